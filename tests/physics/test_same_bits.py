"""The same model, start and actions give the same bits, however the worlds are computed.

Of the models of the environments other lanes in float64 and other processors are compared in
test_fingerprint.py.
"""

from functools import cache

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, World, shapes
from scenes import cloth_3d, pendulum_2d, rope_2d

WORLDS = 35  # a tile of 32 lanes and a remainder of 3, or four tiles of 8 and a remainder of 3
STEPS = 6

MODELS = {
    "rope": lambda: rope_2d(12, pins=[0], rope={"bending_stiffness": 1e-3}, iterations=2),
    "pendulum": lambda: pendulum_2d((0.5, 0.5), (1.0, 2.0), integrator="rattle", iterations=2),
    "cloth": lambda: cloth_3d((5, 5), height=0.05, pins=[(0, 0), (0, 4)]),
}


def lines():
    """A slack rope on tethers and a curved strip with a heavy end."""
    builder = ModelBuilder(2)
    strip = {"bending_stiffness": 1e-3, "curvature": 2.0, "payload": 0.5, "implicit": True}
    slack = shapes.rope(builder, (0.0, 0.0), (0.0, -1.0), 12, mass=0.2, slack=True)
    stiff = shapes.rope(builder, (0.5, 0.0), (0.5, -1.0), 12, mass=0.2, **strip)
    builder.add_rod(slack, bending_stiffness=1e-3)
    builder.pin([slack[0], stiff[0]])
    builder.add_tethers(stretch=0.01)
    return builder.build(iterations=2)


def creased():
    """Two sheets of three triangles that hang from a corner: one creased at rest, one flat."""
    builder = ModelBuilder(3)
    corners = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0.02), (0, -0.1, 0), (0.1, 0.1, 0)])
    triangles = np.array([(0, 1, 2), (1, 0, 3), (1, 4, 2)])
    for is_creased in (True, False):
        indices = builder.add_particles(corners, 0.01)
        builder.pin(indices[0])
        sheet = indices[triangles]
        shapes.bend_sheet(builder, sheet, bending_stiffness=1e-3, creased=is_creased)
        for i, j in ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (1, 4), (2, 4)):
            builder.add_distance(indices[i], indices[j])
    return builder.build(iterations=2)


def collisions():
    """Balls and a rope that collide with each other and with shapes, some of which are carried."""
    builder = ModelBuilder(2)
    rope = shapes.rope(builder, (-0.5, 0.2), (0.5, 0.2), 12, mass=0.2)
    links = np.stack([rope[:-1], rope[1:]], axis=1)
    builder.add_collision(rope, 0.01, links=links, within=True, friction=0.3)
    balls = builder.add_particles([(0.1 * i, 0.26 + 0.02 * i) for i in range(-4, 5)], 0.1)
    builder.add_collision(balls, 0.04, within=True, friction=0.3, restitution=0.5)
    ends = builder.add_particles([(-0.2, 0.1), (0.2, 0.0)], 1.0, pinned=True)
    builder.add_capsule((-0.2, 0.1), (0.2, 0.0), 0.03, pins=(ends[0], ends[1]), friction=0.4)
    builder.add_box((0.5, 0.0), (0.1, 0.1), axes=[[0.8, 0.6], [-0.6, 0.8]], restitution=0.5)
    builder.add_sphere((-0.5, 0.0), 0.1, pin=ends[0], margin=0.01)
    builder.add_plane((0.0, 0.12), (0.1, 1.0), friction=0.2)
    return builder.build()


# constraints of which lanes alone are compared, as every other number of lanes is compiled anew
FURTHER = {"lines": lines, "creased": creased, "collisions": collisions}


def run(name, num_worlds, *, dtype=np.float32, **keywords):
    """Positions and velocities after a few steps in which every world has motions of its own."""
    model = {**MODELS, **FURTHER}[name]()
    state = World(model, num_worlds, dtype=dtype, **keywords)
    random = np.random.default_rng(7)
    state.v[:] = random.normal(scale=0.5, size=(WORLDS, *state.v.shape[1:]))[:num_worlds]
    targets = state.x[:, model.pins].copy()
    for _ in range(STEPS):
        shift = random.normal(scale=0.02, size=(WORLDS, *targets.shape[1:]))
        targets += shift[:num_worlds].astype(dtype)
        state.step(1 / 30, 7, targets=targets)
    return np.concatenate([state.x, state.v], axis=1)


@cache
def one_by_one(name, dtype):
    """All worlds in scalar code on one thread."""
    return run(name, WORLDS, dtype=dtype, lanes=1, num_threads=1)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("num_threads", [1, 2])
def test_lanes_and_threads_do_not_change_a_bit(name, num_threads):
    several = run(name, WORLDS, lanes=32, num_threads=num_threads)
    np.testing.assert_array_equal(several, one_by_one(name, np.float32))


@pytest.mark.parametrize("name", FURTHER)
def test_lanes_do_not_change_a_bit_of_further_constraints(name):
    several = run(name, WORLDS, dtype=np.float64, lanes=8)
    np.testing.assert_array_equal(several, one_by_one(name, np.float64))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_two_threads_do_not_change_a_bit_of_scalar_code(name, dtype):
    two = run(name, WORLDS, dtype=dtype, lanes=1, num_threads=2)
    np.testing.assert_array_equal(two, one_by_one(name, dtype))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("num_worlds", [1, 2, 7, 8, 9, 31, 32, 33])
def test_a_world_does_not_depend_on_how_many_there_are(name, num_worlds):
    chosen = run(name, num_worlds)  # lanes and threads as chosen for this number
    np.testing.assert_array_equal(chosen, one_by_one(name, np.float32)[:num_worlds])


@pytest.mark.parametrize("name", MODELS)
def test_a_second_run_repeats_the_first(name):
    np.testing.assert_array_equal(run(name, 3), run(name, 3))


@pytest.mark.parametrize("name", MODELS)
def test_worlds_differ_where_their_motions_differ(name):
    worlds = one_by_one(name, np.float32)
    assert len(np.unique(worlds.reshape(WORLDS, -1), axis=0)) == WORLDS
