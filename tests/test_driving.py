"""How actions drive the pins: within workspace, rail, speed, acceleration and span."""

import numpy as np
import pytest

from episodes import IDS, flat, make, make_vec, pins, play

# float32 positions of about 1 m are exact to 6e-8 m, which over a control step of 20 ms is
# 6e-6 m/s, and over two of them 6e-4 m/s2
SPEED_ERROR, ACCELERATION_ERROR = 1e-4, 1e-2


def bang_bang(env, steps, seed=0):
    """Actions that jump between the extremes, each kept for a random number of steps."""
    random = np.random.default_rng(seed)
    shape = env.action_space.shape
    action = np.zeros(shape)
    for _ in range(steps):
        change = random.random(shape) < 0.15
        action = np.where(change, random.choice([-3.0, -1.0, 0.0, 1.0], shape), action)
        yield action


def motion(env, actions):
    """Positions (T, W, P, dim), velocities [m/s] and accelerations [m/s2] of the pins."""
    env.reset(seed=2)
    places = [pins(env)]
    for action in actions:
        env.step(action)
        places.append(pins(env))
    x = np.array(places)
    rate = env.unwrapped.task.control_rate
    v = np.diff(x, axis=0) * rate
    still = np.zeros_like(v[:1])
    return x, v, np.diff(np.concatenate([still, v]), axis=0) * rate


@pytest.mark.parametrize("id", IDS)
def test_pins_stay_in_their_workspace_and_below_their_speed(id):
    env = make_vec(id, 16, max_episode_steps=None)
    task = env.unwrapped.task
    x, v, _ = motion(env, bang_bang(env, 150))
    lower, upper = task.workspace()
    assert (x >= lower - 1e-6).all()
    assert (x <= upper + 1e-6).all()
    # both are reached, or the test would show nothing
    along = list(task.action_axes)
    assert np.abs(v).max() <= task.max_speed + SPEED_ERROR
    assert np.abs(v).max() > 0.9 * task.max_speed
    reached = x[..., along].reshape(-1, len(along))
    assert (reached.max(axis=0) > upper[along] - 0.1 * (upper - lower)[along]).any()


@pytest.mark.parametrize("id", IDS)
def test_pins_accelerate_within_their_limit_even_at_the_edges(id):
    env = make_vec(id, 16, max_episode_steps=None)
    task = env.unwrapped.task
    size, count = len(task.action_axes), len(task.model.pins)

    def alike():
        # pins that move alike never meet the span of their body, which has a test of its own
        for action in bang_bang(env, 150):
            yield np.tile(action[:, :size], count)

    _, _, acceleration = motion(env, alike())
    assert np.abs(acceleration).max() <= task.max_acceleration + ACCELERATION_ERROR
    assert np.abs(acceleration).max() > 0.9 * task.max_acceleration


def test_grippers_of_a_cloth_stay_within_its_span():
    env = make_vec("PBDCloth-v0", 16, max_episode_steps=None)
    x, _, _ = motion(env, bang_bang(env, 150))
    apart = np.linalg.norm(x[:, :, 0] - x[:, :, 1], axis=2)
    span = env.unwrapped.task.span()
    assert apart.max() <= span + 1e-6
    assert apart.max() > 0.99 * span


def test_a_pendulums_pivot_stays_on_its_rail():
    env = make_vec("PBDPendulum-v0", 4)
    x, _, _ = motion(env, bang_bang(env, 100))
    assert (x[..., 1] == 0.0).all()


def test_actions_beyond_the_space_are_clipped_and_reported():
    env, twin = make("PBDRope-v0"), make("PBDRope-v0")
    env.reset(seed=0)
    twin.reset(seed=0)
    *beyond, info = env.step(np.array([2.5, -0.5], dtype=np.float32))
    *within, other = twin.step(np.array([1.0, -0.5], dtype=np.float32))
    assert info["action_clipped"] == 1.5
    assert other["action_clipped"] == 0.0
    np.testing.assert_array_equal(beyond[0], within[0])
    assert beyond[1:] == within[1:]


def test_what_a_gripper_could_not_follow_is_reported():
    env = make("PBDRope-v0", max_speed=2.0, max_acceleration=20.0)
    env.reset(options={"gripper": [-0.9, 0.5]})
    push = np.array([1.0, 0.0], dtype=np.float32)
    limited = [step[4]["pin_limited"] for step in play(env, [push] * 8)]
    # 20 m/s2 over 1/30 s gain a third of 2 m/s each step
    np.testing.assert_allclose(limited[:3], [2 / 3, 1 / 3, 0.0], atol=1e-5)
    # at the far edge it stands still, however it is pushed
    assert play(env, [push] * 40)[-1][4]["pin_limited"] > 0.9


@pytest.mark.parametrize("id", IDS)
def test_noops_and_random_actions_leave_all_numbers_finite(id):
    env = make_vec(id, 64)
    env.reset(seed=0)
    for index, action in enumerate(bang_bang(env, 100)):
        observation, reward, terminated, _, info = env.step(action * (index % 50 > 10))
        assert np.isfinite(flat(observation)).all()
        assert np.isfinite(reward).all()
        assert not terminated.any()
        assert all(np.isfinite(values).all() for values in info.values())
