"""A window that shows pictures as they come, in real time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from pbd_gym.rendering.look import check_size
from pbd_gym.rendering.palette import LIGHT, Colour
from pbd_gym.rendering.video import check_frame

if TYPE_CHECKING:
    import pygame

_GLANCE = 0.01  # how often the window looks what the user does while it waits [s]


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
        self._due: float | None = None  # when the next picture is [s]; None before the first

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
        if self._due is None:
            pygame.display.init()
            pygame.display.set_mode(self._size, pygame.RESIZABLE)
            pygame.display.set_caption(self._title)
            self._due = time.perf_counter()
        # Somebody else may have shut pygame down.
        if not pygame.display.get_init() or pygame.display.get_surface() is None:
            self.close()
            return
        picture = pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        self._draw(picture)
        self._due = max(self._due + 1.0 / self._fps, time.perf_counter()) if self._fps else 0.0
        self._wait(picture)

    def _draw(self, picture: pygame.Surface) -> None:
        """Fit a picture into the window as large as it is now."""
        import pygame

        screen = pygame.display.get_surface()
        assert screen is not None
        width, height = picture.get_size()
        share = min(screen.get_width() / width, screen.get_height() / height)
        if share != 1.0:
            fitted = (max(round(width * share), 1), max(round(height * share), 1))
            picture = pygame.transform.smoothscale(picture, fitted)
        screen.fill(self._background)
        screen.blit(picture, picture.get_rect(center=screen.get_rect().center))
        pygame.display.flip()

    def _wait(self, picture: pygame.Surface) -> None:
        """Wait until the next picture is due; follow meanwhile what the user does."""
        import pygame

        while not self.closed:
            for event in pygame.event.get():
                if event.type == pygame.QUIT or (
                    event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE
                ):
                    self.close()
                    return
                if event.type == pygame.VIDEORESIZE:
                    self._draw(picture)
            left = (self._due or 0.0) - time.perf_counter()
            if left <= 0.0:
                return
            time.sleep(min(left, _GLANCE))

    def close(self) -> None:
        """Close the window; doing so twice does no harm."""
        if self._due is not None and not self.closed:
            import pygame

            pygame.display.quit()
        self.closed = True
