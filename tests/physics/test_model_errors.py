import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, shapes
from refusals import line, refused

NAN, INF = np.nan, np.inf


@pytest.mark.parametrize("dim", [0, 1, 4, "2"])
def test_a_model_has_two_or_three_axes(dim):
    with pytest.raises(ValueError, match=f"dim is {dim!r}"):
        ModelBuilder(dim)


def test_a_model_has_particles():
    refused(ModelBuilder(2), "0 particles")


@pytest.mark.parametrize("mass", [0.0, -2.5, NAN, INF, -INF])
def test_a_mass_is_positive_and_finite(mass):
    builder = line()
    builder.add_particles([[0.0, 1.0]], mass)
    refused(builder, f"mass of particle 4 is {mass}")


def test_the_mass_of_a_pin_does_not_matter():
    builder = line()
    builder.add_particles([[0.0, 1.0]], 0.0, pinned=True)
    assert builder.build().inverse_mass[4] == 0.0


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_positions_are_finite(value):
    builder = line()
    builder.add_particles([[0.0, 1.0], [1.0, value]], 1.0)
    refused(builder, rf"position of particle 5 is \[\s*1\.\s+{value}\]")


@pytest.mark.parametrize("positions", [[[1.0, 2.0, 3.0]], [1.0], [[[0.0, 1.0]]]])
def test_positions_have_one_coordinate_per_axis(positions):
    with pytest.raises(ValueError, match=r"positions have shape .* expected \(n, 2\)"):
        line().add_particles(positions, 1.0)


@pytest.mark.parametrize("particle", [4, -1, 1000])
def test_only_particles_that_exist_can_be_pinned(particle):
    with pytest.raises(ValueError, match=f"cannot pin particle {particle}: there are 4"):
        line().pin(particle)


@pytest.mark.parametrize("particle", [4, -1])
def test_constraints_hold_particles_that_exist(particle):
    range_of_particles = "particles are numbered 0 to 3"
    for rest in (None, 1.0):
        builder = line()
        builder.add_chain([0, 1, particle], rest=rest)
        refused(builder, f"particle of chain entry 2 is {particle}; {range_of_particles}")
        builder = line()
        builder.add_distance(0, 1)
        builder.add_distance(2, particle, rest=rest)
        refused(builder, rf"distance constraint 1 is \[ ?2 +{particle}\]; {range_of_particles}")
    builder = line()
    builder.add_bend(0, 1, particle, compliance=1.0)
    refused(builder, rf"bend 0 is \[ ?0 +1 +{particle}\]; {range_of_particles}")
    builder = line()
    builder.set_self_collision([0, particle], 0.1)
    refused(builder, f"particle of self-collision 1 is {particle}; {range_of_particles}")


@pytest.mark.parametrize("particles", [[], [2]])
def test_a_chain_has_two_particles(particles):
    builder = line()
    builder.add_chain(particles)
    refused(builder, f"number of particles in chain 0 is {len(particles)}")


def test_a_chain_does_not_visit_a_particle_twice():
    builder = line()
    builder.add_chain([0, 1])
    builder.add_chain([1, 2, 3, 1], rest=1.0)
    refused(builder, "chain 1 visits particle 1 twice")


@pytest.mark.parametrize("rest", [0.0, -1.0, NAN, INF])
def test_a_rest_length_is_positive_and_finite(rest):
    builder = line()
    builder.add_chain([0, 1, 2], rest=[1.0, rest])
    refused(builder, f"rest length of chain entry 1 is {rest}")
    builder = line()
    builder.add_distance(0, 1, rest=rest)
    refused(builder, f"rest length of distance constraint 0 is {rest}")


def test_a_link_between_particles_on_one_spot_has_no_length():
    builder = ModelBuilder(2)
    builder.add_particles([[1.0, 1.0], [1.0, 1.0]], 1.0)
    builder.add_chain([0, 1])
    refused(builder, "rest length of chain entry 0 is 0.0")
    builder = ModelBuilder(2)
    builder.add_particles([[1.0, 1.0], [1.0, 1.0]], 1.0)
    builder.add_distance(0, 1)
    refused(builder, "rest length of distance constraint 0 is 0.0")


def test_a_pair_is_linked_once():
    builder = line()
    builder.add_chain([0, 1, 2])
    builder.add_chain([2, 1])
    refused(builder, r"link 2 \[2 1\] repeats link 1")
    builder = line()
    builder.add_distance(0, 1)
    builder.add_distance(1, 0)
    refused(builder, r"link 1 \[1 0\] repeats link 0")
    builder = line()
    builder.add_chain([0, 1, 2])
    builder.add_distance(1, 2)
    refused(builder, r"link 2 \[1 2\] repeats link 1")
    builder = line()
    builder.add_bend(0, 1, 2, compliance=1.0)
    builder.add_bend(2, 1, 0, compliance=2.0)
    refused(builder, r"bend 1 \[2 1 0\] repeats bend 0")


def test_a_constraint_holds_different_particles():
    builder = line()
    builder.add_distance(2, 2, rest=1.0)
    refused(builder, r"distance constraint 0 is \[2 2\]")
    builder = line()
    builder.add_bend(0, 1, 0, compliance=1.0)
    refused(builder, r"bend 0 is \[0 1 0\]")


@pytest.mark.parametrize("compliance", [-1e-9, NAN, INF])
def test_a_compliance_is_finite_and_not_negative(compliance):
    builder = line()
    builder.add_chain([0, 1], compliance=compliance)
    refused(builder, f"compliance of chain entry 0 is {compliance}")
    builder = line()
    builder.add_distance(0, 1, compliance=compliance)
    refused(builder, f"compliance of distance constraint 0 is {compliance}")
    builder = line()
    builder.add_bend(0, 1, 2, compliance=compliance)
    refused(builder, f"compliance of bend 0 is {compliance}")


@pytest.mark.parametrize("limit", [-0.01, NAN])
def test_a_strain_limit_is_not_negative(limit):
    builder = line()
    builder.add_chain([0, 1, 2])
    builder.add_chain([2, 3], strain_limit=limit)
    refused(
        builder, f"greatest length of chain entry 3 is {1.0 + limit}; a strain limit is at least 0"
    )


@pytest.mark.parametrize("damping", [-0.1, NAN, INF])
def test_the_damping_of_a_chain_is_finite_and_not_negative(damping):
    builder = line()
    builder.add_chain([0, 1, 2])
    builder.add_chain([2, 3], damping=damping)
    refused(builder, f"damping of chain entry 3 is {damping}; finite and at least 0")


@pytest.mark.parametrize("friction", [-0.1, NAN, INF])
def test_the_friction_of_a_bend_is_finite_and_not_negative(friction):
    builder = line()
    builder.add_bend(0, 1, 2, compliance=1.0)
    builder.add_bend(1, 2, 3, compliance=1.0, friction=friction)
    refused(builder, f"friction of bend 1 is {friction}")


@pytest.mark.parametrize("stiffness", [0.0, -0.5, 1.0001, NAN])
def test_the_seeds_stiffness_is_a_share(stiffness):
    builder = line()
    builder.add_distance(0, 1)
    builder.add_distance(1, 2, stiffness=stiffness)
    refused(builder, f"stiffness k of distance constraint 1 is {stiffness}")


@pytest.mark.parametrize("gravity", [(0.0,), (0.0, 0.0, -9.81), (0.0, NAN), (INF, 0.0), 9.81])
def test_gravity_has_one_finite_number_per_axis(gravity):
    refused(line(), "gravity is .* expected 2 finite numbers", gravity=gravity)


@pytest.mark.parametrize("damping", [-0.1, NAN, INF])
def test_damping_is_a_finite_rate(damping):
    refused(line(), f"damping is {damping}", damping=damping)


@pytest.mark.parametrize("integrator", ["verlet", "", "PBD", None])
def test_an_integrator_is_one_that_exists(integrator):
    refused(line(), f"integrator is {integrator!r}; allowed: pbd, rattle", integrator=integrator)


@pytest.mark.parametrize("name", ["iterations", "contact_sweeps"])
@pytest.mark.parametrize("count", [0, -1, 1.5, 2.0, True, "2", NAN])
def test_iterations_and_sweeps_are_whole_numbers(name, count):
    refused(line(), f"{name} is {count!r}", **{name: count})


def test_a_shape_has_enough_particles():
    with pytest.raises(ValueError, match="particles is 1"):
        shapes.rope(ModelBuilder(2), (0, 0), (1, 0), 1, mass=1.0)
    with pytest.raises(ValueError, match=r"shape is \(1, 4\)"):
        shapes.cloth(ModelBuilder(3), (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 4), mass=1.0)
    with pytest.raises(ValueError, match="2 lengths and 1 masses"):
        shapes.pendulum(ModelBuilder(2), (0, 0), (1.0, 1.0), (1.0,))


def test_a_builder_that_was_refused_can_be_corrected():
    builder = line()
    builder.set_ground(-1.0, restitution=2.0)
    refused(builder, "restitution is 2.0")
    builder.set_ground(-1.0, restitution=0.5)
    assert builder.build().room.restitution == 0.5


def test_a_model_cannot_be_changed():
    model = line().build()
    with pytest.raises(ValueError, match="read-only"):
        model.positions[0] = 1.0
    with pytest.raises(AttributeError):
        model.damping = 1.0


def test_a_fingerprint_tells_models_apart_and_nothing_else():
    base = line().build()
    assert line().build().fingerprint == base.fingerprint
    settings = [{"damping": 0.1}, {"iterations": 2}, {"gravity": (0, 0)}]
    changed = [line().build(**other) for other in settings]
    pinned = line()
    pinned.pin(0)
    fingerprints = {model.fingerprint for model in (base, *changed, pinned.build())}
    assert len(fingerprints) == 5
