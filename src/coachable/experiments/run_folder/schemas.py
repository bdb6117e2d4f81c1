"""The tables of a run folder, format_version 2: their columns, types and units."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import pyarrow as pa

from coachable.envs.problem import PlantProblem
from coachable.envs.squashing import Deterministic
from coachable.experiments.experiment import Experiment
from coachable.plants.plant import Plant
from coachable.rewards.setup import TERM_NAMES

FORMAT_VERSION = 2
READABLE = (1, 2)
"""Format versions that the reader knows. Their tables are the same but for columns that were added."""
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


def _columns(*columns: tuple[str, pa.DataType, str], added: tuple[str, ...] = ()) -> pa.Schema:
    """The schema of a table, where those columns are nullable that were `added` since older tables."""
    return pa.schema(
        [
            pa.field(name, kind, nullable=name in added, metadata={"unit": unit} if unit else None)
            for name, kind, unit in columns
        ]
    )


_LANE = ("lane", pa.string(), "")
_CYCLES = ("cycles", pa.int32(), "")
_UPDATE = [(name, pa.float32(), "") for name in DIAGNOSTICS]
_TERMS = [(name, pa.float32(), "") for name in TERM_NAMES]


def _of_plant(plant: Plant) -> dict[str, pa.Schema]:
    states = zip(plant.state_names, plant.state_units or ("",) * len(plant.state_names), strict=True)
    controls = zip(plant.control_names, plant.control_units or ("",) * len(plant.control_names), strict=True)
    return {
        "episodes": _columns(
            _LANE,
            ("end_step", pa.int64(), ""),
            ("return", pa.float32(), ""),
            ("length", pa.int32(), ""),
            ("fell", pa.bool_(), ""),
            *_UPDATE,
            added=DIAGNOSTICS,
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
            _CYCLES,
            *_TERMS,
            added=("cycles",),
        ),
        "trajectories": _columns(
            _LANE,
            ("which", pa.string(), ""),
            ("t", pa.float32(), "s"),
            *((name, pa.float32(), unit) for name, unit in states),
            *((name, pa.float32(), unit) for name, unit in controls),
            ("foot_x", pa.float32(), "m"),
            ("phase", pa.int8(), ""),
            *_TERMS,
        ),
        "survival": _columns(_LANE, ("seconds_up", pa.float32(), "s"), ("perturbed_up", pa.float32(), "")),
    }


_PAID = (
    ("return", pa.float32(), ""),
    ("environment", pa.float32(), ""),
    ("behaviour", pa.float32(), ""),
    ("length", pa.int32(), ""),
    ("fell", pa.bool_(), ""),
    ("share_in_cycle", pa.float32(), ""),
)
_OF_ENVIRONMENT: Mapping[str, pa.Schema] = MappingProxyType(
    {
        "episodes": _columns(_LANE, ("end_step", pa.int64(), ""), *_PAID, *_UPDATE, added=DIAGNOSTICS),
        "evaluations": _columns(
            _LANE,
            ("step", pa.int64(), ""),
            ("episode", pa.int32(), ""),
            *_PAID,
            _CYCLES,
            ("distance", pa.float32(), "m"),
            added=("cycles",),
        ),
    }
)

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
    ("strides", pa.float32(), ""),
    ("step_time", pa.float32(), "s"),
    ("step_length", pa.float32(), "m"),
    ("duty", pa.float32(), ""),
    ("overlap", pa.float32(), ""),
    ("flight", pa.float32(), ""),
    ("alternation", pa.float32(), ""),
    ("lag", pa.float32(), ""),
    ("asymmetry", pa.float32(), "%"),
    ("step_asymmetry", pa.float32(), "%"),
    added=("strides", "step_time", "step_length", "overlap", "step_asymmetry"),
)
"""What `coachable gait` measures, one row an episode; see `gaits.measures`.

`follows` is the share of steps that belong to the behaviour; `cycles` how many of its cycles are completed a
second, NaN if it has none; `dt` the time between two steps; `environment` the return without the behaviour's
part. Strides, steps, `overlap` and `step_asymmetry` are null in older tables, which lack them; where the last
two are lacking, `alternation` counts every touchdown as a step, of feet that land together, too.
"""


def table_of_rule(table: str, rule: Deterministic) -> str:
    """The name of a table under a further rule for what policies do when they do not explore."""
    return f"{table}-{rule}"


def schemas(experiment: Experiment) -> Mapping[str, pa.Schema]:
    """The tables of an experiment's runs by name.

    `lane` is `setup-seed`, or a baseline's name. `fell`: whether the episode ended in a fall; in a Gymnasium
    environment, whether it terminated and was not truncated. `share_in_cycle`: the share of steps in a phase.
    `cycles`: how many of the behaviour's cycles the episode completed; null in older tables, which lack it.

    - A plant's: terms are unweighted; in `evaluations` sums over the episode, in `trajectories` of the step
      that began at `t`. `phase` counts the behaviour's phases from 0; outside all of them is their number.
    - A Gymnasium environment's, one row an episode: `return` is what the lane was trained for, `environment`
      the environment's own return, `behaviour` the described reward's with its weight; `distance` is how far
      `x_position` in the infos moved, NaN where there is none.

    Policies are evaluated by the experiment's first rule for what they do when they do not explore; by
    further ones in tables of their own, such as `evaluations-clipped-mean`.
    """
    if not isinstance(problem := experiment.problem, PlantProblem):
        return _OF_ENVIRONMENT
    tables = _of_plant(problem.plant)
    further = {
        table_of_rule(name, rule): tables[name]
        for rule in experiment.deterministic[1:]
        for name in ("evaluations", "survival")
    }
    return {**tables, **further}
