"""95 % confidence intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_Z = 1.959964  # two-sided 95 % of the normal distribution


@dataclass(frozen=True)
class Estimate:
    """A mean with the bounds of its 95 % confidence interval."""

    mean: float
    low: float
    high: float


def bootstrap_mean(values: np.ndarray, *, resamples: int = 10_000, seed: int = 0) -> Estimate:
    """Estimate a mean; the interval is the percentile bootstrap over `values` (E,)."""
    generator = np.random.default_rng(seed)
    draws = generator.integers(len(values), size=(resamples, len(values)))
    low, high = np.quantile(values[draws].mean(axis=1), (0.025, 0.975))
    return Estimate(float(values.mean()), float(low), float(high))


def wilson_rate(successes: np.ndarray) -> Estimate:
    """Estimate a rate from booleans (E,); Wilson's interval.

    Unlike the bootstrap it does not shrink to a point when all or none succeed.
    """
    count, rate = len(successes), float(successes.mean())
    scale = 1.0 + _Z**2 / count
    centre = (rate + _Z**2 / (2 * count)) / scale
    half = _Z / scale * math.sqrt(rate * (1 - rate) / count + (_Z / (2 * count)) ** 2)
    return Estimate(rate, max(centre - half, 0.0), min(centre + half, 1.0))
