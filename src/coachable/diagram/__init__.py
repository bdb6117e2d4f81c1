"""Automata as pictures, and as DOT and Mermaid text."""
