"""What both faces are made and reset with."""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

from pbd_gym.tasks import Task


def make_task(task: str | type[Task], arguments: dict[str, Any]) -> Task:
    """Return the task of a class or of its place, "module:Class", configured by keywords.

    Raises:
        TypeError: For a keyword that the task does not know, or a value of another kind.
        ValueError: For a value out of range, or a place that holds no task.
    """
    kind: Any = task
    if isinstance(task, str):
        module, _, name = task.partition(":")
        kind = getattr(importlib.import_module(module), name, None)
    if not (isinstance(kind, type) and issubclass(kind, Task)):
        raise ValueError(f"task is {task!r}; expected a Task class or its place 'module:Class'")
    known = [spec.name for spec in dataclasses.fields(kind)]
    for name in arguments:
        if name not in known:
            raise TypeError(f"{kind.__name__} has no keyword {name!r}; allowed: {', '.join(known)}")
    return kind(**arguments)


def as_dict(options: dict[str, Any] | None) -> dict[str, Any]:
    """Return a copy of reset options."""
    if options is not None and not isinstance(options, dict):
        raise TypeError(f"options is {options!r}; expected None or a dict")
    return dict(options or {})
