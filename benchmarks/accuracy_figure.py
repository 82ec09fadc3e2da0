"""The figure of error against cost, one panel per scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

_STYLES = {
    "pbd_gym pbd float32": ("#56b4e9", "o"),
    "pbd_gym rattle float32": ("#0072b2", "o"),
    "pbd_gym rattle float64": ("#000000", "o"),
    "MuJoCo": ("#d55e00", "s"),
    "pyPBD": ("#009e73", "^"),
    "pymunk": ("#cc79a7", "v"),
}


def draw_figure(rows: Sequence[Any], path: Path) -> None:
    """Draw every setting as a point, and a line through those that nothing cheaper beats."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    scenes = list(dict.fromkeys(row.scene for row in rows))
    columns = min(len(scenes), 2)
    lines = -(-len(scenes) // columns)
    size = (4.6 * columns, 3.6 * lines)
    figure, panels = plt.subplots(lines, columns, figsize=size, layout="constrained", squeeze=False)
    for scene, axes in zip(scenes, panels.ravel(), strict=False):
        own = [row for row in rows if row.scene == scene and np.isfinite(row.error)]
        for engine in dict.fromkeys(row.engine for row in own):
            _draw_engine(axes, [row for row in own if row.engine == engine], engine)
        cloth = "cloth" in scene
        axes.set(
            title=scene,
            xscale="log",
            yscale="log",
            xlabel="cost of 1/60 s of one world [µs of one core]",
            ylabel="worst stretch of a link" if cloth else "RMS error of the last point [m]",
        )
        axes.grid(which="major", alpha=0.3)
    for axes in panels.ravel()[len(scenes) :]:
        axes.axis("off")
    handles = {}
    for axes in panels.ravel():
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(), handles.keys(), loc="outside lower center", ncols=3, frameon=False
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_engine(axes: Any, rows: Sequence[Any], engine: str) -> None:
    colour, marker = _STYLES[engine]
    ordered = sorted(rows, key=lambda row: row.microseconds)
    cost = [row.microseconds for row in ordered]
    errors = [min(row.error, 1.0) for row in ordered]
    best = np.minimum.accumulate(errors)
    axes.step(cost, best, where="post", color=colour, alpha=0.6)
    axes.plot(cost, errors, marker, color=colour, markersize=4, label=engine)
