"""A rope on a gripper: bring its free end to a point and settle it there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pbd_gym.physics import Model, ModelBuilder, shapes
from pbd_gym.physics.compiling import entry
from pbd_gym.tasks.base import Draw, Judgement, Start, Task, Variables, draw, number
from pbd_gym.tasks.rewards import closeness


@dataclass(frozen=True, kw_only=True)
class Rope(Task):
    """A rope hangs from a gripper; its free end must come to the goal and rest there.

    ## Description
    A rope of 24 particles and 1 m hangs in a vertical plane from a gripper that the agent moves.
    The goal is a point that the hanging rope can reach: the agent has to get there quickly and to
    end the sway that its own motion causes. Every link is solved directly, so the rope keeps its
    length however it is swung.

    ## Action Space
    `Box(-1, 1, (2,), float32)`

    | Num | Action                       | Min | Max | Unit        |
    |-----|------------------------------|-----|-----|-------------|
    | 0   | gripper's desired velocity x | -1  | 1   | `max_speed` |
    | 1   | gripper's desired velocity y | -1  | 1   | `max_speed` |

    The gripper's velocity follows with at most `max_acceleration` along each axis and brakes before
    the edges of its workspace, x in [-1, 1] m, y in [-0.5, 1] m. Actions beyond [-1, 1] are
    clipped.

    ## Observation Space
    `Box(-10, 10, (4 N + 2,), float32)` for N observed particles, the gripper among them (24, or 10
    with `observation="keypoints"`):

    | Part                                                      | Size    | Unit         |
    |-----------------------------------------------------------|---------|--------------|
    | gripper's position relative to the centre of its workspace | 2       | m            |
    | gripper's velocity                                        | 2       | `max_speed`  |
    | other particles' positions relative to the gripper        | 2N - 2  | rope lengths |
    | other particles' velocities                               | 2N - 2  | 2 m/s        |
    | goal relative to the gripper                              | 2       | rope lengths |

    ## Rewards
    exp(-5 d / L) in [0, 1] for the distance d of the free end from the goal, L the rope's length.

    ## Starting State
    The rope hangs at rest from a gripper drawn uniformly from its workspace. The goal is uniform
    over where the free end of a rope hanging from the workspace can be: x in [-1, 1], y in
    [-0.5, 1] - L.

    ## Episode End
    Truncated after 100 steps. Success: d < 0.05 L at each of the last 10 steps. Terminated only if
    the simulation diverges, which does not happen with the defaults.

    ## Arguments
    ```python
    >>> import gymnasium
    >>> env = gymnasium.make("pbd_gym:PBDRope-v0", particles=32, mass=0.5)
    >>> observation, info = env.reset(seed=1, options={"goal": [0.5, -0.5]})

    ```
    Every field of the class is a keyword. `reset` takes the options `gripper` and `goal`, (x, y)
    [m] each.

    ## Version History
    * v0: first version
    """

    particles: int = number(24, 10, 1000)
    length: float = number(1.0, 0.1, 1.0, "m")
    mass: float = number(0.2, 1e-3, 1e3, "kg")
    compliance: float = number(0.0, 0.0, 1.0, "m/N")
    bending_stiffness: float = number(0.0, 0.0, 1e3, "N m2")

    hold_steps: ClassVar[int] = 10

    def build(self) -> Model:
        """Build the hanging rope, pinned at its first particle."""
        builder = ModelBuilder(2)
        indices = shapes.rope(
            builder,
            (0.0, 0.0),
            (0.0, -self.length),
            self.particles,
            mass=self.mass,
            compliance=self.compliance,
            bending_stiffness=self.bending_stiffness,
        )
        builder.pin(indices[0])
        return builder.build(gravity=(0.0, -self.gravity), damping=self.damping, iterations=2)

    def workspace(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the gripper's workspace."""
        return np.array([-1.0, -0.5]), np.array([1.0, 1.0])

    @property
    def view(self) -> tuple[np.ndarray, np.ndarray]:
        """The workspace and what hangs below it."""
        return np.array([-1.3, -0.6 - self.length]), np.array([1.3, 1.1])

    def declare_draws(self) -> dict[str, Draw]:
        """Draw the gripper, and the goal from below any place of the gripper."""
        lower, upper = self.workspace()
        drop = np.array([0.0, self.length])
        return {"gripper": draw(lower, upper), "goal": draw(lower - drop, upper - drop)}

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Hang the rope straight down, at rest."""
        x = (self.model.positions + quantities["gripper"][:, None]).astype(np.float32)
        return Start(x, np.zeros_like(x), {"goal": quantities["goal"].astype(np.float32)})

    @cached_property
    def _observed(self) -> np.ndarray:
        """The observed particles below the gripper."""
        count = self.particles if self.observation == "particles" else 10
        return np.round(np.linspace(0, self.particles - 1, count)).astype(np.int64)[1:]

    @cached_property
    def _centre(self) -> np.ndarray:
        """Middle of the gripper's workspace, (2,) [m]."""
        lower, upper = self.workspace()
        return (0.5 * (lower + upper)).astype(np.float32)

    @cached_property
    def _scales(self) -> np.ndarray:
        """What the gripper's velocity, lengths and other velocities are multiplied by."""
        return np.array([1.0 / self.max_speed, 1.0 / self.length, 0.5], dtype=np.float32)

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return gripper, rope relative to the gripper, and goal relative to the gripper."""
        observations = np.empty((len(x), 4 * len(self._observed) + 6), dtype=x.dtype)
        goal = variables["goal"]
        _observe(x, v, goal, self._observed, self._centre, self._scales, observations)
        return observations

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Judge by the distance of the free end from the goal."""
        count = len(x)
        distance, reward, performance = np.empty(count), np.empty(count), np.empty(count)
        reached = np.empty(count, dtype=bool)
        limits = self.reward_scale, self.goal_radius
        _judge(x, variables["goal"], *limits, distance, reward, performance, reached)
        return Judgement(reward, reached, performance, {"distance": distance})

    def goal(self, variables: Variables, world: int) -> np.ndarray:
        """Only the free end has a goal."""
        positions = np.full((self.particles, 2), np.nan)
        positions[-1] = variables["goal"][world]
        return positions

    @property
    def goal_radius(self) -> float:
        """Within 5 % of the rope's length the goal is met [m]."""
        return 0.05 * self.length

    @property
    def reward_scale(self) -> float:
        """A fifth of the rope's length [m]."""
        return 0.2 * self.length

    def scripted(self, observation: np.ndarray) -> np.ndarray:
        """Bring the gripper above the goal; follow the rope's middle to take the sway out."""
        count = 2 * len(self._observed)
        shape = (len(observation), len(self._observed), 2)
        hang = observation[:, 4 : 4 + count].reshape(shape).mean(axis=1) * self.length
        drift = observation[:, 4 + count : 4 + 2 * count].reshape(shape).mean(axis=1) * 2.0
        drift -= observation[:, 2:4] * self.max_speed
        velocity = observation[:, -2:] * self.length + np.array([0.0, self.length])
        velocity *= (1.5, 3.0)
        velocity[:, 0] += 4.0 * hang[:, 0] - 0.2 * drift[:, 0]
        return np.clip(velocity / self.max_speed, -1.0, 1.0).astype(np.float32)


@entry
def _observe(
    x: Any, v: Any, goal: Any, observed: Any, centre: Any, scales: Any, observations: Any
) -> None:
    """Write the observations of n worlds; see the class for what they hold."""
    motion = 4 + 2 * observed.shape[0]  # where the velocities begin
    last = motion + 2 * observed.shape[0]
    for world in range(x.shape[0]):
        for axis in range(2):
            gripper = x[world, 0, axis]
            observations[world, axis] = gripper - centre[axis]
            observations[world, 2 + axis] = v[world, 0, axis] * scales[0]
            observations[world, last + axis] = (goal[world, axis] - gripper) * scales[1]
        for index in range(observed.shape[0]):
            particle = observed[index]
            for axis in range(2):
                apart = x[world, particle, axis] - x[world, 0, axis]
                observations[world, 4 + 2 * index + axis] = apart * scales[1]
                observations[world, motion + 2 * index + axis] = (
                    v[world, particle, axis] * scales[2]
                )


@entry
def _judge(
    x: Any,
    goal: Any,
    scale: float,
    radius: float,
    distance: Any,
    reward: Any,
    performance: Any,
    reached: Any,
) -> None:
    """Judge n worlds by the distances of their free ends from their goals [m], (n,) each."""
    for world in range(x.shape[0]):
        across = np.float64(x[world, -1, 0] - goal[world, 0])
        along = np.float64(x[world, -1, 1] - goal[world, 1])
        distance[world] = np.sqrt(across * across + along * along)
    for world in range(x.shape[0]):  # a loop of its own is vector code
        reward[world] = closeness(distance[world], scale)
        performance[world] = -distance[world]
        reached[world] = distance[world] < radius
