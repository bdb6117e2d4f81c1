"""How a control step can end."""

import enum


class Outcome(enum.IntEnum):
    """How a control step ended; everything but `WALKING` ends an episode as a fall."""

    WALKING = 0
    FELL = 1
    CHATTERED = 2
    NOT_FINITE = 3
