"""What a Model is made of: one table per kind of constraint or contact.

A Model holds them as checked by `ModelBuilder.build`: float64 and int64, read-only. The kernels
read the same tables in the state's dtype, see parameters.py.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np


class Particles(NamedTuple):
    """Point masses, and what acts on all of them.

    Attributes:
        positions: As built, (N, dim) [m].
        inverse_mass: (N,) [1/kg]; 0 is a pinned particle, moved only by its target.
        pins: (P,) particles of inverse mass 0.
        grabbable: (G,) particles that can be pins in some worlds and free in others, or None.
        gravity: (dim,) [m/s2].
    """

    positions: Any
    inverse_mass: Any
    pins: Any
    grabbable: Any
    gravity: Any


class Chains(NamedTuple):
    """Links in a row, solved directly; C chains with L entries, chain after chain.

    Attributes:
        offsets: (C + 1,) first entry of each chain.
        particles: (L,) particle of each entry.
        rest: (L,) rest length of the link that starts at an entry [m]; a chain's last is unused.
        compliance: (L,) of a stretched link [m/N].
        greatest: (L,) length beyond which a link is cut short after all else [m].
        damping: (L,) rate at which the velocities of a link's ends approach each other [1/s].
    """

    offsets: Any
    particles: Any
    rest: Any
    compliance: Any
    greatest: Any
    damping: Any


class Ropes(NamedTuple):
    """Links in a row that stay stable under any tension; R ropes with L entries.

    Attributes:
        offsets: (R + 1,) first entry of each rope.
        particles: (L,) particle of each entry.
        rest: (L,) rest length of the link that starts at an entry [m]; a rope's last is unused.
        compliance: (L,) of a stretched link [m/N].
        slack: (R,) 1 where links may be shorter than their rest.
    """

    offsets: Any
    particles: Any
    rest: Any
    compliance: Any
    slack: Any


class Distances(NamedTuple):
    """Distances kept by sweeps.

    Attributes:
        pairs: (E, 2) particles.
        rest: (E,) [m].
        compliance: (E,) [m/N].
        stiffness: (E,) the seed's k in (0, 1].
    """

    pairs: Any
    rest: Any
    compliance: Any
    stiffness: Any


class Limits(NamedTuple):
    """Distances kept between bounds: slack ropes, tethers, strain limits.

    Attributes:
        pairs: (E, 2) particles.
        least: (E,) length below which they are pushed apart [m]; 0 for never.
        greatest: (E,) length beyond which they are pulled together [m]; +inf for never.
        compliance: (E,) [m/N].
    """

    pairs: Any
    least: Any
    greatest: Any
    compliance: Any


class Bends(NamedTuple):
    """Straight rest of three particles in a row.

    Attributes:
        triples: (B, 3) particles a, b, c with b between the others.
        compliance: (B,) l^3/EI [m/N].
        friction: (B,) limit of the dry friction of bending [N].
    """

    triples: Any
    compliance: Any
    friction: Any


class Rods(NamedTuple):
    """Bending of evenly spaced particles in a row, solved directly; R rods with L entries.

    Attributes:
        offsets: (R + 1,) first entry of each rod.
        particles: (L,) particle of each entry.
        rest: (L,) size of x_a - 2 x_b + x_c at rest, b at the entry [m]; in 2D positive where the
            rod turns left. A rod's first and last are unused.
        compliance: (L,) of that vector [m/N].
        curved: (R,) 1 where the rest is not straight.
    """

    offsets: Any
    particles: Any
    rest: Any
    compliance: Any
    curved: Any


class Hinges(NamedTuple):
    """Angles between two triangles that share an edge.

    Attributes:
        corners: (H, 4) the edge's two particles, then the triangles' other corners.
        cosine: (H,) of half the rest angle.
        sine: (H,) of half the rest angle.
        compliance: (H,) [rad/(N m)].
    """

    corners: Any
    cosine: Any
    sine: Any
    compliance: Any


class Folds(NamedTuple):
    """Flat rest of two triangles that share an edge, as a sum of their corners.

    Attributes:
        corners: (F, 4) the edge's two particles, then the triangles' other corners.
        weights: (F, 4) of the corners in that sum.
        compliance: (F,) [m2/(N m)].
    """

    corners: Any
    weights: Any
    compliance: Any


class Volumes(NamedTuple):
    """Closed outlines that keep their area (2D), closed surfaces that keep their volume (3D).

    Attributes:
        offsets: (V + 1,) first entry of each in `particles`.
        particles: Particles of each, once.
        facet_offsets: (V + 1,) first facet of each.
        facets: (F, dim) particles of each edge or triangle, oriented outwards.
        rest: (V,) signed area [m2] or volume [m3].
        compliance: (V,) -d area/d pressure [m3/N] or -d volume/d pressure [m5/N].
        least: (V,) least sum of inverse mass times gradient squared to divide by.
    """

    offsets: Any
    particles: Any
    facet_offsets: Any
    facets: Any
    rest: Any
    compliance: Any
    least: Any


class ShapeMatches(NamedTuple):
    """Bodies drawn to a rest shape that moves and turns with them.

    Attributes:
        offsets: (S + 1,) first entry of each body.
        particles: (L,) particle of each entry.
        weight: (L,) its share in the body's mass.
        rest: (L, dim) its place in the rest shape [m].
        softness: (S,) compliance times mass [s2]; 0 is rigid.
    """

    offsets: Any
    particles: Any
    weight: Any
    rest: Any
    softness: Any


class Attachments(NamedTuple):
    """Particles held at a fixed offset from another.

    Attributes:
        pairs: (A, 2) particle and anchor.
        offsets: (A, dim) position of the particle relative to the anchor [m].
        compliance: (A,) [m/N].
    """

    pairs: Any
    offsets: Any
    compliance: Any


class Room(NamedTuple):
    """Axis-aligned walls (the seed's window).

    Attributes:
        lower: (dim,) [m], -inf where there is no wall.
        upper: (dim,) [m], +inf where there is no wall.
        radius: Distance that particles keep from a wall [m].
        restitution: In [0, 1].
        friction: Coulomb coefficient of what sticks.
        kinetic_friction: Coulomb coefficient of what slides.
    """

    lower: Any
    upper: Any
    radius: Any
    restitution: Any
    friction: Any
    kinetic_friction: Any


class Colliders(NamedTuple):
    """C solid shapes that particles may not enter, static or carried by pins.

    Attributes:
        kinds: (C,) 0 plane, 1 box, 2 capsule; a sphere is a capsule whose ends coincide.
        pins: (C, 2) pins that carry the start and the end; -1 where it is static.
        starts: (C, dim) point of a plane, centre of a box, end of a capsule; from the pin [m].
        ends: (C, dim) other end of a capsule; from the second pin [m].
        axes: (C, dim * dim) unit axes of a box, one after another; normal of a plane.
        sizes: (C, dim) half extents of a box; the first is the radius of a capsule [m].
        margin: (C,) distance that particles keep from the surface [m].
        restitution: (C,) in [0, 1].
        friction: (C,) Coulomb coefficient of what sticks.
        kinetic_friction: (C,) Coulomb coefficient of what slides.
    """

    kinds: Any
    pins: Any
    starts: Any
    ends: Any
    axes: Any
    sizes: Any
    margin: Any
    restitution: Any
    friction: Any
    kinetic_friction: Any


class SelfCollision(NamedTuple):
    """Particles that keep their distance from each other.

    Attributes:
        particles: (S,) particles.
        distance: That they keep [m].
        friction: Coulomb coefficient between them.
    """

    particles: Any
    distance: Any
    friction: Any


class Encounters(NamedTuple):
    """M particles that keep a distance from links between others.

    Attributes:
        movers: (S,) all particles that occur.
        particles: (M,) particles.
        links: (M, 2) ends of the link; twice the same for a particle.
        distance: (M,) that is kept [m].
        reach: (M,) distance and half of the link's length as placed [m].
        friction: (M,) Coulomb coefficient.
        restitution: (M,) in [0, 1].
        sweeps: Most sweeps over them in a substep.
    """

    movers: Any
    particles: Any
    links: Any
    distance: Any
    reach: Any
    friction: Any
    restitution: Any
    sweeps: int


def entries_of_links(table: Chains | Ropes) -> np.ndarray:
    """Return the entries of chains or ropes at which a link starts, (links,)."""
    last = np.zeros(len(table.particles), dtype=bool)
    last[table.offsets[1:] - 1] = True
    return np.flatnonzero(~last)


def entries_of_joints(table: Rods) -> np.ndarray:
    """Return the entries of rods at which they bend, all but the first and last of each."""
    inner = np.ones(len(table.particles), dtype=bool)
    inner[table.offsets[:-1]] = False
    inner[table.offsets[1:] - 1] = False
    return np.flatnonzero(inner)


def links_in_rows(table: Chains | Ropes) -> tuple[np.ndarray, np.ndarray]:
    """Return the links of chains or ropes: their particles (links, 2) and rest lengths [m]."""
    entries = entries_of_links(table)
    pairs = np.stack([table.particles[entries], table.particles[entries + 1]], axis=1)
    return pairs, table.rest[entries]
