"""Does the plant do what was described? Its phases, edges and cycles, and what it does beside them."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from coachable.automata.monitor import Monitor
from coachable.behaviours.behaviour import Behaviour
from coachable.plants.plant import Plant
from coachable.verification.gait.walk import SampledWalk


@dataclass(frozen=True)
class Transition:
    """How often the walk went from one location to another; `None` is outside all phases."""

    source: str | None
    target: str | None
    count: int
    described: bool
    """Whether it is an edge of the behaviour."""


@dataclass(frozen=True)
class Adherence:
    """A walk against the behaviour that it was to follow, sample by sample."""

    behaviour: str
    seconds: float
    """How long the walk was [s]."""
    up: bool
    """Whether the plant was still up at its end."""
    share_in_phases: float
    """Share of the samples that were in a phase."""
    phases: Mapping[str, float]
    """Share of the samples in each phase."""
    transitions: tuple[Transition, ...]
    """The behaviour's edges first, taken or not, then all others, most frequent first."""
    cycles: Mapping[str, int]
    """How often each of the behaviour's cycles was completed."""
    violations: Mapping[str, int]
    """How many of each kind."""
    explained: tuple[str, ...]
    """The first violation of each kind in a sentence."""

    @property
    def follows(self) -> bool:
        """Whether there was no violation."""
        return not self.violations


def adherence(behaviour: Behaviour, plant: Plant, walk: SampledWalk) -> Adherence:
    """Monitor a walk as `coachable explain` monitors a recorded trace.

    **Raises:** `ParameterError` for a behaviour with a signal that the plant does not have.
    """
    new = np.concatenate([[True], np.diff(walk.time) > 0])  # a touchdown may fall on a sample
    columns = _signals(behaviour, plant, walk.x[new])
    monitor = Monitor(behaviour)
    locations, violations = monitor.feed_rows(walk.time[new], columns)
    report = monitor.report()
    first = {violation.kind: violation for violation in reversed(violations)}
    return Adherence(
        behaviour=behaviour.name,
        seconds=walk.seconds,
        up=walk.up,
        share_in_phases=report.share_in_cycle or 0.0,
        phases={name: count / report.samples for name, count in report.samples_in.items()},
        transitions=_transitions(behaviour, locations),
        cycles={
            " → ".join([*(edge.source for edge in cycle), cycle[0].source]): count
            for cycle, count in zip(behaviour.cycles, report.cycles, strict=True)
        },
        violations={kind.value: count for kind, count in report.violations.items()},
        explained=tuple(first[kind].sentence for kind in report.violations),
    )


def _signals(behaviour: Behaviour, plant: Plant, x: np.ndarray) -> dict[str, np.ndarray]:
    """The coordinates of the state, and whatever else the behaviour's phases are written in."""
    columns: dict[str, np.ndarray] = dict(zip(plant.state_names, x.T, strict=True))
    others = tuple(name for name in behaviour.signal_names if name not in columns)
    if others:
        with jax.enable_x64(True):
            values = jax.vmap(lambda x: plant.signals(x, others))(jnp.asarray(x))
        columns |= dict(zip(others, np.asarray(values).T, strict=True))
    return columns


def _transitions(behaviour: Behaviour, locations: np.ndarray) -> tuple[Transition, ...]:
    names = (*behaviour.phase_names, None)
    edges = list(dict.fromkeys((edge.source, edge.target) for edge in behaviour.edges))
    moved = locations[1:] != locations[:-1]
    pairs, counts = np.unique(
        np.stack([locations[:-1][moved], locations[1:][moved]], axis=-1), axis=0, return_counts=True
    )
    counted = {
        (names[one], names[other]): int(count)
        for (one, other), count in zip(pairs.tolist(), counts, strict=True)
    }
    others = sorted(counted.keys() - set(edges), key=lambda pair: (-counted[pair], str(pair)))
    return (
        *(Transition(*pair, count=counted.get(pair, 0), described=True) for pair in edges),
        *(Transition(*pair, count=counted[pair], described=False) for pair in others),
    )
