"""Questions about sines and cosines of sums of angles, decided by interval branch and bound.

A conjunction of comparisons is brought into signs of polynomials in angles, sines and cosines. All states
that matter are in a box, for sines are periodic; the box is bisected until a point of it is certain to meet
every sign, or no part of it can. Intervals are rounded outward by crival, so both are proofs. Where one
polynomial must be zero, two corners of a box in which the rest holds, with different signs, show that it is
somewhere. What is too close to call within the effort is left open.
"""

# crival has no types of its own, and its intervals hold floats or arrays.
# pyright: reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false, reportReturnType=false
from __future__ import annotations

import itertools
import math
import typing
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.util import find_spec

import numpy as np

from coachable.behaviours.checking.solver.corners import without_corners
from coachable.behaviours.checking.solver.waves import Atom, BeyondReach, polynomial
from coachable.behaviours.expressions import Arithmetic
from coachable.behaviours.predicates import All, Any, Comparison, Predicate, holds
from coachable.behaviours.rewriting import expanded, without_negations
from coachable.behaviours.tree import walk

if typing.TYPE_CHECKING:
    from ival import Interval

Signs = frozenset[int]

_SIGNS = {">": {1}, ">=": {0, 1}, "<": {-1}, "<=": {-1, 0}}
_MOST_TERMS, _SAMPLES, _MOST_BOXES, _ROUNDS = 64, 4096, 40_000, 60
_TURN = Fraction(6283185308, 10**9)
"""A little more than 2π."""

Decision = Mapping[str, float] | bool | None
"""A state; True if there is one whose numbers are no floats; False if there is none; None if that is open."""


def decide(signals: Sequence[str], predicates: Sequence[Predicate]) -> Decision:
    """A state in which predicates hold together; see `Decision`. Without crival everything is open."""
    if find_spec("ival") is None:
        return None
    try:
        if (state := _drawn(signals, predicates)) is not None:
            return state
        terms = list(itertools.islice(_terms(All(*predicates)), _MOST_TERMS + 1))
        if len(terms) > _MOST_TERMS:
            return None
        systems = [system for term in terms if (system := _system(term)) is not None]
    except BeyondReach:
        return None
    answers: list[Decision] = []
    for system in systems:
        answer = _sampled(system, signals, predicates)
        if answer is not None:
            return answer
    for system in systems:
        answer = False if _out_of_reach(system) else _branched(system, signals, predicates)
        answers.append(_climbed(system, signals, predicates) if answer is None else answer)
        if answers[-1] not in (None, False):
            return answers[-1]
    return False if all(answer is False for answer in answers) else None


def _terms(predicate: Predicate) -> Iterator[tuple[Comparison, ...]]:
    def few(part: Predicate) -> list[tuple[Comparison, ...]]:
        found = list(itertools.islice(of(part), _MOST_TERMS + 1))
        if len(found) > _MOST_TERMS:
            raise BeyondReach
        return found

    def of(part: Predicate) -> Iterator[tuple[Comparison, ...]]:
        match part:
            case Comparison():
                yield (part,)
            case All(parts=parts):
                for chosen in itertools.product(*map(few, parts)):
                    yield tuple(itertools.chain(*chosen))
            case Any(parts=parts):
                for one in parts:
                    yield from of(one)

    return of(without_negations(without_corners(expanded(predicate))))


def _drawn(signals: Sequence[str], predicates: Sequence[Predicate]) -> Mapping[str, float] | None:
    """A state among short numbers drawn at random, where there is much room; whatever the form."""
    plain, keys = _comparisons(predicates)
    random = np.random.default_rng(0)
    points = random.uniform(-math.pi, math.pi, (len(signals), _SAMPLES)).round(1)
    values = dict(zip(signals, points, strict=True))
    with np.errstate(all="ignore"):
        inside = np.broadcast_to(np.asarray(holds(plain, values, np)), _SAMPLES)
    points = points[:, np.flatnonzero(inside)[:64]]
    for point in points.T:
        state = dict(zip(signals, point.tolist(), strict=True))
        if _clear(keys, state) and all(holds(one, state) for one in predicates):
            return state
    return None


def by_a_hair(predicate: Predicate, state: Mapping[str, float]) -> bool:
    """Whether a comparison of sines in it is so close to equality in a state that floats may be wrong.

    Without crival, and for what is not decided here, that is not known, and False.
    """
    if find_spec("ival") is None:
        return False
    try:
        _, keys = _comparisons([predicate])
    except BeyondReach:
        return False
    waves = [key for key in keys if any(kind != "var" for powers, _ in key for kind, *_ in powers)]
    return not _clear(waves, state)


_Key = tuple[tuple[tuple[Atom, ...], Fraction], ...]
"""A polynomial that can be looked up."""


def _comparisons(predicates: Sequence[Predicate]) -> tuple[Predicate, list[_Key]]:
    """All predicates together, and the difference of both sides of each comparison in them."""
    plain = All(*(without_negations(without_corners(expanded(one))) for one in predicates))
    comparisons = tuple(dict.fromkeys(walk(plain, Comparison)))
    return plain, [tuple(polynomial(Arithmetic(one.left, "-", one.right)).items()) for one in comparisons]


def _clear(keys: Sequence[_Key], state: Mapping[str, float]) -> bool:
    """Whether no polynomial is near zero in a state: floats err by less, so its sign is as they have it."""
    whole = dict.fromkeys(state, (Fraction(0), Fraction(0)))
    point = np.array([*state.values()])[:, None]
    enclosures = _enclosures(_System(dict.fromkeys(keys, frozenset()), whole, True), point, point)
    return all(value.lo[0] > 1e-9 or value.hi[0] < -1e-9 for value in enclosures)


@dataclass(frozen=True)
class _System:
    """The signs that polynomials must have, and the box in which that is decided."""

    signs: Mapping[tuple[tuple[tuple[Atom, ...], Fraction], ...], Signs]
    box: Mapping[str, tuple[Fraction, Fraction]]
    bounded: bool
    """Whether every state that matters has its equal in the box."""


def _system(term: Sequence[Comparison]) -> _System | None:
    """`None` if some polynomial can have no sign."""
    signs: dict[tuple, Signs] = {}
    for comparison in term:
        difference = polynomial(Arithmetic(comparison.left, "-", comparison.right))
        allowed = frozenset(_SIGNS[comparison.relation])
        if not set(difference) - {()}:
            number = difference.get((), Fraction(0))
            if (number > 0) - (number < 0) not in allowed:
                return None
            continue
        ordered = sorted(difference.items(), reverse=True)
        first = ordered[0][1]
        key = tuple((powers, number / abs(first) * (1 if first > 0 else -1)) for powers, number in ordered)
        allowed = allowed if first > 0 else frozenset(-sign for sign in allowed)
        signs[key] = signs.get(key, frozenset((-1, 0, 1))) & allowed
        if not signs[key]:
            return None
    return _boxed(signs)


def _boxed(signs: Mapping[tuple, Signs]) -> _System | None:
    names, periods, levels = set(), {}, {}
    bounds: dict[str, list[Fraction | None]] = {}
    bounded, left = True, {}
    for key, allowed in signs.items():
        atoms = [atom for powers, _ in key for atom in powers]
        for kind, multiples, _ in atoms:
            for name, number in multiples:
                names.add(name)
                if kind != "var":
                    periods[name] = math.lcm(periods.get(name, 1), number.denominator)
        if len(atoms) == 1 and atoms[0][0] == "var":
            ((name, _),) = atoms[0][1]
            level = -dict(key).get((), Fraction(0))
            levels.setdefault(name, []).append(abs(level))
            low, high = bounds.setdefault(name, [None, None])
            if -1 not in allowed:
                low = level if low is None else max(low, level)
            if 1 not in allowed:
                high = level if high is None else min(high, level)
            bounds[name] = [low, high]
            if allowed != frozenset((0,)):
                left[key] = allowed
            continue
        left[key] = allowed
        if any(kind == "var" for kind, _, _ in atoms):
            bounded = False
    box = {}
    for name in sorted(names):
        reach = _TURN * periods.get(name, 1)
        reach = max(levels[name]) + reach if name in levels else reach / 2
        low, high = bounds.get(name, [None, None])
        free = max(reach, Fraction(10)) if not bounded else reach
        box[name] = (-free if low is None else low, free if high is None else high)
        if box[name][0] > box[name][1]:
            return None
    return _System(left, box, bounded)


# Points and boxes are pairs of arrays (number of signals, batch) of their lower and upper ends.


def _ends(system: _System) -> tuple[np.ndarray, np.ndarray]:
    from ival import Interval

    sides = [(Interval(low).lo, Interval(high).hi) for low, high in system.box.values()]
    low, high = np.array(sides, float).reshape(-1, 2).T
    return low, high


def _pair(low: np.ndarray, high: np.ndarray) -> Interval:
    from ival import Interval

    found = Interval.empty()
    found.lo, found.hi = low, high
    return found


def _enclosures(system: _System, low: np.ndarray, high: np.ndarray) -> list[Interval]:
    """What each polynomial can be in each box."""
    import ival

    place = {name: _pair(low[i], high[i]) for i, name in enumerate(system.box)}
    atoms: dict[Atom, Interval] = {}

    def of(atom: Atom) -> Interval:
        if atom not in atoms:
            kind, multiples, offset = atom
            value = _pair(np.zeros(low.shape[1]), np.zeros(low.shape[1])) + ival.Interval(offset)
            for name, number in multiples:
                value = value + (place[name] if number == 1 else ival.Interval(number) * place[name])
            atoms[atom] = value if kind == "var" else getattr(ival, kind)(value)
        return atoms[atom]

    found = []
    for key in system.signs:
        value = _pair(np.zeros(low.shape[1]), np.zeros(low.shape[1]))
        for powers, number in key:
            part = ival.Interval(number)
            for atom in powers:
                part = part * of(atom)
            value = value + part
        found.append(value)
    return found


def _certain(value: Interval, allowed: Signs) -> np.ndarray:
    """Where it is certain and not by a hair: what is zero has states around it that are not allowed."""
    return ((value.lo > 0) & (1 in allowed)) | ((value.hi < 0) & (-1 in allowed))


def _possible(value: Interval, allowed: Signs) -> np.ndarray:
    zero = (value.lo <= 0) & (value.hi >= 0)
    return ((value.hi > 0) & (1 in allowed)) | ((value.lo < 0) & (-1 in allowed)) | (zero & (0 in allowed))


def _found(
    system: _System,
    low: np.ndarray,
    high: np.ndarray,
    signals: Sequence[str],
    predicates: Sequence[Predicate],
) -> Decision:
    """A state in one of these boxes that is certain, or None."""
    equal = [i for i, allowed in enumerate(system.signs.values()) if allowed == frozenset((0,))]
    if len(equal) > 1:
        return None
    values = _enclosures(system, low, high)
    certain = np.ones(low.shape[1], bool)
    for i, allowed in enumerate(system.signs.values()):
        certain &= True if i in equal else _certain(values[i], allowed)
    (places,) = np.nonzero(certain)
    if not len(places):
        return None
    if equal:
        return True if _changes_sign(system, equal[0], low[:, places], high[:, places]) else None
    for place in places[:8]:
        middle = (low[:, place] + high[:, place]) / 2
        for digits in (1, 2, 3, 6, 17):
            short = np.array([float(f"{x:.{digits}g}") for x in middle])
            inside = (short >= low[:, place]) & (short <= high[:, place])
            state = dict.fromkeys(signals, 0.0) | dict(zip(system.box, short.tolist(), strict=True))
            if (inside.all() or _point_is_certain(system, short)) and all(
                holds(one, state) for one in predicates
            ):
                return state
    return True


def _point_is_certain(system: _System, point: np.ndarray) -> bool:
    low, high = _ends(system)
    if np.any(point < low) or np.any(point > high):
        return False
    values = _enclosures(system, point[:, None], point[:, None])
    return all(
        bool(_certain(value, allowed)[0])
        for value, allowed in zip(values, system.signs.values(), strict=True)
    )


def _changes_sign(system: _System, index: int, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a polynomial is above zero at one corner of some box and below at the opposite one."""
    middle, radius = (low + high) / 2, (high - low) / 2
    slopes = []
    for axis in range(len(low)):
        step = np.zeros_like(low)
        step[axis] = radius[axis]
        ends = [_enclosures(system, middle + sign * step, middle + sign * step)[index] for sign in (1, -1)]
        slopes.append(ends[0].lo - ends[1].lo)
    up = np.where(np.array(slopes) >= 0, high, low)
    down = np.where(np.array(slopes) >= 0, low, high)
    above, below = (_enclosures(system, corner, corner)[index] for corner in (up, down))
    return bool(np.any((above.lo > 0) & (below.hi < 0)))


def _sampled(system: _System, signals: Sequence[str], predicates: Sequence[Predicate]) -> Decision:
    """A state among points drawn from the box, which is quick where there is much room."""
    low, high = (end[:, None] for end in _ends(system))
    random = np.random.default_rng(0)
    points = np.minimum(np.maximum(low + random.random((len(low), _SAMPLES)) * (high - low), low), high)
    room, off = _room(system, points)
    inside = np.flatnonzero(room > 0)
    if not len(inside):
        return None
    chosen = inside[np.argsort(off[inside] - 1e-3 * np.minimum(room[inside], 1.0))[:256]]
    for radius in (0.0, 1e-3, 1e-2, 3e-2, 1e-1, 2e-1):
        below, above = (np.clip(points[:, chosen] + sign * radius, low, high) for sign in (-1, 1))
        if (answer := _found(system, below, above, signals, predicates)) is not None:
            return answer
    return None


def _climbed(system: _System, signals: Sequence[str], predicates: Sequence[Predicate]) -> Decision:
    """A state near the best of many points, step by step: where there is so little room that few have any."""
    if frozenset((0,)) in system.signs.values():
        return None
    low, high = (end[:, None] for end in _ends(system))
    random = np.random.default_rng(0)
    points = low + random.random((len(low), _SAMPLES)) * (high - low)
    for step in np.geomspace(0.5, 1e-3, 20):
        room, _ = _room(system, np.clip(points, low, high))
        best = points[:, np.argsort(room)[-64:]]
        moved = np.tile(best, 32) + step * random.standard_normal((len(low), 32 * 64))
        points = np.clip(np.concatenate([best, moved], axis=1), low, high)
    room, _ = _room(system, points)
    chosen = points[:, np.argsort(room)[-64:]]
    return _found(system, chosen, chosen, signals, predicates)


def _room(system: _System, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each point is inside of all signs, and from where a polynomial is zero that must be."""
    values = [value.lo for value in _enclosures(system, points, points)]
    room, off = np.full(points.shape[1], math.inf), np.zeros(points.shape[1])
    for value, allowed in zip(values, system.signs.values(), strict=True):
        if allowed == frozenset((0,)):
            off = np.abs(value)
        else:
            best = [value] * (1 in allowed) + [-value] * (-1 in allowed)
            room = np.minimum(room, np.max(best, axis=0))
    return room, off


def _out_of_reach(system: _System) -> bool:
    """Whether two signs together ask for more than a cos x + b sin x ≤ √(a² + b²) gives.

    That is out of an arm's reach. It needs no box, and so no more effort for many joints than for few.
    """
    above = [
        linear
        for key, allowed in system.signs.items()
        for sign in (1, -1)
        if -sign not in allowed and (linear := _linear(key, sign)) is not None
    ]
    turns = np.linspace(0.0, math.pi / 2, 65)
    for one, other in itertools.product(above, above):
        # Where both are at least zero, so is any sum of positive multiples of them.
        sums = {
            angle: [
                np.cos(turns) * a + np.sin(turns) * b for a, b in zip(one[angle], other[angle], strict=True)
            ]
            for angle in {**one, **other}
        }
        reach = sum(np.hypot(*wave) for angle, wave in sums.items() if angle is not None)
        level = sums[None][0]
        # Floats err by far less than the room that is asked for.
        if np.any(reach + level < -1e-9 * (reach + np.abs(level) + 1)):
            return True
    return False


def _linear(key: _Key, sign: int) -> Mapping[tuple | None, tuple[float, float]] | None:
    """By angle the factors of cosine and sine in a sum of waves, by None what is added; or it is none."""
    found = defaultdict(lambda: (0.0, 0.0), {None: (0.0, 0.0)})
    for powers, number in key:
        if len(powers) > 1 or (powers and powers[0][0] == "var"):
            return None
        kind, *angle = powers[0] if powers else ("cos",)
        cos, sin = found[tuple(angle) or None]
        factor = sign * float(number)
        found[tuple(angle) or None] = (cos + factor, sin) if kind == "cos" else (cos, sin + factor)
    return found


def _branched(system: _System, signals: Sequence[str], predicates: Sequence[Predicate]) -> Decision:
    """The box, bisected along its longest sides; what can hold nowhere is left out."""
    low, high = (end[:, None] for end in _ends(system))
    for _ in range(_ROUNDS):
        values = _enclosures(system, low, high)
        possible = np.ones(low.shape[1], bool)
        for value, allowed in zip(values, system.signs.values(), strict=True):
            possible &= _possible(value, allowed)
        low, high = low[:, possible], high[:, possible]
        if not low.shape[1]:
            return False if system.bounded else None
        if (answer := _found(system, low, high, signals, predicates)) is not None:
            return answer
        if low.shape[1] > _MOST_BOXES:
            return None
        axis, every = np.argmax(high - low, axis=0), np.arange(low.shape[1])
        middle = (low[axis, every] + high[axis, every]) / 2
        left, right = high.copy(), low.copy()
        left[axis, every] = right[axis, every] = middle
        low, high = np.concatenate([low, right], 1), np.concatenate([left, high], 1)
    return None
