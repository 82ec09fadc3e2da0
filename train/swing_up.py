"""Swing-ups by trajectory optimisation: iLQR on the exact step, many candidates at once.

Iterative linear-quadratic regulator (W. Li and E. Todorov 2004) with regularised steps and a line
search (Y. Tassa et al. 2012). The rates are bounded softly: a slow swing-up is one whose regulator
changes slowly as well, which is what makes it easy to follow and to learn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pendulum_model import PendulumModel
from regulator import PUSH, regulate_top

_SHARES = np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.01])  # of a full improvement that are tried
_GREATEST = 1e6  # gain, where a linearisation over a tumbling motion has no use


@dataclass(frozen=True, kw_only=True)
class SwingUpSettings:
    """How swing-ups are searched.

    Attributes:
        seconds: Length of a swing-up [s], 0.5 to 60.
        candidates: First guesses that are improved side by side.
        iterations: Improvements of each.
        amplitude: Standard deviation of the pushes' sines in a first guess [m/s].
        pivot: Soft limit of the pivot's position in shares of half the rail.
        speed: That of the pivot's velocity in shares of the largest.
        push: That of the push in shares of the largest.
        rate: That of the links' rates [rad/s].
        stiffness: Cost of exceeding pivot, speed or push [1/m2 or s2/m2].
        rate_stiffness: Cost of exceeding the rate [s2/rad2].
    """

    seconds: float = 2.5
    candidates: int = 16
    iterations: int = 120
    amplitude: float = 0.06
    pivot: float = 2.0 / 3.0
    speed: float = 0.8
    push: float = 2.0 / 3.0
    rate: float = 9.0
    stiffness: float = 500.0
    rate_stiffness: float = 0.02

    def __post_init__(self) -> None:
        if not 0.5 <= self.seconds <= 60.0:
            raise ValueError(f"seconds must be 0.5 to 60, got {self.seconds}")


class Motions(NamedTuple):
    """N motions of T steps.

    Attributes:
        states: (N, T + 1, n).
        pushes: (N, T) [m/s].
    """

    states: np.ndarray
    pushes: np.ndarray


class SwingUpSearch:
    """Finds swing-ups of a pendulum that hangs at rest; see `SwingUpSettings`.

    Attributes:
        motions: The candidates as they are by now.
        costs: Of each (N,).
    """

    def __init__(
        self, model: PendulumModel, settings: SwingUpSettings, random: np.random.Generator
    ) -> None:
        self._model, self._settings = model, settings
        self._last = regulate_top(model).costs
        size, task = model.size, model.task
        # soft limits of what is linear in state and push: pivot, its next velocity, push, rates
        self._limited = np.zeros((3 + task.links, size + 1))
        self._limited[[0, 1, 1, 2], [0, 1, size, size]] = 1.0
        self._limited[3:, model.rates] = np.eye(task.links)
        shares = settings.pivot * task.rail, settings.speed * task.max_speed
        self._limits = np.array(
            [*shares, settings.push * model.most] + [settings.rate] * task.links
        )
        stiffness = [settings.stiffness] * 3 + [settings.rate_stiffness] * task.links
        self._stiffness = np.array(stiffness)
        shape = (settings.candidates, size)
        self.motions = self._play(np.zeros(shape), self._guess(random))
        self.costs = self._cost(self.motions)
        self._damping = np.full(settings.candidates, 1e-2)

    def _guess(self, random: np.random.Generator) -> np.ndarray:
        """Return pushes (N, T): sums of four sines of 0.5 to 2 Hz."""
        settings = self._settings
        rate = self._model.task.control_rate
        time = np.arange(round(settings.seconds * rate)) / rate
        shape = (4, settings.candidates, 1)
        turns = random.uniform(0.5, 2.0, shape) * time + random.random(shape)
        sines = random.normal(0.0, settings.amplitude, shape) * np.sin(2.0 * np.pi * turns)
        return sines.sum(axis=0)

    def best(self, progress: Callable[[float], None]) -> tuple[np.ndarray, np.ndarray]:
        """Return states (T + 1, n) and pushes (T,) of the best swing-up.

        Args:
            progress: Called with the least cost after each iteration; may raise to end the search.

        Raises:
            ValueError: If none ends near enough to the top to be caught there.
        """
        for _ in range(self._settings.iterations):
            self._improve()
            progress(float(self.costs.min()))
        states, pushes = (part[self.costs.argmin()] for part in self.motions)
        apart = states[-1] - self._model.top
        if np.abs(apart[self._model.angles]).max() > 0.5:
            raise ValueError("no swing-up was found; try another --seed")
        return states, pushes

    def _improve(self) -> None:
        """Improve each candidate by one iteration, or damp its next one more."""
        count, tries = len(self.costs), len(_SHARES)
        gains = self._gains()
        many = [np.repeat(part, tries, axis=0) for part in (*self.motions, *gains)]
        states, pushes, change, feedback = many
        change = change * np.tile(_SHARES, count)[:, None]
        tried = self._play(states[:, 0], pushes, change, feedback, states)
        costs = self._cost(tried).reshape(count, tries)
        chosen = costs.argmin(axis=1)
        least = costs[np.arange(count), chosen]
        better = least < self.costs
        rows = (np.arange(count) * tries + chosen)[better]
        for mine, theirs in zip(self.motions, tried, strict=True):
            mine[better] = theirs[rows]
        self.costs = np.where(better, least, self.costs)
        eased = np.where(chosen <= 1, 0.4, 1.0) * self._damping
        damping = np.where(better, eased, 5.0 * self._damping)
        self._damping = np.clip(damping, 1e-6, 1e6)

    def _play(
        self,
        start: np.ndarray,
        pushes: np.ndarray,
        change: np.ndarray | None = None,
        feedback: np.ndarray | None = None,
        around: np.ndarray | None = None,
    ) -> Motions:
        """Return the motions of pushes (N, T) from states (N, n).

        With `change` (N, T), it and feedback (N, T, n) on the way from states `around` are added.
        """
        states = np.empty((len(start), pushes.shape[1] + 1, self._model.size))
        states[:, 0] = start
        done = np.empty(pushes.shape)
        for time in range(pushes.shape[1]):
            state, push = states[:, time], pushes[:, time]
            if change is not None and feedback is not None and around is not None:
                back = (feedback[:, time] * (state - around[:, time])).sum(axis=1)
                push = push + change[:, time] + back
            done[:, time] = self._model.possible(state, push)
            states[:, time + 1] = self._model.step(state, done[:, time])
        return Motions(states, done)

    def _cost(self, motions: Motions) -> np.ndarray:
        """Return the costs of N motions (N,)."""
        apart = motions.states[:, -1] - self._model.top
        last = 0.5 * np.einsum("ni,ij,nj->n", apart, self._last, apart)
        excess = np.maximum(np.abs(self._joined(motions) @ self._limited.T) - self._limits, 0.0)
        running = 0.5 * PUSH * motions.pushes**2 + excess**2 @ self._stiffness
        return last + running.sum(axis=1)

    def _joined(self, motions: Motions) -> np.ndarray:
        """Return states with their pushes (N, T, n + 1)."""
        return np.concatenate([motions.states[:, :-1], motions.pushes[:, :, None]], axis=2)

    def _expand(self) -> tuple[np.ndarray, np.ndarray]:
        """Return gradient (N, T, n + 1) and Hessian (N, T, n + 1, n + 1) of the running cost."""
        joined = self._joined(self.motions)
        values = joined @ self._limited.T
        excess = np.maximum(np.abs(values) - self._limits, 0.0)
        gradient = 2.0 * (self._stiffness * excess * np.sign(values)) @ self._limited
        gradient[:, :, -1] += PUSH * self.motions.pushes
        active = 2.0 * self._stiffness * (excess > 0.0)
        hessian = np.einsum("ntl,li,lj->ntij", active, self._limited, self._limited, optimize=True)
        hessian[:, :, -1, -1] += PUSH
        return gradient, hessian

    def _gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the change of the pushes (N, T) and the feedback (N, T, n) of an iteration."""
        count, steps = self.motions.pushes.shape
        size = self._model.size
        flat = self.motions.states[:, :-1].reshape(-1, size), self.motions.pushes.ravel()
        joint = self._model.linearise(*flat).reshape(count, steps, size, size + 1)
        gradient, hessian = self._expand()
        value = np.tile(self._last, (count, 1, 1))
        slope = (self.motions.states[:, -1] - self._model.top) @ self._last
        change, feedback = np.empty((count, steps)), np.empty((count, steps, size))
        closed = np.tile(np.eye(size + 1, size), (count, 1, 1))  # state to state and push
        for time in reversed(range(steps)):
            now = joint[:, time]
            across = now.swapaxes(1, 2)
            first = gradient[:, time] + (across @ slope[:, :, None])[:, :, 0]
            second = hessian[:, time] + across @ value @ now
            pull = self._damping[:, None] * (now[:, :, -1:] * now).sum(axis=1)
            damped = second[:, -1] + pull
            change[:, time] = _usable(-first[:, -1] / damped[:, -1])
            feedback[:, time] = _usable(-damped[:, :-1] / damped[:, -1:])
            closed[:, -1] = feedback[:, time]
            back = closed.swapaxes(1, 2)
            first += second[:, :, -1] * change[:, time, None]
            slope = _usable((back @ first[:, :, None])[:, :, 0], 1e100)
            value = _usable(back @ second @ closed, 1e100)
        return change, feedback


def _usable(values: np.ndarray, most: float = _GREATEST) -> np.ndarray:
    """Return values within -most to most, 0 for what is no number."""
    return np.where(np.isnan(values), 0.0, np.clip(values, -most, most))
