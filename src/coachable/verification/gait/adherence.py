"""Does the robot do what was described? Its phases, edges and cycles, and what it does beside them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from coachable.automata.monitor import Monitor
from coachable.behaviours.behaviour import Behaviour
from coachable.experiments.recorded_episodes import RecordedWalk
from coachable.plants.plant import Plant
from coachable.verification.gait.walk import SampledWalk
from coachable.verification.proportion import Proportion


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
    """A walk, or several, against the behaviour that was to be followed, sample by sample."""

    behaviour: str
    seconds: float
    """How long the walk was, or all of them together [s]."""
    up: bool
    """Whether the robot was still up at the end; of several walks, of each."""
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
    episodes: Proportion | None = None
    """In a Gymnasium environment: the walks, and how many of them did not terminate."""

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
    return _monitored(behaviour, [(walk.time[new], columns)], walk.seconds, walk.up)


def adherence_in_episodes(behaviour: Behaviour, walks: Sequence[RecordedWalk]) -> Adherence:
    """Monitor each of several episodes from its start on, and count what all of them did."""
    up = Proportion(sum(not walk.fell for walk in walks), len(walks))
    return _monitored(
        behaviour,
        [(walk.time, walk.trace.values) for walk in walks],
        seconds=sum(float(walk.time[-1]) for walk in walks),
        up=up.count == up.total,
        episodes=up,
    )


def _monitored(
    behaviour: Behaviour,
    traces: Sequence[tuple[np.ndarray, Mapping[str, np.ndarray]]],
    seconds: float,
    up: bool,
    episodes: Proportion | None = None,
) -> Adherence:
    """The adherence of traces, each the times and the signals of a walk."""
    samples, moves = 0, Counter[tuple[str | None, str | None]]()
    samples_in, violations = Counter[str](), Counter[str]()
    completed = np.zeros(len(behaviour.cycles), int)
    explained: dict[str, str] = {}
    for time, columns in traces:
        monitor = Monitor(behaviour)
        locations, found = monitor.feed_rows(time, columns)
        report = monitor.report()
        samples += report.samples
        samples_in.update(report.samples_in)
        violations.update({kind.value: count for kind, count in report.violations.items()})
        completed += report.cycles
        moves.update(_moves(behaviour, locations))
        for violation in found:
            explained.setdefault(violation.kind.value, violation.sentence)
    return Adherence(
        behaviour=behaviour.name,
        seconds=seconds,
        up=up,
        share_in_phases=samples_in.total() / samples,
        phases={name: samples_in[name] / samples for name in behaviour.phase_names},
        transitions=_transitions(behaviour, moves),
        cycles={
            " → ".join([*(edge.source for edge in cycle), cycle[0].source]): count
            for cycle, count in zip(behaviour.cycles, completed.tolist(), strict=True)
        },
        violations=dict(violations),
        explained=tuple(explained[kind] for kind in violations),
        episodes=episodes,
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


def _moves(behaviour: Behaviour, locations: np.ndarray) -> dict[tuple[str | None, str | None], int]:
    """How often a walk moved from one location to another."""
    names = (*behaviour.phase_names, None)
    moved = locations[1:] != locations[:-1]
    pairs, counts = np.unique(
        np.stack([locations[:-1][moved], locations[1:][moved]], axis=-1), axis=0, return_counts=True
    )
    return {
        (names[one], names[other]): int(count)
        for (one, other), count in zip(pairs.tolist(), counts, strict=True)
    }


def _transitions(
    behaviour: Behaviour, counted: Mapping[tuple[str | None, str | None], int]
) -> tuple[Transition, ...]:
    edges = list(dict.fromkeys((edge.source, edge.target) for edge in behaviour.edges))
    others = sorted(counted.keys() - set(edges), key=lambda pair: (-counted[pair], str(pair)))
    return (
        *(Transition(*pair, count=counted.get(pair, 0), described=True) for pair in edges),
        *(Transition(*pair, count=counted[pair], described=False) for pair in others),
    )
