"""Strains, violations and stored energies are those of the geometry; contacts are told."""

import numpy as np

from pbd_gym.physics import ModelBuilder, readouts
from scenes import particles_2d


def placed(model):
    return model.positions[None]


def test_limits_are_violated_beyond_their_bounds_only():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (1.0, 0.0), (2.2, 0.0), (2.4, 0.0)], 1.0)
    builder.add_tether(0, 1, 1.5)
    builder.add_distance(1, 2, rest=1.0, slack=True, compliance=0.1)
    builder.add_distance(2, 3, rest=0.5, compliance=1.0, strain_limits=(-0.2, 0.2))
    model = builder.build()
    np.testing.assert_allclose(
        readouts.limit_violations(model, placed(model)), [[0.0, 0.2, -0.2]], atol=1e-15
    )
    np.testing.assert_allclose(
        readouts.limit_strains(model, placed(model)), [[0.0, 0.2, -0.5]], atol=1e-15
    )
    # the slack distance by 0.2 m, the other by 0.3 m; rigid limits store nothing
    energy = readouts.elastic_energy(model, placed(model))
    np.testing.assert_allclose(energy, 0.5 * 0.2**2 / 0.1 + 0.5 * 0.3**2 / 1.0)


def test_a_slack_rope_stores_nothing_while_it_is_short():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (0.8, 0.0), (2.0, 0.0)], 1.0)
    builder.add_chain([0, 1, 2], rest=1.0, compliance=0.01, slack=True)
    model = builder.build()
    np.testing.assert_allclose(readouts.link_strains(model, placed(model)), [[-0.2, 0.2]])
    energy = readouts.elastic_energy(model, placed(model))
    np.testing.assert_allclose(energy, 0.5 * 0.2**2 / 0.01)


def test_rods_are_violated_by_their_turn_and_that_of_their_rest():
    builder = ModelBuilder(2)
    corner = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]  # a left turn
    builder.add_particles([*corner, *corner, *corner], 1.0)
    builder.add_rod([0, 1, 2], bending_stiffness=2.0)
    builder.add_rod([3, 4, 5], bending_stiffness=2.0, curvature=0.5)
    builder.add_rod([6, 7, 8], bending_stiffness=2.0, curvature=-0.5)
    model = builder.build()
    turn = np.sqrt(2.0)  # |(0, 0) - 2 (1, 0) + (1, 1)|, all of it across the line of the ends
    violations = readouts.rod_violations(model, placed(model))
    np.testing.assert_allclose(violations, [[turn, turn - 0.5, turn + 0.5]])


def hinged(angle):
    """A hinge and a fold of triangles with right angles, bent by an angle from flat."""
    builder = ModelBuilder(3)
    wing = (0.0, np.cos(angle), np.sin(angle))
    builder.add_particles([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), wing], 1.0)
    builder.add_hinge((0, 1), (2, 3), bending_stiffness=2.0, angle=0.0)
    builder.add_fold((0, 1), (2, 3), bending_stiffness=2.0)
    return builder.build()


def test_hinges_are_violated_by_their_angle_and_folds_by_their_corners():
    for angle in (-2.0, 0.1, 3.0):
        model = hinged(angle)
        hinge = readouts.hinge_violations(model, placed(model))[0, 0]
        np.testing.assert_allclose(abs(hinge), 2.0 * abs(np.sin(0.5 * angle)))
        # weights of the wings by the cotangents of 90 and 45 degrees: -1 each
        fold = np.linalg.norm(model.positions[2] + model.positions[3])
        np.testing.assert_allclose(readouts.fold_violations(model, placed(model))[0, 0], fold)
        energy = 4.0 * (1.0 - np.cos(0.5 * angle)) / model.hinges.compliance[0]
        energy += 0.5 * fold**2 / model.folds.compliance[0]
        np.testing.assert_allclose(readouts.elastic_energy(model, placed(model)), energy)


def test_areas_and_volumes_are_violated_by_what_they_miss():
    builder = ModelBuilder(2)
    builder.add_particles([(5.0, 0.0), (7.0, 0.0), (7.0, 1.0), (5.0, 1.0)], 1.0)
    builder.add_area([0, 1, 2, 3], pressure=2.0, compliance=0.1)
    model = builder.build()
    np.testing.assert_allclose(readouts.volume_violations(model, placed(model)), [[-2.0]])
    np.testing.assert_allclose(readouts.volume_strains(model, placed(model)), [[-0.5]])
    energy = 0.5 * 2.0**2 / model.volumes.compliance[0]
    np.testing.assert_allclose(readouts.elastic_energy(model, placed(model)), energy)
    builder = ModelBuilder(3)
    builder.add_particles([*np.eye(3), (0.0, 0.0, 0.0)], 1.0)
    builder.add_tetrahedra([(3, 0, 1, 2)])
    model = builder.build()
    np.testing.assert_allclose(readouts.volume_violations(model, 2.0 * placed(model)), [[7 / 6]])


def test_a_matched_shape_is_not_violated_by_moves_and_turns_but_by_stretch():
    corners = np.array([(1.0, 0.5), (-1.0, 0.5), (-1.0, -0.5), (1.0, -0.5)])
    builder = ModelBuilder(2)
    builder.add_particles(corners, 0.5)
    builder.add_shape_match([0, 1, 2, 3], compliance=0.1)
    model = builder.build()
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    x = np.stack([corners @ turn.T + (3.0, 4.0), 1.1 * corners, corners * (-1.0, 1.0)])
    away = readouts.shape_violations(model, x)
    np.testing.assert_allclose(away[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(away[1], 0.1 * np.sqrt(1.25))
    # mirrored along its length it is turned by half a turn at best: the shorter side misfits
    np.testing.assert_allclose(away[2], 1.0)
    # k/2 sum (m_i/M) d^2, k = 1/compliance
    energy = 0.5 / 0.1 * np.mean(away**2, axis=1)
    np.testing.assert_allclose(readouts.elastic_energy(model, x), energy, atol=1e-15)


def test_attachments_are_violated_by_what_misses_their_offset():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (3.0, 5.0)], 1.0)
    builder.add_attachment(1, 0, offset=(0.0, 1.0), compliance=2.0)
    model = builder.build()
    np.testing.assert_allclose(readouts.attachment_violations(model, placed(model)), [[5.0]])
    np.testing.assert_allclose(readouts.elastic_energy(model, placed(model)), 25.0 / 4.0)


def test_the_gap_to_the_nearest_shape_is_told():
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 1.5), (5.0, 0.1), (9.5, 2.0), (4.0, 3.0), (4.0, 3.0)], 1.0)
    builder.pin([4])
    builder.add_plane((0.0, 0.0), (0.0, 1.0), margin=0.1)
    builder.add_box((9.0, 2.0), (1.0, 0.6))
    builder.add_sphere((0.0, 2.5), 0.5)
    builder.add_capsule((4.0, 3.3), (5.0, 3.3), 0.2, pins=(4, 4))
    model = builder.build()
    x = np.repeat(placed(model), 2, axis=0)
    x[1, 4] += (0.0, 1.0)  # a pin that carries a capsule away
    gaps = readouts.shape_gaps(model, x)
    np.testing.assert_allclose(gaps[:, :4], [[0.5, 0.0, -0.5, 0.1], [0.5, 0.0, -0.5, 1.1]])
    touching = [False, True, True, False, False]
    np.testing.assert_array_equal(readouts.touches_shape(model, x), [touching, touching])


def test_nothing_is_told_of_kinds_that_a_model_lacks():
    model = particles_2d([(0.0, 0.0), (1.0, 0.0)])
    names = [name for name in readouts.__all__ if name.endswith(("_strains", "_violations"))]
    assert len(names) == 14
    for name in names:
        assert getattr(readouts, name)(model, placed(model)).shape == (1, 0), name
    assert not readouts.touches_shape(model, placed(model)).any()
    assert readouts.elastic_energy(model, placed(model)) == 0.0
