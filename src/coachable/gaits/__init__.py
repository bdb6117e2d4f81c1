"""Which gait it is: measures of recorded walks, by when the feet are on the ground."""

from coachable.gaits.measures import feet, gait, touchdowns

__all__ = [
    "feet",
    "gait",
    "touchdowns",
]
