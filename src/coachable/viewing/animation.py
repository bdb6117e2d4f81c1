"""A motion as a moving picture: gif with what is always installed, mp4 with the [video] extra."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from PIL import Image

from coachable.drawing.motion import Motion
from coachable.drawing.stage import NamedPhase
from coachable.foundation.errors import CoachableError, MissingExtraError
from coachable.foundation.files import written_beside
from coachable.viewing.scene import Scene, SideBySide

GIF_FPS = 25
"""Gifs count time in hundredths of a second: 25 frames a second are exact, and show every fourth sample."""
MP4_FPS = 50
_COLOURS = 128
_LAST_FRAME = 1_000
"""How long a gif rests before it begins again [ms]."""


def animate(motions: Mapping[str, Motion], path: Path, phases: Sequence[NamedPhase]) -> None:
    """Write motions as a film in real time: each robot, its phase, the time, the distance.

    Each has 640 × 360 pixels, several side by side, in rows that are about as many as columns. The film lasts
    as long as the longest motion.

    The stance leg is blue, other legs are orange; masses are filled on the leg that stood first and hollow on
    the others. The strip at the bottom shows the phases over the whole time.

    **Arguments:** `motions` by title; `path`, which ends in `.gif` or `.mp4`; `phases` of the behaviour, in
    its order.

    **Raises:** `MissingExtraError` for an mp4 without the [video] extra, `CoachableError` for another suffix.
    """
    scenes = SideBySide(tuple(Scene.of(motion, phases, title) for title, motion in motions.items()))
    start = min(motion.time[0] for motion in motions.values())
    write_film(path, scenes, float(start), max(motion.seconds for motion in motions.values()))


@runtime_checkable
class Film(Protocol):
    """What a film shows."""

    @property
    def size(self) -> tuple[int, int]:
        """Of a frame [pixels]."""
        ...

    def frame(self, time: float) -> Image.Image:
        """The picture at a time [s]."""
        ...


def write_film(path: Path, film: Film, start: float, seconds: float) -> None:
    """Write what a film shows from a time [s] on, in real time.

    **Raises:** `MissingExtraError` for an mp4 without the [video] extra, `CoachableError` for a file that
    ends neither in `.gif` nor in `.mp4`.
    """
    writers = {".gif": (_write_gif, GIF_FPS), ".mp4": (_write_mp4, MP4_FPS)}
    if path.suffix not in writers:
        raise CoachableError(f"{path.name}: a film ends in {' or '.join(writers)}")
    write, fps = writers[path.suffix]
    num_frames = max(1, round(seconds * fps))
    write(path, film, [start + k / fps for k in range(1, num_frames + 1)])


def _write_gif(path: Path, scene: Film, times: Sequence[float]) -> None:
    palette = _palette(scene, times)
    frames = (scene.frame(time).quantize(palette=palette, dither=Image.Dither.NONE) for time in times)
    durations = [1_000 // GIF_FPS] * (len(times) - 1) + [_LAST_FRAME]
    with written_beside(path) as beside:
        next(frames).save(
            beside,
            "GIF",
            save_all=True,
            append_images=frames,
            duration=durations,
            loop=0,
            optimize=False,
        )


def _palette(scene: Film, times: Sequence[float]) -> Image.Image:
    """One palette for all frames, taken from some of them: one for each would flicker."""
    some = [times[int(index)] for index in np.linspace(0, len(times) - 1, 12)]
    width, height = scene.size
    sheet = Image.new("RGB", (width, height * len(some)))
    for row, time in enumerate(some):
        sheet.paste(scene.frame(time), (0, height * row))
    palette = sheet.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 240] = 255  # or else Pillow takes one that is nearly white for the page
    palette.putpalette(colours.ravel().tolist())
    return palette


def _write_mp4(path: Path, scene: Film, times: Sequence[float]) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingExtraError("an mp4", "video") from None
    width, height = scene.size
    raw_frames = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {MP4_FPS} -i -"
    options = f"-y -loglevel error {raw_frames} -vcodec libx264 -pix_fmt yuv420p -crf 18 -f mp4"
    # ffmpeg is run directly: imageio_ffmpeg would fork, which a process that runs JAX must not.
    with written_beside(path) as beside:
        command = [imageio_ffmpeg.get_ffmpeg_exe(), *options.split(), str(beside.absolute())]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
            assert ffmpeg.stdin is not None
            with contextlib.suppress(BrokenPipeError):  # it has ended early, and says why
                for time in times:
                    ffmpeg.stdin.write(scene.frame(time).tobytes())
            _, complaint = ffmpeg.communicate()
        if ffmpeg.returncode:
            reason = complaint.decode(errors="replace").strip()
            raise CoachableError(f"{path} could not be written: {reason}")
