"""Learning curves: figures over environment steps, as CSV and as a picture."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.files import write_bytes, write_text

__all__ = ["COLUMNS", "Curve"]

Floats = NDArray[np.float64]
Row = dict[str, float]

COLUMNS = ("steps", "seconds", "reward", "found")
"""The first columns of every curve; a trainer's own figures follow."""

INK, GREY, FAINT, LINE = "#18202c", "#70788a", "#e3e6eb", "#0072b2"


class Curve:
    """The rows of a learning curve, kept in a CSV file to which every new row goes at once.

    A figure that is unknown is NaN here and an empty cell in the file. A last line that a
    crash has cut off is left out.

    Args:
        path: of the file; without one there, the curve is empty.

    Attributes:
        names: of the columns, ``COLUMNS`` first.
        rows: a dict for each row, in rising order of "steps".

    Raises:
        ValueError: the file is no learning curve.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.names: list[str] = list(COLUMNS)
        self.rows: list[Row] = []
        if path.exists():
            self._read()

    @property
    def steps(self) -> int:
        """The environment steps of the last row; 0 without one."""
        return int(self.rows[-1]["steps"]) if self.rows else 0

    @property
    def seconds(self) -> float:
        """The seconds of training up to the last row; 0 without one."""
        return self.rows[-1]["seconds"] if self.rows else 0.0

    def append(self, row: Mapping[str, float]) -> None:
        """Add a row, in the file, too.

        Args:
            row: figures by column; a new column makes the file be written anew.

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
        """Drop the rows beyond some number of steps, from the file, too."""
        self.rows = [row for row in self.rows if row["steps"] <= steps]
        self._write()

    def column(self, name: str) -> Floats:
        """A column: float64, shape (rows,), NaN where a figure is unknown."""
        return np.array([row.get(name, math.nan) for row in self.rows], np.float64)

    def draw(self, path: Path, title: str) -> None:
        """Draw the share found and the return over environment steps, as PNG.

        Pale are the rows, bold is the mean of the last twentieth of them.

        Args:
            path: of the picture; its folder is made if need be.
            title: stands above it.

        Raises:
            ImportError: matplotlib is not installed.
            StorageError: the picture cannot be written.
        """
        try:
            from matplotlib import style
            from matplotlib.figure import Figure
            from matplotlib.ticker import EngFormatter, PercentFormatter
        except ImportError as error:
            raise ImportError(
                "a picture of the curve needs the package matplotlib: "
                'pip install "DroneSwarmSearchEnvironment[evaluation]"',
                name=error.name,
            ) from error
        with style.context(["default", _STYLE]):
            figure = Figure(figsize=(4.8, 3.8), layout="constrained")
            above, below = figure.subplots(2, 1, sharex=True)
            steps = self.column("steps")
            marker = "." if len(steps) < 10 else ""
            for axes, name in ((above, "found"), (below, "reward")):
                values = self.column(name)
                axes.plot(steps, values, color=LINE, alpha=0.25, linewidth=0.8)
                axes.plot(steps, moving_mean(values), color=LINE, linewidth=1.6, marker=marker)
            above.set_title(title)
            above.set(ylabel="everybody found", ylim=(-0.02, 1.02))
            above.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
            below.set(ylabel="return of a drone", xlabel="environment steps")
            below.xaxis.set_major_formatter(EngFormatter(sep=""))
            below.yaxis.set_major_formatter(EngFormatter(sep=""))
            figure.align_ylabels()
            pixels = io.BytesIO()
            figure.savefig(pixels, format="png", dpi=200)
        write_bytes(path, pixels.getvalue())

    def _read(self) -> None:
        text = self._path.read_text("utf-8")
        whole = text[: text.rfind("\n") + 1]
        lines = list(csv.reader(io.StringIO(whole)))
        if not lines or tuple(lines[0][: len(COLUMNS)]) != COLUMNS:
            raise ValueError(
                f"{self._path} must be a learning curve with the columns {', '.join(COLUMNS)}, "
                f"got {','.join(lines[0]) if lines else 'nothing'!r}"
            )
        self.names = lines[0]
        for line in lines[1:]:
            figures = [float(cell) if cell else math.nan for cell in line]
            self.rows.append(dict(zip(self.names, figures, strict=True)))

    def _write(self) -> None:
        write_text(
            self._path, ",".join(self.names) + "\n" + "".join(self._line(row) for row in self.rows)
        )

    def _line(self, row: Row) -> str:
        return ",".join(_cell(row.get(name, math.nan)) for name in self.names) + "\n"


def moving_mean(values: Floats) -> Floats:
    """The mean of each value and those before it, a twentieth of all of them.

    Args:
        values: shape (n,); NaN is left out.

    Returns:
        float64, shape (n,); NaN where there is nothing to take the mean of.
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
    """A figure as the file has it: nothing for NaN, six digits, whole numbers as such."""
    if math.isnan(value):
        return ""
    return str(int(value)) if value.is_integer() else f"{value:.6g}"


_STYLE = {
    "font.family": "DejaVu Sans",  # ships with matplotlib
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.solid_capstyle": "round",
    "text.color": INK,
}
