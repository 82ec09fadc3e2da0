"""What a task is: start, actions to pin targets, observation, reward; for n worlds at once."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium import spaces

from pbd_gym.physics import Model
from pbd_gym.tasks.driving import drive_pins

Variables = dict[str, np.ndarray]
# Observations are scaled to about [-1, 1] and clipped here, so that their bounds are finite.
OBSERVATION_LIMIT = 10.0


def number(default: float, low: float, high: float, unit: str = "") -> Any:
    """Declare a number of a task's configuration, its range (both ends allowed) and its unit."""
    return dataclasses.field(default=default, metadata={"low": low, "high": high, "unit": unit})


def choice(default: str, *allowed: str) -> Any:
    """Declare a word of a task's configuration and the words that are allowed."""
    return dataclasses.field(default=default, metadata={"allowed": allowed})


@dataclasses.dataclass(frozen=True)
class Draw:
    """A quantity drawn uniformly at every reset; an option of `reset` can fix it instead.

    Attributes:
        low: (k,) least value drawn.
        high: (k,) greatest value drawn.
        least: (k,) least value an option may have.
        greatest: (k,) greatest value an option may have.
    """

    low: np.ndarray
    high: np.ndarray
    least: np.ndarray
    greatest: np.ndarray


def draw(low: Any, high: Any, least: Any = None, greatest: Any = None) -> Draw:
    """Declare a drawn quantity; an option may have the same range where no other is given."""
    ends = [low, high, low if least is None else least, high if greatest is None else greatest]
    return Draw(*(np.atleast_1d(np.asarray(end, dtype=np.float64)) for end in ends))


class Start(NamedTuple):
    """Where n worlds begin: positions and velocities (n, N, dim), and what the task remembers."""

    x: np.ndarray
    v: np.ndarray
    variables: Variables


class Judgement(NamedTuple):
    """How n worlds stand after a step, each (n,).

    Attributes:
        reward: In [0, 1].
        reached: Whether the goal is met at this moment.
        performance: The task's measure, greater is better.
        terms: Parts of the reward, for `info`.
    """

    reward: np.ndarray
    reached: np.ndarray
    performance: np.ndarray
    terms: dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task:
    """A task for n worlds. Its fields are its configuration, with units; subclasses add theirs.

    A subclass defines the methods that raise NotImplementedError here, as class constants
    `hold_steps` (number of steps in a row for which the goal must be met), `best_performance`, and
    `action_axes` (the axes along which an action moves each pin).

    `observe` and `judge` may be plain NumPy. Those of the built-in tasks call compiled loops over
    the worlds: for one world, small NumPy calls would take longer than its physics.

    Raises:
        TypeError: For a keyword that does not exist or a value of another kind.
        ValueError: For a value out of range.
    """

    control_rate: float = number(30.0, 1.0, 1000.0, "Hz")
    substeps: int = number(10, 1, 1000)
    max_speed: float = number(2.0, 1e-3, 100.0, "m/s")
    max_acceleration: float = number(20.0, 1e-3, 1000.0, "m/s2")
    gravity: float = number(9.81, 0.0, 100.0, "m/s2")
    damping: float = number(0.5, 0.0, 100.0, "1/s")
    observation: str = choice("particles", "particles", "keypoints")

    hold_steps: ClassVar[int] = 1
    best_performance: ClassVar[float] = 0.0
    action_axes: ClassVar[tuple[int, ...]] = (0, 1)
    # beyond this distance from the origin a world has diverged [m]
    sanity_bound: ClassVar[float] = 100.0

    def __post_init__(self) -> None:
        for spec in dataclasses.fields(self):
            _check_field(spec, getattr(self, spec.name))

    @cached_property
    def model(self) -> Model:
        """The model of one world."""
        return self.build()

    @cached_property
    def draws(self) -> dict[str, Draw]:
        """What is drawn at a reset, by name."""
        return self.declare_draws()

    @cached_property
    def action_space(self) -> spaces.Box:
        """Desired velocities of the pins in units of `max_speed`."""
        size = len(self.action_axes) * len(self.model.pins)
        return spaces.Box(-1.0, 1.0, (size,), np.float32)

    @cached_property
    def observation_space(self) -> spaces.Box:
        """What `observe` returns for one world."""
        start = self.lowest_start
        size = self.observe(start.x, start.v, start.variables).shape[1]
        return spaces.Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (size,), np.float32)

    @cached_property
    def lowest_start(self) -> Start:
        """Where one world begins if every quantity is drawn at its least: tells kinds and sizes."""
        return self.start({name: spec.low[None] for name, spec in self.draws.items()})

    @property
    def view(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box that a picture shows, (dim,) each [m]."""
        raise NotImplementedError

    def build(self) -> Model:
        """Build the model of one world."""
        raise NotImplementedError

    def declare_draws(self) -> dict[str, Draw]:
        """Declare what is drawn at a reset."""
        raise NotImplementedError

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        """Return where worlds begin, given the drawn quantities, each (n, k) in float64."""
        raise NotImplementedError

    def workspace(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of the box in which the pins stay, (dim,) each [m]."""
        raise NotImplementedError

    def observe(self, x: np.ndarray, v: np.ndarray, variables: Variables) -> np.ndarray:
        """Return observations (n, size) in the state's dtype, a fresh array, before clipping."""
        raise NotImplementedError

    def judge(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray, variables: Variables
    ) -> Judgement:
        """Judge worlds by their state and the action (n, size) that led to it."""
        raise NotImplementedError

    def scripted(self, observation: Any) -> np.ndarray:
        """Return the actions (n, size) of a hand-written policy for observations of n worlds."""
        raise NotImplementedError

    def goal(self, variables: Variables, world: int) -> np.ndarray | None:
        """Return where particles should be, (N, dim) [m], NaN where anything goes, or None."""
        return None

    @property
    def goal_radius(self) -> float:
        """Tolerance around a goal [m], for the picture."""
        return 0.0

    @property
    def reward_scale(self) -> float:
        """Distance from a goal at which the reward has fallen to 1/e, where there is a goal [m]."""
        raise NotImplementedError

    @property
    def rails(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Ends of the rails along which pins move, (dim,) each [m], for the picture."""
        return ()

    def span(self) -> float:
        """Return how far apart two pins may be [m]."""
        return np.inf

    def pin_targets(
        self, x: np.ndarray, v: np.ndarray, action: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Turn actions (n, size) in [-1, 1] into pin targets at the end of the control step.

        Returns:
            Targets (n, P, dim) [m], and by how much the pins' velocities fall short of the desired
            ones, (n,) in units of `max_speed`.
        """
        pins, axes, workspace, limits = self._driving
        targets = np.empty((len(x), len(pins), self.model.dim), dtype=x.dtype)
        short = np.empty(len(x))
        drive_pins(x, v, action, pins, axes, workspace, limits, targets, short)
        return targets, short

    @cached_property
    def _driving(self) -> tuple[np.ndarray, ...]:
        """Constants of `drive_pins`, in the dtype of the worlds."""
        limits = [1.0 / self.control_rate, self.max_speed, self.max_acceleration, self.span()]
        return (
            self.model.pins.copy(),
            np.array(self.action_axes),
            np.array(self.workspace(), dtype=np.float32),
            np.array(limits, dtype=np.float32),
        )


def _check_field(spec: Any, value: Any) -> None:
    """Refuse a configuration value of another kind or out of the range declared for it."""
    if "allowed" in spec.metadata:
        if value not in spec.metadata["allowed"]:
            words = ", ".join(map(repr, spec.metadata["allowed"]))
            raise ValueError(f"{spec.name} is {value!r}; allowed: {words}")
        return
    whole = isinstance(spec.default, int)
    kinds: Any = int | np.integer if whole else int | float | np.integer | np.floating
    if isinstance(value, bool) or not isinstance(value, kinds):
        raise TypeError(
            f"{spec.name} is {value!r}; expected {'a whole number' if whole else 'a number'}"
        )
    low, high, unit = spec.metadata["low"], spec.metadata["high"], spec.metadata["unit"]
    if not low <= value <= high:
        raise ValueError(f"{spec.name} is {value!r}; allowed: {low} to {high} {unit}".rstrip())
