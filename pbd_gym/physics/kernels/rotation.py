"""The rotation that fits a rest shape best, from the moment A = sum of m p q^T of a body.

Where A stands in the row of sums, R = argmax trace(R^T A) stands afterwards. Only +, -, *, / and
square roots, and no start value: the state of a world remains positions and velocities.
"""

import numpy as np

from ..compiling import kernel
from .layout import LANES, MOMENT

_SQUARINGS = 20
_ROOT_OF_3 = 1.7320508075688772


@kernel
def rotate_2d(sums):
    """The angle is atan2(sum of m q x p, sum of m q . p); its cosine and sine are enough."""
    real = type(sums[0])
    one, zero = real(1), real(0)
    for lane in range(LANES):
        at = MOMENT + lane
        cosine, sine = sums[at] + sums[at + 3 * LANES], sums[at + 2 * LANES] - sums[at + LANES]
        size = np.sqrt(cosine * cosine + sine * sine)
        # a body on one spot or turned inside out may fit equally well at every angle
        cosine = cosine / size if size > zero else one
        sine = sine / size if size > zero else zero
        sums[at] = cosine
        sums[at + LANES] = -sine
        sums[at + 2 * LANES] = sine
        sums[at + 3 * LANES] = cosine


@kernel
def rotate_3d(sums):
    """The unit quaternion of R maximises q^T K q for a symmetric 4 x 4 matrix K (Horn 1987).

    K plus a multiple of the unit matrix is positive; squared again and again it tends to q q^T.
    Twenty squarings are a million steps of the power iteration. Other than a polar decomposition
    this always gives a rotation, never a reflection: for flat bodies and for those turned inside
    out as well.
    """
    _fill(sums)
    for _ in range(_SQUARINGS):
        _square(sums)
    _read_off(sums)


@kernel
def _fill(sums):
    """Put the upper triangle of (K + mu)/trace in place of A; no eigenvalue of K is below -mu."""
    real = type(sums[0])
    one, quarter, zero, root = real(1), real(0.25), real(0), real(_ROOT_OF_3)
    for lane in range(LANES):
        at = MOMENT + lane
        xx, xy, xz = sums[at], sums[at + LANES], sums[at + 2 * LANES]
        yx, yy, yz = sums[at + 3 * LANES], sums[at + 4 * LANES], sums[at + 5 * LANES]
        zx, zy, zz = sums[at + 6 * LANES], sums[at + 7 * LANES], sums[at + 8 * LANES]
        square = xx * xx + xy * xy + xz * xz + yx * yx + yy * yy + yz * yz
        mu = root * np.sqrt(square + zx * zx + zy * zy + zz * zz)
        mu = mu if mu > zero else one  # a body on one spot: no rotation
        scale = quarter / mu
        sums[at] = scale * (mu + xx + yy + zz)
        sums[at + LANES] = scale * (zy - yz)
        sums[at + 2 * LANES] = scale * (xz - zx)
        sums[at + 3 * LANES] = scale * (yx - xy)
        sums[at + 4 * LANES] = scale * (mu + xx - yy - zz)
        sums[at + 5 * LANES] = scale * (xy + yx)
        sums[at + 6 * LANES] = scale * (zx + xz)
        sums[at + 7 * LANES] = scale * (mu - xx + yy - zz)
        sums[at + 8 * LANES] = scale * (yz + zy)
        sums[at + 9 * LANES] = scale * (mu - xx - yy + zz)


@kernel
def _square(sums):
    """Square the matrix and divide it by its trace."""
    one = type(sums[0])(1)
    for lane in range(LANES):
        at = MOMENT + lane
        a, b, c, d = sums[at], sums[at + LANES], sums[at + 2 * LANES], sums[at + 3 * LANES]
        e, f, g = sums[at + 4 * LANES], sums[at + 5 * LANES], sums[at + 6 * LANES]
        h, i, j = sums[at + 7 * LANES], sums[at + 8 * LANES], sums[at + 9 * LANES]
        first = a * a + b * b + c * c + d * d
        second = b * b + e * e + f * f + g * g
        third = c * c + f * f + h * h + i * i
        fourth = d * d + g * g + i * i + j * j
        scale = one / (first + second + third + fourth)
        sums[at] = scale * first
        sums[at + LANES] = scale * (a * b + b * e + c * f + d * g)
        sums[at + 2 * LANES] = scale * (a * c + b * f + c * h + d * i)
        sums[at + 3 * LANES] = scale * (a * d + b * g + c * i + d * j)
        sums[at + 4 * LANES] = scale * second
        sums[at + 5 * LANES] = scale * (b * c + e * f + f * h + g * i)
        sums[at + 6 * LANES] = scale * (b * d + e * g + f * i + g * j)
        sums[at + 7 * LANES] = scale * third
        sums[at + 8 * LANES] = scale * (c * d + f * g + h * i + i * j)
        sums[at + 9 * LANES] = scale * fourth


@kernel
def _read_off(sums):
    """Put R in place of q q^T: the column of its largest diagonal entry is q but for its length.

    If several rotations fit equally well, that column belongs to one of them; which one is the
    same in every run.
    """
    one, two = type(sums[0])(1), type(sums[0])(2)
    for lane in range(LANES):
        at = MOMENT + lane
        best = sums[at]
        w, x, y, z = best, sums[at + LANES], sums[at + 2 * LANES], sums[at + 3 * LANES]
        e, f, g = sums[at + 4 * LANES], sums[at + 5 * LANES], sums[at + 6 * LANES]
        h, i, j = sums[at + 7 * LANES], sums[at + 8 * LANES], sums[at + 9 * LANES]
        b, c, d = x, y, z
        w, x, y, z = (b, e, f, g) if e > best else (w, x, y, z)
        best = max(best, e)
        w, x, y, z = (c, f, h, i) if h > best else (w, x, y, z)
        best = max(best, h)
        w, x, y, z = (d, g, i, j) if j > best else (w, x, y, z)
        scale = two / (w * w + x * x + y * y + z * z)
        sums[at] = one - scale * (y * y + z * z)
        sums[at + LANES] = scale * (x * y - w * z)
        sums[at + 2 * LANES] = scale * (x * z + w * y)
        sums[at + 3 * LANES] = scale * (x * y + w * z)
        sums[at + 4 * LANES] = one - scale * (x * x + z * z)
        sums[at + 5 * LANES] = scale * (y * z - w * x)
        sums[at + 6 * LANES] = scale * (x * z - w * y)
        sums[at + 7 * LANES] = scale * (y * z + w * x)
        sums[at + 8 * LANES] = one - scale * (x * x + y * y)
