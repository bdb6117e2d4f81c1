"""The formal model of a behaviour: a hybrid automaton, its execution, and monitors of recorded runs."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.automata.classifier import Classifier as Classifier
    from coachable.automata.execution import Execution as Execution
    from coachable.automata.execution import Transition as Transition
    from coachable.automata.execution import execute as execute
    from coachable.automata.explanation import Explanation as Explanation
    from coachable.automata.explanation import explain as explain
    from coachable.automata.hybrid import HybridAutomaton as HybridAutomaton
    from coachable.automata.monitor import Monitor as Monitor
    from coachable.automata.monitor_report import MonitorReport as MonitorReport
    from coachable.automata.trace import Trace as Trace
    from coachable.automata.trace_file import read_trace as read_trace
    from coachable.automata.trace_file import write_trace as write_trace
    from coachable.automata.violation import Violation as Violation

_HOMES = {
    "Classifier": "automata.classifier",
    "Execution": "automata.execution",
    "Explanation": "automata.explanation",
    "HybridAutomaton": "automata.hybrid",
    "Monitor": "automata.monitor",
    "MonitorReport": "automata.monitor_report",
    "Trace": "automata.trace",
    "Transition": "automata.execution",
    "Violation": "automata.violation",
    "execute": "automata.execution",
    "explain": "automata.explanation",
    "read_trace": "automata.trace_file",
    "write_trace": "automata.trace_file",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
