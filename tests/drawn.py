"""Models that the tests of pictures draw, and how pictures are compared."""

import numpy as np
import pytest

from pbd_gym.physics import Balls, ModelBuilder, Net, shapes

PLANE = ([-1.2, -1.2], [1.2, 1.2])


SPACE = ([-0.6, -0.6, 0.0], [0.6, 0.6, 0.8])


ROPE, CLOTH = 12, 6  # particles of the rope, particles along a side of the cloth


def rope(*, walls=False):
    builder = ModelBuilder(2)
    particles = shapes.rope(builder, (0, 0.5), (0, -0.5), ROPE, mass=0.2)
    builder.pin(particles[0])
    if walls:
        builder.set_room((-1.0, -1.0), (np.inf, np.inf))
    return builder.build()


def pendulum(masses):
    builder = ModelBuilder(2)
    shapes.pendulum(builder, (0, 0), [0.5] * len(masses), masses)
    return builder.build()


def cloth(*, loose_at=None, held=True):
    builder = ModelBuilder(3)
    grid = shapes.cloth(
        builder, (-0.3, 0.3, 0.4), (0, -0.6, 0), (0.6, 0, 0), (CLOTH,) * 2, mass=0.2
    )
    if held:
        builder.pin([grid[0, 0], grid[0, -1]])
    if loose_at is not None:
        builder.add_particles(loose_at, 0.1)
    builder.set_ground(0.0)
    return builder.build()


def mixed():
    builder = ModelBuilder(3)
    shapes.rope(builder, (-0.4, 0, 0.5), (0.4, 0, 0.3), ROPE, mass=0.2)
    shapes.pendulum(builder, (0.2, 0.3, 0.8), [0.25, 0.25], [1.0, 0.2])
    builder.add_particles((0, -0.3, 0.1), 0.1)
    builder.set_room((-0.6, -0.6, 0), (0.6, 0.6, 1))
    return builder.build()


def bodies_2d():
    builder = ModelBuilder(2)
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    outline = 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    shapes.soft_body_2d(builder, outline + np.array([-0.5, 0.2]), mass=0.2)
    shapes.rigid_box(builder, (0.5, 0.2), (0.5, 0.4), mass=0.2)
    return builder.build()


def bodies_3d():
    builder = ModelBuilder(3)
    shapes.soft_ball(builder, (-0.3, 0, 0.3), 0.2, mass=0.1)
    shapes.rigid_box(builder, (0.3, 0, 0.3), (0.2, 0.3, 0.2), mass=0.2)
    return builder.build()


def nets_and_balls(dim):
    builder = ModelBuilder(dim)
    side = np.linspace(-0.4, 0.0, 4)
    places = [(x, *[0.0] * (dim - 2), y + 0.5) for x in side for y in side]
    grid = builder.add_particles(places, 0.1).reshape(4, 4)
    builder.add_body(Net(tuple(map(tuple, [*grid.tolist(), *grid.T.tolist()])), 0.005))
    balls = builder.add_particles([(x, *[0.0] * (dim - 2), 0.3) for x in (0.2, 0.4)], 0.1)
    builder.add_body(Balls(tuple(balls.tolist()), 0.08))
    builder.set_ground(0.0)
    return builder.build()


def shapes_2d():
    builder = ModelBuilder(2)
    shapes.rope(builder, (-0.4, 0.9), (0.9, 0.9), ROPE, mass=0.2)
    pin = builder.add_particles((0.7, -0.6), 1.0, pinned=True)[0]
    builder.add_plane((0.0, -0.9), (0.3, 1.0))
    builder.add_sphere((-0.4, 0.0), 0.2)
    builder.add_box((0.5, 0.0), (0.3, 0.1), axes=[[0.8, 0.6], [-0.6, 0.8]])
    builder.add_capsule((0.7, -0.6), (0.2, -0.4), 0.05, pins=(pin, None))
    return builder.build()


def shapes_3d():
    builder = ModelBuilder(3)
    shapes.cloth(builder, (-0.3, 0.3, 0.6), (0, -0.6, 0), (0.6, 0, 0), (CLOTH,) * 2, mass=0.2)
    pin = builder.add_particles((-0.3, -0.3, 0.3), 1.0, pinned=True)[0]
    builder.add_plane((0.0, 0.5, 0.0), (0.0, -1.0, 1.0))
    builder.add_sphere((0.0, 0.0, 0.2), 0.2)
    builder.add_box((0.4, -0.3, 0.1), (0.1, 0.15, 0.1))
    builder.add_capsule((-0.3, -0.3, 0.3), (-0.5, 0.3, 0.5), 0.05, pins=(pin, None))
    builder.set_ground(0.0)
    return builder.build()


SCENES = {
    "rope": (rope(), PLANE),
    "walled rope": (rope(walls=True), PLANE),
    "pendulum": (pendulum([1.0, 0.3, 0.3]), PLANE),
    "cloth": (cloth(), SPACE),
    "rope and pendulum in space": (mixed(), SPACE),
    "bodies": (bodies_2d(), PLANE),
    "bodies in space": (bodies_3d(), SPACE),
    "nets and balls": (nets_and_balls(2), PLANE),
    "nets and balls in space": (nets_and_balls(3), SPACE),
    "shapes": (shapes_2d(), PLANE),
    "shapes in space": (shapes_3d(), SPACE),
}


every_scene = pytest.mark.parametrize(("model", "view"), SCENES.values(), ids=SCENES.keys())


def no_goal(model):
    return np.full(model.positions.shape, np.nan)


def changed(a, b):
    """How many pixels differ."""
    return int((a != b).any(axis=2).sum())


def as_ints(frame):
    return frame.astype(np.int64)
