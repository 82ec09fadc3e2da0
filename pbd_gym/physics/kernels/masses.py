"""The inverse mass of a particle: one number for all worlds, or one per lane.

Where particles can be grabbed at run time, they are pins in some worlds and free in others, and
their inverse masses stand in the scratch rows. Which of the two holds is known when the kernels are
compiled: without grabs nothing is loaded per lane.
"""

from ..compiling import kernel
from .layout import MASS


@kernel
def inverse_mass_of(masses, particle):
    """Return the inverse mass of a particle [1/kg]; None if it differs from lane to lane."""
    return _inverse_mass_of(masses.inverse_mass, masses.grabbable, particle)


@kernel
def _inverse_mass_of(inverse_mass, grabbable, particle):
    if grabbable is None:
        return inverse_mass[particle]
    return None


@kernel
def in_lane(inverse_mass, at, lane):
    """Return an inverse mass of `inverse_mass_of` in a lane, `at` being the particle's row."""
    if inverse_mass is None:
        return at[MASS + lane]
    return inverse_mass


@kernel
def is_grabbed(inverse_mass, at, lane):
    """Tell whether a particle that is free as built is a pin in a lane."""
    if inverse_mass is None:
        return at[MASS + lane] == 0
    return False
