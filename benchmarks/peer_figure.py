"""The comparison with peers as bars."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

_COLOURS = {"pbd_gym": "#d55e00"}
_OTHERS = "#8aa6b8"


def draw_figure(rows: Sequence[Any], path: Path) -> bool:
    """Draw speeds scene by scene on one logarithmic axis; return whether matplotlib is there."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    scenes = list(dict.fromkeys(row.scene for row in rows))
    lines, labels, headings = [], [], []
    for scene in scenes:
        headings.append((len(lines), scene))
        lines.append(None)
        labels.append(scene)
        for row in (row for row in rows if row.scene == scene):
            lines.append(row)
            threads = f", {row.threads} threads" if row.threads > 1 else ""
            labels.append(f"{row.engine}: {row.setting}{threads}")
    figure, axes = plt.subplots(figsize=(9.0, 0.24 * len(lines) + 0.8), layout="constrained")
    for place, row in enumerate(lines):
        if row is None:
            continue
        spread = [[row.median - row.least], [row.greatest - row.median]]
        colour = _COLOURS.get(row.engine, _OTHERS)
        axes.barh(place, row.median, color=colour, xerr=spread, error_kw={"lw": 0.8})
    axes.set_xscale("log")
    axes.set_yticks(range(len(lines)), labels, fontsize=8)
    for place, _ in headings:
        axes.get_yticklabels()[place].set_fontweight("bold")
    axes.set_ylim(len(lines) - 0.4, -0.6)
    axes.set_xlabel("control steps per second, all worlds together")
    axes.grid(axis="x", which="major", alpha=0.3)
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return True
