"""Scenes whose exact motion is known to many digits: point masses on rigid links, in a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY = 9.81
FRAME = 1.0 / 60.0


@dataclass(frozen=True, eq=False)
class ChainScene:
    """Point masses on rigid massless links below a pivot that may be driven sideways.

    Attributes:
        name: Of the scene.
        lengths: Of the links, (n,) [m].
        masses: Of the points, (n,) [kg].
        angles: Where the links start, from hanging down, (n,) [rad]; all at rest.
        seconds: Simulated time [s]; the errors are taken at every 1/60 s.
        amplitude: Of the pivot's motion at 1 Hz, growing over the first half second [m].
    """

    name: str
    lengths: np.ndarray
    masses: np.ndarray
    angles: np.ndarray
    seconds: float
    amplitude: float = 0.0

    @property
    def frames(self) -> int:
        """Number of 1/60 s."""
        return round(self.seconds / FRAME)

    @property
    def start(self) -> np.ndarray:
        """Where pivot and points start, (n + 1, 2) [m]."""
        links = self.lengths[:, None] * np.stack([np.sin(self.angles), -np.cos(self.angles)], 1)
        return np.concatenate([np.zeros((1, 2)), np.cumsum(links, axis=0)])

    def pivot(self, time: float) -> float:
        """Return where the pivot is [m]."""
        growth, _, _ = ramp(time)
        return self.amplitude * growth * np.sin(2.0 * np.pi * time)

    def pivot_acceleration(self, time: float) -> float:
        """Return the pivot's acceleration [m/s2]."""
        growth, slope, curve = ramp(time)
        rate, phase = 2.0 * np.pi, 2.0 * np.pi * time
        return self.amplitude * (
            curve * np.sin(phase) + 2.0 * slope * rate * np.cos(phase)
            - growth * rate**2 * np.sin(phase)
        )  # fmt: skip

    @cached_property
    def reference(self) -> np.ndarray:
        """Where the last point is after each 1/60 s, (frames, 2) [m].

        Lagrange's equations in the links' angles, solved by DOP853 at a relative tolerance of
        1e-11. Nothing of the package takes part.
        """
        size = len(self.masses)
        solution = solve_ivp(
            self._rates,
            (0.0, self.frames * FRAME * (1.0 + 1e-12)),
            np.concatenate([self.angles, np.zeros(size)]),
            method="DOP853",
            t_eval=np.arange(1, self.frames + 1) * FRAME,
            rtol=1e-11,
            atol=1e-12,
        )
        angles = solution.y[:size]
        x = self.lengths @ np.sin(angles) + [self.pivot(time) for time in solution.t]
        return np.stack([x, -(self.lengths @ np.cos(angles))], axis=1)

    def _rates(self, time: float, state: np.ndarray) -> np.ndarray:
        """Return the rates of the angles and of the angular velocities.

        sum_j m_ij l_j (cos(a_i - a_j) a_j'' + sin(a_i - a_j) a_j'^2) = -m_ii (g sin a_i + p'' cos
        a_i), where m_ij is the mass below both links i and j, and p the pivot.
        """
        size = len(self.masses)
        angle, rate = state[:size], state[size:]
        below = np.cumsum(self.masses[::-1])[::-1]
        carried = below[np.maximum.outer(np.arange(size), np.arange(size))] * self.lengths
        between = angle[:, None] - angle
        push = GRAVITY * np.sin(angle) + self.pivot_acceleration(time) * np.cos(angle)
        right = -below * push - (carried * np.sin(between)) @ (rate * rate)
        return np.concatenate([rate, np.linalg.solve(carried * np.cos(between), right)])

    def error(self, tip: np.ndarray) -> float:
        """Return the root mean square distance of a tip's motion (frames, 2) from the exact one."""
        gaps = np.sum((tip - self.reference) ** 2, axis=1)
        value = float(np.sqrt(np.mean(gaps)))
        return value if np.isfinite(value) else float("inf")


def ramp(time: float) -> tuple[float, float, float]:
    """Return a smooth growth from 0 to 1 over half a second, its slope and its curvature."""
    share = min(time / 0.5, 1.0)
    if share >= 1.0:
        return 1.0, 0.0, 0.0
    value = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    slope = 30.0 * share**2 * (1.0 - share) ** 2 / 0.5
    curve = 60.0 * share * (1.0 - 3.0 * share + 2.0 * share**2) / 0.25
    return value, slope, curve


def _hanging(count: int) -> dict[str, np.ndarray]:
    """Return a rope of 1 m and 0.2 kg of `count` particles, the first of which is the pivot."""
    return {
        "lengths": np.full(count - 1, 1.0 / (count - 1)),
        "masses": np.full(count - 1, 0.2 / count),
        "angles": np.zeros(count - 1),
    }


_RIGHT = np.pi / 2.0
SCENES = (
    ChainScene("pendulum", np.ones(1), np.ones(1), np.full(1, _RIGHT), 2.0),
    ChainScene("double pendulum", np.ones(2), np.ones(2), np.full(2, _RIGHT), 1.0),
    ChainScene("driven rope", **_hanging(32), seconds=1.0, amplitude=0.25),
)
