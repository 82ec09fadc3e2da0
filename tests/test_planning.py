"""Plans come true to the last bit, are reproducible, and get better by searching."""

import dataclasses

import numpy as np
import pytest

from episodes import IDS, assert_same, make, make_vec, play, random_actions
from pbd_gym.planning import METHODS, SETTINGS, Planner, PlannerSettings, planner_settings

SMALL = PlannerSettings(
    horizon=8, knots=3, candidates=12, iterations=2, elites=0.25, guided=0.25, replan=3
)


def begun(id, num_worlds=2, steps=3):
    """Worlds in the midst of their episodes."""
    env = make_vec(id, num_worlds, max_episode_steps=None)
    env.reset(seed=4)
    play(env, random_actions(env, steps))
    return env.unwrapped


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("id", ["PBDDoublePendulum-v0", "PBDRopeGoal-v0", "PBDCloth-v0"])
def test_what_a_plan_predicts_is_what_the_environment_pays(id, method):
    env = begun(id)
    # the scripted policy is often the best of so few
    settings = dataclasses.replace(SMALL, method=method, guided=0.9)
    planner = Planner(env.task, settings, num_worlds=2)
    for _ in range(3):
        plan = planner.plan(env.get_state())
        for step in range(SMALL.replan):
            reward = env.step(plan.actions[:, step])[1]
            np.testing.assert_array_equal(reward, plan.rewards[:, step])


def test_a_single_environment_pays_what_was_planned():
    env = make("PBDRope-v0")
    env.reset(seed=4)
    plan = Planner(env.unwrapped.task, SMALL).plan(env.unwrapped.get_state())
    assert [step[1] for step in play(env, plan.actions[0])] == plan.rewards[0].tolist()


@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_plans_the_same_and_another_otherwise(method):
    env = begun("PBDRope-v0")
    settings = dataclasses.replace(SMALL, method=method, guided=0)

    def plans(planner):
        return [planner.plan(env.get_state()) for _ in range(2)]

    planner = Planner(env.task, settings, num_worlds=2, seed=1)
    first = plans(planner)
    assert_same(plans(Planner(env.task, settings, num_worlds=2, seed=1)), first)
    planner.reset(1)
    assert_same(plans(planner), first)
    other = plans(Planner(env.task, settings, num_worlds=2, seed=2))
    assert (other[0].actions != first[0].actions).any()


def test_planning_leaves_the_environment_as_it_is():
    env = begun("PBDRope-v0")
    before = env.get_state()
    Planner(env.task, SMALL, num_worlds=2).plan(before)
    assert_same(env.get_state(), before)


def test_a_plan_is_never_worse_than_the_rest_of_the_last_one():
    env = begun("PBDRope-v0", steps=1)
    settings = dataclasses.replace(SMALL, spread=3.0, guided=0)
    planner = Planner(env.task, settings, num_worlds=2)
    rest = SMALL.horizon - SMALL.replan
    for _ in range(4):
        plan = planner.plan(env.get_state())
        play(env, plan.actions[:, : SMALL.replan].transpose(1, 0, 2))
        held = np.repeat(plan.actions[:, -1:], SMALL.replan, axis=1)
        state = env.get_state()
        sequence = np.concatenate([plan.actions[:, SMALL.replan :], held], axis=1)
        kept = sum(step[1] for step in play(env, sequence.transpose(1, 0, 2)))
        assert rest > 0
        env.set_state(state)
        # sums of eight rewards in another order
        assert (planner.plan(state).rewards.sum(axis=1) >= kept - 1e-12).all()
        planner.reset()


def test_more_candidates_and_iterations_find_more():
    env = begun("PBDRope-v0", num_worlds=8, steps=1)
    few = dataclasses.replace(SMALL, horizon=20, knots=5, candidates=4, iterations=1, guided=0)
    many = dataclasses.replace(few, candidates=64, iterations=3)
    found = [
        Planner(env.task, settings, num_worlds=8).plan(env.get_state()).rewards.sum(axis=1)
        for settings in (few, many)
    ]
    assert (found[1] > found[0]).all()


def test_a_planner_holds_an_inverted_pendulum_by_its_scripted_policy():
    env = make_vec("PBDDoublePendulum-v0", 1, max_episode_steps=None).unwrapped
    env.reset(seed=0, options={"angles": [3.1, -3.1], "rates": [0.0, 0.0]})
    settings = planner_settings("PBDDoublePendulum-v0", candidates=32)
    planner = Planner(env.task, settings)
    for _ in range(4):
        plan = planner.plan(env.get_state())
        infos = [step[4] for step in play(env, plan.actions[0, : settings.replan, None])]
    assert infos[-1]["upright"][0] > 0.99


def test_a_guided_plan_promises_no_less_than_the_scripted_policy_earns():
    env = begun("PBDRope-v0", num_worlds=3)
    state = env.get_state()
    planner = Planner(env.task, dataclasses.replace(SMALL, iterations=1), num_worlds=3)
    promised = planner.plan(state).rewards.sum(axis=1)
    # the same steps as before, for what is observed after them
    observation = env.reset(seed=4)[0]
    for action in random_actions(env, 3):
        observation = env.step(action)[0]
    earned = np.zeros(3)
    for _ in range(SMALL.horizon):
        observation, reward, *_ = env.step(env.task.scripted(observation))
        earned += reward
    # sums of eight rewards in another order
    assert (promised >= earned - 1e-12).all()


def test_actions_are_those_of_one_plan_after_the_other():
    env = begun("PBDPendulum-v0")
    settings = PlannerSettings(horizon=6, knots=3, candidates=8, iterations=1, replan=2)
    acting, planning = (Planner(env.unwrapped.task, settings, num_worlds=2) for _ in range(2))
    for _ in range(3):
        plan = planning.plan(env.unwrapped.get_state())
        for step in range(settings.replan):
            actions = acting.act(env.unwrapped.get_state())
            assert np.array_equal(actions, plan.actions[:, step])
            env.step(actions)
    acting.act(env.unwrapped.get_state())
    acting.reset()  # forgets what is left of the plan, too
    planning.reset()
    state = env.unwrapped.get_state()
    assert np.array_equal(acting.act(state), planning.plan(state).actions[:, 0])


def test_worlds_that_are_forgotten_are_planned_from_nothing():
    env = begun("PBDRope-v0")
    planner, fresh = (Planner(env.task, SMALL, num_worlds=2) for _ in range(2))
    planner.plan(env.get_state())
    planner.reset()
    planner.forget(np.array([True, True]))
    assert_same(planner.plan(env.get_state()), fresh.plan(env.get_state()))


def test_a_state_of_other_worlds_is_refused():
    env = begun("PBDRope-v0", num_worlds=3)
    with pytest.raises(ValueError, match="the state holds 3 worlds"):
        Planner(env.task, SMALL, num_worlds=2).plan(env.get_state())
    with pytest.raises(ValueError, match="the state remembers"):
        Planner(make("PBDPendulum-v0").unwrapped.task, SMALL, num_worlds=3).plan(env.get_state())
    new = make("PBDRope-v0").unwrapped
    with pytest.raises(ValueError, match="0 of them begun"):
        Planner(new.task, SMALL).plan(new.get_state())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("method", "icem"), ("horizon", 0), ("horizon", 2.5), ("knots", 31), ("candidates", 1)],
        *[("iterations", 0), ("elites", 1.5), ("guided", -0.1), ("guided", 1.0), ("replan", 31)],
        *[("temperature", 0.0), ("spread", float("nan")), ("tail", -1.0)],
    ],
)
def test_settings_that_cannot_be_meant_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value!r}"):
        PlannerSettings(**{name: value})


def test_settings_are_those_of_registered_environments():
    assert set(SETTINGS) <= set(IDS)
    assert planner_settings("pbd_gym:PBDCloth-v0", horizon=45).horizon == 45
    assert planner_settings("Crane-v0") == PlannerSettings()
