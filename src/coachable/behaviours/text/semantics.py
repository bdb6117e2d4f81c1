"""Parse trees as predicates and expressions over declared names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lark import Token, Tree

from coachable.behaviours.expressions import (
    FUNCTIONS,
    Arithmetic,
    Call,
    Constant,
    Expression,
    Negative,
    Number,
    Variable,
)
from coachable.behaviours.names import spelt_out
from coachable.behaviours.predicates import (
    All,
    Any,
    Between,
    Comparison,
    Near,
    Not,
    Phrase,
    Predicate,
    Signal,
)
from coachable.behaviours.text.diagnostics import Diagnostics, Place
from coachable.behaviours.text.mirror import Mirror
from coachable.behaviours.text.syntax import Statement
from coachable.behaviours.tree import children, fold
from coachable.foundation.errors import BehaviourError
from coachable.foundation.suggestion import suggestion

MAX_DEPTH = 60
MAX_SIZE = 5000
"""The greatest depth and number of parts of a predicate, phrases expanded; a sum is as deep as it is long."""

Measure = tuple[int, int]
"""Size and depth."""


class Scope:
    """The names that a text declares, and the predicates and expressions that its lines denote.

    The methods return `None` for a line with an error, which is recorded once.
    """

    def __init__(
        self,
        diagnostics: Diagnostics,
        signals: Mapping[str, Signal],
        constants: Mapping[str, Constant],
        phrases: Mapping[str, Statement],
        mirror: Mirror | None,
        broken: frozenset[str],
    ):
        self._mirror = mirror
        self._diagnostics = diagnostics
        self._signals = signals
        self._constants = constants
        self._statements = phrases
        self._broken = broken
        self._phrases: dict[str, Phrase | None] = {}
        self._measures: dict[str, Measure] = {}
        self._open: list[str] = []

    def phrase(self, words: str) -> Phrase | None:
        """The phrase of these words, from the vocabulary or as the mirror image of one that is there."""
        if words in self._phrases:
            return self._phrases[words]
        if words not in self._statements:
            return self._image(words)
        statement = self._statements[words]
        if words in self._open or len(self._open) >= MAX_DEPTH:
            circle = [*self._open[self._open.index(words) :], words] if words in self._open else []
            message = f"phrase {words!r} is defined by itself: {' → '.join(circle[:6])}"
            if not circle:
                message = f"phrases are defined by one another more than {MAX_DEPTH} deep"
            self._diagnostics.add(statement.place(), message)
            self._phrases[words] = None
            return None
        self._open.append(words)
        assert statement.tree is not None
        predicate = self.predicate(statement, statement.tree.children[1])
        self._open.pop()
        if words not in self._phrases:
            self._phrases[words] = None if predicate is None else Phrase(words, predicate)
            if predicate is not None:
                self._measures[words] = self.measure(predicate)
        return self._phrases[words]

    def is_phrase(self, words: str) -> bool:
        """Whether these words are in the vocabulary, or would be in its mirror image."""
        return words in self._statements or (
            self._mirror is not None and self._mirror.text(words) in self._statements
        )

    def mirrored(self, predicate: Predicate) -> Predicate:
        """The predicate of the other side; without a mirror there is none, and it stays."""
        if self._mirror is None:
            return predicate
        return self._mirror.predicate(predicate, self._constants, self._mirrored_phrase)

    def _mirrored_phrase(self, phrase: Phrase) -> Phrase:
        assert self._mirror is not None
        return self.phrase(self._mirror.text(phrase.words)) or phrase

    def _image(self, words: str) -> Phrase | None:
        """The phrase that only exists as a mirror image."""
        assert self._mirror is not None
        original = self.phrase(self._mirror.text(words))
        self._phrases[words] = None if original is None else Phrase(words, self.mirrored(original.predicate))
        if original is not None:
            self._measures[words] = self._measures[original.words]
        return self._phrases[words]

    def predicate(self, statement: Statement, tree: Tree | Token) -> Predicate | None:
        """The predicate that a parse tree denotes."""
        predicate = self._predicate(statement, tree)
        if predicate is not None:
            size, depth = self.measure(predicate)
            if size > MAX_SIZE or depth > MAX_DEPTH:
                self._diagnostics.add(
                    statement.place(),
                    f"this has {size} parts, {depth} deep, once phrases are expanded; "
                    f"no more than {MAX_SIZE} and {MAX_DEPTH} are read",
                )
                return None
        return predicate

    def expression(self, statement: Statement, tree: Tree | Token) -> Expression | None:
        """The expression that a parse tree denotes."""
        match tree:
            case Tree(data="number"):
                return self._number(statement, tree)
            case Tree(data="words"):
                return self._variable(statement, tree)
            case Tree(data="group", children=[inner]):
                return self.expression(statement, inner)
            case Tree(data="negative", children=[inner]):
                operand = self.expression(statement, inner)
                if isinstance(operand, Number) and inner.data == "number":
                    return Number(-operand.value, operand.unit)
                return None if operand is None else Negative(operand)
            case Tree(data="call", children=[Token() as name, *arguments]):
                return self._call(statement, name, [self.expression(statement, a) for a in arguments])
            case Tree(data="sum" | "product", children=children):
                return self._chain(statement, children)
        self._diagnostics.add(place_of(statement, tree), "a condition has no value to calculate with")
        return None

    def measure(self, predicate: Predicate) -> Measure:
        """The size and depth of a predicate, phrases expanded."""
        if isinstance(predicate, Phrase) and predicate.words in self._measures:
            return _around([self._measures[predicate.words]])
        if isinstance(predicate, Phrase | Not | All | Any):
            return _around(map(self.measure, children(predicate)))
        return fold(predicate, lambda _, inner: _around(inner))

    def _predicate(self, statement: Statement, tree: Tree | Token) -> Predicate | None:
        match tree:
            case Tree(data="words"):
                return self._phrase_or_truth(statement, tree)
            case Tree(data="group", children=[inner]):
                return self._predicate(statement, inner)
            case Tree(data="negation", children=[inner]):
                part = self._predicate(statement, inner)
                return None if part is None else Not(part)
            case Tree(data="all" | "any" as kind, children=children):
                parts = [self._predicate(statement, child) for child in children]
                if any(part is None for part in parts):
                    return None
                return (All if kind == "all" else Any)(*(part for part in parts if part is not None))
            case Tree(data="comparison" | "between" | "near", children=children):
                return self._compared(statement, tree, list(children))
        self._diagnostics.add(
            place_of(statement, tree), "this is a number; compare it with something", "for example: x > 0"
        )
        return None

    def _compared(self, statement: Statement, tree: Tree, children: list) -> Predicate | None:
        deadband = None
        if isinstance(children[-1], Tree) and children[-1].data == "deadband":
            deadband = self._number(statement, children.pop().children[0])
        relations = [str(child) for child in children if isinstance(child, Token)]
        sides = [self.expression(statement, child) for child in children if isinstance(child, Tree)]
        known = [side for side in sides if side is not None]
        if len(known) < len(sides):
            return None
        if tree.data == "near":
            return Near(known[0], known[1], known[2])
        if tree.data == "comparison":
            return Comparison(known[0], relations[0], known[1], deadband)
        if not all(relation in ("<", "<=") for relation in relations):
            place = statement.place(next(c for c in children if isinstance(c, Token) and c[0] == ">"))
            self._diagnostics.add(place, "a range goes from low to high", "for example: 0.1 < x <= 0.3")
            return None
        return Between(known[0], relations[0], known[1], relations[1], known[2], deadband)

    def _phrase_or_truth(self, statement: Statement, tree: Tree) -> Predicate | None:
        words = words_of(tree)
        if words in ("true", "false"):
            return All() if words == "true" else Any()
        if self.is_phrase(words):
            return self.phrase(words)
        if words in self._broken:
            return None
        if words in self._signals or words in self._constants:
            message, hint = f"{words} is a number; compare it with something", f"for example: {words} > 0"
        else:
            message = f"{spelt_out(words[:80])} is not in the vocabulary"
            hint = suggestion(words, [*self._statements, *self._broken])
        self._diagnostics.add(place_of(statement, tree), message, hint)
        return None

    def _variable(self, statement: Statement, tree: Tree) -> Variable | Constant | None:
        words = words_of(tree)
        if words in self._signals:
            return Variable(words)
        if words in self._constants:
            return self._constants[words]
        if self._mirror is not None and (other := self._constants.get(self._mirror.text(words))) is not None:
            return self._mirror.constant(other)
        if words in self._broken:
            return None
        hint = suggestion(words, [*self._signals, *self._constants, *self._broken])
        if self.is_phrase(words):
            message, hint = "a phrase is a condition; it has no value to calculate or compare with", ""
        elif "-" in words and set(words.split("-")) <= {*self._signals, *self._constants}:
            message, hint = f"no signal is called {words!r}", f"write {' - '.join(words.split('-'))}"
        else:
            message = f"{spelt_out(words[:80])} is neither a signal nor a constant"
        self._diagnostics.add(place_of(statement, tree), message, hint)
        return None

    def _number(self, statement: Statement, tree: Tree) -> Number | None:
        try:
            return number_of(tree.children)
        except BehaviourError as error:
            self._diagnostics.add(place_of(statement, tree), str(error))
            return None

    def _call(self, statement: Statement, name: Token, operands: list[Expression | None]) -> Call | None:
        known = [operand for operand in operands if operand is not None]
        try:
            if str(name) in FUNCTIONS and len(known) < len(operands):
                return None
            return Call(str(name), *known)
        except BehaviourError as error:
            self._diagnostics.add(statement.place(name), str(error))
            return None

    def _chain(self, statement: Statement, children: list) -> Expression | None:
        if len(children) > 2 * MAX_DEPTH:
            place = place_of(statement, children[2 * MAX_DEPTH])
            self._diagnostics.add(place, f"no more than {MAX_DEPTH} terms are read in a row")
            return None
        result, *others = (self.expression(statement, child) for child in children[::2])
        for sign, operand in zip(children[1::2], others, strict=True):
            if result is None or operand is None:
                return None
            result = Arithmetic(result, str(sign), operand)
        return result


def number_of(tokens: Iterable) -> Number:
    """The number in a sequence of tokens: an optional minus, the digits, an optional unit.

    **Raises:** `BehaviourError` if it is too large to be one.
    """
    by_type = {token.type: str(token) for token in tokens if isinstance(token, Token)}
    unit = " ".join(by_type.get("UNIT", "[]")[1:-1].split())
    return Number(float(by_type["NUMBER"]) * (-1.0 if "MINUS" in by_type else 1.0), unit)


def words_of(tree: Tree) -> str:
    """The words of a phrase, with single spaces between them."""
    return " ".join(map(str, tree.children))


def place_of(statement: Statement, tree: Tree | Token) -> Place:
    """The place where a part of a statement begins."""
    if isinstance(tree, Token):
        return statement.place(tree)
    return statement.place(next(tree.scan_values(lambda value: isinstance(value, Token)), None))


def _around(inner: Iterable[Measure]) -> Measure:
    sizes, depths = zip((0, 0), *inner, strict=True)
    return sum(sizes) + 1, max(depths) + 1
