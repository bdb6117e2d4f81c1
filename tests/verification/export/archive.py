"""Reads a KeYmaera X archive: its grammar, whether every name is declared, and what its definitions mean."""

import math
import operator
from pathlib import Path

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput

PARSER = Lark(Path(__file__).with_name("keymaerax.lark").read_text(), parser="lalr")

_ARITHMETIC = {
    "plus": operator.add,
    "minus": operator.sub,
    "times": operator.mul,
    "over": operator.truediv,
    "negative": operator.neg,
}
_RELATIONS = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
    "!=": operator.ne,
}
_IMPORTABLE = {"sin": 1, "cos": 1, "abs": 1, "min": 2, "max": 2}
_FORMULAS = {"implies", "disjunction", "conjunction", "not", "box", "comparison", "true", "false"}


class BadArchive(Exception):
    pass


class Archive:
    """One entry; raises `BadArchive` if it is not in the grammar, or speaks of what it does not declare."""

    def __init__(self, text):
        try:
            (entry,) = PARSER.parse(text).children
        except UnexpectedInput as error:
            raise BadArchive(str(error)) from None
        self.functions = {}  # name: (its arguments, its body, whether it is a formula)
        self.imports, self.variables = {}, []
        parts = {part.data: part for part in entry.children if isinstance(part, Tree)}
        for definition in parts["definitions"].children:
            self._define(definition)
        for declaration in parts["variables"].children:
            for name in map(str, declaration.children):
                if name in self.variables or name in self.functions:
                    raise BadArchive(f"{name} is declared twice")
                self.variables.append(name)
        (self.problem,) = parts["problem"].children
        self._check(self.problem, {*self.variables}, formula=True)

    def _define(self, definition):
        if definition.data == "imports":
            for name in map(str, definition.children):
                if name not in _IMPORTABLE:
                    raise BadArchive(f"kyx.math has no {name}")
                self.imports[name] = _IMPORTABLE[name]
            return
        name, arguments, body = str(definition.children[0]), (), definition.children[-1]
        if len(definition.children) == 3:
            arguments = tuple(map(str, definition.children[1].children))
        if name in self.functions or name in self.imports:
            raise BadArchive(f"{name} is defined twice")
        is_formula = definition.data == "predicate"
        self._check(body, set(arguments), is_formula)
        self.functions[name] = (arguments, body, is_formula)

    def _check(self, node, known, formula):
        """Names are declared, calls have their arguments, terms and formulas are where they belong."""
        if isinstance(node, Token):
            return
        kind = node.data
        if kind == "name":
            name = str(node.children[0])
            constant = name in self.functions and self.functions[name][0] == ()
            if not (name in known or constant):
                raise BadArchive(f"{name} is not declared")
            if formula:
                raise BadArchive(f"{name} is a number, not a formula")
        elif kind == "call":
            name, *given = node.children
            if name in self.imports:
                count, is_formula = self.imports[name], False
            elif name in self.functions:
                arguments, _, is_formula = self.functions[name]
                count = len(arguments)
            else:
                raise BadArchive(f"{name} is not declared")
            if count != len(given):
                raise BadArchive(f"{name} takes {count} arguments, not {len(given)}")
            if is_formula != formula:
                raise BadArchive(f"{name} stands where it does not fit")
            for argument in given:
                self._check(argument, known, formula=False)
        elif kind in ("assign", "assign_any", "rate"):
            if node.children[0] not in self.variables:
                raise BadArchive(f"{node.children[0]} is not a program variable")
            for child in node.children[1:]:
                self._check(child, known, formula=False)
        elif kind == "ode":
            for child in node.children:
                self._check(child, known, formula=child.data != "rate")
        elif kind in ("program", "sequence", "block", "loop"):
            for child in node.children:
                self._check(child, known, formula=False)
        elif kind == "test":
            self._check(node.children[0], known, formula=True)
        elif kind in _FORMULAS:
            if not formula:
                raise BadArchive(f"a formula stands where a number belongs: {node}")
            for child in node.children:
                inside = kind != "comparison" and not (kind == "box" and child.data == "program")
                self._check(child, known, formula=inside)
        else:
            if formula:
                raise BadArchive(f"a number stands where a formula belongs: {node}")
            for child in node.children:
                self._check(child, known, formula=False)

    def __call__(self, name, **values):
        """The value of a defined name, given those of its arguments by name."""
        arguments, body, _ = self.functions[name]
        return self.value(body, {argument: values[argument] for argument in arguments})

    def value(self, node, values):
        """The number of a term, or the truth of a formula, at values of the variables."""
        kind, children = node.data, node.children
        match kind:
            case "number":
                return float(children[0])
            case "name":
                name = str(children[0])
                return values[name] if name in values else self(name)
            case "call":
                name, given = str(children[0]), [self.value(child, values) for child in children[1:]]
                if name in self.imports:
                    return {"abs": abs, "min": min, "max": max}.get(name, getattr(math, name, None))(*given)
                return self(name, **dict(zip(self.functions[name][0], given, strict=True)))
            case "comparison":
                left, relation, right = children
                return _RELATIONS[str(relation)](self.value(left, values), self.value(right, values))
            case "true" | "false":
                return kind == "true"
            case "not":
                return not self.value(children[0], values)
            case "conjunction":
                return all(self.value(child, values) for child in children)
            case "disjunction":
                return any(self.value(child, values) for child in children)
            case "implies":
                return not self.value(children[0], values) or self.value(children[1], values)
        return _ARITHMETIC[kind](*(self.value(child, values) for child in children))

    def after(self, program, values):
        """All values that a program without loops and flows can end with, from the given ones."""
        match program.data:
            case "program":
                return [end for choice in program.children for end in self.after(choice, values)]
            case "sequence":
                ends = [values]
                for statement in program.children:
                    ends = [end for start in ends for end in self.after(statement, start)]
                return ends
            case "block":
                return self.after(program.children[0], values)
            case "test":
                return [values] if self.value(program.children[0], values) else []
            case "assign":
                name, term = program.children
                return [values | {str(name): self.value(term, values)}]
        raise ValueError(f"{program.data} has no single end")

    @property
    def branches(self):
        """The branches of the loop that the problem is about, and what must hold after it."""
        box = next(self.problem.find_data("box"))
        (loop,) = box.children[0].find_data("loop")
        (program,) = loop.children
        return program.children
