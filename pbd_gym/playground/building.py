"""From a Drawing to a Model."""

from __future__ import annotations

from itertools import groupby, pairwise
from typing import Any

import numpy as np

from pbd_gym import physics
from pbd_gym.physics import Linkage, Mesh, Model, ModelBuilder, Net, Polygon, Sheet, Strand
from pbd_gym.playground.drawing import RIGID, Drawing, Fabric

# All drawings of one number of axes share one compiled variant, however they are edited.
_KINDS = ("colliders", "encounters", "grabs", "solids")
_ITERATIONS = 2  # a chain that is swung hard keeps its length with two
_CONTACT_SWEEPS = 8  # a heap of 1000 balls is quick enough to play with, and creeps unseen
_AREA_MODULUS = 2e3  # of soft bodies [N/m]
_BULK_MODULUS = 2e4  # [Pa]
_NET_RADIUS = 0.002  # of struts, drawn [m]

Pair = tuple[int, int]


def build_model(drawing: Drawing, integrator: str) -> Model:
    """Return the Model of a drawing; its particles have the drawing's indices.

    Args:
        drawing: The scene.
        integrator: "pbd" or "rattle".

    Raises:
        ValueError: Naming what cannot be, as `ModelBuilder.build` does.
    """
    builder = ModelBuilder(drawing.dim)
    for (mass, pinned), group in groupby(drawing.particles, lambda p: (p.mass, p.pinned)):
        builder.add_particles([p.position for p in group], mass, pinned=pinned)
    _add_links(builder, drawing)
    _add_solids(builder, drawing)
    _add_contacts(builder, drawing)
    _add_looks(builder, drawing)
    builder.make_grabbable([i for i, p in enumerate(drawing.particles) if not p.pinned])
    gravity = np.zeros(drawing.dim)
    gravity[-1] = -drawing.settings.gravity
    return builder.build(
        gravity=gravity,
        damping=drawing.settings.damping,
        integrator=integrator,
        iterations=_ITERATIONS,
        contact_sweeps=_CONTACT_SWEEPS,
        kinds=_KINDS,
    )


def links_of(drawing: Drawing) -> list[Pair]:
    """Return the pairs of particles that are linked, each once: what a stroke can cut."""
    pairs = [pair for thread in drawing.threads for pair in pairwise(thread.particles)]
    pairs += [strut.particles for strut in drawing.struts]
    for outline in drawing.outlines:
        pairs += edges_around(outline.particles)
    for skin in drawing.skins:
        pairs += edges_of(skin.triangles)
    return pairs


def edges_around(ring: tuple[int, ...]) -> list[Pair]:
    """Return the edges of a closed line, the last one back to the start."""
    return list(zip(ring, (*ring[1:], ring[0]), strict=True))


def edges_of(triangles: tuple[tuple[int, int, int], ...]) -> list[Pair]:
    """Return the edges of triangles, each once."""
    around = (edge for triangle in triangles for edge in edges_around(triangle))
    return sorted({as_pair(i, j) for i, j in around})


def as_pair(i: int, j: int) -> Pair:
    """Return a pair in ascending order."""
    return (i, j) if i < j else (j, i)


def _softness(drawing: Drawing) -> float:
    """Return the compliance of a metre of link [1/N]."""
    stiffness = drawing.settings.stiffness
    return 0.0 if stiffness >= RIGID else 10.0**-stiffness


def _add_links(builder: ModelBuilder, drawing: Drawing) -> None:
    soft = _softness(drawing)
    for thread in drawing.threads:
        mean = float(np.mean(thread.rest))
        builder.add_chain(thread.particles, rest=thread.rest, compliance=soft * mean)
    for strut in drawing.struts:
        compliance = strut.compliance + soft * strut.rest
        builder.add_distance(*strut.particles, rest=strut.rest, compliance=compliance)


def _add_solids(builder: ModelBuilder, drawing: Drawing) -> None:
    soft = max(_softness(drawing), 0.02)  # a soft body with a rigid outline would not be soft
    position = np.array([p.position for p in drawing.particles])
    for outline in drawing.outlines:
        ring = edges_around(outline.particles)
        for i, j in ring[::2] + ring[1::2]:  # solved once around, the body would roll by itself
            rest = float(np.linalg.norm(position[i] - position[j]))
            builder.add_distance(i, j, rest=rest, compliance=soft * rest)
        builder.add_area(outline.particles, compliance=1.0 / _AREA_MODULUS)
        builder.add_shape_match(outline.particles, compliance=1.0 / outline.shape_stiffness)
    for skin in drawing.skins:
        for i, j in edges_of(skin.triangles):
            rest = float(np.linalg.norm(position[i] - position[j]))
            builder.add_distance(i, j, rest=rest, compliance=soft * rest)
        builder.add_volume(skin.triangles, compliance=1.0 / _BULK_MODULUS)
        corners = sorted({corner for triangle in skin.triangles for corner in triangle})
        builder.add_shape_match(corners, compliance=1.0 / skin.shape_stiffness)


def _add_contacts(builder: ModelBuilder, drawing: Drawing) -> None:
    settings = drawing.settings
    surface: dict[str, Any] = {
        "friction": settings.friction,
        "restitution": settings.restitution,
    }
    lower, upper = (np.array(corner, dtype=np.float64) for corner in drawing.view)
    radius = max((group.radius for group in drawing.balls), default=0.01)
    if drawing.walls:
        builder.set_room(lower, upper, radius=radius, **surface)
    else:
        builder.set_ground(lower[-1], radius=radius, **surface)
    for obstacle in drawing.obstacles:
        if obstacle.kind == "ball":
            builder.add_sphere(obstacle.centre, obstacle.size[0], margin=radius, **surface)
        else:
            builder.add_box(obstacle.centre, obstacle.size, margin=radius, **surface)
    for group in drawing.balls:
        builder.add_collision(group.particles, group.radius, within=True, **surface)
    for outline in drawing.outlines:
        ring = edges_around(outline.particles)
        builder.add_collision(outline.particles, outline.radius, links=ring, **surface)


def _add_looks(builder: ModelBuilder, drawing: Drawing) -> None:
    """Tell the renderer what to draw."""
    links = {as_pair(i, j) for i, j in links_of(drawing)} if drawing.fabrics else set()
    covered: set[Pair] = set()
    for fabric in drawing.fabrics:
        holes = _holes(fabric, links, covered)
        builder.add_body(Sheet(fabric.rows, 0.002, holes))
    _add_lines(builder, drawing, covered)
    for outline in drawing.outlines:
        builder.add_body(Polygon(outline.particles, outline.radius))
    for skin in drawing.skins:
        builder.add_body(Mesh(skin.triangles))
    for group in drawing.balls:
        builder.add_body(physics.Balls(group.particles, group.radius))


def _add_lines(builder: ModelBuilder, drawing: Drawing, covered: set[Pair]) -> None:
    """Tell the renderer to draw threads and struts that no fabric covers."""
    net: list[tuple[int, ...]] = [strut.particles for strut in drawing.struts if strut.shown]
    for thread in drawing.threads:
        if thread.look == "rope":
            builder.add_body(Strand(thread.particles, thread.radius))
        elif thread.look == "rods":
            builder.add_body(Linkage(thread.particles, thread.radius))
        elif thread.look == "thread":
            net.append(thread.particles)
        else:
            bare = (pair for pair in pairwise(thread.particles) if as_pair(*pair) not in covered)
            net += bare
    if net:
        builder.add_body(Net(tuple(net), _NET_RADIUS))


def _holes(fabric: Fabric, links: set[Pair], covered: set[Pair]) -> tuple[Pair, ...]:
    """Return the cells of a fabric that lack an edge, and note the edges of all others."""
    holes = []
    for row, (upper, lower) in enumerate(pairwise(fabric.rows)):
        cells = zip(pairwise(upper), pairwise(lower), strict=True)
        for column, ((a, b), (d, c)) in enumerate(cells):
            edges = {as_pair(i, j) for i, j in edges_around((a, b, c, d))}
            if edges <= links:
                covered |= edges
            else:
                holes.append((row, column))
    return tuple(holes)
