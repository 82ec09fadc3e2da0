"""Compiled kernels on disk, seen from fresh processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import pbd_gym
from pbd_gym.physics.compiling import load_kernels

FALL = """
from scenes import particles_2d
from pbd_gym.physics import World
state = World(particles_2d((0.0, 0.0)))
state.step(0.1, 1)
print(state.x[0, 0, 1])
"""
FALLEN = "-0.0981"  # g h^2
PLACES = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "TMPDIR")


def python(code, **environment):
    """Run code in a process of its own and return what it printed, by stream."""
    folders = [Path(__file__).parent, Path(pbd_gym.__file__).parents[1]]
    path = os.pathsep.join(map(str, folders))
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.strip(), result.stderr.splitlines()


def test_the_first_process_announces_its_compilation_and_the_second_is_silent(tmp_path):
    places = {name: str(tmp_path) for name in PLACES}
    fallen, said = python(FALL, **places)
    assert float(fallen) == pytest.approx(float(FALLEN), rel=1e-6)  # float32
    assert len(said) == 1
    assert "compiling kernels (2D, pbd, 1 lanes, float32)" in said[0]
    assert f"kept in {tmp_path}" in said[0]
    assert python(FALL, **places) == (fallen, [])


def test_kernels_work_where_no_cache_folder_can_be_written(tmp_path):
    file = tmp_path / "file"
    file.write_text("no folder can be made below a file")
    places = {name: str(file / name) for name in PLACES}
    # tempfile would go on from TMPDIR to /tmp
    nowhere = f"import tempfile; tempfile.tempdir = {places['TMPDIR']!r}"
    fallen, said = python(nowhere + FALL, **places)
    assert float(fallen) == pytest.approx(float(FALLEN), rel=1e-6)  # float32
    assert len(said) == 1
    assert "not kept: no cache folder can be written" in said[0]
    assert file.read_text() == "no folder can be made below a file"


def test_the_next_best_folder_is_taken_where_the_first_cannot_be_written(tmp_path):
    file = tmp_path / "file"
    file.touch()
    code = "from pbd_gym.physics.compiling import cache_folder; print(cache_folder())"
    below = str(file / "x")
    folder, _ = python(code, NUMBA_CACHE_DIR=below, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert Path(folder).parent == tmp_path / "cache" / "pbd_gym"
    places = {"NUMBA_CACHE_DIR": below, "XDG_CACHE_HOME": below, "TMPDIR": str(tmp_path)}
    folder, _ = python(code, **places)
    assert Path(folder).parents[1] == tmp_path


def test_the_folder_is_another_for_another_processor(tmp_path):
    code = "from pbd_gym.physics.compiling import cache_folder; print(cache_folder().name)"
    place = {"NUMBA_CACHE_DIR": str(tmp_path)}
    host, _ = python(code, **place)
    generic, _ = python(code, **place, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    assert host != generic
    assert host == python(code, **place)[0]


def test_python_is_refused_what_only_kernels_may_call():
    with pytest.raises(TypeError, match="limit_moves is called by kernels only"):
        load_kernels(2, 1).limit_moves()


def test_physics_is_imported_without_a_word():
    assert python("import pbd_gym.physics") == ("", [])
