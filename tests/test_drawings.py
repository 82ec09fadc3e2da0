import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from drawings import hanging_rope
from pbd_gym.physics import ModelBuilder
from pbd_gym.playground.__main__ import main
from pbd_gym.playground.building import build_model
from pbd_gym.playground.drawing import Settings
from pbd_gym.playground.files import load_scene, save_scene
from pbd_gym.playground.scenes import SCENES
from pbd_gym.playground.simulation import begin


@pytest.mark.parametrize("name", [name for name in SCENES if SCENES[name]().dim == 2])
def test_every_flat_scene_stays_finite_and_in_view(name):
    drawing = SCENES[name]()
    one = replace(drawing, settings=replace(drawing.settings, integrator="pbd"))
    simulation = begin(one)
    for _ in range(60):
        simulation.step()
    x = simulation.worlds["pbd"].x[0]
    lower, upper = np.array(drawing.view)
    assert (x > lower - 0.2).all()
    assert (x < upper + 0.2).all()


def test_files_that_are_no_scenes_are_refused_by_name(tmp_path):
    path = tmp_path / "scene.json"
    save_scene(path, hanging_rope())
    good = json.loads(path.read_text())
    spoilt = {
        "not marked": {"x": []},
        "does not exist": {"threads": [{"particles": [0, 99], "rest": [1.0]}]},
        "gravity is": {"settings": {"gravity": 1e9}},
        "has no 'colour'": {"colour": "red"},
        "expected a list": {"particles": 3},
        "coordinates": {"particles": [{"position": [0.0, 0.0, 0.0]}]},
    }
    for words, change in spoilt.items():
        content = change if words == "not marked" else {**good, "drawing": good["drawing"] | change}
        path.write_text(json.dumps(content))
        with pytest.raises(ValueError, match=words) as caught:
            load_scene(path)
        assert str(path) in str(caught.value)
    path.write_text("{")
    with pytest.raises(ValueError, match="no scene"):
        load_scene(path)


def test_a_missing_library_is_named_with_the_command_that_installs_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygame_gui", None)
    assert main(["Rope"]) == 1
    assert 'pip install "pbd-gym[playground]"' in capsys.readouterr().err


def test_an_unknown_scene_is_refused_by_name(capsys, tmp_path):
    for name in ("Trampoline", str(tmp_path / "nowhere.json")):
        with pytest.raises(SystemExit):
            main([name])
        assert name in capsys.readouterr().err


def test_kinds_that_a_model_has_not_change_nothing_but_what_is_compiled():
    model = build_model(hanging_rope().drawing, "pbd")
    assert model.volumes is not None
    assert len(model.volumes.rest) == 0
    assert model.colliders is not None
    assert model.encounters is not None
    builder = ModelBuilder(2)
    builder.add_particles((0.0, 0.0), 1.0)
    assert builder.build().volumes is None
    with pytest.raises(ValueError, match="kind 'liquids' is unknown"):
        builder.build(kinds=["liquids"])


def test_settings_out_of_range_are_refused():
    for change in (
        {"gravity": -1.0},
        {"substeps": 2.5},
        {"integrator": "euler"},
        {"damping": True},
    ):
        with pytest.raises(ValueError, match=next(iter(change))):
            Settings(**change)
