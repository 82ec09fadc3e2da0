"""The exact control step of a pendulum task in minimal coordinates, and its linearisation."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np

from pbd_gym.tasks import Batch, Start
from pbd_gym.tasks.pendulum import Pendulum

# Half the distance of central differences, in units of the states. The worlds compute in float32,
# of which smaller ones show the rounding, larger ones the curvature.
_HALF_STEP = 0.02


class PendulumModel:
    """Steps and derivatives of a pendulum, each taken from worlds that are set to the states.

    A state holds n = 2 + 2 links numbers: the pivot's position [m] and velocity [m/s], each link's
    angle from hanging, counter-clockwise [rad], and its rate [rad/s]. The input is the push: the
    wanted change of the pivot's velocity in one control step [m/s].

    Attributes:
        task: The pendulum.
        size: Numbers of a state, n.
        angles: Where the angles stand in a state.
        rates: Where their rates stand.
        top: The state of standing upright in the middle of the rail, (n,).
        most: The largest push [m/s].
        steps: Control steps computed so far, over all worlds.
    """

    def __init__(self, task: Pendulum) -> None:
        self.task = task
        self.size = 2 + 2 * task.links
        self.angles = slice(2, 2 + task.links)
        self.rates = slice(2 + task.links, self.size)
        self.top = np.zeros(self.size)
        self.top[self.angles] = np.pi
        self.most = task.max_acceleration / task.control_rate
        self.steps = 0
        self._batch = lru_cache(maxsize=8)(lambda worlds: Batch(task, worlds))

    def draw(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Return starting states (count, n) as the task draws them."""
        states = np.zeros((count, self.size))
        for name, where in (("pivot", slice(0, 1)), ("angles", self.angles), ("rates", self.rates)):
            spec = self.task.draws[name]
            states[:, where] = random.uniform(spec.low, spec.high, (count, len(spec.low)))
        return states

    def action(self, states: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Return the actions (W, 1) that push (W,) in states (W, n)."""
        wanted = (states[:, 1] + pushes) / self.task.max_speed
        return np.clip(wanted, -1.0, 1.0).astype(np.float32)[:, None]

    def push(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Return the pushes (W,) that actions (W,) mean in states (W, n)."""
        return actions * self.task.max_speed - states[:, 1]

    def possible(self, states: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Return the nearest pushes (W,) that the pivot's drive can give in states (W, n)."""
        speed = self.task.max_speed
        pushes = np.clip(pushes, -self.most, self.most)
        return np.clip(states[:, 1] + pushes, -speed, speed) - states[:, 1]

    def observe(self, states: np.ndarray) -> np.ndarray:
        """Return the observations (W, 2 + 4 links) of states (W, n)."""
        start = self._place(states)
        return self.task.observe(start.x, start.v, {})

    def read(self, observations: np.ndarray) -> np.ndarray:
        """Return the states (W, n) of observations, angles within -pi to pi."""
        values = observations.astype(np.float64)
        count = 2 * self.task.links
        along = values[:, 2 : 2 + count].reshape(len(values), -1, 2)
        motion = 5.0 * values[:, 2 + count :].reshape(along.shape)
        states = np.empty((len(values), self.size))
        states[:, 0] = values[:, 0] * self.task.rail
        states[:, 1] = values[:, 1] * self.task.max_speed
        states[:, self.angles] = np.arctan2(along[:, :, 0], -along[:, :, 1])
        states[:, self.rates] = along[:, :, 0] * motion[:, :, 1] - along[:, :, 1] * motion[:, :, 0]
        return states

    def difference(self, states: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return states - others (..., n), angles the short way round."""
        apart = states - others
        turns = apart[..., self.angles] / (2.0 * np.pi)
        apart[..., self.angles] -= 2.0 * np.pi * np.round(turns)
        return apart

    def step(self, states: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Return the states (W, n) one control step later; their angles count full turns."""
        batch, start = self._batch(len(states)), self._place(states)
        snapshot, variables = batch.get_state()
        batch.set_state((dataclasses.replace(snapshot, x=start.x, v=start.v), variables))
        batch.step(self.action(states, pushes))
        self.steps += len(states)
        return states + self.difference(self.read(batch.observe()), states)

    def linearise(self, states: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Return the derivatives of the step (W, n, n + 1) in states (W, n) and pushes (W,)."""
        size = self.size
        shifts = _HALF_STEP * np.concatenate([np.eye(size + 1), -np.eye(size + 1)])
        points = np.concatenate([states, pushes[:, None]], axis=1)[:, None] + shifts
        points = points.reshape(-1, size + 1)
        after = self.step(points[:, :-1], points[:, -1]).reshape(len(states), 2, size + 1, size)
        return self.difference(after[:, 0], after[:, 1]).swapaxes(1, 2) / (2.0 * _HALF_STEP)

    def _place(self, states: np.ndarray) -> Start:
        """Return positions and velocities of worlds in these states."""
        quantities = {
            "pivot": states[:, :1],
            "angles": states[:, self.angles],
            "rates": states[:, self.rates],
        }
        copies = {name: np.array(value, order="C") for name, value in quantities.items()}
        start = self.task.start(copies)
        start.v[:, :, 0] += states[:, 1:2].astype(start.v.dtype)
        return start
