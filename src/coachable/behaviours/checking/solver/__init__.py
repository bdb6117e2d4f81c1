"""Predicates as terms of a solver, and exact geometry for what is affine."""
