"""What bounds decide is what the solver decides, and many phases are not asked of it one by one."""

import itertools
import random

import pytest

from coachable.behaviours.behaviour import Phase
from coachable.behaviours.checking.boxes import is_in_the_middle, pairs_not_apart
from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.solver import cells, cut_of, refuted, smt
from coachable.behaviours.expressions import Arithmetic, Number, Variable
from coachable.behaviours.predicates import All, Comparison, Not
from coachable.behaviours.text.parser import parse

SIGNALS = ("x", "y")


def a_bound(generator):
    signal, number = Variable(generator.choice(SIGNALS)), generator.randint(-2, 2)
    relation = generator.choice(["<", "<=", ">", ">="])
    match generator.randrange(3):
        case 0:
            return Comparison(signal, relation, number)
        case 1:
            return Comparison(number, relation, signal)
        case _:
            return Comparison(Arithmetic(Number(-2), "*", signal), relation, number)


def holds_somewhere(*predicates):
    return not refuted(SIGNALS, *predicates)


def test_pairs_are_kept_apart_where_the_solver_refutes_them():
    generator = random.Random(0)
    phases = []
    while len(phases) < 25:
        predicate = All(*(a_bound(generator) for _ in range(generator.randint(1, 4))))
        if holds_somewhere(predicate):
            phases.append(Phase(f"P{len(phases)}", "", predicate))
    pairs = itertools.combinations(phases, 2)
    expected = [(a, b) for a, b in pairs if holds_somewhere(a.predicate, b.predicate)]
    assert pairs_not_apart(phases) == expected
    assert 0 < len(expected) < 300
    assert pairs_not_apart([]) == []


def test_what_holds_in_the_middle_holds_somewhere():
    generator = random.Random(1)
    predicates = [All(*(a_bound(generator) for _ in range(3))) for _ in range(60)]
    found = [predicate for predicate in predicates if is_in_the_middle(predicate)]
    assert len(found) > 20
    assert all(map(holds_somewhere, found))
    assert not is_in_the_middle(Comparison("x", "<", "y"))


def test_the_cells_of_bounds_are_those_that_the_solver_finds():
    generator = random.Random(2)
    for _ in range(8):
        cuts = {}
        for _ in range(4):
            cut = a_bound(generator)
            cuts.setdefault(cut_of(cut, SIGNALS)[0], cut)
        sides = itertools.product((True, False), repeat=len(cuts))
        expected = [
            cell
            for cell in sides
            if holds_somewhere(*(c if up else Not(c) for c, up in zip(cuts.values(), cell, strict=True)))
        ]
        assert cells(SIGNALS, tuple(cuts.values()), 100) == expected
        assert cells(SIGNALS, tuple(cuts.values()), len(expected) - 1) is None


@pytest.mark.parametrize("rate", ["", "  v = d/dt x [m/s]\n"])
def test_the_solver_is_asked_twice_as_often_for_twice_the_bands(monkeypatch, rate):
    asked = []
    limited = smt._limited
    monkeypatch.setattr(smt, "_limited", lambda kind: asked.append(kind) or limited(kind))

    def count(bands):
        rows = "\n".join(f"  P{i}: x >= {i} [m], x < {i + 1} [m]" for i in range(bands))
        edges = "\n".join(f"  P{i} -> P{i + 1}" for i in range(bands - 1))
        text = f'behaviour "bands"\n\nsignals\n  x [m]\n{rate}\nphases\n{rows}\n\nedges\n{edges}\n'
        asked.clear()
        assert not [one for one in check(parse(text)).findings if one.severity == "error"]
        return len(asked)

    assert count(24) < 2.3 * count(12)
