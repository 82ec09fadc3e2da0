"""What holds between particles along lines: chains, distances, bends."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import (
    check_compliance,
    check_different,
    check_duplicates,
    check_indices,
    refuse_if,
)
from pbd_gym.physics.tables import Bends, Chains, Distances


class LinkBuilder(ParticleBuilder):
    """Collects chains, distances and bends."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._chains: list[tuple[np.ndarray, np.ndarray, float, float]] = []
        self._distances: list[tuple[int, int, float, float, float]] = []
        self._bends: list[tuple[int, int, int, float, float]] = []

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
        entries = as_indices(particles)
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

    def _chain_table(self) -> Chains:
        with np.errstate(invalid="ignore"):  # a rest length of 0 is refused below
            greatest = [rest * (1.0 + limit) for _, rest, _, limit in self._chains]
        sizes = [len(entries) for entries, *_ in self._chains]
        chains = Chains(
            offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            particles=_joined([entries for entries, *_ in self._chains], np.int64),
            # a chain of n particles has n - 1 links; the entry of its last particle holds a dummy
            rest=_joined([np.append(rest, 1.0) for _, rest, _, _ in self._chains], np.float64),
            compliance=np.repeat(np.array([row[2] for row in self._chains], np.float64), sizes),
            greatest=_joined([np.append(length, np.inf) for length in greatest], np.float64),
        )
        _check_chains(chains, self._count)
        return chains

    def _distance_table(self, chains: Chains) -> Distances:
        numbers = np.array([row[2:] for row in self._distances], dtype=np.float64).reshape(-1, 3)
        distances = Distances(
            pairs=np.array([row[:2] for row in self._distances], dtype=np.int64).reshape(-1, 2),
            rest=numbers[:, 0].copy(),
            compliance=numbers[:, 1].copy(),
            stiffness=numbers[:, 2].copy(),
        )
        _check_distances(distances, self._count)
        check_duplicates(np.concatenate([chains.links()[0], distances.pairs]), "link")
        return distances

    def _bend_table(self) -> Bends:
        bends = Bends(
            triples=np.array([row[:3] for row in self._bends], dtype=np.int64).reshape(-1, 3),
            compliance=np.array([row[3] for row in self._bends], dtype=np.float64),
            friction=np.array([row[4] for row in self._bends], dtype=np.float64),
        )
        check_indices(bends.triples, self._count, "particles of bend")
        check_different(bends.triples, "bend")
        check_compliance(bends.compliance, "bend")
        wrong = ~(np.isfinite(bends.friction) & (bends.friction >= 0.0))
        refuse_if(wrong, "friction of bend", bends.friction, "finite and at least 0 [N]")
        check_duplicates(bends.triples, "bend")
        return bends


def _check_chains(chains: Chains, count: int) -> None:
    sizes = np.diff(chains.offsets)
    refuse_if(sizes < 2, "number of particles in chain", sizes, "a chain has at least 2")
    check_indices(chains.particles, count, "particle of chain entry")
    for chain, (first, last) in enumerate(pairwise(chains.offsets)):
        unique, counts = np.unique(chains.particles[first:last], return_counts=True)
        if (counts > 1).any():
            raise ValueError(
                f"chain {chain} visits particle {unique[counts > 1][0]} twice; a directly solved "
                "chain must be open: close a loop with add_distance"
            )
    wrong = ~(np.isfinite(chains.rest) & (chains.rest > 0.0))
    refuse_if(wrong, "rest length of chain entry", chains.rest, "it must be positive, finite [m]")
    check_compliance(chains.compliance, "chain entry")
    wrong = ~(chains.greatest >= chains.rest)
    refuse_if(
        wrong, "greatest length of chain entry", chains.greatest, "a strain limit is at least 0"
    )


def _check_distances(distances: Distances, count: int) -> None:
    check_indices(distances.pairs, count, "particles of distance constraint")
    check_different(distances.pairs, "distance constraint")
    rest = distances.rest
    wrong = ~(np.isfinite(rest) & (rest > 0.0))
    refuse_if(wrong, "rest length of distance constraint", rest, "it must be positive [m]")
    check_compliance(distances.compliance, "distance constraint")
    stiffness = distances.stiffness
    wrong = ~((stiffness > 0.0) & (stiffness <= 1.0))
    refuse_if(wrong, "stiffness k of distance constraint", stiffness, "allowed: 0 < k <= 1")


def _joined(parts: list[np.ndarray], dtype: Any) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=dtype), *parts]).astype(dtype)
