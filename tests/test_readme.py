"""The README tells the truth: its programs run, its commands exist, its tables are of today."""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import gymnasium
import pytest

import pbd_gym  # noqa: F401

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    """Return the README's code blocks in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def commands():
    """Return the lines of the README's shell blocks, without comments."""
    lines = "".join(blocks("bash")).splitlines()
    return [line.split("#")[0].split() for line in lines if line.strip()]


@pytest.mark.parametrize("program", blocks("python"), ids=range(len(blocks("python"))))
def test_every_program_runs(program, tmp_path):
    if "stable_baselines3" in program:
        pytest.importorskip("stable_baselines3")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_ten_lines_are_those_of_the_example():
    example = (ROOT / "examples/quickstart.py").read_text(encoding="utf-8")
    assert blocks("python")[0] in example


@cache
def help_of(script):
    """Return what a script says of its options."""
    done = subprocess.run(
        [sys.executable, ROOT / script, "--help"], capture_output=True, text=True, check=True
    )
    return done.stdout


def test_every_script_and_option_in_a_command_exists():
    for command in commands():
        for script in (word for word in command if word.endswith(".py")):
            options = [word for word in command if word.startswith("--")]
            text = help_of(script)
            assert not [option for option in options if not re.search(rf"{option}\b", text)]


def test_every_make_target_exists():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    named = re.findall(r"\bmake (train|test|lint|bench|help|clean)\b", README)
    assert {"train", "test", "lint", "bench"} <= set(named) <= set(targets)


def test_every_link_to_a_file_or_section_leads_somewhere():
    links = re.findall(r"\]\(([^)]+)\)", README)
    local = [link for link in links if "://" not in link]
    headings = re.findall(r"^#+ (.+)$", README, flags=re.MULTILINE)
    sections = {"#" + heading.lower().replace(" ", "-") for heading in headings}
    assert local
    assert not [link for link in local if link not in sections and not (ROOT / link).exists()]


def described(id):
    """Return the columns of an environment's row that can be read off it."""
    env = gymnasium.make(id)
    task = env.get_wrapper_attr("task")
    few = gymnasium.make(id, observation="keypoints")
    spaces = [one.observation_space for one in (env, few)]
    size, least = (getattr(space, "spaces", {"observation": space}) for space in spaces)
    sizes = [space["observation"].shape[0] for space in (size, least)]
    goals = f", goals {size['desired_goal'].shape[0]}" if "desired_goal" in size else ""
    return [
        f"{task.model.dim}D, {task.model.num_particles} particles",
        str(env.action_space.shape[0]),
        (str(sizes[0]) if sizes[0] == sizes[1] else f"{sizes[0]} ({sizes[1]})") + goals,
        f"{env.spec.max_episode_steps} steps at {task.control_rate:g} Hz",
    ]


@pytest.mark.parametrize("id", [id for id in gymnasium.registry if id.startswith("PBD")])
def test_the_table_of_environments_is_of_today(id):
    row = next(line for line in README.splitlines() if line.startswith(f"| `{id}` |"))
    assert [cell.strip() for cell in row.split("|")][3:7] == described(id)


@pytest.mark.parametrize(
    ("page", "mark", "results"),
    [
        ("README.md", "speed", "throughput.md"),
        ("docs/physics.md", "accuracy", "accuracy.md"),
        ("docs/performance.md", "peers", "peers.md"),
        ("docs/performance.md", "budget", "budget.md"),
        ("docs/performance.md", "roofline", "roofline.md"),
        ("docs/performance.md", "scaling", "scaling.md"),
        ("docs/performance.md", "frames", "sb3_frames.md"),
    ],
)
def test_tables_are_those_of_the_committed_results(page, mark, results):
    text = (ROOT / page).read_text(encoding="utf-8")
    table = re.search(rf"<!-- {mark} -->\n(.*?)\n<!-- /{mark} -->", text, re.DOTALL)
    assert table is not None
    assert table[1].strip() in (ROOT / "benchmarks/results" / results).read_text(encoding="utf-8")
