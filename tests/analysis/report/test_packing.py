"""Packed numbers come back in JavaScript as they went in; JSON cannot leave its element."""

import json

import numpy as np
import pytest

from coachable.analysis.report.packing import LARGEST, pack, safe_json


def test_what_is_packed_here_is_unpacked_there(in_node):
    rng = np.random.default_rng(0)
    columns = {
        "walk": np.cumsum(rng.normal(size=500)),
        "7": rng.uniform(-1e-3, 1e-3, 500),
        "phase": rng.integers(0, 5, 500).astype(float),
        "jumps": np.resize([-3.0, 3.0], 500),
        "3": np.where(np.arange(500) < 20, np.nan, 1.5),
        "nothing": np.zeros(500),
        "unknown": np.full(500, np.nan),
    }
    packed = pack(columns, {"phase": 1.0})
    back = in_node(
        "unpack(input).then((c) => Object.fromEntries(Object.entries(c).map(([k, v]) =>"
        " [k, Array.from(v, (x) => Number.isNaN(x) ? null : x)])))",
        packed,
    )
    for name, column in columns.items():
        found = np.array([np.nan if x is None else x for x in back[name]])
        scale = dict(packed["columns"])[name]
        np.testing.assert_allclose(found, column, atol=0.5000001 * scale)
        assert scale <= max(1.0, np.nanmax(np.abs(column), initial=0) / LARGEST)
    np.testing.assert_array_equal(back["phase"], columns["phase"])


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="column t"):
        pack({"t": np.array([0.0, 40_000.0])}, {"t": 1.0})


def test_json_cannot_end_its_element():
    hostile = {"</script><!--": "<script>&amp;\u2028"}
    text = safe_json(hostile)
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == hostile
    with pytest.raises(ValueError, match="JSON"):
        safe_json(float("nan"))
