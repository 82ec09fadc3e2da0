"""Closed outlines in the plane keep their area, closed surfaces in space their volume."""

from ..compiling import kernel, row
from .forces import VOLUMES, force_row, note
from .layout import CONTENT, DIM, DIRECTION, LANES, POSITION, STIFFNESS
from .masses import in_lane, inverse_mass_of


@kernel
def project_volumes(work, masses, volumes, inverse_h2, iteration, forces):
    """Project every area or volume on its rest value (Mueller et al. 2007, eq. 10, 14 and 15).

    The content is signed: a body turned inside out has a negative one and turns back. A compliant
    one is projected in the first iteration only: a second would make it stiffer. The gradients
    stand in the particles' rows until all are known.
    """
    if volumes is None:
        return
    offsets, particles = volumes.offsets, volumes.particles
    facet_offsets, facets = volumes.facet_offsets, volumes.facets
    rest, compliance, least = volumes.rest, volumes.compliance, volumes.least
    sums = row(work, work.shape[0] - 3)
    for index in range(rest.shape[0]):
        alpha = compliance[index]
        if iteration == 0 or alpha == 0:
            first, last = offsets[index], offsets[index + 1]
            origin = row(work, particles[first])
            for entry in range(first, last):
                _clear_gradient(row(work, particles[entry]))
            for facet in range(facet_offsets[index], facet_offsets[index + 1]):
                a, b = row(work, facets[facet, 0]), row(work, facets[facet, 1])
                if DIM == 2:
                    _add_edge(a, b, origin)
                else:
                    _add_triangle(a, b, row(work, facets[facet, DIM - 1]), origin)
            _clear_sums(sums)
            for entry in range(first, last):
                particle = particles[entry]
                inverse_mass = inverse_mass_of(masses, particle)
                _add_particle(row(work, particle), inverse_mass, origin, sums)
            force = force_row(forces, VOLUMES, index)
            _solve(sums, rest[index], alpha * inverse_h2, least[index], force)
            for entry in range(first, last):
                particle = particles[entry]
                _move(row(work, particle), inverse_mass_of(masses, particle), sums)


@kernel
def _clear_gradient(at):
    zero = type(at[0])(0)
    for lane in range(DIM * LANES):
        at[DIRECTION + lane] = zero


@kernel
def _clear_sums(sums):
    zero = type(sums[0])(0)
    for lane in range(LANES):
        sums[CONTENT + lane] = zero
        sums[STIFFNESS + lane] = zero


@kernel
def _add_edge(a, b, origin):
    """Add the gradient of (x_a - o) x (x_b - o) / 2, the area between an edge and a point."""
    half = type(a[0])(0.5)
    x, y = POSITION, POSITION + LANES
    for lane in range(LANES):
        a_x, a_y = a[x + lane] - origin[x + lane], a[y + lane] - origin[y + lane]
        b_x, b_y = b[x + lane] - origin[x + lane], b[y + lane] - origin[y + lane]
        a[DIRECTION + lane] += half * b_y
        a[DIRECTION + LANES + lane] -= half * b_x
        b[DIRECTION + lane] -= half * a_y
        b[DIRECTION + LANES + lane] += half * a_x


@kernel
def _add_triangle(a, b, c, origin):
    """Add the gradient of the volume between a triangle and a point, a triple product by 6."""
    _add_cross(a, b, c, origin)
    _add_cross(b, c, a, origin)
    _add_cross(c, a, b, origin)


@kernel
def _add_cross(a, b, c, origin):
    """Add (x_b - o) x (x_c - o) / 6 to the gradient of a."""
    sixth = type(a[0])(1.0 / 6.0)
    for k in range(DIM):
        i = POSITION + (k + 1) % DIM * LANES
        j = POSITION + (k + 2) % DIM * LANES
        for lane in range(LANES):
            b_i, b_j = b[i + lane] - origin[i + lane], b[j + lane] - origin[j + lane]
            c_i, c_j = c[i + lane] - origin[i + lane], c[j + lane] - origin[j + lane]
            a[DIRECTION + k * LANES + lane] += sixth * (b_i * c_j - b_j * c_i)


@kernel
def _add_particle(at, mass, origin, sums):
    """Add a particle's share: a content of degree DIM is the sum of (x - o) . gradient / DIM."""
    real = type(at[0])
    share = real(1.0 / DIM)
    for lane in range(LANES):
        square, content = real(0), real(0)
        for k in range(DIM):
            gradient = at[DIRECTION + k * LANES + lane]
            position = POSITION + k * LANES + lane
            square += gradient * gradient
            content += (at[position] - origin[position]) * gradient
        sums[CONTENT + lane] += share * content
        sums[STIFFNESS + lane] += in_lane(mass, at, lane) * square


@kernel
def _solve(sums, rest, alpha, least, force):
    """Turn the sums into the multiplier; what is all but collapsed is not thrown apart."""
    zero = type(rest)(0)
    for lane in range(LANES):
        total = max(sums[STIFFNESS + lane], least) + alpha
        error = sums[CONTENT + lane] - rest
        sums[CONTENT + lane] = error / total if total > zero else zero
        note(force, lane, -sums[CONTENT + lane])


@kernel
def _move(at, mass, sums):
    for k in range(DIM):
        for lane in range(LANES):
            weight = in_lane(mass, at, lane) * sums[CONTENT + lane]
            at[POSITION + k * LANES + lane] -= weight * at[DIRECTION + k * LANES + lane]
