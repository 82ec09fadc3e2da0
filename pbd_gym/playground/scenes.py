"""The scenes that the program begins with, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from pbd_gym.physics.solid_shapes import icosphere
from pbd_gym.playground.drawing import (
    Balls,
    Drawing,
    Fabric,
    Obstacle,
    Outline,
    Particle,
    Settings,
    Skin,
    Strut,
    Thread,
)

_PLANE = ((-1.6, -1.1), (1.6, 0.8))
_SPACE = ((-0.7, -0.7, 0.0), (0.7, 0.7, 1.1))
_SHEAR = 0.1  # compliance of a cloth's diagonals [m/N]


def pendulum(links: int) -> Drawing:
    """Return a pendulum of one to five links, held out to the side."""
    length = 0.9 / links
    angle = np.radians(150.0)
    places = [(k * length * np.sin(angle), -k * length * np.cos(angle)) for k in range(links + 1)]
    particles = (_pin(places[0]), *(Particle(tuple(map(float, at)), 0.5) for at in places[1:]))
    return Drawing(
        name=_PENDULUMS[links - 1],
        dim=2,
        view=((-1.3, -1.05), (1.3, 1.05)),
        particles=particles,
        settings=Settings(damping=0.0, integrator="both"),
        threads=(Thread(tuple(range(links + 1)), (length,) * links, "rods"),),
    )


def rope(payload: float = 0.0) -> Drawing:
    """Return a rope that hangs from one end, with a weight [kg] at the other on request."""
    count, length = 24, 1.4
    x = np.linspace(-0.2, length - 0.4, count)
    particles = [Particle((float(at), 0.5), 0.3 / count) for at in x]
    particles[0] = _pin(particles[0].position)
    balls: tuple[Balls, ...] = ()
    if payload:
        particles[-1] = replace(particles[-1], mass=payload)
        balls = (Balls((count - 1,), 0.06),)
    return Drawing(
        name="Rope with a weight" if payload else "Rope",
        dim=2,
        view=_PLANE,
        particles=tuple(particles),
        threads=(Thread(tuple(range(count)), tuple(map(float, np.diff(x)))),),
        balls=balls,
    )


def net(side: int = 24) -> Drawing:
    """Return a cloth of the plane, held by one corner and the middle of its upper edge."""
    x, y = np.linspace(-0.75, 0.75, side), np.linspace(0.65, -0.65, side)
    particles = [Particle((float(a), float(b)), 0.5 / side**2) for b in y for a in x]
    for place in (0, side // 2):
        particles[place] = _pin(particles[place].position)
    grid = np.arange(side * side).reshape(side, side)
    across, down = float(x[1] - x[0]), float(y[0] - y[1])
    threads = [Thread(tuple(row), (across,) * (side - 1), "thread") for row in grid.tolist()]
    threads += [Thread(tuple(row), (down,) * (side - 1), "thread") for row in grid.T.tolist()]
    return Drawing(
        name="Cloth, flat",
        dim=2,
        view=_PLANE,
        particles=tuple(particles),
        threads=tuple(threads),
        struts=_diagonals(grid, float(np.hypot(across, down))),
    )


def cloth(side: int = 20) -> Drawing:
    """Return a cloth in space that falls on a ball, held by one corner."""
    x = np.linspace(-0.45, 0.45, side)
    particles = [Particle((float(a), float(b), 0.85), 0.2 / side**2) for b in x for a in x]
    particles[0] = _pin(particles[0].position)
    grid = np.arange(side * side).reshape(side, side)
    gap = float(x[1] - x[0])
    rows = grid.tolist()
    threads = [Thread(tuple(row), (gap,) * (side - 1), "woven", 0.002) for row in rows]
    threads += [Thread(tuple(row), (gap,) * (side - 1), "woven", 0.002) for row in grid.T.tolist()]
    return Drawing(
        name="Cloth in space",
        dim=3,
        view=_SPACE,
        particles=tuple(particles),
        settings=Settings(damping=0.5),
        threads=tuple(threads),
        struts=_diagonals(grid, gap * 2.0**0.5),
        fabrics=(Fabric(tuple(map(tuple, rows))),),
        obstacles=(Obstacle("ball", (0.05, 0.05, 0.35), (0.28,)),),
    )


def soft_bodies() -> Drawing:
    """Return a disc, a drop and a bar that fall on each other."""
    shapes = [_round((-0.45, 0.25), 0.26, 28), _round((0.3, 0.4), 0.2, 22), _bar((0.0, -0.45))]
    particles, outlines = [], []
    for points in shapes:
        first = len(particles)
        particles += [Particle(tuple(map(float, at)), 0.02) for at in points]
        outlines.append(Outline(tuple(range(first, len(particles)))))
    return Drawing(
        name="Soft bodies",
        dim=2,
        view=_PLANE,
        walls=True,
        particles=tuple(particles),
        settings=Settings(substeps=16),
        outlines=tuple(outlines),
        obstacles=(Obstacle("ball", (0.25, -0.95), (0.3,)),),
    )


def soft_balls() -> Drawing:
    """Return two soft balls in space, over a box."""
    directions, triangles = icosphere(2)
    particles, skins = [], []
    for centre, size in (((-0.2, 0.0, 0.85), 0.2), ((0.25, 0.1, 0.6), 0.15)):
        first = len(particles)
        places = np.array(centre) + size * directions
        particles += [Particle(tuple(map(float, at)), 0.3 / len(places)) for at in places]
        skins.append(Skin(tuple(map(tuple, (triangles + first).tolist()))))
    return Drawing(
        name="Soft balls in space",
        dim=3,
        view=_SPACE,
        particles=tuple(particles),
        skins=tuple(skins),
        obstacles=(Obstacle("box", (-0.1, 0.0, 0.15), (0.3, 0.3, 0.15)),),
    )


def ball_pit(count: int = 200) -> Drawing:
    """Return balls that fall into a pit with two round obstacles."""
    radius = 0.05 * (200 / count) ** 0.5
    columns = int(3.0 / (2.4 * radius))
    shift = np.random.default_rng(0).uniform(-0.18, 0.18, (count, 2)) * radius
    places = np.array([(k % columns, k // columns) for k in range(count)]) * 2.4 * radius
    places += shift + np.array([-1.6 + 3.0 * radius, -0.4])
    return Drawing(
        name="Ball pit",
        dim=2,
        view=_PLANE,
        walls=True,
        particles=tuple(Particle(tuple(map(float, at)), 0.05) for at in places),
        settings=Settings(substeps=4, restitution=0.4, friction=0.1),
        balls=(Balls(tuple(range(count)), radius),),
        obstacles=(
            Obstacle("ball", (-0.5, -0.85), (0.18,)),
            Obstacle("box", (0.5, -0.8), (0.2, 0.1)),
        ),
    )


def empty() -> Drawing:
    """Return a nail with a short rope: the beginning of a drawing of one's own."""
    places = [(0.0, 0.4 - 0.06 * k) for k in range(5)]
    particles = (_pin(places[0]), *(Particle(at) for at in places[1:]))
    rest = tuple(float(abs(a[1] - b[1])) for a, b in pairwise(places))
    return Drawing(
        name="Your own drawing",
        dim=2,
        view=_PLANE,
        walls=True,
        particles=particles,
        threads=(Thread(tuple(range(5)), rest),),
    )


_PENDULUMS = ("Pendulum", "Double pendulum", "Triple pendulum", "Four links", "Five links")
SCENES: dict[str, Callable[[], Drawing]] = {
    **{name: partial(pendulum, k + 1) for k, name in enumerate(_PENDULUMS)},
    "Rope": rope,
    "Rope with a weight": partial(rope, 1.0),
    "Cloth, flat": net,
    "Cloth in space": cloth,
    "Soft bodies": soft_bodies,
    "Soft balls in space": soft_balls,
    "Ball pit": ball_pit,
    "Your own drawing": empty,
}


def _pin(position: tuple[float, ...]) -> Particle:
    return Particle(tuple(map(float, position)), pinned=True)


def _diagonals(grid: np.ndarray, rest: float) -> tuple[Strut, ...]:
    """Return soft diagonals of all cells, which hold a cloth in its shape."""
    pairs = [
        *zip(grid[:-1, :-1].ravel(), grid[1:, 1:].ravel(), strict=True),
        *zip(grid[:-1, 1:].ravel(), grid[1:, :-1].ravel(), strict=True),
    ]
    return tuple(Strut((int(i), int(j)), rest, _SHEAR, shown=False) for i, j in pairs)


def _round(centre: tuple[float, float], radius: float, corners: int) -> np.ndarray:
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return np.array(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _bar(centre: tuple[float, float]) -> np.ndarray:
    """Return the outline of a bar, evenly spaced."""
    across, up, step = 0.6, 0.18, 0.06
    xs, ys = np.arange(0.0, across, step), np.arange(0.0, up, step)
    below, right = [(x, 0.0) for x in xs], [(across, y) for y in ys]
    above, left = [(across - x, up) for x in xs], [(0.0, up - y) for y in ys]
    return np.array([*below, *right, *above, *left]) + np.array(centre) - (across / 2, up / 2)
