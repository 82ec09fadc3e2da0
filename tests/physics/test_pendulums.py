import numpy as np
import pytest
from scenes import GRAVITY, energy, pendulum_2d, turn, world
from scipy.integrate import solve_ivp
from scipy.special import ellipk

# the settings of the pendulum environments
DT, SUBSTEPS, ITERATIONS = 0.02, 10, 2


def swung(angles, *, lengths=(1.0,), integrator="rattle", **settings):
    """A pendulum at rest at angles from the downward vertical [rad]."""
    masses = [1.0] * len(lengths)
    model = pendulum_2d(lengths, masses, integrator=integrator, iterations=ITERATIONS, **settings)
    state = world(model)
    turn(state, np.array(angles))
    return state


def measured_period(state, swings):
    """Mean time between upward passages through the vertical line below the pivot [s]."""
    passages, time, before = [], 0.0, state.x[0, 1, 0]
    while len(passages) <= swings:
        state.step(DT, SUBSTEPS)
        time += DT
        after, speed = state.x[0, 1, 0], state.v[0, 1, 0]
        if before < 0.0 <= after:
            # back along the tangent to the moment at which x was 0
            passages.append(time - after / speed)
        before = after
    return (passages[-1] - passages[0]) / swings


@pytest.mark.parametrize("degrees", [90.0, 170.0])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(degrees):
    angle = np.radians(degrees)
    exact = 4.0 * np.sqrt(1.0 / GRAVITY) * ellipk(np.sin(angle / 2.0) ** 2)
    period = measured_period(swung([angle]), swings=3)
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


def double_pendulum(t, state):
    """Two bobs of 1 kg on rods of 1 m: angles from the downward vertical and their rates."""
    a, b, da, db = state
    sine, cosine = np.sin(a - b), np.cos(a - b)
    mass = np.array([[2.0, cosine], [cosine, 1.0]])
    force = np.array(
        [-sine * db**2 - 2.0 * GRAVITY * np.sin(a), sine * da**2 - GRAVITY * np.sin(b)]
    )
    return [da, db, *np.linalg.solve(mass, force)]


def double_pendulum_error(integrator, substeps):
    """Distance of the lower bob after 1 s from the solution of the differential equation [m]."""
    start = np.radians([90.0, 90.0])
    solution = solve_ivp(
        double_pendulum, (0.0, 1.0), [*start, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-12
    )
    a, b = solution.y[:2, -1]
    tip = np.array([np.sin(a) + np.sin(b), -np.cos(a) - np.cos(b)])
    state = swung(start, lengths=(1.0, 1.0), integrator=integrator)
    for _ in range(50):
        state.step(DT, substeps)
    return np.linalg.norm(state.x[0, 2] - tip)


def test_a_double_pendulum_follows_an_independent_solver():
    # an independent implementation of the same scheme has 1.8e-4 m at h = 1/600 s; second order
    # makes that 1.8e-4 * (600/500)^2 = 2.6e-4 m here with one iteration; two are better
    assert double_pendulum_error("rattle", SUBSTEPS) < 2.6e-4


@pytest.mark.parametrize(("integrator", "order"), [("pbd", 1.0), ("rattle", 2.0)])
def test_the_error_shrinks_with_the_order_of_the_integrator(integrator, order):
    coarse, fine = (double_pendulum_error(integrator, substeps) for substeps in (10, 40))
    # a quarter of the step: log_4 of the ratio; the next order spoils it by a few percent
    assert np.log(coarse / fine) / np.log(4.0) == pytest.approx(order, abs=0.1)


def test_the_rods_of_a_pendulum_keep_their_length():
    state = swung(np.radians([170.0, 100.0, 60.0]), lengths=(0.3, 0.4, 0.3))
    for _ in range(500):
        state.step(DT, SUBSTEPS)
        lengths = np.linalg.norm(np.diff(state.x[0], axis=0), axis=1)
        # Newton squares the error: a chaotic triple pendulum turns with up to 30 rad/s, which
        # stretches a predicted link by (30 * 0.002)^2/2 = 2e-3, 2e-6 and 2e-12 in turn
        np.testing.assert_allclose(lengths, [0.3, 0.4, 0.3], rtol=1e-10)
