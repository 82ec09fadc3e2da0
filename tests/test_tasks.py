"""How the tasks begin, and their scripted policies."""

import numpy as np
import pytest

from episodes import IDS, flat, make, make_vec, nothing, outcomes, parts, pins
from pbd_gym.envs import PBDEnv
from pbd_gym.tasks.base import Draw, Start
from pbd_gym.tasks.pendulum import Pendulum


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


class Still(Pendulum):
    """A pendulum of which nothing is drawn."""

    def declare_draws(self) -> dict[str, Draw]:
        return {}

    def start(self, quantities: dict[str, np.ndarray]) -> Start:
        places = {"angles": 1, "rates": 1, "pivot": 1}
        return super().start({name: np.zeros((1, size)) for name, size in places.items()})


def test_a_task_may_draw_nothing():
    env = PBDEnv(Still)
    first, _ = env.reset(seed=0)
    second, _ = env.reset(seed=1)
    assert np.array_equal(first, second)
