"""The goal-conditioned twins of rope and cloth: the same worlds, their goals apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pbd_gym.tasks.base import Judgement, Start, Variables
from pbd_gym.tasks.cloth import Cloth
from pbd_gym.tasks.goals import GoalTask
from pbd_gym.tasks.rope import Rope


@dataclass(frozen=True, kw_only=True)
class RopeGoal(Rope, GoalTask):
    """The rope with its goal apart: bring the free end to a point, with or without hindsight.

    ## Description
    The world, the starts and the goals of `PBDRope-v0`: the same seed and actions move the same
    rope. The goal is observed apart from the rope, as Gymnasium-Robotics has it, and the reward is
    a function of the goals alone, so that transitions can be replayed with other goals.

    ## Action Space
    `Box(-1, 1, (2,), float32)`, as for `PBDRope-v0`.

    ## Observation Space
    `Dict`; N particles are observed, the gripper among them (24, or 10 with
    `observation="keypoints"`):

    | Key             | Size | Holds                                                            |
    |-----------------|------|------------------------------------------------------------------|
    | `observation`   | 4 N  | the observation of `PBDRope-v0` without its last part, the goal  |
    | `achieved_goal` | 2    | where the free end is, x, y [m]                                  |
    | `desired_goal`  | 2    | where it should be, x, y [m]                                     |

    ## Rewards
    `reward="sparse"` (default): 1 where the free end is within 0.05 L of the goal, else 0.
    `reward="dense"`: exp(-5 d / L) for its distance d, the reward of `PBDRope-v0`.
    `env.unwrapped.compute_reward(achieved_goal, desired_goal, info)` returns the same for goals
    (..., 2).

    ## Starting State
    That of `PBDRope-v0`.

    ## Episode End
    Truncated after 100 steps. Success: d < 0.05 L at each of the last 10 steps. No goal ends an
    episode; it is terminated only if the simulation diverges, which does not happen with the
    defaults.

    ## Arguments
    ```python
    >>> import gymnasium
    >>> env = gymnasium.make("pbd_gym:PBDRopeGoal-v0", reward="dense")
    >>> observation, info = env.reset(seed=1, options={"goal": [0.5, -0.5]})

    ```
    `reward`, and every keyword and option of `PBDRope-v0`.

    ## Version History
    * v0: first version
    """

    @property
    def tolerance(self) -> float:
        """The circle around the goal [m]."""
        return self.goal_radius

    def achieved(self, x: np.ndarray) -> np.ndarray:
        """Return where the free end is."""
        return x[:, -1].copy()

    def desired(self, variables: Variables) -> np.ndarray:
        """Return where the free end should be."""
        return variables["goal"].copy()

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return gripper, and rope relative to the gripper."""
        return super().observe(x, v, variables)[:, :-2].copy()

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Begin as the rope does."""
        return self.remember_goal(super().start(quantities))

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Reward by the goals alone; performance and terms are those of the rope."""
        return self.reward_goal(super().judge(x, v, action, variables), x, variables)

    def scripted(self, observation: Any) -> np.ndarray:
        """Act on a dict of observations as on the rope's, which end with the goal."""
        rope, desired = observation["observation"], observation["desired_goal"]
        goal = (desired - rope[:, :2] - self._centre) / self.length
        return super().scripted(np.concatenate([rope, goal], axis=1))


@dataclass(frozen=True, kw_only=True)
class ClothGoal(Cloth, GoalTask):
    """The cloth with its goal apart: bring nine of its points to their places.

    ## Description
    The world, the starts and the goals of `PBDCloth-v0`: the same seed and actions move the same
    cloth. The goal is where nine points of the cloth should be, its corners, the middles of its
    edges and its centre; as desired they lie on the drawn square. It is observed apart from the
    cloth, as Gymnasium-Robotics has it, and the reward is a function of the goals alone, so that
    transitions can be replayed with other goals.

    ## Action Space
    `Box(-1, 1, (6,), float32)`, as for `PBDCloth-v0`.

    ## Observation Space
    `Dict`; N particles are observed (144, or 9 with `observation="keypoints"`):

    | Key             | Size | Holds                                                            |
    |-----------------|------|------------------------------------------------------------------|
    | `observation`   | 6 N  | positions [0.5 m], velocities [m/s]                              |
    | `achieved_goal` | 27   | where the nine points are, row by row from the held edge [m]     |
    | `desired_goal`  | 27   | where they should be [m]                                         |

    ## Rewards
    `reward="sparse"` (default): 1 where the mean distance m of the nine points from their places is
    below side/12 (5 cm), else 0. `reward="dense"`: exp(-5 m / side).
    `env.unwrapped.compute_reward(achieved_goal, desired_goal, info)` returns the same for goals
    (..., 27).

    ## Starting State
    That of `PBDCloth-v0`.

    ## Episode End
    Truncated after 90 steps. Success: m < side/12 at the end. No goal ends an episode; it is
    terminated only if the simulation diverges, which does not happen with the defaults.

    ## Arguments
    ```python
    >>> import gymnasium
    >>> env = gymnasium.make("pbd_gym:PBDClothGoal-v0", observation="keypoints", reward="dense")
    >>> observation, info = env.reset(seed=1, options={"goal": [0.1, 0.0], "goal_yaw": 0.3})

    ```
    `reward`, and every keyword and option of `PBDCloth-v0`.

    ## Version History
    * v0: first version
    """

    @property
    def tolerance(self) -> float:
        """A tenth of the mean distance at the start, about, as `PBDCloth-v0` asks for [m]."""
        return self.side / 12.0

    @cached_property
    def _points(self) -> np.ndarray:
        """The nine particles that the goal is about."""
        return self.grid_particles(3)

    def achieved(self, x: np.ndarray) -> np.ndarray:
        """Return where the nine points are."""
        return x[:, self._points].reshape(len(x), -1)

    def desired(self, variables: Variables) -> np.ndarray:
        """Return the places of the nine points on the square."""
        return self.places(variables)[:, self._points].reshape(-1, 27).astype(np.float32)

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return positions and velocities, as of a goal in the middle."""
        axis = np.zeros((len(x), 2), dtype=x.dtype)
        middle = {"goal": np.zeros_like(axis), "goal_axis": axis}
        return super().observe(x, v, middle)[:, :-4].copy()

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Begin as the cloth does."""
        return self.remember_goal(super().start(quantities))

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Reward by the goals alone; performance and terms are those of the cloth."""
        return self.reward_goal(super().judge(x, v, action, variables), x, variables)

    def scripted(self, observation: Any) -> np.ndarray:
        """Act on a dict of observations as on the cloth's, which are relative to the square."""
        cloth, desired = observation["observation"], observation["desired_goal"]
        nine = desired.reshape(-1, 9, 3)
        centre = nine[:, [0, 2, 6, 8]].mean(axis=1) * (1.0, 1.0, 0.0)
        axis = (nine[:, 2] - nine[:, 0]) / self.side
        positions, velocities = np.split(cloth, 2, axis=1)
        relative = positions - np.tile(2.0 * centre, positions.shape[1] // 3)
        whole = np.concatenate([relative, velocities, centre[:, :2], axis[:, :2]], axis=1)
        return super().scripted(whole)
