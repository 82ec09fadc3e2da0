"""What holds between particles along lines: chains, distances and their limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.physics.building.particles import ParticleBuilder, as_indices
from pbd_gym.physics.checks import (
    check_compliance,
    check_different,
    check_duplicates,
    check_indices,
    refuse_if,
)
from pbd_gym.physics.tables import Chains, Distances, Limits, Ropes, links_in_rows


class _Chain(NamedTuple):
    particles: np.ndarray
    rest: np.ndarray
    compliance: float
    strain_limit: float
    damping: float
    slack: bool
    implicit: bool


class LinkBuilder(ParticleBuilder):
    """Collects chains, distances and their limits."""

    def __init__(self, dim: int) -> None:
        super().__init__(dim)
        self._chains: list[_Chain] = []
        self._distances: list[tuple[int, int, float, float, float]] = []
        self._limits: list[tuple[int, int, float, float, float]] = []

    def add_chain(
        self,
        particles: Sequence[int] | np.ndarray,
        *,
        rest: Any = None,
        compliance: float = 0.0,
        strain_limit: float = np.inf,
        damping: float = 0.0,
        slack: bool = False,
        implicit: bool = False,
    ) -> None:
        """Link particles in a row; all links of the chain are solved together, directly.

        Args:
            particles: Two or more particle indices, in order.
            rest: Rest length of the links [m], one or one each; as placed where None.
            compliance: Of a link under tension [m/N]; 0 is inextensible.
            strain_limit: Strain beyond which a link is cut short whatever pulls on it; +inf for no
                limit. For cloth, whose crossing threads are solved in turn.
            damping: Rate at which the velocities of a link's ends approach each other [1/s].
            slack: Let links be shorter than their rest: they pull but do not push.
            implicit: Let links pull along the directions that they will have, which stays stable
                under any tension. For many short links and heavy end masses: an explicit chain
                blows up where waves of tension, of speed sqrt(tension / mass per length), run
                further than half a link in a substep. Costs two to three times as much.

        Raises:
            ValueError: If a slack or implicit chain has a strain limit or damping.
        """
        entries = as_indices(particles)
        if rest is None:
            lengths = [self._length(i, j) for i, j in pairwise(entries)]
        else:
            lengths = np.broadcast_to(
                np.asarray(rest, dtype=np.float64), (max(len(entries) - 1, 0),)
            )
        implicit = bool(implicit or slack)
        if implicit and strain_limit < np.inf:
            raise ValueError(
                f"strain_limit of a slack or implicit chain is {strain_limit}; they have none"
            )
        if implicit and damping != 0.0:
            raise ValueError(f"damping of a slack or implicit chain is {damping}; they have none")
        self._chains.append(
            _Chain(
                entries,
                np.array(lengths),
                float(compliance),
                float(strain_limit),
                float(damping),
                bool(slack),
                implicit,
            )
        )

    def add_distance(
        self,
        i: int,
        j: int,
        *,
        rest: float | None = None,
        compliance: float = 0.0,
        stiffness: float = 1.0,
        slack: bool = False,
        strain_limits: tuple[float, float] = (-np.inf, np.inf),
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
            slack: Let the distance be shorter than its rest: it pulls but does not push. This and
                the limits are projected as PBD does under RATTLE too.
            strain_limits: Least and greatest strain, at which a compliant distance becomes rigid;
                from -1 (or less: no limit) to 0, and from 0 to +inf (no limit).

        Raises:
            ValueError: If a limit is on the wrong side, or a slack distance has a stiffness k.
        """
        length = self._length(i, j) if rest is None else float(rest)
        low, high = strain_limits
        if not low <= 0.0 <= high:
            raise ValueError(
                f"strain_limits are {strain_limits}; expected a compression of at most 0 and a "
                "stretch of at least 0"
            )
        if slack and stiffness != 1.0:
            raise ValueError(f"stiffness k of a slack distance is {stiffness}; give a compliance")
        i, j = int(i), int(j)
        if slack:
            self._limits.append((i, j, 0.0, length, float(compliance)))
        else:
            self._distances.append((i, j, length, float(compliance), float(stiffness)))
        least, greatest = length * max(1.0 + low, 0.0), length * (1.0 + high)
        if least > 0.0 or greatest < np.inf:
            self._limits.append((i, j, least, greatest, 0.0))

    def _chain_tables(self) -> tuple[Chains, Ropes | None]:
        """Return the explicit chains and the implicit ones."""
        chains = _chain_table([chain for chain in self._chains if not chain.implicit])
        _check_chains(chains, self._count, "chain")
        implicit = [chain for chain in self._chains if chain.implicit]
        if not implicit:
            return chains, None
        table = _chain_table(implicit)
        _check_chains(table, self._count, "implicit chain")
        slack = np.array([chain.slack for chain in implicit], dtype=np.int64)
        return chains, Ropes(table.offsets, table.particles, table.rest, table.compliance, slack)

    def _distance_table(self, chains: Chains, ropes: Ropes | None) -> Distances:
        numbers = np.array([row[2:] for row in self._distances], dtype=np.float64).reshape(-1, 3)
        distances = Distances(
            pairs=np.array([row[:2] for row in self._distances], dtype=np.int64).reshape(-1, 2),
            rest=numbers[:, 0].copy(),
            compliance=numbers[:, 1].copy(),
            stiffness=numbers[:, 2].copy(),
        )
        _check_distances(distances, self._count)
        links = [links_in_rows(chains)[0], distances.pairs]
        if ropes is not None:
            links.insert(1, links_in_rows(ropes)[0])
        check_duplicates(np.concatenate(links), "link")
        return distances

    def _limit_table(self) -> Limits | None:
        if not self._limits:
            return None
        numbers = np.array([row[2:] for row in self._limits], dtype=np.float64)
        limits = Limits(
            pairs=np.array([row[:2] for row in self._limits], dtype=np.int64),
            least=numbers[:, 0].copy(),
            greatest=numbers[:, 1].copy(),
            compliance=numbers[:, 2].copy(),
        )
        check_indices(limits.pairs, self._count, "particles of limit")
        check_different(limits.pairs, "limit")
        wrong = ~((limits.greatest > 0.0) & (limits.greatest >= limits.least))
        refuse_if(wrong, "greatest length of limit", limits.greatest, "it must be positive [m]")
        check_compliance(limits.compliance, "limit")
        return limits


def _chain_table(rows: list[_Chain]) -> Chains:
    with np.errstate(invalid="ignore"):  # a rest length of 0 is refused below
        greatest = [chain.rest * (1.0 + chain.strain_limit) for chain in rows]
    sizes = [len(chain.particles) for chain in rows]
    return Chains(
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        particles=joined([chain.particles for chain in rows], np.int64),
        # a chain of n particles has n - 1 links; the entry of its last particle holds a dummy
        rest=joined([np.append(chain.rest, 1.0) for chain in rows], np.float64),
        compliance=np.repeat(np.array([chain.compliance for chain in rows], np.float64), sizes),
        greatest=joined([np.append(length, np.inf) for length in greatest], np.float64),
        damping=np.repeat(np.array([chain.damping for chain in rows], np.float64), sizes),
    )


def _check_chains(chains: Chains, count: int, what: str) -> None:
    sizes = np.diff(chains.offsets)
    refuse_if(sizes < 2, f"number of particles in {what}", sizes, "a chain has at least 2")
    check_indices(chains.particles, count, f"particle of {what} entry")
    for chain, (first, last) in enumerate(pairwise(chains.offsets)):
        unique, counts = np.unique(chains.particles[first:last], return_counts=True)
        if (counts > 1).any():
            raise ValueError(
                f"{what} {chain} visits particle {unique[counts > 1][0]} twice; a directly solved "
                "chain must be open: close a loop with add_distance"
            )
    wrong = ~(np.isfinite(chains.rest) & (chains.rest > 0.0))
    refuse_if(wrong, f"rest length of {what} entry", chains.rest, "it must be positive, finite [m]")
    check_compliance(chains.compliance, f"{what} entry")
    wrong = ~(chains.greatest >= chains.rest)
    refuse_if(
        wrong, f"greatest length of {what} entry", chains.greatest, "a strain limit is at least 0"
    )
    wrong = ~(np.isfinite(chains.damping) & (chains.damping >= 0.0))
    refuse_if(wrong, f"damping of {what} entry", chains.damping, "finite and at least 0 [1/s]")


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


def joined(parts: list[np.ndarray], dtype: Any) -> np.ndarray:
    """Return arrays end to end; an empty array of the dtype where there are none."""
    return np.concatenate([np.zeros(0, dtype=dtype), *parts]).astype(dtype)
