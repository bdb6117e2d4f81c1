"""Which gait it is: measures of recorded walks, by when the feet are on the ground."""

from coachable.gaits.classify import gait
from coachable.gaits.footfalls import feet, touchdowns

__all__ = [
    "feet",
    "gait",
    "touchdowns",
]
