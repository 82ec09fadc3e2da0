"""The ModelBuilder: collects what a world is made of, checks it all, returns a Model."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from pbd_gym.physics.building.bending import BendBuilder
from pbd_gym.physics.building.colliders import ColliderBuilder
from pbd_gym.physics.building.contacts import ContactBuilder
from pbd_gym.physics.building.encounters import EncounterBuilder
from pbd_gym.physics.building.solids import SolidBuilder
from pbd_gym.physics.building.tethers import TetherBuilder
from pbd_gym.physics.model import Model

INTEGRATORS = ("pbd", "rattle")
KINDS = ("colliders", "encounters", "grabs", "solids")


class ModelBuilder(
    TetherBuilder, BendBuilder, SolidBuilder, ContactBuilder, ColliderBuilder, EncounterBuilder
):
    """Collects particles and what holds between them; `build` checks it all and returns a Model.

    Args:
        dim: Number of space axes, 2 or 3. The last axis points up.
    """

    def build(
        self,
        *,
        gravity: Any = None,
        damping: float = 0.0,
        integrator: str = "pbd",
        iterations: int = 1,
        contact_sweeps: int = 32,
        kinds: Collection[str] = (),
    ) -> Model:
        """Check everything that was added and return the Model.

        Args:
            gravity: (dim,) [m/s2]; 9.81 downwards where None.
            damping: Rate at which free velocities decay [1/s].
            integrator: "pbd" or "rattle", see below.
            iterations: Projections of rigid constraints in a substep. A compliant constraint
                receives its force in the first and keeps it.
            contact_sweeps: Most sweeps over the contacts between bodies in a substep, which end
                sooner where all are settled. With fewer, heaps are quicker and creep.
            kinds: Of "colliders", "encounters", "grabs" and "solids", those to compile for even if
                the model has none. Kernels are compiled for the kinds that a model has; models that
                are edited share one variant if all of them name the kinds that may come.

        "pbd" is the seed's scheme (Mueller et al. 2007): positions are predicted, projected along
        the current direction of each constraint, and velocities read off, v = (x - x_start)/h.
        First order. It conserves linear momentum and, in free flight, E + h/2 m g.v; forces at rest
        are exact. It takes energy out as backward Euler does: what swings with omega [rad/s] loses
        amplitude at the rate omega^2 h/2 [1/s], what spins loses angular momentum at omega^2 h. For
        cloth, contacts and whatever must not go wrong.

        "rattle" (Andersen 1983) projects rigid chains and distances along their direction at the
        start of the substep, kicks by half a substep before and after, and removes the velocities
        along them. Second order. It conserves linear and angular momentum, follows a parabola
        exactly, and its energy oscillates within (omega h)^2 without drift, for as long as the
        substeps have one length. All else (compliant links, implicit and slack chains, bends,
        contacts) is projected and dissipates as with "pbd". For pendulums and short chains, and
        where numbers matter.

        Raises:
            ValueError: Naming the index and the value of what cannot be.
        """
        if gravity is None:
            gravity = np.zeros(self.dim)
            gravity[-1] = -9.81
        particles = self._particle_table(np.array(gravity, dtype=np.float64), "grabs" in kinds)
        _check_settings(damping, integrator, kinds)
        _check_count("iterations", iterations)
        _check_count("contact_sweeps", contact_sweeps)
        chains, ropes = self._chain_tables()
        return Model(
            dim=self.dim,
            damping=float(damping),
            integrator=integrator,
            iterations=int(iterations),
            particles=particles,
            chains=chains,
            ropes=ropes,
            distances=self._distance_table(chains, ropes),
            limits=self._limit_table(),
            bends=self._bend_table(),
            rods=self._rod_table(),
            hinges=self._hinge_table(),
            folds=self._fold_table(),
            room=self._room_table(),
            colliders=self._collider_table("colliders" in kinds),
            self_collision=self._self_collision_table(),
            encounters=self._encounter_table("encounters" in kinds, int(contact_sweeps)),
            bodies=tuple(self._bodies),
            **self._solid_tables("solids" in kinds),
        )


def _check_settings(damping: float, integrator: str, kinds: Collection[str]) -> None:
    if not (np.isfinite(damping) and damping >= 0.0):
        raise ValueError(f"damping is {damping}; a rate must be finite and at least 0 [1/s]")
    if integrator not in INTEGRATORS:
        raise ValueError(f"integrator is {integrator!r}; allowed: {', '.join(INTEGRATORS)}")
    for kind in kinds:
        if kind not in KINDS:
            raise ValueError(f"kind {kind!r} is unknown; allowed: {', '.join(KINDS)}")


def _check_count(name: str, count: int) -> None:
    whole = isinstance(count, int | np.integer) and not isinstance(count, bool)
    if not whole or count < 1:
        raise ValueError(f"{name} is {count!r}; expected a whole number from 1 up")
