"""Random models of every kind of constraint and contact, for abuse.py and the tests.

A family is a fixed set of kinds, so that it needs one compilation; sizes, masses, compliances,
gravity and all else are drawn. Calm models have masses up to 10:1 under at most 1 g; wild ones up
to 1000:1 under up to 10 g. What cannot be is refused by `build` with a ValueError, as for anyone.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pbd_gym.physics import Model, ModelBuilder, shapes

_COMPLIANCES = (0.0, 1e-5, 1e-3, 1e-1)


class Family(NamedTuple):
    """Models that have the same kinds.

    Attributes:
        build: Takes a generator and whether the model is wild.
        dtype: Of its worlds.
    """

    build: Callable[[np.random.Generator, bool], Model]
    dtype: type


def _masses(generator: np.random.Generator, count: int, wild: bool) -> np.ndarray:
    return 0.1 * (1000.0 if wild else 10.0) ** generator.uniform(size=count)


def _gravity(generator: np.random.Generator, dim: int, wild: bool) -> np.ndarray:
    """Return nothing, earth's, or up to ten times that, downwards (dim,) [m/s2]."""
    size = generator.choice([0.0, 9.81, 98.1 * generator.uniform() if wild else 9.81])
    return size * np.eye(dim)[-1] * -1.0


def _settings(generator: np.random.Generator, dim: int, wild: bool) -> dict:
    return {
        "gravity": _gravity(generator, dim, wild),
        "iterations": int(generator.integers(1, 4)),
        "damping": float(generator.choice([0.0, 1.0])),
    }


def _surface(generator: np.random.Generator) -> dict:
    friction = generator.uniform()
    return {
        "restitution": generator.uniform(),
        "friction": friction,
        "kinetic_friction": friction * generator.uniform(),
    }


def _network(dim: int, integrator: str) -> Callable[[np.random.Generator, bool], Model]:
    """Chains, distances and bends between any particles, some in one place, some in a room."""

    def build(generator: np.random.Generator, wild: bool) -> Model:
        count = int(generator.integers(4, 25))
        places = generator.uniform(-1.0, 1.0, (count, dim))
        if generator.uniform() < 0.1:
            places[generator.integers(count)] = places[generator.integers(count)]
        builder = ModelBuilder(dim)
        for place, mass in zip(places, _masses(generator, count, wild), strict=True):
            builder.add_particles(place, mass)
        _link_at_random(builder, generator, count)
        builder.pin(generator.choice(count, int(generator.integers(0, 4 if wild else 2)), False))
        if generator.uniform() < 0.5:
            builder.set_room([-2.0] * dim, [2.0] * dim, **_surface(generator))
        return builder.build(integrator=integrator, **_settings(generator, dim, wild))

    return build


def _link_at_random(builder: ModelBuilder, generator: np.random.Generator, count: int) -> None:
    order, cut = generator.permutation(count), int(generator.integers(2, count - 1))
    linked: set[frozenset[int]] = set()
    for part in np.split(order, [cut]):
        builder.add_chain(part, compliance=generator.choice(_COMPLIANCES))
        linked |= {frozenset(map(int, link)) for link in pairwise(part)}
    for _ in range(int(generator.integers(count))):
        i, j = (int(particle) for particle in generator.choice(count, 2, replace=False))
        if frozenset((i, j)) not in linked:
            linked.add(frozenset((i, j)))
            builder.add_distance(i, j, compliance=generator.choice(_COMPLIANCES))
    for _ in range(int(generator.integers(count // 2))):
        a, b, c = generator.choice(count, 3, replace=False)
        builder.add_bend(a, b, c, compliance=generator.choice([0.1, 10.0]))


def _ropes(generator: np.random.Generator, wild: bool) -> Model:
    """Implicit and slack ropes with payloads and rods, tethered, over a table (2D)."""
    builder = ModelBuilder(2)
    for index in range(2):
        count = int(generator.integers(4, 20))
        end = (generator.uniform(0.3, 1.0), generator.uniform(-0.5, 0.5) + index)
        payload = 0.2 * (1000.0 if wild else 10.0) ** generator.uniform()
        rope = shapes.rope(
            builder,
            (0.0, float(index)),
            end,
            count,
            mass=0.2,
            payload=payload,
            compliance=generator.choice(_COMPLIANCES[:2]),
            bending_stiffness=generator.choice([1e-4, 1e-2]),
            slack=index == 0,
            implicit=True,
        )
        builder.pin(rope[0])
        if wild and generator.uniform() < 0.3:
            builder.pin(rope[-1])
        low = -generator.uniform()
        builder.add_distance(
            rope[0], rope[-1], compliance=1e-2, strain_limits=(low, generator.uniform())
        )
    builder.add_tethers(stretch=generator.uniform())
    builder.set_ground(-2.0, **_surface(generator))
    return builder.build(**_settings(generator, 2, wild))


def _sheets(generator: np.random.Generator, wild: bool) -> Model:
    """A cloth that collides with itself, creased and folded, over all shapes on a pin (3D)."""
    builder = ModelBuilder(3)
    rows, columns = (int(n) for n in generator.integers(4, 8, 2))
    cell = 0.05
    held = [(0, 0), (0, columns - 1)][: int(generator.integers(0, 3))]
    grid = shapes.cloth(
        builder,
        (0.0, 0.0, 0.5),
        ((rows - 1) * cell, 0.0, 0.0),
        (0.0, (columns - 1) * cell, 0.0),
        (rows, columns),
        mass=generator.uniform(0.02, 2.0 if wild else 0.2),
        thread_damping=generator.choice([0.0, 5.0]),
        bending_friction=generator.choice([0.0, 1e-3]),
        collision_distance=0.6 * cell,
        collision_friction=generator.uniform(),
        pinned=held,
    )
    wings = grid[1, 0], grid[0, 1]
    builder.add_hinge(
        (grid[0, 0], grid[1, 1]), wings, bending_stiffness=1e-4, angle=generator.uniform(-1.0, 1.0)
    )
    builder.add_fold(
        (grid[-2, -2], grid[-1, -1]), (grid[-1, -2], grid[-2, -1]), bending_stiffness=1e-4
    )
    pin = int(builder.add_particles((0.1, 0.1, 0.0), 1.0, pinned=True)[0])
    across = generator.uniform(-0.1, 0.1, 3)
    builder.add_sphere((0.1, 0.1, 0.3), 0.1, pin=pin, margin=0.01, **_surface(generator))
    builder.add_box((0.3, 0.1, 0.3), (0.1, 0.05, 0.1), pin=pin, **_surface(generator))
    builder.add_capsule(-across, across, 0.05, pins=(pin, None), **_surface(generator))
    builder.add_plane((0.0, 0.0, -0.2), (0.1, 0.0, 1.0), **_surface(generator))
    return builder.build(**_settings(generator, 3, wild))


def _solids(generator: np.random.Generator, wild: bool) -> Model:
    """Two soft bodies and a rigid one that collide, one grabbable, one attached to a pin (2D)."""
    builder = ModelBuilder(2)
    for index in range(2):
        count = int(generator.integers(5, 16))
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        ring = 0.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        body = shapes.soft_body_2d(
            builder,
            ring + np.array([0.5 * index, 0.3]),
            mass=_masses(generator, 1, wild)[0],
            stretch_stiffness=generator.choice([10.0, 1e3, np.inf]),
            area_modulus=generator.choice([10.0, np.inf]),
            shape_stiffness=generator.choice([0.0, 100.0, np.inf]),
            collision_radius=0.02,
            collision_friction=generator.uniform(),
        )
        builder.make_grabbable(body[:2])
    box = shapes.rigid_box(builder, (0.25, 0.8), (0.2, 0.1), mass=_masses(generator, 1, wild)[0])
    corners = box.ravel()[[0, 1, 3, 2]]
    links = np.stack([corners, np.roll(corners, -1)], axis=1)
    builder.add_collision(corners, 0.02, links=links, restitution=generator.uniform())
    pin = int(builder.add_particles((0.25, 1.0), 1.0, pinned=True)[0])
    builder.add_attachment(corners[0], pin, compliance=generator.choice([1e-3, 1e-1]))
    builder.add_sphere((0.25, -0.5), 0.2, **_surface(generator))
    builder.set_room((-2.0, -1.0), (2.0, 2.0), **_surface(generator))
    return builder.build(**_settings(generator, 2, wild))


def _balls(generator: np.random.Generator, wild: bool) -> Model:
    """A soft ball, a tetrahedron and a rigid box that collide on a plane, one on a pin (3D)."""
    builder = ModelBuilder(3)
    stiffness = generator.choice([100.0, np.inf])
    ball = shapes.soft_ball(
        builder,
        (0.0, 0.0, 0.5),
        0.2,
        mass=_masses(generator, 1, wild)[0],
        subdivisions=0,
        bulk_modulus=generator.choice([1e4, np.inf]),
        shape_stiffness=generator.choice([0.0, stiffness]),
    )
    builder.add_collision(ball, 0.1, friction=generator.uniform())
    corners = np.array([0.6, 0.0, 0.5]) + generator.uniform(-0.2, 0.2, (4, 3))
    four = np.concatenate(
        [
            builder.add_particles(corner, mass)
            for corner, mass in zip(corners, _masses(generator, 4, wild), strict=True)
        ]
    )
    builder.add_tetrahedra([four], compliance=generator.choice([0.0, 1e-4]))
    builder.add_shape_match(four, compliance=generator.choice([0.0, 1e-2]))
    builder.add_collision(four, 0.05, restitution=generator.uniform())
    box = shapes.rigid_box(
        builder, (0.0, 0.6, 0.5), (0.2, 0.2, 0.2), mass=_masses(generator, 1, wild)[0]
    )
    builder.add_collision(box.ravel(), 0.1, friction=generator.uniform())
    pin = int(builder.add_particles((0.0, 0.6, 0.8), 1.0, pinned=True)[0])
    builder.add_attachment(box.ravel()[0], pin, compliance=1e-2)
    builder.add_plane((0.0, 0.0, 0.0), (0.0, 0.1, 1.0), **_surface(generator))
    return builder.build(**_settings(generator, 3, wild))


FAMILIES = {
    "networks 2D": Family(_network(2, "pbd"), np.float32),
    "networks 2D rattle": Family(_network(2, "rattle"), np.float32),
    "networks 3D": Family(_network(3, "pbd"), np.float32),
    "networks 3D rattle": Family(_network(3, "rattle"), np.float32),
    "ropes 2D": Family(_ropes, np.float64),
    "sheets 3D": Family(_sheets, np.float32),
    "solids 2D": Family(_solids, np.float64),
    "balls 3D": Family(_balls, np.float32),
}
