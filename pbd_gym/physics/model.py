"""What does not change while time runs: the Model."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from pbd_gym.physics.bodies import Body
from pbd_gym.physics.tables import (
    Attachments,
    Bends,
    Chains,
    Colliders,
    Distances,
    Encounters,
    Folds,
    Hinges,
    Limits,
    Particles,
    Rods,
    Room,
    Ropes,
    SelfCollision,
    ShapeMatches,
    Volumes,
    links_in_rows,
)


@dataclass(frozen=True, eq=False)
class Model:
    """Masses, constraints, walls and gravity of one world. Immutable; made by `ModelBuilder.build`.

    Attributes:
        dim: Number of space axes, 2 or 3; the last points up.
        damping: Rate at which free velocities decay [1/s].
        integrator: "pbd" (first order, the seed thesis) or "rattle" (second order).
        iterations: Projections of the rigid constraints in a substep.
        particles: Point masses, pins and gravity.
        chains: Links in a row, solved directly.
        ropes: Chains that stay stable under any tension and may be slack, or None.
        distances: Distances kept by sweeps.
        limits: Distances kept between bounds, or None.
        bends: Bends with a straight rest.
        rods: Rows of particles whose bending is solved directly, or None.
        hinges: Angles between triangles, or None.
        folds: Pairs of triangles that are flat at rest, or None.
        volumes: Areas (2D) or volumes (3D) that are kept, or None.
        shape_matches: Bodies that keep their shape, or None.
        attachments: Particles held at an offset from another, or None.
        room: Walls.
        colliders: Solid shapes, or None.
        self_collision: Particles that keep their distance, or None.
        encounters: Particles that keep a distance from links of others, or None.
        bodies: What a renderer draws.
        fingerprint: SHA-256 of all but the bodies.
    """

    dim: int
    damping: float
    integrator: str
    iterations: int
    particles: Particles
    chains: Chains
    ropes: Ropes | None
    distances: Distances
    limits: Limits | None
    bends: Bends
    rods: Rods | None
    hinges: Hinges | None
    folds: Folds | None
    volumes: Volumes | None
    shape_matches: ShapeMatches | None
    attachments: Attachments | None
    room: Room
    colliders: Colliders | None
    self_collision: SelfCollision | None
    encounters: Encounters | None
    bodies: tuple[Body, ...]
    fingerprint: str = field(init=False)

    def __post_init__(self) -> None:
        self._freeze()
        digest = hashlib.sha256()
        for name, value in self._values():
            if isinstance(value, np.ndarray):
                digest.update(f"{name}{value.dtype}{value.shape}".encode() + value.tobytes())
            else:
                digest.update(f"{name}={value!r}".encode())
        object.__setattr__(self, "fingerprint", digest.hexdigest())

    def _values(self) -> Iterator[tuple[str, Any]]:
        """Yield everything by name that the motion depends on, tables field by field."""
        for spec in fields(self):
            if not spec.init or spec.name == "bodies":
                continue
            value = getattr(self, spec.name)
            if hasattr(value, "_asdict"):
                for name, part in value._asdict().items():
                    yield f"{spec.name}.{name}", part
            else:
                yield spec.name, value

    def _freeze(self) -> None:
        """Make the arrays read-only."""
        for _, value in self._values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        # numpy does not pickle the read-only flag
        self.__dict__.update(state)
        self._freeze()

    @property
    def positions(self) -> np.ndarray:
        """Positions in which the model was built, (N, dim) [m]."""
        return self.particles.positions

    @property
    def inverse_mass(self) -> np.ndarray:
        """(N,) [1/kg]; 0 is a pinned particle."""
        return self.particles.inverse_mass

    @property
    def pins(self) -> np.ndarray:
        """Pinned particles, (P,), moved only by their targets."""
        return self.particles.pins

    @property
    def grabbable(self) -> np.ndarray:
        """Particles that a World can grab and release, (G,), in the order of `World.grabbed`."""
        grabbable = self.particles.grabbable
        return np.zeros(0, dtype=np.int64) if grabbable is None else grabbable

    @property
    def gravity(self) -> np.ndarray:
        """(dim,) [m/s2]."""
        return self.particles.gravity

    @property
    def num_particles(self) -> int:
        """Number of particles N."""
        return len(self.inverse_mass)

    def links(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the links of all chains: their particles (links, 2) and rest lengths [m]."""
        pairs, rest = links_in_rows(self.chains)
        if self.ropes is None:
            return pairs, rest
        of_ropes, rest_of_ropes = links_in_rows(self.ropes)
        return np.concatenate([pairs, of_ropes]), np.concatenate([rest, rest_of_ropes])
