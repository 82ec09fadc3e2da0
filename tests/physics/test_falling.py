import numpy as np
import pytest

from scenes import GRAVITY, particles_2d, world

START = np.array([0.3, 2.0])
VELOCITY = np.array([1.5, 4.0])
STEPS, DT, SUBSTEPS = 50, 0.02, 10
G = np.array([0.0, -GRAVITY])


def thrown(**settings):
    """One particle after 1 s of flight."""
    state = world(particles_2d(START, **settings))
    state.v[0, 0] = VELOCITY
    for _ in range(STEPS):
        state.step(DT, SUBSTEPS)
    return state.x[0, 0], state.v[0, 0]


def test_pbd_flies_along_the_parabola_of_its_own_difference_equation():
    n, h = STEPS * SUBSTEPS, DT / SUBSTEPS
    x, v = thrown()
    # exact for v += g h, x += v h; what is left is the rounding of 500 substeps, 500 * 2e-16 * 5 m
    expected = START + n * h * VELOCITY + G / 2 * n * h * (n * h + h)
    np.testing.assert_allclose(x, expected, atol=1e-12)
    # v is read off positions that carry a rounding error of 1e-15 m each, divided by h = 2e-3 s
    np.testing.assert_allclose(v, VELOCITY + n * h * G, atol=1e-10)


def test_rattle_flies_along_the_true_parabola():
    t = STEPS * DT
    x, v = thrown(integrator="rattle")
    # half kicks on either side integrate a constant acceleration exactly; rounding as above
    np.testing.assert_allclose(x, START + t * VELOCITY + G / 2 * t**2, atol=1e-11)
    np.testing.assert_allclose(v, VELOCITY + t * G, atol=1e-10)


def test_a_damped_fall_is_the_geometric_series_of_its_substeps():
    rate = 2.0
    n, h = STEPS * SUBSTEPS, DT / SUBSTEPS
    _, v = thrown(damping=rate)
    decay = np.exp(-rate * h)
    # damping acts before the kick: v_n = decay^n v_0 + g h (1 + decay + ... + decay^(n-1))
    expected = decay**n * VELOCITY + G * h * (1 - decay**n) / (1 - decay)
    np.testing.assert_allclose(v, expected, atol=1e-10)


def test_a_damped_fall_comes_close_to_the_differential_equation():
    rate = 2.0
    h, t = DT / SUBSTEPS, STEPS * DT
    _, v = thrown(damping=rate)
    expected = np.exp(-rate * t) * VELOCITY + G / rate * (1 - np.exp(-rate * t))
    # first order: the kick of a substep is damped half a substep too little, at most g h / 2
    np.testing.assert_allclose(v, expected, atol=0.5 * GRAVITY * h)


@pytest.mark.parametrize("integrator", ["pbd", "rattle"])
def test_light_and_heavy_particles_fall_alike(integrator):
    light, heavy = (thrown(mass=mass, integrator=integrator)[0] for mass in (0.01, 100.0))
    np.testing.assert_array_equal(light, heavy)


def test_a_world_without_gravity_keeps_a_particle_at_its_speed():
    x, v = thrown(gravity=(0.0, 0.0))
    np.testing.assert_allclose(x, START + STEPS * DT * VELOCITY, atol=1e-12)
    np.testing.assert_allclose(v, VELOCITY, atol=1e-10)  # rounding of positions over h
