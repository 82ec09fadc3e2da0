"""n worlds of one task: what both Gymnasium faces share. No autoreset and no time limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics import Snapshot, World
from pbd_gym.tasks.base import Start, Task, Variables

_LEAST, _GREATEST = np.float32(-1.0), np.float32(1.0)
_LARGEST = float(np.finfo(np.float32).max)


class Outcome(NamedTuple):
    """What a step gave, each (W,).

    Attributes:
        reward: float64 in [0, 1].
        terminated: True where a world diverged.
        info: Scalars by name: success, performance, reward terms, what was clipped.
    """

    reward: np.ndarray
    terminated: np.ndarray
    info: dict[str, np.ndarray]


class Batch:
    """Worlds of one task: their state, what the task remembers of each episode, and their steps.

    Args:
        task: What is asked in each world.
        num_worlds: Number of worlds W.
        num_threads: As for `World`.
    """

    def __init__(self, task: Task, num_worlds: int, num_threads: int | None = None) -> None:
        self.task = task
        self.world = World(task.model, num_worlds, num_threads=num_threads)
        # something of each kind from the beginning, so that a state to set can be compared with it
        fresh = self._fresh(task.lowest_start)
        self.variables = {
            name: np.repeat(value, num_worlds, axis=0) for name, value in fresh.items()
        }
        space = task.observation_space
        self._least, self._greatest = space.low[0], space.high[0]
        self._draws = sum(len(spec.low) for spec in task.draws.values())

    def reset(
        self,
        worlds: np.ndarray,
        generators: list[np.random.Generator],
        fixed: dict[str, np.ndarray],
    ) -> None:
        """Begin new episodes.

        Args:
            worlds: (n,) indices of the worlds.
            generators: Of all W worlds; each begun world draws from its own.
            fixed: Quantities to fix instead, as `check_options` returns them.
        """
        uniforms = np.array([generators[world].random(self._draws) for world in worlds])
        quantities, first = {}, 0
        for name, spec in self.task.draws.items():
            last = first + len(spec.low)
            share = uniforms[:, first:last]
            drawn = spec.low + (spec.high - spec.low) * share
            quantities[name] = fixed[name][worlds] if name in fixed else drawn
            first = last
        start = self.task.start(quantities)
        self.world.x[worlds] = start.x
        self.world.v[worlds] = start.v
        for name, value in self._fresh(start).items():
            self.variables[name][worlds] = value

    def _fresh(self, start: Start) -> Variables:
        """Return what the task and the batch remember of new episodes, (n, ...) each."""
        action = np.zeros((len(start.x), *self.task.action_space.shape), dtype=np.float32)
        judgement = self.task.judge(start.x, start.v, action, start.variables)
        return {
            **start.variables,
            "start_performance": judgement.performance,
            "streak": np.zeros(len(start.x), dtype=np.int64),
        }

    def check_options(self, options: dict[str, Any]) -> dict[str, np.ndarray]:
        """Return reset options as arrays (W, k), given as (k,) for all worlds or as (W, k).

        Raises:
            ValueError: For an unknown option or one out of range.
        """
        fixed = {}
        for name, value in options.items():
            if name not in self.task.draws:
                known = ", ".join(self.task.draws)
                raise ValueError(f"unknown reset option {name!r}; allowed: {known}")
            spec = self.task.draws[name]
            values = self._option(name, value, len(spec.low))
            if not ((spec.least <= values) & (values <= spec.greatest)).all():
                raise ValueError(
                    f"reset option {name!r} is {value!r}; allowed: {spec.least} to {spec.greatest}"
                )
            fixed[name] = values
        return fixed

    def _option(self, name: str, value: Any, count: int) -> np.ndarray:
        """Return an option of `count` numbers as (W, count)."""
        worlds = self.world.num_worlds
        try:
            values = np.asarray(value)
        except ValueError:  # rows of different lengths
            values = np.empty(0)
        shapes = [(count,), (worlds, count), *([()] if count == 1 else [])]
        if values.dtype.kind not in "fiu" or values.shape not in shapes:
            raise ValueError(
                f"reset option {name!r} is {value!r}; expected {count} numbers, for all worlds or "
                f"for each of {worlds}"
            )
        return np.broadcast_to(values.astype(np.float64), (worlds, count))

    def check_actions(self, actions: Any) -> np.ndarray:
        """Return actions as a float32 array (W, size).

        Raises:
            TypeError: If they are not numbers.
            ValueError: If their shape is wrong or one is not finite.
        """
        try:
            array = np.asarray(actions)
        except ValueError as error:
            raise ValueError(f"the actions do not form an array: {error}") from error
        if array.dtype.kind not in "fiu":
            raise TypeError(f"actions have dtype {array.dtype}; expected real numbers")
        expected = (self.world.num_worlds, *self.task.action_space.shape)
        if array.shape != expected:
            raise ValueError(f"actions have shape {array.shape}; expected {expected}")
        if not np.isfinite(array).all():
            world, index = np.argwhere(~np.isfinite(array))[0]
            raise ValueError(f"action {index} of world {world} is {array[world, index]}")
        if array.dtype == np.float64:  # numbers that only float64 can hold would become infinite
            array = np.minimum(np.maximum(array, -_LARGEST), _LARGEST)
        return array.astype(np.float32)

    def step(self, actions: np.ndarray) -> Outcome:
        """Advance every world by one control step; actions as `check_actions` returns them."""
        task, world = self.task, self.world
        clipped = np.minimum(np.maximum(actions, _LEAST), _GREATEST)
        targets, short = task.pin_targets(world.x, world.v, clipped)
        world.step(1.0 / task.control_rate, task.substeps, targets)
        diverged = self._put_back_diverged()
        judgement = task.judge(world.x, world.v, clipped, self.variables)
        streak = self.variables["streak"]
        streak += 1
        streak *= judgement.reached & ~diverged
        start = self.variables["start_performance"]
        # a world that begins at its best stays defined: nothing to gain, 1 while it is held
        possible = np.maximum(task.best_performance - start, 1e-6)
        info = {
            "is_success": streak >= task.hold_steps,
            "normalized_performance": 1.0
            - (task.best_performance - judgement.performance) / possible,
            **judgement.terms,
            "action_clipped": np.abs(actions - clipped).max(axis=1),
            "pin_limited": short,
            "diverged": diverged,
        }
        return Outcome(np.where(diverged, 0.0, judgement.reward), diverged, info)

    def _put_back_diverged(self) -> np.ndarray:
        """Return which worlds left all bounds; they are put back to where the model was built."""
        x, bound = self.world.x, self.task.sanity_bound
        # written so that NaN counts as out of bounds
        if x.max() < bound and x.min() > -bound:
            return np.zeros(len(x), dtype=bool)
        diverged = np.asarray(~(np.abs(x) < bound).all(axis=(1, 2)))
        x[diverged] = self.task.model.positions
        self.world.v[diverged] = 0.0
        return diverged

    def observe(self) -> np.ndarray:
        """Return the observations, a fresh float32 array (W, size) within the space's bounds."""
        observation = self.task.observe(self.world.x, self.world.v, self.variables)
        np.maximum(observation, self._least, out=observation)
        return np.minimum(observation, self._greatest, out=observation)

    def get_state(self) -> tuple[Snapshot, Variables]:
        """Return copies of all that a continuation depends on."""
        return self.world.snapshot(), {name: value.copy() for name, value in self.variables.items()}

    def set_state(self, state: tuple[Snapshot, Variables]) -> None:
        """Continue from a state of `get_state`.

        Raises:
            ValueError: If it is of another task, model or number of worlds. Nothing changes then.
        """
        snapshot, variables = state
        own, other = _kinds(self.variables), _kinds(variables)
        if own != other:
            raise ValueError(f"the state remembers {other}; expected {own}")
        self.world.restore(snapshot)
        self.variables = {name: value.copy() for name, value in variables.items()}


def _kinds(variables: Variables) -> dict[str, str]:
    """Return type and shape of each variable by name."""
    return {name: f"{value.dtype} {value.shape}" for name, value in sorted(variables.items())}
