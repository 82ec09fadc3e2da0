"""What the tools do to a drawing: pin, cut, draw. All return a new one; no particle moves place.

Particles are only ever added at the end, so that those that were there keep their indices.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pbd_gym.playground.building import Pair, as_pair, edges_around, edges_of, links_of
from pbd_gym.playground.drawing import Balls, Drawing, Outline, Particle, Skin, Strut, Thread

_MASS = 0.01  # of a drawn particle [kg]


def toggle_pin(drawing: Drawing, index: int) -> Drawing:
    """Return the drawing with a particle pinned, or free if it was pinned."""
    particle = drawing.particles[index]
    return _with_particle(drawing, index, replace(particle, pinned=not particle.pinned))


def crossed_links(drawing: Drawing, pixels: np.ndarray, stroke: np.ndarray) -> set[Pair]:
    """Return the links that a stroke crosses on the screen.

    Args:
        drawing: Whose links they are.
        pixels: Where its particles are seen, (N, 2); a link of one that is not finite is never cut.
        stroke: The two ends of a piece of the stroke, (2, 2) [pixels].
    """
    pairs = np.array(links_of(drawing), dtype=np.int64).reshape(-1, 2)
    a, b = pixels[pairs[:, 0]], pixels[pairs[:, 1]]
    p, q = stroke
    with np.errstate(invalid="ignore"):
        parts_link = _side(p, q, a) * _side(p, q, b) < 0.0
        parts_stroke = _side(a, b, p) * _side(a, b, q) < 0.0
    return {as_pair(int(i), int(j)) for i, j in pairs[parts_link & parts_stroke]}


def cut(drawing: Drawing, links: Collection[Pair]) -> Drawing:
    """Return the drawing without these links.

    A thread falls into two. A closed body bursts: what is left of it are its edges.
    """
    gone = {as_pair(i, j) for i, j in links}
    threads = [part for thread in drawing.threads for part in _pieces(thread, gone)]
    outlines: list[Outline] = []
    for outline in drawing.outlines:
        ring = edges_around(outline.particles)
        at = next((k for k, edge in enumerate(ring) if as_pair(*edge) in gone), None)
        if at is None:
            outlines.append(outline)
        else:
            threads += _pieces(_opened(drawing, outline, at), gone)
    skins: list[Skin] = []
    struts = [strut for strut in drawing.struts if as_pair(*strut.particles) not in gone]
    for skin in drawing.skins:
        edges = edges_of(skin.triangles)
        if gone.isdisjoint(edges):
            skins.append(skin)
        else:
            struts += [_strut(drawing, edge) for edge in edges if edge not in gone]
    return replace(
        drawing,
        threads=tuple(threads),
        struts=tuple(struts),
        outlines=tuple(outlines),
        skins=tuple(skins),
    )


def draw_line(
    drawing: Drawing,
    points: np.ndarray,
    start: int | None = None,
    end: int | None = None,
) -> Drawing:
    """Return the drawing with a rope along points.

    Args:
        drawing: To which it is added.
        points: Of the whole rope, (M, dim) [m].
        start: Particle that is its first point, or None for a new one.
        end: Particle that is its last point, or None.
    """
    first, last = int(start is not None), len(points) - int(end is not None)
    particles, fresh = _added(drawing, points[first:last])
    row = [i for i in (start, *fresh, end) if i is not None]
    grown = replace(drawing, particles=particles)
    if len(row) < 2 or (len(row) == 2 and as_pair(row[0], row[1]) in _linked(drawing)):
        return grown
    rest = list(map(float, np.linalg.norm(np.diff(points, axis=0), axis=1)))
    if start is not None and start == end:  # a chain that is solved directly must be open
        closing = Strut((row[-2], row[-1]), rest.pop())
        grown = replace(grown, struts=(*drawing.struts, closing))
        row.pop()
    return replace(grown, threads=(*drawing.threads, Thread(tuple(row), tuple(rest))))


def draw_ball(drawing: Drawing, point: np.ndarray, radius: float = 0.03) -> Drawing:
    """Return the drawing with a ball at a point (dim,) [m] that collides with other balls."""
    particles, (ball,) = _added(drawing, point[None])
    groups = [group for group in drawing.balls if group.radius != radius]
    alike = [i for group in drawing.balls if group.radius == radius for i in group.particles]
    balls = (*groups, Balls((*alike, ball), radius))
    return replace(drawing, particles=particles, balls=balls)


def draw_outline(drawing: Drawing, points: np.ndarray) -> Drawing:
    """Return the drawing with a soft body within a closed line of points (M, 2) [m]."""
    particles, fresh = _added(drawing, points)
    outlines = (*drawing.outlines, Outline(tuple(fresh)))
    return replace(drawing, particles=particles, outlines=outlines)


def resample(points: np.ndarray, spacing: float, *, closed: bool = False) -> np.ndarray:
    """Return points (K, dim) evenly along a line through points (M, dim), about `spacing` apart.

    Both ends are kept; of a closed line the end is left out, as it is the start.
    """
    if closed:
        points = np.concatenate([points, points[:1]])
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(length)])
    count = max(round(along[-1] / spacing), 3 if closed else 1) + 1
    places = np.linspace(0.0, along[-1], count)
    even = np.column_stack([np.interp(places, along, axis) for axis in points.T])
    return even[:-1] if closed else even


def _with_particle(drawing: Drawing, index: int, particle: Particle) -> Drawing:
    particles = (*drawing.particles[:index], particle, *drawing.particles[index + 1 :])
    return replace(drawing, particles=particles)


def _added(drawing: Drawing, points: np.ndarray) -> tuple[tuple[Particle, ...], list[int]]:
    """Return all particles with new ones at the end, and the indices of those."""
    new = [Particle(tuple(map(float, point)), _MASS) for point in points]
    first = len(drawing.particles)
    return (*drawing.particles, *new), list(range(first, first + len(new)))


def _linked(drawing: Drawing) -> set[Pair]:
    return {as_pair(i, j) for i, j in links_of(drawing)}


def _pieces(thread: Thread, gone: set[Pair]) -> list[Thread]:
    """Return what is left of a thread; a single particle is no thread any more."""
    pieces, first = [], 0
    for link, (i, j) in enumerate(pairwise(thread.particles)):
        if as_pair(i, j) in gone:
            pieces.append((first, link + 1))
            first = link + 1
    pieces.append((first, len(thread.particles)))
    if len(pieces) == 1:
        return [thread]
    return [
        replace(thread, particles=thread.particles[a:b], rest=thread.rest[a : b - 1])
        for a, b in pieces
        if b - a > 1
    ]


def _opened(drawing: Drawing, outline: Outline, at: int) -> Thread:
    """Return the edges of an outline without the one at an index, as a thread."""
    row = (*outline.particles[at + 1 :], *outline.particles[: at + 1])
    rest = [_rest(drawing, edge) for edge in pairwise(row)]
    return Thread(row, tuple(rest), radius=outline.radius)


def _strut(drawing: Drawing, edge: Pair) -> Strut:
    return Strut(edge, _rest(drawing, edge))


def _rest(drawing: Drawing, edge: Pair) -> float:
    a, b = (np.array(drawing.particles[i].position) for i in edge)
    return float(np.linalg.norm(a - b))


def _side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return on which side of the line from p to q the point r lies: positive on one, by sign."""
    u, w = q - p, r - p
    return u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]
