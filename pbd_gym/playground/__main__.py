"""Start the program: `python -m pbd_gym.playground`."""

from __future__ import annotations

import argparse
import sys

from pbd_gym.playground.files import Scene, at_rest, load_scene
from pbd_gym.playground.scenes import SCENES


def main(arguments: list[str] | None = None) -> int:
    """Open the window and return when it is closed."""
    parser = argparse.ArgumentParser(
        prog="python -m pbd_gym.playground",
        description="Drag, pin, cut and draw ropes, cloths and soft bodies.",
    )
    names = ", ".join(SCENES)
    parser.add_argument(
        "scene", nargs="?", default="Rope", help=f"a saved scene (.json), or one of: {names}"
    )
    options = parser.parse_args(arguments)
    try:
        scene = _scene(options.scene)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    try:
        import pygame_gui  # noqa: F401  (asks before a window opens whether it is there)
    except ImportError:
        print('the playground needs pygame_gui: pip install "pbd-gym[playground]"', file=sys.stderr)
        return 1
    from pbd_gym.playground.app import App

    App(scene).run()
    return 0


def _scene(name: str) -> Scene:
    if name.endswith(".json"):
        return load_scene(name)
    for known, make in SCENES.items():
        if known.lower() == name.lower():
            return at_rest(make())
    raise ValueError(f"scene {name!r} is unknown; allowed: {', '.join(SCENES)}, or a .json file")


if __name__ == "__main__":
    sys.exit(main())
