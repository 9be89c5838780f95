"""The style of all plots, for the columns of a journal, and their files.

A policy has the same colour and marker in every plot. The colours are those of M. Okabe and K.
Ito, Color universal design, 2008, which are distinct for all common forms of colour vision, with
a darker yellow. Needs the packages of the extra "evaluation".
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

from DroneSwarmSearch._internal.files import write_bytes

try:
    from matplotlib import style
    from matplotlib.figure import Figure
    from PIL import Image  # matplotlib depends on it
except ImportError as error:
    raise ImportError(
        'plots need the package matplotlib: pip install "DroneSwarmSearchEnvironment[evaluation]"',
        name=error.name,
    ) from error

__all__ = ["DOUBLE", "GREY", "INK", "LOOKS", "OTHERS", "SINGLE", "Look", "save", "styled"]

P = ParamSpec("P")
T = TypeVar("T")

SINGLE, DOUBLE = 3.5, 7.16
"""The widths of one and two columns in inches (IEEE)."""

DPI = 200
INK, GREY = "#18202c", "#70788a"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # part of matplotlib
    "font.size": 7.5,
    "axes.titlesize": 7.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6eb",
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "lines.markeredgecolor": "white",
    "lines.markeredgewidth": 0.4,
    "errorbar.capsize": 0,
    "image.cmap": "Blues",
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "DroneSwarmSearch",  # equal plots make equal files
}


class Look(NamedTuple):
    """How a policy is drawn."""

    colour: str
    marker: str


LOOKS = {
    "planner": Look("#d55e00", "D"),
    "ppo": Look("#5b3fa0", "h"),
    "greedy-forecast": Look("#1b3a6b", ">"),
    "greedy-posterior": Look("#0072b2", "o"),
    "greedy-matrix": Look("#56b4e9", "s"),
    "parallel-sweep": Look("#009e73", "^"),
    "creeping-line": Look("#e69f00", "v"),
    "expanding-square": Look("#cc79a7", "p"),
    "sector-search": Look("#8f7f00", "X"),
    "random": Look("#9aa0a8", "P"),
}

OTHERS = (Look("#b3243c", "H"), Look("#8c4a2f", "<"), Look("#000000", "d"), Look("#3d6b35", "8"))
"""For other policies, in their order."""


def styled(make: Callable[P, T]) -> Callable[P, T]:
    """Draw in the style of this module, and ignore the user's settings."""

    @wraps(make)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> T:
        with style.context(["default", STYLE]):
            return make(*args, **kwargs)

    return wrapped


@styled
def save(figure: Figure, path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write a figure as PNG and as SVG.

    Args:
        figure: from a function of `plots` or `maps`.
        path: without suffix.

    Returns:
        The two files.

    Raises:
        StorageError: a file cannot be written.
    """
    pixels, drawing, picture = io.BytesIO(), io.BytesIO(), io.BytesIO()
    figure.savefig(pixels, format="png", dpi=DPI)
    figure.savefig(drawing, format="svg", metadata={"Date": None})
    with Image.open(pixels) as image:  # a palette reduces the file to a third
        image.convert("RGB").quantize(256).save(picture, "PNG", dpi=(DPI, DPI), optimize=True)
    written = Path(f"{os.fspath(path)}.png"), Path(f"{os.fspath(path)}.svg")
    for target, data in zip(written, (picture, drawing), strict=True):
        write_bytes(target, data.getvalue())
    return written
