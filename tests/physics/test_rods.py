import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from scenes import momenta, strain, world


def beam(links, *, dim=2, stiffness=0.1, weight=1e-4, **settings):
    """A cantilever of 1 m along x, clamped at its first two particles; each weighs `weight` [N]."""
    builder = ModelBuilder(dim)
    points = np.zeros((links + 2, dim))
    points[:, 0] = np.arange(-1, links + 1) / links
    indices = builder.add_particles(points, 0.01)
    builder.pin(indices[:2])
    builder.add_chain(indices)
    builder.add_rod(indices, bending_stiffness=stiffness)
    gravity = np.zeros(dim)
    gravity[-1] = -weight / 0.01
    return world(builder.build(gravity=gravity, **settings))


def arms(links):
    """Distances of the particles from each joint of the beam, 0 for what is not beyond it [m]."""
    joints, particles = np.arange(links)[:, None], np.arange(1, links + 1)
    return np.maximum(particles - joints, 0) / links


@pytest.mark.parametrize("links", [10, 20, 40])
def test_a_cantilever_bends_as_its_joints_say(links):
    weight = 4e-3 / links**2
    state = beam(links, weight=weight, damping=3.0)
    for _ in range(480):
        state.step(1 / 60)
    # each joint turns by (moment) l/EI, which lowers the tip by that times its arm. At the default
    # settings; what is left is the slope squared, here below 0.02^2
    turns = np.sum(weight * arms(links), axis=1) / links / 0.1
    deflection = np.sum(turns * arms(links)[:, -1])
    assert -state.x[0, -1, 1] == pytest.approx(deflection, rel=4e-4)
    # and as the beam of the continuum, q L^4 / 8 EI, to 1/links: the load is half a link too far
    # out, and the joint at the clamp turns for a whole link instead of half of one
    beam_theory = weight * links / 8.0 / 0.1
    assert -state.x[0, -1, 1] == pytest.approx(beam_theory, rel=4.0 / links)


def test_a_cantilever_bends_in_proportion_to_its_load():
    tips = []
    for load in (1.0, 8.0):
        state = beam(20, weight=load * 1e-6, damping=3.0)
        for _ in range(480):
            state.step(1 / 60)
        tips.append(-state.x[0, -1, 1] / load)
    # linear to the slope squared, (8 * 20 * 1e-6 / 6 / 0.1)^2 = 7e-8; and 8 s of damping leave
    # exp(-1.5 * 8) = 6e-6 of the sway
    assert tips[1] == pytest.approx(tips[0], rel=1e-5)


def test_a_strip_between_clamps_on_a_circle_bends_evenly():
    links, radius, angle = 24, 0.5, np.radians(60.0)
    at = np.linspace(0.0, angle, links + 1)
    circle = radius * np.stack([np.sin(at), 1.0 - np.cos(at)], axis=1)
    builder = ModelBuilder(2)
    indices = builder.add_particles(circle, 0.01)
    builder.pin(indices[[0, 1, -2, -1]])
    builder.add_chain(indices)
    builder.add_rod(indices, bending_stiffness=0.01)
    state = world(builder.build(gravity=(0.0, 0.0), damping=6.0, iterations=2))
    state.v[0, 2:-2] = np.random.default_rng(3).normal(scale=0.05, size=(links - 3, 2))
    for _ in range(480):
        state.step(1 / 60)
    directions = np.diff(state.x[0], axis=0)
    angles = np.unwrap(np.arctan2(directions[:, 1], directions[:, 0]))
    even = np.linspace(angles[0], angles[-1], links)
    # equal turns of equal links are a circle, which is the equilibrium; 0.02 degrees is what others
    # in the field allow
    assert np.degrees(np.sqrt(np.mean((angles - even) ** 2))) < 0.02


def turning(x):
    """Signed curvature of each joint [1/m] of a row of points in the plane."""
    links = np.diff(x, axis=0)
    sides = np.sign(links[:-1, 0] * links[1:, 1] - links[:-1, 1] * links[1:, 0])
    spacing = np.linalg.norm(links, axis=1).mean()
    return sides * np.linalg.norm(np.diff(links, axis=0), axis=1) / spacing**2


@pytest.mark.parametrize("curvature", [-6.0, 3.0, 15.0])
@pytest.mark.parametrize("stiffness", [1.0, 1000.0])
def test_a_straight_strip_curls_up_to_its_rest(curvature, stiffness):
    builder = ModelBuilder(2)
    rope = {"mass": 0.2, "bending_stiffness": stiffness, "curvature": curvature}
    shapes.rope(builder, (0.0, 0.0), (1.0, 0.0), 17, **rope)
    state = world(builder.build(gravity=(0.0, 0.0), damping=2.0))
    for _ in range(300):
        state.step(1 / 60)
    # it was let loose with 0.5 EI curvature^2 L, up to 100 kJ/kg, and is at rest again after 5 s:
    # its slowest mode of bending is damped by exp(-5)
    np.testing.assert_allclose(turning(state.x[0]), curvature, rtol=2e-4)
    assert strain(state) < 1e-9
    # pushed off by nothing, it stays where it was: rounding of 100 m/s in 3000 substeps
    np.testing.assert_allclose(momenta(state)[0], 0.0, atol=1e-11)


def test_a_curved_strip_turns_freely():
    builder = ModelBuilder(2)
    at = np.linspace(0.0, 2.0, 17)
    indices = builder.add_particles(0.5 * np.stack([np.sin(at), 1.0 - np.cos(at)], axis=1), 0.01)
    builder.add_chain(indices)
    builder.add_rod(indices, bending_stiffness=0.1, curvature=2.0)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.v[0] = np.stack([-state.x[0, :, 1], state.x[0, :, 0]], axis=1)  # 1 rad/s
    before = momenta(state)[1][0, 1]
    for _ in range(60):
        state.step(1 / 60)
    # no torque within: it loses no more than the scheme takes, (omega h)^2/2 in each of 600
    # substeps for a turn as a whole
    assert momenta(state)[1][0, 1] == pytest.approx(before, rel=2 * 600 * (1 / 600) ** 2)


def test_a_strip_in_space_bends_to_its_curvature_in_any_plane():
    builder = ModelBuilder(3)
    at = np.linspace(0.0, 1.0, 17)
    points = np.stack([at, 0.01 * at**2, -0.02 * at**2], axis=1)
    indices = shapes.chain(builder, points, 0.01)
    builder.add_rod(indices, bending_stiffness=0.1, curvature=4.0, spacing=1 / 16)
    state = world(builder.build(gravity=(0, 0, 0), damping=2.0))
    plane = np.linalg.svd(points - points.mean(axis=0))[2][2]
    for _ in range(300):
        state.step(1 / 60)
    second = np.diff(state.x[0], n=2, axis=0)
    # the links are as placed, 1/16 m up to the slope squared, 0.05^2/2
    np.testing.assert_allclose(np.linalg.norm(second, axis=1) * 16**2, 4.0, rtol=3e-3)
    np.testing.assert_allclose((state.x[0] - state.x[0].mean(axis=0)) @ plane, 0.0, atol=1e-3)


def test_rods_that_cannot_be_are_refused():
    def refused(match, particles=(0, 1, 2, 3), dim=2, x=(0.0, 1.0, 2.0, 3.0), **settings):
        builder = ModelBuilder(dim)
        points = np.zeros((4, dim))
        points[:, 0] = x
        builder.add_particles(points, 1.0)
        builder.add_rod(particles, **{"bending_stiffness": 1.0, **settings})
        with pytest.raises(ValueError, match=match):
            builder.build()

    refused("number of particles in rod 0 is 2; a rod has at least 3", (0, 1))
    refused("particle of rod 0, entry 2 is 4; particles are numbered 0 to 3", (0, 1, 4))
    refused(r"rod 0 0 is \[0 1 0\]; it needs 3 different", (0, 1, 0))
    refused("spacing of rod 0 is nan; .* placed evenly", x=(0.0, 1.0, 2.5, 3.0))
    refused("spacing of rod 0 is 0.0; it must be positive", spacing=0.0)
    refused("bending stiffness of rod 0 is 0.0; it must be positive", bending_stiffness=0.0)
    refused(r"curvature of rod 0 has shape \(3,\)", curvature=[1.0, 1.0, 1.0])
    refused(r"curvature of rod 0 is 1.5; allowed: from -1.0 to 1.0 \[1/m\]", curvature=1.5)
    refused("curvature of rod 0 is -0.5; allowed: from 0.0", dim=3, curvature=-0.5)
