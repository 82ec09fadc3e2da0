"""Drive an environment by hand: `python -m pbd_gym.play PBDRope-v0`."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from pbd_gym.hyperparams import ALGORITHMS
from pbd_gym.rendering import Renderer
from pbd_gym.rendering.palette import LIGHT, Colour

Action = Callable[[Any], np.ndarray]

KEYS = """arrows   left, right, down, up
PgUp PgDn   away, nearer (in space)
mouse   hold it down: there
tab   which gripper: both, first, second
a   agent on or off (with --policy)
space   pause     r   new episode
h   help on or off     Esc   leave"""

_COLUMN = 300  # width of what is told beside the picture [pixels]
_GAIN = 8.0  # how fast what is held follows the mouse [1/s]
_PAUSE = 2.0  # after the end of an episode [s]


class Play:
    """A window in which the pins of an environment follow mouse and keys.

    Args:
        env_id: Of an environment of this package.
        agent: Function from an observation to an action, that can take over; None for nobody.
        size: Side of the picture [pixels].
        seed: Of the first episode.
        **options: Of the environment, as for `make`.

    Attributes:
        running: Until the user leaves.
        by_agent: Whether the agent acts.
        info: What the last step told.
        total: Sum of the episode's rewards.
        ended: Why the episode has ended, or "".
    """

    def __init__(
        self,
        env_id: str,
        agent: Action | None = None,
        *,
        size: int = 640,
        seed: int = 0,
        **options: Any,
    ) -> None:
        import pygame

        self._pygame = pygame
        pygame.display.init()
        pygame.font.init()
        pygame.display.set_caption(f"pbd_gym {env_id}")
        self._screen = pygame.display.set_mode((size + _COLUMN, size))
        self._clock = pygame.time.Clock()
        look: dict[str, Any] = {"render_mode": "rgb_array", "render_size": (size, size)}
        self._env = gymnasium.make(env_id, **look, **options)
        self._task: Any = self._env.get_wrapper_attr("task")
        view, rails = self._task.view, self._task.rails
        self._seer = Renderer(self._task.model, view, size=(size, size), rails=rails)
        self._size, self._seed, self._agent = size, seed, agent
        self.running, self.paused, self.by_agent = True, False, agent is not None
        self._has_help, self._chosen, self._ticks = True, 0, 0
        self._fonts: dict[int, Any] = {}
        self._held: set[int] = set()  # keys
        self._mouse: tuple[int, int] | None = None  # where it is held down
        # the first step of all may have to compile the kernels
        self._warming = threading.Thread(target=self._warm_up, daemon=True)
        self._warming.start()

    @property
    def is_ready(self) -> bool:
        """Whether the kernels are there."""
        return not self._warming.is_alive()

    def run(self) -> None:
        """Go on until the user leaves."""
        try:
            while self.running:
                self.frame()
                self._clock.tick(self._task.control_rate)
        finally:
            self._env.close()
            self._pygame.display.quit()

    def reset(self, seed: int | None = None) -> None:
        """Begin an episode."""
        self._observation, self.info = self._env.reset(seed=seed)
        self.total, self.steps, self.reward, self.ended = 0.0, 0, 0.0, ""

    def frame(self) -> None:
        """Take in what the user did, act, and draw one picture."""
        for event in self._pygame.event.get():
            self._take(event)
        if not self.running:
            return
        self._ticks += 1
        if not self.is_ready:
            self._screen.fill(LIGHT.paper)
            words = "Preparing the physics, once" + "." * (self._ticks // 10 % 4)
            self._write(words, (self._size // 2 - 100, self._size // 2), 26)
        else:
            if not (self.paused or self.ended):
                self._act()
            elif self.ended and self._ticks > self._resume_at:
                self.reset()
            self._draw()
        self._pygame.display.flip()

    def by_hand(self) -> np.ndarray:
        """Return the action that mouse and keys ask for: the desired velocity of each pin."""
        task = self._task
        pins, axes = task.model.pins, list(task.action_axes)
        chosen = np.arange(len(pins)) if self._chosen == 0 else np.array([self._chosen - 1])
        velocity = np.zeros((len(pins), task.model.dim))
        if self._mouse is None:
            velocity[chosen] = self._keys_direction(task.model.dim)
        else:
            x = self._env.get_wrapper_attr("get_state")().worlds.x[0, pins[chosen]]
            middle = x.mean(axis=0, keepdims=True).astype(np.float64)
            _, depth = self._seer.project(middle)
            target = self._seer.unproject(np.array([self._mouse], dtype=np.float64), depth)
            velocity[chosen] = _GAIN * (target - middle) / task.max_speed
        return np.clip(velocity[:, axes].ravel(), -1.0, 1.0).astype(np.float32)

    def _keys_direction(self, dim: int) -> np.ndarray:
        """Return the direction of the keys that are held; in space, as seen by the camera."""
        key, held = self._pygame, self._held
        across = (key.K_RIGHT in held) - (key.K_LEFT in held)
        up = (key.K_UP in held) - (key.K_DOWN in held)
        away = (key.K_PAGEUP in held) - (key.K_PAGEDOWN in held)
        return np.array([across, up] if dim == 2 else [across, away, up], dtype=np.float64)

    def _act(self) -> None:
        agent = self._agent if self.by_agent else None
        action = self.by_hand() if agent is None else agent(self._observation)
        self._observation, reward, terminated, truncated, self.info = self._env.step(action)
        self.reward = float(reward)
        self.total += self.reward
        self.steps += 1
        if terminated or truncated:
            won = "Success" if self.info["is_success"] else "Time is up"
            self.ended = "The world has diverged" if terminated else won
            self._resume_at = self._ticks + _PAUSE * self._task.control_rate

    def _warm_up(self) -> None:
        self.reset(self._seed)
        self._env.step(np.zeros(self._task.action_space.shape, dtype=np.float32))
        self.reset(self._seed)

    # What the user does.

    def _take(self, event: Any) -> None:
        pygame = self._pygame
        if event.type == pygame.QUIT:
            self.running = False
        elif event.type == pygame.KEYDOWN:
            self._held.add(event.key)
            self._press(event.key)
        elif event.type == pygame.KEYUP:
            self._held.discard(event.key)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == pygame.BUTTON_LEFT:
            self._mouse = event.pos if event.pos[0] < self._size else None
        elif event.type == pygame.MOUSEMOTION and self._mouse is not None:
            self._mouse = event.pos
        elif event.type == pygame.MOUSEBUTTONUP and event.button == pygame.BUTTON_LEFT:
            self._mouse = None

    def _press(self, key: int) -> None:
        pygame = self._pygame
        if key == pygame.K_ESCAPE:
            self.running = False
        elif key == pygame.K_SPACE:
            self.paused = not self.paused
        elif key == pygame.K_r and self.is_ready:
            self.reset()
        elif key == pygame.K_h:
            self._has_help = not self._has_help
        elif key == pygame.K_TAB:
            pins = len(self._task.model.pins)
            self._chosen = (self._chosen + 1) % (pins + 1) if pins > 1 else 0
        elif key == pygame.K_a:
            self.by_agent = self._agent is not None and not self.by_agent

    # What is shown.

    def _draw(self) -> None:
        frame: Any = self._env.render()
        size = (self._size, self._size)
        self._screen.fill(LIGHT.paper)
        self._screen.blit(self._pygame.image.frombuffer(frame.tobytes(), size, "RGB"), (0, 0))
        left, top = self._size + 20, 18
        grippers = ("both grippers", "first gripper", "second gripper")
        several = len(self._task.model.pins) > 1
        who = "agent" if self.by_agent else "you" + f", {grippers[self._chosen]}" * several
        self._write(f"Acting: {who}" + "   (paused)" * self.paused, (left, top), 22)
        self._write(f"Step {self.steps}     return {self.total:.1f}", (left, top + 28), 22)
        self._bar("reward", self.reward, (left, top + 66))
        top += 106
        for name, value in self.info.items():
            if isinstance(value, bool):
                continue
            self._bar(name.replace("_", " "), float(value), (left, top))
            top += 34
        if self.ended or self.info.get("is_success"):
            words = self.ended or "Success"
            colour = LIGHT.body if self.info.get("is_success") else LIGHT.goal_edge
            self._write(words, (left, top + 8), 34, colour)
        if self._has_help:
            for line, words in enumerate(reversed(KEYS.splitlines())):
                self._write(words, (left, self._size - 34 - 22 * line), 20, LIGHT.steel)

    def _bar(self, name: str, value: float, place: tuple[int, int]) -> None:
        """Show a quantity as a number and, as far as it lies in [0, 1], as a bar."""
        draw, width = self._pygame.draw, _COLUMN - 40
        self._write(name, place, 20, LIGHT.steel)
        number = f"{value:.3f}"
        shift = width - self._font(20).size(number)[0]
        self._write(number, (place[0] + shift, place[1]), 20)
        box = (place[0], place[1] + 18, width, 5)
        draw.rect(self._screen, LIGHT.grid, box, border_radius=2)
        filled = round(width * min(max(value, 0.0), 1.0))
        draw.rect(self._screen, LIGHT.body, (*box[:2], filled, 5), border_radius=2)

    def _write(
        self,
        words: str,
        place: tuple[int, int],
        size: int,
        colour: Colour = LIGHT.dark_steel,
    ) -> None:
        self._screen.blit(self._font(size).render(words, True, colour), place)

    def _font(self, size: int) -> Any:
        if size not in self._fonts:
            self._fonts[size] = self._pygame.font.Font(None, size)
        return self._fonts[size]


def load_agent(name: str, algo: str, env_id: str) -> tuple[Action, dict[str, Any]]:
    """Return what acts, and the options of the environment in which it can.

    Args:
        name: "scripted", the task's own policy, or the path of a model of stable-baselines3.
        algo: Of that model, "ppo", "sac" or "crossq".
        env_id: Of the environment.

    Raises:
        FileNotFoundError: If there is no such model.
        ImportError: If stable-baselines3 is not installed.
        ValueError: If the model was trained on another task.
    """
    if name != "scripted":
        from pbd_gym.sb3 import load_policy

        return load_policy(name, algo, env_id)
    scripted = gymnasium.make(env_id).get_wrapper_attr("task").scripted

    def act(observation: Any) -> np.ndarray:
        if isinstance(observation, dict):
            return scripted({name: part[None] for name, part in observation.items()})[0]
        return scripted(observation[None])[0]

    return act, {}


def main(arguments: list[str] | None = None) -> int:
    """Open the window and return when it is closed."""
    import pbd_gym

    known = [name for name in gymnasium.registry if name.startswith("PBD")]
    parser = argparse.ArgumentParser(
        prog="python -m pbd_gym.play",
        description=f"Drive the pins of an environment by hand (pbd_gym {pbd_gym.__version__}).",
        epilog=f"keys:\n{KEYS}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("env", metavar="ENV", help=f"one of {', '.join(known)}")
    parser.add_argument(
        "--policy",
        help="who can take over: scripted, or the path of a model that stable-baselines3 has saved "
        "(load only your own, for it is unpickled)",
    )
    parser.add_argument("--algo", choices=ALGORITHMS, default="ppo", help="of that model")
    parser.add_argument("--size", type=int, default=640, help="side of the picture [pixels]")
    parser.add_argument("--seed", type=int, default=0, help="of the first episode")
    options = parser.parse_args(arguments)
    env_id = options.env.removeprefix("pbd_gym:")
    if env_id not in known:
        parser.error(f"environment {options.env!r} is unknown; allowed: {', '.join(known)}")
    if options.size % 2 or not 400 <= options.size <= 2000:
        parser.error(f"--size is {options.size}; allowed: even numbers from 400 to 2000")
    try:
        agent, fitting = None, {}
        if options.policy:
            agent, fitting = load_agent(options.policy, options.algo, env_id)
    except (OSError, ImportError, ValueError) as error:
        parser.error(str(error))
    Play(env_id, agent, size=options.size, seed=options.seed, **fitting).run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
