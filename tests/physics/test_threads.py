"""Threads share the tiles of worlds: who advances a tile, and when, makes no difference."""

import time

import numpy as np
import pytest

from pbd_gym.physics import Adaptive, ModelBuilder, World, shapes
from pbd_gym.physics.threads import Crew

WORLDS = 200  # seven tiles of lanes, the last one not full
PAUSES = {"back to back": (0.0, 100), "after a pause": (0.005, 40)}  # [s] between steps, and steps


def ropes(num_threads: int) -> World:
    """Ropes that swing from different angles."""
    builder = ModelBuilder(2)
    rope = shapes.rope(builder, (0.0, 0.0), (1.0, 0.0), 8, mass=0.1)
    builder.pin(rope[0])
    world = World(builder.build(), WORLDS, num_threads=num_threads)
    world.x[:, :, 1] = -world.x[:, :, 0] * np.linspace(0.0, 1.0, WORLDS, dtype=np.float32)[:, None]
    return world


def swung(num_threads: int, steps: int, pause: float = 0.0, substeps: int | Adaptive = 4) -> World:
    """The ropes after some steps."""
    world = ropes(num_threads)
    for _ in range(steps):
        world.step(1 / 60, substeps=substeps)
        time.sleep(pause)
    return world


def assert_same(one: World, other: World) -> None:
    assert np.array_equal(one.x, other.x)
    assert np.array_equal(one.v, other.v)


@pytest.mark.parametrize(("pause", "steps"), PAUSES.values(), ids=PAUSES)
@pytest.mark.parametrize("num_threads", [2, 3, 7])
def test_helpers_that_wait_or_sleep_between_steps_change_no_bit(num_threads, pause, steps):
    assert_same(swung(num_threads, steps, pause), swung(1, steps))


def test_threads_share_worlds_that_take_different_numbers_of_substeps():
    substeps = Adaptive(reach=0.005, least=2, most=16)
    alone, shared = (swung(number, 20, substeps=substeps) for number in (1, 3))
    assert len(np.unique(alone.substeps_used)) > 1
    assert_same(alone, shared)


def test_a_world_goes_on_where_steps_of_another_kind_have_come_between():
    alone, shared = ropes(1), ropes(2)
    for world in (alone, shared):
        for step in range(30):
            world.step(1 / 60, substeps=2 + step % 2)
    assert_same(alone, shared)


@pytest.mark.parametrize("substeps", [4, Adaptive(reach=0.005, least=2, most=16)])
def test_a_world_that_is_being_stepped_is_refused_to_another_thread(monkeypatch, substeps):
    world, alone = ropes(2), ropes(1)
    elsewhere = np.full((WORLDS, 1, 2), 1.0, dtype=np.float32)
    work, refusals = Crew.work, []

    def work_while_another_comes(crew: Crew) -> None:
        with pytest.raises(RuntimeError, match="another thread is stepping") as refusal:
            world.step(1 / 30, substeps=3, targets=elsewhere)
        refusals.append(refusal)
        work(crew)

    alone.step(1 / 60, substeps=substeps)
    with monkeypatch.context() as patch:
        patch.setattr(Crew, "work", work_while_another_comes)
        world.step(1 / 60, substeps=substeps)
    assert refusals
    assert_same(world, alone)
    world.step(1 / 60, substeps=substeps)  # afterwards it is free again


def test_an_interrupted_step_is_finished_first():
    answers = [KeyboardInterrupt(), False, True]

    def work(tickets: np.ndarray, helper: int) -> bool:
        if helper >= 0:
            return True
        answer = answers.pop(0)
        if isinstance(answer, KeyboardInterrupt):
            raise answer
        return answer

    with pytest.raises(KeyboardInterrupt):
        Crew(work, [(), ()], tiles=1).work()
    assert not answers
