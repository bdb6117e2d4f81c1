"""The search for a fall, and its independent confirmation."""

from coachable.verification.falsification.counterexample_file import load_counterexample
from coachable.verification.falsification.fall_search import Fall

__all__ = [
    "Fall",
    "load_counterexample",
]
