"""Elementary functions that give the same bits on every machine.

Library versions of exp, sin and cos differ in their last bits between processors, as they choose
other instructions on each. These use only +, -, *, / on float64, which IEEE 754 defines exactly.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbd_gym.physics.compiling import entry


def exp(y: Any) -> np.ndarray:
    """Return e^y for y <= 0, elementwise in float64; relative error below 1e-13.

    Values below -64 give e^-64, which is 0 for every reward.
    """
    values = np.asarray(y, dtype=np.float64, order="C")
    result = np.empty(values.shape)
    _exp(values.reshape(-1), result.reshape(-1))
    return result


@entry
def exp_scalar(y: float) -> float:
    """Return e^y for one number y <= 0, for use within kernels: the same bits as `exp`.

    e^y = (e^(y/256))^256: a Taylor polynomial on [-0.25, 0], then eight squarings.
    """
    small = max(y, -64.0) * (1.0 / 256.0)
    total = 1.0
    for degree in range(11, 0, -1):
        total = 1.0 + total * small * (1.0 / degree)
    for _ in range(8):
        total = total * total
    return total


@entry
def _exp(values: Any, result: Any) -> None:
    """Apply `exp_scalar` elementwise."""
    for index in range(values.shape[0]):
        result[index] = exp_scalar(values[index])


def cos_sin(angle: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return cosine and sine of an angle in [-pi, pi] [rad], elementwise in float64.

    Taylor polynomials of angle/4 (below 0.79 in size), then the double-angle formulas twice;
    absolute error below 1e-14.
    """
    values = np.asarray(angle, dtype=np.float64, order="C")
    cosine, sine = np.empty(values.shape), np.empty(values.shape)
    _cos_sin(values.reshape(-1), cosine.reshape(-1), sine.reshape(-1))
    return cosine, sine


@entry
def _cos_sin(angle: Any, cosine: Any, sine: Any) -> None:
    """Write cosines and sines of angles (n,)."""
    for index in range(angle.shape[0]):
        quarter = angle[index] * 0.25
        square = quarter * quarter
        even = odd = 1.0
        for degree in range(18, 0, -2):
            even = 1.0 - even * square * (1.0 / (degree * (degree - 1)))
            odd = 1.0 - odd * square * (1.0 / (degree * (degree + 1)))
        odd *= quarter
        for _ in range(2):
            even, odd = even * even - odd * odd, 2.0 * even * odd
        cosine[index], sine[index] = even, odd
