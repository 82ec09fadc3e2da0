import numpy as np
import pytest
from scipy.spatial.distance import pdist

from pbd_gym.physics import ModelBuilder, World, shapes

CELLS, SIDE = 15, 0.6
COLLISION_DISTANCE = 0.6 * SIDE / CELLS
STEP = {"dt": 1 / 30, "substeps": 16}  # 1/480 s, in float32 as in training


def cloth_above(height):
    """A level cloth that may not pass through itself, around x = y = 0."""
    builder = ModelBuilder(3)
    shapes.cloth(
        builder,
        (-SIDE / 2, SIDE / 2, height),
        (0.0, -SIDE, 0.0),
        (SIDE, 0.0, 0.0),
        (CELLS + 1,) * 2,
        mass=0.2,
        bending_compliance=1.0,
        thread_damping=5.0,
        collision_distance=COLLISION_DISTANCE,
        collision_friction=0.5,
    )
    return builder


def self_crossings(x):
    """How many threads of a cloth pierce its triangles."""
    grid = np.arange((CELLS + 1) ** 2).reshape(CELLS + 1, CELLS + 1)
    corners = [
        part.ravel() for part in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    ]
    triangles = np.stack([*np.stack(corners)[[0, 1, 2]].T, *np.stack(corners)[[0, 2, 3]].T])
    rows, columns = (grid[:, :-1], grid[:, 1:]), (grid[:-1], grid[1:])
    threads = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in (rows, columns)])
    p, q = (x[end][:, None] for end in threads.T)
    a, b, c = (x[corner][None] for corner in triangles.T)

    def volume(base, one, two, three):
        return np.einsum("...i,...i->...", np.cross(one - base, two - base), three - base)

    ends_apart = volume(a, b, c, p) * volume(a, b, c, q) < 0.0
    ways = [volume(p, q, *pair) for pair in ((a, b), (b, c), (c, a))]
    through = (np.sign(ways[0]) == np.sign(ways[1])) & (np.sign(ways[1]) == np.sign(ways[2]))
    shared = (threads[:, None, :, None] == triangles[None, :, None, :]).any(axis=(2, 3))
    return int((ends_apart & through & ~shared).sum())


def deepest_overlap(x):
    """By how much particles are closer than they may come, in spacings, 0 if none are."""
    closest = pdist(x).min()
    return max(COLLISION_DISTANCE - closest, 0.0) / (SIDE / CELLS)


def test_a_cloth_dropped_on_a_ball_drapes_and_comes_to_rest():
    centre, radius = np.array([0.0, 0.0, 0.15]), 0.15
    builder = cloth_above(0.45)
    builder.add_sphere(centre, radius, margin=0.005, friction=0.5)
    builder.set_ground(0.0, radius=0.004, friction=0.5)
    state = World(builder.build(damping=0.5, iterations=2))
    for step in range(150):
        state.step(**STEP)
        assert deepest_overlap(state.x[0]) < 0.1
        gap = np.linalg.norm(state.x[0] - centre, axis=1) - radius
        # a tenth of the spacing would do, but none enters at all
        assert gap.min() > 0.0
        assert state.x[0, :, 2].min() > 0.0
        if step % 10 == 9:
            assert self_crossings(state.x[0].astype(np.float64)) == 0
    assert np.linalg.norm(state.v, axis=2).max() < 0.01
    assert 0.1 < np.mean(gap < 0.006) < 0.9  # it lies on the ball and hangs down around it
    assert state.x[0, :, 2].max() < 2.0 * radius + 0.02


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_thrown_cloth_does_not_tunnel_through_a_thin_table(speed):
    thickness = 0.01
    builder = cloth_above(0.5)
    builder.add_box((0.0, 0.0, 0.3), (0.5, 0.5, thickness / 2.0), friction=0.3)
    state = World(builder.build(damping=0.5, iterations=2))
    fall = np.sqrt(speed**2 + 2.0 * 9.81 * 0.2)
    assert fall / 480 < thickness  # it would pass at half the thickness if it met the edge alone
    state.v[..., 2] = -speed
    for _ in range(60):
        state.step(**STEP)
        # never below the upper face by more than float32 rounds at this height
        assert state.x[0, :, 2].min() > 0.3 + thickness / 2.0 - 1e-6


def test_a_cloth_hangs_over_a_rod():
    radius = 0.02
    builder = cloth_above(0.5)
    builder.add_capsule((-0.5, 0.0, 0.4), (0.5, 0.0, 0.4), radius, margin=0.005, friction=0.6)
    state = World(builder.build(damping=0.5, iterations=2))
    for _ in range(90):
        state.step(**STEP)
        gap = np.linalg.norm(state.x[0, :, 1:] - (0.0, 0.4), axis=1) - radius
        assert gap.min() > 0.0
    assert state.x[0, :, 2].mean() < 0.35
    assert state.x[0, :, 2].max() < 0.4 + radius + 0.01


def test_particles_rest_on_the_surface_of_shapes_in_space():
    builder = ModelBuilder(3)
    random = np.random.default_rng(8)
    thrown = builder.add_particles(
        random.uniform((-0.2, -0.2, 0.6), (0.2, 0.2, 1.0), (200, 3)), 0.1
    )
    builder.set_self_collision(thrown[:2], 1e-6)  # only chooses the kernels of the other tests
    turned = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    builder.add_box((0.0, 0.0, 0.0), (0.15, 0.1, 0.1), axes=turned, friction=0.9)
    builder.add_plane((0.0, 0.0, -0.2), (0.1, 0.0, 1.0), friction=0.9)
    state = World(builder.build(damping=0.2))
    for _ in range(60):
        state.step(**STEP)
        x = state.x[0].astype(np.float64)
        excess = np.abs(x @ turned.T) - (0.15, 0.1, 0.1)
        slope = (x + np.array([0.0, 0.0, 0.2])) @ np.array([0.1, 0.0, 1.0]) / np.sqrt(1.01)
        # rounding of float32 at distances of 1 m
        assert excess.max(axis=1).min() > -1e-6
        assert slope.min() > -1e-6
    lying = (np.abs(excess.max(axis=1)) < 1e-6) | (slope < 1e-6)
    assert lying.all()
    assert np.abs(state.v).max() < 1e-3
