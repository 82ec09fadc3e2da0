"""The results of the throughput benchmark as text and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

_COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7")


def markdown(rows: Sequence[Any], machine: str) -> str:
    """Return the results as markdown: complete steps, their share of the kernel, start-up."""
    parts = [
        f"Measured on {machine}.",
        "Complete control steps per second, all worlds together, median over the rounds "
        f"({_spread(rows)}):",
        _table(rows, ("make", "make_vec"), lambda row: _si(row.median)),
        "The bare kernel (`World.step`), and in brackets the speed of the complete step "
        "as a share of it:",
        _table(rows, ("kernel",), lambda row: f"{_si(row.median)} ({_share(row, rows)})"),
    ]
    starts = _starts(rows)
    if starts:
        parts += ["Seconds from the start of Python to the end of the first step:", starts]
    return "\n\n".join(parts) + "\n"


def _spread(rows: Sequence[Any]) -> str:
    """Say how far the slowest and fastest round were from the median."""
    complete = [row for row in rows if row.measure in ("make", "make_vec")]
    spreads = sorted(
        max(row.greatest - row.median, row.median - row.least) / row.median for row in complete
    )
    middle, worst = spreads[len(spreads) // 2], spreads[-1]
    return (
        f"single rounds differ from it by {middle:.0%} in a typical case, {worst:.0%} in the worst"
    )


def _si(value: float) -> str:
    """Return a speed to two or three digits, as 31 k or 1.24 M."""
    for limit, divisor, unit in ((1e6, 1e6, " M"), (1e3, 1e3, " k")):
        if value >= limit:
            scaled = value / divisor
            return f"{scaled:.{2 if scaled < 10 else 1 if scaled < 100 else 0}f}{unit}"
    return f"{value:.0f}"


def _share(kernel: Any, rows: Sequence[Any]) -> str:
    """Return the speed of the complete step as a share of the kernel's."""
    for row in rows:
        if row.measure == "make_vec" and (row.id, *row[2:4]) == (kernel.id, *kernel[2:4]):
            return f"{row.median / kernel.median:.0%}"
    return "-"


def _table(rows: Sequence[Any], measures: Sequence[str], cell: Any) -> str:
    """Return one line per environment and one column per (measure, worlds, threads)."""
    chosen = [row for row in rows if row.measure in measures]
    columns = sorted(
        {(row.measure, row.worlds, row.threads) for row in chosen},
        key=lambda column: (column[0] != "make", *column[1:]),
    )
    cells = {(row.id, *row[1:4]): cell(row) for row in chosen}
    head = ["environment"] + [_heading(*column) for column in columns]
    lines = [head, ["---", *["---:"] * len(columns)]]
    for id in dict.fromkeys(row.id for row in chosen):
        line = [cells[(id, *column)] for column in columns]
        lines += [[f"`{id}`", *line]]
    return _lines(lines)


def _heading(measure: str, worlds: int, threads: int) -> str:
    if measure == "make":
        return "`make`"
    return f"{worlds} {'world' if worlds == 1 else 'worlds'}, {threads} thr."


def _starts(rows: Sequence[Any]) -> str:
    """Return the start-up times, one line per environment and number of worlds."""
    seconds = {row[:3]: row.median for row in rows if row.measure in ("cold", "warm")}
    if not seconds:
        return ""
    lines = [["environment", "worlds", "empty cache", "warm cache"], ["---", *["---:"] * 3]]
    for id, worlds in dict.fromkeys((key[0], key[2]) for key in seconds):
        cold, warm = (seconds[id, measure, worlds] for measure in ("cold", "warm"))
        lines.append([f"`{id}`", str(worlds), f"{cold:.1f}", f"{warm:.2f}"])
    return _lines(lines)


def _lines(cells: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def draw_figure(rows: Sequence[Any], path: Path) -> bool:
    """Draw speed over worlds, complete step and kernel; return whether matplotlib is there."""
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    threads = max(row.threads for row in rows)
    for id, colour in zip(dict.fromkeys(row.id for row in rows), _COLOURS, strict=False):
        for measure, style in (("make_vec", "-o"), ("kernel", ":")):
            chosen = [row for row in rows if (row.id, row.measure) == (id, measure)]
            line = [row for row in chosen if row.threads == min(threads, row.worlds)]
            label = id if measure == "make_vec" else None
            worlds, speeds = [row.worlds for row in line], [row.median for row in line]
            axes.loglog(worlds, speeds, style, color=colour, label=label, markersize=4)
    axes.set_xlabel("worlds")
    axes.set_ylabel("control steps per second")
    axes.set_title(f"Complete step (solid) and bare kernel (dotted), {threads} threads", size=10)
    axes.grid(which="major", alpha=0.3)
    axes.legend(fontsize=8, frameon=False)
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return True
