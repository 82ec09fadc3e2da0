"""Which particles may not pass through each other: collisions of bodies that move."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import check_different, check_in, check_indices
from pbd_gym.physics.tables import Encounters

# Parts of one body that were placed closer than this many collision distances are neighbours: its
# own constraints hold them apart.
_NEIGHBOURHOOD = 3.0
# More would take longer to look through than a step has time. All of them have room in the lists.
_MOST = 1_000_000


class _Group(NamedTuple):
    """What was added by one call of `add_collision`."""

    particles: np.ndarray
    links: np.ndarray
    radius: float
    within: bool
    friction: float
    restitution: float


class EncounterBuilder(ParticleBuilder):
    """Collects bodies that collide with each other."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._groups: list[_Group] = []

    def add_collision(
        self,
        particles: Sequence[int] | np.ndarray,
        radius: float,
        *,
        links: Any = None,
        within: bool = False,
        friction: float = 0.0,
        restitution: float = 0.0,
    ) -> None:
        """Let a body collide with all others that are added so, and with itself if wanted.

        A body is made of balls (discs in the plane) around its particles, and of the links between
        them, as thick. Particles of one body do not pass its links, nor those of another: in the
        plane nothing passes then. In space two links could cross with their ends apart: r_a + r_b
        must be more than half of the shorter one, for any two links as placed. Links are no faces:
        balls pass the meshes of a net unless r_a + r_b is more than half its longest link.

        What collides keeps its momentum. What moves relatively by more than 2 (r_a + r_b) within a
        substep can pass unseen. What overlaps is let apart at 1 m/s and keeps no speed of that.
        Contacts are swept over until they are settled, up to `contact_sweeps` times a substep (see
        `build`): what stands by its friction stays. Particles do not turn.

        Args:
            particles: Of the body, each once and in no other body.
            radius: [m]. Bodies a and b keep r_a + r_b.
            links: (n, 2) pairs of the particles; None for separate balls.
            within: Let parts of the body collide too, where they were placed more than six radii
                from each other (separate balls: anywhere).
            friction: Coulomb coefficient; of two bodies the mean counts.
            restitution: In [0, 1]; of two bodies the mean counts.
        """
        members = as_indices(particles)
        pairs = np.zeros((0, 2), np.int64) if links is None else as_indices(links).reshape(-1, 2)
        numbers = float(radius), bool(within), float(friction), float(restitution)
        self._groups.append(_Group(members, pairs, *numbers))

    def _encounter_table(self, always: bool, sweeps: int) -> Encounters | None:
        groups = self._groups
        if not groups and not always:
            return None
        for index, group in enumerate(groups):
            _check(group, index, self._count)
        members = [group.particles for group in groups]
        movers = np.concatenate([np.zeros(0, np.int64), *members])
        unique, counts = np.unique(movers, return_counts=True)
        if (counts > 1).any():
            raise ValueError(
                f"particle {unique[counts > 1][0]} is named twice by add_collision; "
                "a particle collides as part of one body"
            )
        parts = [self._within(group) for group in groups if group.within]
        parts += [_between(*pair) for pair in combinations(groups, 2)]
        rows = np.concatenate([np.zeros((0, 6)), *parts])
        if not len(rows) and not always:
            return None
        if len(rows) > _MOST:
            raise ValueError(f"there are {len(rows)} possible encounters; allowed: {_MOST}")
        if self.dim == 3:
            self._check_that_links_do_not_cross()
        corners = rows[:, :3].astype(np.int64)
        points = np.array(self._positions)[corners]
        length = np.sqrt(np.sum((points[:, 1] - points[:, 2]) ** 2, axis=1))
        return Encounters(
            movers=unique,
            particles=corners[:, 0].copy(),
            links=corners[:, 1:].copy(),
            distance=rows[:, 3].copy(),
            reach=rows[:, 3] + length / 2.0,
            friction=rows[:, 4].copy(),
            restitution=rows[:, 5].copy(),
            sweeps=sweeps,
        )

    def _check_that_links_do_not_cross(self) -> None:
        """Refuse bodies in space whose links can pass each other between their ends.

        Where two links cross, an end of each is within half its length of the other link.
        """
        points = np.array(self._positions)
        longest = [_longest(points, group.links) for group in self._groups]
        for i, one in enumerate(self._groups):
            for j in range(i if one.within else i + 1, len(self._groups)):
                distance, shorter = one.radius + self._groups[j].radius, min(longest[i], longest[j])
                if shorter > 0.0 and distance <= shorter / 2.0:
                    raise ValueError(
                        f"collisions {i} and {j} keep {distance} m apart and have links of "
                        f"{shorter} m, which could cross; allowed: more than {shorter / 2.0} m"
                    )

    def _within(self, group: _Group) -> np.ndarray:
        """Return the encounters of a body with itself."""
        if not len(group.links):
            first, second = np.triu_indices(len(group.particles), 1)
            balls = group.particles[first], group.particles[second]
            return _rows(balls[0], np.stack([balls[1], balls[1]], axis=1), group, group)
        rows = _rows(*_all_with_all(group.particles, group.links), group, group)
        corners = np.array(self._positions)[rows[:, :3].astype(np.int64)]
        return rows[_gap(corners) >= _NEIGHBOURHOOD * 2.0 * group.radius]


def _check(group: _Group, index: int, count: int) -> None:
    check_indices(group.particles, count, f"particle of collision {index},")
    check_indices(group.links, count, f"ends of collision {index}, link")
    check_different(group.links, f"link of collision {index},")
    foreign = np.setdiff1d(group.links, group.particles)
    if len(foreign):
        raise ValueError(
            f"collision {index} links particle {foreign[0]}, which is not of the body; links join "
            "particles of the body"
        )
    check_in(f"radius of collision {index}", group.radius, 1e-9, np.inf, "[m]")
    check_in(f"friction of collision {index}", group.friction, 0.0, np.inf)
    check_in(f"restitution of collision {index}", group.restitution, 0.0, 1.0)


def _between(one: _Group, other: _Group) -> np.ndarray:
    """Return the encounters of two bodies: particles of each with links of the other."""
    parts = []
    for balls, lines in ((one, other), (other, one)):
        if len(lines.links):
            parts.append(_rows(*_all_with_all(balls.particles, lines.links), one, other))
    if not parts:
        balls = np.stack([other.particles, other.particles], axis=1)
        parts.append(_rows(*_all_with_all(one.particles, balls), one, other))
    return np.concatenate(parts)


def _all_with_all(particles: np.ndarray, links: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(particles, len(links)), np.tile(links, (len(particles), 1))


def _longest(points: np.ndarray, links: np.ndarray) -> float:
    """Return the length of the longest link as placed, 0 without links [m]."""
    ends = points[links]
    return float(np.sqrt(np.sum((ends[:, 0] - ends[:, 1]) ** 2, axis=1)).max(initial=0.0))


def _rows(particles: np.ndarray, links: np.ndarray, one: _Group, other: _Group) -> np.ndarray:
    """Return rows (M, 6): particle, ends of the link, distance, friction, restitution."""
    distance = one.radius + other.radius
    friction = (one.friction + other.friction) / 2.0
    restitution = (one.restitution + other.restitution) / 2.0
    shared = np.broadcast_to([distance, friction, restitution], (len(particles), 3))
    return np.column_stack([particles, links, shared])


def _gap(corners: np.ndarray) -> np.ndarray:
    """Return the distances (M,) of particles from links, corners (M, 3, dim)."""
    c, a, b = corners[:, 0], corners[:, 1], corners[:, 2]
    along = np.sum((c - a) * (b - a), axis=1) / np.sum((b - a) ** 2, axis=1)
    nearest = a + np.clip(along, 0.0, 1.0)[:, None] * (b - a)
    return np.sqrt(np.sum((c - nearest) ** 2, axis=1))
