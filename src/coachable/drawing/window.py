"""A window that shows pictures as they come, through pygame."""

from __future__ import annotations

import os

from PIL import Image

from coachable.drawing.stage import SIZE
from coachable.foundation.errors import MissingExtraError


class Window:
    """A window of the size of a picture; opened where it is made, gone after `close`.

    **Raises:** `MissingExtraError` without pygame.
    """

    def __init__(self, title: str):
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
        except ImportError:
            raise MissingExtraError("a window (render_mode='human')", "window") from None
        self._pygame = pygame
        pygame.display.init()
        pygame.display.set_caption(title)
        self._screen = pygame.display.set_mode(SIZE)
        self._clock = pygame.time.Clock()

    def show(self, picture: Image.Image, pictures_a_second: int) -> None:
        """Show a picture, no sooner than it is due after the one before."""
        surface = self._pygame.image.frombuffer(picture.tobytes(), picture.size, "RGB")
        self._screen.blit(surface, (0, 0))
        self._pygame.event.pump()
        self._pygame.display.flip()
        self._clock.tick(pictures_a_second)

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
