import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Comparison, Constant, Number, Variable
from coachable.behaviours.expressions import Arithmetic, Call, evaluate
from coachable.behaviours.text.parser import parse
from coachable.foundation.errors import BehaviourError
from tests.behaviours.random_behaviours import built, expressions, recipe

NAMES = ("x", "y", "z")
LEAVES = (
    recipe(Variable, st.sampled_from(NAMES))
    | recipe(Constant, st.just("k"), st.just((Number, 2.5, "rad")))
    | recipe(Number, st.floats(-9, 9) | st.integers(-9, 9), st.sampled_from(["", "rad"]))
)
VALUES = st.fixed_dictionaries(dict.fromkeys(NAMES, st.floats(-9, 9)))

WORDS = {
    "sin": math.sin, "cos": math.cos, "abs": abs, "min": min, "max": max, "k": 2.5,
    "__builtins__": {},
}  # fmt: skip


@settings(max_examples=150)
@given(expressions(LEAVES), VALUES)
def test_a_printed_expression_is_worth_what_python_says(drawn, values):
    expression = built(drawn)
    text = str(expression).replace(" [rad]", "")
    try:
        expected = eval(text, WORDS, values)
    except ZeroDivisionError:
        return
    except (OverflowError, ValueError):  # sine of an infinity
        expected = math.nan
    worth = evaluate(expression, values)
    assert worth == expected or (math.isnan(worth) and math.isnan(expected)) or not math.isfinite(expected)


@settings(max_examples=150)
@given(expressions(LEAVES))
def test_a_printed_expression_is_read_as_the_same_one(drawn):
    expression = built(drawn)
    declared = "signals\n  x\n  y\n  z\nconstants\n  k = 2.5 [rad]\n"
    behaviour = parse(f'behaviour ""\n{declared}phases\n  p: {expression} > 0')
    assert behaviour.phases[0].predicate == Comparison(expression, ">", 0)


@pytest.mark.parametrize(
    ("left", "right", "quotient"),
    [
        (1.0, 0.0, math.inf),
        (-1.0, 0.0, -math.inf),
        (1.0, -0.0, -math.inf),
        (0.0, 0.0, math.nan),
        (math.nan, 0.0, math.nan),
    ],
)
def test_division_by_zero_is_that_of_arrays(left, right, quotient):
    worth = evaluate(Arithmetic(Variable("x"), "/", Variable("y")), {"x": left, "y": right})
    assert worth == quotient or (math.isnan(worth) and math.isnan(quotient))


@pytest.mark.parametrize("function", ["sin", "cos", "abs", "min", "max"])
def test_nan_stays_nan(function):
    arguments = [Variable("x"), Number(1)] if function in ("min", "max") else [Variable("x")]
    for order in (arguments, arguments[::-1]):
        assert math.isnan(evaluate(Call(function, *order), {"x": math.nan}))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Number(math.nan),
        lambda: Number(math.inf),
        lambda: Constant("1k", Number(1)),
        lambda: Constant("not", Number(1)),
        lambda: Arithmetic(Number(1), "%", Number(1)),
        lambda: Call("tan", Number(1)),
        lambda: Call("sin"),
        lambda: Call("min", Number(1)),
    ],
)
def test_what_cannot_be_calculated_is_refused(wrong):
    with pytest.raises(BehaviourError):
        wrong()
