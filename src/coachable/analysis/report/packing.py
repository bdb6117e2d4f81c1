"""Arrays as short text inside a page: 16 bits a number, differences, deflate, base64."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

LARGEST = 32_767
MISSING = -32_768
"""Stands for NaN."""


def pack(columns: Mapping[str, np.ndarray], scales: Mapping[str, float] | None = None) -> dict[str, Any]:
    """Columns of one length as JSON data that `unpack` in `model.js` reads.

    Each value is rounded to a multiple of its column's scale, by default the greatest magnitude / 32,767, so
    that its error is at most half of that. NaN stays NaN. What is kept are the differences between rows, all
    low bytes before all high bytes of a column, compressed.

    **Arguments:** `scales` of the columns that should have another one, such as 1 for whole numbers.
    """
    columns = {name: np.asarray(column, float) for name, column in columns.items()}
    given, kept, parts = scales or {}, {}, []
    for name, column in columns.items():
        missing = np.isnan(column)
        greatest = float(np.max(np.abs(column[~missing]), initial=0.0))
        kept[name] = given.get(name, greatest / LARGEST or 1.0)
        whole = np.where(missing, MISSING, np.round(np.where(missing, 0, column) / kept[name]))
        if np.any(np.abs(whole[~missing]) > LARGEST):
            raise ValueError(f"column {name} does not fit into 16 bits at a scale of {kept[name]}")
        steps = np.diff(whole.astype(np.int64), prepend=0).astype(np.uint16)  # differences wrap around
        parts += [(steps & 0xFF).astype(np.uint8), (steps >> 8).astype(np.uint8)]
    data = np.concatenate(parts).tobytes() if parts else b""
    rows = len(next(iter(columns.values()))) if columns else 0
    return {
        "rows": rows,
        "columns": list(kept.items()),
        "data": base64.b64encode(zlib.compress(data, 9)).decode(),
    }


def safe_json(data: Any) -> str:
    """JSON that may stand inside a `<script>` element: no `<`, so that nothing in it can end the element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
