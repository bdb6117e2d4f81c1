"""What every room stands on: errors, files, typed data, the palette."""

from coachable.foundation.errors import (
    BehaviourError,
    BehaviourTextError,
    CoachableError,
    MissingExtraError,
    ParameterError,
    PlanError,
    RunFolderError,
    SignalError,
    TraceError,
)

__all__ = [
    "BehaviourError",
    "BehaviourTextError",
    "CoachableError",
    "MissingExtraError",
    "ParameterError",
    "PlanError",
    "RunFolderError",
    "SignalError",
    "TraceError",
]
