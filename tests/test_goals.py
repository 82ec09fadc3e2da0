"""Goal-conditioned twins: the same worlds, a reward of the goals alone, learning from hindsight."""

import numpy as np
import pytest

from episodes import assert_same, make, make_vec, play, random_actions

TWINS = {"PBDRopeGoal-v0": "PBDRope-v0", "PBDClothGoal-v0": "PBDCloth-v0"}
REWARDS = ("sparse", "dense")
twins = pytest.mark.parametrize("id", TWINS)
rewards = pytest.mark.parametrize("reward", REWARDS)


def played(id, steps=40, num_envs=4, **keywords):
    """A batch and what steps of its scripted policy gave."""
    env = make_vec(id, num_envs, **keywords)
    observation, _ = env.reset(seed=1)
    results = []
    for _ in range(steps):
        results.append(env.step(env.unwrapped.task.scripted(observation)))
        observation = results[-1][0]
    return env.unwrapped, results


@twins
def test_a_twin_is_the_same_world_as_its_task(id):
    twin, task = make_vec(id, 3), make_vec(TWINS[id], 3)
    twin.reset(seed=5)
    task.reset(seed=5)
    actions = random_actions(task, 10)
    for mine, other in zip(play(twin, actions), play(task, actions), strict=True):
        assert_same(mine[4]["distance"], other[4]["distance"])
        assert_same(mine[4]["normalized_performance"], other[4]["normalized_performance"])
    assert_same(twin.unwrapped.get_state().worlds.x, task.unwrapped.get_state().worlds.x)


def test_the_dense_reward_of_the_rope_is_that_of_its_task():
    twin, task = make_vec("PBDRopeGoal-v0", 3, reward="dense"), make_vec("PBDRope-v0", 3)
    twin.reset(seed=5)
    task.reset(seed=5)
    for action in random_actions(task, 10):
        assert_same(twin.step(action)[1], task.step(action)[1])


@twins
def test_the_scripted_policy_acts_on_a_twin_as_on_its_task(id):
    twin, task = make_vec(id, 8), make_vec(TWINS[id], 8)
    goals, whole = twin.reset(seed=5)[0], task.reset(seed=5)[0]
    for _ in range(20):
        mine, other = (
            env.unwrapped.task.scripted(seen) for env, seen in ((twin, goals), (task, whole))
        )
        # the goal comes back from float32 places of the order of 1 m
        np.testing.assert_allclose(mine, other, rtol=0.0, atol=1e-4)
        goals, whole = twin.step(mine)[0], task.step(mine)[0]


@twins
def test_an_observation_without_its_goal_tells_nothing_of_it(id):
    env, goals = make(id), ([0.1, -0.1], [-0.1, -0.2])
    seen = [env.reset(seed=3, options={"goal": goal})[0] for goal in goals]
    np.testing.assert_array_equal(seen[0]["observation"], seen[1]["observation"])
    assert (seen[0]["desired_goal"] != seen[1]["desired_goal"]).any()


def test_goals_are_places_of_the_body():
    rope, results = played("PBDRopeGoal-v0", steps=3)
    state = rope.get_state()
    np.testing.assert_array_equal(results[-1][0]["achieved_goal"], state.worlds.x[:, -1])
    np.testing.assert_array_equal(results[-1][0]["desired_goal"], state.variables["goal"])
    cloth, results = played("PBDClothGoal-v0", steps=3)
    state = cloth.get_state()
    nine = (12 * np.array([[0], [6], [11]]) + [0, 6, 11]).ravel()
    achieved, desired = (
        results[-1][0][name].reshape(-1, 9, 3) for name in ("achieved_goal", "desired_goal")
    )
    np.testing.assert_array_equal(achieved, state.worlds.x[:, nine])
    for world in range(4):
        places = cloth.task.goal(state.variables, world)[nine].astype(np.float32)
        np.testing.assert_array_equal(desired[world], places)


@rewards
@twins
def test_a_reward_is_that_of_the_goals_alone(id, reward):
    env, results = played(id, reward=reward)
    for observation, earned, terminated, truncated, info in results:
        goals = observation["achieved_goal"], observation["desired_goal"]
        np.testing.assert_array_equal(env.compute_reward(*goals, info), earned)
        np.testing.assert_array_equal(env.compute_terminated(*goals, info), terminated)
        np.testing.assert_array_equal(env.compute_truncated(*goals, info), truncated)


@rewards
@twins
def test_rewards_of_many_goals_are_those_of_each(id, reward):
    env, results = played(id, reward=reward)
    achieved, desired = (
        np.stack([step[0][name] for step in results]) for name in ("achieved_goal", "desired_goal")
    )
    desired[::2] = achieved[::2]  # as hindsight replaces goals
    many = env.compute_reward(achieved, desired, {})
    assert many.shape == achieved.shape[:2]
    assert (many[::2] == 1.0).all()
    single = make(id, reward=reward).unwrapped
    for place in ((0, 0), (1, 2), (-1, -1)):
        alone = single.compute_reward(achieved[place], desired[place], {})
        assert np.shape(alone) == ()
        assert alone == many[place]
        assert not single.compute_terminated(achieved[place], desired[place], {"diverged": False})
        assert not single.compute_truncated(achieved[place], desired[place], {})


@pytest.mark.parametrize(("id", "tolerance"), [("PBDRopeGoal-v0", 0.05), ("PBDClothGoal-v0", 0.05)])
def test_the_sparse_reward_is_1_within_the_tolerance_and_else_0(id, tolerance):
    env = make(id).unwrapped
    dim = env.task.model.dim
    goal = np.zeros(env.observation_space["achieved_goal"].shape, dtype=np.float32)
    away = np.zeros((2, len(goal) // dim, dim), dtype=np.float32)
    away[:, :, 0] = np.array([0.99 * tolerance, 1.01 * tolerance])[:, None]
    reward = env.compute_reward(away.reshape(2, -1), np.stack([goal, goal]), [{}, {}])
    assert reward.tolist() == [1.0, 0.0]


@twins
def test_goals_that_do_not_fit_are_refused(id):
    env = make(id).unwrapped
    size = env.observation_space["desired_goal"].shape[0]
    for mine, other in (((size,), (2, size)), ((size + 1,), (size + 1,)), ((), ())):
        with pytest.raises(ValueError, match=rf"expected the same, \(\.\.\., {size}\)"):
            env.compute_reward(np.zeros(mine), np.zeros(other), {})


@pytest.mark.parametrize("reward", ["shaped", None, 1])
def test_a_reward_of_no_known_kind_is_refused(reward):
    with pytest.raises(ValueError, match=r"reward is .*; allowed: 'sparse', 'dense'"):
        make("PBDRopeGoal-v0", reward=reward)


@pytest.mark.parametrize("faces", [make, lambda id, **keywords: make_vec(id, 2, **keywords)])
def test_a_task_whose_goals_are_not_apart_is_refused(faces):
    with pytest.raises(ValueError, match="Rope is no GoalTask"):
        faces("PBDRopeGoal-v0", task="pbd_gym.tasks.rope:Rope")


@pytest.mark.parametrize("worlds", [1, 3])
def test_stable_baselines3_learns_from_hindsight(worlds):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import SAC, HerReplayBuffer

    from pbd_gym.sb3 import make_sb3_vec_env

    if worlds == 1:
        env = make("PBDRopeGoal-v0", max_episode_steps=10)
    else:
        env = make_sb3_vec_env("pbd_gym:PBDRopeGoal-v0", worlds, seed=0, max_episode_steps=10)
    model = SAC(
        "MultiInputPolicy",
        env,
        replay_buffer_class=HerReplayBuffer,
        learning_starts=15 * worlds,
        batch_size=32,
        policy_kwargs={"net_arch": [8]},
        seed=0,
        device="cpu",
    )
    model.learn(30 * worlds)
    samples = model.replay_buffer.sample(200)
    goals = (
        samples.next_observations["achieved_goal"].numpy(),
        samples.next_observations["desired_goal"].numpy(),
    )
    reward = model.get_env().env_method("compute_reward", *goals, {}, indices=[0])[0]
    np.testing.assert_array_equal(samples.rewards.numpy()[:, 0], reward.astype(np.float32))
    assert 0.0 < reward.mean() < 1.0, "no goal was replaced by what was achieved"
