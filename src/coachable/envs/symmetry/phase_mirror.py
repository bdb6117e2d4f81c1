"""Phase-based mirroring: one policy for both sides.

While the expected phase lies in the half of a description that its mirror added, the policy observes the
mirror image of what there is, and its action is mirrored back. Source: Abdolhosseini, Ling, Xie, Peng and van
de Panne, *On learning symmetric locomotion* (MIG 2019), method PHASE.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Bool, Float, Int

from coachable.behaviours.behaviour import Behaviour
from coachable.envs.symmetry.derived import RobotMirror
from coachable.envs.symmetry.signed_permutation import SignedPermutation
from coachable.rewards.forms.form import entry

EXPECTED_PHASE = "expected_phase"
"""The attribute of an environment that says which phase is expected now."""


@dataclass(frozen=True)
class PhaseMirror:
    """What a policy observes and does, mirrored or not, by the expected phase."""

    observation: SignedPermutation
    """Of all that the policy observes, memory included."""
    action: SignedPermutation
    phases: tuple[bool, ...]
    """Whether each phase lies in the mirrored half; the last one is that of none."""

    @staticmethod
    def of(
        robot: RobotMirror, behaviour: Behaviour, observed: tuple[str, ...] = (), place: int | None = None
    ) -> PhaseMirror:
        """The mirror of a robot's policy.

        **Arguments:** `observed`, the names of the numbers of the memory; `place`, where among the robot's
        own they begin, by default behind them.
        """
        names = behaviour.phase_names
        images = {name: names[image] for name, image in zip(names, behaviour.phase_images, strict=True)}
        memory = SignedPermutation(
            tuple(observed.index(_image(name, images)) for name in observed), (1,) * len(observed)
        )
        own = robot.observation
        return PhaseMirror(
            own.around(memory, len(own.sources) if place is None else place),
            robot.action,
            (*behaviour.mirrored_phases, False),
        )

    def observed(self, observation: Float[Any, " numbers"], phase: int) -> Float[Any, " numbers"]:
        """What the policy is given for an observation while a phase is expected."""
        return self.observation(observation) if self.phases[phase] else observation

    def done(self, action: Float[Any, " controls"], phase: int) -> Float[Any, " controls"]:
        """What is done when the policy says so while a phase is expected."""
        return self.action(action) if self.phases[phase] else action

    def is_mirrored(self, phase: Int[Any, "*batch"]) -> Bool[Any, "*batch"]:
        """Whether the policy is mirrored while phases are expected, in any array library."""
        return entry(np.array(self.phases), phase)

    def to_data(self) -> dict[str, Any]:
        """The mirror in values that JSON has."""
        return {
            "observation": {"sources": self.observation.sources, "signs": self.observation.signs},
            "action": {"sources": self.action.sources, "signs": self.action.signs},
            "mirrored_phases": self.phases,
        }

    @staticmethod
    def from_json(text: str) -> PhaseMirror | None:
        """The mirror of a policy's description; `None` for one without."""
        if not text:
            return None
        data = json.loads(text)
        observation, action = (_permutation(data[name]) for name in ("observation", "action"))
        return PhaseMirror(observation, action, tuple(map(bool, data["mirrored_phases"])))


class MirroredEnv(gymnasium.Wrapper):
    """An environment as a policy that is mirrored by phase meets it, for training.

    **Arguments:** `env`, a described environment, whose `expected_phase` is asked for after every step.
    """

    def __init__(self, env: gymnasium.Env, mirror: PhaseMirror):
        super().__init__(env)
        self.mirror = mirror
        self._phase = -1

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._observed(observation), info

    def step(self, action: np.ndarray) -> Any:
        """One step, by the phase that was expected before it."""
        done = self.mirror.done(np.asarray(action), self._phase)
        observation, *rest = self.env.step(done)
        return self._observed(observation), *rest

    @property
    def is_mirrored(self) -> bool:
        """Whether the policy is mirrored in the next step."""
        return self.mirror.phases[self._phase]

    def expect(self, phase: int) -> None:
        """Be mirrored as it is while this phase is expected."""
        self._phase = phase

    def _observed(self, observation: np.ndarray) -> np.ndarray:
        self.expect(self.env.get_wrapper_attr(EXPECTED_PHASE))
        return self.mirror.observed(observation, self._phase)


def _image(name: str, images: Mapping[str, str]) -> str:
    """The name of the number that is a number's image: that of a phase is that of the phase's."""
    for phase, image in images.items():
        if name == phase or name.endswith(f" {phase}"):
            return name.removesuffix(phase) + image
    return name


def _permutation(data: Mapping[str, Any]) -> SignedPermutation:
    return SignedPermutation(tuple(map(int, data["sources"])), tuple(map(int, data["signs"])))
