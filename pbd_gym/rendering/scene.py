"""What the painters of plane and space ask a model: who has a goal, how large a bob is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from pbd_gym.physics.bodies import Body, Linkage, Net, Sheet, Strand
from pbd_gym.physics.model import Model
from pbd_gym.rendering.curves import finite_rows

Segment = tuple["Sequence[float] | np.ndarray", "Sequence[float] | np.ndarray"]

_BOB_DENSITY = 500.0  # [kg/m3]; a bob is drawn as a wooden ball of its mass
_PAYLOAD = 3.0  # an end of a rope that is so many times as heavy as the others carries something


def particles_of(body: Body) -> np.ndarray:
    """Return the particle indices of a body: (M,), or (rows, columns) of a sheet."""
    return np.array(body.particles, dtype=np.int64)


@lru_cache(maxsize=64)
def threads_of(net: Net) -> np.ndarray:
    """Return the pairs of particles between which the lines of a net run, (M, 2)."""
    pairs = [pair for thread in net.threads for pair in pairwise(thread)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def split_goals(model: Model, goal: np.ndarray | None) -> tuple[list[Body], np.ndarray]:
    """Tell goals of whole bodies from goals of single particles.

    Args:
        model: Whose bodies they are.
        goal: (N, dim) [m], NaN for a particle without a goal; or None for no goals at all.

    Returns:
        The bodies with a goal for every particle, and the indices of all other particles with one.
    """
    if goal is None:
        return [], np.zeros(0, dtype=np.int64)
    single = finite_rows(goal)
    whole = [body for body in model.bodies if single[particles_of(body)].all()]
    for body in whole:
        single[particles_of(body)] = False
    return whole, np.flatnonzero(single)


def carriers(model: Model) -> np.ndarray:
    """Return the pins that carry shapes."""
    if model.colliders is None:
        return np.zeros(0, dtype=np.int64)
    pins = np.unique(model.colliders.pins)
    return pins[pins >= 0]


def grippers(model: Model) -> np.ndarray:
    """Return the pins that hold a body and carry no shape."""
    return np.setdiff1d(model.pins, carriers(model))


def in_bodies(model: Model) -> np.ndarray:
    """Return which particles belong to a body, (N,)."""
    within = np.zeros(len(model.inverse_mass), dtype=bool)
    for body in model.bodies:
        within[particles_of(body)] = True
    return within


def loose_particles(model: Model) -> np.ndarray:
    """Return the indices of the particles that belong to no body and carry no shape."""
    loose = ~in_bodies(model)
    loose[carriers(model)] = False
    return np.flatnonzero(loose)


def loose_links(model: Model) -> np.ndarray:
    """Return the links and distances (M, 2) that are no part of what a body shows."""
    pairs = np.concatenate([model.links()[0], model.distances.pairs]).astype(np.int64)
    return pairs[~in_bodies(model)[pairs].all(axis=1)]


def tips(model: Model) -> np.ndarray:
    """Return the free ends of ropes and pendulums and the free corners of cloths."""
    ends: list[int] = []
    for body in model.bodies:
        particles = particles_of(body)
        if isinstance(body, Strand | Linkage):
            ends += particles[[0, -1]].tolist()
        elif isinstance(body, Sheet):
            ends += particles[[0, 0, -1, -1], [0, -1, 0, -1]].tolist()
    return np.array([end for end in ends if model.inverse_mass[end] > 0.0], dtype=np.int64)


def ball_radius(model: Model, particles: np.ndarray) -> np.ndarray:
    """Return the radius of a ball of each particle's mass, (M,) [m]; 0 for a pin.

    It grows with the cube root of the mass.
    """
    inverse_mass = model.inverse_mass[particles]
    free = np.where(inverse_mass > 0.0, inverse_mass, np.inf)
    return np.cbrt(3.0 / (4.0 * np.pi * _BOB_DENSITY * free))


def bob_radius(model: Model, linkage: Linkage) -> np.ndarray:
    """Return the radius of the bob at each particle of a linkage, (M,) [m]; 0 at a pin.

    Bobs never touch each other.
    """
    particles = particles_of(linkage)
    links = np.linalg.norm(np.diff(model.positions[particles], axis=0), axis=1)
    largest = 0.35 * links.min(initial=np.inf)
    radius = ball_radius(model, particles)
    bounded = np.clip(radius, min(linkage.radius, largest), largest)
    return np.where(model.inverse_mass[particles] > 0.0, bounded, 0.0)


def payload_radius(model: Model, strand: Strand) -> float:
    """Return the radius of the load at the last particle of a rope [m]; 0 if it carries none."""
    inverse_mass = model.inverse_mass[particles_of(strand)]
    last, others = inverse_mass[-1], inverse_mass[:-1]
    if not (last > 0.0 and _PAYLOAD * last < np.median(others)):
        return 0.0
    return float(ball_radius(model, particles_of(strand)[-1:])[0])


def round_length(length: float) -> float:
    """Return the largest of ..., 0.1, 0.2, 0.5, 1, 2, 5, ... that is not above a length [m]."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length * 1.001))
