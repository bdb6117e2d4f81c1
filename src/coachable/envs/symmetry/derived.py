"""A robot's mirror image as its policy meets it: which observation and which action is whose, with signs.

It is derived from the model (`mujoco_mirror`) and from observations of states and of their images, and
tested against the simulator before anybody uses it. Where the two sides of a model differ, that is named, and
the test is made of a model in which they do not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.signals.pack import environment_name
from coachable.envs.signals.reading import Signals, reader_of_one
from coachable.envs.symmetry.mujoco_mirror import (
    Difference,
    MujocoMirror,
    differences,
    engine,
    equal_sides,
    mirrors_of,
)
from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.foundation.errors import ParameterError, SignalError

NUM_STATES = 200
"""States of short random episodes, whose observations are compared with those of their images."""
STEPS = (1, 10, 100)
"""After so many small steps of the simulator states and their images are compared."""
BOUNDS = (1e-9, 1e-6)
"""How far they may differ after the first two of these; contacts make what comes later chaotic."""
NUM_TESTS = 20
_ALIKE = 1e-6
"""How far observations may differ, as a share of the largest value, and still be each other's image."""


@dataclass(frozen=True)
class RobotMirror:
    """The mirror image of what a policy observes and of what it does."""

    observation: SignedPermutation
    action: SignedPermutation


@dataclass(frozen=True)
class DerivedSymmetry:
    """A robot's mirror image, and what speaks for it."""

    environment: str
    mirror: RobotMirror
    exchanged: tuple[tuple[str, str], ...]
    """Pairs of bodies, by name, that change places."""
    motors: tuple[tuple[str, str], ...]
    """Pairs of motors, the second one with a minus where it turns the other way."""
    differences: tuple[Difference, ...]
    """In what the two sides of the model are not the same."""
    errors: Mapping[int, float]
    """The largest difference between states and images after so many small steps, differences mended."""
    errors_as_it_is: Mapping[int, float]
    """The same of the model as it is."""


def derived_symmetry(
    env: gymnasium.Env, behaviour: Behaviour | None = None, signals: Signals = None
) -> DerivedSymmetry:
    """Derive and test the mirror image of a MuJoCo robot, whose environment is used up.

    **Arguments:** `behaviour`, whose mirror says which signals change places: of several ways in which the
    robot is its own image, the first that does as it says is taken; `signals`, as in `BehaviourReward`.

    **Raises:** `ParameterError` for an environment that is not MuJoCo's, a robot without two sides, a
    component of the observation without a partner, and a mirror image that the simulator contradicts.
    """
    base: Any = env.unwrapped
    name = environment_name(env)
    if not all(hasattr(base, attribute) for attribute in ("model", "data", "set_state", "_get_obs")):
        raise ParameterError(
            f"{name} is no MuJoCo environment of Gymnasium's, so its mirror image cannot be derived; name it "
            "in the plan: [mirror] observation = { swap = [[...]], flip = [...] } and action = { ... }, as "
            "in docs/environments.md"
        )
    candidates = [mirror for mirror in mirrors_of(base.model) if mirror.exchanges]
    if not candidates:
        raise ParameterError(
            f"{name} has no left and right: nothing of it changes places in a mirror between y and −y"
        )
    states = [*_states(env)]
    mirror = _as_described(env, candidates, states, behaviour, signals)
    found = differences(base.model, mirror)
    errors_as_it_is = _errors(base.model, mirror, states)
    equal_sides(base.model, found)
    errors = _errors(base.model, mirror, states)
    for steps, bound in zip(STEPS, BOUNDS, strict=False):
        if errors[steps] > bound:
            raise ParameterError(
                f"the mirror image that was derived for {name} is contradicted by its simulator: after "
                f"{steps} small steps states and their images differ by {errors[steps]:.1e}"
            )
    model = base.model
    return DerivedSymmetry(
        environment=name,
        mirror=RobotMirror(_observation_map(env, mirror, states), mirror.controls),
        exchanged=_exchanged(model, mirror),
        motors=tuple(_motors(model, mirror)),
        differences=found,
        errors=errors,
        errors_as_it_is=errors_as_it_is,
    )


@dataclass(frozen=True)
class _State:
    qpos: np.ndarray
    qvel: np.ndarray
    controls: np.ndarray


def _states(env: gymnasium.Env) -> Iterator[_State]:
    """States of short episodes under random actions, with the controls that come next."""
    rng, base, count = np.random.default_rng(0), _base(env), 0
    low, high = base.model.actuator_ctrlrange.T
    while count < NUM_STATES:
        env.reset(seed=count)
        for _ in range(int(rng.integers(1, 40))):
            controls = rng.uniform(low, high)
            base.do_simulation(controls, base.frame_skip)
            if not np.isfinite(base.data.qpos).all():
                break
        else:
            yield _State(base.data.qpos.copy(), base.data.qvel.copy(), rng.uniform(low, high))
            count += 1


def _as_described(
    env: gymnasium.Env,
    candidates: Sequence[MujocoMirror],
    states: Sequence[_State],
    behaviour: Behaviour | None,
    signals: Signals,
) -> MujocoMirror:
    """The first of the mirrors in which signals change places as the description says."""
    if behaviour is None or behaviour.symmetry is None:
        return candidates[0]
    names = behaviour.signal_names
    # Signals are read from what is observed before it is flattened.
    inner = env.env if isinstance(env, gymnasium.wrappers.FlattenObservation) else env
    read, complaint = reader_of_one(env, names, signals, "outside"), ""
    images = [behaviour.signal_image(name) for name in names]
    sources, signs = [names.index(image) for image, _ in images], np.array([sign for _, sign in images])

    def values(qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
        _place(env, qpos, qvel, np.zeros_like(_base(env).data.ctrl))
        return np.asarray(read(env, _observed(inner), {}, 0), float)

    for mirror in candidates:
        try:
            ours = np.array([values(state.qpos, state.qvel) for state in states[:50]])
            theirs = np.array([values(*mirror.state(state.qpos, state.qvel)) for state in states[:50]])
        except SignalError:
            return mirror  # signals in infos are only there after a step
        apart = np.abs(theirs[:, sources] * signs - ours).max(axis=0)
        apart /= np.maximum(np.abs(ours).max(axis=0), 1)
        if (apart < 1e-3).all():
            return mirror
        worst = int(np.argmax(apart))
        sign = "-" if signs[worst] < 0 else ""
        complaint = complaint or (
            f"in the mirror of behaviour {behaviour.name!r} {names[worst]} becomes "
            f"{sign}{names[sources[worst]]}, but in {environment_name(env)} it does not: bodies that change "
            "places there are " + ", ".join(map(" and ".join, _exchanged(_base(env).model, mirror)))
        )
    raise ParameterError(complaint)


def _observation_map(env: gymnasium.Env, mirror: MujocoMirror, states: Sequence[_State]) -> SignedPermutation:
    """The signed permutation P with obs(image of a state) = P obs(state).

    **Raises:** `ParameterError` naming what is observed and has no partner.
    """
    ours = np.array([_seen(env, state.qpos, state.qvel, state.controls) for state in states])
    theirs = np.array(
        [_seen(env, *mirror.state(s.qpos, s.qvel), mirror.controls(s.controls)) for s in states]
    )
    size = np.maximum(np.abs(ours).max(axis=0), np.abs(theirs).max(axis=0))
    scale = np.maximum(size, 1.0)
    apart = np.array([_apart_with_signs(ours[:, source], theirs) for source in range(ours.shape[1])])
    # Whose image is whose goes both ways, with one sign.
    apart = np.maximum(apart, apart.transpose(2, 1, 0))
    # What is always 0 could be anybody's image, and stays where it is; so does what else is as good there.
    cost = np.maximum(apart.min(axis=1) / scale, _ALIKE) + 1e-9 * (1 - np.eye(len(scale)))
    sources, places = linear_sum_assignment(cost)
    source_of = np.empty(len(places), int)
    source_of[places] = sources
    left_over = [place for place in range(len(places)) if cost[source_of[place], place] > 2 * _ALIKE]
    if left_over:
        raise ParameterError(_unpaired(env, left_over))
    same, turned = apart[source_of, :, np.arange(len(source_of))].T
    signs = np.where(same <= turned, 1, -1)
    return SignedPermutation(tuple(source_of.tolist()), tuple(signs.tolist()))


def _apart_with_signs(
    source: Float[np.ndarray, " states"], theirs: Float[np.ndarray, "states places"]
) -> Float[np.ndarray, "2 places"]:
    """How far a number is at most from each number of the images, with its sign and with the other."""
    return np.stack([np.abs(theirs - sign * source[:, None]).max(axis=0) for sign in (1, -1)])


def _unpaired(env: gymnasium.Env, places: Sequence[int]) -> str:
    """What to say of places in the observation that have no partner."""
    parts = [name for name in dict.fromkeys(_part_of(env, place) for place in places) if name]
    which = f"{', '.join(parts)} (place {', '.join(map(str, places[:8]))}{', …' if len(places) > 8 else ''})"
    switches = [f"include_{part}_in_observation = false" for part in parts if part not in ("qpos", "qvel")]
    hint = f"; leave it out: [env_options] {', '.join(switches)}" if switches else ""
    return f"what {environment_name(env)} observes has no mirror image in {which}{hint}"


def _part_of(env: gymnasium.Env, place: int) -> str:
    """The name that Gymnasium's environments have for a part of their observation."""
    structure, end = getattr(env.unwrapped, "observation_structure", {}), 0
    for name, size in structure.items():
        if not name.startswith("skipped"):
            end += int(size)
            if place < end:
                return name
    return ""


def _seen(env: gymnasium.Env, qpos: np.ndarray, qvel: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """What is observed of a state, with the forces that act in it."""
    _place(env, qpos, qvel, controls)
    return np.asarray(_observed(env), float).ravel()


def _place(env: gymnasium.Env, qpos: np.ndarray, qvel: np.ndarray, controls: np.ndarray) -> None:
    """Put the simulator into a state, whatever it was in before, and work out the forces in it."""
    base = _base(env)
    base.data.ctrl[:], base.data.qacc_warmstart[:] = controls, 0
    base.set_state(qpos, qvel)
    engine().mj_rnePostConstraint(base.model, base.data)


def _observed(env: gymnasium.Env) -> Any:
    """The observation of now, through the wrappers that change it."""
    if isinstance(env, gymnasium.ObservationWrapper):
        return env.observation(_observed(env.env))
    if isinstance(env, gymnasium.Wrapper):
        return _observed(env.env)
    return _base(env)._get_obs()


def _errors(model: Any, mirror: MujocoMirror, states: Sequence[_State]) -> dict[int, float]:
    """How far states and their images are apart after so many small steps, at most."""
    mujoco, rng = engine(), np.random.default_rng(1)
    errors: dict[int, float] = dict.fromkeys(STEPS, 0.0)
    low, high = model.actuator_ctrlrange.T
    for state in states[:NUM_TESTS]:
        ours, theirs = mujoco.MjData(model), mujoco.MjData(model)
        ours.qpos[:], ours.qvel[:] = state.qpos, state.qvel
        theirs.qpos[:], theirs.qvel[:] = mirror.state(state.qpos, state.qvel)
        for step in range(1, STEPS[-1] + 1):
            ours.ctrl[:] = rng.uniform(low, high)
            theirs.ctrl[:] = mirror.controls(ours.ctrl.copy())
            for data in (ours, theirs):
                mujoco.mj_step(model, data)
            if step in errors:
                errors[step] = max(errors[step], _apart(mirror, ours, theirs))
    return errors


def _apart(mirror: MujocoMirror, ours: Any, theirs: Any) -> float:
    qpos, qvel = mirror.state(ours.qpos.copy(), ours.qvel.copy())
    return float(max(np.abs(qpos - theirs.qpos).max(), np.abs(qvel - theirs.qvel).max()))


def _motors(model: Any, mirror: MujocoMirror) -> Iterator[tuple[str, str]]:
    names = [model.actuator(index).name or str(index) for index in range(model.nu)]
    for place, (source, sign) in enumerate(zip(mirror.controls.sources, mirror.controls.signs, strict=True)):
        if source <= place:
            yield names[source], ("-" if sign < 0 else "") + names[place]


def _exchanged(model: Any, mirror: MujocoMirror) -> tuple[tuple[str, str], ...]:
    """The names of bodies that change places, each pair once."""
    pairs = ((body, image) for body, image in enumerate(mirror.bodies) if body < image)
    return tuple((model.body(one).name, model.body(other).name) for one, other in pairs)


def _base(env: gymnasium.Env) -> Any:
    return env.unwrapped
