"""Draw the pictures and animations of the README, and every environment in every look.

    make gallery
    python docs/gallery.py --models models

The README's are kept in docs/images; the looks of all environments go to build/gallery. The folder
holds policies that PPO of stable-baselines3 has saved, named after their environments, such as
models/PBDRope-v0.zip; environments without one are filmed with their scripted policy, three links
with the planner.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import pbd_gym  # noqa: F401  (registers the environments)
from pbd_gym.planning import Planner, planner_settings
from pbd_gym.play import load_agent
from pbd_gym.rendering import VideoWriter, Viewpoint, grid

IMAGES = Path(__file__).parent / "images"
LOOKS = Path(__file__).parents[1] / "build/gallery"
IDS = [id for id in gymnasium.registry if id.startswith("PBD")]
SIZES = (256, 512, 1024)
COLORS, THEMES = ("material", "strain"), ("light", "dark")
# Environment, seed, the moments [steps] that the first picture shows.
TASKS = (("PBDRope-v0", 1, (8, 99)), ("PBDPendulum-v0", 0, (60, 499)), ("PBDCloth-v0", 3, (30, 89)))
NEAR = Viewpoint(zoom=1.35)
STRAIN = {"show": (), "color": "strain", "theme": "dark"}
# Name, environment, seed, length [steps], every how many steps a frame, look.
FILMS: tuple[tuple[str, str, int, int, int, dict[str, Any]], ...] = (
    ("rope", "PBDRope-v0", 1, 100, 2, {"show": ("trail",)}),
    ("cloth", "PBDCloth-v0", 3, 90, 2, {"show": (), "camera": NEAR}),
    ("pendulum", "PBDPendulum-v0", 0, 300, 3, {"show": ("trail",)}),
    ("double_pendulum", "PBDDoublePendulum-v0", 0, 300, 3, {"show": ("trail",)}),
    ("triple_pendulum", "PBDTriplePendulum-v0", 0, 300, 3, {"show": ("trail",)}),
    ("strain", "PBDCloth-v0", 5, 90, 2, {**STRAIN, "camera": NEAR}),
)
FILM_SIZE = 272
PLANNED = ("PBDTriplePendulum-v0",)  # its scripted policy fails

Models = dict[str, Path]
Policy = Callable[[Any], np.ndarray]


def main() -> None:
    """Draw everything."""
    arguments = parse_arguments()
    models = find_models(arguments.models)
    print("trained policies: " + (", ".join(models) or "none"))
    IMAGES.mkdir(exist_ok=True)
    draw_tasks(models)
    for name, id, seed, steps, stride, look in FILMS:
        draw_film(IMAGES / f"{name}.gif", id, seed, steps, stride, look, models)
    draw_fan(IMAGES / "chaos.gif")
    draw_thousand(IMAGES / "thousand.png")
    draw_looks()


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--models",
        type=Path,
        metavar="FOLDER",
        help="with trained policies, ID.zip each; only your own, for they are unpickled",
    )
    arguments = parser.parse_args()
    if arguments.models is not None and not arguments.models.is_dir():
        parser.error(f"argument --models: {arguments.models} is no folder")
    return arguments


def find_models(folder: Path | None) -> Models:
    """Return the paths of the trained policies in a folder, by environment."""
    if folder is None:
        return {}
    return {id: folder / f"{id}.zip" for id in IDS if (folder / f"{id}.zip").is_file()}


def episode(
    id: str, seed: int, steps: int, models: Models, *, planned: bool = False, **look: Any
) -> Iterator[Any]:
    """Yield an environment at the start of an episode and after each of its steps."""
    policy, options = load_agent(str(models.get(id, "scripted")), "ppo", id)
    env = gymnasium.make(id, render_mode="rgb_array", **look, **options)
    if planned:
        policy = plan_in(env, id)
    observation, _ = env.reset(seed=seed)
    yield env
    for _ in range(steps):
        observation, *_ = env.step(policy(observation))
        yield env


def plan_in(env: gymnasium.Env, id: str) -> Policy:
    """Return a policy that plans from the environment's true state, whatever it observes."""
    planner = Planner(env.get_wrapper_attr("task"), planner_settings(id))
    state = env.get_wrapper_attr("get_state")
    return lambda observation: planner.act(state())[0]


def draw_tasks(models: Models) -> None:
    """Draw tasks.png: a column per environment, time running down."""
    columns = []
    for id, seed, moments in TASKS:
        envs = enumerate(episode(id, seed, max(moments), models, render_size=(304, 304)))
        columns.append([env.render() for moment, env in envs if moment in moments])
    tiles = [column[row] for row in range(len(columns[0])) for column in columns]
    save(IMAGES / "tasks.png", grid(tiles, len(columns)))


def draw_film(
    path: Path,
    id: str,
    seed: int,
    steps: int,
    stride: int,
    look: dict[str, Any],
    models: Models,
) -> None:
    """Film one episode, and let its end stand for a second."""
    planned = id in PLANNED and id not in models
    look = {"render_size": (FILM_SIZE, FILM_SIZE), **look}
    envs = episode(id, seed, steps, models, planned=planned, **look)
    frames = [env.render() for env in envs]
    rate = gymnasium.make(id).metadata["render_fps"] / stride
    with VideoWriter(path, rate) as video:
        for frame in [*frames[::stride], *[frames[-1]] * round(rate)]:
            video.write(frame)


def draw_fan(path: Path, worlds: int = 100, seconds: float = 6.0, stride: int = 3) -> None:
    """Film double pendulums that begin a hundredth of a degree apart, upon each other."""
    env: Any = gymnasium.make_vec(
        "PBDDoublePendulum-v0",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        render_mode="rgb_array",
        render_size=(FILM_SIZE, FILM_SIZE),
        theme="dark",
        show=(),
        damping=0.0,
    )
    first = 2.4 + np.radians(0.01) * np.arange(worlds)
    angles = np.stack([first, np.full(worlds, 2.8)], axis=1)
    env.reset(seed=0, options={"angles": angles, "rates": np.zeros((worlds, 2))})
    stops = np.array([[68, 120, 255], [60, 210, 190], [250, 220, 90], [255, 110, 70]], float)
    place = np.linspace(0.0, len(stops) - 1.0, worlds)
    tints = [np.interp(place, range(len(stops)), channel) for channel in stops.T]
    colours = np.stack(tints, axis=1)
    rate = env.metadata["render_fps"]
    still = np.zeros(env.action_space.shape, dtype=np.float32)
    with VideoWriter(path, rate / stride) as video:
        for step in range(round(seconds * rate)):
            if step % stride == 0:
                video.write(lay_upon_each_other(env.render(), colours))
            env.step(still)
    env.close()


def lay_upon_each_other(frames: tuple[np.ndarray, ...], colours: np.ndarray) -> np.ndarray:
    """Return what frames show before their common background, each in a colour (W, 3)."""
    empty = np.median(frames[:: max(1, len(frames) // 15)], axis=0)
    picture = empty.copy()
    for frame, colour in zip(frames, colours, strict=True):
        shown = np.abs(frame - empty).max(axis=2, keepdims=True) / 160.0
        picture += (colour - picture) * np.clip(shown, 0.0, 0.8)
    return np.rint(picture).astype(np.uint8)


def draw_thousand(path: Path, worlds: int = 1000, columns: int = 40, steps: int = 32) -> None:
    """Draw cloths in a thousand worlds while they are laid down."""
    env: Any = gymnasium.make_vec(
        "PBDCloth-v0",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        render_mode="rgb_array",
        render_size=(48, 48),
        camera=Viewpoint(zoom=1.6),
        show=(),
    )
    scripted = env.unwrapped.task.scripted
    observation, _ = env.reset(seed=0)
    for _ in range(steps):
        observation, *_ = env.step(scripted(observation))
    save(path, grid(env.render(), columns))
    env.close()


def draw_looks() -> None:
    """Draw every environment at every size, in both colour modes, light and dark."""
    LOOKS.mkdir(parents=True, exist_ok=True)
    for size in SIZES:
        for id in IDS:
            tiles = []
            for theme, color in product(THEMES, COLORS):
                look = {"render_size": (size, size), "color": color, "theme": theme}
                *_, env = episode(id, 3, 40, {}, **look)
                tiles.append(env.render())
            save(LOOKS / f"{id}-{size}.png", grid(tiles, 2))


def save(path: Path, picture: np.ndarray) -> None:
    """Write a picture (height, width, 3) of uint8 as PNG."""
    import pygame

    height, width = picture.shape[:2]
    surface = pygame.image.frombuffer(picture.tobytes(), (width, height), "RGB")
    pygame.image.save(surface, str(path))


if __name__ == "__main__":
    main()
