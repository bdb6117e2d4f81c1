"""Reward forms as plans have them: there and back, and mistakes named by their keys."""

import copy
import sys
import types
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coachable.behaviours import load_behaviour
from coachable.foundation.errors import ParameterError
from coachable.rewards.forms import (
    Equation,
    Potential,
    Released,
    RewardForm,
    Stay,
    form_from_data,
    form_of,
    reward_table,
)
from coachable.rewards.reward_hash import hash_of_paid

WALKING = load_behaviour("compass-walking")
NUMBERS = st.floats(-1e6, 1e6) | st.integers(-9, 9)


@dataclass(frozen=True)
class Own(RewardForm):
    amount: float = 1.0
    note: str = "x"

    def bind(self, behaviour, dt):
        raise AssertionError("data is read and written without a behaviour")


@pytest.fixture
def own_module(monkeypatch):
    module = types.ModuleType("some_forms")
    module.Own, module.number = Own, 3
    monkeypatch.setitem(sys.modules, "some_forms", module)
    monkeypatch.setattr(Own, "__module__", "some_forms")


@given(st.floats(0, 1), st.none() | st.dictionaries(st.sampled_from(["O1", "O2", "O3"]), NUMBERS))
def test_a_potential_goes_there_and_back(discount, potential):
    form = Potential(discount, potential)
    again = form_from_data(form.to_data())
    assert again == form
    assert hash(again) == hash(form)
    assert copy.deepcopy(form) == form  # as it is when it is sent to another process
    assert hash_of_paid(WALKING, again) == hash_of_paid(WALKING, form)


def test_simple_forms_are_their_names():
    for form, name in ((Stay(), "stay"), (Equation(), "equation"), (Released(), "released")):
        assert form.to_data() == name
        assert (
            form_from_data(name) == form_from_data({"form": name}) == form_of(name) == form_of(form) == form
        )


def test_a_form_of_your_own_is_named_by_its_module(own_module):
    assert form_from_data("some_forms:Own") == Own()
    form = form_from_data({"form": "some_forms:Own", "amount": 2})
    assert form == Own(2)
    assert form.to_data() == {"form": "some_forms:Own", "amount": 2, "note": "x"}
    assert form_from_data(form.to_data()) == form


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ("stai", "unknown reward form 'stai'; did you mean 'stay'"),
        (3, "form must be a name or a table with a key 'form', got 3"),
        ({"discount": 0.9}, "form.form is missing; known: 'stay', 'equation'"),
        ("potential", "form.discount is missing; 'potential' needs it"),
        (
            {"form": "potential", "discont": 0.9},
            "form.discont: 'potential' has no such key; did you mean",
        ),
        ({"form": "potential", "discount": "0.9"}, "form.discount must be a number, got '0.9'"),
        ({"form": "potential", "discount": True}, "form.discount must be a number, got True"),
        ({"form": "potential", "discount": 2}, "discount must be from 0 to 1, got 2"),
        ({"form": "potential", "discount": 1, "potential": 3}, "form.potential must be a table, got 3"),
        (
            {"form": "potential", "discount": 1, "potential": {"O1": "a"}},
            "form.potential.O1 must be a number, got 'a'",
        ),
        ({"form": "stay", "discount": 1}, "form.discount: 'stay' has no such key"),
        ("no_such_module:Form", "'no_such_module:Form': ModuleNotFoundError"),
        ("some_forms:Owm", "some_forms has no 'Owm'; did you mean 'Own'"),
        ("some_forms:number", "must be a dataclass that is a RewardForm, but it is 3"),
        ({"form": "some_forms:Own", "note": 3}, "form.note must be text, got 3"),
    ],
)
def test_mistakes_are_named_by_their_keys(data, complaint, own_module):
    with pytest.raises(ParameterError) as raised:
        form_from_data(data)
    assert complaint in str(raised.value)


def test_what_a_form_pays_by():
    for form in ("stay", "equation", "released"):
        table = reward_table(WALKING, form).tolist()
        assert form_of(form).paid_by(WALKING) == {"orthant_table": table}
    progress = Potential(0.9, {"O1": 0.25, "O2": 0.5, "O3": 0.75, "O4": 1})
    assert hash_of_paid(WALKING, Potential(0.9)) == hash_of_paid(WALKING, progress)
    forms = [Stay(), Equation(), Released(), Potential(0.9), Potential(0.8), Own(1.0), Own(2.0)]
    assert len({hash_of_paid(WALKING, form) for form in forms}) == len(forms)
