"""The laws of walking, folding and rewriting the syntax tree, on random predicates."""

from dataclasses import fields

from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours import All, Between, Comparison, Constant, Not, Number, Phrase, Variable
from coachable.behaviours.expressions import Arithmetic, Call, Negative
from coachable.behaviours.rewriting import expanded, normal_form, without_negations
from coachable.behaviours.tree import Node, children, fold, rebuilt, rewritten, walk
from tests.behaviours.random_behaviours import built, expressions, predicates

LEAVES = st.sampled_from([(Variable, "x"), (Variable, "y"), (Constant, "k", (Number, 2.0)), (Number, 3.0)])
OPERANDS = expressions(LEAVES)
TREES = predicates(OPERANDS, ((Phrase, "is high", (Comparison, "x", ">", 1.0)),))


@given(TREES)
def test_a_node_over_its_own_children_is_equal_to_it(drawn):
    tree = built(drawn)
    for node in walk(tree):
        assert rebuilt(node, children(node)) == node
    assert rewritten(tree, lambda node: None) == tree
    assert rewritten(tree, lambda node: node) is tree


@given(TREES)
def test_a_fold_visits_the_nodes_of_the_walk(drawn):
    tree = built(drawn)
    assert fold(tree, lambda node, below: [node, *(one for part in below for one in part)]) == [*walk(tree)]
    assert [*walk(tree, Variable, Not)] == [node for node in walk(tree) if isinstance(node, Variable | Not)]


@given(TREES)
def test_no_node_in_a_field_is_left_out(drawn):
    """But for deadbands and the numbers of constants, which are not operands."""
    for node in walk(built(drawn)):
        held = [
            getattr(node, field.name) for field in fields(node) if field.name not in ("deadband", "number")
        ]
        flat = [one for value in held for one in (value if isinstance(value, tuple) else (value,))]
        assert [one for one in flat if isinstance(one, Node)] == [*children(node)]


@given(TREES)
def test_what_is_replaced_is_not_searched_again(drawn):
    w = Arithmetic(Variable("x"), "+", Number(1))
    changed = rewritten(built(drawn), lambda node: w if node == Variable("x") else None)
    found = [node for node in walk(changed) if node == Variable("x")]
    assert len(found) == sum(node == w for node in walk(changed))


@given(TREES)
def test_a_predicate_without_negations_has_none_and_means_the_same(drawn):
    tree = built(drawn)
    plain = without_negations(expanded(tree))
    assert not any(walk(plain, Not))
    assert normal_form(plain) == normal_form(tree)


def test_nodes_come_from_the_outside_in_and_from_left_to_right():
    x, y = Variable("x"), Variable("y")
    total = Arithmetic(Negative(x), "+", Call("min", y, x))
    between, comparison = Between(0, "<", total, "<=", y), Comparison(y, "<", x)
    predicate = All(between, Not(comparison))
    inside = [Number(0), total, Negative(x), x, Call("min", y, x), y, x, y]
    assert [*walk(predicate)] == [predicate, between, *inside, Not(comparison), comparison, y, x]


def test_a_tree_as_deep_as_it_is_long_is_walked_and_folded():
    total = Variable("x")
    for _ in range(5_000):
        total = Negative(total)
    assert sum(1 for _ in walk(total)) == 5_001
    assert fold(total, lambda _, below: 1 + max(below, default=0)) == 5_001
