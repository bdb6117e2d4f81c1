"""How two descriptions differ in meaning: what they call a state, what they pay, what they demand."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from coachable.behaviours.behaviour import Behaviour, Dwell, Edge
from coachable.behaviours.checking.comparison import always_equal, disagreements, staying_differs
from coachable.behaviours.checking.units import exact_factor
from coachable.behaviours.expressions import Number, Variable
from coachable.behaviours.predicates import Between, Comparison, Predicate, Signal
from coachable.behaviours.tree import walk
from coachable.rewards.forms import reward_table


@dataclass(frozen=True)
class Difference:
    """One thing in which two descriptions differ.

    `about` is what it concerns: signals, phases, outside, reward, dwell, deadband, cycles, events or names.
    `state` is one in which they disagree. Names alone do not matter to the meaning.
    """

    about: str
    sentence: str
    state: Mapping[str, float] | None = None

    @property
    def matters(self) -> bool:
        """Whether it is a difference in meaning."""
        return self.about != "names"


def differences(first: Behaviour, second: Behaviour) -> tuple[Difference, ...]:
    """Everything in which the second description differs from the first, what concerns most of it first.

    Phases are compared by their place in the order, which is what the reward sees of them. For every pair of
    different phases that the two give to the same state there is such a state, found with Z3 and confirmed in
    floating point.
    """
    names = _Names(first, second)
    return (
        *_signals(first, second),
        *_phases(first, second, names),
        *_reward(first, second, names),
        *_dwells(first, second, names),
        *_deadbands(first, second, names),
        *_events(first, second, names),
        *_cycles(first, second, names),
        *_renamed(first, second),
    )


def as_text(found: Sequence[Difference], signals: Iterable[Signal]) -> str:
    """The differences for people, one a line, each state below its sentence in the signals' units."""
    units = {signal.name: f" {signal.unit}" if signal.unit else "" for signal in signals}
    lines = []
    if not any(difference.about in ("signals", "phases") for difference in found):
        lines.append("The same phases everywhere.")
    for difference in found:
        lines.append(difference.sentence)
        if difference.state is not None:
            values = (f"{name} = {_short(value)}{units[name]}" for name, value in difference.state.items())
            lines.append(f"  {', '.join(values)}")
    if not any(difference.matters for difference in found):
        lines.append("They mean the same.")
    return "\n".join(lines)


def _short(value: float) -> str:
    return repr(value).removesuffix(".0")


def as_json(found: Sequence[Difference]) -> str:
    """The differences for programs."""
    listed = [
        {"about": one.about, "sentence": one.sentence, "matters": one.matters, "state": one.state}
        for one in found
    ]
    same = not any(difference.matters for difference in found)
    return json.dumps({"same_meaning": same, "differences": listed}, indent=2, ensure_ascii=False)


@dataclass(frozen=True)
class _Names:
    """What to call a place in the order of the phases, so that readers of both descriptions know it."""

    first: Behaviour
    second: Behaviour

    def __call__(self, index: int | None) -> str:
        if index is None:
            return "outside"
        names = [b.phase_names[index] for b in (self.first, self.second) if index < len(b.phases)]
        return "/".join(dict.fromkeys(names))


def _signals(first: Behaviour, second: Behaviour) -> Iterator[Difference]:
    ours, theirs = ({signal.name: signal for signal in b.signals} for b in (first, second))
    for name in [name for name in ours if name not in theirs]:
        yield Difference("signals", f"Only the first has the signal {name}.")
    for name in [name for name in theirs if name not in ours]:
        yield Difference("signals", f"Only the second has the signal {name}.")
    for name in [name for name in ours if name in theirs]:
        one, other = ours[name], theirs[name]
        if one.unit != other.unit and exact_factor(one.unit, other.unit) != 1:
            units = f"{one.unit or 'no unit'} in the first and {other.unit or 'no unit'} in the second"
            yield Difference("signals", f"{name} has {units}.")
        if one.derivative_of != other.derivative_of:
            kinds = [
                f"the derivative of {s.derivative_of}" if s.derivative_of else "none" for s in (one, other)
            ]
            yield Difference("signals", f"{name} is declared a derivative: {kinds[0]}, against {kinds[1]}.")


def _phases(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    ours, theirs = len(first.phases), len(second.phases)
    if ours != theirs:
        yield Difference("phases", f"The first has {ours} phases, the second {theirs}.")
    for found in disagreements(first, second):
        verb = "is" if found.state else "may be (Z3 found no certain answer)"
        places = f"{names(found.first)} in the first and {names(found.second)} in the second"
        yield Difference("phases", f"A state {verb} {places}.", found.state)
    if (first.outside is None) != (second.outside is None):
        which = "first" if second.outside is None else "second"
        yield Difference("outside", f"Only the {which} means states outside all phases to be possible.")


def _reward(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    shared = min(len(first.phases), len(second.phases))
    ours, theirs = reward_table(first, "stay"), reward_table(second, "stay")
    for p, c in product(range(shared), repeat=2):
        if ours[p, c] != theirs[p, c]:
            pays = f"{ours[p, c]:+d} in the first and {theirs[p, c]:+d} in the second"
            yield Difference("reward", f"Going from {names(p)} to {names(c)} pays {pays}.")


def _dwells(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    for index, (one, other) in enumerate(zip(first.phases, second.phases, strict=False)):
        ours, theirs = (phase.dwell or Dwell() for phase in (one, other))
        if ours != theirs:
            lengths = f"{_duration(ours)} in the first and {_duration(theirs)} in the second"
            yield Difference("dwell", f"{names(index)} lasts {lengths}.")


def _duration(dwell: Dwell) -> str:
    if dwell == Dwell():
        return "as long as it likes"
    if math.isinf(dwell.at_most):
        return f"at least {dwell.at_least:g} s"
    return (
        f"{dwell.at_least:g} s to {dwell.at_most:g} s" if dwell.at_least else f"at most {dwell.at_most:g} s"
    )


def _deadbands(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    for index, (one, other) in enumerate(zip(first.phases, second.phases, strict=False)):
        bands = [_bands(phase.predicate) for phase in (one, other)]
        if bands[0] == bands[1]:
            continue
        answer = staying_differs(one.predicate, other.predicate)
        if answer.state is not None or not answer.decided:
            bands = " and ".join(
                f"{', '.join(map(str, band)) or 'none'} in the {which}"
                for band, which in zip(bands, ("first", "second"), strict=True)
            )
            sentence = f"What keeps a state in {names(index)} differs: deadbands {bands}."
            yield Difference("deadband", sentence, answer.state)


def _events(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    ours, theirs = _by_ends(first), _by_ends(second)
    for ends in [ends for ends in ours if ends in theirs]:
        one, other = ours[ends], theirs[ends]
        if _same_jumps(one, other):
            continue
        jumps = f"{_jumps(one)} in the first and {_jumps(other)} in the second"
        yield Difference("events", f"{names(ends[0])} → {names(ends[1])} happens {jumps}.")


def _by_ends(behaviour: Behaviour) -> dict[tuple[int, int], list[Edge]]:
    grouped: dict[tuple[int, int], list[Edge]] = {}
    for edge in behaviour.edges:
        grouped.setdefault(_ends(edge, behaviour), []).append(edge)
    return grouped


def _ends(edge: Edge, behaviour: Behaviour) -> tuple[int, int]:
    source, target = (behaviour.phase_names.index(name) for name in (edge.source, edge.target))
    return source, target


def _same_jumps(ours: list[Edge], theirs: list[Edge]) -> bool:
    """Whether each edge of one side has one of the other side that does the same."""
    left = list(theirs)
    for edge in ours:
        twin = next((other for other in left if _same_jump(edge, other)), None)
        if twin is None:
            return False
        left.remove(twin)
    return not left


def _same_jump(edge: Edge, other: Edge) -> bool:
    sets = [{jump.signal: jump.expression for jump in one.reset} for one in (edge, other)]
    return edge.event == other.event and all(
        always_equal(*(assigned.get(name, Variable(name)) for assigned in sets))
        for name in sets[0].keys() | sets[1].keys()
    )


def _jumps(edges: list[Edge]) -> str:
    ways = []
    for edge in edges:
        event = f"on {edge.event}" if edge.event is not None else "without an event"
        ways.append(event + (f" with {', '.join(map(str, edge.reset))}" if edge.reset else ""))
    return " or ".join(ways)


def _cycles(first: Behaviour, second: Behaviour, names: _Names) -> Iterator[Difference]:
    ours, theirs = ({_walk(cycle, b) for cycle in b.cycles} for b in (first, second))
    for which, extra in (("first", ours - theirs), ("second", theirs - ours)):
        for cycle in sorted(extra):
            way = " → ".join(names(index) for index in (*(p for p, _ in cycle), cycle[0][0]))
            yield Difference("cycles", f"Only the {which} counts the cycle {way}.")


def _walk(cycle: tuple[Edge, ...], behaviour: Behaviour) -> tuple[tuple[int, str], ...]:
    """The places a cycle goes through and the events on its way, begun where that sorts first."""
    steps = [(_ends(edge, behaviour)[0], edge.event or "") for edge in cycle]
    return min(tuple(steps[start:] + steps[:start]) for start in range(len(steps)))


def _renamed(first: Behaviour, second: Behaviour) -> Iterator[Difference]:
    for one, other in zip(first.phases, second.phases, strict=False):
        if one.name != other.name:
            yield Difference("names", f"What the first calls {one.name}, the second calls {other.name}.")
        elif one.title != other.title:
            yield Difference(
                "names", f"{one.name} is “{one.title}” in the first, “{other.title}” in the second."
            )
    if first.outside != second.outside and None not in (first.outside, second.outside):
        yield Difference(
            "names", f"Outside is “{first.outside}” in the first, “{second.outside}” in the second."
        )


def _bands(predicate: Predicate) -> tuple[Number, ...]:
    compared = walk(predicate, Comparison, Between)
    return tuple(part.deadband for part in compared if part.deadband is not None)
