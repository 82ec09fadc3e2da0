"""What a builder refuses of walls, shapes and collisions."""

import numpy as np
import pytest

from refusals import line, refused

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize(
    ("lower", "upper"), [((0, 2), (5, 1)), ((0, 1), (5, 1)), ((0, NAN), (5, 5)), ((0, 0), (5, NAN))]
)
def test_a_lower_wall_lies_below_the_upper_one(lower, upper):
    builder = line()
    builder.set_room(lower, upper)
    refused(builder, f"lower wall of axis 1 is {float(lower[1])}")


def test_a_room_leaves_space_between_the_radii_at_its_walls():
    builder = line()
    builder.set_room((-9, 0.0), (9, 0.1), radius=0.05)
    refused(builder, "lower wall of axis 1 is 0.0")


def test_a_room_has_two_walls_per_axis():
    builder = line()
    builder.set_room((0.0, 0.0, 0.0), (1.0, 1.0))
    refused(builder, r"walls have shapes \(3,\) and \(2,\); expected \(2,\)")


@pytest.mark.parametrize("value", [-0.1, NAN, INF])
def test_properties_of_walls_are_finite_and_not_negative(value):
    for name in ("friction", "restitution"):
        builder = line()
        builder.set_ground(-1.0, **{name: value})
        refused(builder, f"{name} is {value}")
    builder = line()
    builder.set_ground(-1.0, radius=value)
    refused(builder, f"wall radius is {value}")


def test_restitution_is_at_most_one():
    builder = line()
    builder.set_ground(-1.0, restitution=1.01)
    refused(builder, r"restitution is 1\.01")


def test_particles_are_placed_at_the_self_collision_distance_or_farther():
    builder = line()
    builder.set_self_collision([0, 1, 3], 1.001)
    refused(builder, r"self-collision distance is 1\.001; particle 0 is placed 1\.0 m")


@pytest.mark.parametrize("distance", [-1.0, NAN, INF])
def test_a_self_collision_distance_is_finite_and_not_negative(distance):
    builder = line()
    builder.set_self_collision([0, 1], distance)
    refused(builder, f"self-collision distance is {distance}")


def test_self_collision_names_a_particle_once():
    builder = line()
    builder.set_self_collision([0, 1, 0], 0.1)
    refused(builder, "self-collision names a particle twice")


def add_shapes(builder, **surface):
    """A ball before the shape that is in question, so that its index is 1."""
    builder.add_sphere((0.0, 5.0), 0.1)
    builder.add_sphere((1.0, 5.0), 0.1, **surface)


@pytest.mark.parametrize("value", [-0.1, NAN, INF])
def test_properties_of_colliders_are_finite_and_not_negative(value):
    for name in ("margin", "restitution", "friction"):
        builder = line()
        add_shapes(builder, **{name: value})
        refused(builder, f"{name} of collider 1 is {value}")


def test_kinetic_friction_is_not_above_that_of_rest():
    builder = line()
    add_shapes(builder, friction=0.3, kinetic_friction=0.4)
    refused(builder, r"kinetic friction of collider 1 is 0\.4")
    builder = line()
    builder.set_ground(-1.0, friction=0.3, kinetic_friction=0.4)
    refused(builder, r"kinetic friction is 0\.4")


def test_colliders_have_a_size_and_a_place():
    for radius in (0.0, -1.0, NAN, INF):
        builder = line()
        builder.add_sphere((0.0, 5.0), radius)
        refused(builder, "size of collider 0")
    builder = line()
    builder.add_box((0.0, NAN), (1.0, 1.0))
    refused(builder, "place of collider 0")
    builder = line()
    builder.add_plane((0.0, 0.0), (0.0, 0.0))
    refused(builder, "normal of collider 0")
    builder = line()
    builder.add_box((0.0, 5.0), (1.0, 1.0), axes=[[1.0, 0.0], [0.1, 1.0]])
    refused(builder, "axes of collider 0")
    with pytest.raises(ValueError, match=r"axes have shape \(3, 3\)"):
        line().add_box((0.0, 5.0), (1.0, 1.0), axes=np.eye(3))
    with pytest.raises(ValueError, match=r"start has shape \(3,\)"):
        line().add_sphere((0.0, 5.0, 0.0), 1.0)


@pytest.mark.parametrize("pin", [-1, 2, 4, 2.0])
def test_pins_carry_colliders(pin):
    builder = line()
    builder.pin(0)
    builder.add_capsule((0.0, 5.0), (1.0, 5.0), 0.1, pins=(0, pin))
    with pytest.raises((ValueError, TypeError), match=r"pin of colliders 1 is|particles are"):
        builder.build()


def test_bodies_that_collide_are_made_of_particles_that_exist():
    builder = line()
    builder.add_collision([0, 1], 0.1)
    builder.add_collision([2, 4], 0.1)
    refused(builder, "particle of collision 1, 1 is 4; particles are numbered 0 to 3")
    builder = line()
    builder.add_collision([0, 1], 0.1, links=[[0, 1], [1, 1]])
    refused(builder, r"link of collision 0, 1 is \[1 1\]")
    builder = line()
    builder.add_collision([0, 1], 0.1, links=[[1, 2]])
    refused(builder, "collision 0 links particle 2, which is not of the body")


def test_a_particle_collides_as_part_of_one_body():
    builder = line()
    builder.add_collision([0, 1], 0.1)
    builder.add_collision([1, 2], 0.1)
    refused(builder, "particle 1 is named twice")
    builder = line()
    builder.add_collision([0, 1, 0], 0.1)
    refused(builder, "particle 0 is named twice")


@pytest.mark.parametrize("value", [-0.1, NAN, INF])
def test_properties_of_collisions_are_finite_and_not_negative(value):
    builder = line()
    builder.add_collision([0, 1], value)
    refused(builder, f"radius of collision 0 is {value}")
    for name in ("friction", "restitution"):
        builder = line()
        builder.add_collision([0, 1], 0.1)
        builder.add_collision([2, 3], 0.1, **{name: value})
        refused(builder, f"{name} of collision 1 is {value}")


def test_one_body_alone_collides_with_nothing():
    builder = line()
    builder.add_collision([0, 1], 0.1)
    assert builder.build().encounters is None
