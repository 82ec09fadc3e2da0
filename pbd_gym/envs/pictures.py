"""How worlds of a batch are drawn and shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pbd_gym.rendering import Look, Renderer, Viewpoint, Window
from pbd_gym.tasks import Batch, Task

RENDER_MODES = ("rgb_array", "human")
_TRAIL = 1.5  # how far back a trail reaches [s]


class Pictures:
    """Draws worlds of a batch, in a window if asked; makes renderer and window when first used."""

    def __init__(
        self,
        task: Task,
        worlds: int,
        render_mode: str | None,
        size: tuple[int, int],
        camera: str | Viewpoint,
        color: str,
        theme: str,
        show: Sequence[str],
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode is {render_mode!r}; allowed: None, {list(RENDER_MODES)}")
        self.task, self.look = task, Look(size, camera, color, theme, show)
        self.renderer: Renderer | None = None
        self.window: Window | None = None
        self._drawn = render_mode is not None
        self._steps = np.zeros(worlds, dtype=np.int64)  # since each episode began
        self._follows = self._drawn and "trail" in self.look.show
        self._past: list[np.ndarray] = []  # positions (W, N, dim) from the oldest on

    @property
    def fps(self) -> int:
        """Frames per second at which a video plays in real time."""
        return max(1, round(self.task.control_rate))

    def begin(self, worlds: np.ndarray, batch: Batch) -> None:
        """Set the clock of worlds to 0 and forget where they were."""
        self._steps[worlds] = 0
        if self._follows:
            for past in self._past:
                past[worlds] = np.nan
            if not self._past:
                self._past.append(np.full_like(batch.world.x, np.nan))
            self._past[-1][worlds] = batch.world.x[worlds]

    def advance(self, batch: Batch) -> None:
        """Note that a control step has passed, if any picture can be asked for."""
        if not self._drawn:
            return
        self._steps += 1
        if self._follows:
            self._past.append(batch.world.x.copy())
            del self._past[: -round(_TRAIL * self.task.control_rate) - 1]

    def draw(self, batch: Batch, world: int) -> np.ndarray:
        """Return a frame of one world, (height, width, 3) uint8."""
        task, look = self.task, self.look
        if self.renderer is None:
            self.renderer = Renderer(
                task.model,
                task.view,
                size=look.size,
                rails=task.rails,
                camera=look.camera,
                color=look.color,
                theme=look.theme,
                show=look.show,
            )
        tips = self.renderer.tips
        trail = [past[world, tips] for past in self._past]
        return self.renderer.draw(
            batch.world.x[world],
            task.goal(batch.variables, world),
            task.goal_radius,
            time=self._steps[world] / task.control_rate,
            trail=np.array(trail) if trail else None,
        )

    def show(self, frame: np.ndarray) -> None:
        """Show a frame in the window, in real time."""
        if self.window is None:
            rate, paper = self.task.control_rate, self.look.colours.paper
            self.window = Window(self.look.size, rate, background=paper)
        self.window.show(frame)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.window is not None:
            self.window.close()
        self.window = None

    def __getstate__(self) -> dict[str, Any]:
        # windows cannot be pickled; they and the renderer are made again when needed
        return {**self.__dict__, "renderer": None, "window": None}
