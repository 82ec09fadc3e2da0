"""The comparison with peers: equal scenes, what is left out, and that it measures what it says."""

import csv
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import pytest

pytest.importorskip("scipy")
sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import peers
from accuracy_scenes import FRAME
from driven_tasks import FRAMES, DrivenCloth, DrivenRope
from motions import Contender, Motion, frame
from peer_bodies import ROPE, actions_along, single_ropes


def test_a_quick_run_prints_a_table_and_writes_all_files(tmp_path, capsys):
    assert peers.main(["--quick", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert (tmp_path / "peers.md").read_text(encoding="utf-8") in printed
    assert (tmp_path / "peers.png").stat().st_size > 0
    with open(tmp_path / "peers.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {"pbd_gym", "gymnasium"} <= {row["engine"] for row in rows}
    assert all(0.0 < float(row["least"]) <= float(row["median"]) for row in rows)


def test_a_package_that_is_missing_is_left_out_and_named(monkeypatch, capsys):
    monkeypatch.setitem(peers._MODULES, "EnvPool", ("no_such_module",))
    contenders = [Contender(name, "", 1, 1, Motion) for name in ("pbd_gym", "EnvPool")]
    assert peers.installed(contenders) == contenders[:1]
    assert capsys.readouterr().err == "EnvPool is left out: pip install envpool\n"


def test_speed_strain_and_error_are_those_of_the_scene():
    # a rope that is moved as a whole, a hundredth too long
    def prepare(worlds):
        places = ROPE.start * 1.01
        return Motion(lambda k: time.sleep(0.01), lambda: places)

    contender = Contender("pbd_gym", "stiff", 5, 1, prepare)
    (row,) = peers.measure("rope", [contender], 1, 0.05)
    assert row.strain == pytest.approx(0.01)
    assert row.error == pytest.approx(ROPE.error(np.tile(ROPE.start[-1] * 1.01, (60, 1))))
    # 10 ms asleep per step: no machine does more than 100 steps a second, a busy one does fewer
    assert 0.2 * 500 < row.median <= 500


def test_the_driven_rope_of_the_environment_moves_as_exactly_as_the_peers_are_asked_to():
    (ours,) = (one for one in single_ropes() if one.engine == "pbd_gym")
    strain, error = peers.quality("one rope", ours.prepare(1))
    assert strain < 1e-3
    assert error < 0.06  # of a rope of 1 m, within the first second


@pytest.mark.parametrize("task", [DrivenRope(), DrivenCloth(particles=4)], ids=["rope", "cloth"])
def test_actions_take_the_pins_along_the_path_of_the_scene(task):
    # what a speed in float32 times a step of 1/60 s leaves out, over 4 s
    pins, targets = task.scene.model.pins, task.scene.targets
    start = task.lowest_start
    x, v = start.x.copy(), start.v.copy()
    begin = x[0, pins[0]] - targets(0.0)[0]
    for k, action in enumerate(actions_along(task)):
        places, _ = task.pin_targets(x, v, action[None])
        v[0, pins] = (places[0] - x[0, pins]) / FRAME
        x[0, pins] = places[0]
        np.testing.assert_allclose(places[0] - begin, targets((k + 1) * FRAME), atol=1e-4)


def test_the_last_second_of_a_path_repeats():
    assert [frame(k) for k in (0, FRAMES - 1)] == [0, FRAMES - 1]
    assert [frame(FRAMES + k) for k in (0, 59, 60)] == [FRAMES - 60, FRAMES - 1, FRAMES - 60]


def test_driven_environments_are_made_through_gymnasium():
    env = gymnasium.make_vec(
        "PBDRope-v0", num_envs=2, vectorization_mode="vector_entry_point", task=DrivenRope
    )
    observation, _ = env.reset(seed=0)
    assert np.array_equal(observation[0, :-2], observation[1, :-2])  # but for the goal
