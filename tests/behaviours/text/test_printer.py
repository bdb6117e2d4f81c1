import re

import pytest
from hypothesis import given, settings

from coachable.behaviours import Behaviour
from coachable.behaviours.library import LIBRARY, SHIPPED
from coachable.behaviours.text.formatter import formatted
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from tests.behaviours.random_behaviours import behaviours, built


@settings(max_examples=60)
@given(behaviours())
def test_what_is_printed_is_read_as_the_same_behaviour(parts):
    behaviour = Behaviour(**{field: built(recipe) for field, recipe in parts.items()})
    text = to_text(behaviour)
    again = parse(text)
    assert again == behaviour
    assert hash(again) == hash(behaviour)
    assert to_text(again) == text == formatted(text)


def tokens(text):
    """The text without comments and layout; a comma means `and`, and quotes are not needed around a word."""
    code = re.sub(r'("(?:[^"\\]|\\.)*")|#.*', r"\1", text)
    return re.findall(r'"(?:[^"\\]|\\.)*"|\w+|[^\w\s]', code)


TEXTS = {name: (LIBRARY / f"{name}.behaviour").read_text(encoding="utf-8") for name in SHIPPED}


@pytest.mark.parametrize("name", [name for name, text in TEXTS.items() if "include" not in text])
def test_a_text_without_include_and_mirror_is_printed_in_the_same_tokens(name):
    text = TEXTS[name]
    assert tokens(to_text(parse(text))) == tokens(text)
    assert to_text(parse(text)) == text


@settings(max_examples=20)
@given(behaviours())
def test_printing_adds_and_loses_no_token(parts):
    text = to_text(Behaviour(**{field: built(recipe) for field, recipe in parts.items()}))
    shuffled = re.sub(r"(?m)^ +", "   ", text) if "\n    " not in text else text
    assert tokens(to_text(parse(shuffled))) == tokens(text)
