"""What can be read off the state of worlds: energies, momenta, strains, violations, contacts.

Functions of a Model and of positions `x` (W, N, dim) [m] and velocities `v` (W, N, dim) [m/s], of
which they change nothing; they cost nothing where they are not called. They compute in float64,
whatever the state's dtype. Pins have no mass of their own and do not count; a grabbed particle
does. Of a kind that a model lacks there are no columns. Forces are known only while a step is
computed: `World.step(..., record=True)`.

PBD reads velocities off the substep that just ended, so that what is computed from them is half a
substep late: in free flight E + h/2 m g.v is constant and E itself is not.
"""

from pbd_gym.physics.readouts.contacts import (
    shape_gaps,
    touches_particle,
    touches_shape,
    touches_wall,
)
from pbd_gym.physics.readouts.energies import (
    angular_momentum,
    elastic_energy,
    kinetic_energy,
    linear_momentum,
    potential_energy,
)
from pbd_gym.physics.readouts.violations import (
    attachment_violations,
    bend_violations,
    distance_strains,
    distance_violations,
    fold_violations,
    hinge_violations,
    limit_strains,
    limit_violations,
    link_strains,
    link_violations,
    rod_violations,
    shape_violations,
    volume_strains,
    volume_violations,
)

__all__ = [
    "angular_momentum",
    "attachment_violations",
    "bend_violations",
    "distance_strains",
    "distance_violations",
    "elastic_energy",
    "fold_violations",
    "hinge_violations",
    "kinetic_energy",
    "limit_strains",
    "limit_violations",
    "linear_momentum",
    "link_strains",
    "link_violations",
    "potential_energy",
    "rod_violations",
    "shape_gaps",
    "shape_violations",
    "touches_particle",
    "touches_shape",
    "touches_wall",
    "volume_strains",
    "volume_violations",
]
