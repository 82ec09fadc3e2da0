"""What does not change while time runs: the Model, and the ModelBuilder that makes it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any

import numpy as np

from pbd_gym.physics.checks import check_model

INTEGRATORS = ("pbd", "rattle")


@dataclass(frozen=True)
class Strand:
    """A rope or chain, drawn as one line: particle indices in order and its radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Linkage:
    """Rods with a bob at every free end: a pendulum. Particle indices in order, rod radius [m]."""

    particles: tuple[int, ...]
    radius: float


@dataclass(frozen=True)
class Sheet:
    """A rectangular cloth: rows x columns of particle indices, and its half thickness [m]."""

    particles: tuple[tuple[int, ...], ...]
    radius: float


Body = Strand | Linkage | Sheet


@dataclass(frozen=True, eq=False)
class Model:
    """Masses, constraints, walls and gravity of one world. Immutable; made by `ModelBuilder.build`.

    N particles, P pins, C chains with L chain entries, E distance constraints, B bends, `dim` axes
    of which the last points up. Every array is float64 or int64 and read-only.

    Attributes:
        dim: Number of space axes, 2 or 3.
        positions: Positions in which the model was built, (N, dim) [m].
        inverse_mass: (N,) [1/kg]; 0 is a pinned particle, moved only by its target.
        gravity: (dim,) [m/s2].
        damping: Rate at which free velocities decay [1/s].
        integrator: "pbd" (first order, the seed thesis) or "rattle" (second order).
        iterations: Projections of the rigid constraints in a substep.
        chain_offsets: (C + 1,) first entry of each chain in `chain_particles`.
        chain_particles: (L,) particle of each chain entry, chain after chain.
        link_rest: (L,) rest length of the link that starts at an entry [m]; the last is unused.
        link_compliance: (L,) of a stretched link [m/N].
        link_greatest_length: (L,) beyond which a link is cut short after all else [m].
        distance_pairs: (E, 2) particles.
        distance_rest: (E,) [m].
        distance_compliance: (E,) [m/N].
        distance_stiffness: (E,) the seed's k in (0, 1].
        bend_triples: (B, 3) particles a, b, c with b between the others.
        bend_compliance: (B,) l^3/EI [m/N].
        bend_friction: (B,) limit of the dry friction of bending [N].
        lower: (dim,) walls [m], -inf where there is none.
        upper: (dim,) walls [m], +inf where there is none.
        wall_radius: Distance that particles keep from a wall [m].
        restitution: Of walls, in [0, 1].
        friction: Coulomb coefficient of walls.
        collision_particles: (S,) particles that may not come closer to each other than
            `collision_distance`.
        collision_distance: [m]; 0 switches self-collision off.
        bodies: What a renderer draws.
    """

    dim: int
    positions: np.ndarray
    inverse_mass: np.ndarray
    gravity: np.ndarray
    damping: float
    integrator: str
    iterations: int
    chain_offsets: np.ndarray
    chain_particles: np.ndarray
    link_rest: np.ndarray
    link_compliance: np.ndarray
    link_greatest_length: np.ndarray
    distance_pairs: np.ndarray
    distance_rest: np.ndarray
    distance_compliance: np.ndarray
    distance_stiffness: np.ndarray
    bend_triples: np.ndarray
    bend_compliance: np.ndarray
    bend_friction: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    wall_radius: float
    restitution: float
    friction: float
    collision_particles: np.ndarray
    collision_distance: float
    bodies: tuple[Body, ...]
    pins: np.ndarray = field(init=False)
    fingerprint: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pins", np.flatnonzero(self.inverse_mass == 0.0))
        self._freeze()
        digest = hashlib.sha256()
        for spec in fields(self):
            if not spec.init or spec.name == "bodies":
                continue
            value = getattr(self, spec.name)
            if isinstance(value, np.ndarray):
                digest.update(f"{spec.name}{value.dtype}{value.shape}".encode() + value.tobytes())
            else:
                digest.update(f"{spec.name}={value!r}".encode())
        object.__setattr__(self, "fingerprint", digest.hexdigest())

    def _freeze(self) -> None:
        """Make the arrays read-only."""
        for spec in fields(self):
            value = getattr(self, spec.name, None)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        # numpy does not pickle the read-only flag
        self.__dict__.update(state)
        self._freeze()

    @property
    def num_particles(self) -> int:
        """Number of particles N."""
        return len(self.inverse_mass)

    def links(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the links of all chains: their particles (links, 2) and rest lengths [m]."""
        last = np.zeros(len(self.chain_particles), dtype=bool)
        last[self.chain_offsets[1:] - 1] = True
        entries = np.flatnonzero(~last)
        pairs = np.stack([self.chain_particles[entries], self.chain_particles[entries + 1]], 1)
        return pairs, self.link_rest[entries]


class ModelBuilder:
    """Collects particles and what holds between them; `build` checks it all and returns a Model.

    Args:
        dim: Number of space axes, 2 or 3. The last axis points up.
    """

    def __init__(self, dim: int) -> None:
        if dim not in (2, 3):
            raise ValueError(f"dim is {dim!r}; a model has 2 or 3 axes")
        self.dim = dim
        self._positions: list[np.ndarray] = []
        self._masses: list[float] = []
        self._pinned: list[bool] = []
        self._chains: list[tuple[np.ndarray, np.ndarray, float, float]] = []
        self._distances: list[tuple[int, int, float, float, float]] = []
        self._bends: list[tuple[int, int, int, float, float]] = []
        self._walls: dict[str, Any] = {
            "lower": np.full(dim, -np.inf),
            "upper": np.full(dim, np.inf),
            "wall_radius": 0.0,
            "restitution": 0.0,
            "friction": 0.0,
        }
        self._collision: tuple[np.ndarray, float] = (np.zeros(0, dtype=np.int64), 0.0)
        self._bodies: list[Body] = []

    def add_particles(self, positions: Any, mass: float, *, pinned: bool = False) -> np.ndarray:
        """Add particles of one mass and return their indices.

        Args:
            positions: (n, dim), or (dim,) for a single particle [m].
            mass: Of each particle [kg].
            pinned: Hold them: they move only by targets. The mass has no effect then.

        Raises:
            ValueError: If the positions do not have `dim` coordinates.
        """
        points = np.atleast_2d(np.array(positions, dtype=np.float64))
        if points.ndim != 2 or points.shape[1] != self.dim:
            raise ValueError(
                f"positions have shape {np.shape(positions)}; expected (n, {self.dim})"
            )
        first = len(self._masses)
        self._positions.extend(points)
        self._masses.extend([float(mass)] * len(points))
        self._pinned.extend([pinned] * len(points))
        return np.arange(first, first + len(points))

    def pin(self, particles: int | Iterable[int]) -> None:
        """Pin particles that were added before: from now on only targets move them.

        Raises:
            ValueError: If a particle does not exist.
        """
        for particle in np.atleast_1d(np.asarray(particles)):
            if not 0 <= particle < len(self._pinned):
                raise ValueError(f"cannot pin particle {particle}: there are {len(self._pinned)}")
            self._pinned[particle] = True

    def add_chain(
        self,
        particles: Sequence[int] | np.ndarray,
        *,
        rest: Any = None,
        compliance: float = 0.0,
        strain_limit: float = np.inf,
    ) -> None:
        """Link particles in a row; all links of the chain are solved together, directly.

        Args:
            particles: Two or more particle indices, in order.
            rest: Rest length of the links [m], one or one each; as placed where None.
            compliance: Of a link under tension [m/N]; 0 is inextensible.
            strain_limit: Strain beyond which a link is cut short whatever pulls on it; +inf for no
                limit. For cloth, whose crossing threads are solved in turn.
        """
        entries = _indices(particles)
        if rest is None:
            lengths = [self._length(i, j) for i, j in pairwise(entries)]
        else:
            lengths = np.broadcast_to(
                np.asarray(rest, dtype=np.float64), (max(len(entries) - 1, 0),)
            )
        self._chains.append((entries, np.array(lengths), float(compliance), float(strain_limit)))

    def add_distance(
        self,
        i: int,
        j: int,
        *,
        rest: float | None = None,
        compliance: float = 0.0,
        stiffness: float = 1.0,
    ) -> None:
        """Keep two particles at a distance, solved by Gauss-Seidel sweeps.

        Args:
            i: First particle.
            j: Second particle.
            rest: Rest length [m]; as placed where None.
            compliance: Inverse of the spring stiffness [m/N]; 0 is rigid.
            stiffness: The seed thesis' k in (0, 1], the share of the error that a projection
                removes. It depends on the time step: in a substep of h seconds k acts as the
                compliance h^2 (w_i + w_j) (1 - k) / k.
        """
        length = self._length(i, j) if rest is None else float(rest)
        self._distances.append((int(i), int(j), length, float(compliance), float(stiffness)))

    def add_bend(self, a: int, b: int, c: int, *, compliance: float, friction: float = 0.0) -> None:
        """Resist bending at b: the vector x_a - 2 x_b + x_c is drawn to zero (straight rest).

        Args:
            a: Neighbour of b.
            b: Particle in the middle.
            c: Other neighbour of b.
            compliance: l^3 / EI [m/N] for neighbours l apart and a bending stiffness EI [N m2].
            friction: Force up to which dry friction holds the bend as it is [N].
        """
        self._bends.append((int(a), int(b), int(c), float(compliance), float(friction)))

    def set_room(
        self,
        lower: Any,
        upper: Any,
        *,
        friction: float = 0.0,
        restitution: float = 0.0,
        radius: float = 0.0,
    ) -> None:
        """Enclose the world in axis-aligned walls (the seed's window).

        Args:
            lower: (dim,) [m], -inf for no wall.
            upper: (dim,) [m], +inf for no wall.
            friction: Coulomb coefficient, static and kinetic.
            restitution: In [0, 1]; 0 stops, 1 returns the whole normal velocity.
            radius: Distance that particles keep from the walls [m].
        """
        self._walls = {
            "lower": np.array(lower, dtype=np.float64),
            "upper": np.array(upper, dtype=np.float64),
            "wall_radius": float(radius),
            "restitution": float(restitution),
            "friction": float(friction),
        }

    def set_ground(
        self,
        height: float = 0.0,
        *,
        friction: float = 0.0,
        restitution: float = 0.0,
        radius: float = 0.0,
    ) -> None:
        """Put a horizontal ground at a height [m]; the other arguments are those of `set_room`."""
        lower = np.full(self.dim, -np.inf)
        lower[-1] = height
        upper = np.full(self.dim, np.inf)
        self.set_room(lower, upper, friction=friction, restitution=restitution, radius=radius)

    def set_self_collision(self, particles: Sequence[int] | np.ndarray, distance: float) -> None:
        """Keep particles `distance` [m] apart, at most the smallest distance as placed."""
        self._collision = (_indices(particles), float(distance))

    def add_body(self, body: Body) -> None:
        """Tell a renderer what to draw."""
        self._bodies.append(body)

    def build(
        self,
        *,
        gravity: Any = None,
        damping: float = 0.0,
        integrator: str = "pbd",
        iterations: int = 1,
    ) -> Model:
        """Check everything that was added and return the Model.

        Args:
            gravity: (dim,) [m/s2]; 9.81 downwards where None.
            damping: Rate at which free velocities decay [1/s].
            integrator: "pbd": positions are projected along the current constraint direction and
                velocities read off (first order, dissipates like backward Euler). "rattle": chains
                and distances are projected along the direction at the start of the substep, then
                velocities too (second order, keeps energy); for pendulums and short chains.
            iterations: Projections of rigid constraints in a substep. A compliant constraint
                receives its force in the first and keeps it.

        Raises:
            ValueError: Naming the index and the value of what cannot be.
        """
        if gravity is None:
            gravity = np.zeros(self.dim)
            gravity[-1] = -9.81
        masses = np.array(self._masses, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse_mass = np.where(self._pinned, 0.0, 1.0 / masses)
        with np.errstate(invalid="ignore"):  # a rest length of 0 is refused below
            greatest = [rest * (1.0 + limit) for _, rest, _, limit in self._chains]
        # A chain of n particles has n - 1 links; the entry of its last particle holds a dummy.
        rests = [np.append(rest, 1.0) for _, rest, _, _ in self._chains]
        sizes = [len(entries) for entries, *_ in self._chains]
        pairs = np.array([row[:2] for row in self._distances], dtype=np.int64).reshape(-1, 2)
        distances = np.array([row[2:] for row in self._distances], dtype=np.float64).reshape(-1, 3)
        columns: dict[str, Any] = {
            "positions": np.array(self._positions, dtype=np.float64).reshape(-1, self.dim),
            "inverse_mass": inverse_mass,
            "gravity": np.array(gravity, dtype=np.float64),
            "chain_offsets": np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            "chain_particles": _joined([entries for entries, *_ in self._chains], np.int64),
            "link_rest": _joined(rests, np.float64),
            "link_compliance": np.repeat([row[2] for row in self._chains], sizes),
            "link_greatest_length": _joined([np.append(g, np.inf) for g in greatest], np.float64),
            "distance_pairs": pairs,
            "distance_rest": distances[:, 0].copy(),
            "distance_compliance": distances[:, 1].copy(),
            "distance_stiffness": distances[:, 2].copy(),
            "bend_triples": np.array([r[:3] for r in self._bends], dtype=np.int64).reshape(-1, 3),
            "bend_compliance": np.array([row[3] for row in self._bends], dtype=np.float64),
            "bend_friction": np.array([row[4] for row in self._bends], dtype=np.float64),
            "collision_particles": self._collision[0].copy(),
        }
        settings: dict[str, Any] = {
            "dim": self.dim,
            "damping": float(damping),
            "integrator": integrator,
            "iterations": iterations,
            "collision_distance": self._collision[1],
            "bodies": tuple(self._bodies),
            **self._walls,
        }
        check_model(columns, settings, masses, np.array(self._pinned, dtype=bool), INTEGRATORS)
        return Model(**columns, **settings)

    def _length(self, i: int, j: int) -> float:
        """Distance of two particles as placed [m]; NaN where one does not exist (build refuses)."""
        count = len(self._positions)
        if not (0 <= i < count and 0 <= j < count):
            return float("nan")
        return float(np.sqrt(np.sum((self._positions[i] - self._positions[j]) ** 2)))


def _indices(particles: Any) -> np.ndarray:
    """Return particle indices as int64; a float index is a mistake, not a number to round."""
    indices = np.asarray(particles).reshape(-1)
    if indices.dtype.kind not in "iu" and indices.size:
        raise TypeError(f"particles are {particles!r}; expected whole numbers")
    return indices.astype(np.int64)


def _joined(parts: list[np.ndarray], dtype: Any) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=dtype), *parts]).astype(dtype)
