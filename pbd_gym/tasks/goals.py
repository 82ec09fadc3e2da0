"""Goals apart from the rest of the state, so that they can be replaced in hindsight (HER)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces

from pbd_gym.physics.compiling import entry
from pbd_gym.tasks.base import OBSERVATION_LIMIT, Judgement, Start, Task, Variables, choice
from pbd_gym.tasks.rewards import closeness


@dataclass(frozen=True, kw_only=True)
class GoalTask(Task):
    """A task whose goal is apart from the rest: `observe` leaves it out, the reward needs no more.

    Goals are places of k points of the body, (n, k dim) [m] in the state's dtype. As the reward
    depends on them alone, transitions can be learned from as if another goal had been desired (M.
    Andrychowicz et al.: Hindsight Experience Replay, 2017).

    A twin of a task has that task and this class as its bases, in this order, as each of them sets
    the defaults anew. It defines the methods that raise NotImplementedError here, and hands what
    the task's `start` and `judge` return through `remember_goal` and `reward_goal`.
    """

    reward: str = choice("sparse", "sparse", "dense")

    @property
    def tolerance(self) -> float:
        """Mean distance of the points from their places below which a goal is reached [m]."""
        raise NotImplementedError

    def achieved(self, x: np.ndarray) -> np.ndarray:
        """Return where the points are, (n, k dim), a fresh array."""
        raise NotImplementedError

    def desired(self, variables: Variables) -> np.ndarray:
        """Return where the points should be, (n, k dim), by what the task remembers."""
        raise NotImplementedError

    @cached_property
    def goal_space(self) -> spaces.Box:
        """Achieved and desired goals of one world."""
        size = self.desired(self.lowest_start.variables).shape[1]
        return spaces.Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (size,), np.float32)

    def remember_goal(self, start: Start) -> Start:
        """Return the start of a task that remembers the desired goal, too."""
        desired = self.desired(start.variables)
        return start._replace(variables={**start.variables, "desired_goal": desired})

    def reward_goal(self, judgement: Judgement, x: np.ndarray, variables: Variables) -> Judgement:
        """Return a task's judgement with the reward and success of the goals alone."""
        distance, dense = self._compare(self.achieved(x), variables["desired_goal"])
        reached = distance < self.tolerance
        return judgement._replace(reward=self._choose(reached, dense), reached=reached)

    def compute_reward(self, achieved: np.ndarray, desired: np.ndarray) -> np.ndarray:
        """Return the rewards (...,) of goals (..., k dim)."""
        achieved, desired = np.asarray(achieved), np.asarray(desired)
        if achieved.shape != desired.shape or achieved.shape[-1:] != self.goal_space.shape:
            raise ValueError(
                f"achieved goals have shape {achieved.shape} and desired ones {desired.shape}; "
                f"expected the same, (..., {self.goal_space.shape[0]})"
            )
        rows = (-1, achieved.shape[-1])
        distance, dense = self._compare(
            np.ascontiguousarray(achieved, dtype=np.float32).reshape(rows),
            np.ascontiguousarray(desired, dtype=np.float32).reshape(rows),
        )
        return self._choose(distance < self.tolerance, dense).reshape(achieved.shape[:-1])

    def _choose(self, reached: np.ndarray, dense: np.ndarray) -> np.ndarray:
        """Return the rewards that the task was asked for."""
        return reached.astype(np.float64) if self.reward == "sparse" else dense

    def _compare(self, achieved: np.ndarray, desired: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean distances of n times k points from their places [m] and dense rewards."""
        distance, dense = np.empty(len(achieved)), np.empty(len(achieved))
        shape = (len(achieved), -1, self.model.dim)
        places = achieved.reshape(shape), desired.reshape(shape)
        _compare(*places, self.reward_scale, distance, dense)
        return distance, dense


@entry
def _compare(achieved: Any, desired: Any, scale: float, distance: Any, dense: Any) -> None:
    """Write the mean distances of n times k points (n, k, dim) from their places and the rewards.

    Args:
        achieved: Where the points are [m].
        desired: Where they should be [m].
        scale: Distance at which the dense reward is 1/e [m].
        distance: (n,) [m], written.
        dense: Rewards (n,), written.
    """
    for world in range(achieved.shape[0]):
        total = 0.0
        for point in range(achieved.shape[1]):
            square = 0.0
            for axis in range(achieved.shape[2]):
                apart = np.float64(achieved[world, point, axis] - desired[world, point, axis])
                square += apart * apart
            total += np.sqrt(square)
        distance[world] = total / achieved.shape[1]
        dense[world] = closeness(distance[world], scale)
