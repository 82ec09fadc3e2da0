"""What particles may not enter: walls, and each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import check_in, check_indices, refuse_if
from pbd_gym.physics.tables import Room, SelfCollision


class ContactBuilder(ParticleBuilder):
    """Collects walls and collisions."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._room = Room(np.full(dim, -np.inf), np.full(dim, np.inf), 0.0, 0.0, 0.0, 0.0)
        self._self_collision: SelfCollision | None = None

    def set_room(
        self,
        lower: Any,
        upper: Any,
        *,
        friction: float = 0.0,
        kinetic_friction: float | None = None,
        restitution: float = 0.0,
        radius: float = 0.0,
    ) -> None:
        """Enclose the world in axis-aligned walls (the seed's window).

        Args:
            lower: (dim,) [m], -inf for no wall.
            upper: (dim,) [m], +inf for no wall.
            friction: Coulomb coefficient of what sticks.
            kinetic_friction: Of what slides; the same where None.
            restitution: In [0, 1]; 0 stops, 1 returns the whole normal velocity.
            radius: Distance that particles keep from the walls [m].
        """
        corners = np.array(lower, dtype=np.float64), np.array(upper, dtype=np.float64)
        kinetic = friction if kinetic_friction is None else kinetic_friction
        self._room = Room(
            *corners, float(radius), float(restitution), float(friction), float(kinetic)
        )

    def set_ground(
        self,
        height: float = 0.0,
        *,
        friction: float = 0.0,
        kinetic_friction: float | None = None,
        restitution: float = 0.0,
        radius: float = 0.0,
    ) -> None:
        """Put a horizontal ground at a height [m]; the other arguments are those of `set_room`."""
        lower = np.full(self.dim, -np.inf)
        lower[-1] = height
        upper = np.full(self.dim, np.inf)
        self.set_room(
            lower,
            upper,
            friction=friction,
            kinetic_friction=kinetic_friction,
            restitution=restitution,
            radius=radius,
        )

    def set_self_collision(
        self, particles: Sequence[int] | np.ndarray, distance: float, *, friction: float = 0.0
    ) -> None:
        """Keep particles apart from each other.

        All pairs of up to 1024 particles can be near each other at once; of more particles, some
        hundreds of thousands of pairs, beyond which the last ones are not seen.

        Args:
            particles: Particles, each once.
            distance: That they keep [m]; at most the smallest distance as placed.
            friction: Coulomb coefficient between them.
        """
        self._self_collision = SelfCollision(
            as_indices(particles), float(distance), float(friction)
        )

    def _room_table(self) -> Room:
        room, shape = self._room, (self.dim,)
        if room.lower.shape != shape or room.upper.shape != shape:
            raise ValueError(
                f"walls have shapes {room.lower.shape} and {room.upper.shape}; expected {shape}"
            )
        check_in("wall radius", room.radius, 0.0, np.inf, "[m]")
        # written so that a NaN wall is refused too
        wrong = ~(room.lower + room.radius < room.upper - room.radius)
        allowed = f"it must lie below the upper walls {room.upper} [m]"
        refuse_if(wrong, "lower wall of axis", room.lower, allowed)
        check_in("restitution", room.restitution, 0.0, 1.0)
        check_in("friction", room.friction, 0.0, np.inf)
        check_in("kinetic friction", room.kinetic_friction, 0.0, room.friction)
        return room

    def _self_collision_table(self) -> SelfCollision | None:
        table = self._self_collision
        if table is None:
            return None
        check_in("self-collision distance", table.distance, 0.0, np.inf, "[m]")
        check_in("friction of self-collision", table.friction, 0.0, np.inf)
        particles = table.particles
        check_indices(particles, self._count, "particle of self-collision")
        if len(np.unique(particles)) != len(particles):
            raise ValueError(f"self-collision names a particle twice: {particles}")
        points = np.array(self._positions)[particles]
        for index in range(len(points) - 1):
            gaps = np.sqrt(((points[index + 1 :] - points[index]) ** 2).sum(axis=1))
            if gaps.min() < table.distance:
                raise ValueError(
                    f"self-collision distance is {table.distance}; particle {particles[index]} is "
                    f"placed {gaps.min()} m from another, and it may not be larger than that"
                )
        return table if table.distance > 0.0 else None
