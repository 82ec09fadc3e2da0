"""Pins that are carried by a frame, and what is attached to something."""

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, frame_targets, shapes
from scenes import GRAVITY, momenta, world


@pytest.mark.parametrize("dim", [2, 3])
def test_pins_carry_a_rigid_body_wherever_their_frame_goes(dim):
    builder = ModelBuilder(dim)
    box = shapes.rigid_box(builder, np.zeros(dim), np.full(dim, 0.2), mass=1.0, counts=3)
    held = box[0].ravel()
    builder.pin(held)
    state = world(builder.build(gravity=np.zeros(dim)))
    carried = state.model.positions[held]
    for step in range(1, 31):
        angle = 0.05 * step
        # about the last axis
        turn = angle if dim == 2 else [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]
        targets = frame_targets(carried, np.full((1, dim), 0.01 * step), [turn])
        state.step(1 / 60, 10, targets=targets)
    goal = frame_targets(state.model.positions, np.full(dim, 0.01 * 30), turn)
    # the body follows its pins but for 1/1000 of its own motion in a substep, 0.005 rad of 0.2 m,
    # and the chord of the last control step is off by 0.05^2/8 of 0.2 m between its ends
    np.testing.assert_allclose(state.x[0], goal, atol=2e-5)


def test_the_pins_of_a_frame_move_at_its_speed():
    builder = ModelBuilder(2)
    builder.add_particles([(0.1, 0.0), (-0.1, 0.0)], 1.0, pinned=True)
    state = world(builder.build())
    rate, dt = 1.0, 1 / 60
    state.step(dt, 10, targets=frame_targets(state.model.positions, [(0.0, 0.0)], [rate * dt]))
    # the chord of a turn by phi: speed omega r sin(phi/2)/(phi/2)
    chord = 0.1 * rate * np.sin(rate * dt / 2) / (rate * dt / 2)
    np.testing.assert_allclose(np.linalg.norm(state.v[0], axis=1), chord, rtol=1e-12)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.3, -0.1)])
def test_a_particle_hangs_on_its_attachment_by_the_law_of_hooke(offset):
    for compliance in (0.0, 2e-3):
        builder = ModelBuilder(2)
        builder.add_particles((1.0, 1.0), 1.0, pinned=True)
        builder.add_particles((1.0, 1.0), 0.5)
        builder.add_attachment(1, 0, offset=offset, compliance=compliance)
        state = world(builder.build(damping=20.0))
        for _ in range(180):
            state.step(1 / 60, 10)
        state.step(1 / 60, 10, targets=np.array([[[1.1, 1.0]]]))
        for _ in range(180):
            state.step(1 / 60, 10)
        # alpha m g below the offset; sqrt(1000)/s damped by 20/s has decayed by exp(-30)
        expected = np.array([1.1, 1.0]) + offset - [0.0, compliance * 0.5 * GRAVITY]
        np.testing.assert_allclose(state.x[0, 1], expected, atol=1e-10)


def test_an_attachment_at_no_offset_is_a_joint_that_gives_no_impulse():
    builder = ModelBuilder(2)
    left = shapes.rigid_box(builder, (0.0, 0.0), (1.0, 0.2), mass=1.0)
    right = shapes.rigid_box(builder, (1.0, 0.0), (1.0, 0.2), mass=2.0)
    builder.add_attachment(int(left[1, 0]), int(right[0, 0]), offset=(0.0, 0.0))
    state = world(builder.build(gravity=(0.0, 0.0), iterations=20))
    state.v[0] = np.random.default_rng(2).normal(size=state.v[0].shape)
    before = momenta(state)[0]
    for _ in range(60):
        state.step(1 / 60, 10)
    i, j = state.model.attachments.pairs[0]
    # bodies are solved after the joint: sweeps leave a share of h v = 2 mm of each substep
    assert np.linalg.norm(state.x[0, i] - state.x[0, j]) < 1e-4
    # 12000 projections that round to 1e-16 m, by h = 1/600 s
    np.testing.assert_allclose(momenta(state)[0], before, atol=1e-10)
