"""Energy that came from nowhere is taken out again.

Where light links whip between what is heavy or held, a solve leaves errors of length, and the next
one turns them into speed: energy would grow without bound. A world that ends a control step fast
and with more energy than went in keeps its positions; its velocities are scaled down until the
books balance: motion, height, springs, and the work of pins.

Models with a kind of constraint whose stored energy is not counted here are left alone.
"""

import numpy as np

from ..compiling import kernel, row
from .layout import DIM, LANES, POSITION, SQUARES, VELOCITY
from .masses import inverse_mass_of, is_grabbed
from .springs import released_by_springs
from .tiles import lanes_used, world_of

# Mean speed above which the books are kept [m/s]: for slow worlds it would cost more than it is
# worth.
_FAST = 2.0
# The least gain that is one, as a share of the kinetic energy. Velocities of the first order are of
# half a substep ago; the second order loses and finds again what would be lost if it were taken.
_GAIN = 0.05


@kernel
def take_out_gain(x, v, tile, worlds, work, model, timing):
    """Slow down the worlds of a tile that have gained energy; x and v are as the step began."""
    if _are_any(model.hinges, model.folds, model.volumes):
        return
    if _are_any(model.shape_matches, model.attachments, None):
        return
    marks = row(work, work.shape[0] - 2)
    fast = x.dtype.type(x.shape[1] * _FAST * _FAST)
    for lane in range(lanes_used(tile, x, worlds)):
        if marks[SQUARES + lane] > fast:
            _balance(x, v, world_of(tile, lane, x, worlds), lane, work, model, timing)


@kernel
def _are_any(first, second, third):
    return first is not None or second is not None or third is not None


@kernel
def _balance(x, v, world, lane, work, model, timing):
    """Scale the velocities of a lane down where its energy rose by more than went in.

    A pin of speed u does the work u times the impulse that it gives: no more than 2 u sqrt(2 m E)
    where it turns round all momentum that a mass m with the kinetic energy E can have. Without a
    pin velocities are scaled about that of the centre of mass, and momentum stays.
    """
    masses, real = model.particles, x.dtype.type
    half, one, zero = real(0.5), real(1), real(0)
    gained, kinetic, total, drive, held = zero, zero, zero, zero, False
    for particle in range(x.shape[1]):
        at, mass = row(work, particle), inverse_mass_of(masses, particle)
        square, risen = zero, zero
        for k in range(DIM):
            now, before = at[VELOCITY + k * LANES + lane], v[world, particle, k]
            fall = x[world, particle, k] - at[POSITION + k * LANES + lane]
            square += now * now
            risen += half * (now * now - before * before) + masses.gravity[k] * fall
        if masses.inverse_mass[particle] == 0 or is_grabbed(mass, at, lane):
            drive, held = max(drive, square), True
        else:
            weight = one / masses.inverse_mass[particle]
            total += weight
            kinetic += half * weight * square
            gained += weight * risen
    gained -= released_by_springs(x, world, lane, work, model, timing)
    gained -= real(2) * np.sqrt(real(2) * drive * total * kinetic)
    if gained > real(_GAIN) * kinetic:
        _slow_down(lane, work, masses, gained, kinetic, zero if held else one / total)


@kernel
def _slow_down(lane, work, masses, gained, kinetic, per_mass):
    """Take a kinetic energy out of a lane, as far as it is there.

    per_mass: 1/mass of all, or 0 where a pin takes up momentum.
    """
    real = type(kinetic)
    one, zero = real(1), real(0)
    within = kinetic
    for k in range(DIM):
        momentum = _momentum(lane, work, masses, k)
        within -= real(0.5) * momentum * momentum * per_mass
    share = np.sqrt(max(one - gained / within, zero)) if within > zero else zero
    for k in range(DIM):
        mean = _momentum(lane, work, masses, k) * per_mass
        for particle in range(masses.inverse_mass.shape[0]):
            at, mass = row(work, particle), inverse_mass_of(masses, particle)
            if masses.inverse_mass[particle] > 0 and not is_grabbed(mass, at, lane):
                own = at[VELOCITY + k * LANES + lane] - mean
                at[VELOCITY + k * LANES + lane] = mean + share * own


@kernel
def _momentum(lane, work, masses, k):
    """Return the momentum of all that is free as built along an axis [kg m/s]."""
    momentum = masses.inverse_mass[0] * 0
    for particle in range(masses.inverse_mass.shape[0]):
        if masses.inverse_mass[particle] > 0:
            momentum += work[particle, VELOCITY + k * LANES + lane] / masses.inverse_mass[particle]
    return momentum
