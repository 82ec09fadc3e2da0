"""What a model must satisfy, checked once by `ModelBuilder.build`; the kernels check nothing."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

# Beyond this a mass or its inverse would leave the range of float32 in the solver [kg].
_LEAST_MASS = 1e-12


def check_model(
    columns: dict[str, Any],
    settings: dict[str, Any],
    masses: np.ndarray,
    pinned: np.ndarray,
    integrators: tuple[str, ...],
) -> None:
    """Raise a ValueError that names the first thing that cannot be, with its index and value."""
    _check_particles(columns["positions"], masses, pinned)
    _check_settings(settings, columns["gravity"], integrators)
    _check_walls(settings)
    _check_chains(columns)
    _check_distances(columns)
    _check_bends(columns)
    _check_self_collision(columns, settings["collision_distance"])


def _refuse_if(wrong: Any, what: str, values: np.ndarray, allowed: str) -> None:
    """Raise for the first index at which `wrong` is true."""
    if np.any(wrong):
        index = int(np.flatnonzero(wrong)[0])
        raise ValueError(f"{what} {index} is {values[index]}; {allowed}")


def _check_particles(positions: np.ndarray, masses: np.ndarray, pinned: np.ndarray) -> None:
    if not len(positions):
        raise ValueError("the model has 0 particles; add at least one")
    wrong = ~np.isfinite(positions).all(axis=1)
    _refuse_if(wrong, "position of particle", positions, "coordinates must be finite [m]")
    wrong = ~((masses >= _LEAST_MASS) & (masses <= 1.0 / _LEAST_MASS)) & ~pinned
    allowed = f"a mass must be positive and finite, from {_LEAST_MASS} to {1.0 / _LEAST_MASS} [kg]"
    _refuse_if(wrong, "mass of particle", masses, allowed)


def _check_settings(settings: dict[str, Any], gravity: np.ndarray, names: tuple[str, ...]) -> None:
    dim = settings["dim"]
    if gravity.shape != (dim,) or not np.isfinite(gravity).all():
        raise ValueError(f"gravity is {gravity}; expected {dim} finite numbers [m/s2]")
    damping = settings["damping"]
    if not (np.isfinite(damping) and damping >= 0.0):
        raise ValueError(f"damping is {damping}; a rate must be finite and at least 0 [1/s]")
    if settings["integrator"] not in names:
        raise ValueError(f"integrator is {settings['integrator']!r}; allowed: {', '.join(names)}")
    iterations = settings["iterations"]
    whole = isinstance(iterations, int | np.integer) and not isinstance(iterations, bool)
    if not whole or iterations < 1:
        raise ValueError(f"iterations is {iterations!r}; expected a whole number from 1 up")


def _check_walls(settings: dict[str, Any]) -> None:
    lower, upper, dim = settings["lower"], settings["upper"], settings["dim"]
    if lower.shape != (dim,) or upper.shape != (dim,):
        raise ValueError(f"walls have shapes {lower.shape} and {upper.shape}; expected ({dim},)")
    radius = settings["wall_radius"]
    if not (np.isfinite(radius) and radius >= 0.0):
        raise ValueError(f"wall radius is {radius}; it must be finite and at least 0 [m]")
    # written so that a NaN wall is refused too
    wrong = ~(lower + radius < upper - radius)
    _refuse_if(wrong, "lower wall of axis", lower, f"it must lie below the upper walls {upper} [m]")
    for name, limit in (("restitution", 1.0), ("friction", np.inf)):
        value = settings[name]
        if not (0.0 <= value <= limit and np.isfinite(value)):
            raise ValueError(f"{name} is {value}; allowed: finite, from 0 to {limit}")


def _check_indices(indices: np.ndarray, count: int, what: str) -> None:
    wrong = (indices < 0) | (indices >= count)
    if wrong.ndim == 2:
        wrong = wrong.any(axis=1)
    _refuse_if(wrong, what, indices, f"particles are numbered 0 to {count - 1}")


def _check_duplicates(pairs: np.ndarray, what: str) -> None:
    """Refuse a constraint that holds between the same particles as an earlier one."""
    seen: dict[tuple[int, ...], int] = {}
    for index, pair in enumerate(pairs):
        key = tuple(sorted(int(particle) for particle in pair))
        if key in seen:
            raise ValueError(f"{what} {index} {pair} repeats {what} {seen[key]}; hold a pair once")
        seen[key] = index


def _check_compliance(values: np.ndarray, what: str) -> None:
    wrong = ~(np.isfinite(values) & (values >= 0.0))
    _refuse_if(wrong, f"compliance of {what}", values, "it must be finite and at least 0 [m/N]")


def _check_chains(columns: dict[str, Any]) -> None:
    offsets, particles = columns["chain_offsets"], columns["chain_particles"]
    sizes = np.diff(offsets)
    _refuse_if(sizes < 2, "number of particles in chain", sizes, "a chain has at least 2")
    _check_indices(particles, len(columns["positions"]), "particle of chain entry")
    for chain, (first, last) in enumerate(pairwise(offsets)):
        unique, counts = np.unique(particles[first:last], return_counts=True)
        if (counts > 1).any():
            raise ValueError(
                f"chain {chain} visits particle {unique[counts > 1][0]} twice; a directly solved "
                "chain must be open: close a loop with add_distance"
            )
    rest = columns["link_rest"]
    wrong = ~(np.isfinite(rest) & (rest > 0.0))
    _refuse_if(wrong, "rest length of chain entry", rest, "it must be positive and finite [m]")
    _check_compliance(columns["link_compliance"], "chain entry")
    greatest = columns["link_greatest_length"]
    wrong = ~(greatest >= rest)
    _refuse_if(wrong, "greatest length of chain entry", greatest, "a strain limit is at least 0")
    inner = np.ones(len(particles), dtype=bool)
    inner[offsets[1:] - 1] = False
    starts = np.flatnonzero(inner)
    links = np.stack([particles[starts], particles[starts + 1]], axis=1)
    _check_duplicates(np.concatenate([links, columns["distance_pairs"]]), "link")


def _check_distances(columns: dict[str, Any]) -> None:
    pairs, rest = columns["distance_pairs"], columns["distance_rest"]
    _check_indices(pairs, len(columns["positions"]), "particles of distance constraint")
    wrong = pairs[:, 0] == pairs[:, 1]
    _refuse_if(wrong, "distance constraint", pairs, "it needs two different particles")
    wrong = ~(np.isfinite(rest) & (rest > 0.0))
    _refuse_if(wrong, "rest length of distance constraint", rest, "it must be positive [m]")
    _check_compliance(columns["distance_compliance"], "distance constraint")
    stiffness = columns["distance_stiffness"]
    wrong = ~((stiffness > 0.0) & (stiffness <= 1.0))
    _refuse_if(wrong, "stiffness k of distance constraint", stiffness, "allowed: 0 < k <= 1")


def _check_bends(columns: dict[str, Any]) -> None:
    triples = columns["bend_triples"]
    _check_indices(triples, len(columns["positions"]), "particles of bend")
    ordered = np.sort(triples, axis=1)
    wrong = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    _refuse_if(wrong, "bend", triples, "it needs three different particles")
    _check_compliance(columns["bend_compliance"], "bend")
    friction = columns["bend_friction"]
    wrong = ~(np.isfinite(friction) & (friction >= 0.0))
    _refuse_if(wrong, "friction of bend", friction, "it must be finite and at least 0 [N]")
    _check_duplicates(triples, "bend")


def _check_self_collision(columns: dict[str, Any], distance: float) -> None:
    particles, positions = columns["collision_particles"], columns["positions"]
    if not (np.isfinite(distance) and distance >= 0.0):
        raise ValueError(f"self-collision distance is {distance}; finite and at least 0 [m]")
    _check_indices(particles, len(positions), "particle of self-collision")
    if len(np.unique(particles)) != len(particles):
        raise ValueError(f"self-collision names a particle twice: {particles}")
    points = positions[particles]
    for index in range(len(points) - 1):
        gaps = np.sqrt(((points[index + 1 :] - points[index]) ** 2).sum(axis=1))
        if gaps.min() < distance:
            raise ValueError(
                f"self-collision distance is {distance}; particle {particles[index]} is placed "
                f"{gaps.min()} m from another, and the distance may not be larger than that"
            )
