"""Learning curves: rows of a CSV file, and a plot of them."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats


def log_row(path: str | Path, **values: float) -> None:
    """Append a row of named columns, the same each time, to a CSV file, and print it."""
    cells = {
        name: f"{value:.6g}" if value % 1 else f"{value:.0f}" for name, value in values.items()
    }
    with Path(path).open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        if not file.tell():
            writer.writerow(cells)
        writer.writerow(cells.values())
    print(", ".join(f"{name} {cell}" for name, cell in cells.items()), end="   \r", flush=True)


def plot_curve(
    *paths: str | Path, steps: str = "steps", columns: Sequence[str] = ("found",)
) -> None:
    """Plot columns of CSV files over the training steps, as a PNG beside the first file.

    Thin lines show the rows, bold ones their moving means.

    Args:
        paths: the files; several are the parts of one training that was resumed.
        steps: the column on the horizontal axis.
        columns: the columns to plot, one panel each; empty cells are left out.

    Raises:
        ImportError: Matplotlib, of the extra "evaluation", is not installed.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter

    figure = Figure(figsize=(6.4, 2.8 * len(columns)), layout="constrained")
    panels = figure.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    for path in paths:
        values = read_columns(path)
        for panel, name in zip(panels, columns, strict=True):
            known = ~np.isnan(values[name])
            x, y = values[steps][known], values[name][known]
            panel.plot(x, y, "C0", alpha=0.25, linewidth=0.8)
            panel.plot(x, moving_mean(y), "C0", marker="." if len(x) < 10 else "")
            panel.set_ylabel(name)
            panel.grid(alpha=0.4)
    panels[-1].set_xlabel(steps)
    panels[-1].xaxis.set_major_formatter(EngFormatter(sep=""))
    figure.savefig(Path(paths[0]).with_suffix(".png"), dpi=150)


def read_columns(path: str | Path) -> dict[str, Floats]:
    """The columns of a CSV file by name: float64, NaN for empty cells."""
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="", ndmin=1)
    return {name: table[name] for name in table.dtype.names or ()}


def moving_mean(values: Floats) -> Floats:
    """The mean over a trailing window, one twentieth of all values wide: shape (n,)."""
    width, n = max(1, math.ceil(len(values) / 20)), len(values)
    sums: Floats = np.convolve(values, np.ones(width))[:n]
    return sums / np.minimum(np.arange(1, n + 1), width)
