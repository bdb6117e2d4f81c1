"""Reads a SpaceEx file: its elements, the grammar of what stands in them, and that every name is declared."""

import math
import operator
import re
import xml.etree.ElementTree as ET
from pathlib import Path

from lark import Lark, Token
from lark.exceptions import UnexpectedInput

SPACEEX = "{http://www-verimag.imag.fr/xml-namespaces/sspaceex}"
NAME = re.compile(r"[a-zA-Z_][a-zA-Z0-9_]*")
NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?")
_GRAMMAR = Path(__file__).with_name("spaceex.lark").read_text()
_PARSERS = {
    element: Lark(_GRAMMAR, parser="lalr", start=rule)
    for element, rule in {
        "invariant": "conjunction",
        "guard": "conjunction",
        "flow": "flow",
        "assignment": "assignment",
    }.items()
}
_ARITHMETIC = {
    "plus": operator.add,
    "minus": operator.sub,
    "times": operator.mul,
    "over": operator.truediv,
    "negative": operator.neg,
}
_CHILDREN = {
    "component": {"note", "param", "location", "transition", "bind"},
    "location": {"note", "invariant", "flow"},
    "transition": {"note", "label", "guard", "assignment"},
    "bind": {"note", "map"},
}


class BadModel(Exception):
    pass


class Composition:
    """All components; raises `BadModel` if one is not well formed, or speaks of what it does not declare."""

    def __init__(self, text):
        self.components, self.trees = {}, {}
        for component in ET.fromstring(text):
            if component.tag != f"{SPACEEX}component":
                raise BadModel(f"{component.tag} is no component")
            for element in component.iter():
                for child in element:
                    if child.tag.removeprefix(SPACEEX) not in _CHILDREN.get(
                        element.tag.removeprefix(SPACEEX), ()
                    ):
                        raise BadModel(f"{child.tag} in {element.tag}")
            self._read(component)
        self._check_binds()

    def _read(self, component):
        name = component.get("id")
        params = {}
        for param in component.iter(f"{SPACEEX}param"):
            if not NAME.fullmatch(param.get("name")) or param.get("name") in params:
                raise BadModel(f"{name}: {param.get('name')} is no name, or declared twice")
            params[param.get("name")] = param
        self.components[name] = component
        locations = [location.get("id") for location in component.iter(f"{SPACEEX}location")]
        if len(set(locations)) != len(locations):
            raise BadModel(f"{name}: two locations have one id")
        for location in component.iter(f"{SPACEEX}location"):
            if not NAME.fullmatch(location.get("name")):
                raise BadModel(f"{name}: {location.get('name')!r} is no name")
        for transition in component.iter(f"{SPACEEX}transition"):
            for end in ("source", "target"):
                if transition.get(end) not in locations:
                    raise BadModel(f"{name}: a transition's {end} {transition.get(end)} is no location")
            label = transition.findtext(f"{SPACEEX}label")
            if label is not None and (label not in params or params[label].get("type") != "label"):
                raise BadModel(f"{name}: label {label} is not declared")
        for kind, parser in _PARSERS.items():
            for element in component.iter(f"{SPACEEX}{kind}"):
                try:
                    tree = parser.parse(element.text or "")
                except UnexpectedInput as error:
                    raise BadModel(f"{name}, {kind}: {error}") from None
                self.trees[element] = tree
                self._check_names(name, params, tree)

    def _check_names(self, component, params, tree):
        for node in tree.iter_subtrees():
            names = [child for child in node.children if isinstance(child, Token) and child.type == "NAME"]
            for used in names:
                if used not in params or params[used].get("type") != "real":
                    raise BadModel(f"{component}: {used} is not declared")
            if node.data in ("rate", "jump"):
                changed = params[names[0]]
                if changed.get("controlled") != "true" or changed.get("dynamics") != "any":
                    raise BadModel(f"{component}: {names[0]} is not its to change")

    def _check_binds(self):
        drivers = {}
        for name, component in self.components.items():
            own = {param.get("name") for param in component.iter(f"{SPACEEX}param")}
            for bind in component.iter(f"{SPACEEX}bind"):
                part = self.components.get(bind.get("component"))
                if part is None:
                    raise BadModel(f"{name}: {bind.get('component')} is no component")
                params = {param.get("name"): param for param in part.iter(f"{SPACEEX}param")}
                values = {one.get("key"): one.text for one in bind}
                if set(values) != set(params):
                    raise BadModel(f"{name}: {set(values) ^ set(params)} is not bound")
                for key, value in values.items():
                    constant = params[key].get("dynamics") == "const"
                    if value not in own and not (constant and NUMBER.fullmatch(value)):
                        raise BadModel(f"{name}: {key} is bound to {value}")
                    if (
                        params[key].get("type") == "real"
                        and params[key].get("controlled") == "true"
                        and not constant
                    ):
                        drivers.setdefault((name, value), []).append(bind.get("as"))
            if any(True for _ in component.iter(f"{SPACEEX}bind")):
                for param in component.iter(f"{SPACEEX}param"):
                    count = len(drivers.get((name, param.get("name")), []))
                    if param.get("type") == "real" and count != (param.get("controlled") == "true"):
                        raise BadModel(f"{name}: {param.get('name')} is driven by {count} components")

    def constants(self, component):
        """The numbers that the system binds a component's constants to."""
        (bind,) = [one for one in self.components["system"] if one.get("component") == component]
        return {one.get("key"): float(one.text) for one in bind if NUMBER.fullmatch(one.text)}

    def flow(self, component, location, values):
        """The rates of a component in a location, by name."""
        (place,) = [one for one in self.components[component] if one.get("name") == location]
        return self._changed(place.find(f"{SPACEEX}flow"), values | self.constants(component))

    def assigned(self, component, label, values):
        """What a component's only transition with this label, or without one, assigns, by name."""
        transitions = self.components[component].iter(f"{SPACEEX}transition")
        (transition,) = [one for one in transitions if one.findtext(f"{SPACEEX}label") == label]
        return self._changed(transition.find(f"{SPACEEX}assignment"), values | self.constants(component))

    def _changed(self, element, values):
        tree = self.trees[element]
        return {str(change.children[0]): _value(change.children[1], values) for change in tree.children}


def _value(node, values):
    match node.data:
        case "number":
            return float(node.children[0])
        case "name":
            return values[str(node.children[0])]
        case "call":
            function, argument = node.children
            return getattr(math, str(function))(_value(argument, values))
    return _ARITHMETIC[node.data](*(_value(child, values) for child in node.children))
