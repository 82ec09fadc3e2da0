from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from pbd_gym.physics import World
from pbd_gym.tasks.pendulum import Pendulum
from scenes import GRAVITY, energy, pendulum_2d, turn, world

# the settings of the pendulum environments
DT, SUBSTEPS, ITERATIONS = 0.02, 10, 2


def swung(angles, *, lengths=(1.0,), masses=None, integrator="rattle", **settings):
    """A pendulum at rest at angles from the downward vertical [rad], with bobs of 1 kg."""
    masses = masses or [1.0] * len(lengths)
    model = pendulum_2d(lengths, masses, integrator=integrator, iterations=ITERATIONS, **settings)
    state = world(model)
    turn(state, np.array(angles))
    return state


def measured_period(state, swings, substeps=SUBSTEPS):
    """Mean time between upward passages through the vertical line below the pivot [s]."""
    passages, time, before = [], 0.0, state.x[0, 1, 0]
    while len(passages) <= swings:
        state.step(DT, substeps)
        time += DT
        after, speed = state.x[0, 1, 0], state.v[0, 1, 0]
        if before < 0.0 <= after:
            # back along the tangent to the moment at which x was 0
            passages.append(time - after / speed)
        before = after
    return (passages[-1] - passages[0]) / swings


def exact_period(degrees):
    """Period of a pendulum of 1 m that is let go at an angle [s]."""
    return 4.0 * np.sqrt(1.0 / GRAVITY) * ellipk(np.sin(np.radians(degrees) / 2.0) ** 2)


@pytest.mark.parametrize("degrees", [30.0, 60.0, 90.0, 120.0, 150.0, 170.0])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(degrees):
    exact = exact_period(degrees)
    period = measured_period(swung([np.radians(degrees)]), swings=3)
    # second order: |dT|/T of the order of (omega h)^2 = 9.81 * 0.002^2 = 4e-5; Verlet has
    # 1/24 of it for small swings and less than a third for all
    assert period == pytest.approx(exact, rel=1.3e-5)


def test_a_pendulum_does_not_lose_energy_with_rattle():
    state = swung([np.radians(90.0)])
    start, worst = energy(state), 0.0
    for _ in range(3000):
        state.step(DT, SUBSTEPS)
        worst = max(worst, abs(energy(state) - start))
    # symplectic: a bounded oscillation of relative size (omega h)^2 with no drift over a minute;
    # twice the weight's drop of 9.81 J is the scale, since the bob is fastest where it has fallen
    assert worst < 2 * 9.81 * GRAVITY * (DT / SUBSTEPS) ** 2


@pytest.mark.parametrize("substeps", [5, 10, 20])
def test_a_small_pendulum_damps_like_backward_euler_with_pbd(substeps):
    state = swung([1e-3], integrator="pbd")
    h, steps = DT / substeps, 500
    frequency = np.sqrt(GRAVITY)
    for _ in range(steps):
        state.step(DT, substeps)
    n = steps * substeps
    # z = 1/(1 - i omega h) per substep is backward Euler of x'' = -omega^2 x with the start
    # x = x0, v = 0; the read-off velocity is (x_n - x_(n-1))/h
    z = 1.0 / (1.0 - 1j * frequency * h)
    x, v = 1e-3 * np.real(z**n), 1e-3 * np.real(z ** (n - 1) * (z - 1.0)) / h
    amplitude = np.hypot(x, v / frequency)
    measured = np.hypot(state.x[0, 1, 0], state.v[0, 1, 0] / frequency)
    assert amplitude < 0.97e-3  # there is something to see
    # the pendulum is linear to theta^2/16 = 6e-8; the direction's second order adds as much
    assert measured == pytest.approx(amplitude, rel=1e-5)


@pytest.mark.parametrize("degrees", [90.0, 170.0])
def test_the_environments_pendulum_keeps_period_and_energy_for_a_minute(degrees):
    task = Pendulum()
    assert (task.model.integrator, task.model.iterations) == ("rattle", ITERATIONS)
    assert (1.0 / task.control_rate, task.substeps) == (DT, SUBSTEPS)
    state = World(task.model)  # in single precision
    turn(state, np.radians([degrees]))
    lowest = -GRAVITY * task.mass * task.length
    start, worst = energy(state) - lowest, 0.0
    # what may be asked of single precision: each of 30000 substeps rounds the way of 4 m/s * 2 ms
    # to 3e-8 m at random, and near 180 degrees the period changes 17 times as much as the energy
    period = measured_period(state, swings=3)
    assert period == pytest.approx(exact_period(degrees), rel=5e-4)
    for _ in range(3000):
        state.step(DT, SUBSTEPS)
        worst = max(worst, abs(energy(state) - lowest - start))
    assert worst < 1e-3 * start


@pytest.mark.parametrize("substeps", [2, 10])
def test_a_small_pendulum_swings_as_slowly_as_backward_euler_with_pbd(substeps):
    h, frequency = DT / substeps, np.sqrt(GRAVITY)
    period = measured_period(swung([1e-3], integrator="pbd"), swings=5, substeps=substeps)
    # z = 1/(1 - i omega h) turns by atan(omega h) per substep; the tangent at up to DT after a
    # passage misses it by omega^2 DT^3/3 = 2.6e-5 s of 5 swings
    assert period == pytest.approx(2.0 * np.pi * h / np.arctan(frequency * h), rel=3e-6)


def double_pendulum(t, state, lengths, masses):
    """Two bobs on rods: angles from the downward vertical and their rates (Lagrange)."""
    a, b, da, db = state
    (length, lower), (upper_mass, lower_mass) = lengths, masses
    total, coupled = upper_mass + lower_mass, lower_mass * length * lower
    sine, cosine = np.sin(a - b), np.cos(a - b)
    mass = [[total * length**2, coupled * cosine], [coupled * cosine, lower_mass * lower**2]]
    force = [
        -coupled * sine * db**2 - total * GRAVITY * length * np.sin(a),
        coupled * sine * da**2 - lower_mass * GRAVITY * lower * np.sin(b),
    ]
    return [da, db, *np.linalg.solve(mass, force)]


EQUAL = ((1.0, 1.0), (1.0, 1.0))


@cache
def exact_tip(lengths, masses, time):
    """Where the lower bob is, from 90 degrees each, by an independent solver [m]."""
    solution = solve_ivp(
        double_pendulum,
        (0.0, time),
        [*np.radians([90.0, 90.0]), 0.0, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        args=(lengths, masses),
    )
    a, b = solution.y[:2, -1]
    upper, lower = lengths
    return np.array([upper * np.sin(a) + lower * np.sin(b), -upper * np.cos(a) - lower * np.cos(b)])


def double_pendulum_error(integrator, substeps, lengths, masses, steps=50):
    """Distance of the lower bob from the solution of the differential equation [m]."""
    state = swung(np.radians([90.0, 90.0]), lengths=lengths, masses=masses, integrator=integrator)
    for _ in range(steps):
        state.step(DT, substeps)
    return np.linalg.norm(state.x[0, 2] - exact_tip(lengths, masses, steps * DT))


def test_the_independent_solver_gives_the_published_double_pendulum():
    # computed with another program, to 1e-8 m
    for time, tip in ((1.0, (-1.44481885, -1.32179446)), (2.0, (-1.43412482, -1.12987020))):
        np.testing.assert_allclose(exact_tip(*EQUAL, time), tip, atol=1e-8)


@pytest.mark.parametrize(
    ("lengths", "masses", "fine"),
    [(*EQUAL, 20), ((1.2, 0.4), (0.5, 3.0), 20), ((0.6, 1.1), (2.0, 0.5), 30)],
)
def test_a_double_pendulum_follows_an_independent_solver(lengths, masses, fine):
    # second order. An independent implementation of the same scheme has 7.9e-6 m at h = 1/600 s for
    # equal rods, that is 1.1e-5 m with 10 and 3e-6 m with 20 substeps here; a short and heavy upper
    # pendulum swings faster and needs 30
    assert double_pendulum_error("rattle", SUBSTEPS, lengths, masses) < 1e-3
    assert double_pendulum_error("rattle", fine, lengths, masses) < 1e-5


@pytest.mark.parametrize(("integrator", "order"), [("pbd", 1.0), ("rattle", 2.0)])
def test_the_error_shrinks_with_the_order_of_the_integrator(integrator, order):
    substeps = np.array([10, 20, 40, 100])
    errors = [double_pendulum_error(integrator, int(count), *EQUAL) for count in substeps]
    # the slope of log error over log h; the next order spoils it by a few percent
    slope = np.polyfit(np.log(DT / substeps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(("substeps", "loss"), [(10, 4.4e-2), (20, 2.2e-2), (100, 4.6e-3)])
def test_a_double_pendulum_loses_energy_with_pbd_in_proportion_to_the_substep(substeps, loss):
    state = swung(np.radians([90.0, 90.0]), lengths=(1.0, 1.0), integrator="pbd")
    start = energy(state)
    for _ in range(120):
        state.step(1 / 60, substeps)
    # in units of 3 m g l; from an independent implementation of the same scheme, to two digits
    assert (start - energy(state)) / (3.0 * GRAVITY) == pytest.approx(loss, rel=0.05)


def test_a_triple_pendulum_keeps_its_energy_with_rattle():
    state = swung(np.radians([120.0, 170.0, 90.0]), lengths=(1 / 3, 1 / 3, 1 / 3))
    start, errors = energy(state), []
    for _ in range(3000):
        state.step(DT, SUBSTEPS)
        errors.append(energy(state) - start)
    # chaotic, for a minute. Symplectic: links that whip around with omega = 31 rad/s lose and find
    # again up to (omega h)^2 = 4e-3 of the 3 * 9.81 J that can turn into motion
    scale = 3.0 * GRAVITY
    assert np.abs(errors).max() < 4e-3 * scale
    # no drift: the means over the first and the last ten seconds agree to a hundredth of that
    assert abs(np.mean(errors[:500]) - np.mean(errors[-500:])) < 4e-5 * scale
