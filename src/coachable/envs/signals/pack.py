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
from coachable.envs.signals.probes import Probe, Reading, Simulation
from coachable.foundation.errors import ParameterError
from coachable.foundation.suggestion import suggestion

Reader = Callable[[Any, Mapping[str, Any]], dict[str, float]]
"""From an observation and its info to the signals of this moment, by name."""


@dataclass(frozen=True)
class SignalPack:
    """The signals of an environment, and how they are read."""

    environment: str
    """The id for `gymnasium.make`."""
    probes: tuple[Probe, ...]
    simulation_of: Callable[[gymnasium.Env], Simulation]

    def __reduce__(self) -> Any:
        # Probes are functions within functions, which cannot be pickled; those that ship have a name.
        shipped = SIGNAL_PACKS.get(self.environment) is self
        return (signal_pack, (self.environment,)) if shipped else object.__reduce_ex__(self, 2)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What can be read, with units, and signs in words."""
        return tuple(probe.signal for probe in self.probes)

    def reader(self, env: gymnasium.Env, names: Iterable[str] | None = None) -> Reader:
        """A function that reads the named signals, or all, of this very environment.

        It changes nothing in the simulator, and reads whichever model the environment has at that moment.

        **Raises:** `ParameterError` for a signal that the pack does not have, or the environment's model.
        """
        names = tuple(signal.name for signal in self.signals) if names is None else tuple(names)
        read_row = self.row_reader(names)
        read_row.look_up(env)
        return lambda observation, info: dict(zip(names, read_row(env), strict=True))

    def row_reader(self, names: Iterable[str]) -> RowReader:
        """What reads them in a row, in the order of the names, of whichever environment it is given.

        **Raises:** `ParameterError` for a signal that the pack does not have.
        """
        names, known = tuple(names), [signal.name for signal in self.signals]
        for name in names:
            if name not in known:
                raise ParameterError(f"{self.environment} has no signal {name!r}; {suggestion(name, known)}")
        return RowReader(self, names)

    def read(self, env: gymnasium.Env, observation: Any, info: Mapping[str, Any]) -> dict[str, float]:
        """All signals at this moment; for one that is read at every step `reader` is quicker."""
        return self.reader(env)(observation, info)


class RowReader:
    """Reads named signals of a pack. Copied or pickled, it takes nothing of a simulator with it.

    Names in the simulator are looked up once, so that reading is quick, and again when the environment has
    got another model.

    **Raises:** when names are looked up, `ParameterError` for a signal that the environment's model lacks.
    """

    def __init__(self, pack: SignalPack, names: tuple[str, ...]):
        self._pack, self._names = pack, names
        self._simulation: Simulation | None = None
        self._readings: tuple[Reading, ...] = ()

    def __call__(self, env: gymnasium.Env) -> tuple[float, ...]:
        """The signals at this moment."""
        simulation = self._simulation
        if simulation is None or not simulation.is_of(env):
            simulation = self.look_up(env)
        simulation.look()
        return tuple(map(call, self._readings))

    def __reduce__(self):
        return RowReader, (self._pack, self._names)

    def look_up(self, env: gymnasium.Env) -> Simulation:
        """Find the names in the environment's simulator, as the next reading would."""
        pack = self._pack
        try:
            simulation = pack.simulation_of(env)
        except AttributeError as error:
            raise ParameterError(
                f"the signals of {pack.environment} cannot be read of {environment_name(env)}: {error}"
            ) from None
        probes = {probe.signal.name: probe for probe in pack.probes}
        readings = []
        for name in self._names:
            try:
                readings.append(probes[name].of(simulation))
            except (KeyError, AttributeError) as error:
                raise ParameterError(
                    f"the signal {name!r} of {pack.environment} cannot be read of {environment_name(env)}: "
                    f"{error.args[0]}"
                ) from None
        self._simulation, self._readings = simulation, tuple(readings)
        return simulation


def environment_name(env: Any) -> str:
    """What messages call an environment: its id, or its class."""
    spec = env.unwrapped.spec
    return type(env.unwrapped).__name__ if spec is None else spec.id


SIGNAL_PACKS: Mapping[str, SignalPack] = MappingProxyType(
    {
        environment: SignalPack(environment, probes, simulation_of)
        for environment, probes, simulation_of in (
            ("Walker2d-v5", mujoco.WALKER_2D, MujocoSimulation),
            ("Hopper-v5", mujoco.HOPPER, MujocoSimulation),
            ("HalfCheetah-v5", mujoco.HALF_CHEETAH, MujocoSimulation),
            ("Humanoid-v5", mujoco.HUMANOID, MujocoSimulation),
            ("Ant-v5", mujoco.ANT, MujocoSimulation),
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
