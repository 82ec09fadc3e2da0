"""Environments made and stepped in other processes, by a name that every process understands."""

import multiprocessing

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv

from episodes import VARIANTS, assert_same, episode, make, make_sync, make_vec, play, random_actions

STEPS = 5
START_METHODS = sorted(
    {"forkserver", "spawn"}.intersection(multiprocessing.get_all_start_methods())
)


def use_threads():
    """Step a batch that two threads share, so that this process has a pool of threads."""
    env = make_vec("PBDRope-v0", 64, num_threads=2)
    env.reset(seed=0)
    play(env, random_actions(env, 3))


def play_in_child(id, connection):
    # nothing but the name: the child imports the package because of it
    env = gymnasium.make(f"pbd_gym:{id}")
    connection.send(episode(env, 3, STEPS))


@pytest.mark.parametrize("id", VARIANTS)
@pytest.mark.parametrize("method", START_METHODS)
def test_a_child_process_makes_an_environment_by_its_name(method, id):
    use_threads()
    context = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=play_in_child, args=(id, sender))
    child.start()
    sender.close()
    try:
        assert receiver.poll(60), "the child hangs"
        assert_same(receiver.recv(), episode(make(id), 3, STEPS))
    finally:
        child.kill()
        child.join()


@pytest.mark.parametrize("id", VARIANTS)
def test_asynchronous_environments_step_after_their_parent_used_threads(id):
    use_threads()
    # the default start method, which is fork on Linux before Python 3.14
    env = AsyncVectorEnv([lambda: make(id)] * 2)
    twin = make_sync(id, 2)
    try:
        assert_same(env.reset(seed=3)[0], twin.reset(seed=3)[0])
        for action in random_actions(env, STEPS):
            mine, other = env.step(action), twin.step(action)
            assert_same(mine[0], other[0])
            np.testing.assert_array_equal(mine[1], other[1])
    finally:
        env.close()


def test_make_vec_makes_asynchronous_environments():
    use_threads()
    env = gymnasium.make_vec("pbd_gym:PBDRope-v0", num_envs=2, vectorization_mode="async")
    twin = make_vec("PBDRope-v0", 2)
    try:
        np.testing.assert_array_equal(env.reset(seed=3)[0], twin.reset(seed=3)[0])
    finally:
        env.close()


def batch_in_child(connection):
    # 64 worlds on two threads of the child's own
    batch = make_vec("PBDRope-v0", 64, num_threads=2)
    connection.send(episode(batch, 3, STEPS))


@pytest.mark.parametrize("method", sorted(multiprocessing.get_all_start_methods()))
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_batch_steps_on_threads_of_a_child_process(method):
    use_threads()
    context = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=batch_in_child, args=(sender,))
    child.start()
    sender.close()
    try:
        assert receiver.poll(60), "the child hangs"
        assert_same(receiver.recv(), episode(make_vec("PBDRope-v0", 64), 3, STEPS))
    finally:
        child.kill()
        child.join()


def test_stable_baselines3_steps_environments_in_processes():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import SubprocVecEnv

    use_threads()
    env = make_vec_env("pbd_gym:PBDRope-v0", n_envs=2, seed=3, vec_env_cls=SubprocVecEnv)
    try:
        observation = env.reset()
        alone = [make("PBDRope-v0").reset(seed=3 + index)[0] for index in range(2)]
        np.testing.assert_array_equal(observation, alone)
        actions = np.zeros((2, *env.action_space.shape), dtype=np.float32)
        for _ in range(STEPS):
            observation, _, done, infos = env.step(actions)
        assert observation.shape == (2, *env.observation_space.shape)
        assert not done.any()
        assert {"is_success", "normalized_performance"} <= infos[0].keys()
    finally:
        env.close()
