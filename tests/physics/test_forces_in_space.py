"""Laws of the forces that a step tells, for the kinds of space: sheets, tetrahedra, cloth.

All tests share one set of kinds and two lanes, as those of the plane do.
"""

import functools

import numpy as np

from pbd_gym.physics import ModelBuilder, World, readouts, shapes
from scenes import GRAVITY

DT, SUBSTEPS = 1 / 60, 10


def scene():
    """Systems beside each other, and their particles by name; each is at rest or close to it."""
    builder, at = ModelBuilder(3), {}
    for y, name, add in ((0.0, "hinge", builder.add_hinge), (1.0, "fold", builder.add_fold)):
        # a triangle that is held, and one that sticks out over its edge
        corners = [(0.0, y, 2.0), (0.0, y + 0.2, 2.0), (-0.2, y + 0.1, 2.0), (0.2, y + 0.1, 2.0)]
        at[name] = builder.add_particles(corners, 0.3)
        builder.pin(at[name][:3])
        for end in at[name][:2]:
            builder.add_distance(at[name][3], end)
        add(at[name][:2], at[name][2:], bending_stiffness=30.0)
    base = [(1.0, 0.0, 1.0), (1.3, 0.0, 1.0), (1.0, 0.3, 1.0), (1.1, 0.1, 1.4)]
    at["tetrahedron"] = builder.add_particles(base, 0.5)
    builder.pin(at["tetrahedron"][:3])
    builder.add_tetrahedra([at["tetrahedron"]], compliance=1e-6)
    at["cloth"] = shapes.cloth(
        builder,
        (2.0, 0.0, 2.0),
        (0.0, 0.0, -0.2),
        (0.2, 0.0, 0.0),
        (5, 5),
        mass=0.1,
        pinned=[(0, column) for column in range(5)],
    )
    at["pair"] = builder.add_particles([(3.0, 0.0, 1.0), (3.0, 0.5, 1.0)], 0.4)
    builder.pin(at["pair"][0])
    members = np.concatenate([at["cloth"].ravel(), at["pair"]])
    builder.set_self_collision(members, 0.03, friction=0.5)
    return World(builder.build(damping=5.0), 3, dtype=np.float64, lanes=2), at


@functools.cache
def at_rest():
    """The forces of the last world after ten seconds, its positions, model and names."""
    state, at = scene()
    # built apart, as neighbours in the body do not collide; now one lies on the other
    state.x[:, at["pair"][1]] = state.x[:, at["pair"][0]] + (0.0, 0.0, 0.03)
    for _ in range(600):
        state.step(DT, SUBSTEPS, record=True)  # always: kernels that do not are others
    return type(state.forces)(*(part[2] for part in state.forces)), state.x[2], state.model, at


def test_a_hinge_holds_a_wing_with_weight_times_arm():
    forces, x, _, at = at_rest()
    load = 0.3 * GRAVITY * x[at["hinge"][3], 0]
    # rigid distances take nothing about the edge; rounding as in the plane
    np.testing.assert_allclose(abs(forces.hinges[0]), load, rtol=1e-4)


def test_a_fold_holds_a_wing_by_its_weight():
    forces, x, model, at = at_rest()
    # its force on the wing is upright on it but for half of the angle of 0.01 rad
    lift = forces.folds[0] * abs(model.folds.weights[0, 3])
    arm = np.hypot(x[at["fold"][3], 0], x[at["fold"][3], 2] - 2.0)
    np.testing.assert_allclose(lift * arm, 0.3 * GRAVITY * x[at["fold"][3], 0], rtol=1e-4)


def test_the_pressure_of_a_tetrahedron_carries_its_apex():
    forces, x, model, _ = at_rest()
    # dV/dz = base/3
    np.testing.assert_allclose(forces.volumes[0] * 0.045 / 3.0, 0.5 * GRAVITY, rtol=1e-9)
    missing = -readouts.volume_violations(model, x[None])[0, 0]
    np.testing.assert_allclose(missing / model.volumes.compliance[0], forces.volumes[0], rtol=1e-6)


def test_the_threads_and_diagonals_of_a_cloth_carry_it_at_its_pins():
    forces, x, model, at = at_rest()
    carried, pinned = 0.0, at["cloth"][0]
    pairs, _ = model.links()
    for ends, pulls in ((pairs, forces.chains), (model.distances.pairs, forces.distances)):
        for pin, other in ((0, 1), (1, 0)):
            held = np.isin(ends[:, pin], pinned) & ~np.isin(ends[:, other], pinned)
            away = x[ends[held, pin]] - x[ends[held, other]]
            carried += np.sum(pulls[held] * away[:, 2] / np.linalg.norm(away, axis=1))
    # diagonals of 7 cm pull while their ends have fallen by g h^2: along 4e-4 rad from where they
    # end, of 0.07 N. Bends carry the rest: that fall over 10 m/N in each of five threads
    np.testing.assert_allclose(carried, 0.1 * 20 / 25 * GRAVITY, atol=5e-5)


def test_a_particle_presses_on_the_one_below_with_its_weight():
    forces, _, _, at = at_rest()
    weight = 0.4 * GRAVITY
    np.testing.assert_allclose(forces.contacts[at["pair"]], weight, rtol=1e-9)
    np.testing.assert_allclose(
        forces.self_collision[at["pair"]], [[0.0, 0.0, -weight], [0.0, 0.0, weight]], atol=1e-8
    )
