"""How much a policy in a Gymnasium environment withstands: pushes of its actions, kicks, late actions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coachable.verification.proportion import Proportion
from coachable.verification.robustness.disturbed_episode import EpisodeDisturbance, EpisodeLoop
from coachable.verification.robustness.pushes import ENOUGH, SECONDS, Pushes, Survival, Tolerance

NUM_EPISODES = 24
"""Of each size of each push: episode i has the i-th start of the evaluations, moment and direction."""

AMOUNTS = (0.25, 0.5, 1.0, 2.0)
"""Of the largest coordinate. Two halves of its range carry an action from one bound to the other."""

PUSH_SECONDS = 0.2
"""How long the actions are pushed."""

Draw = Callable[[int, float], EpisodeDisturbance]
"""From the number of an episode and an amount to the disturbance."""


def episode_pushes(loop: EpisodeLoop, progress: Callable[[float], None] = lambda share: None) -> Pushes:
    """The share of episodes that is survived with each push, and up to which size `ENOUGH` of them are.

    A push adds a constant to the actions for `PUSH_SECONDS`; a kick, of MuJoCo's robots alone, changes all
    velocities at once. Its moment is drawn evenly from the first half of an episode, its direction from the
    cube, scaled so that the largest coordinate is the amount; both are the same for every amount. An
    environment's own limit of time ends an episode sooner, as a survived one.

    **Arguments:** `progress`, called with the share of the work that was done since the last call.
    """
    kinds: list[tuple[str, str, Draw]] = [
        (f"push of the actions for {PUSH_SECONDS:g} s", "half ranges", _pushes(loop))
    ]
    if loop.num_velocities:
        kinds.append(("kick of the velocities", "m/s, rad/s", _kicks(loop)))
    each = 1 / (2 + len(kinds) * len(AMOUNTS))

    def survival(what: str, amount: float, unit: str, draw: Draw) -> Survival:
        ends = [loop.run(number, draw(number, amount), SECONDS) for number in range(NUM_EPISODES)]
        progress(each)
        return Survival(what, amount, unit, Proportion(sum(not end.fell for end in ends), len(ends)))

    undisturbed = survival("undisturbed", 0.0, "", lambda *_: EpisodeDisturbance())
    late = survival("actions one step late", 1.0, "step", lambda *_: EpisodeDisturbance(delay=True))
    pushed = [[survival(what, amount, unit, draw) for amount in AMOUNTS] for what, unit, draw in kinds]
    return Pushes(
        tolerances=tuple(_tolerance([undisturbed, *ladder]) for ladder in pushed),
        delay_survived=late.up.share >= ENOUGH,
        survival=(undisturbed, *(one for ladder in pushed for one in ladder), late),
    )


def _tolerance(ladder: list[Survival]) -> Tolerance:
    """The greatest amount that enough episodes survive, and all smaller ones."""
    amount = 0.0
    for one in ladder:
        if one.up.share < ENOUGH:
            break
        amount = one.amount
    return Tolerance(ladder[-1].what, amount, ladder[-1].amount, ladder[-1].unit)


def _pushes(loop: EpisodeLoop) -> Draw:
    steps = loop.num_steps(PUSH_SECONDS)

    def draw(number: int, amount: float) -> EpisodeDisturbance:
        begin, direction = _drawn(loop, 0, number, loop.num_actions)
        return EpisodeDisturbance(begin, push=np.tile(amount * direction, (steps, 1)))

    return draw


def _kicks(loop: EpisodeLoop) -> Draw:
    def draw(number: int, amount: float) -> EpisodeDisturbance:
        begin, direction = _drawn(loop, 1, number, loop.num_velocities)
        return EpisodeDisturbance(begin, kick=amount * direction)

    return draw


def _drawn(loop: EpisodeLoop, kind: int, number: int, size: int) -> tuple[int, np.ndarray]:
    """A moment, and a direction whose largest coordinate is 1."""
    generator = np.random.default_rng((kind, number))
    begin = int(generator.integers(-(-loop.num_steps(SECONDS) // 2)))
    direction = generator.uniform(-1, 1, size)
    return begin, direction / np.max(np.abs(direction))
