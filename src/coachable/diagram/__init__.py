"""Automata as pictures, and as DOT and Mermaid text."""

from coachable.diagram.draw import automaton_svg
from coachable.diagram.plain_text import automaton_dot, automaton_mermaid
from coachable.diagram.raster import svg_to_png

__all__ = [
    "automaton_dot",
    "automaton_mermaid",
    "automaton_svg",
    "svg_to_png",
]
