"""What is kept of each world beside its physics: clips, divergence, streaks, scores."""

import numpy as np
import pytest

from episodes import make, make_vec, nothing
from pbd_gym.tasks.bookkeeping import clip_actions, clip_observations, find_diverged, keep_score


def test_actions_are_clipped_and_the_greatest_excess_of_each_world_is_told():
    actions = np.array([[0.5, -1.0], [3.0, -1.5], [-0.25, -4.0]])
    clipped, excess = np.empty((3, 2), dtype=np.float32), np.empty(3)
    assert clip_actions(actions, clipped, excess)
    np.testing.assert_array_equal(clipped, [[0.5, -1.0], [1.0, -1.0], [-0.25, -1.0]])
    np.testing.assert_array_equal(excess, [0.0, 2.0, 3.0])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_one_action_that_is_not_finite_is_noticed(value):
    actions = np.zeros((3, 2))
    actions[1, 1] = value
    assert not clip_actions(actions, np.empty((3, 2), dtype=np.float32), np.empty(3))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 100.0, -101.0])
def test_one_coordinate_out_of_bounds_makes_its_world_diverged(value):
    x, diverged = np.full((3, 5, 2), 99.0, dtype=np.float32), np.empty(3, dtype=bool)
    assert not find_diverged(x, 100.0, diverged)
    assert not diverged.any()
    x[1, 4, 1] = value
    assert find_diverged(x, 100.0, diverged)
    np.testing.assert_array_equal(diverged, [False, True, False])


def score(reached, diverged, streak):
    """Rewards, streaks and successes of worlds that are half way from -2 to 0."""
    count = len(reached)
    earned, normalized, success = np.empty(count), np.empty(count), np.empty(count, dtype=bool)
    ones, streak = np.ones(count), np.array(streak)
    performance, start = -ones, -2.0 * ones
    judged = 0.75 * ones, np.array(reached), performance, np.array(diverged)
    keep_score(*judged, start, streak, 0.0, 3, earned, normalized, success)
    np.testing.assert_array_equal(normalized, 0.5)
    return earned.tolist(), streak.tolist(), success.tolist()


def test_a_streak_grows_at_the_goal_and_ends_away_from_it_or_by_divergence():
    earned, streak, success = score(
        reached=[True, True, False, True],
        diverged=[False, False, False, True],
        streak=[0, 2, 5, 5],
    )
    assert earned == [0.75, 0.75, 0.75, 0.0]
    assert streak == [1, 3, 0, 0]
    assert success == [False, True, False, False]


def test_observations_are_clipped_in_place_and_nan_is_not_hidden():
    observations = np.array([[11.0, -1e30, 3.0], [np.inf, np.nan, -10.0]], dtype=np.float32)
    clip_observations(observations, 10.0)
    np.testing.assert_array_equal(observations, [[10.0, -10.0, 3.0], [10.0, np.nan, -10.0]])


@pytest.mark.parametrize("value", [np.nan, 1e6])
def test_a_world_out_of_bounds_is_terminated_and_put_back_and_the_others_go_on(value):
    env, twin = (make_vec("PBDRope-v0", 3) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    state = env.unwrapped.get_state()
    state.worlds.x[1, 5] = value
    env.unwrapped.set_state(state)
    observation, reward, terminated, _, info = env.step(nothing(env))
    expected, *_ = twin.step(nothing(twin))
    assert terminated.tolist() == info["diverged"].tolist() == [False, True, False]
    assert reward[1] == 0.0
    assert np.isfinite(observation).all()
    np.testing.assert_array_equal(observation[[0, 2]], expected[[0, 2]])


def test_a_task_may_judge_in_any_type_and_layout():
    env, twin = make("PBDRope-v0").unwrapped, make("PBDRope-v0").unwrapped
    judge = type(env.task).judge

    def judging(self, *arguments):
        judgement = judge(self, *arguments)
        wide = np.zeros((len(judgement.reward), 2), dtype=np.float32)
        wide[:, 0] = judgement.reward
        return judgement._replace(reward=wide[:, 0])

    twin.reset(seed=0)
    expected = twin.step(nothing(twin))[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(env.task), "judge", judging)
        env.reset(seed=0)
        assert env.step(nothing(env))[1] == np.float32(expected)
