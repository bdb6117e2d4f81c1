"""One family of exceptions: every message says what is wrong, where, and what to do about it."""

from collections.abc import Callable


class CoachableError(Exception):
    """A mistake the user can mend; the command line prints it without a traceback."""


Raises = Callable[[str], CoachableError]
"""The class of the error that a function raises with its message, where its caller chooses it."""


class ParameterError(CoachableError):
    """A physical or numerical parameter is out of its range; the message names the field."""


class BehaviourError(CoachableError):
    """A behaviour description contradicts itself or does not exist; the message names the culprit."""


class BehaviourTextError(BehaviourError):
    """A text that is no behaviour; the message shows every mistake in its place."""


class TraceError(CoachableError):
    """A recorded trace cannot be read or watched; the message names the column or the sample."""


class SignalError(CoachableError):
    """An environment fails, or gives a signal or a reward that is no number; the message says which."""


class PlanError(CoachableError):
    """A study plan asks for something that cannot be done."""


class RunFolderError(CoachableError):
    """A run folder is missing, damaged, or belongs to another plan; the message names the file."""


class MissingExtraError(CoachableError):
    """An optional dependency is not installed; the message gives the pip command.

    Arguments: `feature`, what was asked for; `extra`, the name of the extra that provides it.
    """

    def __init__(self, feature: str, extra: str):
        super().__init__(f"{feature} needs an optional dependency: pip install 'coachable[{extra}]'")
        self.feature = feature
        self.extra = extra
