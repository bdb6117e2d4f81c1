"""Automata as pictures, and as DOT and Mermaid text."""

from coachable.diagram.draw import automaton_svg as automaton_svg
from coachable.diagram.plain_text import automaton_dot as automaton_dot
from coachable.diagram.plain_text import automaton_mermaid as automaton_mermaid
from coachable.diagram.raster import svg_to_png as svg_to_png
