"""n worlds of one task: what both Gymnasium faces share. No autoreset and no time limit."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics import Snapshot, World
from pbd_gym.tasks.base import OBSERVATION_LIMIT, Judgement, Start, Task, Variables
from pbd_gym.tasks.bookkeeping import clip_actions, clip_observations, find_diverged, keep_score
from pbd_gym.tasks.goals import GoalTask


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
        self._action_shape = (num_worlds, *task.action_space.shape)
        specs, none = task.draws.values(), np.zeros(0)
        self._low = np.concatenate([none, *[spec.low for spec in specs]])
        self._range = np.concatenate([none, *[spec.high - spec.low for spec in specs]])

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
        shares = [generators[world].random(len(self._low)) for world in worlds.tolist()]
        drawn = self._low + self._range * np.array(shares)
        quantities, first = {}, 0
        for name, spec in self.task.draws.items():
            last = first + len(spec.low)
            quantities[name] = fixed[name][worlds] if name in fixed else drawn[:, first:last]
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
            "start_performance": _float64(judgement.performance),
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

    def step(self, actions: Any) -> Outcome:
        """Advance every world by one control step.

        Args:
            actions: (W, size) real numbers; what is beyond [-1, 1] is clipped.

        Raises:
            TypeError: If they are not numbers.
            ValueError: If their shape is wrong or one is not finite. Nothing has moved then.
        """
        task, world = self.task, self.world
        clipped, excess = self._clip(actions)
        targets, short = task.pin_targets(world.x, world.v, clipped)
        world.step(1.0 / task.control_rate, task.substeps, targets)
        diverged = self._put_back_diverged()
        judgement = task.judge(world.x, world.v, clipped, self.variables)
        reward, normalized, success = self._score(judgement, diverged)
        info = {
            "is_success": success,
            "normalized_performance": normalized,
            **judgement.terms,
            "action_clipped": excess,
            "pin_limited": short,
            "diverged": diverged,
        }
        return Outcome(reward, diverged, info)

    def _clip(self, actions: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return actions within [-1, 1] in float32, and by how much each world's were clipped."""
        try:
            array = np.asarray(actions)
        except ValueError as error:
            raise ValueError(f"the actions do not form an array: {error}") from error
        if array.dtype.kind not in "fiu":
            raise TypeError(f"actions have dtype {array.dtype}; expected real numbers")
        if array.shape != self._action_shape:
            raise ValueError(f"actions have shape {array.shape}; expected {self._action_shape}")
        if array.dtype != np.float32:
            array = _float64(array)
        clipped, excess = np.empty(self._action_shape, dtype=np.float32), np.empty(len(array))
        if not clip_actions(np.ascontiguousarray(array), clipped, excess):
            world, index = np.argwhere(~np.isfinite(array))[0]
            raise ValueError(f"action {index} of world {world} is {array[world, index]}")
        return clipped, excess

    def _put_back_diverged(self) -> np.ndarray:
        """Return which worlds left all bounds; they are put back to where the model was built."""
        world, diverged = self.world, np.empty(self.world.num_worlds, dtype=bool)
        if find_diverged(world.x, self.task.sanity_bound, diverged):
            world.x[diverged] = self.task.model.positions
            world.v[diverged] = 0.0
        return diverged

    def _score(
        self, judgement: Judgement, diverged: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rewards, normalized performances and successes, (W,) each; count the streaks."""
        worlds = len(diverged)
        earned, normalized, success = np.empty(worlds), np.empty(worlds), np.empty(worlds, bool)
        keep_score(
            _float64(judgement.reward),
            judgement.reached,
            _float64(judgement.performance),
            diverged,
            self.variables["start_performance"],
            self.variables["streak"],
            float(self.task.best_performance),
            self.task.hold_steps,
            earned,
            normalized,
            success,
        )
        return earned, normalized, success

    def observe(self, worlds: np.ndarray | None = None) -> Any:
        """Return observations, a fresh float32 array (n, size) within the space's bounds.

        Of a goal-conditioned task it is a dict of such arrays, the goals apart.

        Args:
            worlds: (n,) indices of the worlds to observe; all of them if not given.
        """
        x, v, variables = self.world.x, self.world.v, self.variables
        if worlds is not None:
            x, v = x[worlds], v[worlds]
            variables = {name: value[worlds] for name, value in variables.items()}
        observations = self.task.observe(x, v, variables)
        clip_observations(observations, OBSERVATION_LIMIT)
        if not isinstance(self.task, GoalTask):
            return observations
        achieved, desired = self.task.achieved(x), variables["desired_goal"].copy()
        clip_observations(achieved, OBSERVATION_LIMIT)
        return {"observation": observations, "achieved_goal": achieved, "desired_goal": desired}

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


def _float64(values: np.ndarray) -> np.ndarray:
    """Return values as kernels are compiled for them: in float64, side by side in memory."""
    return np.asarray(values, dtype=np.float64, order="C")


def _kinds(variables: Variables) -> dict[str, str]:
    """Return type and shape of each variable by name."""
    return {name: f"{value.dtype} {value.shape}" for name, value in sorted(variables.items())}
