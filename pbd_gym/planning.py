"""Planning on exact snapshots: CEM and MPPI over the native batch.

A planner copies the true state of an environment into many worlds, plays a candidate sequence of
actions in each, and refines the distribution that it draws them from by what they earned. As a
snapshot branches an episode to the last bit, what it predicts is what the environment will pay.

    import gymnasium
    from pbd_gym.planning import Planner, PlannerSettings

    env = gymnasium.make("pbd_gym:PBDRope-v0")
    env.reset(seed=0)
    planner = Planner(env.unwrapped.task, PlannerSettings(horizon=40))
    plan = planner.plan(env.unwrapped.get_state())
    for action in plan.actions[0, : planner.settings.replan]:
        env.step(action)
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.envs import EpisodeState
from pbd_gym.tasks import Batch, Task

METHODS = ("cem", "mppi")


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """How a planner searches.

    Attributes:
        method: "cem", the cross-entropy method (R. Y. Rubinstein 1999): the best candidates give
            the next mean and spread; or "mppi", model-predictive path integral control (G.
            Williams et al. 2017): all of them give the next mean, weighted by their returns.
        horizon: Length of a sequence [control steps].
        knots: Numbers that each component of the noise is interpolated from; few make it smooth.
        candidates: Sequences that are tried at once for each world.
        iterations: Refinements of the distribution in each plan.
        elites: Share of the candidates that "cem" goes on from: the best ones.
        guided: Share of the candidates that hand over to the task's scripted policy at a drawn
            step, one of them at the first: feedback holds what no open sequence can, such as an
            inverted pendulum, and no plan promises less than the scripted policy earns.
        temperature: Of the weights of "mppi", in standard deviations of the returns.
        spread: Standard deviation of the noise in each plan's first iteration.
        tail: Control steps for which the last reward is counted once more: what comes beyond the
            horizon, if the end is held.
        replan: Control steps of each plan that are played before the next [control steps].
    """

    method: str = "cem"
    horizon: int = 30
    knots: int = 8
    candidates: int = 256
    iterations: int = 3
    elites: float = 0.1
    guided: float = 0.0
    temperature: float = 0.1
    spread: float = 0.6
    tail: float = 0.0
    replan: int = 5

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method is {self.method!r}; allowed: {', '.join(METHODS)}")
        ranges = {
            "horizon": (1, np.inf),
            "knots": (1, self.horizon),
            "candidates": (2, np.inf),
            "iterations": (1, np.inf),
            "elites": (0.0, 1.0),
            "guided": (0.0, 0.9),
            "temperature": (1e-6, 1e6),
            "spread": (1e-6, 1e6),
            "tail": (0.0, 1e6),
            "replan": (1, self.horizon),
        }
        for name, (least, most) in ranges.items():
            value = getattr(self, name)
            if isinstance(least, int) and not isinstance(value, int):
                raise ValueError(f"{name} is {value!r}; expected a whole number")
            if not least <= value <= most:
                raise ValueError(f"{name} is {value!r}; allowed: {least} to {most}")


# Found by trying on a few episodes each; every other id takes the defaults.
_PENDULUM = {"horizon": 70, "knots": 14, "candidates": 512, "guided": 0.25}
_PENDULUM |= {"spread": 0.8, "tail": 20.0, "replan": 10}
# it falls within a few steps: look less far ahead, more often
_TRIPLE = _PENDULUM | {"horizon": 50, "knots": 10, "candidates": 1024, "replan": 5}
_ROPE = {"knots": 10, "iterations": 4, "guided": 0.125, "spread": 0.4, "replan": 10}
_CLOTH = {"horizon": 90, "knots": 9, "candidates": 48, "iterations": 2, "guided": 0.5}
_CLOTH |= {"spread": 0.3, "replan": 15}
SETTINGS: dict[str, dict[str, Any]] = {
    "PBDPendulum-v0": _PENDULUM,
    "PBDDoublePendulum-v0": _PENDULUM,
    "PBDTriplePendulum-v0": _TRIPLE,
    "PBDRope-v0": _ROPE,
    "PBDCloth-v0": _CLOTH,
    "PBDRopeGoal-v0": _ROPE,
    "PBDClothGoal-v0": _CLOTH,
}


def planner_settings(env_id: str, **changes: Any) -> PlannerSettings:
    """Return the settings that serve an environment, with changes.

    Args:
        env_id: Environment id, with or without its module: "pbd_gym:PBDRope-v0".
        **changes: Attributes of `PlannerSettings` to set otherwise.
    """
    return PlannerSettings(**SETTINGS.get(env_id.split(":")[-1], {}) | changes)


class Plan(NamedTuple):
    """The best sequences found, for W worlds.

    Attributes:
        actions: (W, horizon, size) float32 in [-1, 1].
        rewards: What they will earn, (W, horizon).
    """

    actions: np.ndarray
    rewards: np.ndarray


class Planner:
    """Plans for W worlds of a task at once; the same seed and states give the same plans.

    Each plan begins from the rest of the last one, which it can only improve on: that is always
    among the candidates.

    Args:
        task: What is asked, `env.unwrapped.task`.
        settings: How to search.
        num_worlds: Number of worlds W to plan for.
        seed: Of the candidates.
        num_threads: As for `World`.
    """

    def __init__(
        self,
        task: Task,
        settings: PlannerSettings | None = None,
        *,
        num_worlds: int = 1,
        seed: int = 0,
        num_threads: int | None = None,
    ) -> None:
        self.settings = settings or PlannerSettings()
        self.num_worlds = num_worlds
        self._batch = Batch(task, num_worlds * self.settings.candidates, num_threads)
        self._size = task.action_space.shape[0]
        # noise is interpolated linearly between knots at even times
        time = np.linspace(0.0, self.settings.knots - 1.0, self.settings.horizon)
        self._knot = np.minimum(time.astype(np.int64), max(self.settings.knots - 2, 0))
        self._next = np.minimum(self._knot + 1, self.settings.knots - 1)
        self._share = (time - self._knot)[:, None]
        first = np.arange(num_worlds)[:, None] * self.settings.candidates
        count = self.settings.candidates
        last = np.arange(count - round(self.settings.guided * (count - 2)), count)
        self._guided = (first + last).ravel()  # worlds of the batch that hand over
        self._elites = max(1, round(self.settings.elites * count))
        self.reset(seed)

    def reset(self, seed: int = 0) -> None:
        """Forget the last plan and draw candidates from a seed anew."""
        self._random = np.random.default_rng(seed)
        self._mean = np.zeros((self.num_worlds, self.settings.horizon, self._size))
        self._queue: list[np.ndarray] = []

    def forget(self, worlds: np.ndarray) -> None:
        """Plan from nothing in some worlds, given by mask or index: their episodes are new."""
        self._mean[worlds] = 0.0
        self._queue = []

    def act(self, state: EpisodeState) -> np.ndarray:
        """Return the next actions (W, size), from a new plan after each `replan` of them.

        Raises:
            ValueError: If the state is of another task or number of worlds.
        """
        if not self._queue:
            self._queue = list(self.plan(state).actions[:, : self.settings.replan].swapaxes(0, 1))
        return self._queue.pop(0)

    def plan(self, state: EpisodeState) -> Plan:
        """Return the best sequences found from a state of `get_state`, for W worlds.

        Raises:
            ValueError: If the state is of another task or number of worlds.
        """
        start = self._repeated(state)
        shape = (self.num_worlds, self.settings.knots, self._size)
        mean, spread = self._mean, np.full(shape, self.settings.spread)
        best, found, value = mean, np.empty(0), np.full(self.num_worlds, -np.inf)
        for _ in range(self.settings.iterations):
            knots, candidates = self._draw(mean, spread, best)
            rewards = self._play(start, candidates)
            returns = rewards.sum(axis=2) + self.settings.tail * rewards[:, :, -1]
            best, found, value = _better((best, found, value), candidates, rewards, returns)
            mean, spread = self._refine(knots, candidates, returns, spread)
        rest = best[:, self.settings.replan :]
        held = np.repeat(best[:, -1:], self.settings.replan, axis=1)
        self._mean = np.concatenate([rest, held], axis=1)
        return Plan(best.astype(np.float32), found)

    def _repeated(self, state: EpisodeState) -> tuple[Any, dict[str, np.ndarray]]:
        """Return the state of the batch in which each world stands once per candidate."""
        if len(state.begun) != self.num_worlds or not state.begun.all():
            raise ValueError(
                f"the state holds {len(state.begun)} worlds, {state.begun.sum()} of them begun; "
                f"expected {self.num_worlds}"
            )
        count, worlds = self.settings.candidates, state.worlds
        arrays = {name: getattr(worlds, name) for name in ("x", "v", "grabbed")}
        many = {k: None if a is None else np.repeat(a, count, axis=0) for k, a in arrays.items()}
        variables = {k: np.repeat(value, count, axis=0) for k, value in state.variables.items()}
        return dataclasses.replace(worlds, **many), variables

    def _draw(
        self, mean: np.ndarray, spread: np.ndarray, best: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return noise at the knots (W, C, knots, size), and sequences (W, C, horizon, size).

        The first candidate is the mean, the second the best one so far.
        """
        count = self.settings.candidates
        knots = self._random.standard_normal((len(mean), count, *spread.shape[1:]))
        knots *= spread[:, None]
        knots[:, :2] = 0.0
        left, right = knots[:, :, self._knot], knots[:, :, self._next]
        candidates = mean[:, None] + left * (1.0 - self._share) + right * self._share
        candidates[:, 1] = best
        # what is played is float32, so that a plan can be played again to the last bit, and lies in
        # one piece, so that guided candidates can be overwritten in place
        return knots, np.clip(candidates, -1.0, 1.0).astype(np.float32, order="C")

    def _play(self, start: Any, candidates: np.ndarray) -> np.ndarray:
        """Return what the sequences earn, (W, C, horizon).

        The guided ones are overwritten by what the scripted policy does from a drawn step on.
        """
        batch, sequences = self._batch, candidates.reshape(-1, *candidates.shape[2:])
        batch.set_state(start)
        handed = self._random.integers(0, self.settings.horizon, len(self._guided))
        handed[:: max(len(handed) // self.num_worlds, 1)] = 0  # one in each world from the start
        rewards = np.empty(sequences.shape[:2])
        for step in range(self.settings.horizon):
            led = self._guided[handed <= step]
            if len(led):
                sequences[led, step] = batch.task.scripted(batch.observe(led))
            rewards[:, step] = batch.step(sequences[:, step]).reward
        return rewards.reshape(candidates.shape[:3])

    def _refine(
        self, knots: np.ndarray, candidates: np.ndarray, returns: np.ndarray, spread: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (W, horizon, size) and spread (W, knots, size) for the next iteration."""
        if self.settings.method == "mppi":
            apart = returns - returns.max(axis=1, keepdims=True)
            scale = self.settings.temperature * returns.std(axis=1, keepdims=True) + 1e-12
            weight = np.exp(apart / scale)
            weight /= weight.sum(axis=1, keepdims=True)
            return (candidates * weight[:, :, None, None]).sum(axis=1), spread
        order = np.argsort(-returns, axis=1, kind="stable")[:, : self._elites, None, None]
        elites = np.take_along_axis(candidates, order, axis=1)
        narrow = np.take_along_axis(knots, order, axis=1).std(axis=1)
        return elites.mean(axis=1, dtype=np.float64), np.maximum(narrow, 0.05 * spread)


def _better(
    known: tuple[np.ndarray, np.ndarray, np.ndarray],
    candidates: np.ndarray,
    rewards: np.ndarray,
    returns: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sequences (W, horizon, size), rewards (W, horizon), returns (W,): the best so far."""
    worlds = np.arange(len(returns))
    top = returns.argmax(axis=1)
    sequence, earned, value = candidates[worlds, top], rewards[worlds, top], returns[worlds, top]
    better = value > known[2]
    if better.all():
        return sequence, earned, value
    return (
        np.where(better[:, None, None], sequence, known[0]),
        np.where(better[:, None], earned, known[1]),
        np.where(better, value, known[2]),
    )
