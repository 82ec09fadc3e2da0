"""A cloth held by two corners above a table: lay it flat on a square."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pbd_gym.physics import Model, ModelBuilder, World, shapes
from pbd_gym.physics.compiling import entry, loaded_lanes
from pbd_gym.physics.portable import cos_sin
from pbd_gym.tasks.base import Draw, Judgement, Start, Task, Variables, draw, number
from pbd_gym.tasks.rewards import closeness

_PI = 3.141592653589793
# Distance that particles keep from the table [m].
_TABLE_GAP = 0.005
# Pins are held at most this share of the cloth's side apart: a taut edge would fight with gravity.
_SPAN = 0.97
# What the task remembers of the goal: the square's centre, the cosine and sine of its yaw.
_SQUARE = ("goal", "goal_axis")


@dataclass(frozen=True, kw_only=True)
class Cloth(Task):
    """A cloth hangs by two corners above a table; it must be laid flat on a square.

    ## Description
    A cloth of 12 x 12 particles, 0.6 m wide, hangs from two grippers at the corners of one edge.
    The agent moves both grippers and has to lay the cloth on a drawn square of the table: free
    edge first, then down and back. The threads are solved directly, the cloth collides with itself
    and with the table, with friction.

    ## Action Space
    `Box(-1, 1, (6,), float32)`: desired velocities x, y, z of the first, then of the second
    gripper, in units of `max_speed` (1 m/s). The grippers' velocities follow with at most
    `max_acceleration` (10 m/s2) along each axis, brake before the edges of the workspace (x, y in
    [-0.8, 0.8] m, z up to 1 m) and stay within 0.97 of the cloth's side of each other. Actions
    beyond [-1, 1] are clipped.

    ## Observation Space
    `Box(-10, 10, (6 N + 4,), float32)` for N observed particles (144, or 9 with
    `observation="keypoints"`: corners, middles of the edges, centre):

    | Part                                         | Size | Unit  |
    |----------------------------------------------|------|-------|
    | positions relative to the square's centre    | 3 N  | 0.5 m |
    | velocities                                   | 3 N  | m/s   |
    | the square's centre, x, y                    | 2    | m     |
    | cosine and sine of the square's yaw          | 2    |       |

    ## Rewards
    exp(-5 m / side) in [0, 1] for the mean distance m of all particles from their places on the
    square.

    ## Starting State
    The cloth hangs at rest. The grippers' middle is drawn from x, y in [-0.1, 0.1] m, their
    height from [0.68, 0.74] m and the yaw of the line between them from [-0.3, 0.3] rad; so are the
    centre and the yaw of the square.

    ## Episode End
    Truncated after 90 steps. Success: normalized performance > 0.9 at the end, that is a mean
    distance below a tenth of that at the start. Terminated only if the simulation diverges, which
    does not happen with the defaults.

    ## Arguments
    ```python
    >>> import gymnasium
    >>> env = gymnasium.make("pbd_gym:PBDCloth-v0", observation="keypoints", friction=0.8)
    >>> observation, info = env.reset(seed=1, options={"goal": [0.1, 0.0], "goal_yaw": 0.3})

    ```
    Every field of the class is a keyword. `reset` takes the options `middle` (x, y) [m], `height`
    [m], `yaw` [rad], `goal` (x, y) [m] and `goal_yaw` [rad].

    ## Version History
    * v0: first version
    """

    particles: int = number(12, 4, 40)
    side: float = number(0.6, 0.1, 0.6, "m")
    mass: float = number(0.15, 1e-3, 1e2, "kg")
    stretch_compliance: float = number(1e-4, 0.0, 1.0, "m/N")
    shear_compliance: float = number(0.1, 0.0, 1e3, "m/N")
    bending_compliance: float = number(10.0, 0.0, 1e6, "m/N")
    bending_friction: float = number(0.003, 0.0, 1e3, "N")
    thread_damping: float = number(0.0, 0.0, 1e3, "1/s")
    # of the cloth with itself; where it sticks more, a heap can hardly be drawn flat
    collision_friction: float = number(0.1, 0.0, 10.0)
    friction: float = number(0.5, 0.0, 10.0)
    substeps: int = number(16, 1, 1000)
    max_speed: float = number(1.0, 1e-3, 100.0, "m/s")
    max_acceleration: float = number(10.0, 1e-3, 1000.0, "m/s2")
    damping: float = number(1.0, 0.0, 100.0, "1/s")

    action_axes: ClassVar[tuple[int, ...]] = (0, 1, 2)

    def build(self) -> Model:
        """Build the cloth, hanging flat; row 0 is the held edge."""
        builder = ModelBuilder(3)
        spacing = self.side / (self.particles - 1)
        grid = shapes.cloth(
            builder,
            (-0.5 * self.side, 0.0, self.side + 0.1),
            (0.0, 0.0, -self.side),
            (self.side, 0.0, 0.0),
            (self.particles, self.particles),
            mass=self.mass,
            stretch_compliance=self.stretch_compliance,
            shear_compliance=self.shear_compliance,
            bending_compliance=self.bending_compliance,
            bending_friction=self.bending_friction,
            thread_damping=self.thread_damping,
            strain_limit=0.01,
            collision_distance=0.7 * spacing,
            collision_friction=self.collision_friction,
        )
        builder.pin([grid[0, 0], grid[0, -1]])
        builder.set_ground(0.0, friction=self.friction, radius=_TABLE_GAP)
        return builder.build(gravity=(0.0, 0.0, -self.gravity), damping=self.damping)

    def workspace(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the grippers' workspace."""
        return np.array([-0.8, -0.8, _TABLE_GAP]), np.array([0.8, 0.8, 1.0])

    def span(self) -> float:
        """Return how far apart the grippers may be."""
        return _SPAN * self.side

    @property
    def view(self) -> tuple[np.ndarray, np.ndarray]:
        """The part of the workspace in which the task takes place."""
        return np.array([-0.6, -0.6, 0.0]), np.array([0.6, 0.6, 0.8])

    def declare_draws(self) -> dict[str, Draw]:
        """Draw where the cloth hangs and where it shall lie."""
        near, far = np.full(2, 0.1), np.full(2, 0.4)
        return {
            "middle": draw(-near, near, -far, far),
            "height": draw(self.side + 0.08, self.side + 0.14, self.side + 0.08, 1.0),
            "yaw": draw(-0.3, 0.3, -_PI, _PI),
            "goal": draw(-near, near, -far, far),
            "goal_yaw": draw(-0.3, 0.3, -_PI, _PI),
        }

    @cached_property
    def _hanging(self) -> np.ndarray:
        """Positions of the cloth at rest below its grippers, whose middle is the origin, (N, 3)."""
        world = World(self.model, 1, lanes=loaded_lanes(3))
        # a flat sheet between two grippers would stay flat until something makes it buckle
        across = world.x[0, :, 0] / (0.5 * self.side)
        world.x[0, :, 1] += np.float32(0.01) * (1 - across * across)
        pins = self.model.pins
        grippers = world.x[:, pins]
        grippers[:, :, 0] *= np.float32(_SPAN)
        for _ in range(round(8.0 * self.control_rate)):
            world.step(1.0 / self.control_rate, self.substeps, grippers)
        x = world.x[0]
        return x - np.float32(0.5) * (x[pins[0]] + x[pins[1]])

    @cached_property
    def _square(self) -> np.ndarray:
        """Places of the particles on a square around the origin, (N, 2): row 0 at +y."""
        line = np.linspace(-0.5 * self.side, 0.5 * self.side, self.particles)
        across, along = np.meshgrid(line, -line)
        return np.stack([across.ravel(), along.ravel()], axis=1)

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Hang the cloth at rest at its place, turned by its yaw."""
        turned = _turn(self._hanging[None].astype(np.float64), quantities["yaw"])
        place = np.concatenate([quantities["middle"], quantities["height"]], axis=1)
        x = (turned + place[:, None]).astype(np.float32)
        cosine, sine = cos_sin(quantities["goal_yaw"])
        variables = {
            "goal": quantities["goal"].astype(np.float32),
            "goal_axis": np.concatenate([cosine, sine], axis=1).astype(np.float32),
        }
        return Start(x, np.zeros_like(x), variables)

    def _in_square(self, vectors: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Return vectors (n, k, 3) in the axes of the goal squares (n, 2)."""
        cosine, sine = axis[:, :1], axis[:, 1:]
        turned = vectors.copy()
        turned[:, :, 0] = vectors[:, :, 0] * cosine + vectors[:, :, 1] * sine
        turned[:, :, 1] = vectors[:, :, 1] * cosine - vectors[:, :, 0] * sine
        return turned

    @cached_property
    def _observed(self) -> np.ndarray:
        """Indices of the observed particles."""
        return self.grid_particles(self.particles if self.observation == "particles" else 3)

    def grid_particles(self, count: int) -> np.ndarray:
        """Return the particles of a grid of count x count over the cloth, row by row."""
        line = np.round(np.linspace(0, self.particles - 1, count)).astype(np.int64)
        return (line[:, None] * self.particles + line).ravel()

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return positions relative to the square, velocities, and the square."""
        observations = np.empty((len(x), 6 * len(self._observed) + 4), dtype=x.dtype)
        _observe(x, v, variables["goal"], variables["goal_axis"], self._observed, observations)
        return observations

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Judge by the mean distance of the particles from their places."""
        distance, reward = np.empty(len(x)), np.empty(len(x))
        goal, axis = variables["goal"], variables["goal_axis"]
        _judge(x, goal, axis, self._square, self.reward_scale, distance, reward)
        if "start_performance" in variables:
            reached = distance < -0.1 * variables["start_performance"]
        else:
            reached = np.zeros(len(x), dtype=bool)
        return Judgement(reward, reached, -distance, {"distance": distance})

    def goal(self, variables: Variables, world: int) -> np.ndarray:
        """Every particle has its place on the square."""
        return self.places({name: variables[name][world : world + 1] for name in _SQUARE})[0]

    @property
    def reward_scale(self) -> float:
        """A fifth of the cloth's side [m]."""
        return 0.2 * self.side

    def places(self, variables: Variables) -> np.ndarray:
        """Return where the particles lie on the squares of n worlds, (n, N, 3) [m]."""
        cosine, sine = variables["goal_axis"].T[:, :, None].astype(np.float64)
        across, along = self._square[:, 0], self._square[:, 1]
        turned = np.stack([across * cosine - along * sine, across * sine + along * cosine], axis=2)
        height = np.full((*turned.shape[:2], 1), _TABLE_GAP)
        return np.concatenate([turned + variables["goal"][:, None], height], axis=2)

    def scripted(self, observation: np.ndarray) -> np.ndarray:
        """Put the free edge down at its place, then lower the held edge while moving it back."""
        count = len(self._observed)
        line = round(count**0.5)
        cosine, sine = observation[:, -2:-1], observation[:, -1:]
        places = observation[:, : 3 * count].reshape(-1, count, 3).astype(np.float64) * 0.5
        places = self._in_square(places, observation[:, -2:]).reshape(-1, line, line, 3)
        grippers = places[:, 0, [0, -1]]
        half = 0.5 * self.side
        free = places[:, -1].mean(axis=1)
        # the height of the grippers says how much of the cloth may already lie on the table
        height = grippers[:, :, 2].mean(axis=1)
        lying = np.sqrt(np.maximum(self.side**2 - np.minimum(height, self.side) ** 2, 0.0))
        target = np.zeros_like(grippers)
        target[:, 0, 0], target[:, 1, 0] = -_SPAN * half, _SPAN * half
        target[:, :, 1] = (lying - half)[:, None]
        astray = np.abs(grippers - target)[:, :, :2].max(axis=(1, 2)) > 0.1
        astray |= np.abs(free[:, 1] + half) > 0.15
        wait = astray & (height > self.side - 0.1) & (height < self.side + 0.03)
        velocity = 4.0 * (target - grippers)
        fall = np.maximum(4.0 * (_TABLE_GAP - height), -0.4)
        velocity[:, :, 2] = np.where(wait, 0.0, fall)[:, None]
        world = np.empty_like(velocity)
        world[:, :, 0] = velocity[:, :, 0] * cosine - velocity[:, :, 1] * sine
        world[:, :, 1] = velocity[:, :, 0] * sine + velocity[:, :, 1] * cosine
        world[:, :, 2] = velocity[:, :, 2]
        return np.clip(world.reshape(-1, 6) / self.max_speed, -1.0, 1.0).astype(np.float32)


@entry
def _observe(x: Any, v: Any, goal: Any, goal_axis: Any, observed: Any, observations: Any) -> None:
    """Write the observations of n worlds; see the class for what they hold."""
    double = x.dtype.type(2)
    size = 3 * observed.shape[0]
    for world in range(x.shape[0]):
        for index in range(observed.shape[0]):
            particle = observed[index]
            across, along = x[world, particle, 0], x[world, particle, 1]
            observations[world, 3 * index] = (across - goal[world, 0]) * double
            observations[world, 3 * index + 1] = (along - goal[world, 1]) * double
            observations[world, 3 * index + 2] = x[world, particle, 2] * double
            for axis in range(3):
                observations[world, size + 3 * index + axis] = v[world, particle, axis]
        for axis in range(2):
            observations[world, 2 * size + axis] = goal[world, axis]
            observations[world, 2 * size + 2 + axis] = goal_axis[world, axis]


@entry
def _judge(
    x: Any, goal: Any, goal_axis: Any, square: Any, scale: float, distance: Any, reward: Any
) -> None:
    """Write the mean distances of n worlds' particles from their places [m], and the rewards.

    Args:
        x: Positions (n, N, 3) [m].
        goal: Centres of the squares (n, 2) [m].
        goal_axis: Cosines and sines of their yaws (n, 2).
        square: Places of the particles on a square around the origin, (N, 2) [m].
        scale: Distance at which the reward is 1/e [m].
        distance: (n,), written.
        reward: (n,), written.
    """
    count = x.shape[1]
    for world in range(x.shape[0]):
        cosine, sine = np.float64(goal_axis[world, 0]), np.float64(goal_axis[world, 1])
        total = 0.0
        for particle in range(count):
            across, along = (
                x[world, particle, 0] - goal[world, 0],
                x[world, particle, 1] - goal[world, 1],
            )
            right = across * cosine + along * sine - square[particle, 0]
            up = along * cosine - across * sine - square[particle, 1]
            above = x[world, particle, 2] - _TABLE_GAP
            total += np.sqrt(right * right + up * up + above * above)
        distance[world] = total / count
        reward[world] = closeness(distance[world], scale)


def _turn(points: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Turn points (1, k, 3) about the vertical by yaws (n, 1) [rad]; return (n, k, 3)."""
    cosine, sine = cos_sin(yaw)
    across = points[:, :, 0] * cosine - points[:, :, 1] * sine
    along = points[:, :, 0] * sine + points[:, :, 1] * cosine
    up = np.broadcast_to(points[:, :, 2], across.shape)
    return np.stack([across, along, up], axis=2)
