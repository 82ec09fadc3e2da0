from itertools import pairwise

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from scenes import GRAVITY, world


def hung(mass=1.0, **properties):
    """A particle 1 m below a pin, held by a distance."""
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0, pinned=True)
    builder.add_particles((0.0, -1.0), mass)
    builder.add_distance(0, 1, **properties)
    return world(builder.build(damping=2.0))


def test_a_slack_distance_pulls_but_does_not_push():
    state = hung(slack=True)
    state.v[0, 1] = (0.0, 2.0)
    state.step(0.1)
    # 0.1 s of free flight with damping of 2/s: between that of 2 m/s and that of 2 m/s exp(-0.2)
    height = state.x[0, 1, 1] + 1.0
    assert 0.2 * np.exp(-0.2) - 0.5 * GRAVITY * 0.01 - 0.01 < height < 0.2
    for _ in range(120):
        state.step(1 / 60)
        assert state.x[0, 1, 1] > -1.0 - 1e-12
    assert state.x[0, 1, 1] == pytest.approx(-1.0, abs=1e-12)


def test_a_slack_spring_stretches_by_the_law_of_hooke():
    state = hung(slack=True, compliance=0.01)
    for _ in range(900):
        state.step(1 / 60)
    # alpha m g; swings decay by exp(-15)
    assert -state.x[0, 1, 1] - 1.0 == pytest.approx(0.01 * GRAVITY, rel=1e-6)


@pytest.mark.parametrize("gravity", [GRAVITY, -GRAVITY])
def test_strain_limits_hold_a_soft_distance_on_both_sides(gravity):
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0, pinned=True)
    builder.add_particles((0.0, -1.0), 1.0)
    builder.add_distance(0, 1, compliance=0.1, strain_limits=(-0.05, 0.08))
    state = world(builder.build(gravity=(0.0, -gravity), damping=2.0))
    for _ in range(300):
        state.step(1 / 60)
        assert 0.95 - 1e-12 < -state.x[0, 1, 1] < 1.08 + 1e-12
    # without limits, the weight would stretch or compress it by 0.98 m
    assert -state.x[0, 1, 1] == pytest.approx(1.08 if gravity > 0 else 0.95, abs=1e-12)


def sagging(particles, tethered):
    """Greatest strain along a hanging rope of sweeps [1] once it is at rest."""
    builder = ModelBuilder(2)
    depth = np.linspace(0.0, -1.0, particles)
    indices = builder.add_particles(np.stack([np.zeros(particles), depth], axis=1), 0.01)
    builder.pin(indices[0])
    for i, j in pairwise(indices):
        builder.add_distance(i, j)
    if tethered:
        builder.add_tethers()
    state = world(builder.build(damping=4.0))
    for _ in range(240):
        state.step(1 / 60)
    return -state.x[0, -1, 1] - 1.0


def test_tethers_take_the_stretch_out_of_sweeps():
    # sweeps of N links stretch by h^2 g N (N - 1)/2; tethers bound that by their own length
    stretch = GRAVITY / 600**2 * 63 * 62 / 2
    assert sagging(64, tethered=False) == pytest.approx(stretch, rel=1e-3)
    assert abs(sagging(64, tethered=True)) < 1e-4


def test_tethers_follow_the_shortest_way():
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder, (0, 0, 0), (0.4, 0, 0), (0, 0.3, 0), (5, 4), mass=0.1, pinned=[(0, 0), (0, -1)]
    )
    builder.add_tethers(stretch=0.02)
    model = builder.build()
    np.testing.assert_array_equal(model.pins, grid[0, [0, -1]])
    lengths = {tuple(pair): length for pair, length in zip(*model.limits[::2], strict=True)}
    assert len(lengths) == 2 * 18  # every free particle to both corners
    # three diagonals of a cell and one side; straight it would be hypot(0.4, 0.3)
    assert lengths[grid[4, 3], grid[0, 0]] == pytest.approx(1.02 * (0.3 * np.sqrt(2) + 0.1))
    assert lengths[grid[4, 0], grid[0, 0]] == pytest.approx(1.02 * 0.4)


def test_tethers_need_a_pin():
    builder = ModelBuilder(2)
    builder.add_particles([(0, 0), (1, 0), (2, 0)], 1.0)
    builder.add_chain([0, 1, 2])
    with pytest.raises(ValueError, match="anchor 1 is not a pinned particle"):
        builder.add_tethers(anchors=[1])
    with pytest.raises(ValueError, match=r"stretch is -0.1"):
        builder.add_tethers(stretch=-0.1)
    builder.add_tethers()  # no pins, no tethers
    assert builder.build().limits is None


@pytest.mark.parametrize("limits", [(0.1, 0.2), (-0.2, -0.1), (np.nan, 0.0)])
def test_strain_limits_lie_on_both_sides_of_the_rest(limits):
    builder = ModelBuilder(2)
    builder.add_particles([(0, 0), (1, 0)], 1.0)
    with pytest.raises(ValueError, match="strain_limits are"):
        builder.add_distance(0, 1, strain_limits=limits)


def test_a_slack_distance_has_no_stiffness_of_the_seed():
    builder = ModelBuilder(2)
    builder.add_particles([(0, 0), (1, 0)], 1.0)
    with pytest.raises(ValueError, match=r"stiffness k of a slack distance is 0\.5"):
        builder.add_distance(0, 1, slack=True, stiffness=0.5)


def test_limits_that_cannot_be_are_refused():
    def refused(match, add):
        builder = ModelBuilder(2)
        builder.add_particles([(0, 0), (1, 0)], 1.0)
        add(builder)
        with pytest.raises(ValueError, match=match):
            builder.build()

    refused(r"particles of limit 0 is \[0 2\]", lambda builder: builder.add_tether(0, 2, 1.0))
    refused(r"limit 0 is \[1 1\]; it needs 2", lambda builder: builder.add_tether(1, 1, 1.0))
    refused(r"greatest length of limit 0 is 0\.0", lambda builder: builder.add_tether(0, 1, 0.0))
    refused(
        r"compliance of limit 0 is -1\.0",
        lambda builder: builder.add_distance(0, 1, slack=True, compliance=-1.0),
    )
