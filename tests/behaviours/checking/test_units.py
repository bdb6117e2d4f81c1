import contextlib
import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours.checking.units import NONE, Unit, exact_factor, parse_unit, unfamiliar
from coachable.foundation.errors import BehaviourError

EQUAL = [
    ("N", "kg*m/s^2"),
    ("N*m", "J"),
    ("N m", "N·m"),
    ("W", "J/s"),
    ("rad/s", "1/s"),
    ("1/s", "Hz"),
    ("s^-1", "Hz"),
    ("m/s/s", "m/s^2"),
    ("m s**-2", "m/s^2"),
    ("W*s", "N*m"),
    ("rad*m", "m"),
    ("", "1"),
    ("step", "step"),
    ("m/s2", "m/s^2"),
    ("m s-2", "m/s^2"),
    ("kg m2 s-2", "J"),
    ("rad/sec", "rad/s"),
    ("degrees/second", "deg/s"),
    ("μs", "µs"),
]
DIFFERENT = [
    ("deg", "rad"),
    ("ms", "s"),
    ("%", ""),
    ("deg/s", "rad/s"),
    ("m", "s"),
    ("N", "N*m"),
    ("m/s", "m/s^2"),
    ("step", ""),
    ("step", "jump"),
    ("rad", "m"),
    ("step2", "step^2"),
    ("m2", "m"),
]


@pytest.mark.parametrize(("one", "other"), EQUAL)
def test_units_that_are_the_same(one, other):
    assert parse_unit(one).equals(parse_unit(other))
    assert parse_unit(other).equals(parse_unit(one))


@pytest.mark.parametrize(("one", "other"), DIFFERENT)
def test_units_that_are_not(one, other):
    assert not parse_unit(one).equals(parse_unit(other))
    assert not parse_unit(other).equals(parse_unit(one))


def test_a_scale_is_what_one_is_worth():
    assert parse_unit("deg").scale == pytest.approx(math.pi / 180)
    assert parse_unit("km/h").scale == pytest.approx(1 / 3.6)
    assert parse_unit("km/h").same_dimension(parse_unit("m/s"))


WORDS = st.sampled_from(["m", "s", "kg", "rad", "deg", "N", "step", "%", "ms"])


@given(WORDS, WORDS, st.integers(-3, 3), st.sampled_from("*/ "))
def test_reading_is_algebra(one, other, power, joint):
    unit = parse_unit(f"{one}^{power}{joint}{other}")
    raised = NONE
    for _ in range(abs(power)):
        raised = raised.times(parse_unit(one), 1 if power > 0 else -1)
    assert unit.powers == raised.times(parse_unit(other), -1 if joint == "/" else 1).powers
    assert unit.times(unit, -1).equals(NONE)


@given(st.text(max_size=12))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(BehaviourError):
        assert isinstance(parse_unit(text), Unit)


@pytest.mark.parametrize("text", ["rad//s", "/s", "m/", "m^", "(m/s)", "m^^2", "*"])
def test_what_is_no_unit_is_refused(text):
    with pytest.raises(BehaviourError, match=r"write such as 'm/s\^2'"):
        parse_unit(text)


def test_a_misspelt_word_has_a_suggestion():
    assert unfamiliar("rads/s") == {"rads": "rad"}
    assert unfamiliar("step") == {"step": None}
    assert unfamiliar("N*m") == {}


@pytest.mark.parametrize(
    ("text", "printed"), [("N*m", "kg*m^2/s^2"), ("1/s", "1/s"), ("", "no unit"), ("rad", "rad")]
)
def test_units_print_in_base_units(text, printed):
    assert str(parse_unit(text)) == printed


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        ("m/s**2", "m/s^2", 1),
        ("N m", "N*m", 1),
        ("N.m", "N*m", 1),
        ("N-m", "J", 1),
        ("Nm", "kg*m^2/s^2", 1),
        ("m·s⁻²", "m/s/s", 1),
        ("mm", "m", Fraction(1, 1000)),
        ("km/h", "m/s", Fraction(5, 18)),
        ("N mm", "N*m", Fraction(1, 1000)),
        ("min", "ms", 60_000),
        ("strides", "strides", 1),
        ("deg", "rad", None),
        ("rad/s", "Hz", None),
        ("m", "s", None),
        ("m//s", "m", None),
        ("km^900", "m", None),
    ],
)
def test_numbers_are_converted_where_the_factor_is_exact(unit, wanted, factor):
    assert exact_factor(unit, wanted) == factor
