"""The learning curve of a run: a CSV file, and a plot of it."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.files import write_bytes, write_text

__all__ = ["COLUMNS", "Curve", "moving_mean"]

Floats = NDArray[np.float64]
Row = dict[str, float]

COLUMNS = ("steps", "seconds", "reward", "found")
"""The first columns of every curve; a trainer's own values follow."""

HELD_OUT = "held-out "
"""Begins the names of columns with success rates outside the training."""


class Curve:
    """The rows of a learning curve, mirrored in a CSV file.

    An unknown value is NaN here and an empty cell in the file. An incomplete last line, left
    by a crash, is ignored.

    Args:
        path: the path of the file; the curve is empty if it does not exist.

    Attributes:
        names: the names of the columns, starting with ``COLUMNS``.
        rows: one dict per row, by increasing "steps".

    Raises:
        ValueError: the file is not a learning curve.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.names: list[str] = list(COLUMNS)
        self.rows: list[Row] = []
        if path.exists():
            self._read()

    @property
    def steps(self) -> int:
        """The environment steps of the last row, or 0."""
        return int(self.rows[-1]["steps"]) if self.rows else 0

    @property
    def seconds(self) -> float:
        """The training time at the last row in seconds, or 0."""
        return self.rows[-1]["seconds"] if self.rows else 0.0

    def append(self, row: Mapping[str, float]) -> None:
        """Add a row, and write it to the file; a new name adds a column.

        Raises:
            StorageError: the file cannot be written.
        """
        new = [name for name in row if name not in self.names]
        self.names += new
        self.rows.append({name: float(row.get(name, math.nan)) for name in self.names})
        if new or len(self.rows) == 1:
            self._write()
            return
        with self._path.open("a", encoding="utf-8", newline="") as file:
            file.write(self._line(self.rows[-1]))

    def cut(self, steps: int) -> None:
        """Remove the rows after a number of steps, also from the file, if there is one."""
        self.rows = [row for row in self.rows if row["steps"] <= steps]
        if self._path.exists():
            self._write()  # also removes an incomplete last line

    def column(self, name: str) -> Floats:
        """A column: float64, shape (rows,), NaN where unknown."""
        return np.array([row.get(name, math.nan) for row in self.rows], np.float64)

    def draw(self, path: Path, title: str) -> None:
        """Plot the success rate and the return over environment steps as a PNG.

        The thin line shows the rows, the bold line their moving mean. A third plot shows success
        outside the training, if it is known.

        Raises:
            ImportError: matplotlib is not installed.
            StorageError: the file cannot be written.
        """
        try:
            from matplotlib import style
            from matplotlib.figure import Figure
            from matplotlib.ticker import EngFormatter, PercentFormatter
        except ImportError as error:
            raise ImportError(
                "the plot of the learning curve needs the package matplotlib: "
                'pip install "DroneSwarmSearchEnvironment[evaluation]"',
                name=error.name,
            ) from error
        with style.context("default"):
            held_out = [name for name in self.names if name.startswith(HELD_OUT)]
            count = 3 if held_out else 2
            figure = Figure(figsize=(6.4, 2.5 * count), layout="constrained")
            above, *outside, below = figure.subplots(count, 1, sharex=True)
            steps = self.column("steps")
            marker = "." if len(steps) < 10 else ""
            for axes, name in ((above, "found"), (below, "reward")):
                values = self.column(name)
                known = ~np.isnan(values)
                axes.plot(steps[known], values[known], "C0", alpha=0.25, linewidth=0.8)
                axes.plot(steps, moving_mean(values), "C0", marker=marker)
                axes.grid(alpha=0.4)
            for axes in outside:
                self._draw_held_out(axes, held_out)
                axes.yaxis.set_major_formatter(PercentFormatter(1.0))
            above.set(title=title, ylabel="success rate", ylim=(-0.02, 1.02))
            above.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
            below.set(ylabel="return of a drone", xlabel="environment steps")
            below.xaxis.set_major_formatter(EngFormatter(sep=""))
            if abs(below.get_ylim()[0]) + abs(below.get_ylim()[1]) >= 1000:
                below.yaxis.set_major_formatter(EngFormatter(sep=""))
            figure.align_ylabels()
            pixels = io.BytesIO()
            figure.savefig(pixels, format="png", dpi=150)
        write_bytes(path, pixels.getvalue())

    def _draw_held_out(self, axes: Any, names: list[str]) -> None:
        """Plot success outside the training: of the policy in training, then of baselines."""
        for name in names:
            values = self.column(name)
            known = ~np.isnan(values)
            line = {"marker": "."} if name == names[0] else {"linestyle": "--"}
            label = name.removeprefix(HELD_OUT)
            axes.plot(self.column("steps")[known], values[known], label=label, **line)
        axes.set(ylabel="success rate, held out")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(names), fontsize="small")
        axes.grid(alpha=0.4)

    def _read(self) -> None:
        text = self._path.read_text("utf-8")
        complete = text[: text.rfind("\n") + 1]
        lines = list(csv.reader(io.StringIO(complete)))
        if not lines or tuple(lines[0][: len(COLUMNS)]) != COLUMNS:
            raise ValueError(
                f"{self._path} must be a learning curve with the columns {', '.join(COLUMNS)}, "
                f"got {','.join(lines[0]) if lines else 'nothing'!r}"
            )
        self.names = lines[0]
        for line in lines[1:]:
            values = [float(cell) if cell else math.nan for cell in line]
            self.rows.append(dict(zip(self.names, values, strict=True)))

    def _write(self) -> None:
        lines = [",".join(self.names) + "\n", *map(self._line, self.rows)]
        write_text(self._path, "".join(lines))

    def _line(self, row: Row) -> str:
        return ",".join(_cell(row.get(name, math.nan)) for name in self.names) + "\n"


def moving_mean(values: Floats) -> Floats:
    """The mean over a trailing window, one twentieth of all values wide.

    Args:
        values: shape (n,); NaN values are skipped.

    Returns:
        float64, shape (n,); NaN where the window has no values.
    """
    width = max(1, math.ceil(len(values) / 20))
    known = ~np.isnan(values)
    sums = np.concatenate([np.zeros(1), np.cumsum(np.where(known, values, 0.0))])
    counts = np.concatenate([np.zeros(1), np.cumsum(known)])
    first = np.maximum(np.arange(len(values)) + 1 - width, 0)
    total, count = sums[1:] - sums[first], counts[1:] - counts[first]
    means: Floats = np.full(len(values), math.nan)
    np.divide(total, count, out=means, where=count > 0)
    return means


def _cell(value: float) -> str:
    """A value as text: empty for NaN, integers in full, others with six digits."""
    if math.isnan(value):
        return ""
    return str(int(value)) if value.is_integer() else f"{value:.6g}"
