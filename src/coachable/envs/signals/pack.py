"""Signal packs: the signals of robots that many people train, read from their simulators.

A behaviour is about signals, such as `left_knee > 0.3`; a pack defines an environment's signals, in
which unit and with which sign, and reads them. Nothing is read from columns of the observation.

Signs are those of gait analysis: the robot walks in the direction of +x; a hip is positive in flexion, with
the thigh in front; a knee in flexion, with the shank behind; an ankle in dorsiflexion, with the toes up; a
pitch where the torso leans forward. A `…_velocity` is the derivative of the angle, with its sign.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import call
from types import MappingProxyType
from typing import Any

import gymnasium

from coachable.behaviours.predicates import Signal
from coachable.envs.signals import bipedal_walker, mujoco
from coachable.envs.signals.mujoco_probes import MujocoSimulation
from coachable.envs.signals.probes import Probe, Simulation
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion

Reader = Callable[[Any, Mapping[str, Any]], dict[str, float]]
"""From an observation and its info to the signals of this moment, by name."""

RowReader = Callable[[Any, Mapping[str, Any]], tuple[float, ...]]
"""The same, in a row."""


@dataclass(frozen=True)
class SignalPack:
    """The signals of an environment, and how they are read."""

    environment: str
    """The id for `gymnasium.make`."""
    probes: tuple[Probe, ...]
    simulation_of: Callable[[gymnasium.Env], Simulation]

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What can be read, with units, and signs in words."""
        return tuple(probe.signal for probe in self.probes)

    def reader(self, env: gymnasium.Env, names: Iterable[str] | None = None) -> Reader:
        """A function that reads the named signals, or all, of this very environment.

        Names in the simulator are looked up here, once, so that reading is quick. It changes nothing in the
        simulator.

        **Raises:** `ParameterError` for a signal that the pack does not have.
        """
        names = tuple(signal.name for signal in self.signals) if names is None else tuple(names)
        read_row = self.row_reader(env, names)
        return lambda observation, info: dict(zip(names, read_row(observation, info), strict=True))

    def row_reader(self, env: gymnasium.Env, names: Iterable[str]) -> RowReader:
        """The same in a row, in the order of the names, for whoever knows them: that is quicker.

        **Raises:** as `reader`.
        """
        probes = {probe.signal.name: probe for probe in self.probes}
        for name in names:
            if name not in probes:
                raise ParameterError(f"{self.environment} has no signal {name!r}; {suggestion(name, probes)}")
        simulation = self.simulation_of(env)
        readings = [probes[name].of(simulation) for name in names]
        look = simulation.look

        def read(observation: Any, info: Mapping[str, Any]) -> tuple[float, ...]:
            look()
            return tuple(map(call, readings))

        return read

    def read(self, env: gymnasium.Env, observation: Any, info: Mapping[str, Any]) -> dict[str, float]:
        """All signals at this moment; for one that is read at every step `reader` is quicker."""
        return self.reader(env)(observation, info)


SIGNAL_PACKS: Mapping[str, SignalPack] = MappingProxyType(
    {
        environment: SignalPack(environment, probes, simulation_of)
        for environment, probes, simulation_of in (
            ("Walker2d-v5", mujoco.WALKER_2D, MujocoSimulation),
            ("Hopper-v5", mujoco.HOPPER, MujocoSimulation),
            ("HalfCheetah-v5", mujoco.HALF_CHEETAH, MujocoSimulation),
            ("Humanoid-v5", mujoco.HUMANOID, MujocoSimulation),
            (
                "BipedalWalker-v3",
                bipedal_walker.BIPEDAL_WALKER,
                bipedal_walker.BipedalWalkerSimulation,
            ),
        )
    }
)
"""Every pack that ships, by the environment's id."""


def signal_pack(env_or_id: gymnasium.Env | str) -> SignalPack:
    """The pack of an environment, or of its id.

    **Raises:** `ParameterError` if there is none, with the nearest id that has one.
    """
    if isinstance(env_or_id, str):
        name = env_or_id
    else:
        spec = env_or_id.unwrapped.spec
        if spec is None:
            raise ParameterError(
                f"{env_or_id} was not made by gymnasium.make, so it has no id; name the pack by the id itself"
            )
        name = spec.id
    if name not in SIGNAL_PACKS:
        raise ParameterError(
            f"no signal pack for {name!r}; {suggestion(name, SIGNAL_PACKS)}. Signals of another environment "
            "are functions of your own"
        )
    return SIGNAL_PACKS[name]
