"""Random behaviours for Hypothesis, as recipes that `built` turns into values.

Values are built in the test and not by the strategy, for beartype draws random numbers of its own.
"""

import math
from typing import Any as Anything

from hypothesis import assume
from hypothesis import strategies as st

from coachable.behaviours import (
    All,
    Any,
    Assignment,
    Between,
    Comparison,
    Constant,
    Dwell,
    Edge,
    Near,
    Not,
    Number,
    Phase,
    Phrase,
    Signal,
    Variable,
)
from coachable.behaviours.expressions import Arithmetic, Call, Negative
from coachable.behaviours.names import RESERVED

ODD = ["", "a b", "a  b", '"', "# no", "\\", "left", "x\ny", "(a)", "=", "\u202e", "\U0001f600", "\ufeff"]
TEXT = st.text(max_size=12) | st.sampled_from(ODD)
WORDS = st.from_regex(r"[a-zäθ][a-z0-9_äθ]{0,5}(-[a-z]{1,3})?", fullmatch=True).filter(
    lambda word: word not in RESERVED
)
NAMES = st.from_regex(r"[a-z_][a-z0-9_]{0,6}", fullmatch=True).filter(lambda name: name not in RESERVED)
UNITS = st.sampled_from(["", "rad", "rad/s", "m/s^2", "N m", "°", "%"])
FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def built(recipe: Anything) -> Anything:
    """What a recipe, a tuple of a class and recipes for its arguments, makes; anything else as it is."""
    if isinstance(recipe, tuple) and recipe and callable(recipe[0]):
        kind, *arguments = recipe
        return kind(*map(built, arguments))
    return tuple(map(built, recipe)) if isinstance(recipe, tuple) else recipe


def recipe(kind, *arguments):
    return st.tuples(st.just(kind), *arguments)


NUMBERS = recipe(Number, FLOATS | st.integers(-9, 9), UNITS)


def expressions(leaves):
    return st.recursive(
        leaves,
        lambda inner: (
            recipe(Negative, inner)
            | recipe(Arithmetic, inner, st.sampled_from("+-*/"), inner)
            | recipe(Call, st.sampled_from(["sin", "cos", "abs"]), inner)
            | recipe(Call, st.sampled_from(["min", "max"]), inner, inner)
            | recipe(Call, st.sampled_from(["min", "max"]), inner, inner, inner)
        ),
        max_leaves=5,
    )


def predicates(operands, phrases=()):
    relations, ranges = st.sampled_from(["<", "<=", ">", ">="]), st.sampled_from(["<", "<="])
    deadbands = st.none() | recipe(Number, st.floats(0, 9), UNITS)
    atoms = (
        recipe(Comparison, operands, relations, operands, deadbands)
        | recipe(Between, operands, ranges, operands, ranges, operands, deadbands)
        | recipe(Near, operands, operands, operands)
        | st.sampled_from([(All,), (Any,), *phrases])
    )
    return st.recursive(
        atoms,
        lambda inner: (
            st.lists(inner, max_size=3).map(lambda parts: (All, *parts))
            | st.lists(inner, max_size=3).map(lambda parts: (Any, *parts))
            | recipe(Not, inner)
        ),
        max_leaves=5,
    )


@st.composite
def behaviours(draw):
    """A recipe for each argument of `Behaviour`."""
    *names, constant = draw(st.lists(NAMES, min_size=2, max_size=6, unique=True))
    signals = [draw(recipe(Signal, st.just(name), UNITS, TEXT)) for name in names]
    if draw(st.booleans()):
        signals.append(draw(recipe(Signal, st.just("rate__"), UNITS, TEXT, st.sampled_from(names))))
    constants = (draw(recipe(Constant, st.just(constant), NUMBERS, TEXT)),)
    leaves = st.sampled_from([*((Variable, name) for name in names), *constants]) | NUMBERS
    operands = expressions(leaves)
    phrases: tuple = ()
    some_words = st.lists(WORDS, min_size=1, max_size=4).map(" ".join)
    for words in draw(st.lists(some_words, max_size=3, unique=True)):
        phrases += ((Phrase, words, draw(predicates(operands, phrases))),)
    phase_names = draw(st.lists(TEXT.filter(str.strip) | WORDS, min_size=1, max_size=4, unique=True))
    dwells = st.none() | recipe(Dwell, st.floats(0, 9), st.floats(0, 9) | st.just(math.inf))
    phases = tuple(
        (Phase, name, draw(TEXT), draw(predicates(operands, phrases)), draw(dwells)) for name in phase_names
    )
    assignments = recipe(Assignment, st.sampled_from(names), operands)
    resets = st.lists(assignments, max_size=2, unique_by=lambda a: a[1]).map(tuple)
    ends = st.sampled_from(phase_names)
    edge = recipe(Edge, ends, ends, st.none() | TEXT | WORDS, resets)
    edges = draw(st.lists(edge, max_size=5, unique_by=repr))
    return {
        "name": draw(TEXT),
        "description": draw(TEXT | st.lists(TEXT, max_size=3).map("\n".join)),
        "signals": tuple(signals),
        "phases": phases,
        "edges": tuple(edges),
        "cycles": draw(st.lists(closed_walks(edges), max_size=2).map(tuple)) if edges else (),
        "constants": constants,
        "vocabulary": phrases,
        "outside": draw(st.none() | TEXT),
    }


@st.composite
def closed_walks(draw, edges):
    walk = [draw(st.sampled_from(edges))]
    while walk[-1][2] != walk[0][1]:
        following = [edge for edge in edges if edge[1] == walk[-1][2]]
        assume(following and len(walk) < 6)
        walk.append(draw(st.sampled_from(following)))
    return tuple(walk)
