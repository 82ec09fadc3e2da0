"""What an import loads, and how soon the first step comes."""

import subprocess
import sys
from pathlib import Path

import pytest

import pbd_gym
from episodes import VARIANTS

HEAVY = ("numba", "pygame", "torch", "stable_baselines3", "matplotlib", "imageio_ffmpeg")
# Seconds that a user waits from `python` to the first step, with kernels in the cache.
PROMISE = 2.0


def python(code):
    """Words that a fresh process prints, in which every warning is an error."""
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


def loaded(code, names=HEAVY):
    """Which of the packages a fresh process has loaded after the code."""
    return python(f"{code}\nimport sys\nprint(*(n for n in {names!r} if n in sys.modules))")


def test_importing_the_package_loads_nothing_heavy():
    assert loaded("import pbd_gym") == []


@pytest.mark.parametrize("id", VARIANTS)
def test_an_environment_that_is_not_drawn_loads_no_pygame_nor_torch(id):
    code = f"import gymnasium\nenv = gymnasium.make('pbd_gym:{id}')\nenv.reset()"
    assert loaded(code) == ["numba"]


def test_the_physics_itself_imports_neither_gymnasium_nor_pygame():
    # The package's __init__ registers ids with Gymnasium; an empty one stands in for it.
    folder = str(Path(pbd_gym.__file__).parent)
    code = (
        "import sys, types\n"
        "sys.modules['pbd_gym'] = package = types.ModuleType('pbd_gym')\n"
        f"package.__path__ = [{folder!r}]\n"
        "from pbd_gym.physics import ModelBuilder, World, shapes\n"
        "builder = ModelBuilder(2)\n"
        "shapes.rope(builder, (0.0, 0.0), (0.0, -1.0), 4, mass=1.0)\n"
        "World(builder.build())"
    )
    assert loaded(code, ("gymnasium", "pygame")) == []


def test_registering_twice_is_silent():
    code = (
        "import importlib, pbd_gym, gymnasium\n"
        "before = dict(gymnasium.registry)\n"
        "importlib.reload(pbd_gym)\n"
        "gymnasium.register_envs(pbd_gym)\n"
        "gymnasium.make('pbd_gym:PBDRope-v0')\n"
        "assert gymnasium.registry == before"
    )
    assert python(code) == []


@pytest.mark.parametrize("id", VARIANTS)
def test_the_first_step_comes_soon_in_a_fresh_process(id):
    code = (
        "import time\n"
        "import gymnasium\n"
        f"env = gymnasium.make('pbd_gym:{id}')\n"
        "env.reset(seed=0)\n"
        "env.step(env.action_space.sample())\n"
        "print(time.process_time())"
    )
    best = float("inf")
    # the processor time of the whole process, so that whatever else the machine does matters
    # little; the first try may fill the caches
    for _ in range(3):
        result = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        best = min(best, float(result.stdout))
        if best < PROMISE:
            break
    assert best < PROMISE
