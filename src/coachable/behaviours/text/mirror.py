"""Mirror images: the words of a mirror swapped in the names of a text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from coachable.behaviours.behaviour import Assignment, Edge
from coachable.behaviours.expressions import Constant, Expression, Variable
from coachable.behaviours.predicates import Phrase, Predicate
from coachable.behaviours.tree import Node, rewritten


@dataclass(frozen=True)
class Mirror:
    """An involution on words: `{"left": "right", "right": "left"}`, and the same with capitals."""

    words: Mapping[str, str]

    @staticmethod
    def of(pairs: Iterable[tuple[str, str]]) -> Mirror:
        """The mirror that swaps the words of each pair."""
        words: dict[str, str] = {}
        for left, right in pairs:
            for change in (str, str.capitalize, str.upper):
                words |= {change(left): change(right), change(right): change(left)}
        return Mirror(MappingProxyType(words))

    def text(self, text: str) -> str:
        """The text with whole words swapped; an underscore or a hyphen ends a word, as in `left_knee`."""
        either = "|".join(map(re.escape, self.words))
        return re.sub(rf"(?<![^\W_])(?:{either})(?![^\W_])", lambda match: self.words[match.group()], text)

    def constant(self, constant: Constant) -> Constant:
        """The constant under its mirrored name; one whose name stays is the same on both sides."""
        name = self.text(constant.name)
        return (
            constant
            if name == constant.name
            else Constant(name, constant.number, self.text(constant.description))
        )

    def expression(self, expression: Expression, constants: Mapping[str, Constant]) -> Expression:
        """The expression of the other side; `constants` are those that have a value of their own."""

        return rewritten(expression, self._image_of(constants))

    def predicate(
        self,
        predicate: Predicate,
        constants: Mapping[str, Constant],
        phrase: Callable[[Phrase], Phrase],
    ) -> Predicate:
        """The predicate of the other side; `phrase` gives a phrase's mirror image."""
        image_of = self._image_of(constants)
        return rewritten(predicate, lambda node: phrase(node) if isinstance(node, Phrase) else image_of(node))

    def _image_of(self, constants: Mapping[str, Constant]) -> Callable[[Node], Expression | None]:
        def image(node: Node) -> Expression | None:
            match node:
                case Variable(name):
                    return Variable(self.text(name))
                case Constant(name):
                    return constants.get(self.text(name)) or self.constant(node)

        return image

    def edge(self, edge: Edge, constants: Mapping[str, Constant]) -> Edge:
        """The edge of the other side."""
        return Edge(
            self.text(edge.source),
            self.text(edge.target),
            None if edge.event is None else self.text(edge.event),
            tuple(
                Assignment(self.text(a.signal), self.expression(a.expression, constants)) for a in edge.reset
            ),
        )
