"""Drawing a robot pixel by pixel: what a film shows, and an environment that is watched while it runs."""

from coachable.drawing.motion import Motion
from coachable.drawing.stage import NamedPhase

__all__ = [
    "Motion",
    "NamedPhase",
]
