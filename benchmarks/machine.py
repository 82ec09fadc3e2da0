"""On what the numbers were measured."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path


def describe_machine() -> str:
    """Return processor, cores, load, versions and commit in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "gymnasium"))
    return (
        f"{_processor()}, {_cores()} cores{_load()}, {platform.system()}, "
        f"Python {platform.python_version()}, {packages}, commit {_commit()}"
    )


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _load() -> str:
    """Say how many processes waited for a core over the last minute, where that is known."""
    return f" at load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Return the short hash of the commit, with a plus where the package differs from it."""
    package = Path(__file__).parents[1]
    try:
        words = ("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--", "pbd_gym")
        commit, changes = (
            subprocess.run(
                ["git", "-C", str(package), *arguments], capture_output=True, text=True, check=True
            ).stdout.strip()
            for arguments in words
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{commit}+" if changes else commit
