"""Linear-quadratic regulators: at the top, and along a motion that leads there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendulum_model import PendulumModel

# Costs of deviations, per control step: pivot's position [1/m2] and velocity [s2/m2], angles
# [1/rad2], rates [s2/rad2]; and of the push [s2/m2].
POSITION, VELOCITY, ANGLE, RATE, PUSH = 0.2, 0.02, 2.0, 0.02, 2.0


class Gains(NamedTuple):
    """A regulator of T steps, or without the first axis a stationary one.

    Attributes:
        feedback: Push per deviation from the motion (T, n).
        costs: Matrices (T + 1, n, n) of the cost to go, deviation' matrix deviation.
    """

    feedback: np.ndarray
    costs: np.ndarray


def weights(model: PendulumModel) -> np.ndarray:
    """Return the costs of deviations in each number of a state (n,)."""
    links = model.task.links
    return np.array([POSITION, VELOCITY] + [ANGLE] * links + [RATE] * links)


def riccati_step(
    joint: np.ndarray, cost: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return feedback (n,) and cost to go (n, n) one step before a cost to go.

    Args:
        joint: Derivatives of the step in state and push (n, n + 1).
        cost: The cost to go after the step (n, n).
        weight: Costs of deviations (n,).
    """
    drift, drive = joint[:, :-1], joint[:, -1]
    pull = drive @ cost
    feedback = -(pull @ drift) / (PUSH + pull @ drive)
    closed = drift + np.outer(drive, feedback)
    before = np.diag(weight) + drift.T @ cost @ closed
    return feedback, 0.5 * (before + before.T)


def regulate_top(model: PendulumModel) -> Gains:
    """Return the stationary regulator of standing upright, by iterating Riccati's equation."""
    joint = model.linearise(model.top[None], np.zeros(1))[0]
    weight = weights(model)
    cost = np.diag(weight)
    for _ in range(20_000):
        feedback, before = riccati_step(joint, cost, weight)
        if np.allclose(before, cost, rtol=1e-9):
            return Gains(feedback, before)
        cost = before
    raise ValueError("no regulator holds this pendulum upright: Riccati's equation diverges")


def regulate_motion(
    model: PendulumModel, states: np.ndarray, pushes: np.ndarray, last: np.ndarray
) -> Gains:
    """Return the time-varying regulator of a motion.

    Args:
        model: The pendulum.
        states: Of the motion (T + 1, n).
        pushes: (T,).
        last: Matrix (n, n) of the cost to go at its end.
    """
    joint, weight = model.linearise(states[:-1], pushes), weights(model)
    feedback = np.empty((len(pushes), model.size))
    costs = np.empty((len(states), model.size, model.size))
    costs[-1] = last
    for time in reversed(range(len(pushes))):
        feedback[time], costs[time] = riccati_step(joint[time], costs[time + 1], weight)
    return Gains(feedback, costs)


class Command(NamedTuple):
    """What a regulator does in W states.

    Attributes:
        push: (W,) [m/s].
        phase: Where along the motion each state is taken to be [control steps] (W,).
        cost: The cost to go of its deviation from there (W,).
    """

    push: np.ndarray
    phase: np.ndarray
    cost: np.ndarray


class Regulator:
    """Follows a motion to the top and stays there, without a clock: a function of the state alone.

    The phase of a state is that of the nearest point of the motion, measured by the cost to go of
    what lies between them.

    Args:
        model: The pendulum.
        states: Of a motion that ends near the top, (T + 1, n).
        pushes: (T,).
        hold: Control steps at the top that are added to the motion.

    Attributes:
        arrival: Phase at which the motion has come up, T.
        states: Of the motion with what was added, and the top itself (T + hold + 2, n).
        pushes: (T + hold + 2,).
    """

    def __init__(
        self, model: PendulumModel, states: np.ndarray, pushes: np.ndarray, hold: int = 100
    ) -> None:
        self._model, self.arrival = model, len(pushes)
        top = regulate_top(model)
        states, pushes = self._held(states, pushes, top, hold)
        gains = regulate_motion(model, states, pushes, top.costs)
        end = top.feedback @ model.difference(states[-1], model.top)
        self.states = np.concatenate([states, model.top[None]])
        self.pushes = np.concatenate([pushes, [end, 0.0]])
        self._feedback = np.concatenate([gains.feedback, np.tile(top.feedback, (2, 1))])
        self._costs = np.concatenate([gains.costs, top.costs[None]])
        # |root' deviation|^2 is the cost to go
        self._roots = np.linalg.cholesky(self._costs).astype(np.float32)
        self._ways = model.difference(self.states[1:], self.states[:-1])

    def _held(
        self, states: np.ndarray, pushes: np.ndarray, top: Gains, hold: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the motion with some steps of the regulator at the top behind it."""
        state, held, added = states[-1:], [states], [pushes]
        for _ in range(hold):
            push = self._model.difference(state, self._model.top) @ top.feedback
            push = self._model.possible(state, push)
            state = self._model.step(state, push)
            held.append(state)
            added.append(push)
        return np.concatenate(held), np.concatenate(added)

    def __call__(self, states: np.ndarray) -> Command:
        """Return what to do in states (W, n)."""
        points = np.concatenate([self._nearest(part) for part in _parts(states, 512)])
        last = len(self._ways) - 1
        before, after = (
            self._project(states, points, np.clip(points - side, 0, last)) for side in (1, 0)
        )
        return Command(*np.where(before.cost < after.cost, before, after))

    def _nearest(self, states: np.ndarray) -> np.ndarray:
        """Return the index of the nearest point of the motion to each state (W,)."""
        apart = self._model.difference(states[None], self.states[:, None]).astype(np.float32)
        return np.square(apart @ self._roots).sum(axis=2).argmin(axis=0)

    def _project(self, states: np.ndarray, points: np.ndarray, first: np.ndarray) -> Command:
        """Return what to do at the foot of the states on the ways from `first` to the next points.

        Args:
            states: (W, n).
            points: Whose cost to go measures the distance (W,).
            first: Points where the ways begin (W,).
        """
        costs, ways = self._costs[points], self._ways[first]
        apart = self._model.difference(states, self.states[first])
        pull = np.einsum("wij,wj->wi", costs, ways)
        share = (apart * pull).sum(axis=1) / ((ways * pull).sum(axis=1) + 1e-12)
        share = np.clip(share, 0.0, 1.0)
        apart = apart - share[:, None] * ways
        begun = self.pushes[first] + (self._feedback[first] * apart).sum(axis=1)
        ended = self.pushes[first + 1] + (self._feedback[first + 1] * apart).sum(axis=1)
        push = (1.0 - share) * begun + share * ended
        cost = np.einsum("wi,wij,wj->w", apart, costs, apart)
        return Command(push, first + share, cost)


def _parts(states: np.ndarray, size: int) -> list[np.ndarray]:
    """Return the states in parts small enough for the memory."""
    return [states[first : first + size] for first in range(0, len(states), size)]
