"""Constraints solved one after another in list order (Gauss-Seidel sweeps): distances and bends."""

import numpy as np

from ..compiling import kernel
from .layout import DIM, LANES, POSITION, START, VELOCITY


@kernel
def project_distances(work, model, inverse_h2, iteration):
    """Project every distance along its current direction (Mueller et al. 2007, eq. 10-11).

    A compliant one is projected in the first iteration only: a second would make it stiffer.
    """
    for index in range(model.distance_rest.shape[0]):
        i, j = model.distance_pairs[index, 0], model.distance_pairs[index, 1]
        compliance = model.distance_compliance[index]
        if iteration == 0 or compliance == 0:
            _distance(
                work[i],
                work[j],
                model.inverse_mass[i],
                model.inverse_mass[j],
                model.distance_rest[index],
                compliance * inverse_h2,
                model.distance_stiffness[index],
            )


@kernel
def _distance(a, b, mass_a, mass_b, rest, alpha, stiffness):
    one, zero = a.dtype.type(1), a.dtype.type(0)
    total = mass_a + mass_b + alpha
    share = stiffness / total if total > zero else zero
    for lane in range(LANES):
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        # coincident particles have no direction: left to the other constraints
        scale = share * (one - rest / length) if length > zero else zero
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[POSITION + k * LANES + lane] -= mass_a * move
            b[POSITION + k * LANES + lane] += mass_b * move


@kernel
def project_distances_from_start(work, model, inverse_h2, iteration):
    """Project every distance along its direction at the start of the substep (SHAKE)."""
    for index in range(model.distance_rest.shape[0]):
        i, j = model.distance_pairs[index, 0], model.distance_pairs[index, 1]
        compliance = model.distance_compliance[index]
        if iteration == 0 or compliance == 0:
            _distance_from_start(
                work[i],
                work[j],
                model.inverse_mass[i],
                model.inverse_mass[j],
                model.distance_rest[index],
                compliance * inverse_h2,
                model.distance_stiffness[index],
            )


@kernel
def _distance_from_start(a, b, mass_a, mass_b, rest, alpha, stiffness):
    """One Newton step of (|x_a - x_b|^2 - rest^2) / (2 rest) = 0 along the start direction."""
    one, zero, half = a.dtype.type(1), a.dtype.type(0), a.dtype.type(0.5)
    inverse = one / rest
    for lane in range(LANES):
        square, aligned = zero, zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            square += now * now
            aligned += now * start
        turned = aligned < half * rest * rest
        slope = (square if turned else aligned) * inverse * inverse
        total = (mass_a + mass_b) * slope + alpha
        scale = stiffness * half * (square * inverse - rest) * inverse / total if total > zero else zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            move = scale * (now if turned else start)
            a[POSITION + k * LANES + lane] -= mass_a * move
            b[POSITION + k * LANES + lane] += mass_b * move


@kernel
def project_distance_velocities(work, model):
    """Remove the velocity along rigid distances (the second half of RATTLE)."""
    for index in range(model.distance_rest.shape[0]):
        i, j = model.distance_pairs[index, 0], model.distance_pairs[index, 1]
        if model.distance_compliance[index] == 0:
            _distance_velocity(work[i], work[j], model.inverse_mass[i], model.inverse_mass[j])


@kernel
def _distance_velocity(a, b, mass_a, mass_b):
    one, zero = a.dtype.type(1), a.dtype.type(0)
    total = mass_a + mass_b
    share = one / total if total > zero else zero
    for lane in range(LANES):
        square, rate = zero, zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
            rate += delta * (a[VELOCITY + k * LANES + lane] - b[VELOCITY + k * LANES + lane])
        scale = share * rate / square if square > zero else zero
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[VELOCITY + k * LANES + lane] -= mass_a * move
            b[VELOCITY + k * LANES + lane] += mass_b * move


@kernel
def project_bends(work, model, inverse_h2):
    """Draw x_a - 2 x_b + x_c to zero: straight rest, linear, keeps both momenta."""
    for index in range(model.bend_compliance.shape[0]):
        i, j, k = model.bend_triples[index, 0], model.bend_triples[index, 1], model.bend_triples[index, 2]
        _bend(
            work[i],
            work[j],
            work[k],
            model.inverse_mass[i],
            model.inverse_mass[j],
            model.inverse_mass[k],
            model.bend_compliance[index] * inverse_h2,
        )


@kernel
def _bend(a, b, c, mass_a, mass_b, mass_c, alpha):
    one, two, four, zero = a.dtype.type(1), a.dtype.type(2), a.dtype.type(4), a.dtype.type(0)
    total = mass_a + four * mass_b + mass_c + alpha
    share = one / total if total > zero else zero
    for lane in range(LANES):
        for k in range(DIM):
            at = POSITION + k * LANES + lane
            move = share * (a[at] - two * b[at] + c[at])
            a[at] -= mass_a * move
            b[at] += two * mass_b * move
            c[at] -= mass_c * move
