"""Copies of an environment that are stepped side by side, in one process."""
