"""The checker: unintended properties of a behaviour, proven with a solver or shown at an example state."""

from coachable.behaviours.checking.checker import check
from coachable.behaviours.checking.findings import CheckReport, Finding, Subject

__all__ = [
    "CheckReport",
    "Finding",
    "Subject",
    "check",
]
