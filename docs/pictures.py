"""Draw the pictures of the README: python docs/pictures.py."""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np

from pbd_gym.rendering import grid

IMAGES = Path(__file__).parent / "images"
SIZE = 304
# Environment, seed and the moments [steps] that are shown.
SCENES = (
    ("pbd_gym:PBDRope-v0", 1, (8, 99)),
    ("pbd_gym:PBDPendulum-v0", 0, (60, 499)),
    ("pbd_gym:PBDCloth-v0", 3, (30, 89)),
)


def film(id: str, seed: int, moments: tuple[int, ...]) -> list[np.ndarray]:
    """Return frames of the scripted policy's episode at some moments [steps]."""
    env = gymnasium.make(id, render_mode="rgb_array", render_size=(SIZE, SIZE))
    scripted = env.get_wrapper_attr("task").scripted
    observation, _ = env.reset(seed=seed)
    frames = []
    for step in range(max(moments) + 1):
        observation, *_ = env.step(scripted(observation[None])[0])
        if step in moments:
            frames.append(np.asarray(env.render()))
    env.close()
    return frames


def main() -> None:
    """Write docs/images/tasks.png: a column per environment, time running down."""
    import pygame

    columns = [film(*scene) for scene in SCENES]
    frames = [column[row] for row in range(len(columns[0])) for column in columns]
    picture = grid(frames, len(columns))
    IMAGES.mkdir(exist_ok=True)
    surface = pygame.surfarray.make_surface(picture.transpose(1, 0, 2))
    pygame.image.save(surface, str(IMAGES / "tasks.png"))


if __name__ == "__main__":
    main()
