"""Particles held at a fixed offset from another one."""

from ..compiling import kernel, row
from .forces import ATTACHMENTS, force_row, note
from .layout import DIM, LANES, POSITION
from .masses import in_lane, inverse_mass_of


@kernel
def project_attachments(work, masses, attachments, inverse_h2, iteration, forces):
    """Draw C = x_particle - x_anchor - offset to zero, a vector: linear, so exact at once.

    A compliant one is projected in the first iteration only: a second would make it stiffer.
    """
    if attachments is None:
        return
    pairs, offsets, compliance = attachments.pairs, attachments.offsets, attachments.compliance
    for index in range(compliance.shape[0]):
        alpha = compliance[index]
        if iteration == 0 or alpha == 0:
            i, j = pairs[index, 0], pairs[index, 1]
            _attach(
                row(work, i),
                row(work, j),
                inverse_mass_of(masses, i),
                inverse_mass_of(masses, j),
                row(offsets, index),
                alpha * inverse_h2,
                force_row(forces, ATTACHMENTS, index * DIM),
            )


@kernel
def _attach(a, b, mass_a, mass_b, offset, alpha, force):
    zero = type(alpha)(0)
    for k in range(DIM):
        at = POSITION + k * LANES
        for lane in range(LANES):
            w_a, w_b = in_lane(mass_a, a, lane), in_lane(mass_b, b, lane)
            total = w_a + w_b + alpha
            error = a[at + lane] - b[at + lane] - offset[k]
            scale = error / total if total > zero else zero
            note(force, k * LANES + lane, -scale)
            a[at + lane] -= w_a * scale
            b[at + lane] += w_b * scale
