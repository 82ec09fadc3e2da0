"""Laws of the forces that a step tells, for every kind in the plane.

All tests share one set of kinds, so that the kernels are compiled once for each integrator, and
two lanes with a world too many, so that forces in the wrong lane or world are seen.
"""

import functools

import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder, World, readouts
from scenes import GRAVITY

DT, SUBSTEPS = 1 / 60, 10
H = DT / SUBSTEPS
DAMPING = 5.0  # ten seconds leave exp(-25) = 1e-11 of the first motion
DOWN = np.array([0.0, -GRAVITY])
SETTINGS = [("pbd", 1), ("pbd", 3), ("rattle", 1), ("rattle", 3)]
every_setting = pytest.mark.parametrize(("integrator", "iterations"), SETTINGS)
LAST = 2  # the world that is looked at


def scene(bounce=0.0, **settings):
    """Systems beside each other, and their particles by name; each is at rest or close to it."""
    builder, at = ModelBuilder(2), {}
    for name, slack, x in (("rope", False, 0.0), ("slack rope", True, 1.0)):
        at[name] = builder.add_particles([(x, 3.0 - 0.1 * i) for i in range(6)], 0.2)
        builder.pin(at[name][0])
        builder.add_chain(at[name], slack=slack, implicit=True)
    at["rod"] = builder.add_particles([(2.0 + 0.1 * i, 3.0) for i in range(6)], 0.2)
    builder.pin(at["rod"][:2])
    builder.add_chain(at["rod"])
    builder.add_rod(at["rod"], bending_stiffness=20.0)
    at["tether"] = builder.add_particles([(3.0, 3.0), (3.0, 2.0)], 2.0)
    builder.pin(at["tether"][0])
    builder.add_tether(at["tether"][1], at["tether"][0], 1.0)
    at["spring"] = builder.add_particles([(4.0, 3.0), (4.0, 2.0)], 2.0)
    builder.pin(at["spring"][0])
    builder.add_distance(*at["spring"], compliance=1e-2, strain_limits=(-0.1, 0.05))
    at["lamp"] = builder.add_particles([(5.0, 3.0), (5.2, 2.8), (5.2, 2.3)], 1.5)
    builder.pin(at["lamp"][0])
    builder.add_attachment(at["lamp"][1], at["lamp"][0])
    builder.add_distance(at["lamp"][1], at["lamp"][2])
    _add_bag(builder, at)
    at["box"] = builder.add_particles([(7.0, 0.0), (7.4, 0.0), (7.4, 0.2), (7.0, 0.2)], 0.5)
    builder.add_shape_match(at["box"])
    at["ball"] = builder.add_particles((8.0 + 0.5 * np.sin(0.2), 1.0 + 0.5 * np.cos(0.2)), 3.0)
    builder.add_sphere((8.0, 1.0), 0.5, friction=0.5, restitution=bounce)
    at["stack"] = builder.add_particles([(9.0, 0.0), (9.0, 0.2)], 1.0)
    at["beam"] = builder.add_particles([(10.0, 0.5), (11.0, 0.5), (10.3, 0.7)], 1.0)
    builder.pin(at["beam"][:2])
    builder.add_collision(at["stack"], 0.1, within=True, restitution=bounce)
    builder.add_collision(at["beam"][:2], 0.1, links=[at["beam"][:2]])
    builder.add_collision(at["beam"][2:], 0.1, friction=0.5, restitution=bounce)
    builder.set_ground(0.0, friction=0.5, restitution=bounce)
    state = World(builder.build(**settings), LAST + 1, dtype=np.float64, lanes=2)
    return state, at


def _add_bag(builder, at):
    """Eight springs around an area that is blown up."""
    turn = 2.0 * np.pi / 8 * np.arange(8)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    at["bag"] = builder.add_particles((6.0, 0.5) + 0.3 * ring, 0.1)
    for i in (*range(0, 8, 2), *range(1, 8, 2)):
        builder.add_distance(at["bag"][i], at["bag"][(i + 1) % 8], compliance=1e-3)
    builder.add_area(at["bag"], pressure=1.2, compliance=1e-3)


@functools.cache
def at_rest(integrator="pbd", iterations=1, gravity=GRAVITY):
    """The forces of the last world after ten seconds, its positions, model and names."""
    state, at = scene(
        damping=DAMPING, integrator=integrator, iterations=iterations, gravity=(0.0, -gravity)
    )
    for _ in range(600):
        state.step(DT, SUBSTEPS, record=True)  # always: kernels that do not are others
    return (
        type(state.forces)(*(part[LAST] for part in state.forces)),
        state.x[LAST],
        state.model,
        at,
    )


# Where nothing else is said, a force at rest is a move of g h^2 = 3e-5 m, rounded to 1e-15 m (of
# positions of 10 m): exact to 1e-10. 1e-9 leaves room for their sums.
EXACT = {"rtol": 1e-9, "atol": 1e-8}


@every_setting
def test_implicit_and_slack_ropes_carry_what_hangs_below(integrator, iterations):
    forces, *_ = at_rest(integrator, iterations)
    below = 0.2 * GRAVITY * np.arange(5, 0, -1)
    np.testing.assert_allclose(forces.ropes, [*below, *below], **EXACT)


@every_setting
def test_a_cantilever_bends_at_its_root_with_load_times_arm(integrator, iterations):
    forces, x, _, at = at_rest(integrator, iterations)
    root, free = x[at["rod"][1]], x[at["rod"][2:]]
    load = 0.2 * GRAVITY * np.sum(free[:, 0] - root[0])
    # its spacing is the arm of the force; they are at right angles but for half of the joint's
    # angle, which is load x spacing/EI = 0.01 rad: 1 - cos(0.005) = 1e-5
    np.testing.assert_allclose(forces.rods[0] * 0.1, load, rtol=3e-5)


@every_setting
def test_a_tether_carries_a_weight_and_a_strain_limit_what_a_spring_leaves(integrator, iterations):
    forces, *_ = at_rest(integrator, iterations)
    np.testing.assert_allclose(forces.limits[0], 2.0 * GRAVITY, **EXACT)
    np.testing.assert_allclose(forces.limits[1] + forces.distances[0], 2.0 * GRAVITY, **EXACT)


@every_setting
def test_an_attachment_carries_what_hangs_on_it(integrator, iterations):
    forces, *_ = at_rest(integrator, iterations)
    np.testing.assert_allclose(forces.attachments[0], [0.0, 3.0 * GRAVITY], **EXACT)


@every_setting
def test_the_ground_carries_soft_and_rigid_bodies(integrator, iterations):
    forces, _, _, at = at_rest(integrator, iterations)
    for name, mass, rounding in (("bag", 0.8, 1e-8), ("box", 2.0, 1e-9)):
        # the bag sways with 1 nm/s still: so much per h is 6e-7 m/s2, of 9.81
        carried = np.sum(forces.walls[at[name]], axis=0)
        np.testing.assert_allclose(carried, [0.0, mass * GRAVITY], rtol=rounding, atol=1e-6)
        np.testing.assert_allclose(np.sum(forces.contacts[at[name]]), carried[1], rtol=1e-12)


@every_setting
def test_shape_matching_exerts_no_net_force_and_no_torque(integrator, iterations):
    forces, x, model, _ = at_rest(integrator, iterations)
    pull, arm = forces.shape_matches, x[model.shape_matches.particles]
    assert np.abs(pull).max() > 0.4 * GRAVITY  # the upper corners are carried by the lower ones
    np.testing.assert_allclose(np.sum(pull, axis=0), 0.0, atol=1e-8)
    torque = np.sum(arm[:, 0] * pull[:, 1] - arm[:, 1] * pull[:, 0])
    np.testing.assert_allclose(torque, 0.0, atol=1e-7)  # arms of 7 m


@every_setting
def test_a_ball_presses_on_a_slope_with_its_share_of_its_weight(integrator, iterations):
    forces, x, _, at = at_rest(integrator, iterations)
    ball = at["ball"][0]
    np.testing.assert_allclose(forces.colliders[ball], [0.0, 3.0 * GRAVITY], **EXACT)
    height = (x[ball, 1] - 1.0) / 0.5
    # pushed out along the normal below the fall of g h^2, not where it began: 3e-5 m of 0.5 m
    np.testing.assert_allclose(forces.contacts[ball], 3.0 * GRAVITY * height, rtol=6e-5)


@every_setting
def test_balls_on_each_other_press_with_the_weight_above(integrator, iterations):
    forces, _, _, at = at_rest(integrator, iterations)
    lower, upper = at["stack"]
    weight = np.array([0.0, GRAVITY])
    np.testing.assert_allclose(forces.encounters[[lower, upper]], [-weight, weight], **EXACT)
    np.testing.assert_allclose(forces.walls[lower], 2.0 * weight, **EXACT)
    np.testing.assert_allclose(forces.contacts[[lower, upper]], [3.0 * GRAVITY, GRAVITY], **EXACT)


@every_setting
def test_a_ball_on_a_beam_presses_on_its_ends_by_the_lever(integrator, iterations):
    forces, _, _, at = at_rest(integrator, iterations)
    shares = np.array([0.7, 0.3, 1.0])
    np.testing.assert_allclose(forces.contacts[at["beam"]], shares * GRAVITY, **EXACT)
    up = np.array([-0.7, -0.3, 1.0])
    np.testing.assert_allclose(forces.encounters[at["beam"], 1], up * GRAVITY, **EXACT)


@every_setting
def test_the_pressure_of_a_bag_follows_its_compliance_and_the_law_of_laplace(
    integrator, iterations
):
    forces, x, model, at = at_rest(integrator, iterations, gravity=0.0)
    pressure = forces.volumes[0]
    missing = -readouts.volume_violations(model, x[None])[0, 0]
    # Newton's step of a quadratic content: a move of w p l h^2 = 3e-4 m squared, of 0.3 m2
    np.testing.assert_allclose(pressure, missing / model.volumes.compliance[0], rtol=1e-3)
    ring = x[at["bag"]]
    edges = np.roll(ring, -1, axis=0) - ring
    apothem = np.mean(np.linalg.norm(edges, axis=1)) / (2.0 * np.tan(np.pi / 8))
    springs = forces.distances[2:]
    # springs are solved in turn before the area: within a substep the ring moves by 1e-3 of itself
    np.testing.assert_allclose(springs, pressure * apothem, rtol=3e-3)


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
def test_what_collides_obeys_the_second_law_of_newton(integrator):
    state, at = scene(bounce=0.6, integrator=integrator, iterations=2)
    moving = np.concatenate([at["ball"], at["stack"], at["beam"][2:], at["box"]])
    mass = 1.0 / state.model.inverse_mass[moving, None]
    generator = np.random.default_rng(3)
    state.v[:, moving] = generator.normal(scale=1.5, size=(LAST + 1, len(moving), 2))
    touched = np.zeros(3, dtype=int)
    for _ in range(400):
        before = state.v[:, moving].copy()
        state.step(H, 1, record=True)
        forces = state.forces
        contact = forces.walls + forces.colliders + forces.encounters
        contact[:, state.model.shape_matches.particles] += forces.shape_matches
        gained = mass * ((state.v[:, moving] - before) / H - DOWN)
        # velocities are differences of positions of 10 m over h, so that forces of 3 kg round to
        # 1e-15 m * 3 kg / h^2 = 1e-9 N a move, with some tens of moves in a substep
        np.testing.assert_allclose(contact[:, moving], gained, rtol=1e-9, atol=1e-6)
        touched += [np.any(part) for part in (forces.walls, forces.colliders, forces.encounters)]
    assert (touched > 50).all()


def test_a_swinging_rope_pulls_on_its_end_as_the_second_law_asks():
    state, at = scene(iterations=2)
    for name in ("rope", "slack rope"):
        state.v[:, at[name], 0] = np.linspace(0.0, 2.0, 6)
    for _ in range(40):
        for _ in range(SUBSTEPS):
            before = state.v.copy()
            state.step(H, 1, record=True)
            for name, link in (("rope", 4), ("slack rope", 9)):
                end, other = at[name][-1], at[name][-2]
                direction = state.x[:, other] - state.x[:, end]
                direction /= np.linalg.norm(direction, axis=1)[:, None]
                pull = state.forces.ropes[:, link, None] * direction
                gained = 0.2 * ((state.v[:, end] - before[:, end]) / H - DOWN)
                # what the first iteration leaves of the length goes with the square of a link's
                # turn, w h = 4/s * h = 7e-3, and the second squares that: 2e-9 of some 5 N while
                # it swings evenly, and up to 1e-7 N where it whips
                np.testing.assert_allclose(pull, gained, atol=1e-6)
