"""A walk as a moving picture: gif with what is always installed, mp4 with the [video] extra."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from coachable.errors import CoachableError, MissingExtraError
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.viewing.scene import SIZE, Scene
from coachable.viewing.walk import NamedPhase, Walk

GIF_FPS = 25
"""Gifs count time in hundredths of a second: 25 frames a second are exact, and show every fourth sample."""
MP4_FPS = 50
_COLOURS = 128
_LAST_FRAME = 1_000
"""How long a gif rests before it begins again [ms]."""


def animate(
    trajectory: object,
    path: Path,
    phases: Sequence[NamedPhase],
    parameters: CompassParameters = PAPER_PARAMETERS,
) -> None:
    """Write a walk as a film of 640 × 360 pixels in real time: the walker, its phase, the time and the
    distance.

    The stance leg is blue and the swing leg orange; the leg masses are filled on one leg and hollow on the
    other. The strip at the bottom tells the phases over the whole time.

    **Arguments:** `trajectory` as in `Walk.of`; `path`, which ends in `.gif` or `.mp4`; `phases` of the
    behaviour, in its order.

    **Raises:** `MissingExtraError` for an mp4 without the [video] extra, `CoachableError` for another suffix.
    """
    writers = {".gif": (_write_gif, GIF_FPS), ".mp4": (_write_mp4, MP4_FPS)}
    if path.suffix not in writers:
        raise CoachableError(f"{path.name}: a film ends in {' or '.join(writers)}")
    write, fps = writers[path.suffix]
    write(path, _frames(Walk.of(trajectory, parameters), phases, fps), fps)


def _frames(walk: Walk, phases: Sequence[NamedPhase], fps: int) -> Iterator[Image.Image]:
    scene = Scene.of(walk, phases)
    num_frames = max(1, round(walk.seconds * fps))
    return (scene.frame(walk.time[0] + k / fps) for k in range(1, num_frames + 1))


def _write_gif(path: Path, frames: Iterator[Image.Image], fps: int) -> None:
    frames_seen = list(frames)
    palette = _palette(frames_seen)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames_seen)
    durations = [1_000 // fps] * len(others) + [_LAST_FRAME]
    first.save(path, save_all=True, append_images=others, duration=durations, loop=0, optimize=False)


def _palette(frames: Sequence[Image.Image]) -> Image.Image:
    """One palette for all frames, taken from some of them: one for each would flicker."""
    some = [frames[int(index)] for index in np.linspace(0, len(frames) - 1, 12)]
    width, height = SIZE
    sheet = Image.new("RGB", (width, height * len(some)))
    for row, frame in enumerate(some):
        sheet.paste(frame, (0, height * row))
    palette = sheet.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 240] = 255  # or else Pillow takes one that is nearly white for the page
    palette.putpalette(colours.ravel().tolist())
    return palette


def _write_mp4(path: Path, frames: Iterator[Image.Image], fps: int) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingExtraError("an mp4", "video") from None
    film = imageio_ffmpeg.write_frames(str(path), SIZE, fps=fps, quality=8, macro_block_size=2)
    film.send(None)
    try:
        for frame in frames:
            film.send(frame.tobytes())
    finally:
        film.close()
