"""What the painters of plane and space ask a model: who has a goal, how large a bob is."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from pbd_gym.physics.bodies import Body, Linkage, Net
from pbd_gym.physics.model import Model
from pbd_gym.rendering.curves import finite_rows

Segment = tuple["Sequence[float] | np.ndarray", "Sequence[float] | np.ndarray"]

_BOB_DENSITY = 500.0  # [kg/m3]; a bob is drawn as a wooden ball of its mass


def particles_of(body: Body) -> np.ndarray:
    """Return the particle indices of a body: (M,), or (rows, columns) of a sheet."""
    return np.array(body.particles, dtype=np.int64)


@lru_cache(maxsize=64)
def threads_of(net: Net) -> tuple[np.ndarray, ...]:
    """Return the particle indices of each line of a net, (M,)."""
    return tuple(np.array(thread, dtype=np.int64) for thread in net.threads)


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


def loose_particles(model: Model) -> np.ndarray:
    """Return the indices of the particles that belong to no body and carry no shape."""
    loose = np.ones(len(model.inverse_mass), dtype=bool)
    loose[carriers(model)] = False
    for body in model.bodies:
        loose[particles_of(body)] = False
    return np.flatnonzero(loose)


def bob_radius(model: Model, linkage: Linkage) -> np.ndarray:
    """Return the radius of the bob at each particle of a linkage, (M,) [m]; 0 at a pin.

    It grows with the cube root of the mass, and bobs never touch each other.
    """
    particles = particles_of(linkage)
    inverse_mass = model.inverse_mass[particles]
    links = np.linalg.norm(np.diff(model.positions[particles], axis=0), axis=1)
    free = np.where(inverse_mass > 0.0, inverse_mass, np.inf)
    radius = np.cbrt(3.0 / (4.0 * np.pi * _BOB_DENSITY * free))
    largest = 0.35 * links.min(initial=np.inf)
    return np.where(inverse_mass > 0.0, np.clip(radius, min(linkage.radius, largest), largest), 0.0)


def round_length(length: float) -> float:
    """Return the largest of ..., 0.1, 0.2, 0.5, 1, 2, 5, ... that is not above a length [m]."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length * 1.001))
