"""Constraints solved one after another in list order (Gauss-Seidel sweeps): distances and bends."""

import numpy as np

from ..compiling import apart, kernel, row
from .forces import BENDS, DISTANCES, force_row, note
from .layout import DIM, LANES, POSITION, START, VELOCITY
from .masses import in_lane, inverse_mass_of


@kernel
def project_distances(work, masses, distances, inverse_h2, iteration, forces):
    """Project every distance along its current direction (Mueller et al. 2007, eq. 10-11).

    A compliant one is projected in the first iteration only: a second would make it stiffer.
    """
    pairs, rest = distances.pairs, distances.rest
    compliance, stiffness = distances.compliance, distances.stiffness
    for index in range(rest.shape[0]):
        i, j = pairs[index, 0], pairs[index, 1]
        alpha = compliance[index]
        if iteration == 0 or alpha == 0:
            _distance(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                rest[index],
                alpha * inverse_h2,
                stiffness[index],
                force_row(forces, DISTANCES, index),
            )


@apart
def _distance(a, b, mass_a, mass_b, rest, alpha, stiffness, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b + alpha
        share = stiffness / total if total > zero else zero
        square = zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
        length = np.sqrt(square)
        # coincident particles have no direction: left to the other constraints
        scale = share * (one - rest / length) if length > zero else zero
        note(force, lane, scale * length)
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[POSITION + k * LANES + lane] -= w_a * move
            b[POSITION + k * LANES + lane] += w_b * move


@kernel
def project_distances_from_start(work, masses, distances, inverse_h2, iteration, forces):
    """Project every distance along its direction at the start of the substep (SHAKE)."""
    pairs, rest = distances.pairs, distances.rest
    compliance, stiffness = distances.compliance, distances.stiffness
    for index in range(rest.shape[0]):
        i, j = pairs[index, 0], pairs[index, 1]
        alpha = compliance[index]
        if iteration == 0 or alpha == 0:
            _distance_from_start(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                rest[index],
                alpha * inverse_h2,
                stiffness[index],
                force_row(forces, DISTANCES, index),
            )


@apart
def _distance_from_start(a, b, mass_a, mass_b, rest, alpha, stiffness, force):
    """One Newton step of (|x_a - x_b|^2 - rest^2) / (2 rest) = 0 along the start direction."""
    real = type(a[0])
    one, zero, half = real(1), real(0), real(0.5)
    inverse = one / rest
    for lane in range(LANES):
        square, aligned, square_start = zero, zero, zero
        for k in range(DIM):
            now = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            square += now * now
            aligned += now * start
            square_start += start * start
        slope = max(aligned, zero) * inverse * inverse
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = (w_a + w_b) * slope + alpha
        scale = (
            stiffness * half * (square * inverse - rest) * inverse / total if total > zero else zero
        )
        note(force, lane, scale * np.sqrt(square_start))
        for k in range(DIM):
            start = a[START + k * LANES + lane] - b[START + k * LANES + lane]
            move = scale * start
            a[POSITION + k * LANES + lane] -= w_a * move
            b[POSITION + k * LANES + lane] += w_b * move


@kernel
def project_distance_velocities(work, masses, distances, h, forces):
    """Remove the velocity along rigid distances (the second half of RATTLE)."""
    pairs, compliance = distances.pairs, distances.compliance
    for index in range(pairs.shape[0]):
        i, j = pairs[index, 0], pairs[index, 1]
        if compliance[index] == 0:
            _distance_velocity(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                h,
                force_row(forces, DISTANCES, index),
            )


@apart
def _distance_velocity(a, b, mass_a, mass_b, h, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        total = w_a + w_b
        share = one / total if total > zero else zero
        square, rate = zero, zero
        for k in range(DIM):
            delta = a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane]
            square += delta * delta
            rate += delta * (a[VELOCITY + k * LANES + lane] - b[VELOCITY + k * LANES + lane])
        scale = share * rate / square if square > zero else zero
        note(force, lane, scale * np.sqrt(square) * h)
        for k in range(DIM):
            move = scale * (a[POSITION + k * LANES + lane] - b[POSITION + k * LANES + lane])
            a[VELOCITY + k * LANES + lane] -= w_a * move
            b[VELOCITY + k * LANES + lane] += w_b * move


@kernel
def project_bends(work, masses, bends, inverse_h2, forces):
    """Draw C = x_a - 2 x_b + x_c to zero: straight rest, linear, keeps both momenta.

    Dry friction holds C where it is, with a force of its own limit: what real cloth shows when bent
    back and forth.
    """
    triples, compliance, friction = bends.triples, bends.compliance, bends.friction
    for index in range(triples.shape[0]):
        i, j, k = triples[index, 0], triples[index, 1], triples[index, 2]
        a, b, c = row(work, i), row(work, j), row(work, k)
        mass_a, mass_b = inverse_mass_of(masses, i), inverse_mass_of(masses, j)
        mass_c, force = inverse_mass_of(masses, k), force_row(forces, BENDS, index)
        alpha, held = compliance[index] * inverse_h2, friction[index] / inverse_h2
        if held > 0:
            _bend_with_friction(a, b, c, mass_a, mass_b, mass_c, alpha, held, force)
        else:
            _bend(a, b, c, mass_a, mass_b, mass_c, alpha, force)


@apart
def _bend(a, b, c, mass_a, mass_b, mass_c, alpha, force):
    real = type(a[0])
    one, two, four, zero = real(1), real(2), real(4), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        total = w_a + four * w_b + w_c
        share = one / (total + alpha) if total > zero else zero
        pull = zero
        for k in range(DIM):
            at = POSITION + k * LANES + lane
            move = share * (a[at] - two * b[at] + c[at])
            a[at] -= w_a * move
            b[at] += two * w_b * move
            c[at] -= w_c * move
            pull += move * move
        note(force, lane, np.sqrt(pull))


@apart
def _bend_with_friction(a, b, c, mass_a, mass_b, mass_c, alpha, held, force):
    real = type(a[0])
    one, two, four, zero = real(1), real(2), real(4), real(0)
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c = in_lane(mass_c, c, lane)
        total = w_a + four * w_b + w_c
        elastic = one / (total + alpha) if total > zero else zero
        static = one / total if total > zero else zero
        square, pull = zero, zero
        for k in range(DIM):
            at, start = POSITION + k * LANES + lane, START + k * LANES + lane
            change = a[at] - a[start] - two * (b[at] - b[start]) + c[at] - c[start]
            square += change * change
        size = np.sqrt(square)
        most = held / size
        # no call of min: see `_note` in forces.py
        rub = (static if static < most else most) if size > zero else zero
        for k in range(DIM):
            at, start = POSITION + k * LANES + lane, START + k * LANES + lane
            change = a[at] - a[start] - two * (b[at] - b[start]) + c[at] - c[start]
            move = elastic * (a[at] - two * b[at] + c[at]) + rub * change
            a[at] -= w_a * move
            b[at] += two * w_b * move
            c[at] -= w_c * move
            pull += move * move
        note(force, lane, np.sqrt(pull))
