"""Swing-up and balance of an n-link pendulum by its pivot: the scripted policy of the pendulums."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class SwingUp:
    """Energy pumping (Astrom and Furuta 2000), then a linear-quadratic regulator near the top.

    Bobs of equal mass hang on links of equal length from a pivot whose acceleration is the input.
    Angles are measured from upright, counter-clockwise. Only a baseline: unlike the physics it
    uses library linear algebra, so its actions may differ in their last bits between machines.

    Attributes:
        links: Number of links.
        link_length: [m].
        gravity: [m/s2].
        dt: Control step [s].
        max_speed: Of the pivot [m/s].
        max_acceleration: Of the pivot [m/s2].
        rail: Half the rail [m].
    """

    links: int
    link_length: float
    gravity: float
    dt: float
    max_speed: float
    max_acceleration: float
    rail: float

    @cached_property
    def _gains(self) -> np.ndarray:
        """Feedback (2 links + 2,) of acceleration on angles, rates, pivot position and velocity.

        Linearised at the top, M theta'' = G theta + b a with M_ij = l (n - max(i, j)), G_ii = g (n
        - i),
        b_i = n - i (i from 0): the pivot's acceleration tilts the links against it.
        """
        count, size = self.links, 2 * self.links + 2
        index = np.arange(count)
        carried = (count - index).astype(float)
        inertia = self.link_length * (count - np.maximum.outer(index, index))
        drift = np.zeros((size, size))
        drift[:count, count : 2 * count] = np.eye(count)
        drift[count : 2 * count, :count] = np.linalg.solve(inertia, np.diag(self.gravity * carried))
        drift[-2, -1] = 1.0
        push = np.zeros(size)
        push[count : 2 * count] = np.linalg.solve(inertia, carried)
        push[-1] = 1.0
        weights = np.concatenate([np.full(count, 100.0), np.full(count, 1.0), [10.0, 1.0]])
        return _regulator(*_discrete(drift, push, self.dt), np.diag(weights), 0.02)

    def act(
        self,
        pivot: np.ndarray,
        velocity: np.ndarray,
        direction: np.ndarray,
        motion: np.ndarray,
    ) -> np.ndarray:
        """Return actions (n, 1).

        Args:
            pivot: Position (n,) [m].
            velocity: Of the pivot (n,) [m/s].
            direction: Unit vectors of the links (n, links, 2).
            motion: Their rates of change (n, links, 2) [1/s].
        """
        angle = np.arctan2(-direction[:, :, 0], direction[:, :, 1])
        rate = direction[:, :, 0] * motion[:, :, 1] - direction[:, :, 1] * motion[:, :, 0]
        state = np.concatenate([angle, rate, pivot[:, None], velocity[:, None]], axis=1)
        balance = -state @ self._gains
        near_top = (np.abs(angle) < 0.5).all(axis=1) & (
            np.abs(balance) < 3.0 * self.max_acceleration
        )
        acceleration = np.where(near_top, balance, self._pump(pivot, velocity, direction, motion))
        return np.clip((velocity + acceleration * self.dt) / self.max_speed, -1.0, 1.0).astype(
            np.float32
        )[:, None]

    def _pump(
        self,
        pivot: np.ndarray,
        velocity: np.ndarray,
        direction: np.ndarray,
        motion: np.ndarray,
    ) -> np.ndarray:
        """Accelerate against the bobs' motion while energy is missing, and towards the middle."""
        position = self.link_length * np.cumsum(direction, axis=1)
        speed = self.link_length * np.cumsum(motion, axis=1)
        top = self.link_length * np.sum(np.arange(1, self.links + 1))
        energy = 0.5 * np.sum(speed**2, axis=(1, 2)) + self.gravity * np.sum(
            position[:, :, 1], axis=1
        )
        missing = (self.gravity * top - energy) / (2.0 * self.gravity * top)
        # in the pivot's frame its acceleration a gives the bobs the power -a * sum of v_x
        momentum = np.sum(speed[:, :, 0], axis=1)
        strength = np.clip(10.0 * missing, -1.0, 1.0)
        pump = -0.4 * self.max_acceleration * strength * np.tanh(4.0 * momentum)
        return pump - 6.0 * pivot / self.rail - 1.0 * velocity


def _discrete(drift: np.ndarray, push: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact discrete system of z' = drift z + push a for a held over dt."""
    size = len(push)
    joint = np.zeros((size + 1, size + 1))
    joint[:size, :size], joint[:size, size] = drift * dt, push * dt
    total = term = np.eye(size + 1)
    for order in range(1, 20):
        term = term @ joint / order
        total = total + term
    return total[:size, :size], total[:size, size]


def _regulator(
    drift: np.ndarray, push: np.ndarray, weights: np.ndarray, effort: float
) -> np.ndarray:
    """Return the gains of the discrete regulator by iterating Riccati's equation."""
    cost, gains = weights, np.zeros(len(push))
    for _ in range(5000):
        gains = (push @ cost @ drift) / (effort + push @ cost @ push)
        updated = weights + drift.T @ cost @ (drift - np.outer(push, gains))
        if np.allclose(updated, cost, rtol=1e-10):
            break
        cost = updated
    return gains
