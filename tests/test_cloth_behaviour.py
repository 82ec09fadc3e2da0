"""How the cloth of the cloth task behaves under rough hands: it stays whole and comes to rest."""

import numpy as np
import pytest

from pbd_gym.envs import PBDVectorEnv
from pbd_gym.physics import World
from pbd_gym.tasks.cloth import Cloth

GAP = 0.005  # the task keeps particles this far above the table [m]


def make(worlds: int) -> PBDVectorEnv:
    env = PBDVectorEnv(worlds, "pbd_gym.tasks.cloth:Cloth", observation="keypoints")
    env.reset(seed=0)
    return env


def state(env: PBDVectorEnv) -> tuple[np.ndarray, np.ndarray]:
    worlds = env.get_state().worlds
    return worlds.x.astype(np.float64), worlds.v.astype(np.float64)


def speeds(env: PBDVectorEnv) -> np.ndarray:
    """Speed of the fastest particle of each world [m/s]."""
    return np.sqrt((state(env)[1] ** 2).sum(axis=2)).max(axis=1)


def test_random_actions_stretch_no_thread_by_five_percent_and_push_nothing_into_the_table() -> None:
    env = make(128)
    pairs, rest = env.task.model.links()
    generator = np.random.default_rng(0)
    worst, lowest = 0.0, np.inf
    for _ in range(200):
        env.step(generator.uniform(-1.0, 1.0, (128, 6)).astype(np.float32))
        x, _ = state(env)
        ends = x[:, pairs]
        length = np.sqrt(((ends[:, :, 0] - ends[:, :, 1]) ** 2).sum(axis=2))
        worst, lowest = max(worst, (length / rest).max() - 1.0), min(lowest, x[:, :, 2].min())
    assert worst < 0.05
    assert lowest > GAP - 1e-3


def test_a_cloth_that_lies_flat_lies_still() -> None:
    task = Cloth()
    world = World(task.model)
    line = np.linspace(-0.3, 0.3, task.particles)
    places = world.x[0].reshape(task.particles, task.particles, 3)
    places[..., 0], places[..., 1], places[..., 2] = line, -line[:, None], GAP
    for _ in range(60):
        world.step(1.0 / task.control_rate, task.substeps)
        assert np.sqrt((world.v**2).sum(axis=2)).max() < 0.01


def test_crumpled_cloths_come_to_rest_below_their_held_corners() -> None:
    worlds, moving, resting = 128, 75, 60
    env = make(worlds)
    pins = env.task.model.pins
    generator = np.random.default_rng(0)
    half = generator.uniform(0.05, 0.2, (worlds, 1))
    for _ in range(moving):
        held = state(env)[0][:, pins]
        apart = held[:, 1] - held[:, 0]
        apart /= np.sqrt((apart**2).sum(axis=1, keepdims=True))
        middle = held.mean(axis=1)
        middle[:, 2] = 0.03
        target = np.stack([middle - half * apart, middle + half * apart], axis=1)
        jitter = generator.uniform(-0.3, 0.3, target.shape)
        action = np.clip(np.clip(3.0 * (target - held), -1.0, 1.0) + jitter, -1.0, 1.0)
        env.step(action.reshape(worlds, 6).astype(np.float32))
    for _ in range(resting):
        env.step(np.zeros((worlds, 6), dtype=np.float32))
    # Of 1536 worlds of three other seeds 98.7 % are below 3 cm/s 2 s after the hands stop; in the
    # others a last fold is still falling. Of these 128 all are.
    assert (speeds(env) < 0.03).mean() >= 0.98
    assert np.median(speeds(env)) < 0.002


@pytest.mark.parametrize("links", [1, 2, 3])
def test_random_actions_keep_pendulums_whole(links: int) -> None:
    env = PBDVectorEnv(64, "pbd_gym.tasks.pendulum:Pendulum", links=links)
    env.reset(seed=0)
    generator = np.random.default_rng(0)
    pairs, rest = env.task.model.links()
    for _ in range(300):
        env.step(generator.uniform(-1.0, 1.0, (64, 1)).astype(np.float32))
        ends = state(env)[0][:, pairs]
        length = np.sqrt(((ends[:, :, 0] - ends[:, :, 1]) ** 2).sum(axis=2))
        # Newton's second iteration leaves float32 rounding and its own quadratic remainder
        assert np.abs(length / rest - 1.0).max() < 1e-3
