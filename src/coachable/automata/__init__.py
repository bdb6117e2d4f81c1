"""The formal model of a behaviour: a hybrid automaton, its execution, and monitors of recorded runs."""

from coachable.automata.classifier import Classifier
from coachable.automata.execution import Execution, Transition, execute
from coachable.automata.explanation import Explanation, explain
from coachable.automata.hybrid import HybridAutomaton
from coachable.automata.monitor import Monitor
from coachable.automata.monitor_report import MonitorReport
from coachable.automata.trace import Trace
from coachable.automata.trace_file import read_trace, write_trace
from coachable.automata.violation import Violation

__all__ = [
    "Classifier",
    "Execution",
    "Explanation",
    "HybridAutomaton",
    "Monitor",
    "MonitorReport",
    "Trace",
    "Transition",
    "Violation",
    "execute",
    "explain",
    "read_trace",
    "write_trace",
]
