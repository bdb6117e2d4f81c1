"""The checker: unintended properties of a behaviour, proven with a solver or shown at an example state."""

from coachable.behaviours.checking.checker import check as check
from coachable.behaviours.checking.findings import CheckReport as CheckReport
from coachable.behaviours.checking.findings import Finding as Finding
from coachable.behaviours.checking.findings import Subject as Subject
