"""Bending of sheets across the edge that two triangles share; three dimensions only.

The edge runs from corner 0 to corner 1; corners 2 and 3 are the wings.
"""

import numpy as np

from ..compiling import kernel, row
from .forces import FOLDS, HINGES, force_row, note
from .layout import LANES, POSITION
from .masses import in_lane, inverse_mass_of

X, Y, Z = POSITION, POSITION + LANES, POSITION + 2 * LANES
# A triangle that is flatter than this share of its edge (squared) has no normal to speak of.
_FLATTEST = 1e-10


@kernel
def project_folds(work, masses, folds, inverse_h2, forces):
    """Draw C = sum_i weight_i x_i to zero (Bergou et al. 2006): linear, keeps both momenta."""
    if folds is None:
        return
    corners, weights, compliance = folds.corners, folds.weights, folds.compliance
    for index in range(compliance.shape[0]):
        i, j, k, m = corners[index, 0], corners[index, 1], corners[index, 2], corners[index, 3]
        _fold(
            row(work, i),
            row(work, j),
            row(work, k),
            row(work, m),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            inverse_mass_of(masses, m),
            (weights[index, 0], weights[index, 1], weights[index, 2], weights[index, 3]),
            compliance[index] * inverse_h2,
            force_row(forces, FOLDS, index),
        )


@kernel
def _fold(a, b, c, d, mass_a, mass_b, mass_c, mass_d, weights, alpha, force):
    real = type(a[0])
    one, zero = real(1), real(0)
    p, q, r, s = weights
    for lane in range(LANES):
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c, w_d = in_lane(mass_c, c, lane), in_lane(mass_d, d, lane)
        total = p * p * w_a + q * q * w_b + r * r * w_c + s * s * w_d + alpha
        share = one / total if total > zero else zero
        pull = zero
        for at in range(X + lane, X + 3 * LANES + lane, LANES):
            move = share * (p * a[at] + q * b[at] + r * c[at] + s * d[at])
            a[at] -= p * w_a * move
            b[at] -= q * w_b * move
            c[at] -= r * w_c * move
            d[at] -= s * w_d * move
            pull += move * move
        note(force, lane, np.sqrt(pull))


@kernel
def project_hinges(work, masses, hinges, inverse_h2, forces):
    """Turn the wings of every hinge towards its rest angle (Mueller et al. 2007, appendix A)."""
    if hinges is None:
        return
    corners, compliance = hinges.corners, hinges.compliance
    cosine, sine = hinges.cosine, hinges.sine
    for index in range(compliance.shape[0]):
        i, j, k, m = corners[index, 0], corners[index, 1], corners[index, 2], corners[index, 3]
        _hinge(
            row(work, i),
            row(work, j),
            row(work, k),
            row(work, m),
            inverse_mass_of(masses, i),
            inverse_mass_of(masses, j),
            inverse_mass_of(masses, k),
            inverse_mass_of(masses, m),
            cosine[index],
            sine[index],
            compliance[index] * inverse_h2,
            force_row(forces, HINGES, index),
        )


@kernel
def _hinge(a, b, c, d, mass_a, mass_b, mass_c, mass_d, cosine, sine, alpha, force):
    """Turn by the gradients of the angle phi; the error is C = 2 sin((phi - rest)/2).

    For small errors that is phi - rest. It is the torque of the energy 4 (1 - cos((phi - rest)/2))
    / compliance, which grows up to a full turn, and needs no inverse of a sine.
    """
    real = type(a[0])
    one, two, zero = real(1), real(2), real(0)
    flattest = real(_FLATTEST)
    for lane in range(LANES):
        edge = _from(a, b, lane)
        left, right = _from(a, c, lane), _from(a, d, lane)
        up, down = _cross(edge, left), _cross(right, edge)
        square_edge, square_up, square_down = _dot(edge, edge), _dot(up, up), _dot(down, down)
        degenerate = min(square_up, square_down) <= flattest * square_edge * square_edge
        length = np.sqrt(square_edge)
        scale = np.sqrt(square_up * square_down)
        half_cosine, half_sine = _half_angle(
            _dot(up, down), _dot(_cross(up, down), edge) / length, scale
        )
        error = two * (half_sine * cosine - half_cosine * sine)
        # gradients: -length up/|up|^2 at c, -length down/|down|^2 at d, shared by a and b so that
        # they and their torques cancel
        along_c, along_d = _dot(left, edge) / square_edge, _dot(right, edge) / square_edge
        at_c, at_d = -length / square_up, -length / square_down
        a_c, a_d = (along_c - one) * at_c, (along_d - one) * at_d
        b_c, b_d = -along_c * at_c, -along_d * at_d
        w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
        w_c, w_d = in_lane(mass_c, c, lane), in_lane(mass_d, d, lane)
        mixed = two * _dot(up, down)
        total = alpha + w_c * at_c * at_c * square_up + w_d * at_d * at_d * square_down
        total += w_a * (a_c * a_c * square_up + a_d * a_d * square_down + a_c * a_d * mixed)
        total += w_b * (b_c * b_c * square_up + b_d * b_d * square_down + b_c * b_d * mixed)
        move = zero if degenerate or total <= zero else error / total
        note(force, lane, move)
        if degenerate:
            at_c, at_d, a_c, a_d, b_c, b_d = zero, zero, zero, zero, zero, zero
        for k in range(3):
            at = POSITION + k * LANES + lane
            a[at] -= move * w_a * (a_c * up[k] + a_d * down[k])
            b[at] -= move * w_b * (b_c * up[k] + b_d * down[k])
            c[at] -= move * w_c * at_c * up[k]
            d[at] -= move * w_d * at_d * down[k]


@kernel
def _half_angle(dot, turn, scale):
    """Return cosine and sine of half an angle of which scale * cosine and sine are known.

    Of the two forms of either, the one that does not subtract nearly equal numbers.
    """
    real = type(scale)
    zero, half = real(0), real(0.5)
    cosine, sine = dot / scale, turn / scale
    larger = np.sqrt(half + half * abs(cosine))
    smaller = half * abs(sine) / larger
    half_cosine = larger if cosine >= zero else smaller
    half_sine = smaller if cosine >= zero else larger
    return half_cosine, half_sine if sine >= zero else -half_sine


@kernel
def _from(a, b, lane):
    """Return the vector from a to b."""
    return b[X + lane] - a[X + lane], b[Y + lane] - a[Y + lane], b[Z + lane] - a[Z + lane]


@kernel
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@kernel
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
