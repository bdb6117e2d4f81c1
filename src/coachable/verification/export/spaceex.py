"""The model as a SpaceEx file: `walker` (the plant), `automaton` and `sampler`, composed in `system`.

Format: Cotton, Frehse, Lebeltel, *The SpaceEx Modeling Language*, 2010.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

from coachable.automata.hybrid import TOUCHDOWN
from coachable.foundation.errors import ParameterError
from coachable.plants.equations import Equations, decimal, inlined
from coachable.verification.export.model import CONTROL_DT, Model, comparison_texts


def spaceex(model: Model) -> str:
    """The file's text.

    **Raises:** `ParameterError` for a phase that is not a conjunction of comparisons, or that speaks of
    functions: SpaceEx could not read its invariant.
    """
    root = ET.Element(
        "sspaceex",
        xmlns="http://www-verimag.imag.fr/xml-namespaces/sspaceex",
        version="0.2",
        math="SpaceEx",
    )
    outside = ("Outside all phases there is no invariant: their complement is not convex.",)
    for remark in (model.name, *model.remarks, *(() if model.controller is None else outside)):
        root.append(ET.Comment(f" {remark.replace('--', '- -')} "))
    constants = {name: decimal(value) for name, value in model.equations.constants.items()}
    parts = {"walker": _walker(root, model.equations, constants), "automaton": _automaton(root, model)}
    if model.controller is not None:
        parts["sampler"] = _sampler(root, model, constants)
    _system(root, model, parts)
    ET.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _walker(root: ET.Element, equations: Equations, constants: Mapping[str, str]) -> dict[str, str]:
    """The plant, and which of its names is bound to what in the system."""
    component = ET.SubElement(root, "component", id="walker")
    _reals(component, (*equations.state_names, "foot"))
    _reals(component, equations.inputs, controlled=False)
    _constants(component, constants)
    _label(component)
    definitions = equations.definitions
    rates = {name: inlined(rate, definitions) for name, rate in equations.rates.items()} | {"foot": "0"}
    flow = " & ".join(f"{name}' == {rate}" for name, rate in rates.items())
    numbers = {side.name: str(number) for number, side in enumerate(equations.sides, start=1)}
    for side in equations.sides:
        _location(component, numbers[side.name], side.name, side.where, flow)
    for change in equations.side_changes:
        _transition(component, numbers[change.source], numbers[change.target], change.boundary)
    event = equations.event
    jump = {
        "foot": f"foot + {inlined(event.displacement, definitions)}",
        **{name: inlined(after, definitions) for name, after in equations.reset.items()},
    }
    falling = f"{event.zero} == 0 & {event.falling}"
    _transition(component, numbers[event.side], numbers[event.next_side], falling, TOUCHDOWN, jump)
    return {name: name for name in (*equations.state_names, "foot", *equations.inputs, TOUCHDOWN)} | dict(
        constants
    )


def _automaton(root: ET.Element, model: Model) -> dict[str, str]:
    """The phases and their edges; it observes the plant, and blocks what it does not allow."""
    component = ET.SubElement(root, "component", id="automaton")
    names = model.equations.state_names
    _reals(component, names, controlled=False)
    _label(component)
    invariants = []
    for index, location in enumerate(model.locations):
        texts = comparison_texts(location.invariant)
        if texts is None or any(
            "(" in text and function in text for text in texts for function in _FUNCTIONS
        ):
            raise ParameterError(
                f"phase {location.title!r} of {model.behaviour.name!r}: SpaceEx reads conjunctions of "
                "comparisons without functions alone; export the model as .kyx or .py"
            )
        invariants.append(" & ".join(texts))
        _location(component, str(index + 1), location.name, invariants[-1], "")
    for event in (None, TOUCHDOWN):
        for source, target in model.edges(event):
            guard = "" if event else invariants[target]
            _transition(component, str(source + 1), str(target + 1), guard, event)
    return {name: name for name in (*names, TOUCHDOWN)}


def _sampler(root: ET.Element, model: Model, constants: Mapping[str, str]) -> dict[str, str]:
    """The sample clock, and the controls that are held from sample to sample."""
    component = ET.SubElement(root, "component", id="sampler")
    equations = model.equations
    inputs, state = tuple(equations.inputs), equations.state_names
    _reals(component, ("t", *inputs))
    _reals(component, state, controlled=False)
    names = {name: name for name in ("t", *inputs, *state)} | {"period": decimal(CONTROL_DT)}
    _constants(component, ["period"])
    invariant = "t <= period"
    if (controls := model.controls) is not None:
        definitions = {**equations.derived, **controls}
        held = [inlined(f"torque_{joint}", definitions) for joint in range(1, len(inputs) + 1)]
        _constants(component, constants)
        names |= constants
    else:
        assert model.bounds is not None
        held = _any_inputs(model)
        _reals(component, held, controlled=False)
        for name, low, high in zip(held, *model.bounds, strict=True):
            invariant += f" & {low} <= {name} & {name} <= {high}"
        names |= {name: name for name in held}
    sample = {"t": "0", **dict(zip(inputs, held, strict=True))}
    flow = " & ".join(["t' == 1", *(f"{name}' == 0" for name in inputs)])
    _location(component, "1", "holding", invariant, flow)
    _transition(component, "1", "1", "t >= period", None, sample)
    if model.clock == "touchdown":
        _label(component)
        _transition(component, "1", "1", "", TOUCHDOWN, {"t": "period"})
        names[TOUCHDOWN] = TOUCHDOWN
    return names


def _system(root: ET.Element, model: Model, parts: Mapping[str, Mapping[str, str]]) -> None:
    """The composition. What no part drives is an input."""
    component = ET.SubElement(root, "component", id="system")
    ET.SubElement(component, "note").text = _initially(model)
    names = {name for bound in parts.values() for name in bound.values()}
    sampled = model.controller is not None
    state, inputs = model.equations.state_names, tuple(model.equations.inputs)
    _reals(component, (*state, "foot", *(("t", *inputs) if sampled else ())))
    undriven = (*_any_inputs(model), *(() if sampled else inputs))
    _reals(component, [name for name in undriven if name in names], False)
    _label(component)
    for part, bound in parts.items():
        bind = ET.SubElement(component, "bind", {"component": part, "as": part})
        for key, value in bound.items():
            ET.SubElement(bind, "map", key=key).text = value


def _initially(model: Model) -> str:
    """Where it starts, as the configuration file that goes with the model has it."""
    if model.controller is None:
        return "initially: foot == 0, and any state that is in a location of the automaton and of the walker"
    values = [f"{name} == {decimal(value)}" for name, value in model.equations.start.items()]
    place = model.locations[model.start].name
    return "initially: " + " & ".join(
        [
            *values,
            "foot == 0",
            f"t == {decimal(CONTROL_DT)}",
            f"loc(automaton) == {place}",
            f"loc(walker) == {model.equations.sides[0].name}",
        ]
    )


def _any_inputs(model: Model) -> list[str]:
    """Names of inputs that stand for a network's controls."""
    return [f"any_{index}" for index in range(1, len(model.equations.inputs) + 1)]


def _reals(component: ET.Element, names: Iterable[str], controlled: bool = True) -> None:
    for name in names:
        _param(
            component, name, type="real", d1="1", d2="1", dynamics="any", controlled=str(controlled).lower()
        )


def _constants(component: ET.Element, names: Iterable[str]) -> None:
    for name in names:
        _param(component, name, type="real", d1="1", d2="1", dynamics="const", controlled="true")


def _label(component: ET.Element) -> None:
    _param(component, TOUCHDOWN, type="label")


def _param(component: ET.Element, name: str, **attributes: str) -> None:
    ET.SubElement(component, "param", {"name": name, "local": "false", **attributes})


def _location(component: ET.Element, number: str, name: str, invariant: str, flow: str) -> None:
    location = ET.SubElement(component, "location", id=number, name=name)
    if invariant:
        ET.SubElement(location, "invariant").text = invariant
    if flow:
        ET.SubElement(location, "flow").text = flow


def _transition(
    component: ET.Element,
    source: str,
    target: str,
    guard: str,
    label: str | None = None,
    assignment: Mapping[str, str] | None = None,
) -> None:
    transition = ET.SubElement(component, "transition", source=source, target=target)
    if label:
        ET.SubElement(transition, "label").text = label
    if guard:
        ET.SubElement(transition, "guard").text = guard
    if assignment:
        texts = (f"{name} := {value}" for name, value in assignment.items())
        ET.SubElement(transition, "assignment").text = " & ".join(texts)


_FUNCTIONS = ("sin", "cos", "abs", "min", "max")
