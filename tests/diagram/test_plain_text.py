import re
from html import unescape

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coachable.behaviours import Behaviour, Edge, Phase, Signal
from coachable.diagram.plain_text import automaton_dot, automaton_mermaid
from tests.diagram.pictures import BEHAVIOURS, HEIGHT

NODE = re.compile(r'  (phase\d+)\("([^"\n]*)"\)')
QUOTED = r'"(?:[^"\\\n]|\\.)*"'
ATTRIBUTE = re.compile(rf"(\w+)=({QUOTED})")
STATEMENT = re.compile(
    rf"  (?P<source>\w+)(?: -> (?P<target>\w+))? \[(?P<attributes>\w+={QUOTED}(?:, \w+={QUOTED})*)\];"
)
ARROW = re.compile(r'  (phase\d+) -->(?:\|"([^"\n]*)"\|)? (phase\d+)')


def tangled(name, title, event):
    """A behaviour whose every word is what somebody typed."""
    phases = (Phase(f"a{name}", title, HEIGHT), Phase(f"b{name}", title, HEIGHT))
    edges = (Edge(f"a{name}", f"b{name}", event), Edge(f"b{name}", f"a{name}"))
    return Behaviour(name, title, (Signal("height"),), phases, edges)


def parsed_dot(behaviour):
    """Labels by node, and (source, target, label) of the arrows; whatever is not DOT's grammar fails."""
    first, *lines, last = automaton_dot(behaviour).splitlines()
    assert re.fullmatch(rf"digraph {QUOTED} {{", first)
    assert last == "}"
    statements = [STATEMENT.fullmatch(line) for line in lines]
    assert all(statements)
    attributes = [dict(ATTRIBUTE.findall(match["attributes"])) for match in statements]
    labels = [read(each.get("label", '""')) for each in attributes]
    found = list(zip(statements, labels, strict=True))
    nodes = {m["source"]: label for m, label in found if m["source"].startswith("phase") and not m["target"]}
    return nodes, [(m["source"], m["target"], label) for m, label in found if m["target"]]


def read(quoted):
    """The lines that Graphviz shows of a quoted string."""
    lines = re.split(r"(?<!\\)((?:\\\\)*)\\n", quoted[1:-1])
    joined = ["".join(lines[index : index + 2]) for index in range(0, len(lines), 2)]
    return [re.sub(r"\\(.)", r"\1", line) for line in joined]


def shown(text):
    """What Mermaid shows of a label: its codes decoded, as HTML without tags."""
    lines = re.sub(r"</?b>", "", text).split("<br>")
    return [unescape(re.sub(r"#(\d+);", r"&#\1;", line)) for line in lines]


def parsed_mermaid(behaviour):
    first, *lines = automaton_mermaid(behaviour).splitlines()
    assert first == "flowchart LR"
    nodes = {match[1]: shown(match[2]) for line in lines if (match := NODE.fullmatch(line))}
    arrows = [
        (match[1], match[3], shown(match[2] or "")) for line in lines if (match := ARROW.fullmatch(line))
    ]
    assert len(nodes) + len(arrows) == len(lines)
    return nodes, arrows


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_dot_holds_every_phase_and_edge(name):
    behaviour = BEHAVIOURS[name]
    nodes, edges = parsed_dot(behaviour)
    assert sorted(lines[0].split(",")[0] for lines in nodes.values()) == sorted(behaviour.phase_names)
    ends = sorted((source, target) for source, target, _ in edges)
    index = behaviour.phase_names.index
    assert ends == sorted((f"phase{index(e.source)}", f"phase{index(e.target)}") for e in behaviour.edges)


@pytest.mark.parametrize("name", BEHAVIOURS)
def test_mermaid_holds_every_phase_and_edge(name):
    behaviour = BEHAVIOURS[name]
    nodes, arrows = parsed_mermaid(behaviour)
    assert sorted(lines[0].split(",")[0] for lines in nodes.values()) == sorted(behaviour.phase_names)
    index = behaviour.phase_names.index
    assert sorted((one, other) for one, other, _ in arrows) == sorted(
        (f"phase{index(edge.source)}", f"phase{index(edge.target)}") for edge in behaviour.edges
    )


def test_both_say_what_figure_4_says():
    nodes, edges = parsed_dot(BEHAVIOURS["walking"])
    invariant = ["θ₁ > 0", "θ₂ ≤ 0", "θ\u0307₁ ≤ 0", "θ\u0307₂ > 0"]
    assert nodes["phase0"] == ["O1", "swing leg behind the hip", *invariant]
    assert edges[3][2][:2] == ["touchdown", "θ₁ := θ₂"]
    nodes, arrows = parsed_mermaid(BEHAVIOURS["walking"])
    assert nodes["phase0"][:3] == ["O1", "swing leg behind the hip", "θ₁ > 0"]
    assert arrows[3][2][:2] == ["touchdown", "θ₁ := θ₂"]


@settings(max_examples=50)
@given(st.text(max_size=30), st.text(max_size=30), st.text(max_size=30))
def test_no_text_breaks_out_of_its_quotes(name, title, event):
    behaviour = tangled(name, title, event)
    nodes, edges = parsed_dot(behaviour)
    assert (len(nodes), len(edges)) == (2, 2)
    labels, arrows = parsed_mermaid(behaviour)
    assert (len(labels), len(arrows)) == (2, 2)
    plain = re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]+", " ", f"a{name}")
    assert labels["phase0"][0] == nodes["phase0"][0] == plain


@pytest.mark.parametrize(
    "label", ["1. first", "- dash", '"]; x', "<b>bold</b>", "#quot;", "`code`", "end", "a|b"]
)
def test_nothing_in_a_label_is_read_by_mermaid(label):
    _, arrows = parsed_mermaid(tangled("n", "t", label))
    assert arrows[0][2] == [label]
    text = re.search(r'\|"(.*)"\|', automaton_mermaid(tangled("n", "t", label)))
    assert text is not None
    assert not re.search(r'["<>`|&]|#(?!\d+;)|^\s*\d*[-+.)] ', text[1])
