"""The two faces of goal-conditioned tasks, as Gymnasium-Robotics' `GoalEnv` has them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from pbd_gym.envs.single import PBDEnv
from pbd_gym.envs.vector import PBDVectorEnv
from pbd_gym.tasks import GoalTask, Task


class Goals:
    """What a learner replaces goals with: reward and ends as functions of goals, of any shape.

    For goals (..., g) each returns an array (...,). `info` is that of `step`; the reward does not
    depend on it.
    """

    task: Task

    @property
    def _goal_task(self) -> GoalTask:
        if not isinstance(self.task, GoalTask):
            raise ValueError(f"{type(self.task).__name__} is no GoalTask, whose goals are apart")
        return self.task

    def _dict_space(self) -> spaces.Dict:
        goal = self._goal_task.goal_space
        parts = {"achieved_goal": goal, "desired_goal": goal}
        return spaces.Dict({"observation": self._goal_task.observation_space, **parts})

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> Any:
        """Return the reward of a step to achieved goals where others were desired.

        Raises:
            ValueError: If the goals have different shapes or others than the goal space.
        """
        return self._goal_task.compute_reward(achieved_goal, desired_goal)

    def compute_terminated(
        self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any
    ) -> Any:
        """Return whether the step ended the episode: no goal does, only divergence."""
        diverged = info.get("diverged", False) if isinstance(info, dict) else False
        return np.broadcast_to(diverged, np.shape(achieved_goal)[:-1])[()]

    def compute_truncated(
        self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any
    ) -> Any:
        """Return False: only the time limit truncates an episode."""
        return np.zeros(np.shape(achieved_goal)[:-1], dtype=bool)[()]


class PBDGoalEnv(Goals, PBDEnv):
    """One world of a goal-conditioned task; see `PBDEnv` for its arguments."""

    def __init__(self, task: str | type[Task], **arguments: Any) -> None:
        super().__init__(task, **arguments)
        self.observation_space = self._dict_space()


class PBDGoalVectorEnv(Goals, PBDVectorEnv):
    """n worlds of a goal-conditioned task; see `PBDVectorEnv` for its arguments."""

    def __init__(self, num_envs: int, task: str | type[Task], **arguments: Any) -> None:
        super().__init__(num_envs, task, **arguments)
        self.single_observation_space = self._dict_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
