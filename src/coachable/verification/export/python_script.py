"""The model as a Python program of its own: only the standard library, the same walk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.resources import files

import jinja2
import numpy as np

from coachable.learning.policy import Policy
from coachable.plants.equations import NAME
from coachable.verification.export.model import Model, python_text


def python_script(model: Model) -> str:
    """The program's text; run, it prints the walk as CSV, a row a sample."""
    source = files("coachable.verification.export").joinpath("script.py.jinja").read_text(encoding="utf-8")
    template = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, undefined=jinja2.StrictUndefined
    ).from_string(source)
    policy = model.controller if isinstance(model.controller, Policy) else None
    equations = model.equations
    names = equations.state_names
    return template.render(
        name=_plain(model.name),
        remarks=(equations.about, model.driven_by),
        equations=equations,
        names=names,
        inputs=list(equations.inputs),
        guard=_indexed(equations.event.guard, names, "x"),
        admissible=_indexed(equations.event.admissible, names, "landing"),
        height=_indexed(equations.height, names, "x"),
        base=_indexed(equations.base[1], names, "x"),
        controls=model.controls,
        layers=None if policy is None else list(_layers(policy)),
        low=None if policy is None else _numbers(np.asarray(policy.low)),
        high=None if policy is None else _numbers(np.asarray(policy.high)),
        squashing=None if policy is None else policy.squashing,
        std=None
        if policy is None or policy.clips or policy.std is None
        else _numbers(np.asarray(policy.std)),
        phases=[(repr(phase.name), python_text(phase.predicate)) for phase in model.behaviour.phases],
        restarts=model.clock == "touchdown",
        start=list(equations.start.values()),
    )


def _indexed(text: str, names: Sequence[str], vector: str) -> str:
    """A formula with every coordinate as an entry of a vector: `cos(x[0])`."""
    return NAME.sub(lambda one: f"{vector}[{names.index(one[0])}]" if one[0] in names else one[0], text)


def _layers(policy: Policy) -> Iterator[tuple[list[str], str]]:
    """Rows of weights, and biases, of each layer; a float32 is written as the same number."""
    for weight, bias in zip(policy.weights, policy.biases, strict=True):
        yield [_numbers(row) for row in np.asarray(weight)], _numbers(np.asarray(bias))


def _numbers(row: np.ndarray) -> str:
    return f"[{', '.join(map(repr, row.astype(float).tolist()))}]"


def _plain(text: str) -> str:
    """Text that may stand in a docstring."""
    return " ".join(text.split()).replace("\\", "/").replace('"', "'")
