"""The model as a SpaceEx file: walker, automaton and sampler as components, composed in `system`.

Format: Cotton, Frehse, Lebeltel, *The SpaceEx Modeling Language*, 2010.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

from coachable.automata.hybrid import TOUCHDOWN
from coachable.foundation.errors import ParameterError
from coachable.plants.compass import START, STATE_NAMES
from coachable.verification.export.equations import (
    DERIVED,
    FLOW,
    IMPACT,
    RATES,
    SHARED,
    constants_of,
    decimal,
    inlined,
)
from coachable.verification.export.model import CONTROL_DT, Model, comparison_texts

_SIDES = {
    "behind": "theta_2 <= theta_1",
    "ahead": "theta_2 >= theta_1 & theta_1 + theta_2 >= 0",
    "below": "theta_2 >= theta_1 & theta_1 + theta_2 <= 0",
}
_ON_GUARD = "theta_1 + theta_2 == 0"
_PASSING = "theta_1 == theta_2"
_TORQUES, _ANY_TORQUES = ("u_1", "u_2"), ("any_1", "any_2")


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
    constants = {name: decimal(value) for name, value in constants_of(model.parameters).items()}
    parts = {"walker": _walker(root, constants), "automaton": _automaton(root, model)}
    if model.controller is not None:
        parts["sampler"] = _sampler(root, model, constants)
    _system(root, model, parts)
    ET.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _walker(root: ET.Element, constants: Mapping[str, str]) -> dict[str, str]:
    """The plant, and which of its names is bound to what in the system."""
    component = ET.SubElement(root, "component", id="walker")
    _reals(component, (*STATE_NAMES, "foot"))
    _reals(component, _TORQUES, controlled=False)
    _constants(component, constants)
    _label(component)
    definitions = {**DERIVED, **SHARED, **FLOW, **IMPACT}
    rates = {name: inlined(rate, definitions) for name, rate in RATES.items()} | {"foot": "0"}
    flow = " & ".join(f"{name}' == {rate}" for name, rate in rates.items())
    numbers = {side: str(number) for number, side in enumerate(_SIDES, start=1)}
    for side, invariant in _SIDES.items():
        _location(component, numbers[side], side, invariant, flow)
    for source, target, guard in (
        ("behind", "ahead", f"{_PASSING} & theta_1 + theta_2 >= 0"),
        ("behind", "below", f"{_PASSING} & theta_1 + theta_2 <= 0"),
        ("ahead", "behind", _PASSING),
        ("below", "behind", _PASSING),
        ("below", "ahead", _ON_GUARD),
    ):
        _transition(component, numbers[source], numbers[target], guard)
    jump = {
        "foot": f"foot + {inlined('steplength', definitions)}",
        "theta_1": "theta_2",
        "theta_2": "theta_1",
        "dtheta_1": inlined("after_1", definitions),
        "dtheta_2": inlined("after_2", definitions),
    }
    falling = f"{_ON_GUARD} & dtheta_1 + dtheta_2 <= 0"
    _transition(component, numbers["ahead"], numbers["behind"], falling, TOUCHDOWN, jump)
    return {name: name for name in (*STATE_NAMES, "foot", *_TORQUES, TOUCHDOWN)} | dict(constants)


def _automaton(root: ET.Element, model: Model) -> dict[str, str]:
    """The phases and their edges; it watches the walker, and blocks what it does not allow."""
    component = ET.SubElement(root, "component", id="automaton")
    _reals(component, STATE_NAMES, controlled=False)
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
    return {name: name for name in (*STATE_NAMES, TOUCHDOWN)}


def _sampler(root: ET.Element, model: Model, constants: Mapping[str, str]) -> dict[str, str]:
    """The sample clock, and the torques that are held from sample to sample."""
    component = ET.SubElement(root, "component", id="sampler")
    _reals(component, ("t", *_TORQUES))
    _reals(component, STATE_NAMES, controlled=False)
    names = {name: name for name in ("t", *_TORQUES, *STATE_NAMES)} | {"period": decimal(CONTROL_DT)}
    _constants(component, ["period"])
    invariant = "t <= period"
    if model.torques is not None:
        definitions = {**DERIVED, **model.torques}
        torques = [inlined(f"torque_{joint}", definitions) for joint in (1, 2)]
        _constants(component, constants)
        names |= constants
    else:
        assert model.bounds is not None
        torques = list(_ANY_TORQUES)
        _reals(component, _ANY_TORQUES, controlled=False)
        for name, low, high in zip(_ANY_TORQUES, *model.bounds, strict=True):
            invariant += f" & {low} <= {name} & {name} <= {high}"
        names |= {name: name for name in _ANY_TORQUES}
    sample = {"t": "0", **dict(zip(_TORQUES, torques, strict=True))}
    flow = " & ".join(["t' == 1", *(f"{name}' == 0" for name in _TORQUES)])
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
    _reals(component, (*STATE_NAMES, "foot", *(("t", *_TORQUES) if sampled else ())))
    _reals(
        component, [name for name in (*_ANY_TORQUES, *(() if sampled else _TORQUES)) if name in names], False
    )
    _label(component)
    for part, bound in parts.items():
        bind = ET.SubElement(component, "bind", {"component": part, "as": part})
        for key, value in bound.items():
            ET.SubElement(bind, "map", key=key).text = value


def _initially(model: Model) -> str:
    """Where it starts, as the configuration file that goes with the model has it."""
    if model.controller is None:
        return "initially: foot == 0, and any state that is in a location of the automaton and of the walker"
    values = [f"{name} == {decimal(value)}" for name, value in zip(STATE_NAMES, START, strict=True)]
    place = model.locations[model.start].name
    return "initially: " + " & ".join(
        [
            *values,
            "foot == 0",
            f"t == {decimal(CONTROL_DT)}",
            f"loc(automaton) == {place}",
            "loc(walker) == behind",
        ]
    )


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
