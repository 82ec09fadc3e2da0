import numpy as np
import pytest

from pbd_gym.physics import ModelBuilder
from scenes import GRAVITY, momenta, pendulum_2d, rope_2d, strain, turn, world


def test_a_hanging_chain_keeps_its_length():
    state = world(rope_2d(20, pins=[0]))
    for _ in range(120):
        state.step(1 / 60, 10)
    # a straight chain is solved exactly: what is left is the rounding of coordinates of 1 m
    assert strain(state) < 1e-12
    assert state.x[0, -1, 1] == pytest.approx(-1.0, abs=1e-12)


def test_a_hanging_elastic_chain_stretches_by_the_law_of_hooke():
    particles, mass, compliance = 6, 0.6, 1e-3
    model = rope_2d(particles, pins=[0], rope={"mass": mass, "compliance": compliance}, damping=4.0)
    state = world(model)
    for _ in range(600):
        state.step(1 / 60, 10)
    # the link below particle i carries the particles i + 1 ... n - 1, at rest after 10 s: the
    # slowest mode, (pi/10) sqrt(1/(0.1 * 1e-3)) = 31 rad/s, has decayed by exp(-2 * 10)
    carried = np.arange(particles - 1, 0, -1) * mass / particles
    stretch = np.diff(-state.x[0, :, 1]) - 1.0 / (particles - 1)
    np.testing.assert_allclose(stretch, compliance * carried * GRAVITY, rtol=1e-6)


def test_the_weight_on_a_spring_does_not_feel_iterations_or_substeps():
    stretches = []
    for iterations, substeps in ((1, 10), (5, 10), (2, 40)):
        rope = {"mass": 2.0, "compliance": 1e-3}
        model = rope_2d(2, pins=[0], rope=rope, damping=4.0, iterations=iterations)
        state = world(model)
        for _ in range(600):
            state.step(1 / 60, substeps)
        stretches.append(-state.x[0, 1, 1] - 1.0)
    # alpha m g; the oscillation of sqrt(1000) rad/s has decayed by exp(-20) = 2e-9 of 1 cm
    np.testing.assert_allclose(stretches, 1e-3 * 1.0 * GRAVITY, rtol=1e-6)


def swept_stretch(links, substeps, *, upwards):
    """Stretch at rest of a hanging row of rigid distances, one sweep per substep [m]."""
    builder = ModelBuilder(2)
    depth = -np.linspace(0.0, 1.0, links + 1)
    builder.add_particles(np.stack([np.zeros(links + 1), depth], axis=1), 0.1)
    builder.pin(0)
    pairs = [(i, i + 1) for i in range(links)]
    for i, j in reversed(pairs) if upwards else pairs:
        builder.add_distance(i, j)
    state = world(builder.build(damping=10.0))
    for _ in range(180):
        state.step(1 / 60, substeps)
    return -state.x[0, -1, 1] - 1.0


@pytest.mark.parametrize("links", [4, 12])
def test_sweeps_stretch_a_hanging_row_by_the_law_of_the_scheme(links):
    for substeps in (10, 20):
        h = 1 / 60 / substeps
        # a link is undone by h^2/m times the tension of the one that is swept after it
        downwards = h**2 * GRAVITY * links * (links - 1) / 2
        upwards = h**2 * GRAVITY * (links * (links + 1) / 2 - 1)
        # second order in h, exactly; swings decay by exp(-10/2 * 3 s) of h^2 g = 3e-5 m, and 3e-7
        # of that is 1e-11
        assert swept_stretch(links, substeps, upwards=False) == pytest.approx(downwards, abs=1e-8)
        assert swept_stretch(links, substeps, upwards=True) == pytest.approx(upwards, abs=1e-8)


def distant_pair(apart=1.3, **properties):
    """Two particles of 1 and 3 kg that should be at 1 m."""
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0)
    builder.add_particles((apart, 0.0), 3.0)
    builder.add_distance(0, 1, rest=1.0, **properties)
    return world(builder.build(gravity=(0.0, 0.0)))


@pytest.mark.parametrize("k", [0.1, 0.5, 0.9])
def test_the_seeds_stiffness_is_a_compliance_at_one_time_step(k):
    h, w = 1e-3, 1.0 + 1.0 / 3.0
    # an error of 1 mm makes 1 m/s: a faster pair would be slowed down, as its spring is unresolved
    by_stiffness = distant_pair(1.001, stiffness=k)
    by_compliance = distant_pair(1.001, compliance=h**2 * w * (1.0 - k) / k)
    by_stiffness.step(h, 1)
    # one projection removes the share k of the error; rounding of 1 m
    apart = by_stiffness.x[0, 1, 0] - by_stiffness.x[0, 0, 0]
    assert apart == pytest.approx(1.001 - 0.001 * k, abs=1e-14)
    by_stiffness.step(10 * h, 10)
    by_compliance.step(h, 1)
    by_compliance.step(10 * h, 10)
    # the same arithmetic in another order, over 11 substeps, rounding of 1 m
    np.testing.assert_allclose(by_stiffness.x, by_compliance.x, atol=1e-12)


def test_a_spring_swings_like_backward_euler():
    compliance, h, substeps = 1e-3, 1e-3, 100
    state = distant_pair(compliance=compliance)
    state.step(substeps * h, substeps)
    frequency = np.sqrt((1.0 + 1.0 / 3.0) / compliance)
    # x_n - 2 x_(n-1) + x_(n-2) = -(omega h)^2 x_n from x_0 = 0.3, v_0 = 0
    error, rate = 0.3, 0.0
    for _ in range(substeps):
        rate = (rate - frequency**2 * h * error) / (1.0 + (frequency * h) ** 2)
        error += h * rate
    # the exact difference equation; 100 substeps of rounding in 1 m
    assert state.x[0, 1, 0] - state.x[0, 0, 0] == pytest.approx(1.0 + error, abs=1e-12)


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
def test_a_free_rope_keeps_its_momentum(integrator):
    state = world(rope_2d(8, gravity=(0.0, 0.0), iterations=2, integrator=integrator))
    state.v[0] = np.random.default_rng(1).normal(size=(8, 2))
    state.step(1e-3, 1)  # removes what would stretch the links
    before, _ = momenta(state)
    for _ in range(100):
        state.step(0.01, 10)
    # internal forces cancel in pairs; each of 1000 substeps rounds v = (x - x_start)/h to
    # 1e-16 m / 1e-3 s = 1e-13 m/s, times 0.2 kg
    np.testing.assert_allclose(momenta(state)[0], before, atol=1e-11)


def spinning_rod(integrator):
    """Two bobs 1 m apart that turn about their middle with one turn per second."""
    state = world(rope_2d(2, gravity=(0.0, 0.0), integrator=integrator, iterations=4))
    state.v[0, :, 0] = 2.0 * np.pi * (-0.5 - state.x[0, :, 1])
    return state


def test_a_spinning_rod_keeps_its_angular_momentum_with_rattle():
    state = spinning_rod("rattle")
    before = momenta(state)[1]
    for _ in range(600):
        state.step(1 / 60, 10)
    # corrections act along the rod at either end of the substep, which carry no torque: rounding
    # of 1e-16 m / h = 6e-14 m/s in each of 6000 substeps
    np.testing.assert_allclose(momenta(state)[1], before, rtol=1e-9)


def test_a_spinning_rod_slows_down_as_the_pbd_scheme_predicts():
    state = spinning_rod("pbd")
    before = momenta(state)[1][0, 1]
    for _ in range(600):
        state.step(1 / 60, 10)
    # d omega/dt = -omega^3 h to leading order; the next order is (omega h)^2 = 1e-4 of it
    slowed = 1.0 / np.sqrt(1.0 + 2.0 * (2.0 * np.pi) ** 2 * (1 / 600) * 10.0)
    assert momenta(state)[1][0, 1] / before == pytest.approx(slowed, rel=1e-4)


@pytest.mark.parametrize("frequency", [1.0, 2.0])
def test_a_driven_rope_keeps_its_length(frequency):
    state = world(rope_2d(32, pins=[0], iterations=2))
    worst = 0.0
    for step in range(1, 121):
        sway = 0.25 * np.sin(2.0 * np.pi * frequency * step / 60.0)
        state.step(1 / 60, 10, targets=np.array([[[sway, 0.0]]]))
        worst = max(worst, strain(state))
    # the largest relative stretch of any link at the end of any control step of 2 s. A link that
    # turns by phi within a substep of 1/600 s is stretched by phi^2/2 when it is predicted; two
    # Newton iterations square that twice. The whip of the free end turns links by up to 0.5:
    # (0.125)^2 squared again = 2.4e-4
    assert worst < 2.5e-4


def test_a_taut_line_between_two_pins_stays_finite():
    state = world(rope_2d(9, pins=[0, 8], iterations=2, gravity=(0.0, 0.0)))
    for step in range(1, 61):
        # the pins are pulled to 1.2 times the length of the rope, which no link can follow
        apart = 1.0 + 0.2 * min(step / 30.0, 1.0)
        state.step(1 / 60, 10, targets=np.array([[[0.0, 0.0], [0.0, -apart]]]))
    assert np.isfinite(state.x).all()
    assert np.isfinite(state.v).all()
    # no link can hold more than the whole surplus of 0.2 m, in links of 1/8 m
    assert strain(state) <= 1.6 + 1e-9
    assert np.abs(state.v).max() == 0.0  # and once the pins rest, nothing trembles


@pytest.mark.parametrize("rate", [300.0, 3000.0])
def test_links_that_turn_far_in_a_substep_stay_finite(rate):
    state = world(pendulum_2d((0.5, 0.5), (1.0, 1.0), integrator="rattle", iterations=2))
    turn(state, np.array([2.0, -1.0]))
    # with h = 1/300 s the links turn by 57 and by 573 degrees in a substep
    state.v[0, 1] = (0.0, 0.5 * rate)
    state.v[0, 2] = (0.5 * rate, 0.0)
    before = 0.5 * np.sum(state.v**2)
    for _ in range(300):
        state.step(1 / 30, 10)
        assert np.isfinite(state.x).all()
    # projections take energy away; gravity can give 2 bobs 2 m of height
    assert 0.5 * np.sum(state.v**2) < before + 3.0 * GRAVITY * 2.0


def test_particles_on_one_spot_do_not_become_nan():
    state = world(rope_2d(4, pins=[0], iterations=2))
    state.x[:] = 0.0
    state.step(1 / 60, 10)
    assert np.isfinite(state.x).all()


def test_a_bend_draws_a_cantilever_to_the_deflection_of_the_beam():
    links, link, stiffness = 10, 0.1, 0.1
    builder = ModelBuilder(2)
    indices = builder.add_particles([(i * link, 0.0) for i in range(links + 1)], 0.01)
    builder.pin(indices[:2])
    builder.add_chain(indices)
    for a, b, c in zip(indices, indices[1:], indices[2:], strict=False):
        builder.add_bend(a, b, c, compliance=link**3 / stiffness)
    # every free particle weighs 1 mN: gravity of 0.1 m/s2
    state = world(builder.build(gravity=(0.0, -0.1), damping=3.0))
    for _ in range(300):
        state.step(1 / 60, 40)
    weight = 0.01 * 0.1
    # bending moment M_i = EI kappa_i at the joint i turns all links beyond it by M_i l / EI; joints
    # 1 ... n - 1 are free to turn, the particles beyond joint i pull with their own arms
    joints = np.arange(1, links)
    beyond = links - joints
    moments = weight * link * beyond * (beyond + 1) / 2
    deflection = np.sum(moments * beyond * link) * link / stiffness
    assert deflection < 0.1
    assert -state.x[0, -1, 1] == pytest.approx(deflection, rel=0.01)


def damped_spring(substeps, rate=4.0, stiffness=100.0):
    """Where 1 kg is after 1 s that was let go 0.1 m beyond the rest of a damped spring [m]."""
    builder = ModelBuilder(2)
    builder.add_particles([(0.0, 0.0), (1.0, 0.0)], 1.0)
    builder.pin(0)
    builder.add_chain([0, 1], compliance=1.0 / stiffness, damping=rate)
    state = world(builder.build(gravity=(0.0, 0.0)))
    state.x[0, 1, 0] += 0.1
    state.step(1.0, substeps)
    return state.x[0, 1, 0] - 1.0


def test_a_damped_spring_swings_as_the_difference_equation_says():
    rate, stiffness, substeps = 4.0, 100.0, 600
    x, v, h = 0.1, 0.0, 1.0 / substeps
    for _ in range(substeps):  # backward Euler of the spring, then of the damper
        before, x = x, (x + h * v) / (1.0 + stiffness * h * h)
        v = (x - before) / h / (1.0 + rate * h)
    assert damped_spring(substeps) == pytest.approx(x, abs=1e-12)


def test_a_damped_spring_comes_to_the_damped_oscillator_with_the_order_of_the_step():
    rate, stiffness = 4.0, 100.0
    swing = np.sqrt(stiffness - rate**2 / 4.0)
    exact = 0.1 * np.exp(-rate / 2.0) * (np.cos(swing) + rate / 2.0 / swing * np.sin(swing))
    errors = [abs(damped_spring(substeps) - exact) for substeps in (600, 1200, 2400)]
    # the scheme's own damping adds stiffness h / 2 = 0.083/s to the decay, here of 0.1 e^-2 m
    assert errors[0] < 0.1 * np.exp(-rate / 2.0) * stiffness / 600
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.1)
