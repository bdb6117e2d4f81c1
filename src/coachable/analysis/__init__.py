"""What came out of a study: statistics, claims, table and figures, from its run folder alone."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.analysis.claims import Claim as Claim
    from coachable.analysis.claims import Verdict as Verdict
    from coachable.analysis.claims import decide as decide
    from coachable.analysis.intervals import Estimate as Estimate
    from coachable.analysis.intervals import estimate as estimate
    from coachable.analysis.measurements import Measurements as Measurements
    from coachable.analysis.measurements import SetupRuns as SetupRuns
    from coachable.analysis.measurements import measure as measure
    from coachable.analysis.numbers import comparison_numbers as comparison_numbers
    from coachable.analysis.numbers import gait_numbers as gait_numbers
    from coachable.analysis.numbers import table_numbers as table_numbers
    from coachable.analysis.report.page import write_report as write_report
    from coachable.analysis.statistics import SetupStatistics as SetupStatistics
    from coachable.analysis.statistics import statistics_of as statistics_of

_HOMES = {
    "Claim": "analysis.claims",
    "Estimate": "analysis.intervals",
    "Measurements": "analysis.measurements",
    "SetupRuns": "analysis.measurements",
    "SetupStatistics": "analysis.statistics",
    "Verdict": "analysis.claims",
    "comparison_numbers": "analysis.numbers",
    "decide": "analysis.claims",
    "estimate": "analysis.intervals",
    "gait_numbers": "analysis.numbers",
    "measure": "analysis.measurements",
    "statistics_of": "analysis.statistics",
    "table_numbers": "analysis.numbers",
    "write_report": "analysis.report.page",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
