"""Reading JSON that a person may have written: every complaint says where in the document it applies."""

from __future__ import annotations

import json
from collections.abc import Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NoReturn

from coachable.behaviours.predicates import All, Any, Comparison, Not, Predicate
from coachable.behaviours.suggestion import suggestion
from coachable.errors import BehaviourError


def predicate_to_data(predicate: Predicate) -> dict:
    """The predicate as JSON data: an object with signal, relation and bound, or with all, any or not."""
    match predicate:
        case Comparison(signal, relation, bound):
            return {"signal": signal, "relation": relation, "bound": bound}
        case All(parts=parts):
            return {"all": [predicate_to_data(part) for part in parts]}
        case Any(parts=parts):
            return {"any": [predicate_to_data(part) for part in parts]}
        case Not(part):
            return {"not": predicate_to_data(part)}


@dataclass(frozen=True)
class Node:
    """A value in a JSON document together with its place there, such as `phases[2].predicate`."""

    value: object
    place: str = ""

    @staticmethod
    def parse(text: str) -> Node:
        """The document's root. **Raises:** `BehaviourError` with line and column if the text is not JSON."""
        try:
            return Node(json.loads(text, parse_constant=_refuse_constant))
        except json.JSONDecodeError as error:
            raise BehaviourError(
                f"line {error.lineno}, column {error.colno}: not JSON: {error.msg}"
            ) from None
        except ValueError as error:
            raise BehaviourError(f"the document holds a number that cannot be read: {error}") from None

    def fail(self, complaint: str) -> NoReturn:
        """**Raises:** `BehaviourError`: the complaint, behind the place."""
        raise BehaviourError(f"{self.place or 'the document'}: {complaint}")

    def fields(self, required: Set[str], optional: Set[str] = frozenset()) -> dict[str, Node]:
        """The fields of an object; a missing or an unknown one is an error."""
        if not isinstance(self.value, dict):
            self.fail(f"expected an object with {', '.join(sorted(required))}, found {self.value!r}")
        for name in self.value.keys() - (required | optional):
            self.fail(f"unknown field {name!r}; {suggestion(name, sorted(required | optional))}")
        for name in sorted(required - self.value.keys()):
            self.fail(f"the field {name!r} is missing")
        return {name: Node(value, f"{self.place}.{name}".lstrip(".")) for name, value in self.value.items()}

    def items(self) -> Iterator[Node]:
        """The items of a list."""
        if not isinstance(self.value, list):
            self.fail(f"expected a list, found {self.value!r}")
        return (Node(value, f"{self.place}[{index}]") for index, value in enumerate(self.value))

    def text(self) -> str:
        """The value, which must be a string."""
        if not isinstance(self.value, str):
            self.fail(f"expected text, found {self.value!r}")
        return self.value

    def number(self) -> float:
        """The value, which must be a number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            self.fail(f"expected a number, found {self.value!r}")
        try:
            return float(self.value)
        except OverflowError:
            self.fail("the number is too large")

    def predicate(self) -> Predicate:
        """The value as a predicate; the inverse of `predicate_to_data`."""
        match self.value:
            case {"all": _}:
                return All(*(part.predicate() for part in self.fields({"all"})["all"].items()))
            case {"any": _}:
                return Any(*(part.predicate() for part in self.fields({"any"})["any"].items()))
            case {"not": _}:
                return Not(self.fields({"not"})["not"].predicate())
            case {"signal": _} | {"relation": _} | {"bound": _}:
                fields = self.fields({"signal", "relation", "bound"})
                signal, relation, bound = fields["signal"], fields["relation"], fields["bound"]
                arguments = signal.text(), relation.text(), bound.number()
                with located(self.place):
                    return Comparison(*arguments)
            case _:
                self.fail(f'expected a comparison or "all", "any" or "not", found {self.value!r}')


@contextmanager
def located(place: str) -> Iterator[None]:
    """Puts a place in front of whatever a `BehaviourError` raised inside complains about."""
    try:
        yield
    except BehaviourError as error:
        raise BehaviourError(f"{place}: {error}") from None


def _refuse_constant(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a finite number")
