"""Looking at a motion: a strobe picture, a gif, a film."""

from typing import TYPE_CHECKING

from coachable.foundation.lazy import lazily

if TYPE_CHECKING:
    from coachable.viewing.animation import animate as animate
    from coachable.viewing.strobe import write_strobe as write_strobe
    from coachable.viewing.watch import draw_motions as draw_motions

_HOMES = {
    "animate": "viewing.animation",
    "draw_motions": "viewing.watch",
    "write_strobe": "viewing.strobe",
}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]
__getattr__, __dir__ = lazily(__name__, _HOMES)
