"""How options are shown, and how results are printed as JSON."""

from __future__ import annotations

import json
import math
from typing import Literal

from tyro.conf import arg

Semantics = Literal["paper", "released-code"]


def option(metavar: str, help: str, *, otherwise: str = "", short: tuple[str, ...] = ()) -> object:
    """How an option that may be left out is shown: what to write, what it means, what holds without it."""
    hint = f"(default: {otherwise})" if otherwise else ""
    return arg(metavar=metavar, help=help, help_behavior_hint=hint, aliases=short)


def json_text(numbers: dict) -> str:
    """An object as JSON; a number that is not finite becomes null."""
    finite = {key: None if isinstance(n, float) and not math.isfinite(n) else n for key, n in numbers.items()}
    return json.dumps(finite, indent=2)
