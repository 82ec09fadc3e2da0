"""One world of a task as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from pbd_gym.envs.arguments import as_dict, make_task
from pbd_gym.envs.observations import world_of
from pbd_gym.envs.pictures import RENDER_MODES, Pictures
from pbd_gym.envs.state import EpisodeState, check_state
from pbd_gym.rendering import Viewpoint
from pbd_gym.tasks import Batch, Task


class PBDEnv(gymnasium.Env[Any, np.ndarray]):
    """One world of a task. The time limit is Gymnasium's `TimeLimit` wrapper, as for any env.

    Args:
        task: Task class, or its place "module:Class".
        render_mode: None, "rgb_array" or "human".
        render_size: Width and height of a frame [pixels].
        camera: "default", "front", "side", "top" or a `pbd_gym.rendering.Viewpoint`.
        color: "material", or "strain" with a legend in percent.
        theme: "light" or "dark".
        show: Any of "scale", "clock" and "trail".
        **arguments: The task's configuration, see its class.

    Raises:
        TypeError: For an unknown keyword.
        ValueError: For a value out of range.
    """

    # Gymnasium reads it from the class, and declares it there as an attribute of instances
    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 30}  # noqa: RUF012

    def __init__(
        self,
        task: str | type[Task],
        *,
        render_mode: str | None = None,
        render_size: tuple[int, int] = (512, 512),
        camera: str | Viewpoint = "default",
        color: str = "material",
        theme: str = "light",
        show: Sequence[str] = ("scale",),
        **arguments: Any,
    ) -> None:
        self.task = make_task(task, arguments)
        self._pictures = Pictures(
            self.task, 1, render_mode, render_size, camera, color, theme, show
        )
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": self._pictures.fps}
        self.metadata["render_modes"] = list(RENDER_MODES)
        self.action_space = self.task.action_space
        self.observation_space = self.task.observation_space
        self._batch = Batch(self.task, 1, num_threads=1)
        self._begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; options fix quantities that are drawn otherwise (see the task).

        Raises:
            TypeError, ValueError: For an unknown option or one out of range. Nothing changes then.
        """
        fixed = self._batch.check_options(as_dict(options))
        super().reset(seed=seed)
        self._batch.reset(np.zeros(1, dtype=np.int64), [self.np_random], fixed)
        self._begun = True
        self._pictures.begin(np.zeros(1, dtype=np.int64), self._batch)
        if self.render_mode == "human":
            self.render()
        return world_of(self._batch.observe(), 0), {}

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance the world by one control step.

        Raises:
            RuntimeError: Before the first `reset`.
            TypeError, ValueError: For an action that is no vector of finite numbers of the right
                size. Nothing has moved then.
        """
        if not self._begun:
            raise RuntimeError("step was called before reset: call reset() first")
        outcome = self._batch.step(np.asarray(action)[None])
        self._pictures.advance(self._batch)
        if self.render_mode == "human":
            self.render()
        info = {name: values.item() for name, values in outcome.info.items()}
        observation = world_of(self._batch.observe(), 0)
        return observation, outcome.reward.item(), outcome.terminated.item(), False, info

    # Gymnasium types it with a variable that is not the one of the class
    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return a frame (height, width, 3) uint8; in human mode show it and return None."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                "render was called without a render mode; make the environment with "
                'render_mode="rgb_array" or "human"'
            )
            return None
        frame = self._pictures.draw(self._batch, 0)
        if self.render_mode == "rgb_array":
            return frame
        self._pictures.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        self._pictures.close()

    def get_state(self) -> EpisodeState:
        """Return all that the episode's continuation depends on, the random generator included.

        The counter of a `TimeLimit` wrapper is its own and not part of it.
        """
        worlds, variables = self._batch.get_state()
        begun = np.array([self._begun])
        generators = [self.np_random.bit_generator.state]
        counters = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=bool)
        return EpisodeState(worlds, variables, generators, *counters, begun)

    def set_state(self, state: EpisodeState) -> None:
        """Continue from a state of `get_state`, to the last bit.

        Raises:
            TypeError: If it is no `EpisodeState`.
            ValueError: If it is of another task, model or number of worlds. Nothing changes then.
        """
        check_state(state, 1)
        self._batch.set_state((state.worlds, state.variables))
        self.np_random.bit_generator.state = state.generators[0]
        self._begun = bool(state.begun[0])
        self._pictures.begin(np.zeros(1, dtype=np.int64), self._batch)
