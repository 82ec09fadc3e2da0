import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, World, shapes
from scenes import GRAVITY, momenta, world

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
SQUARE = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def ring(corners=24, size=0.1, height=0.0):
    angles = 2.0 * np.pi * np.arange(corners) / corners
    return size * np.stack([np.cos(angles), np.sin(angles)], axis=1) + [0.0, height]


def body(points, masses=1.0, *, hold, **settings):
    """Particles that are held together by a list of kinds of constraint, alone in space."""
    builder = ModelBuilder(points.shape[1])
    for point, mass in zip(points, np.broadcast_to(masses, len(points)), strict=True):
        builder.add_particles(point, mass)
    particles = range(len(points))
    if "area" in hold:
        builder.add_area(particles)
    if "tetrahedron" in hold:
        builder.add_tetrahedra([particles])
    if "shape" in hold:
        builder.add_shape_match(particles)
    return world(builder.build(**{"gravity": np.zeros(points.shape[1]), **settings}))


def content(state):
    """Signed area or volume of the only one of the first world, by the divergence theorem."""
    table = state.model.volumes
    corners = state.x[0][table.facets]
    return np.linalg.det(corners).sum() / (2.0 if state.model.dim == 2 else 6.0)


def best_rotation(now, rest, masses):
    """The rotation and centres of shape matching, by singular value decomposition."""
    centre, rest_centre = (np.average(points, axis=0, weights=masses) for points in (now, rest))
    u, _, v = np.linalg.svd(((now - centre) * masses[:, None]).T @ (rest - rest_centre))
    u[:, -1] *= np.sign(np.linalg.det(u @ v))
    return u @ v, centre, rest_centre


@pytest.mark.parametrize(
    ("points", "hold"), [(SQUARE, "area"), (TETRAHEDRON, "tetrahedron")], ids=["area", "volume"]
)
@pytest.mark.parametrize("scale", [0.5, 0.9, 1.2, 2.0])
def test_a_projection_of_a_content_is_a_step_of_newton(points, hold, scale):
    state = body(points, hold=[hold])
    dim, rest = points.shape[1], content(state)
    state.x[0] *= scale
    state.step(1.0, 1)
    # all corners move in and out alike: s - (s^dim - 1)/(dim s^(dim - 1)); rounding of 1 m
    expected = scale - (scale**dim - 1.0) / (dim * scale ** (dim - 1))
    np.testing.assert_allclose(state.x[0], expected * points, atol=1e-14)
    for _ in range(12):
        state.v[:] = 0.0
        state.step(1.0, 1)
    # Newton's method squares the relative error in each step
    assert content(state) == pytest.approx(rest, rel=1e-14)


@pytest.mark.parametrize(
    ("points", "hold"),
    [
        (ring(5, 1.0), "area"),
        (ring(5, 1.0), "shape"),
        (TETRAHEDRON, "tetrahedron"),
        (TETRAHEDRON, "shape"),
    ],
    ids=["area", "shape in the plane", "volume", "shape in space"],
)
def test_what_holds_a_body_together_gives_it_no_impulse(points, hold):
    random = np.random.default_rng(3)
    masses = random.uniform(0.1, 3.0, len(points))
    state = body(points, masses, hold=[hold])
    h = 0.01
    state.v[0] = random.normal(scale=10.0, size=points.shape)
    predicted = state.x[0] + h * state.v[0]
    before = momenta(state)[0]
    state.step(h, 1)
    moved = state.x[0] - predicted
    assert np.abs(moved).max() > 1e-2
    # gradients of what neither shifts nor turns change: sum m dx = 0 and sum m x ^ dx = 0 up to
    # the rounding of 5 particles of 3 kg at 1 m
    turned = np.einsum("n,ni,nj->ij", masses, predicted, moved)
    np.testing.assert_allclose(turned - turned.T, 0.0, atol=1e-14)
    for _ in range(100):
        state.step(10 * h, 10)
    # 1000 substeps that each round v = dx/h to 1e-16 m / 1e-2 s, times 15 kg
    np.testing.assert_allclose(momenta(state)[0], before, atol=1e-10)


@pytest.mark.parametrize(
    ("points", "hold"),
    [
        (ring(8), ["area"]),
        (ring(8), ["shape"]),
        (ring(8), ["area", "shape"]),
        (TETRAHEDRON, ["tetrahedron"]),
        (TETRAHEDRON, ["shape"]),
    ],
    ids=["area", "shape in the plane", "both", "volume", "shape in space"],
)
def test_a_body_turned_inside_out_recovers(points, hold):
    state = body(points, hold=hold, iterations=4)
    state.x[0, :, 0] *= -1.0
    for _ in range(60):
        state.step(1 / 60, 10)
        state.v[:] = 0.0
        assert np.isfinite(state.x).all()
    rotation, centre, rest_centre = best_rotation(state.x[0], points, np.ones(len(points)))
    np.testing.assert_allclose(centre, rest_centre, atol=1e-12)
    if "shape" in hold:
        goal = centre + (points - rest_centre) @ rotation.T
        np.testing.assert_allclose(state.x[0], goal, atol=1e-12)
    if state.model.volumes.rest.size:
        # solved last, by Newton's method
        assert content(state) == pytest.approx(state.model.volumes.rest[0], rel=1e-9)


@pytest.mark.parametrize("spread", [0.0, 1e-12, 1e-3])
@pytest.mark.parametrize(
    ("points", "hold"), [(ring(8), ["area", "shape"]), (TETRAHEDRON, ["tetrahedron", "shape"])]
)
def test_a_collapsed_body_stays_finite_and_in_place(points, hold, spread):
    state = body(points, hold=hold)
    state.x[0] = spread * points[:, ::-1]
    for _ in range(60):
        state.step(1 / 60, 10)
        assert np.isfinite(state.x).all()
    # internal forces leave the centre of mass where it was
    np.testing.assert_allclose(state.x[0].mean(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("size", [1.0, 1e-3])
@pytest.mark.parametrize("shape", [(1.0, 0.6, 0.3), (1.0, 0.02, 0.02), (1.0, 0.5, 0.0)])
def test_the_rotation_in_space_is_that_of_the_singular_value_decomposition(shape, size):
    random = np.random.default_rng(5)
    masses = random.uniform(0.1, 3.0, 8)
    points = size * random.normal(size=(8, 3)) * shape
    for _ in range(5):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        state = body(points, masses, hold=["shape"])
        placed = points @ turn.T + random.normal(size=3)
        state.x[0] = placed
        state.step(1e-3, 1)
        # a turned body is where it should be: rounding of coordinates of 3 m; of the rotation by
        # 1e-16 over the gap of two eigenvalues, (0.02)^2 for the thin one, times its thickness
        np.testing.assert_allclose(state.x[0], placed, atol=1e-14)
        state.v[:] = 0.0
        placed = placed + 0.1 * size * random.normal(size=(8, 3)) * shape
        state.x[0] = placed
        rotation, centre, rest_centre = best_rotation(placed, points, masses)
        state.step(1e-3, 1)
        goal = centre + (points - rest_centre) @ rotation.T
        np.testing.assert_allclose(state.x[0], goal, atol=1e-13)


def test_a_rigid_body_of_unequal_masses_spins_and_flies_as_the_scheme_predicts():
    masses, h, substeps, rate = np.array([1.0, 2.0, 0.5, 3.0]), 1e-3, 1000, 6.0
    state = body(SQUARE, masses, hold=["shape"], gravity=(0.0, -GRAVITY))
    centre = np.average(SQUARE, axis=0, weights=masses)
    arms = SQUARE - centre
    state.v[0] = rate * np.stack([-arms[:, 1], arms[:, 0]], axis=1) + [0.7, 2.0]
    state.step(substeps * h, substeps)
    # a point at angle 0 that came from -theta is predicted at (2 - cos theta, sin theta)
    theta, angle = np.arctan(rate * h), 0.0
    for _ in range(substeps):
        angle += theta
        theta = np.arctan2(np.sin(theta), 2.0 - np.cos(theta))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    time = substeps * h
    flown = centre + np.array([0.7, 2.0]) * time
    flown[1] -= 0.5 * GRAVITY * time * (time + h)
    # 1000 substeps whose velocities are rounded to 1e-16 m / 1e-3 s: 1e-13 m/s for 1 s each
    np.testing.assert_allclose(state.x[0], flown + arms @ turn.T, atol=1e-10)
    # so it slows down like a whirling rod, to the order (omega h)^2 = 4e-5
    assert theta / h == pytest.approx(rate / np.sqrt(1.0 + 2.0 * rate**2 * h * time), rel=1e-4)


def test_a_rigid_body_in_space_keeps_its_shape_as_it_tumbles_and_falls():
    builder = ModelBuilder(3)
    shapes.rigid_box(builder, (0.0, 0.0, 0.0), (0.3, 0.2, 0.1), mass=1.0)
    state = world(builder.build())
    rest = state.x[0].copy()
    state.v[0] = np.cross([3.0, 1.0, 5.0], rest)
    for _ in range(60):
        state.step(1 / 60, 10)
    fallen = 0.5 * GRAVITY * 1.0 * (1.0 + 1 / 600)
    # as above: 600 substeps, velocities rounded to 1e-15 m * 600/s
    np.testing.assert_allclose(state.x[0].mean(axis=0), [0.0, 0.0, -fallen], atol=1e-10)
    sides = [np.linalg.norm(x[:, None] - x[None], axis=2) for x in (state.x[0], rest)]
    # every substep ends on the rest shape; rounding of coordinates of 5 m
    np.testing.assert_allclose(*sides, atol=1e-14)


def test_a_soft_body_vibrates_like_backward_euler_whatever_its_number_of_particles():
    compliance, h, substeps, mass = 1e-3, 1e-3, 200, 2.0
    for number in (2, 6):
        builder = ModelBuilder(2)
        places = np.linspace(-1.0, 1.0, number)
        particles = builder.add_particles([(x, 0.0) for x in places], mass / number)
        builder.add_shape_match(particles, compliance=compliance)
        state = world(builder.build(gravity=(0.0, 0.0)))
        state.x[0] *= 1.1
        state.step(h * substeps, substeps)
        # the stretch e obeys e_n = (2 e_(n-1) - e_(n-2))/(1 + h^2/(alpha M))
        before, now = 0.1, 0.1
        for _ in range(substeps):
            before, now = now, (2.0 * now - before) / (1.0 + h**2 / (compliance * mass))
        # 200 substeps of rounding in 1 m
        np.testing.assert_allclose(state.x[0, :, 0], (1.0 + now) * places, atol=1e-11)


def test_an_elastic_outline_balances_the_pressure_of_what_it_encloses():
    corners, size, stiffness, modulus, pressure = 16, 0.1, 20.0, 300.0, 1.2
    # energy of edges EA l/2 strain^2 and area K A_0/2 (A/A_0 - 1)^2; area and sides of a polygon
    sides, area = 2.0 * np.sin(np.pi / corners), 0.5 * corners * np.sin(2.0 * np.pi / corners)

    def pull(radius):
        stretch = stiffness * corners * sides * (radius / size - 1.0)
        swell = area * radius**2 / (pressure * area * size**2) - 1.0
        return stretch + modulus * swell * 2.0 * area * radius

    low, high = size / 2.0, 2.0 * size
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if pull(middle) < 0.0 else (low, middle)
    errors = []
    for substeps in (20, 40):
        builder = ModelBuilder(2)
        shapes.soft_body_2d(
            builder,
            ring(corners, size),
            mass=0.5,
            stretch_stiffness=stiffness,
            area_modulus=modulus,
            pressure=pressure,
        )
        state = world(builder.build(gravity=(0.0, 0.0), damping=20.0))
        for _ in range(300):
            state.step(1 / 60, substeps)
        errors.append(np.linalg.norm(state.x[0], axis=1).mean() / low - 1.0)
    # at rest, the damping of 20/s has left exp(-50). Constraints that are solved in turn feel each
    # other with an error of second order: half the substep, a quarter of it
    assert abs(errors[1]) < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def settled(builder, seconds=8):
    """Worst relative change of content on the way, that at the end, and the state."""
    builder.set_ground(0.0, friction=0.5)
    state = world(builder.build(damping=0.5))
    rest, worst = content(state), 0.0
    for _ in range(60 * seconds):
        state.step(1 / 60, 10)
        worst = max(worst, abs(content(state) / rest - 1.0))
    return worst, abs(content(state) / rest - 1.0), state


def test_a_soft_body_that_falls_keeps_its_area_and_comes_to_rest_where_it_fell():
    builder = ModelBuilder(2)
    shapes.soft_body_2d(builder, ring(height=0.3), mass=0.24, stretch_stiffness=26.0)
    worst, rest, state = settled(builder)
    assert worst < 0.02
    assert rest < 0.001
    # it neither creeps nor rolls: an order of solving that goes once around would turn it into a
    # wheel that rolls at 0.1 m/s
    assert np.abs(state.v).max() < 1e-3
    assert abs(state.x[0, :, 0].mean()) < 1e-3
    assert np.ptp(state.x[0, :, 1]) < 0.17  # it sags: 0.2 m as placed


def test_a_soft_ball_that_falls_keeps_its_volume_and_comes_to_rest():
    builder = ModelBuilder(3)
    shapes.soft_ball(builder, (0, 0, 0.3), 0.1, mass=0.1, subdivisions=1, membrane_stiffness=50.0)
    worst, rest, state = settled(builder)
    assert worst < 0.02
    assert rest < 0.001
    assert np.abs(state.v).max() < 0.01


def test_a_rigid_box_rests_on_the_ground():
    builder = ModelBuilder(2)
    shapes.rigid_box(builder, (0.0, 0.2), (0.2, 0.1), mass=1.0)
    builder.set_ground(0.0, friction=0.5)
    state = world(builder.build())
    for _ in range(120):
        state.step(1 / 60, 10)
    # the ground stops the lower corners after the last projection: h^2 g = 2.7e-5 m
    np.testing.assert_allclose(np.ptp(state.x[0], axis=0), [0.2, 0.1], atol=1e-4)
    assert np.abs(state.v).max() < 0.01


def test_lanes_do_not_change_a_bit_of_solids():
    builder = ModelBuilder(3)
    shapes.soft_ball(builder, (0, 0, 0.12), 0.1, mass=0.1, subdivisions=0, shape_stiffness=50.0)
    box = shapes.rigid_box(builder, (0.3, 0, 0.12), (0.1, 0.1, 0.2), mass=0.1)
    builder.add_attachment(0, int(box[0, 0, 0]), compliance=1e-3)
    builder.set_ground(0.0, friction=0.5)
    model = builder.build(iterations=2)
    ends = []
    for lanes in (1, 4):
        state = World(model, 5, dtype=np.float64, lanes=lanes)
        state.v[:] = np.random.default_rng(4).normal(scale=3.0, size=state.v.shape)
        for _ in range(6):
            state.step(1 / 60, 5)
        ends.append(np.concatenate([state.x, state.v]))
    np.testing.assert_array_equal(*ends)
