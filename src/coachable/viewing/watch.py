"""Motions drawn into a file: a film or a strobe picture, by the suffix of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from coachable.drawing.motion import Motion
from coachable.drawing.stage import NamedPhase
from coachable.foundation.errors import CoachableError

FILMS, PICTURES = (".gif", ".mp4"), (".png", ".svg", ".pdf")


def require_drawable(path: Path) -> None:
    """**Raises:** `CoachableError` if a file's suffix is neither a film's nor a picture's."""
    if path.suffix.lower() not in (*FILMS, *PICTURES):
        raise CoachableError(f"{path}: give a file that ends in {', '.join((*FILMS, *PICTURES))}")


def draw_motions(motions: Mapping[str, Motion], path: Path, phases: Sequence[NamedPhase]) -> None:
    """Draw motions by title, several side by side in a film and one below another in a picture.

    **Arguments:** `phases` of the behaviour, in its order.

    **Raises:** `CoachableError` for a file that is neither a film nor a picture, `MissingExtraError` for an
    mp4 without the [video] extra.
    """
    require_drawable(path)
    if path.suffix.lower() in PICTURES:
        from coachable.viewing.strobe import write_strobe as write
    else:
        from coachable.viewing.animation import animate as write
    write(motions, path, phases)
