"""A window that shows pictures as they come, in real time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pbd_gym.rendering.look import check_size
from pbd_gym.rendering.palette import LIGHT, Colour
from pbd_gym.rendering.video import check_frame

if TYPE_CHECKING:
    import pygame


class Window:
    """Shows frames in a resizable window, no faster than `fps`.

    It opens with the first frame. When the user closes it, or presses Escape, it stays closed:
    `closed` is True from then on and further frames are ignored. A process has one such window.

    Args:
        size: Width and height of the window when it opens [pixels], as for a `Renderer`.
        fps: Frames per second; 0 for as fast as they come.
        title: In the bar of the window.
        background: Colour beside a picture of other proportions.

    Attributes:
        closed: Whether the window has been closed, by the user or by `close`.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fps: float,
        *,
        title: str = "pbd_gym",
        background: Colour = LIGHT.paper,
    ) -> None:
        if not (np.isfinite(fps) and fps >= 0.0):
            raise ValueError(f"fps is {fps!r}; it must be finite and at least 0")
        self.closed = False
        self._size = check_size(size)
        self._fps = fps
        self._title = title
        self._background = background
        self._clock: pygame.time.Clock | None = None

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def show(self, frame: np.ndarray) -> None:
        """Show a picture (height, width, 3) of uint8, scaled to the window, and wait for its time.

        Raises:
            ValueError: If it is no such picture.
        """
        check_frame(frame)
        if self.closed:
            return
        import pygame

        height, width = frame.shape[:2]
        clock = self._clock
        if clock is None:
            pygame.display.init()
            pygame.display.set_mode(self._size, pygame.RESIZABLE)
            pygame.display.set_caption(self._title)
            clock = self._clock = pygame.time.Clock()
        # Somebody else may have shut pygame down.
        screen = pygame.display.get_surface() if pygame.display.get_init() else None
        if screen is None or self._is_left():
            self.close()
            return
        picture = pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        share = min(screen.get_width() / width, screen.get_height() / height)
        if share != 1.0:
            fitted = (max(round(width * share), 1), max(round(height * share), 1))
            picture = pygame.transform.smoothscale(picture, fitted)
        screen.fill(self._background)
        screen.blit(picture, picture.get_rect(center=screen.get_rect().center))
        pygame.display.flip()
        clock.tick(self._fps)

    def close(self) -> None:
        """Close the window; doing so twice does no harm."""
        if self._clock is not None and not self.closed:
            import pygame

            pygame.display.quit()
        self.closed = True

    def _is_left(self) -> bool:
        """Whether the user wants to leave."""
        import pygame

        return any(
            event.type == pygame.QUIT
            or (event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE)
            for event in pygame.event.get()
        )
