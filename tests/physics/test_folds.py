import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from scenes import GRAVITY, momenta, world

STIFFNESS = 2e-3  # B [N m]


def wings(*, angle=0.0, free=(0, 1, 2, 3), mass=0.01, **settings):
    """A hinge and, 1 m away, a fold: each two right triangles of 1 dm that share an edge along x.

    The hinge rests at an angle; both start flat. What is not free is pinned.
    """
    builder = ModelBuilder(3)
    corners = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, -0.1, 0)], dtype=float)
    hinge = builder.add_particles(corners, mass)
    fold = builder.add_particles(corners + np.array([1.0, 0.0, 0.0]), mass)
    builder.add_hinge(hinge[:2], hinge[2:], bending_stiffness=STIFFNESS, angle=angle)
    builder.add_fold(fold[:2], fold[2:], bending_stiffness=STIFFNESS)
    for corner in set(range(4)) - set(free):
        builder.pin([hinge[corner], fold[corner]])
    for body in (hinge, fold):
        for i, j in ((0, 1), (0, 2), (1, 2), (0, 3), (1, 3)):
            builder.add_distance(body[i], body[j])
    return world(builder.build(**settings))


def bend(x):
    """Angle between the triangles, positive where the wings bend down from a normal along z."""
    edge = x[1] - x[0]
    up, down = np.cross(edge, x[2] - x[0]), np.cross(x[3] - x[0], edge)
    sine = np.cross(up, down) @ edge / np.linalg.norm(edge)
    return np.arctan2(sine, up @ down)


@pytest.mark.parametrize("angle", [-2.5, -0.5, 0.0, 1.0, 2.5])
def test_a_hinge_comes_to_rest_at_its_angle(angle):
    state = wings(angle=angle, gravity=(0, 0, 0), damping=6.0)
    for _ in range(300):
        state.step(1 / 60, 10)
    # the slowest motion of the wings decays by exp(-damping/2 * 5 s) = 3e-7
    assert bend(state.x[0, :4]) == pytest.approx(angle, abs=1e-5)
    assert bend(state.x[0, 4:]) == pytest.approx(0.0, abs=1e-12)  # nothing moves the flat fold


def test_hinges_and_folds_keep_the_momenta():
    state = wings(angle=1.5, gravity=(0, 0, 0), iterations=3)
    state.v[0] = np.random.default_rng(4).normal(scale=0.1, size=(8, 3))
    state.step(1e-3, 1)
    before, spin = momenta(state)
    for _ in range(10):
        state.step(1e-3, 10)
    after, last_spin = momenta(state)
    # forces cancel: 100 substeps of rounding, 1e-16 m / 1e-4 s * 0.01 kg each
    np.testing.assert_allclose(after, before, atol=1e-12)
    # so do torques at the projected positions; the read-off of PBD damps spin by (omega h)^2 a
    # substep, and wings that shake at 10 rad/s lose 100 * (10 * 1e-4)^2 = 1e-4 of it
    np.testing.assert_allclose(last_spin, spin, atol=2e-3 * np.abs(spin).max())


def test_wings_sag_until_the_torque_balances_their_weight():
    mass = 1e-3
    state = wings(free=(3,), mass=mass, damping=6.0)
    for _ in range(600):
        state.step(1 / 60, 10)
    # the distances, projected after the bending, undo h^2 g = 2.7e-5 m of it, over a wing of 0.1 m
    tolerance = {"rel": 2.7e-4}
    # a hinge has k 2 sin(phi/2) = m g r cos(phi); k = B edge^2 / area of both triangles
    k = STIFFNESS * 0.1**2 / 0.01
    phi = bend(state.x[0, :4])
    assert k * 2.0 * np.sin(phi / 2.0) == pytest.approx(
        mass * GRAVITY * 0.1 * np.cos(phi), **tolerance
    )
    # a fold's energy is k/2 |u + v|^2 for unit vectors along the wings, k (1 - cos(phi))
    phi = bend(state.x[0, 4:])
    assert k * np.sin(phi) == pytest.approx(mass * GRAVITY * 0.1 * np.cos(phi), **tolerance)


def test_a_hinge_of_a_degenerate_triangle_does_nothing():
    state = wings(angle=1.0, gravity=(0, 0, 0))
    state.x[0, 2] = state.x[0, 0] + [0.03, 0.0, 0.0]  # on the edge
    state.x[0, 5] = state.x[0, 4]  # an edge without length
    for _ in range(10):
        state.step(1 / 60, 10)
    assert np.isfinite(state.x).all()


def grid(cells, size):
    """Corners of a square sheet of right triangles and the triangles."""
    side = np.linspace(0.0, size, cells + 1)
    points = np.array([(x, y, 0.0) for x in side for y in side])
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b = number[:-1, :-1].ravel(), number[1:, :-1].ravel()
    c, d = number[:-1, 1:].ravel(), number[1:, 1:].ravel()
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([d, c, b], 1)])


@pytest.mark.parametrize("cells", [10, 20])
def test_a_sheet_bent_to_a_cylinder_has_the_energy_of_the_plate(cells):
    size, radius = 1.0, 2.0
    points, triangles = grid(cells, size)
    x, _, _ = points.T
    bent = np.stack([radius * np.sin(x / radius), points[:, 1], -radius * np.cos(x / radius)], 1)
    energies = []
    for creased in (False, True):
        builder = ModelBuilder(3)
        builder.add_particles(points, 0.01)
        shapes.bend_sheet(builder, triangles, bending_stiffness=STIFFNESS, creased=creased)
        model = builder.build()
        if model.folds is not None:
            sums = np.einsum("fi,fid->fd", model.folds.weights, bent[model.folds.corners])
            energies.append(np.sum(0.5 * np.sum(sums**2, axis=1) / model.folds.compliance))
        if model.hinges is not None:
            angles = np.array([bend(bent[corners]) for corners in model.hinges.corners])
            energies.append(np.sum(4.0 * (1.0 - np.cos(angles / 2.0)) / model.hinges.compliance))
    # B kappa^2 A / 2; the half cells at both ends have no edge across which they could bend
    plate = 0.5 * STIFFNESS / radius**2 * size**2
    np.testing.assert_allclose(energies, plate * (1.0 - 1.0 / cells), rtol=(size / cells) ** 2)


def test_a_crease_is_kept_as_placed():
    points, triangles = grid(2, 0.2)
    points[:, 2] = np.where(points[:, 0] > 0.15, 0.05, 0.0)
    builder = ModelBuilder(3)
    builder.add_particles(points, 0.01)
    shapes.bend_sheet(builder, triangles, bending_stiffness=STIFFNESS, creased=True)
    hinges = builder.build().hinges
    angles = [bend(points[corners]) for corners in hinges.corners]
    assert np.abs(angles).max() > 0.4
    np.testing.assert_allclose(2.0 * np.arctan2(hinges.sine, hinges.cosine), angles, atol=1e-12)


def test_sheets_are_wound_one_way_and_folds_need_three_axes():
    builder = ModelBuilder(3)
    builder.add_particles([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0)], 1.0)
    with pytest.raises(ValueError, match="two triangles run along their edge from 0 to 1"):
        shapes.bend_sheet(builder, [(0, 1, 2), (0, 1, 3)], bending_stiffness=1.0)
    flat = ModelBuilder(2)
    with pytest.raises(ValueError, match="a hinge needs 3 axes; this model has 2"):
        flat.add_hinge((0, 1), (2, 3), bending_stiffness=1.0)
    with pytest.raises(ValueError, match="a fold needs 3 axes"):
        flat.add_fold((0, 1), (2, 3), bending_stiffness=1.0)


@pytest.mark.parametrize("kind", ["hinge", "fold"])
def test_folds_that_cannot_be_are_refused(kind):
    def refused(match, corners=(0, 1, 2, 3), stiffness=1.0, **settings):
        builder = ModelBuilder(3)
        builder.add_particles([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (2, 0, 0)], 1.0)
        add = builder.add_hinge if kind == "hinge" else builder.add_fold
        add(corners[:2], corners[2:], bending_stiffness=stiffness, **settings)
        with pytest.raises(ValueError, match=match):
            builder.build()

    refused(rf"particles of {kind} 0 is \[0 1 2 9\]; particles are numbered 0 to 4", (0, 1, 2, 9))
    refused(rf"{kind} 0 is \[0 1 2 2\]; it needs 4 different", (0, 1, 2, 2))
    refused(rf"a triangle of {kind} 0 is \[0 1 2 4\]; its area must be positive", (0, 1, 2, 4))
    refused(f"bending stiffness of {kind} 0 is -1.0", stiffness=-1.0)
    if kind == "hinge":
        refused("rest angle of hinge 0 is 4.0; allowed: -pi to pi", angle=4.0)
