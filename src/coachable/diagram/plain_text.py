"""The automaton as text that other tools draw: DOT for Graphviz, and Mermaid for Markdown."""

from __future__ import annotations

import re

from coachable.behaviours.behaviour import Behaviour, Edge, Phase
from coachable.behaviours.notation import conditions, pretty_predicate
from coachable.diagram.captions import dwell_text, reset_of
from coachable.diagram.draw import by_ends
from coachable.diagram.layout import drawing_order

_READ = re.compile(r"[^\w .,:=+\-/()\u0080-\U0010ffff]|_")
_LIST = re.compile(r"^(\s*\d*)([-+.)])")
"""What would make a list of a label."""

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]+")


def automaton_dot(behaviour: Behaviour) -> str:
    """The automaton in DOT, the language of Graphviz: `circo` draws a cycle as a circle."""
    phases = {phase.name: phase for phase in behaviour.phases}
    names = {name: f"phase{index}" for index, name in enumerate(behaviour.phase_names)}
    lines = [
        f"digraph {_dot(behaviour.name)} {{",
        '  graph [layout="circo", fontname="sans-serif"];',
        '  node [shape="box", style="rounded", fontname="sans-serif"];',
        '  edge [fontname="sans-serif"];',
    ]
    for name in drawing_order(behaviour):
        lines.append(f"  {names[name]} [label={_dot(*_node_text(phases[name]))}];")
    for edge in behaviour.edges:
        label = _dot(*_edge_text(edge, behaviour))
        lines.append(f"  {names[edge.source]} -> {names[edge.target]} [label={label}];")
    return "\n".join([*lines, "}", ""])


def automaton_mermaid(behaviour: Behaviour) -> str:
    """The automaton as a Mermaid flow chart, which Markdown on GitHub shows as a picture."""
    phases = {phase.name: phase for phase in behaviour.phases}
    names = {name: f"phase{index}" for index, name in enumerate(behaviour.phase_names)}
    lines = ["flowchart LR"]
    for name in drawing_order(behaviour):
        first, *rest = map(_mermaid, _node_text(phases[name]))
        lines.append(f'  {names[name]}("{"<br>".join((f"<b>{first}</b>", *rest))}")')
    for (source, target), edges in by_ends(behaviour.edges).items():
        for edge in edges:
            label = "<br>".join(map(_mermaid, _edge_text(edge, behaviour)))
            arrow = f'-->|"{label}"|' if label else "-->"
            lines.append(f"  {names[source]} {arrow} {names[target]}")
    return "\n".join([*lines, ""])


def _node_text(phase: Phase) -> list[str]:
    dwell = dwell_text(phase.dwell)
    head = f"{phase.name}, {dwell}" if dwell else phase.name
    invariant = map(pretty_predicate, conditions(phase.predicate))
    return [head, *([phase.title] if phase.title else []), *invariant]


def _edge_text(edge: Edge, behaviour: Behaviour) -> list[str]:
    changes = [f"{name} := {value}" for name, value in reset_of(edge, behaviour)]
    return [*([edge.event] if edge.event is not None else []), *changes]


def _dot(*lines: str) -> str:
    """A quoted string of some lines: only quotes and backslashes mean something in it."""
    plain = (_CONTROL.sub(" ", line).replace("\\", "\\\\").replace('"', '\\"') for line in lines)
    return '"' + "\\n".join(plain) + '"'


def _mermaid(text: str) -> str:
    """Text in which nothing is left that Mermaid, Markdown or HTML reads: such characters become `#code;`."""
    plain = _CONTROL.sub(" ", text)
    plain = _LIST.sub(lambda match: f"{match[1]}#{ord(match[2])};", _READ.sub(_coded, plain))
    return plain


def _coded(match: re.Match[str]) -> str:
    return f"#{ord(match[0])};"
