"""The batch equals a SyncVectorEnv of single environments, to the last bit."""

import copy

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from episodes import (
    IDS,
    MODES,
    VARIANTS,
    FragileRope,
    assert_same,
    make,
    make_sync,
    make_vec,
    play,
    random_actions,
)

# worlds of this rope end apart by termination, and together by truncation where they last
FRAGILE = {"task": FragileRope, "max_episode_steps": 9}


def both(id, num_envs, mode, **keywords):
    """The batch and the environments one by one."""
    batch = make_vec(id, num_envs, autoreset_mode=mode, **keywords)
    return batch, make_sync(id, num_envs, mode, **keywords)


def play_both(batch, sync, steps, seed=0):
    """Play the same actions in both, comparing all that comes back; return the ends."""
    ends = []
    for action in random_actions(batch, steps, seed):
        result = batch.step(action)
        assert_same(result, sync.step(action))
        ends.append(result[2:4])
        if batch.metadata["autoreset_mode"] is AutoresetMode.DISABLED:
            mask = result[2] | result[3]
            if mask.any():
                reset = [env.reset(options={"reset_mask": mask.copy()}) for env in (batch, sync)]
                assert_same(*reset)
    return np.array(ends)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("num_envs", [1, 3, 5])
def test_worlds_that_end_apart_equal_single_environments(mode, num_envs):
    batch, sync = both("PBDRope-v0", num_envs, mode, **FRAGILE)
    assert_same(batch.reset(seed=11), sync.reset(seed=11))
    ends = play_both(batch, sync, 60)
    assert ends[:, 0].any(), "none was terminated"
    assert ends[:, 1].any(), "none was truncated"
    if num_envs > 1:
        ended = ends.any(axis=1)
        assert (ended.any(axis=1) & ~ended.all(axis=1)).any(), "all ended at once"


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("id", IDS)
def test_every_id_equals_single_environments(id, mode):
    batch, sync = both(id, 3, mode, max_episode_steps=6)
    assert_same(batch.reset(seed=11), sync.reset(seed=11))
    play_both(batch, sync, 3)
    # from here on the worlds are truncated at different times
    mask = np.array([False, True, False])
    reset = [env.reset(options={"reset_mask": mask.copy()}) for env in (batch, sync)]
    assert_same(*reset)
    play_both(batch, sync, 20, seed=1)


@pytest.mark.parametrize("mode", MODES)
def test_a_batch_in_lanes_equals_single_environments(mode):
    batch, sync = both("PBDRope-v0", 40, mode, **FRAGILE)
    assert_same(batch.reset(seed=11), sync.reset(seed=11))
    play_both(batch, sync, 25)


@pytest.mark.parametrize("id", VARIANTS)
def test_a_batch_describes_itself_as_single_environments_do(id):
    batch, sync = both(id, 3, AutoresetMode.SAME_STEP)
    assert batch.num_envs == 3
    assert batch.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    for name in ("action", "observation", "single_action", "single_observation"):
        assert getattr(batch, f"{name}_space") == getattr(sync, f"{name}_space")


def test_autoreset_begins_with_the_next_step_unless_asked_otherwise():
    assert make_vec("PBDRope-v0", 2).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


@pytest.mark.parametrize("mode", MODES)
def test_an_autoreset_mode_can_be_given_by_its_name(mode):
    assert make_vec("PBDRope-v0", 2, autoreset_mode=mode.name).metadata["autoreset_mode"] is mode


@pytest.mark.parametrize("seed", [7, [7, 3, 7], [7, None, 3]])
def test_seeds_mean_what_they_mean_to_single_environments(seed):
    batch, sync = both("PBDRope-v0", 3, AutoresetMode.NEXT_STEP)
    # first a seed for all, so that the world without one draws on from a known place
    assert_same(batch.reset(seed=1), sync.reset(seed=1))
    assert_same(batch.reset(seed=seed), sync.reset(seed=seed))
    assert_same(batch.reset(), sync.reset())


def test_worlds_without_a_seed_start_apart_and_unlike_any_other_batch():
    starts = [make_vec("PBDRope-v0", 3).reset()[0] for _ in range(2)]
    assert len(np.unique(np.concatenate(starts), axis=0)) == 6


def test_a_seed_goes_only_to_the_worlds_that_are_reset():
    batch, sync = both("PBDRope-v0", 3, AutoresetMode.NEXT_STEP)
    mask = np.array([True, False, True])
    for env in (batch, sync):
        env.reset(seed=1)
    options = [{"reset_mask": mask.copy()} for _ in range(2)]
    reset = [
        env.reset(seed=9, options=one) for env, one in zip((batch, sync), options, strict=True)
    ]
    assert_same(*reset)
    assert_same(batch.reset(), sync.reset())


def test_an_option_for_all_worlds_equals_single_environments():
    batch, sync = both("PBDRope-v0", 3, AutoresetMode.NEXT_STEP)
    options = {"goal": [0.25, -0.5]}
    assert_same(batch.reset(seed=1, options=options), sync.reset(seed=1, options=options))
    assert_same(batch.reset(), sync.reset())


@pytest.mark.parametrize(
    ("id", "name", "rows"),
    [
        ("PBDDoublePendulum-v0", "angles", [[0.0, 3.0], [1.0, -1.0], [2.0, 0.5]]),
        ("PBDRope-v0", "goal", [[0.25, -0.5], [-0.5, -1.0], [0.0, 0.0]]),
        ("PBDCloth-v0", "goal_yaw", [[0.0], [0.25], [-2.0]]),
    ],
)
def test_an_option_with_a_row_per_world_gives_each_its_own(id, name, rows):
    batch = make_vec(id, 3)
    observation, _ = batch.reset(seed=4, options={name: np.array(rows)})
    for world, row in enumerate(rows):
        alone, _ = make(id).reset(seed=4 + world, options={name: row})
        np.testing.assert_array_equal(observation[world], alone)


def test_an_option_reaches_only_the_worlds_that_are_reset():
    batch = make_vec("PBDRope-v0", 3)
    before, _ = batch.reset(seed=4)
    mask = np.array([False, True, False])
    after, _ = batch.reset(options={"goal": [0.25, -0.5], "reset_mask": mask})
    np.testing.assert_array_equal((before == after).all(axis=1), ~mask)


def test_the_options_of_the_caller_stay_as_they_are():
    batch = make_vec("PBDRope-v0", 3)
    mask, goal = np.array([True, False, True]), np.full((3, 2), -0.25)
    options = {"reset_mask": mask, "goal": goal}
    batch.reset(seed=4)
    batch.reset(options=options)
    play(batch, random_actions(batch, 3))
    assert options.keys() == {"reset_mask", "goal"}
    assert options["reset_mask"] is mask
    assert mask.tolist() == [True, False, True]
    assert (goal == -0.25).all()


def test_actions_of_the_caller_stay_as_they_are():
    batch = make_vec("PBDRope-v0", 3)
    batch.reset(seed=4)
    actions = np.full((3, 2), 2.5, dtype=np.float32)
    batch.step(actions)
    assert (actions == 2.5).all()


@pytest.mark.parametrize("mode", MODES)
def test_results_of_one_step_are_not_changed_by_the_next(mode):
    batch = make_vec("PBDRope-v0", 3, autoreset_mode=mode, max_episode_steps=3)
    first = batch.reset(seed=4)
    for action in random_actions(batch, 8 if mode is not AutoresetMode.DISABLED else 3):
        kept = copy.deepcopy(first)
        second = batch.step(action)
        assert_same(first, kept)
        first = second
    kept = copy.deepcopy(first)
    batch.reset(seed=5)
    assert_same(first, kept)


@pytest.mark.parametrize("id", VARIANTS)
def test_one_world_and_many_are_truncated_at_the_same_step(id):
    steps = 4
    alone, batch = make(id, max_episode_steps=steps), make_vec(id, 2, max_episode_steps=steps)
    alone.reset(seed=0)
    batch.reset(seed=0)
    one = [step[3] for step in play(alone, random_actions(alone, steps))]
    many = [step[3].tolist() for step in play(batch, random_actions(batch, steps))]
    assert one == [False, False, False, True]
    assert many == [[truncated] * 2 for truncated in one]


@pytest.mark.parametrize("id", IDS)
def test_the_registered_limit_holds_for_a_batch(id):
    batch = make_vec(id, 2)
    assert batch.unwrapped.max_episode_steps == make(id).spec.max_episode_steps


def test_a_batch_without_a_limit_goes_on():
    batch = make_vec("PBDRope-v0", 2, max_episode_steps=None)
    batch.reset(seed=0)
    ends = [step[2] | step[3] for step in play(batch, random_actions(batch, 120))]
    assert not np.any(ends)


def test_staggered_first_episodes_end_evenly_spread_and_later_ones_are_whole():
    limit = 10
    env = make_vec(
        "PBDRope-v0", 5, max_episode_steps=limit, autoreset_mode="SAME_STEP", stagger=True
    )
    env.reset(seed=0)
    ends = [np.flatnonzero(env.step(env.action_space.sample())[3]) for _ in range(2 * limit)]
    env.close()
    assert [(step + 1, *worlds) for step, worlds in enumerate(ends) if len(worlds)] == [
        (2, 4), (4, 3), (6, 2), (8, 1), (10, 0), (12, 4), (14, 3), (16, 2), (18, 1), (20, 0)
    ]  # fmt: skip


def test_worlds_reset_by_a_mask_are_not_staggered():
    env = make_vec("PBDRope-v0", 2, max_episode_steps=4, autoreset_mode="DISABLED", stagger=True)
    env.reset(seed=0)
    for _ in range(2):
        truncated = env.step(env.action_space.sample())[3]
    assert truncated.tolist() == [False, True]
    env.reset(options={"reset_mask": np.array([False, True])})
    for _ in range(2):
        truncated = env.step(env.action_space.sample())[3]
    env.close()
    assert truncated.tolist() == [True, False]


def test_a_world_that_diverges_is_terminated_without_reward():
    batch = make_vec("PBDRope-v0", 5, task=FragileRope, autoreset_mode="SAME_STEP")
    batch.reset(seed=11)
    for observation, reward, terminated, _, infos in play(batch, random_actions(batch, 60)):
        assert np.isfinite(observation).all()
        if terminated.any():
            assert (reward[terminated] == 0.0).all()
            assert infos["final_info"]["diverged"][terminated].all()
            assert not infos["final_info"]["is_success"][terminated].any()
            return
    pytest.fail("no world diverged")


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_gymnasium_counts_returns_of_a_batch(mode):
    batch = RecordEpisodeStatistics(make_vec("PBDRope-v0", 3, autoreset_mode=mode, **FRAGILE))
    batch.reset(seed=11)
    lengths = []
    for *_, infos in play(batch, random_actions(batch, 30)):
        if "episode" in infos:
            lengths += infos["episode"]["l"][infos["_episode"]].tolist()
    assert lengths
    assert max(lengths) == 9
