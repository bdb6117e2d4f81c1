"""Walks drawn into a file: a film or a strobe picture, as the file's name says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from coachable.drawing.stage import NamedPhase
from coachable.foundation.errors import CoachableError
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters

FILMS, PICTURES = (".gif", ".mp4"), (".png", ".svg", ".pdf")


def require_drawable(path: Path) -> None:
    """**Raises:** `CoachableError` if the name of a file does not say what to draw."""
    if path.suffix.lower() not in (*FILMS, *PICTURES):
        raise CoachableError(f"{path}: give a file that ends in {', '.join((*FILMS, *PICTURES))}")


def draw_walks(
    trajectories: Mapping[str, object],
    path: Path,
    phases: Sequence[NamedPhase],
    parameters: CompassParameters = PAPER_PARAMETERS,
) -> None:
    """Draw walks by title, several side by side in a film and one below another in a picture.

    **Arguments:** each trajectory as in `Walk.of`; `phases` of the behaviour, in its order.

    **Raises:** `CoachableError` for a file that is neither a film nor a picture, `MissingExtraError` for an
    mp4 without the [video] extra.
    """
    require_drawable(path)
    if path.suffix.lower() in PICTURES:
        from coachable.viewing.strobe import write_strobe as write
    else:
        from coachable.viewing.animation import animate as write
    write(trajectories, path, phases, parameters)
