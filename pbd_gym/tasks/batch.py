"""n worlds of one task: what both Gymnasium faces share. No autoreset and no time limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics import Snapshot, World
from pbd_gym.tasks.base import Task, Variables


_LEAST, _GREATEST = np.float32(-1.0), np.float32(1.0)


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
        self.variables: Variables = {}
        self._draws = sum(len(spec.low) for spec in task.draws.values())

    def reset(
        self, worlds: np.ndarray, generators: list[np.random.Generator], options: dict[str, Any]
    ) -> None:
        """Begin new episodes.

        Args:
            worlds: (n,) indices of the worlds.
            generators: Of all W worlds; each begun world draws from its own.
            options: Quantities to fix instead: (k,) for all worlds or (W, k), by name.

        Raises:
            ValueError: For an unknown option or one out of range. Nothing changes then.
        """
        fixed = self._check_options(options)
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
        self._remember(worlds, start.variables)

    def _remember(self, worlds: np.ndarray, variables: Variables) -> None:
        """Store what the task and the batch keep of the new episodes."""
        x, v = self.world.x[worlds], self.world.v[worlds]
        action = np.zeros((len(worlds), *self.task.action_space.shape), dtype=np.float32)
        fresh = dict(variables)
        fresh["start_performance"] = self.task.judge(x, v, action, variables).performance
        fresh["streak"] = np.zeros(len(worlds), dtype=np.int64)
        for name, values in fresh.items():
            if name not in self.variables:
                shape = (self.world.num_worlds, *values.shape[1:])
                self.variables[name] = np.zeros(shape, dtype=values.dtype)
            self.variables[name][worlds] = values

    def _check_options(self, options: dict[str, Any]) -> dict[str, np.ndarray]:
        """Return the options as arrays (W, k)."""
        fixed = {}
        for name, value in options.items():
            if name not in self.task.draws:
                known = ", ".join(self.task.draws)
                raise ValueError(f"unknown reset option {name!r}; allowed: {known}")
            spec = self.task.draws[name]
            try:
                values = np.asarray(value, dtype=np.float64)
                values = np.broadcast_to(values, (self.world.num_worlds, len(spec.low)))
            except (TypeError, ValueError) as error:
                raise ValueError(
                    f"reset option {name!r} is {value!r}; expected {len(spec.low)} numbers"
                ) from error
            if not ((spec.least <= values) & (values <= spec.greatest)).all():
                raise ValueError(
                    f"reset option {name!r} is {value!r}; allowed: {spec.least} to {spec.greatest}"
                )
            fixed[name] = values
        return fixed

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
        array = array.astype(np.float32)
        if not np.isfinite(array).all():
            world, index = np.argwhere(~np.isfinite(array))[0]
            raise ValueError(f"action {index} of world {world} is {array[world, index]}")
        return array

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
            "normalized_performance": 1.0 - (task.best_performance - judgement.performance) / possible,
            **judgement.terms,
            "action_clipped": np.abs(actions - clipped).max(axis=1),
            "pin_limited": short,
            "diverged": diverged,
        }
        return Outcome(np.where(diverged, 0.0, judgement.reward), diverged, info)

    def _put_back_diverged(self) -> np.ndarray:
        """Return which worlds left all bounds; they are put back to where the model was built."""
        x = self.world.x
        # written so that NaN counts as out of bounds
        within = (np.abs(x) < self.task.sanity_bound).all(axis=(1, 2))
        if within.all():
            return ~within
        x[~within] = self.task.model.positions
        self.world.v[~within] = 0.0
        return ~within

    def observe(self) -> np.ndarray:
        """Return the observations, a fresh float32 array (W, size) within the space's bounds."""
        space = self.task.observation_space
        observation = self.task.observe(self.world.x, self.world.v, self.variables)
        return np.minimum(np.maximum(observation, space.low[0]), space.high[0])

    def get_state(self) -> tuple[Snapshot, Variables]:
        """Return copies of all that a continuation depends on."""
        return self.world.snapshot(), {name: value.copy() for name, value in self.variables.items()}

    def set_state(self, state: tuple[Snapshot, Variables]) -> None:
        """Continue from a state of `get_state`.

        Raises:
            ValueError: If it is of another model or another number of worlds.
        """
        snapshot, variables = state
        self.world.restore(snapshot)
        self.variables = {name: value.copy() for name, value in variables.items()}
