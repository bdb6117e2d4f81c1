"""The model as a Python program of its own: only the standard library, the same walk."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

import jinja2
import numpy as np

from coachable.learning.policy import Policy
from coachable.plants.compass import START
from coachable.verification.export.equations import DERIVED, FLOW, IMPACT, SHARED, constants_of
from coachable.verification.export.model import ABOUT, Model, python_text


def python_script(model: Model) -> str:
    """The program's text; run, it prints the walk as CSV, a row a sample."""
    source = files("coachable.verification.export").joinpath("script.py.jinja").read_text(encoding="utf-8")
    template = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, undefined=jinja2.StrictUndefined
    ).from_string(source)
    policy = model.controller if isinstance(model.controller, Policy) else None
    return template.render(
        name=_plain(model.name),
        remarks=(ABOUT, model.driven_by),
        constants=constants_of(model.parameters),
        derived=DERIVED,
        shared=SHARED,
        flow=FLOW,
        impact=IMPACT,
        torques=model.torques,
        layers=None if policy is None else list(_layers(policy)),
        low=None if policy is None else _numbers(np.asarray(policy.low)),
        high=None if policy is None else _numbers(np.asarray(policy.high)),
        squashing=None if policy is None else policy.squashing,
        phases=[(repr(phase.name), python_text(phase.predicate)) for phase in model.behaviour.phases],
        restarts=model.clock == "touchdown",
        start=list(START),
    )


def _layers(policy: Policy) -> Iterator[tuple[list[str], str]]:
    """Rows of weights, and biases, of each layer; a float32 is written as the same number."""
    for weight, bias in zip(policy.weights, policy.biases, strict=True):
        yield [_numbers(row) for row in np.asarray(weight)], _numbers(np.asarray(bias))


def _numbers(row: np.ndarray) -> str:
    return f"[{', '.join(map(repr, row.astype(float).tolist()))}]"


def _plain(text: str) -> str:
    """Text that may stand in a docstring."""
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")
