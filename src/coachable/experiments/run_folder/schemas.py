"""The tables of a run folder, format_version 1: their columns, types and units."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import pyarrow as pa

from coachable.plants.compass import STATE_NAMES
from coachable.rewards.setup import TERM_NAMES

FORMAT_VERSION = 1
DIAGNOSTICS = (
    "approx_kl",
    "clip_fraction",
    "explained_variance",
    "value_loss",
    "policy_loss",
    "entropy",
    "std",
)
"""The columns of `learning.ppo.Diagnostics`, of the update after the rollout in which an episode ended.

Null where the learner does not report one, and in older tables, which lack them.
"""


def _columns(*columns: tuple[str, pa.DataType, str]) -> pa.Schema:
    return pa.schema(
        [
            pa.field(name, kind, nullable=name in DIAGNOSTICS, metadata={"unit": unit} if unit else None)
            for name, kind, unit in columns
        ]
    )


_LANE = ("lane", pa.string(), "")
_UPDATE = [(name, pa.float32(), "") for name in DIAGNOSTICS]
_TERMS = [(name, pa.float32(), "") for name in TERM_NAMES]
_STATE_UNITS = ("rad", "rad", "rad/s", "rad/s")

SCHEMAS: Mapping[str, pa.Schema] = MappingProxyType(
    {
        "episodes": _columns(
            _LANE,
            ("end_step", pa.int64(), ""),
            ("return", pa.float32(), ""),
            ("length", pa.int32(), ""),
            ("fell", pa.bool_(), ""),
            *_UPDATE,
        ),
        "evaluations": _columns(
            _LANE,
            ("step", pa.int64(), ""),
            ("return", pa.float32(), ""),
            ("hip_x", pa.float32(), "m"),
            ("foot_x", pa.float32(), "m"),
            ("length", pa.int32(), ""),
            ("fell", pa.bool_(), ""),
            ("share_in_cycle", pa.float32(), ""),
            *_TERMS,
        ),
        "trajectories": _columns(
            _LANE,
            ("which", pa.string(), ""),
            ("t", pa.float32(), "s"),
            *((name, pa.float32(), unit) for name, unit in zip(STATE_NAMES, _STATE_UNITS, strict=True)),
            ("u1", pa.float32(), "N m"),
            ("u2", pa.float32(), "N m"),
            ("foot_x", pa.float32(), "m"),
            ("phase", pa.int8(), ""),
            *_TERMS,
        ),
        "survival": _columns(_LANE, ("seconds_up", pa.float32(), "s"), ("perturbed_up", pa.float32(), "")),
    }
)
"""By table name.

`lane` is `setup-seed`, or a baseline's name. Terms are unweighted: in `evaluations` sums over the episode,
in `trajectories` what the step that began at `t` paid. `phase` counts the behaviour's phases from 0; outside
all of them is their number.
"""

_PAID = (
    ("return", pa.float32(), ""),
    ("environment", pa.float32(), ""),
    ("behaviour", pa.float32(), ""),
    ("length", pa.int32(), ""),
    ("fell", pa.bool_(), ""),
    ("share_in_cycle", pa.float32(), ""),
)
TRAINING_SCHEMAS: Mapping[str, pa.Schema] = MappingProxyType(
    {
        "episodes": _columns(_LANE, ("end_step", pa.int64(), ""), *_PAID, *_UPDATE),
        "evaluations": _columns(
            _LANE,
            ("step", pa.int64(), ""),
            ("episode", pa.int32(), ""),
            *_PAID,
            ("distance", pa.float32(), "m"),
        ),
    }
)
"""The tables of a training in somebody's environment, one row an episode.

`return` is what the lane was trained for; `environment` what the environment itself paid; `behaviour` what
the described reward came to, with its weight. `fell` says that the episode terminated, and was not cut off.
`share_in_cycle` is the share of steps in a phase; `distance` how far `x_position` in the infos moved, NaN
where they have none.
"""

GAITS = _columns(
    _LANE,
    ("episode", pa.int32(), ""),
    ("gait", pa.string(), ""),
    ("dt", pa.float64(), "s"),
    ("length", pa.int32(), ""),
    ("environment", pa.float32(), ""),
    ("fell", pa.bool_(), ""),
    ("share_in_cycle", pa.float32(), ""),
    ("follows", pa.float32(), ""),
    ("cycles", pa.float32(), "1/s"),
    ("speed", pa.float32(), "m/s"),
    ("transport", pa.float32(), ""),
    ("duty", pa.float32(), ""),
    ("flight", pa.float32(), ""),
    ("alternation", pa.float32(), ""),
    ("lag", pa.float32(), ""),
    ("asymmetry", pa.float32(), "%"),
)
"""What `coachable gait` finds, one row an episode; see `verification.gaits.measures`.

`follows` is the share of steps that belong to the behaviour; `cycles` how many of its cycles are completed a
second, NaN if it has none; `dt` the time between two steps.
"""


def table_of(schema: pa.Schema, columns: Mapping[str, np.ndarray | list]) -> pa.Table:
    """A table from its columns, in the schema's order.

    In a nullable column NaN becomes null; one that is not among `columns` is all null.
    """

    def array(field: pa.Field) -> pa.Array:
        if not field.nullable:
            return pa.array(columns[field.name], field.type)
        if field.name not in columns:
            return pa.nulls(len(columns[schema.names[0]]), field.type)
        return pa.array(columns[field.name], field.type, from_pandas=True)

    return pa.table([array(field) for field in schema], schema=schema)
