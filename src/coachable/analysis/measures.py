"""What is measured while policies are trained: each quantity with its name, unit and column."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pyarrow as pa
from jaxtyping import Num


@dataclass(frozen=True)
class Measure:
    """A quantity that is measured again and again while policies are trained."""

    name: str
    title: str
    axis: str
    """What an axis of its values is called."""
    column: str
    """Its column in `table`; `distance` stands for the one in which the problem keeps it."""
    unit: str = ""
    """`%` for a share, whose values are between 0 and 1."""
    table: Literal["evaluations", "episodes", "updates"] = "evaluations"
    """Of evaluations, of training episodes, or of the updates after those."""
    reading: Literal["value", "highest so far", "complement"] = "value"
    depends_on: Literal["environment", "behaviour", "reward"] = "environment"
    """What two studies must share, beside the environment, for their values to be comparable."""

    @property
    def words(self) -> str:
        """Its title inside a sentence."""
        return self.title[0].lower() + self.title[1:]

    @property
    def heading(self) -> str:
        """Its title with the unit, as the head of a table has it."""
        return self.words + (f" [{self.unit}]" if self.unit else "")

    def read(self, values: Num[np.ndarray, "runs *points"]) -> Num[np.ndarray, "runs *points"]:
        """The measure's values from those of its column, points along the last axis in order."""
        match self.reading:
            case "value":
                return values
            case "complement":
                return 1 - values
            case "highest so far":
                return np.maximum.accumulate(values, axis=1)


RETURN = Measure("reward", "Normalised reward", "return / baseline's return", "return", table="episodes")
HIGHEST = Measure("highest", "Highest distance", "m", "distance", "m", reading="highest so far")
DISTANCE = Measure("distance", "Distance", "m", "distance", "m")
UP = Measure("up", "Survival", "share of runs up after the episode", "fell", "%", reading="complement")
IN_CYCLE = Measure(
    "cycle",
    "Share in cycle",
    "share of samples in the cycle",
    "share_in_cycle",
    "%",
    depends_on="behaviour",
)
BESIDE_A_BASELINE = (RETURN, HIGHEST, DISTANCE, UP, IN_CYCLE)
"""What is measured in a study that has a baseline to be measured against."""

UPDATES = tuple(
    Measure(name, title, axis, name, table="updates")
    for name, title, axis in (
        ("approx_kl", "Approximate KL", "KL divergence of the new policy"),
        ("clip_fraction", "Clip fraction", "share of samples outside the clip range"),
        ("explained_variance", "Explained variance", "share of the returns' variance"),
        ("entropy", "Entropy", "entropy of the policy"),
    )
)
"""What a learner reports of its updates."""

_KNOWN = (
    Measure("environment", "Environment's return", "what the environment pays by itself", "environment"),
    Measure(
        "behaviour",
        "Behaviour's return",
        "what the description pays, with its weight",
        "behaviour",
        depends_on="reward",
    ),
    replace(IN_CYCLE, axis="share of steps in the cycle"),
    Measure("cycles", "Whole cycles", "cycles in an episode", "cycles", depends_on="behaviour"),
    Measure("fell", "Falls", "share of episodes that ended in a fall", "fell", "%"),
    Measure("length", "Episode's length", "steps", "length", "steps"),
    DISTANCE,
)
_WHOLE_RETURN = Measure("return", "Return", "return", "return", depends_on="reward")
_IN_TRAINING = replace(
    _WHOLE_RETURN, name="trained", title="Return in training", axis="return of an episode", table="episodes"
)


def measures_of(table: pa.Table) -> tuple[Measure, ...]:
    """One for each column of the evaluations that has values, and the return in training."""
    columns = {name: table.schema.field(name) for name in table.column_names}
    parts_of_return = {"environment", "behaviour"} <= columns.keys()
    known = _KNOWN if parts_of_return else (_WHOLE_RETURN, *_KNOWN)
    others = [
        Measure(name, title, unit or title.lower(), name, unit)
        for name, column in columns.items()
        if name not in ("lane", "step", "episode", "return", *(measure.column for measure in known))
        for title in (name.replace("_", " ").capitalize(),)
        for unit in ((column.metadata or {}).get(b"unit", b"").decode(),)
    ]
    found = [
        measure
        for measure in (*known, *others)
        if measure.column in columns and not np.isnan(table[measure.column].to_numpy().astype(float)).all()
    ]
    return (*found, _IN_TRAINING)
