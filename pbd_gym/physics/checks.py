"""Refusals that the parts of a ModelBuilder share. The kernels check nothing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np


def refuse_if(wrong: Any, what: str, values: np.ndarray, allowed: str) -> None:
    """Raise a ValueError for the first index at which `wrong` is true, with the value there."""
    if np.any(wrong):
        index = int(np.flatnonzero(wrong)[0])
        raise ValueError(f"{what} {index} is {values[index]}; {allowed}")


def check_indices(indices: np.ndarray, count: int, what: str) -> None:
    """Refuse particles that do not exist, in an array (n,) or (n, k)."""
    wrong = (indices < 0) | (indices >= count)
    if wrong.ndim == 2:
        wrong = wrong.any(axis=1)
    refuse_if(wrong, what, indices, f"particles are numbered 0 to {count - 1}")


def check_different(groups: np.ndarray, what: str) -> None:
    """Refuse a group (n, k) that names a particle twice."""
    ordered = np.sort(groups, axis=1)
    wrong = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    refuse_if(wrong, what, groups, f"it needs {groups.shape[1]} different particles")


def check_duplicates(groups: Iterable[np.ndarray], what: str) -> None:
    """Refuse a constraint that holds between the same particles as an earlier one."""
    seen: dict[tuple[int, ...], int] = {}
    for index, group in enumerate(groups):
        key = tuple(sorted(int(particle) for particle in group))
        if key in seen:
            raise ValueError(
                f"{what} {index} {group} repeats {what} {seen[key]}; hold particles together once"
            )
        seen[key] = index


def check_compliance(values: np.ndarray, what: str) -> None:
    """Refuse a compliance that is negative or not finite."""
    wrong = ~(np.isfinite(values) & (values >= 0.0))
    refuse_if(wrong, f"compliance of {what}", values, "it must be finite and at least 0 [m/N]")


def check_in(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Refuse a setting that is not finite or out of a range (both ends allowed)."""
    if not (np.isfinite(value) and low <= value <= high):
        allowed = f"finite, from {low} to {high} {unit}".rstrip()
        raise ValueError(f"{name} is {value}; allowed: {allowed}")
