"""A walk as a moving picture: gif with what is always installed, mp4 with the [video] extra."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from coachable.drawing.stage import HEIGHT, WIDTH, NamedPhase
from coachable.errors import CoachableError, MissingExtraError
from coachable.plants.compass import PAPER_PARAMETERS, CompassParameters
from coachable.viewing.scene import Scene
from coachable.viewing.walk import Walk

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
    """Write a walk as a film of 640 × 360 pixels in real time: the walker, its phase, the time, the distance.

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
    walk = Walk.of(trajectory, parameters)
    num_frames = max(1, round(walk.seconds * fps))
    write(path, Scene.of(walk, phases), [walk.time[0] + k / fps for k in range(1, num_frames + 1)])


def _write_gif(path: Path, scene: Scene, times: Sequence[float]) -> None:
    palette = _palette(scene, times)
    frames = (scene.frame(time).quantize(palette=palette, dither=Image.Dither.NONE) for time in times)
    durations = [1_000 // GIF_FPS] * (len(times) - 1) + [_LAST_FRAME]
    next(frames).save(path, save_all=True, append_images=frames, duration=durations, loop=0, optimize=False)


def _palette(scene: Scene, times: Sequence[float]) -> Image.Image:
    """One palette for all frames, taken from some of them: one for each would flicker."""
    some = [times[int(index)] for index in np.linspace(0, len(times) - 1, 12)]
    sheet = Image.new("RGB", (WIDTH, HEIGHT * len(some)))
    for row, time in enumerate(some):
        sheet.paste(scene.frame(time), (0, HEIGHT * row))
    palette = sheet.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) > 240] = 255  # or else Pillow takes one that is nearly white for the page
    palette.putpalette(colours.ravel().tolist())
    return palette


def _write_mp4(path: Path, scene: Scene, times: Sequence[float]) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingExtraError("an mp4", "video") from None
    raw_frames = f"-f rawvideo -pix_fmt rgb24 -s {WIDTH}x{HEIGHT} -r {MP4_FPS} -i -"
    options = f"-y -loglevel error {raw_frames} -vcodec libx264 -pix_fmt yuv420p -crf 18"
    # ffmpeg is run directly: imageio_ffmpeg would fork, which a process that runs JAX must not.
    command = [imageio_ffmpeg.get_ffmpeg_exe(), *options.split(), str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended early, and says why
            for time in times:
                ffmpeg.stdin.write(scene.frame(time).tobytes())
        _, complaint = ffmpeg.communicate()
    if ffmpeg.returncode:
        raise CoachableError(f"{path} could not be written: {complaint.decode(errors='replace').strip()}")
