"""What the paper reports: its figures, digitised, and its Table III."""

from __future__ import annotations

import csv
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

Figure = Literal["learning_curves", "walking_distance"]


@dataclass(frozen=True)
class PaperNumbers:
    """The paper's results for one reward setup, of 15 runs."""

    highest_distance: float
    """Greatest distance of any run [m]."""
    normalised_reward: float
    """Mean normalised return of the last 50,000 training steps."""
    reward_std: float
    """Table III: standard deviation over runs of the highest normalised return."""
    distance_std: float
    """Table III: standard deviation over runs of the highest distance [m]."""
    first_above_baseline: float = math.inf
    """Training steps at which the greatest distance of any run first passes the baseline's."""


PAPER_BASELINE_DISTANCE = 8.316
"""The virtual gravity line in the paper's figure [m]."""


@cache
def paper_numbers() -> Mapping[str, PaperNumbers]:
    """The paper's results by the name of the setup."""
    data = tomllib.loads(_resource("paper_numbers.toml"))
    return {name: PaperNumbers(**numbers) for name, numbers in data.items()}


class PaperCurve(NamedTuple):
    """A digitised curve: its value [1 or m] at some training steps."""

    steps: Float[np.ndarray, " points"]
    value: Float[np.ndarray, " points"]


@cache
def paper_curves(figure: Figure) -> Mapping[str, PaperCurve]:
    """The curves of one of the paper's figures by setup.

    `walking_distance` also has `"virtual gravity"`, the paper's baseline.
    """
    rows = [
        row for row in csv.DictReader(_resource("paper_figures.csv").splitlines()) if row["figure"] == figure
    ]

    def curve(name: str) -> PaperCurve:
        points = [row for row in rows if row["setup"] == name]
        steps, value = (
            np.array([float(p[column]) for p in points]) for column in ("training_steps", "value")
        )
        return PaperCurve(steps, value)

    return {name: curve(name) for name in dict.fromkeys(row["setup"] for row in rows)}


def _resource(name: str) -> str:
    return (files("coachable.analysis") / name).read_text(encoding="utf-8")
