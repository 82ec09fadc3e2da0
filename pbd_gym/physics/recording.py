"""Where the kernels leave the forces of constraints when they are asked for."""

from __future__ import annotations

import numpy as np

from pbd_gym.physics.model import Model
from pbd_gym.physics.parameters import Forces
from pbd_gym.physics.tables import entries_of_links


def scratch_of_forces(model: Model, lanes: int, dtype: np.dtype) -> Forces:
    """Return what one thread collects in: a row per constraint or particle, a column per lane."""
    return Forces(
        chains=np.zeros((len(model.chains.particles), lanes), dtype=dtype),
        distances=np.zeros((len(model.distances.rest), lanes), dtype=dtype),
        bends=np.zeros((len(model.bends.compliance), lanes), dtype=dtype),
        walls=np.zeros((model.num_particles, model.dim * lanes), dtype=dtype),
    )


def recorded_forces(model: Model, num_worlds: int, dtype: np.dtype) -> Forces:
    """Return arrays for the forces of all worlds; chains have an entry per particle."""
    return Forces(
        chains=np.zeros((num_worlds, len(model.chains.particles)), dtype=dtype),
        distances=np.zeros((num_worlds, len(model.distances.rest)), dtype=dtype),
        bends=np.zeros((num_worlds, len(model.bends.compliance)), dtype=dtype),
        walls=np.zeros((num_worlds, model.num_particles, model.dim), dtype=dtype),
    )


def copy_of_forces(model: Model, recorded: Forces) -> Forces:
    """Return a copy in which chains have an entry per link."""
    copies = (part.copy() for part in recorded[1:])
    return Forces(recorded.chains[:, entries_of_links(model.chains)], *copies)
