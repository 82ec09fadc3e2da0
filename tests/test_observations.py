"""What is observed and rewarded, against the tables and formulas of the classes in plain NumPy."""

import numpy as np
import pytest

from episodes import make_vec, play, random_actions

WORLDS = 5
# Observations and rewards are of size 1 and made of a few float32 operations on states below 2 m.
FLOAT32 = 2e-6


def played(id, **keywords):
    """What the last of some steps gave, the task, and the state in float64."""
    env = make_vec(id, WORLDS, **keywords)
    env.reset(seed=1)
    actions = random_actions(env, 8)
    observation, reward, _, _, info = play(env, actions)[-1]
    state = env.unwrapped.get_state()
    x, v = state.worlds.x.astype(np.float64), state.worlds.v.astype(np.float64)
    action = np.clip(actions[-1], -1.0, 1.0)
    return observation, reward, info, env.unwrapped.task, x, v, action, state.variables


def assert_close(value, expected):
    np.testing.assert_allclose(value, np.clip(expected, -10.0, 10.0), rtol=FLOAT32, atol=FLOAT32)


@pytest.mark.parametrize(
    ("kind", "observed"),
    [("particles", range(1, 24)), ("keypoints", np.round(np.linspace(0, 23, 10)).astype(int)[1:])],
)
def test_a_rope_is_observed_and_rewarded_as_its_class_says(kind, observed):
    keywords = {"observation": kind, "length": 0.8}
    observation, reward, info, _, x, v, _, variables = played("PBDRope-v0", **keywords)
    gripper, observed = x[:, :1], list(observed)
    parts = [
        gripper - [0.0, 0.25],
        v[:, :1] / 2.0,
        (x[:, observed] - gripper) / 0.8,
        v[:, observed] / 2.0,
        (variables["goal"][:, None] - gripper) / 0.8,
    ]
    assert_close(observation, np.concatenate([part.reshape(WORLDS, -1) for part in parts], axis=1))
    distance = np.linalg.norm(x[:, -1] - variables["goal"], axis=1)
    assert_close(info["distance"], distance)
    assert_close(reward, np.exp(-5.0 * distance / 0.8))


@pytest.mark.parametrize("kind", ["particles", "keypoints"])
def test_a_cloth_is_observed_and_rewarded_as_its_class_says(kind):
    observation, reward, info, task, x, v, _, variables = played("PBDCloth-v0", observation=kind)
    goal, (cosine, sine) = variables["goal"], variables["goal_axis"].T
    line = np.arange(12) if kind == "particles" else np.array([0, 6, 11])
    observed = (12 * line[:, None] + line).ravel()
    places = x[:, observed]
    places[:, :, :2] -= goal[:, None]
    shape = (WORLDS, -1)
    parts = [2.0 * places.reshape(shape), v[:, observed].reshape(shape), goal]
    assert_close(observation, np.column_stack([*parts, cosine, sine]))
    goals = np.array([task.goal(variables, world) for world in range(WORLDS)])
    distance = np.linalg.norm(x - goals, axis=2).mean(axis=1)
    assert_close(info["distance"], distance)
    assert_close(reward, np.exp(-5.0 * distance / 0.6))


@pytest.mark.parametrize(
    ("id", "links"),
    [("PBDPendulum-v0", 1), ("PBDDoublePendulum-v0", 2), ("PBDTriplePendulum-v0", 3)],
)
def test_a_pendulum_is_observed_and_rewarded_as_its_class_says(id, links):
    observation, reward, info, _, x, v, action, _ = played(id)
    direction, rate = np.diff(x, axis=1) * links, np.diff(v, axis=1) * links
    shape = (WORLDS, -1)
    parts = [
        x[:, 0, 0] / 1.5,
        v[:, 0, 0] / 3.0,
        direction.reshape(shape),
        rate.reshape(shape) / 5.0,
    ]
    assert_close(observation, np.column_stack(parts))
    terms = {
        "upright": np.mean(0.5 * (1.0 + direction[:, :, 1]), axis=1),
        "centred": 0.1 ** ((x[:, 0, 0] / 1.5) ** 2),
        "slow": np.min(0.1 ** (np.sum(rate**2, axis=2) / 25.0), axis=1),
        "quiet": 1.0 - action[:, 0].astype(np.float64) ** 2,
    }
    for name, expected in terms.items():
        assert_close(info[name], expected)
    factors = [(1.0 + terms["centred"]) / 2.0, (1.0 + terms["slow"]) / 2.0]
    assert_close(reward, terms["upright"] * np.prod(factors, axis=0) * (4.0 + terms["quiet"]) / 5.0)
