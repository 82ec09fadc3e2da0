"""The number of substeps follows the fastest particle of each world."""

import numpy as np
import pytest

from pbd_gym.physics import Adaptive, ModelBuilder, World, shapes
from scenes import world

DT = 0.02
SUBSTEPS = Adaptive(reach=0.01, least=2, most=16)


def particle(num_worlds, *, pinned=False, **settings):
    """One particle that can be grabbed, beside a pin or not."""
    builder = ModelBuilder(2)
    builder.make_grabbable(builder.add_particles((0.0, 0.0), 1.0))
    if pinned:
        builder.add_particles((1.0, 0.0), 1.0, pinned=True)
    return world(builder.build(**settings), num_worlds)


# ways per control step in units of reach, and the fewest of 2, 4, 8, 16 substeps that are enough
@pytest.mark.parametrize(
    ("reaches", "count"),
    [(0.0, 2), (2.0, 2), (2.001, 4), (4.0, 4), (7.0, 8), (8.001, 16), (16.0, 16), (900.0, 16)],
)
def test_the_fastest_particle_moves_no_further_than_reach(reaches, count):
    state = particle(2, gravity=(0.0, 0.0))
    # 0.6, 0.8 is a direction; 1 - 1e-12 keeps the rounding of the square root away
    state.v[1, 0] = reaches * SUBSTEPS.reach / DT * np.array([0.6, -0.8]) * (1 - 1e-12)
    state.step(DT, SUBSTEPS)
    np.testing.assert_array_equal(state.substeps_used, [2, count])


def test_gravity_counts_before_it_has_made_anything_fast():
    # g dt^2 = 9.81 * 0.02^2 = 3.9 mm: between twice and four times 1 mm
    state = particle(1)
    state.step(DT, Adaptive(reach=1e-3, least=1, most=64))
    np.testing.assert_array_equal(state.substeps_used, [4])


def test_pins_and_grabbed_particles_count_by_their_targets():
    state = particle(3, pinned=True, gravity=(0.0, 0.0))
    state.grabbed[1:] = True
    targets = state.x[:, [1, 0]].copy()
    targets[0, 0, 1] += 0.03  # the pin: three times reach
    targets[0, 1] = 1e9  # not grabbed: ignored
    targets[2, 1, 0] += 0.07  # the grabbed particle: seven times reach
    state.step(DT, SUBSTEPS, targets)
    np.testing.assert_array_equal(state.substeps_used, [4, 2, 8])
    np.testing.assert_array_equal(state.x[2, 0], [0.07, 0.0])


def rope_in_motion(num_worlds):
    """Ropes in worlds that move at different speeds."""
    builder = ModelBuilder(2)
    indices = shapes.rope(builder, (0.0, 0.0), (1.0, 0.0), 8, mass=0.8)
    builder.make_grabbable(indices[[0, 7]])
    state = world(builder.build(), num_worlds)
    speeds = np.geomspace(0.1, 10.0, num_worlds)[:, None, None]
    state.v[:] = speeds * np.random.default_rng(0).normal(size=state.v.shape)
    return state


def test_a_world_moves_as_with_the_number_of_substeps_that_it_took():
    state = rope_in_motion(6)
    before = state.snapshot()
    state.step(DT, SUBSTEPS)
    used = state.substeps_used
    assert set(used) == {2, 4, 8, 16}
    for count in set(used):
        twin = world(state.model, 6)
        twin.restore(before)
        twin.step(DT, int(count))
        np.testing.assert_array_equal(twin.x[used == count], state.x[used == count])
        np.testing.assert_array_equal(twin.v[used == count], state.v[used == count])


def test_a_fixed_number_of_substeps_is_told_too():
    state = rope_in_motion(2)
    state.step(DT, 7)
    np.testing.assert_array_equal(state.substeps_used, [7, 7])
    state.step(DT, SUBSTEPS)
    state.step(DT, 7)
    np.testing.assert_array_equal(state.substeps_used, [7, 7])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"reach": 0.0}, "reach is 0.0; it must be positive"),
        ({"reach": np.nan}, "reach is nan"),
        ({"reach": np.inf}, "reach is inf"),
        ({"least": 0}, "least is 0; expected a whole number from 1 up"),
        ({"least": 2.0}, "least is 2.0"),
        ({"most": True}, "most is True"),
        ({"least": 3, "most": 16}, "most is 16; allowed: least = 3 times a power of two"),
        ({"least": 8, "most": 4}, "most is 4"),
    ],
)
def test_bounds_that_cannot_be_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Adaptive(**{"reach": 0.01, **wrong})


def test_the_shortest_substep_is_checked_before_it_is_needed():
    state = World(rope_in_motion(1).model)
    before = state.snapshot()
    with pytest.raises(ValueError, match="dt is 1e-08 s in 16 substeps"):
        state.step(1e-8, SUBSTEPS)
    np.testing.assert_array_equal(state.x, before.x)
