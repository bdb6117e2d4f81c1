"""Time limits for phases, proposed from how long recorded motions stay in them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from coachable.automata.monitor import gaps_between
from coachable.automata.trace import Trace
from coachable.automata.tracker import Tracker
from coachable.behaviours.behaviour import Behaviour
from coachable.behaviours.text.document import Document
from coachable.foundation.data import real_number
from coachable.foundation.errors import ParameterError


@dataclass(frozen=True, eq=False)
class Limit:
    """How long a phase may last, and what that was measured from."""

    phase: str
    stays: Float[np.ndarray, " stays"]
    """From the first sample in the phase to the first in another place [s]; whole stays only."""
    seconds: float
    """The limit [s]; NaN where no whole stay was seen."""


def limits(
    behaviour: Behaviour, parts: Iterable[Trace], quantile: float = 0.9, slack: float = 1.0
) -> tuple[Limit, ...]:
    """A limit for each phase: a quantile of its stays, times `slack`, up to the next hundredth of a second.

    It is a hundredth at least, since no phase lasts at most 0 s.

    **Arguments:** `parts`: a trace in consecutive parts.

    **Raises:** `ParameterError` for a quantile outside [0, 1], a slack that is not positive or above 1,000,
    and a trace without samples.
    """
    real_number(quantile, "quantile", ParameterError, least=0.0, most=1.0)
    real_number(slack, "slack", ParameterError, above=0.0, most=1000.0)
    tracker, times, locations = Tracker.of(behaviour), [], []
    previous, held = tracker.none_yet, None
    for part in parts:
        if len(part.time):
            there, held = tracker.along_with(part.values, previous, held)
            locations.append(there)
            times.append(part.time)
            previous = int(there[-1])
    if not times:
        raise ParameterError("the trace has no samples")
    stays = _whole_stays(np.concatenate(times), np.concatenate(locations))
    return tuple(
        Limit(name, here, _limit(here, quantile, slack))
        for name, here in zip(behaviour.phase_names, map(stays, range(len(behaviour.phases))), strict=True)
    )


def _whole_stays(times: Float[np.ndarray, " samples"], locations: Int[np.ndarray, " samples"]):
    """By location, how long each stay lasted whose beginning and end were seen."""
    gap = gaps_between(times)  # what goes on across one is no whole stay
    begins = np.flatnonzero(np.append(True, (np.diff(locations) != 0) | gap))
    ends = np.append(begins[1:], len(times) - 1)
    seen = np.ones(len(begins), bool)
    seen[0] = seen[-1] = False
    after_gap = np.append(False, gap)[begins]
    seen &= ~after_gap & ~np.append(after_gap[1:], False)

    def of(location: int) -> Float[np.ndarray, " stays"]:
        here = seen & (locations[begins] == location)
        return times[ends[here]] - times[begins[here]]

    return of


def _limit(stays: Float[np.ndarray, " stays"], quantile: float, slack: float) -> float:
    if not len(stays):
        return math.nan
    seconds = slack * float(np.quantile(stays, quantile, method="higher"))
    hundredths = 100 * seconds - 1e-6
    return max(math.ceil(hundredths), 1) / 100 if math.isfinite(hundredths) else seconds


def with_limits(document: Document, seconds: Mapping[str, float]) -> str:
    """The text of a file with `for at most` in its phases; what they had of it is replaced.

    **Arguments:** `seconds`: by the names of phases [s]; those that are NaN stay as they are.

    **Raises:** `ParameterError` for a phase that is not written in the file itself.
    """
    lines = document.text.splitlines(keepends=True)
    for phase in document.behaviour.phases:
        limit = seconds.get(phase.name, math.nan)
        if math.isnan(limit):
            continue
        number = document.line_of("phase", phase.name)
        head = re.match(r'(\s*[^\s:"]+(?:\s+"[^"]*")?)(?:\s+for\s[^:]*)?:', lines[(number or 1) - 1])
        if number is None or head is None or head[1].split()[0].strip("'") != phase.name:
            raise ParameterError(
                f"phase {phase.name!r} is not written in {document.path} itself; give it its limit by hand: "
                f"for at most {limit:g} s"
            )
        least = phase.dwell.at_least if phase.dwell is not None else 0.0
        time = f"for {least:g} s to {limit:g} s" if least else f"for at most {limit:g} s"
        lines[number - 1] = f"{head[1]} {time}:{lines[number - 1][head.end() :]}"
    return "".join(lines)
