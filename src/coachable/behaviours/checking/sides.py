"""Lateral signals that keep their sign in the mirror image of a step."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from coachable.behaviours.behaviour import Behaviour, Symmetry
from coachable.behaviours.checking.comparison import same_meaning
from coachable.behaviours.checking.findings import Finding, Result, Subject
from coachable.behaviours.expressions import Constant
from coachable.behaviours.predicates import Phrase, Predicate, Signal
from coachable.behaviours.rewriting import expanded
from coachable.behaviours.text.mirror import Mirror

_LATERAL = re.compile(
    r"(?<![^\W_])(?:d|v)?(?:sway|lateral|sideways?|roll|yaw|heading|y|left-?wards?|right-?wards?|"
    r"to the (?:left|right))(?![^\W_])",
    re.IGNORECASE,
)
"""Words for what points to one side. `d` and `v` are before rates."""


def lateral_signals(behaviour: Behaviour) -> Iterator[Result]:
    """Signals to one side, by their name or description, of which both sides of a mirror ask the same.

    Two phases are sides of a mirror if their names differ in one word, and swapping the two words in all
    names makes the one's predicate the other's.
    """
    lateral = [signal for signal in behaviour.signals if _is_lateral(signal)]
    constants = {constant.name: constant for constant in behaviour.constants}
    for first, second, swapped in _sides(behaviour) if lateral else ():
        mirror = Mirror.of(Symmetry((swapped,)))
        if not same_meaning(_image(mirror, first, constants), second):
            continue
        for signal in list(lateral):
            flipped = Mirror.of(Symmetry((swapped,), (signal.name,)))
            keeps_its_name = mirror.text(signal.name) == signal.name
            if keeps_its_name and not same_meaning(_image(flipped, first, constants), second):
                lateral.remove(signal)
                yield _finding(signal, swapped)


def _sides(behaviour: Behaviour) -> Iterator[tuple[Predicate, Predicate, tuple[str, str]]]:
    for index, phase in enumerate(behaviour.phases):
        for other in behaviour.phases[index + 1 :]:
            words = phase.name.split("_"), other.name.split("_")
            if len(words[0]) == len(words[1]):
                differ = [pair for pair in zip(*words, strict=True) if pair[0] != pair[1]]
                if len(set(differ)) == 1:
                    yield phase.predicate, other.predicate, differ[0]


def _image(mirror: Mirror, predicate: Predicate, constants: Mapping[str, Constant]) -> Predicate:
    return mirror.predicate(expanded(predicate), constants, _itself)


def _itself(phrase: Phrase) -> Phrase:
    return phrase


def _is_lateral(signal: Signal) -> bool:
    if signal.derivative_of is not None:
        return False  # It follows the signal whose derivative it is.
    return _LATERAL.search(signal.name) is not None or _LATERAL.search(signal.description) is not None


def _finding(signal: Signal, swapped: tuple[str, str]) -> Finding:
    left, right = swapped
    return Finding(
        "lateral-signal",
        "warning",
        (Subject("signal", signal.name),),
        f"{signal.name} seems to point to one side, and its sign is the same {left} and {right}: where a "
        f"{left} phase asks for one side, its mirror image asks for that side, too.",
        f"Write `mirror {left} <-> {right}, {signal.name} -> -{signal.name}`. Nothing, if {signal.name} does "
        "not change its sign in a mirror.",
    )
