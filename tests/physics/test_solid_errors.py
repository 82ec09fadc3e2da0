import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, frame_targets, shapes
from refusals import refused

NAN, INF = np.nan, np.inf
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
SURFACE = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]


def square():
    builder = ModelBuilder(2)
    builder.add_particles([(0, 0), (1, 0), (1, 1), (0, 1)], 1.0)
    return builder


def tetrahedron():
    builder = ModelBuilder(3)
    builder.add_particles(TETRAHEDRON, 1.0)
    return builder


def test_areas_belong_to_the_plane_and_volumes_to_space():
    with pytest.raises(ValueError, match="an area is kept in 2 dimensions"):
        tetrahedron().add_area([0, 1, 2])
    with pytest.raises(ValueError, match="a volume is kept in 3 dimensions"):
        square().add_volume([(0, 1, 2)])
    with pytest.raises(ValueError, match="a volume is kept in 3 dimensions"):
        square().add_tetrahedra([(0, 1, 2, 3)])


def test_a_content_has_corners_that_exist_and_differ():
    builder = square()
    builder.add_area([0, 1, 2])
    builder.add_area([0, 1, 4])
    refused(builder, r"edge of volume 1: 1 is \[1 4\]; particles are numbered 0 to 3")
    builder = square()
    builder.add_area([0, 1, 2, 1])
    refused(builder, r"area 0 is \[0 1 2 1\]; it needs 3 or more different particles")
    builder = square()
    builder.add_area([0, 1])
    refused(builder, r"area 0 is \[0 1\]; it needs 3 or more different particles")
    builder = tetrahedron()
    builder.add_tetrahedra([(0, 1, 2, -1)])
    refused(builder, r"triangle of volume 0: 1 is \[ ?0 +1 -1\]")
    with pytest.raises(ValueError, match=r"tetrahedra have shape \(1, 3\); expected \(n, 4\)"):
        tetrahedron().add_tetrahedra([(0, 1, 2)])
    with pytest.raises(TypeError, match="expected whole numbers"):
        tetrahedron().add_volume(np.array(SURFACE, dtype=float))


def test_a_surface_is_closed_and_faces_outwards_everywhere():
    builder = tetrahedron()
    builder.add_volume(SURFACE[:3])
    refused(builder, "surface of volume 0 is not closed at the edge from 0 to 2")
    builder = tetrahedron()
    builder.add_volume([*SURFACE[:3], SURFACE[3][::-1]])
    refused(builder, "volume 0 has an edge that two triangles run through the same way")


def test_a_content_is_not_flat_and_kept_once():
    builder = square()
    builder.add_particles((2.0, 0.0), 1.0)
    builder.add_area([0, 1, 4])
    refused(builder, r"volume 0 is 0\.0 as placed; it must not be flat")
    builder = tetrahedron()
    builder.add_volume(SURFACE)
    builder.add_tetrahedra([(3, 1, 0, 2)])
    refused(builder, r"volume 1 \[0 1 2 3\] repeats volume 0")


@pytest.mark.parametrize("value", [-1.0, NAN, INF])
def test_what_a_solid_is_made_of_is_finite_and_not_negative(value):
    builder = square()
    builder.add_area(range(4), compliance=value)
    refused(builder, f"compliance of volume 0 is {value}")
    builder = square()
    builder.add_area(range(4), pressure=value)
    refused(builder, f"pressure of volume 0 is {value}")
    builder = square()
    builder.add_shape_match(range(4), compliance=value)
    refused(builder, f"compliance of shape match 0 is {value}")
    builder = square()
    builder.add_attachment(0, 1, compliance=value)
    refused(builder, f"compliance of attachment 0 is {value}")


def test_a_shape_has_different_particles_on_more_than_one_spot():
    builder = square()
    builder.add_shape_match([0, 5])
    refused(builder, "particle of shape match 0: 1 is 5")
    for particles in ([0], [0, 1, 0]):
        builder = square()
        builder.add_shape_match(particles)
        refused(builder, "shape match 0 is .* 2 or more different particles")
    builder = square()
    builder.add_shape_match([2, *builder.add_particles((1.0, 1.0), 1.0)])
    refused(builder, "shape match 0 has all its 2 particles on one spot")
    builder = square()
    builder.add_shape_match([0, 1, 2])
    builder.add_shape_match([2, 1, 0])
    refused(builder, r"shape match 1 \[2 1 0\] repeats shape match 0")


def test_an_attachment_holds_two_particles_at_an_offset_of_finite_numbers():
    for pair, match in (
        ((0, 4), r"particles of attachment 0 is \[0 4\]"),
        ((2, 2), "attachment 0"),
    ):
        builder = square()
        builder.add_attachment(*pair, offset=(0.0, 0.0))
        refused(builder, match)
    for offset in ((0.0, NAN), (0.0,), 1.0):
        builder = square()
        builder.add_attachment(0, 1, offset=offset)
        refused(builder, "offset of attachment 0 is .* expected 2 finite numbers")
    builder = square()
    builder.add_attachment(0, 1)
    builder.add_attachment(1, 0)
    refused(builder, r"attachment 1 \[1 0\] repeats attachment 0")


def test_bodies_are_made_of_what_can_be_solved():
    with pytest.raises(ValueError, match=r"outline has shape \(2, 2\)"):
        shapes.soft_body_2d(ModelBuilder(2), [(0, 0), (1, 0)], mass=1.0)
    for stiffness in (0.0, -1.0, NAN):
        with pytest.raises(ValueError, match=f"stretch_stiffness is {stiffness}"):
            shapes.soft_body_2d(
                ModelBuilder(2), [(0, 0), (1, 0), (0, 1)], mass=1.0, stretch_stiffness=stiffness
            )
    with pytest.raises(ValueError, match="subdivisions is 5"):
        shapes.soft_ball(ModelBuilder(3), (0, 0, 0), 1.0, mass=1.0, subdivisions=5)
    with pytest.raises(ValueError, match=r"size is \(1, 0\)"):
        shapes.rigid_box(ModelBuilder(2), (0, 0), (1, 0), mass=1.0)
    with pytest.raises(ValueError, match="counts is 1"):
        shapes.rigid_box(ModelBuilder(2), (0, 0), (1, 1), mass=1.0, counts=1)


def test_a_frame_has_points_a_place_and_a_rotation():
    with pytest.raises(ValueError, match=r"points have shape \(2,\)"):
        frame_targets([0.0, 1.0], [0.0, 0.0], 0.0)
    with pytest.raises(ValueError, match=r"position has shape \(3,\); expected \(..., 2\)"):
        frame_targets([[0.0, 1.0]], [0.0, 0.0, 0.0], 0.0)
    with pytest.raises(ValueError, match="expected a quaternion"):
        frame_targets([[0.0, 1.0, 0.0]], [0.0, 0.0, 0.0], 0.0)
    with pytest.raises(ValueError, match="a quaternion may not be 0"):
        frame_targets([[0.0, 1.0, 0.0]], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="rotation is nan; its numbers must be finite"):
        frame_targets([[0.0, 1.0]], [0.0, 0.0], NAN)


def test_a_frame_turns_anticlockwise_and_any_number_of_times():
    for angle in (np.pi / 2, np.pi / 2 + 20 * np.pi):
        # cosine and sine within 1e-14, and the rounding of the angle itself
        at = frame_targets([[1.0, 0.0], [0.0, 2.0]], [5.0, 5.0], angle)
        np.testing.assert_allclose(at, [[5.0, 6.0], [3.0, 5.0]], atol=1e-13)
    at = frame_targets([[1.0, 0.0, 0.0]], np.zeros((3, 2, 3)), [2.0, 0.0, 0.0, 2.0])
    np.testing.assert_allclose(at, np.broadcast_to([0.0, 1.0, 0.0], (3, 2, 1, 3)), atol=1e-15)


def test_a_subdivided_ball_is_closed_and_nears_the_sphere():
    volumes = []
    for subdivisions in range(4):
        builder = ModelBuilder(3)
        ball = shapes.soft_ball(builder, (1, 2, 3), 0.5, mass=1.0, subdivisions=subdivisions)
        table = builder.build().volumes
        assert table is not None
        assert len(ball) == 10 * 4**subdivisions + 2
        volumes.append(table.rest[0] / (4.0 / 3.0 * np.pi * 0.5**3))
    # the gap to the sphere is of second order in the edges, which are halved
    gaps = 1.0 - np.array(volumes)
    np.testing.assert_allclose(gaps[1:-1] / gaps[2:], 4.0, rtol=0.1)
