"""The inverse mass of a particle: one number for all worlds, or one per lane.

Where particles can be grabbed at run time, they are pins in some worlds and free in others, and
their inverse masses stand in the scratch rows. Which of the two holds is known by type when the
kernels are compiled: without grabs nothing is loaded per lane.
"""

from numba.core import types
from numba.extending import overload

from ..compiling import kernel
from .layout import MASS


@kernel
def inverse_mass_of(masses, particle):
    """Return the inverse mass of a particle [1/kg]; None if it differs from lane to lane."""
    return _unless_grabbable(masses.grabbable, masses.inverse_mass, particle)


def _unless_grabbable(grabbable, inverse_mass, particle):
    return inverse_mass[particle] if grabbable is None else None


def in_lane(inverse_mass, at, lane):
    """Return an inverse mass of `inverse_mass_of` in a lane, `at` being the particle's row."""
    return at[MASS + lane] if inverse_mass is None else inverse_mass


def is_grabbed(inverse_mass, at, lane):
    """Tell whether a particle that is free as built is a pin in a lane."""
    return inverse_mass is None and at[MASS + lane] == 0


# Written into their callers, as `_note` in forces.py is, and decided by type: of a function with
# two returns numba would make one that may return None or a number, to be looked at in each lane.
@overload(_unless_grabbable, inline="always")
def _one_or_none(grabbable, inverse_mass, particle):
    if isinstance(grabbable, types.NoneType):
        return lambda grabbable, inverse_mass, particle: inverse_mass[particle]
    return lambda grabbable, inverse_mass, particle: None


@overload(in_lane, inline="always")
def _in_lane(inverse_mass, at, lane):
    if isinstance(inverse_mass, types.NoneType):
        return lambda inverse_mass, at, lane: at[MASS + lane]
    return lambda inverse_mass, at, lane: inverse_mass


@overload(is_grabbed, inline="always")
def _is_grabbed(inverse_mass, at, lane):
    if isinstance(inverse_mass, types.NoneType):
        return lambda inverse_mass, at, lane: at[MASS + lane] == 0
    return lambda inverse_mass, at, lane: False
