"""Learning curves: rows of a CSV file, and a plot of them."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import import_matplotlib
from DroneSwarmSearch._internal.text import without_formulas
from DroneSwarmSearch.evaluation.results import Evaluation


def log_row(path: str | Path, **values: float) -> None:
    """Append a row of named columns, the same each time, to a CSV file, and print it.

    On a terminal, it takes the place of the last one.
    """
    cells = {
        name: f"{value:.6g}" if value % 1 else f"{value:.0f}" for name, value in values.items()
    }
    with Path(path).open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        if not file.tell():
            writer.writerow(cells)
        writer.writerow(cells.values())
    row = ", ".join(f"{name} {cell}" for name, cell in cells.items())
    in_place = sys.stdout is not None and sys.stdout.isatty()
    print(row, end="   \r" if in_place else "\n", flush=True)


def plot_curve(
    *paths: str | Path,
    steps: str = "steps",
    columns: Sequence[str] = ("found",),
    baselines: Sequence[Evaluation] = (),
    title: str = "",
) -> None:
    """Plot the success in CSV files over the training steps, as curve.png beside the first file.

    Thin lines show the rows, bold ones their moving means, and dashed ones the baselines.

    Args:
        paths: the files; several are the parts of one training that was resumed.
        steps: the column on the horizontal axis.
        columns: the columns to plot, probabilities of success; empty cells are left out.
        baselines: evaluations of other policies, of which the mean success per policy is shown.
        title: above the plot, such as the searches that it is about.

    Raises:
        ImportError: Matplotlib, of the extra "evaluation", is not installed.
    """
    import_matplotlib("the curve needs the package matplotlib", "evaluation")
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, PercentFormatter

    figure = Figure(figsize=(7.6, 3.6), layout="constrained")
    axes = figure.subplots()
    for path in paths:
        values = read_columns(path)
        for number, name in enumerate(columns):
            known = ~np.isnan(values[name])
            label = _tidy(name) if path == paths[0] else None
            x = values[steps][known]
            y = values[name][known]
            colour = f"C{number}"
            axes.plot(x, y, colour, alpha=0.25, linewidth=0.8)
            marker = "o" if len(x) < 30 else ""
            axes.plot(x, moving_mean(y), colour, marker=marker, ms=4, label=label)
    axes.plot([], [], color="0.5", alpha=0.5, linewidth=0.8, label="single rows")
    levels: dict[str, list[float]] = {}
    for baseline in baselines:
        levels.setdefault(baseline.policy, []).append(baseline.success.value)
    for number, (name, found) in enumerate(levels.items()):
        colour = f"C{len(columns) + number}"
        label = f"{without_formulas(name)} {fmean(found):.1%}"
        dashes = (3 * number, (3, 3 * len(levels) - 3))  # those of equal baselines take turns
        axes.axhline(fmean(found), color=colour, linestyle=dashes, label=label)
    axes.set(xlabel=_tidy(steps), ylabel="success", title=without_formulas(title))
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.4)
    figure.legend(loc="outside right upper", frameon=False, handlelength=3)
    figure.savefig(Path(paths[0]).with_name("curve.png"), dpi=150)


def _tidy(column: str) -> str:
    """The name of a column as a label: "time/total_timesteps" is "total timesteps"."""
    return without_formulas(column.rpartition("/")[2].replace("_", " "))


def read_columns(path: str | Path) -> dict[str, Floats]:
    """The columns of a CSV file by name: float64, NaN for empty cells."""
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars="", ndmin=1)
    return {name: table[name] for name in table.dtype.names or ()}


def moving_mean(values: Floats) -> Floats:
    """The mean over a trailing window, one twentieth of all values wide: shape (n,)."""
    width = max(1, math.ceil(len(values) / 20))
    n = len(values)
    sums: Floats = np.convolve(values, np.ones(width))[:n]
    return sums / np.minimum(np.arange(1, n + 1), width)
