"""What the tasks ask: starts, the drive of the pins, success, performance, scripted policies."""

import dataclasses

import numpy as np
import pytest
from episodes import IDS, VARIANTS, flat, make, make_vec, nothing, parts, play

# float32 positions of about 1 m are exact to 6e-8 m, which over a control step of 20 ms is
# 6e-6 m/s, and over two of them 6e-4 m/s2
SPEED_ERROR, ACCELERATION_ERROR = 1e-4, 1e-2


def pins(env):
    """Positions of the pins, (W, P, dim) [m]."""
    return env.unwrapped.get_state().worlds.x[:, env.unwrapped.task.model.pins].astype(np.float64)


def outcomes(env, policy, seed):
    """Mean reward (W,) and the last info of an episode in all worlds."""
    observation, _ = env.reset(seed=seed)
    rewards = []
    for _ in range(env.unwrapped.max_episode_steps):
        observation, reward, _, _, info = env.step(policy(observation))
        rewards.append(reward)
    return np.mean(rewards, axis=0), info


@pytest.mark.parametrize("observation", ["particles", "keypoints"])
@pytest.mark.parametrize("id", IDS)
def test_the_scripted_policy_beats_random_actions(id, observation):
    env = make_vec(id, 64, observation=observation)
    random = np.random.default_rng(0)
    shape = env.action_space.shape
    scripted, done = outcomes(env, env.unwrapped.task.scripted, 0)
    chance, drawn = outcomes(env, lambda _: random.uniform(-1, 1, shape), 0)
    # several standard errors of 64 episodes apart
    assert scripted.mean() > chance.mean() + 5.0 * chance.std() / 8.0
    assert done["is_success"].mean() >= drawn["is_success"].mean()


@pytest.mark.parametrize("id", IDS)
def test_the_scripted_policy_acts_alike_alone_and_among_many(id):
    env = make_vec(id, 5)
    observation, _ = env.reset(seed=3)
    actions = env.unwrapped.task.scripted(observation)
    assert actions.dtype == np.float32
    assert env.action_space.contains(actions)
    for world in range(5):
        own = {name: part[world : world + 1] for name, part in parts(observation).items()}
        alone = env.unwrapped.task.scripted(own.get("", own))[0]
        # linear algebra may add up in another order
        np.testing.assert_allclose(alone, actions[world], rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("id", IDS)
def test_every_quantity_is_drawn_over_its_whole_range(id):
    env = make_vec(id, 1000)
    task = env.unwrapped.task
    start, seen = type(task).start, {}

    def spying(self, quantities):
        seen.update(quantities)
        return start(self, quantities)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(task), "start", spying)
        env.reset(seed=0)
    assert seen.keys() == task.draws.keys()
    for name, spec in task.draws.items():
        values = seen[name]
        assert values.shape == (1000, len(spec.low))
        assert (spec.low <= values).all()
        assert (values <= spec.high).all()
        # of 1000 uniform draws one comes within 2 % of each end, but for a chance of 2e-9
        near = 0.02 * (spec.high - spec.low)
        assert (values.min(axis=0) <= spec.low + near).all()
        assert (values.max(axis=0) >= spec.high - near).all()


OPTIONS = {
    "PBDPendulum-v0": {"angles": [2.0], "rates": [-0.5], "pivot": [0.25]},
    "PBDDoublePendulum-v0": {"angles": [2.0, -1.0], "rates": [0.5, 0.0], "pivot": 0.25},
    "PBDTriplePendulum-v0": {"angles": [3.0, 0.0, 1.0], "rates": [0, 0, 0], "pivot": -0.25},
    "PBDRope-v0": {"gripper": [0.5, 0.25], "goal": [-0.5, -0.5]},
    "PBDCloth-v0": {
        "middle": [0.1, -0.1],
        "height": 0.7,
        "yaw": 0.25,
        "goal": [0.0, 0.1],
        "goal_yaw": -0.25,
    },
}
OPTIONS |= {id.replace("-v0", "Goal-v0"): OPTIONS[id] for id in ("PBDRope-v0", "PBDCloth-v0")}


@pytest.mark.parametrize("id", IDS)
def test_options_fix_what_is_drawn(id):
    env = make(id)
    assert OPTIONS[id].keys() == env.unwrapped.task.draws.keys()
    fixed = {flat(env.reset(seed=seed, options=OPTIONS[id])[0]).tobytes() for seed in range(3)}
    drawn = {flat(env.reset(seed=seed)[0]).tobytes() for seed in range(3)}
    assert len(fixed) == 1
    assert len(drawn) == 3


@pytest.mark.parametrize("id", IDS)
def test_an_option_leaves_the_other_quantities_as_drawn(id):
    (first, value), *_ = OPTIONS[id].items()
    env = make(id)
    env.reset(seed=5)
    drawn = env.unwrapped.get_state()
    env.reset(seed=5, options={first: value})
    fixed = env.unwrapped.get_state()
    # the generators have drawn as often, so the next episode is the same too
    assert drawn.generators == fixed.generators
    if "goal" in drawn.variables and first != "goal":
        np.testing.assert_array_equal(drawn.variables["goal"], fixed.variables["goal"])


def test_a_pendulum_starts_at_the_angles_and_the_place_of_its_options():
    env = make("PBDDoublePendulum-v0")
    env.reset(options={"angles": [0.5 * np.pi, np.pi], "rates": [0.0, 0.0], "pivot": 0.25})
    # the first link points to the right, the second up from its end; float32 of 1 m
    expected = [[0.25, 0.0], [0.75, 0.0], [0.75, 0.5]]
    np.testing.assert_allclose(env.unwrapped.get_state().worlds.x[0], expected, atol=1e-6)


def test_pendulums_begin_upright_in_the_asked_share_of_episodes():
    env = make_vec("PBDDoublePendulum-v0", 1000, start_upright=0.3, start_angle=0.5, start_rate=1.5)
    env.reset(seed=0)
    state = env.unwrapped.get_state().worlds
    link = np.diff(state.x, axis=1) / env.unwrapped.task.link_length
    rate = np.diff(state.v, axis=1) / env.unwrapped.task.link_length
    stands = link[:, 0, 1] > 0.0
    assert abs(stands.mean() - 0.3) < 0.06  # four standard errors of 1000 episodes
    height = np.where(stands[:, None], link[:, :, 1], -link[:, :, 1])
    # 2000 links come within 1 % of the widest angle, and within float32 of the link's length
    assert np.cos(0.5) - 1e-6 <= height.min() <= np.cos(0.495)
    turning = link[:, :, 0] * rate[:, :, 1] - link[:, :, 1] * rate[:, :, 0]
    assert 1.485 <= np.abs(turning).max() <= 1.5 + 1e-5


def test_a_pendulum_that_stands_measures_its_angles_from_upright():
    env = make("PBDDoublePendulum-v0", start_upright=0.5)
    env.reset(options={"stand": 0.0, "angles": [0.5 * np.pi, 0.0], "rates": [0.0, 0.0]})
    expected = [[0.0, 0.0], [-0.5, 0.0], [-0.5, 0.5]]
    np.testing.assert_allclose(env.unwrapped.get_state().worlds.x[0], expected, atol=1e-6)


def test_a_rope_starts_below_the_gripper_of_its_options():
    env = make("PBDRope-v0")
    env.reset(options={"gripper": [0.5, 0.25]})
    x = env.unwrapped.get_state().worlds.x[0]
    np.testing.assert_allclose(x[[0, -1]], [[0.5, 0.25], [0.5, -0.75]], atol=1e-6)


def test_a_cloth_starts_between_the_grippers_of_its_options():
    env = make("PBDCloth-v0")
    env.reset(options={"middle": [0.1, -0.1], "height": 0.7, "yaw": 0.5 * np.pi})
    (first, second) = pins(env)[0]
    np.testing.assert_allclose((first + second) / 2, [0.1, -0.1, 0.7], atol=1e-6)
    # turned by a quarter, the line between the grippers runs along +y
    apart = second - first
    np.testing.assert_allclose(apart[[0, 2]], 0.0, atol=1e-6)
    assert apart[1] > 0.9 * env.unwrapped.task.side


@pytest.mark.parametrize(
    ("id", "options", "speed"),
    [
        # hanging straight from float32 positions; links settle by rounding alone
        ("PBDPendulum-v0", {"angles": [0.0], "rates": [0.0]}, 1e-3),
        ("PBDTriplePendulum-v0", {"angles": [0.0] * 3, "rates": [0.0] * 3}, 1e-3),
        ("PBDRope-v0", {}, 1e-3),
        # relaxed for some seconds with damping of 1/s: what is left of the swing is a few mm
        ("PBDCloth-v0", {}, 2e-2),
    ],
)
def test_a_body_starts_at_rest_and_stays_so_when_nothing_moves(id, options, speed):
    env = make_vec(id, 4)
    env.reset(seed=0, options=options)
    start = env.unwrapped.get_state().worlds.x
    for _ in range(30):
        env.step(nothing(env))
        worlds = env.unwrapped.get_state().worlds
        # [m/s]
        assert np.abs(worlds.v).max() < speed
        # of 1 s: what that speed could drift by [m]
        assert np.abs(worlds.x - start).max() < speed


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


@pytest.mark.parametrize("faces", [make, lambda id: make_vec(id, 2)])
@pytest.mark.parametrize(
    ("id", "options"),
    [
        ("PBDRope-v0", {"gripper": [0.25, 0.5], "goal": [0.25, -0.5]}),
        ("PBDPendulum-v0", {"angles": [3.141592653589793], "rates": [0.0]}),
    ],
)
def test_success_needs_the_goal_to_be_held(id, options, faces):
    env = faces(id)
    hold = env.unwrapped.task.hold_steps
    assert hold > 1
    env.reset(seed=0, options=options)
    success = [np.all(step[4]["is_success"]) for step in play(env, [nothing(env)] * hold)]
    assert success == [False] * (hold - 1) + [True]


def test_leaving_the_goal_starts_the_hold_anew():
    env = make("PBDRope-v0")
    hold = env.unwrapped.task.hold_steps
    env.reset(seed=0, options={"gripper": [0.25, 0.5], "goal": [0.25, -0.5]})
    play(env, [nothing(env)] * (hold - 1))
    # one state far away, as if the rope had been blown aside for a step
    at_goal = env.unwrapped.get_state()
    x = at_goal.worlds.x + np.float32(0.25)
    away = dataclasses.replace(at_goal, worlds=dataclasses.replace(at_goal.worlds, x=x))
    env.unwrapped.set_state(away)
    assert not env.step(nothing(env))[4]["is_success"]
    passed = env.unwrapped.get_state()
    back = dataclasses.replace(passed, worlds=at_goal.worlds)
    env.unwrapped.set_state(back)
    success = [step[4]["is_success"] for step in play(env, [nothing(env)] * hold)]
    assert success == [False] * (hold - 1) + [True]


def test_a_cloth_has_succeeded_when_nine_tenths_of_the_way_are_done():
    env = make_vec("PBDCloth-v0", 64)
    _, info = outcomes(env, env.unwrapped.task.scripted, 0)
    np.testing.assert_array_equal(info["is_success"], info["normalized_performance"] > 0.9)
    assert info["is_success"].any(), "the scripted policy laid no cloth down"


@pytest.mark.parametrize("id", IDS)
def test_normalized_performance_is_0_at_the_start(id):
    env = make(id)
    still = {"angles": [0.0] * len(OPTIONS[id]["angles"])} if "angles" in OPTIONS[id] else {}
    rates = {"rates": np.zeros(len(still["angles"]))} if still else {}
    env.reset(seed=0, options=still | rates)
    *_, info = env.step(nothing(env))
    # nothing has moved but by settling: 1 % of the way
    assert abs(info["normalized_performance"]) < 0.01


@pytest.mark.parametrize("id", IDS)
def test_normalized_performance_is_1_at_the_best(id):
    env = make(id).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    best = best_positions(env, state).astype(np.float32)
    worlds = dataclasses.replace(state.worlds, x=best[None], v=np.zeros_like(best[None]))
    env.set_state(dataclasses.replace(state, worlds=worlds))
    _, reward, _, _, info = env.step(nothing(env))
    # a body put there settles by a little, at most 2 % of the way
    assert 0.98 < info["normalized_performance"] <= 1.0
    assert reward > 0.9


def best_positions(env, state):
    """Where the particles are when a task is done (N, dim)."""
    task, x = env.task, state.worlds.x[0].astype(np.float64)
    goal = task.goal(state.variables, 0)
    if goal is None:  # pendulums: upright
        upright = np.zeros_like(x)
        upright[:, 1] = np.linspace(0.0, task.length, len(x))
        return upright
    if np.isnan(goal).any():  # rope: hanging with its end at the goal
        return x + (goal[-1] - x[-1])
    return goal


@pytest.mark.parametrize("id", VARIANTS)
def test_a_goal_has_a_place_or_none_for_every_particle(id):
    env = make(id).unwrapped
    env.reset(seed=0)
    goal = env.task.goal(env.get_state().variables, 0)
    assert goal is None or goal.shape == env.task.model.positions.shape


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
