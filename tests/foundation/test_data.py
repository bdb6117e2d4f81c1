"""Typed data: what is written is read back, kinds are strict, and a mistake is named with its key."""

import datetime
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pytest
from cattrs import ClassValidationError
from hypothesis import given
from hypothesis import strategies as st

from coachable.foundation.data import (
    json_text,
    parse_json,
    parse_toml,
    plain,
    real_number,
    structure,
    structure_given,
    toml_text,
    unstructure,
    whole_number,
)
from coachable.foundation.errors import CoachableError, ParameterError, PlanError, RunFolderError


@dataclass(frozen=True)
class Settings:
    n_steps: int = 2048
    rate: float = 3e-4
    sizes: tuple[int, int] = (64, 64)

    def __post_init__(self):
        if self.n_steps < 1:
            raise ParameterError("n_steps must be at least 1")


@dataclass(frozen=True)
class Circle:
    radius: float

    @property
    def area(self):
        return math.pi * self.radius**2


@dataclass(frozen=True, kw_only=True)
class Plan:
    name: str
    clock: Literal["free", "touchdown"] = "free"
    quick: bool = False
    ppo: Settings = Settings()
    weight: int | float = 1.0
    signals: Mapping[str, int | str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    poles: tuple[complex, ...] = ()
    circles: tuple[Circle, ...] = ()
    margin: float | None = None


DERIVED = {Circle: ("area",)}

text = st.text(st.characters(codec="utf-8"), max_size=5)
finite = st.floats(allow_nan=False, allow_infinity=False)
whole = st.integers(-(2**63), 2**63 - 1)
plans = st.builds(
    Plan,
    name=text,
    clock=st.sampled_from(["free", "touchdown"]),
    quick=st.booleans(),
    ppo=st.builds(Settings, st.integers(1, 99), finite, st.tuples(whole, whole)),
    weight=whole | finite,
    signals=st.dictionaries(text, whole | text, max_size=2),
    options=st.dictionaries(text, st.booleans() | whole | finite | text | st.none(), max_size=2),
    poles=st.lists(st.builds(complex, finite, finite), max_size=2).map(tuple),
    circles=st.lists(st.builds(Circle, finite.filter(lambda r: abs(r) < 1e100)), max_size=2).map(tuple),
    margin=st.none() | finite,
)
values = st.recursive(
    st.booleans() | whole | finite | text | st.dates() | st.times() | st.datetimes(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(text, inner, max_size=3),
)


@given(st.dictionaries(text, values, max_size=4))
def test_toml_that_is_written_is_read_back(data):
    assert parse_toml(toml_text(data), "plan.toml", PlanError) == data


def test_toml_takes_tuples_and_tables_in_lists():
    data = {"when": datetime.date(2026, 1, 2), "sizes": (64, 64), "pushes": [{"size": 0.5}, {"size": 1.0}]}
    assert parse_toml(toml_text(data), "plan.toml", PlanError) == data | {"sizes": [64, 64]}


@given(plans)
def test_a_value_goes_through_json(plan):
    written = json_text(unstructure(plan, DERIVED))
    again = structure(Plan, parse_json(written, "plan", PlanError), "plan", PlanError, derived=DERIVED)
    assert again == plan
    assert json_text(unstructure(again, DERIVED)) == written


def test_json_has_null_for_nan_a_pair_for_a_complex_number_and_the_derived_properties():
    plan = Plan(name="Gangart θ", poles=(1 - 2j,), circles=(Circle(math.nan), Circle(1.0)), margin=math.inf)
    data = unstructure(plan, DERIVED)
    assert json.loads(json_text(data), parse_constant=pytest.fail) == data
    assert data["poles"] == [[1.0, -2.0]]
    assert data["circles"] == [{"radius": None, "area": None}, {"radius": 1.0, "area": math.pi}]
    assert data["margin"] is None
    assert "Gangart θ" in json_text(data)
    again = structure(Plan, data, "plan", PlanError, derived=DERIVED)
    assert math.isnan(again.circles[0].radius)
    assert json_text({"a": [math.nan, (math.inf, 1.0)]}, indent=None) == '{"a": [null, [null, 1.0]]}'


def test_a_whole_number_is_a_number_and_a_missing_key_has_its_default():
    plan = structure(Plan, {"name": "mine", "ppo": {"rate": 1}, "margin": 2}, "mine.toml", PlanError)
    assert plan == Plan(name="mine", ppo=Settings(rate=1.0), margin=2.0)
    assert type(plan.ppo.rate) is type(plan.margin) is float


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "mine.toml: it must be a table, got []"),
        ({}, "mine.toml: it lacks 'name'"),
        ({"name": 3}, "mine.toml: name must be text, got 3"),
        ({"quick": 1}, "mine.toml: quick must be true or false, got 1"),
        ({"clock": "fre"}, "mine.toml: clock must be one of 'free', 'touchdown', got 'fre'"),
        ({"clok": "free"}, "mine.toml: unknown key 'clok'; did you mean 'clock'?"),
        ({"ppo": {"n_step": 1}}, "mine.toml: unknown key 'ppo.n_step'; did you mean 'n_steps'?"),
        ({"ppo": 3}, "mine.toml: ppo must be a table, got 3"),
        ({"ppo": {"n_steps": "x"}}, "mine.toml: ppo.n_steps must be a whole number, got 'x'"),
        ({"ppo": {"n_steps": True}}, "mine.toml: ppo.n_steps must be a whole number, got True"),
        ({"ppo": {"n_steps": 3.0}}, "mine.toml: ppo.n_steps must be a whole number, got 3.0"),
        ({"ppo": {"n_steps": 0}}, "mine.toml: ppo: n_steps must be at least 1"),
        ({"ppo": {"rate": "3"}}, "mine.toml: ppo.rate must be a number, got '3'"),
        ({"ppo": {"rate": True}}, "mine.toml: ppo.rate must be a number, got True"),
        ({"ppo": {"sizes": [1]}}, "mine.toml: ppo.sizes must be a list of 2, got [1]"),
        ({"ppo": {"sizes": "64"}}, "mine.toml: ppo.sizes must be a list of 2, got '64'"),
        ({"ppo": {"sizes": [1, 1.5]}}, "mine.toml: ppo.sizes[1] must be a whole number, got 1.5"),
        ({"weight": "x"}, "mine.toml: weight must be a number, got 'x'"),
        ({"signals": {"speed": 1.5}}, "mine.toml: signals.speed must be a whole number or text, got 1.5"),
        ({"signals": 3}, "mine.toml: signals must be a table, got 3"),
        ({"poles": [[0, 1], 2]}, "mine.toml: poles[1] must be a list of 2, got 2"),
        ({"circles": {}}, "mine.toml: circles must be a list, got {}"),
        ({"circles": [{}]}, "mine.toml: circles[0] lacks 'radius'"),
        ({"margin": [1] * 99}, f"mine.toml: margin must be a number, got {str([1] * 99)[:77]}…"),
    ],
)
def test_a_mistake_is_named_with_its_source_and_key(data, message):
    data = {"name": "mine"} | data if data else data
    with pytest.raises(PlanError) as error:
        structure(Plan, data, "mine.toml", PlanError)
    assert str(error.value) == message


def test_a_derived_property_is_no_field():
    data = {"radius": 1.0, "area": 3.0}
    assert structure(Circle, data, "c", PlanError, derived=DERIVED) == Circle(1.0)
    with pytest.raises(PlanError, match="unknown key 'area'"):
        structure(Circle, data, "c", PlanError)


def test_a_bug_in_a_constructor_is_not_taken_for_a_mistake():
    @dataclass(frozen=True)
    class Broken:
        def __post_init__(self):
            raise ZeroDivisionError("a bug")

    with pytest.raises(ClassValidationError) as error:
        structure(Broken, {}, "mine.toml", PlanError)
    assert error.group_contains(ZeroDivisionError, match="a bug")


def test_part_of_a_table_is_read_by_the_same_rules():
    table = {"n_steps": 3, "sizes": [1, 2]}
    assert structure_given(Settings, table, "f", PlanError, "ppo") == {"n_steps": 3, "sizes": (1, 2)}
    for data, message in [
        (3, "f: ppo must be a table of n_steps, rate, got 3"),
        ({"rat": 1.0}, "f: unknown key 'ppo.rat'; did you mean 'rate'?"),
        ({"rate": "x"}, "f: ppo.rate must be a number, got 'x'"),
        ({"sizes": [1, 2]}, "f: unknown key 'ppo.sizes'; known: 'n_steps', 'rate'"),
    ]:
        with pytest.raises(PlanError) as error:
            structure_given(Settings, data, "f", PlanError, "ppo", without=("sizes",))
        assert str(error.value) == message


@pytest.mark.parametrize("document", ["a =", "a = 1\na = 2", f"a = {'[' * 9999}"])
def test_text_that_is_not_toml_is_refused(document):
    with pytest.raises(PlanError, match=r"mine\.toml is not TOML: "):
        parse_toml(document, "mine.toml", PlanError)


@pytest.mark.parametrize("document", [b"{", b"\xff\xfe", b"[]", b"", b"[" * 99999, "3", b"1" * 9999])
def test_text_that_is_no_json_object_is_refused(document):
    with pytest.raises(RunFolderError, match=r"x\.json is damaged: "):
        parse_json(document, "x.json", RunFolderError)


class _Refused(CoachableError):
    pass


def test_numbers_of_numpy_are_numbers():
    assert whole_number(np.int64(3), "steps", _Refused) == 3
    assert type(whole_number(np.uint8(3), "steps", _Refused)) is int
    assert real_number(np.float32(0.5), "weight", _Refused) == 0.5
    assert structure(tuple[int, float], (np.int32(1), np.int64(2)), "mine", _Refused) == (1, 2.0)
    assert plain({"a": [np.int64(1), (np.float64(0.5), np.bool_(True))], "b": np.arange(2)}) == {
        "a": [1, (0.5, True)],
        "b": [0, 1],
    }


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (1.5, "a whole number, at least 1, got 1.5"),
        (3.0, "a whole number"),
        (True, "a whole number"),
        (np.bool_(True), "a whole number"),
        ("3", "a whole number"),
        (None, "a whole number"),
        (0, "at least 1, got 0"),
        (10**9 + 1, "at most 1,000,000,000, got 1000000001"),
        pytest.param(10**5000, "at most 1,000,000,000, got one of some 5,000 digits", id="huge"),
    ],
)
def test_a_whole_number_is_refused_in_a_sentence(value, said):
    with pytest.raises(_Refused) as refused:
        whole_number(value, "steps", _Refused, 1, 10**9)
    assert str(refused.value).startswith("steps must be ")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (math.nan, "a finite number, got nan"),
        (math.inf, "a finite number, got inf"),
        (10**400, "a finite number, got one of some 400 digits"),
        ("1", "a finite number"),
        (False, "a finite number"),
        (0.0, "greater than zero"),
        (1e308, "from -inf to 3600"),
    ],
)
def test_a_number_is_refused_in_a_sentence(value, said):
    with pytest.raises(_Refused) as refused:
        real_number(value, "seconds", _Refused, above=0, most=3600)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "value"), [pytest.param(int, 10**5000, id="huge"), (int, 2**63), (float, 10**400)]
)
def test_a_number_that_no_machine_holds_is_refused(kind, value):
    with pytest.raises(_Refused, match="mine: it must be a"):
        structure(kind, value, "mine", _Refused)
