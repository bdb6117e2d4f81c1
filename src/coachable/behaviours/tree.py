"""The syntax tree that expressions and predicates form: how it is walked, folded and rewritten."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from typing import Any, ClassVar, TypeVar

Value = TypeVar("Value")
Kind = TypeVar("Kind", bound="Node")


class Node:
    """An expression or a predicate: a frozen dataclass some of whose fields hold the nodes below it.

    The number in a constant and a deadband belong to the node itself: they are not below it.
    """

    CHILDREN: ClassVar[tuple[str, ...]] = ()
    """The fields that hold the nodes below, from left to right: each a node, or a tuple of nodes."""


def children(node: Node) -> tuple[Any, ...]:
    """The nodes directly below a node, from left to right."""
    below: list[Node] = []
    for name in node.CHILDREN:
        value = getattr(node, name)
        below += value if isinstance(value, tuple) else (value,)
    return tuple(below)


def rebuilt(node: Kind, new: Sequence[Node]) -> Kind:
    """The same node over other children, as many as it has."""
    result, rest = copy(node), iter(new)
    for name in node.CHILDREN:
        old = getattr(node, name)
        value = tuple(next(rest) for _ in old) if isinstance(old, tuple) else next(rest)
        object.__setattr__(result, name, value)
    return result


def walk(root: Node, *kinds: type[Kind]) -> Iterator[Kind]:
    """The nodes of a tree, the root included: each before those below it, from left to right.

    **Arguments:** `kinds`: the types of the nodes to give; all nodes without them.
    """
    waiting: list[Any] = [root]
    while waiting:
        node = waiting.pop()
        if not kinds or isinstance(node, kinds):
            yield node
        waiting += reversed(children(node))


def fold(root: Node, combine: Callable[[Any, list[Value]], Value]) -> Value:
    """The value of a tree, computed from the leaves up and from left to right, without recursion.

    **Arguments:** `combine`: from a node and the values of its children to the node's own value.
    """
    values: list[Value] = []
    waiting = [(root, False)]
    while waiting:
        node, ready = waiting.pop()
        below = children(node)
        if below and not ready:
            waiting.append((node, True))
            waiting += ((child, False) for child in reversed(below))
        else:
            start = len(values) - len(below)
            values[start:] = [combine(node, values[start:])]
    return values[0]


def rewritten(root: Node, change: Callable[[Any], Node | None]) -> Any:
    """The tree with some of its nodes replaced, the outermost first.

    **Arguments:** `change`: from a node to its replacement, which is not searched again, or `None` to keep
    the node and continue below it.
    """
    replacement = change(root)
    if replacement is not None:
        return replacement
    return rebuilt(root, [rewritten(child, change) for child in children(root)])
