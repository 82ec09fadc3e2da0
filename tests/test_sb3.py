import importlib
import pickle
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from countdown import Countdown

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.monitor import Monitor

from pbd_gym.sb3 import SB3VecEnv, make_sb3_vec_env

ROPE = "pbd_gym:PBDRope-v0"
HORIZON = 100  # control steps of an episode of the rope


def random_actions(steps, worlds, size=2, seed=0):
    shape = (steps, worlds, size)
    return np.random.default_rng(seed).uniform(-1, 1, shape).astype(np.float32)


def test_the_bridge_hands_the_native_batch_through():
    env = gymnasium.make_vec(
        ROPE,
        num_envs=3,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    bridge = make_sb3_vec_env(ROPE, 3, seed=5)
    np.testing.assert_array_equal(bridge.reset(), env.reset(seed=5)[0])
    returns = np.zeros(3)
    for step, actions in enumerate(random_actions(HORIZON + 5, 3), start=1):
        observation, reward, terminated, truncated, info = env.step(actions)
        seen, seen_reward, done, infos = bridge.step(actions)
        returns += reward
        np.testing.assert_array_equal(seen, observation)
        np.testing.assert_array_equal(seen_reward, reward.astype(np.float32))
        np.testing.assert_array_equal(done, terminated | truncated)
        if step != HORIZON:
            assert infos == [{}, {}, {}]
            continue
        for world, final in enumerate(infos):
            np.testing.assert_array_equal(final["terminal_observation"], info["final_obs"][world])
            assert final["TimeLimit.truncated"] is True
            assert (final["episode"]["r"], final["episode"]["l"]) == (returns[world], HORIZON)
            names = {key for key in info["final_info"] if not key.startswith("_")}
            assert "is_success" in names
            assert names < set(final)
            assert all(final[name] == info["final_info"][name][world] for name in names)
        returns[:] = 0.0
    assert step > HORIZON


def test_worlds_that_end_apart_report_their_own_episodes():
    bridge = SB3VecEnv(Countdown(3))
    bridge.reset()
    ends = []
    for step in range(1, 13):
        _, _, done, infos = bridge.step(np.zeros((3, 1), dtype=np.float32))
        assert [bool(info) for info in infos] == done.tolist()
        ends += [(step, world, infos[world]) for world in np.flatnonzero(done).tolist()]
    assert [(step, world) for step, world, _ in ends] == [
        *[(2, 0), (3, 1), (4, 0), (4, 2), (6, 0), (6, 1), (8, 0), (8, 2), (9, 1)],
        *[(10, 0), (12, 0), (12, 1), (12, 2)],
    ]
    for _, world, info in ends:
        length = world + 2
        assert info["episode"]["l"] == length
        assert info["episode"]["r"] == length * (length + 1) / 2
        assert info["terminal_observation"] == length
        assert info["TimeLimit.truncated"] is (world % 2 == 0)
        assert info["is_success"] is (length > 2)


def test_what_a_step_returns_shares_no_memory_with_other_steps():
    bridge = make_sb3_vec_env(ROPE, 2, seed=0)
    kept = [bridge.reset()]
    for actions in random_actions(HORIZON + 2, 2):
        observation, reward, done, infos = bridge.step(actions)
        kept += [observation, reward, done]
        kept += [info["terminal_observation"] for info in infos if info]
    copies = [array.copy() for array in kept]
    for i, first in enumerate(kept[-12:]):
        assert not any(np.shares_memory(first, other) for other in kept[-12:][:i])
    for array, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_a_stored_state_continues_in_another_bridge_with_its_running_episodes():
    bridge, other = (make_sb3_vec_env(ROPE, 2, seed=seed) for seed in (1, 2))
    bridge.reset()
    other.reset()
    actions = random_actions(HORIZON + 30, 2)
    for action in actions[:30]:
        bridge.step(action)
    other.set_state(pickle.loads(pickle.dumps(bridge.get_state())))
    for action in actions[30:]:
        observation, reward, done, infos = bridge.step(action)
        expected, expected_reward, expected_done, expected_infos = other.step(action)
        np.testing.assert_array_equal(observation, expected)
        np.testing.assert_array_equal(reward, expected_reward)
        np.testing.assert_array_equal(done, expected_done)
        for info, expected_info in zip(infos, expected_infos, strict=True):
            assert info.keys() == expected_info.keys()
            if info:
                assert info["episode"]["r"] == expected_info["episode"]["r"]
                assert info["episode"]["l"] == expected_info["episode"]["l"] == HORIZON


def test_options_reach_the_worlds_once_and_must_be_common_to_them():
    bridge = SB3VecEnv(Countdown(2))
    seen = []
    reset = bridge.env.reset
    bridge.env.reset = lambda **arguments: (seen.append(arguments), reset(**arguments))[1]
    bridge.set_options({"a": 1})
    bridge.seed(3)
    bridge.reset()
    bridge.reset()
    assert seen == [{"seed": [3, 4], "options": {"a": 1}}, {"seed": None, "options": None}]
    bridge.set_options([{"a": 1}, {"a": 2}])
    with pytest.raises(ValueError, match="the same for all worlds"):
        bridge.reset()


def test_attributes_and_methods_of_the_batch_are_reached():
    bridge = SB3VecEnv(Countdown(3))
    bridge.reset()
    assert bridge.get_attr("num_envs") == [3, 3, 3]
    assert bridge.get_attr("num_envs", indices=1) == [3]
    assert bridge.has_attr("count")
    assert not bridge.has_attr("nothing")
    bridge.set_attr("colour", "red")
    assert bridge.get_attr("colour", [0, 2]) == ["red", "red"]
    with pytest.raises(ValueError, match="shared by all worlds"):
        bridge.set_attr("colour", "blue", indices=[0])
    assert [result.shape for result in bridge.env_method("observation", indices=[1])] == [(3, 1)]
    assert bridge.env_is_wrapped(Monitor) == [True, True, True]
    assert bridge.env_is_wrapped(gymnasium.wrappers.TimeLimit, indices=[0]) == [False]


def test_the_worlds_are_drawn_as_tiles():
    bridge = make_sb3_vec_env(ROPE, 3, seed=0, render_mode="rgb_array")
    bridge.reset()
    frames = bridge.get_images()
    height, width, channels = frames[0].shape
    assert len(frames) == 3
    assert bridge.render().shape == (2 * height, 2 * width, channels)
    assert bridge.metadata["render_fps"] == bridge.env.metadata["render_fps"]
    bridge.close()


def test_images_of_worlds_without_a_render_mode_are_refused_with_a_warning():
    with pytest.warns(UserWarning, match="render_mode must be 'rgb_array'"):
        assert SB3VecEnv(Countdown(2)).get_images() == [None, None]


def test_a_batch_that_resets_in_the_next_step_is_refused():
    env = Countdown(2)
    env.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
    with pytest.raises(ValueError, match="SAME_STEP"):
        SB3VecEnv(env)


def test_without_stable_baselines3_the_error_names_the_extra(monkeypatch):
    monkeypatch.delitem(sys.modules, "pbd_gym.sb3")
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.monitor", None)
    with pytest.raises(ImportError, match=r"pbd-gym\[train\]"):
        importlib.import_module("pbd_gym.sb3")
