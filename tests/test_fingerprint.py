"""Hashes of fixed trajectories: of this version, and the same however they are computed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import pbd_gym
from episodes import IDS, VARIANTS
from pbd_gym.fingerprint import KINDS, RELEASED, fingerprint, hash_environment, hash_physics, main


@pytest.mark.parametrize("id", IDS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_environment_moves_as_in_this_version(id, kind):
    # Where this fails on purpose, an environment has changed: raise the version in its id.
    assert fingerprint(f"pbd_gym:{id}", kind) == RELEASED[id][kind]


@pytest.mark.parametrize("id", VARIANTS)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_neither_worlds_nor_threads_change_a_bit_of_the_physics(id, dtype):
    many = hash_physics(id, dtype, 1000, num_threads=1)
    assert many[0] == RELEASED[id][dtype]
    assert len(set(many)) == 1000, "worlds move alike"
    for num_worlds, num_threads in ((1, 1), (3, 1), (3, 2), (64, 1), (64, 2), (1000, 2)):
        several = hash_physics(id, dtype, num_worlds, num_threads=num_threads)
        assert several == many[:num_worlds], (num_worlds, num_threads)


@pytest.mark.parametrize("id", IDS)
def test_neither_worlds_nor_threads_change_a_bit_of_an_environment(id):
    several = hash_environment(id, 64, num_threads=2)
    assert several[0] == RELEASED[id]["environment"]
    assert hash_environment(id, 3) == several[:3]


@pytest.mark.parametrize(
    ("processor", "options"),
    [
        # the plainest x86-64, without what came after SSE2
        ("generic", ["--ids", *VARIANTS, "--kinds", "environment"]),
        # AVX2 with fused multiply-add, which would change bits where it was used
        ("haswell", ["--ids", "PBDRope-v0"]),
    ],
)
def test_another_process_for_another_processor_computes_the_same(tmp_path, processor, options):
    # pytest's own process may have been told so; then this would compare nothing
    assert "NUMBA_CPU_NAME" not in os.environ
    result = subprocess.run(
        [sys.executable, "-W", "error", "-m", "pbd_gym.fingerprint", *options],
        env={
            **os.environ,
            "PYTHONPATH": str(Path(pbd_gym.__file__).parents[1]),
            "NUMBA_CACHE_DIR": str(tmp_path),
            "NUMBA_CPU_NAME": processor,
            "NUMBA_CPU_FEATURES": "",
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert f"compiled for {processor}" in result.stdout
    assert any(tmp_path.rglob("*.nbi")), "nothing was compiled for the other processor"


def test_a_trajectory_that_differs_is_told(monkeypatch, capsys):
    monkeypatch.setitem(RELEASED["PBDRope-v0"], "environment", "0" * 16)
    assert main(["--ids", "PBDRope-v0", "--kinds", "environment"]) == 1
    assert f"differs: {'0' * 16} in this version" in capsys.readouterr().out
    with pytest.raises(ValueError, match="float16"):
        fingerprint("PBDRope-v0", "float16")
