"""How worlds of a batch are drawn and shown."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.rendering import Renderer, Window
from pbd_gym.rendering.renderer import check_size
from pbd_gym.tasks import Batch, Task

RENDER_MODES = ("rgb_array", "human")


class Pictures:
    """Draws worlds of a batch, in a window if asked; makes renderer and window when first used."""

    def __init__(self, task: Task, render_mode: str | None, render_size: tuple[int, int]) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode is {render_mode!r}; allowed: None, {list(RENDER_MODES)}")
        self.task, self.size = task, check_size(render_size)
        self.renderer: Renderer | None = None
        self.window: Window | None = None

    @property
    def fps(self) -> int:
        """Frames per second at which a video plays in real time."""
        return max(1, round(self.task.control_rate))

    def draw(self, batch: Batch, world: int) -> np.ndarray:
        """Return a frame of one world, (height, width, 3) uint8."""
        if self.renderer is None:
            self.renderer = Renderer(
                self.task.model, self.task.view, size=self.size, rails=self.task.rails
            )
        goal = self.task.goal(batch.variables, world)
        return self.renderer.draw(batch.world.x[world], goal, self.task.goal_radius)

    def show(self, frame: np.ndarray) -> None:
        """Show a frame in the window, in real time."""
        if self.window is None:
            self.window = Window(self.size, self.task.control_rate)
        self.window.show(frame)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.window is not None:
            self.window.close()
        self.window = None

    def __getstate__(self) -> dict[str, Any]:
        # surfaces and windows cannot be pickled; they are made again when needed
        return {**self.__dict__, "renderer": None, "window": None}
