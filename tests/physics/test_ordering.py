"""What the order of particles and constraints may change, and what it may not."""

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder
from scenes import GRAVITY, world

LINKS, MASS = 10, 0.01


def swept_rope(order, *, links=LINKS, numbers=None, pinned=0, direct=False):
    """A horizontal rope of 1 m; `order` lists its links, `numbers` its particles' indices."""
    builder = ModelBuilder(2)
    numbers = np.arange(links + 1) if numbers is None else numbers
    points = np.zeros((links + 1, 2))
    points[numbers, 0] = np.arange(links + 1) / links
    builder.add_particles(points, MASS)
    builder.pin([numbers[pinned]])
    if direct:
        builder.add_chain(numbers)
        return world(builder.build())
    for link in order:
        builder.add_distance(numbers[link], numbers[link + 1], rest=1.0 / links)
    for a, b, c in zip(numbers, numbers[1:], numbers[2:], strict=False):
        builder.add_bend(a, b, c, compliance=0.1)
    return world(builder.build())


def advance(state, substeps=10, steps=30):
    for _ in range(steps):
        state.step(1 / 60, substeps)
    return state


@pytest.mark.parametrize("direct", [False, True])
def test_the_numbers_of_the_particles_do_not_change_a_bit(direct):
    numbers = np.random.default_rng(6).permutation(LINKS + 1)
    plain = advance(swept_rope(range(LINKS), direct=direct))
    shuffled = advance(swept_rope(range(LINKS), numbers=numbers, direct=direct))
    np.testing.assert_array_equal(shuffled.x[0, numbers], plain.x[0])
    np.testing.assert_array_equal(shuffled.v[0, numbers], plain.v[0])


def test_the_order_of_a_sweep_matters_less_with_every_substep():
    bias = []
    for substeps in (10, 20, 40):
        down = advance(swept_rope(range(LINKS)), substeps)
        up = advance(swept_rope(reversed(range(LINKS))), substeps)
        bias.append(np.abs(down.x - up.x).max())
    # what a sweep leaves is h^2 w T in each link: at T < 3 N m g = 3 N and 100 1/kg, in 10 links
    assert bias[0] < LINKS * (1 / 600) ** 2 * 100.0 * 3.0
    # second order in h: each halving quarters it, up to the next order
    ratios = np.array(bias[:-1]) / bias[1:]
    assert ((ratios > 3.0) & (ratios < 5.0)).all(), ratios


def hanging_stretch(substeps, order):
    """Stretch of a rope that hangs at rest from its first particle [m]."""
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, -i / LINKS) for i in range(LINKS + 1)], MASS)
    builder.pin([0])
    for link in order:
        builder.add_distance(link, link + 1)
    state = world(builder.build(damping=20.0))
    for _ in range(120):
        state.step(1 / 60, substeps)
    return -state.x[0, -1, 1] - 1.0


def test_a_hanging_rope_is_stretched_by_the_square_of_the_substep():
    substeps = np.array([5, 10, 20, 40])
    h = 1 / 60 / substeps
    stretch = np.array([hanging_stretch(int(count), range(LINKS)) for count in substeps])
    # exact for one sweep from top to bottom: C_j = h^2 w T_(j+1), in all h^2 g N (N - 1)/2; the
    # swing of the fall decays with exp(-20 t/2) in 2 s = 2e-9 of at most 7 mm
    np.testing.assert_allclose(stretch, h**2 * GRAVITY * LINKS * (LINKS - 1) / 2, rtol=1e-6)
    upwards = hanging_stretch(10, reversed(range(LINKS)))
    # from bottom to top: C_j = h^2 w T_(j-1), 0 for the top link
    expected = h[1] ** 2 * GRAVITY * (LINKS * (LINKS + 1) / 2 - 1)
    assert upwards == pytest.approx(expected, rel=1e-6)
