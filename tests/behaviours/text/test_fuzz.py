"""No input, however broken, does anything but to be read or to be told what is wrong with it.

`COACHABLE_FUZZ=10000` tries that many texts of each kind; without it there are a few.
"""

import os
import random
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Behaviour
from coachable.behaviours.library import LIBRARY, load_behaviour
from coachable.behaviours.text.formatter import formatted
from coachable.behaviours.text.parser import parse
from coachable.behaviours.text.printer import to_text
from coachable.foundation.errors import BehaviourError, BehaviourTextError

MANY = settings(max_examples=int(os.environ.get("COACHABLE_FUZZ", "60")))
TEXTS = [path.read_text(encoding="utf-8") for path in sorted(LIBRARY.glob("*"))]
TEXTS += [to_text(load_behaviour("perry-gait"))]
SNIPPETS = [
    *(
        "behaviour",
        "signals",
        "phases",
        "cycle",
        "edges",
        "mirror left <-> right",
        "include",
        "outside",
        "vocabulary",
    ),
    *(
        "means",
        "and",
        "or",
        "not",
        "within",
        "deadband",
        "with",
        "for at most 1 s",
        "on",
        "d/dt",
        "true",
        "left",
    ),
    *(
        "(",
        ")",
        "((((",
        "[",
        "]",
        '"',
        "\\",
        "#",
        ":",
        ":=",
        "->",
        "<->",
        "<",
        ">=",
        "=",
        "-",
        "*",
        "/",
        ",",
        "1e999",
    ),
    *(
        "\n",
        "\n  ",
        "\n    ",
        "\r",
        "\t",
        " ",
        "\0",
        "\ufeff",
        "\u202e",
        "\u0435",
        "\ud800",
        "ſ",
        "½",
        "٣",
        "🦿",
        "e\u0301",
    ),
    *("x", "θ", "sin", "min(", "0.5", "10", "[rad]"),
]


def is_read_or_refused(text):
    try:
        behaviour = parse(text)
    except BehaviourTextError as error:
        told = str(error)
    else:
        assert isinstance(behaviour, Behaviour)
        assert parse(to_text(behaviour)) == behaviour
        assert parse(formatted(text)) == behaviour
        return
    assert len(told) < 50_000
    assert all(letter.isprintable() for letter in told.replace("\n", ""))
    assert re.match(r"line \d+, column \d+: .", told)


@MANY
@given(st.text(alphabet=st.characters()))
def test_any_text(text):
    is_read_or_refused(text)


@MANY
@given(st.lists(st.sampled_from(SNIPPETS) | st.text(max_size=3), max_size=60))
def test_pieces_of_the_language_in_any_order(pieces):
    is_read_or_refused('behaviour "x"\nsignals\n  x\nphases\n  p: ' + " ".join(pieces))


@MANY
@given(st.sampled_from(TEXTS), st.data())
def test_damaged_descriptions(text, data):
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + data.draw(st.sampled_from(["", *SNIPPETS]) | st.text(max_size=3)) + text[end:]
    is_read_or_refused(text)


@MANY
@given(st.sampled_from(TEXTS), st.integers(0, 3000))
def test_truncated_descriptions(text, length):
    is_read_or_refused(text[:length])


@MANY
@given(st.binary(max_size=200) | st.sampled_from(TEXTS).map(lambda text: text.encode("utf-16")))
def test_binary_files(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.behaviour"
    path.write_bytes(data)
    with pytest.raises(BehaviourError):
        load_behaviour(path)


def many(lines):
    return "\n".join(lines)


HUGE = {
    "of open parentheses": 'behaviour "x"\nphases\n' + many(["  p: " + "(" * 900] * 250),
    "of minus signs": 'behaviour "x"\nsignals\n  x\nphases\n  p: ' + many(["      - " * 100] * 250),
    "of unknown names": 'behaviour "x"\nphases\n'
    + many(f"  p{n}: some unknown phrase {n}" for n in range(4900)),
    "of long names": 'behaviour "x"\nsignals\n'
    + many(f"  {'a' * 900}{n}" for n in range(250))
    + "\nphases\n  p: "
    + "a" * 900,
    "of open quotes": 'behaviour "x"\nphases\n' + many(['  "' + '\\"' * 450] * 250),
    "of sections": many(["signals"] * 5000),
    "of comments": many(["# x"] * 4999),
    "of one sum": 'behaviour "x"\nsignals\n  x\nphases\n  p: x' + many(["      + x" * 100] * 250),
    "of phases": 'behaviour "x"\nsignals\n  x\nphases\n' + many(f"  p{n}: x > {n}" for n in range(1500)),
    "of edges": 'behaviour "x"\nsignals\n  x\nphases\n  p: x > 0\ncycle\n  p'
    + many(["    -> p" * 100] * 200),
    "of spaces in brackets": 'behaviour "x"\nsignals\n' + many(["  x [" + " " * 900] * 200),
    "of mirrored words": 'behaviour "x"\nmirror '
    + ", ".join(f"a{n} <-> b{n}" for n in range(60))
    + many(["\nsignals\n  a1"] * 999),
}


@pytest.mark.parametrize("kind", HUGE)
def test_huge_texts(kind):
    is_read_or_refused(HUGE[kind])


def test_lines_in_a_random_order():
    for seed in range(20):
        lines = random.Random(seed).sample(lines_of := TEXTS[0].splitlines(), len(lines_of))
        is_read_or_refused("\n".join(lines))
