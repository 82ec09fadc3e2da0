"""Pictures and films of the window, and scenes, written to files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pygame

from pbd_gym.playground.files import Scene, save_scene
from pbd_gym.rendering import VideoWriter


class Recorder:
    """Writes files into a folder, each under a new name, and says in words how that went.

    Args:
        folder: Where they go.
        fps: Pictures per second of a film.
    """

    def __init__(self, folder: Path, fps: float) -> None:
        self.folder = folder
        self._fps = fps
        self._film: VideoWriter | None = None
        self._size = (0, 0)

    @property
    def is_filming(self) -> bool:
        """Whether a film is being made."""
        return self._film is not None

    def save(self, scene: Scene) -> str:
        """Write a scene as JSON."""
        path = self._fresh_path(".json")
        try:
            save_scene(path, scene)
        except (OSError, ValueError) as error:
            return f"The scene could not be saved: {error}"
        return f"Scene: {path}"

    def picture(self, screen: pygame.Surface) -> str:
        """Write what the window shows as PNG."""
        path = self._fresh_path(".png")
        try:
            pygame.image.save(screen, path)
        except (OSError, pygame.error) as error:
            return f"The picture could not be saved: {error}"
        return f"Picture: {path}"

    def start_film(self, screen: pygame.Surface) -> str:
        """Begin a film of the window."""
        try:
            self._film = VideoWriter(self._fresh_path(".mp4"), self._fps)
        except (ImportError, ValueError) as error:
            return f"No film: {error}"
        width, height = screen.get_size()
        self._size = (width // 2 * 2, height // 2 * 2)
        return "Filming. Press Film again to stop."

    def keep(self, screen: pygame.Surface) -> str | None:
        """Append what the window shows to the film; return what went wrong, if anything did."""
        if self._film is None:
            return None
        width, height = self._size
        pixels = pygame.surfarray.array3d(screen)[:width, :height].transpose(1, 0, 2)
        try:
            self._film.write(np.ascontiguousarray(pixels))
        except (OSError, RuntimeError, ValueError) as error:
            self._film = None
            return f"The film broke off: {error}"
        return None

    def finish_film(self) -> str | None:
        """Write the film to its file, if one is being made."""
        film, self._film = self._film, None
        if film is None:
            return None
        try:
            film.close()
        except (OSError, RuntimeError, ValueError) as error:
            return f"There is no film: {error}"
        return f"Film: {film.path}"

    def _fresh_path(self, suffix: str) -> Path:
        number = 1
        while (self.folder / f"playground-{number}{suffix}").exists():
            number += 1
        return self.folder / f"playground-{number}{suffix}"
