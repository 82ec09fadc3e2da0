"""Scenes as JSON: a drawing, and where its particles are now."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pbd_gym.playground.drawing import (
    Balls,
    Drawing,
    Fabric,
    Obstacle,
    Outline,
    Particle,
    Settings,
    Skin,
    Strut,
    Thread,
)

_FORMAT = "pbd_gym playground 1"
_PARTS: dict[str, type] = {
    "particles": Particle,
    "threads": Thread,
    "struts": Strut,
    "outlines": Outline,
    "skins": Skin,
    "fabrics": Fabric,
    "balls": Balls,
    "obstacles": Obstacle,
}


class Scene(NamedTuple):
    """A drawing and the state from which it goes on: positions [m], velocities [m/s], (N, dim)."""

    drawing: Drawing
    x: np.ndarray
    v: np.ndarray


def at_rest(drawing: Drawing) -> Scene:
    """Return a drawing with its particles where they are drawn, at rest."""
    x = np.array([particle.position for particle in drawing.particles], dtype=np.float64)
    return Scene(drawing, x, np.zeros_like(x))


def save_scene(path: str | os.PathLike[str], scene: Scene) -> None:
    """Write a scene to a JSON file; an existing one is replaced only when all is written."""
    target = Path(path)
    content = {
        "format": _FORMAT,
        "drawing": asdict(scene.drawing),
        "x": scene.x.tolist(),
        "v": scene.v.tolist(),
    }
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        partial.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Read what `save_scene` wrote.

    Raises:
        OSError: If the file cannot be read.
        ValueError: Naming the file and what is wrong in it.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            raise ValueError(f"it is not marked as {_FORMAT!r}")
        drawing = _drawing(content.get("drawing"))
        shape = (len(drawing.particles), drawing.dim)
        return Scene(drawing, *(_state(content, name, shape) for name in ("x", "v")))
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} is no scene: {error}") from error


def _drawing(content: Any) -> Drawing:
    values = _known(Drawing, content)
    for name, kind in _PARTS.items():
        rows = values.get(name, [])
        if not isinstance(rows, list):
            raise ValueError(f"{name} is {rows!r}; expected a list")
        values[name] = tuple(kind(**_known(kind, row)) for row in rows)
    if "settings" in values:
        values["settings"] = Settings(**_known(Settings, values["settings"]))
    values["view"] = _as_tuples(values.get("view"))
    return Drawing(**values)


def _known(kind: type, content: Any) -> dict[str, Any]:
    """Return the fields of a part, lists as tuples; refuse what it has not."""
    if not isinstance(content, dict):
        raise ValueError(f"{kind.__name__.lower()} is {content!r}; expected its fields by name")
    names = {spec.name for spec in fields(kind)}
    for name in content:
        if name not in names:
            allowed = ", ".join(sorted(names))
            raise ValueError(f"{kind.__name__.lower()} has no {name!r}; allowed: {allowed}")
    if kind is Drawing:
        return dict(content)
    return {name: _as_tuples(value) for name, value in content.items()}


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def _state(content: dict[str, Any], name: str, shape: tuple[int, int]) -> np.ndarray:
    array = np.array(content.get(name), dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{name} has shape {array.shape}; expected finite numbers {shape}")
    return array
