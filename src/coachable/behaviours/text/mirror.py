"""Mirror images: the words of a mirror swapped in the names of a text, and lateral signals' signs changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from coachable.behaviours.behaviour import Assignment, Edge, Symmetry
from coachable.behaviours.expressions import Constant, Expression, Negative, Number, Variable
from coachable.behaviours.predicates import MIRRORED, Comparison, Phrase, Predicate
from coachable.behaviours.tree import Node, rewritten


@dataclass(frozen=True)
class Mirror:
    """A symmetry as it is applied to what a text declares.

    `flips` are the signals whose image has the other sign, on both sides, and their derivatives.
    """

    symmetry: Symmetry
    flips: frozenset[str] = frozenset()

    @staticmethod
    def of(symmetry: Symmetry) -> Mirror:
        """The mirror of a symmetry, without derivatives."""
        both = (name for one in symmetry.flips for name in (one, symmetry.image(one)))
        return Mirror(symmetry, frozenset(both))

    def with_derivatives(self, derivatives: Mapping[str, str]) -> Mirror:
        """The same, in which signals change their sign whose primitive does: signal → what it derives."""
        flips = set(self.flips)
        for _ in derivatives:
            flips |= {name for name, primitive in derivatives.items() if primitive in flips}
        return replace(self, flips=frozenset(flips))

    def text(self, text: str) -> str:
        """The text with whole words swapped."""
        return self.symmetry.image(text)

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

    def _image_of(self, constants: Mapping[str, Constant]) -> Callable[[Node], Node | None]:
        def image(node: Node) -> Node | None:
            match node:
                # −x > 0.1 is written x < −0.1.
                case Comparison(Variable(name), relation, Number(value, unit), deadband) if (
                    name in self.flips
                ):
                    bound = Number(-value if value else value, unit)
                    return Comparison(Variable(self.text(name)), MIRRORED[relation], bound, deadband)
                case Negative(Variable(name)) if name in self.flips:
                    return Variable(self.text(name))
                case Variable(name) if name in self.flips:
                    return Negative(Variable(self.text(name)))
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
            tuple(self._assignment(assignment, constants) for assignment in edge.reset),
        )

    def _assignment(self, assignment: Assignment, constants: Mapping[str, Constant]) -> Assignment:
        image, signal = self.expression(assignment.expression, constants), self.text(assignment.signal)
        if assignment.signal not in self.flips:
            return Assignment(signal, image)
        return Assignment(signal, image.operand if isinstance(image, Negative) else Negative(image))
