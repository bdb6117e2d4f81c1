"""How options are shown, and how results are printed as JSON."""

from __future__ import annotations

import json
import math
from typing import Annotated, Literal, get_args

from tyro.conf import arg

Semantics = Literal["paper", "released-code"]
ControllerName = Literal["virtual-gravity", "constant-torque", "none"]
CONTROLLER_NAMES: tuple[ControllerName, ...] = get_args(ControllerName)
Clock = Literal["free", "touchdown"]
Which = Literal["last", "best"]


def option(metavar: str, help: str, *, otherwise: str = "", short: tuple[str, ...] = ()) -> object:
    """How an option that may be left out is shown: what to write, what it means, what holds without it."""
    hint = f"(default: {otherwise})" if otherwise else ""
    return arg(metavar=metavar, help=help, help_behavior_hint=hint, aliases=short)


LaneSetup = Annotated[str | None, option("NAME", "The lane's setup.", otherwise="the plan's first")]
LaneSeed = Annotated[int | None, option("N", "The lane's seed.", otherwise="the plan's first")]
WhichPolicy = Annotated[
    Which,
    arg(help="The policy after the last update, or the one with the best evaluation return."),
]


def json_text(numbers: dict) -> str:
    """An object as JSON; a number that is not finite becomes null."""
    finite = {key: None if isinstance(n, float) and not math.isfinite(n) else n for key, n in numbers.items()}
    return json.dumps(finite, indent=2)
