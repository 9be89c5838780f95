"""The style of all plots in a light and a dark theme, and their files.

A policy has the same colour and marker in every plot of a theme. The colours are those of M. Okabe
and K. Ito, Color universal design, 2008, which are distinct for all common forms of colour vision,
with a darker yellow; lighter on the dark ground. Needs the packages of the extra "evaluation".
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from DroneSwarmSearch._internal.files import write_bytes

try:
    from matplotlib import style
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError(
        'plots need the package matplotlib: pip install "DroneSwarmSearchEnvironment[evaluation]"',
        name=error.name,
    ) from error

__all__ = ["DARK", "LIGHT", "WIDTH", "Look", "Theme", "save"]

WIDTH = 5.2
"""The width of a plot in inches: narrow, so that its text is legible on a phone."""


class Look(NamedTuple):
    """How a policy is drawn."""

    colour: str
    marker: str


class Theme(NamedTuple):
    """The colours of a theme.

    Attributes:
        name: suffix of the file names.
        ground: the background.
        ink: text and emphasis.
        grey: axes.
        faint: grid lines.
        stripe: the background of every second row.
        policies: how the policies of this package look.
        others: how other policies look, in their order.
    """

    name: str
    ground: str
    ink: str
    grey: str
    faint: str
    stripe: str
    policies: tuple[Look, ...]
    others: tuple[Look, ...]

    @property
    def looks(self) -> dict[str, Look]:
        """How the policies of this package look, by name."""
        return dict(zip(_POLICIES, self.policies, strict=True))

    @property
    def settings(self) -> dict[str, Any]:
        """Matplotlib's settings."""
        return {
            "font.family": "DejaVu Sans",  # part of matplotlib
            "font.size": 9.5,
            "axes.titlesize": 9.5,
            "axes.titlelocation": "left",
            "axes.labelcolor": self.ink,
            "axes.edgecolor": self.grey,
            "axes.facecolor": self.ground,
            "axes.linewidth": 0.8,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "axes.axisbelow": True,
            "grid.color": self.faint,
            "grid.linewidth": 0.8,
            "xtick.color": self.grey,
            "ytick.color": self.grey,
            "xtick.labelcolor": self.ink,
            "ytick.labelcolor": self.ink,
            "figure.facecolor": self.ground,
            "savefig.facecolor": self.ground,
            "legend.frameon": False,
            "legend.fontsize": 9.5,
            "lines.linewidth": 1.5,
            "lines.markersize": 5.5,
            "lines.markeredgecolor": self.ground,
            "lines.markeredgewidth": 0.4,
            "errorbar.capsize": 0,
            "image.cmap": "Blues",
            "text.color": self.ink,
            "figure.constrained_layout.use": True,
            "svg.hashsalt": "DroneSwarmSearch",  # equal plots make equal files
        }


_POLICIES = (
    *("planner", "ppo", "greedy-forecast", "greedy-posterior", "greedy-matrix"),
    *("parallel-sweep", "creeping-line", "expanding-square", "sector-search", "random"),
)
_MARKERS, _OTHER_MARKERS = "Dh>os^vpXP", "H<d8"


def _looks(markers: str, colours: str) -> tuple[Look, ...]:
    return tuple(Look(*pair) for pair in zip(colours.split(), markers, strict=True))


LIGHT = Theme(
    name="light",
    ground="#ffffff",
    ink="#18202c",
    grey="#6b7280",
    faint="#e3e6eb",
    stripe="#f5f6f8",
    policies=_looks(
        _MARKERS,
        "#d55e00 #5b3fa0 #1b3a6b #0072b2 #56b4e9 #009e73 #e69f00 #cc79a7 #8f7f00 #9aa0a8",
    ),
    others=_looks(_OTHER_MARKERS, "#b3243c #8c4a2f #000000 #3d6b35"),
)
DARK = Theme(
    name="dark",
    ground="#131416",
    ink="#e8eaed",
    grey="#9aa2ae",
    faint="#2d3138",
    stripe="#1b1d21",
    policies=_looks(
        _MARKERS,
        "#ff8f4d #b79cff #8fb0ff #3f9fe0 #8ad4ff #35c79b #f2b84b #e08fc4 #c9b83a #8a9099",
    ),
    others=_looks(_OTHER_MARKERS, "#ff6b81 #d99a7c #ffffff #8fcf84"),
)


def save(draw: Callable[[Theme], Figure], path: str | os.PathLike[str]) -> list[Path]:
    """Write a plot as `<path>-light.svg` and `<path>-dark.svg`.

    The user's settings of Matplotlib are ignored.

    Args:
        draw: draws the plot in a theme, such as a function of `plots` with its evaluations.
        path: without suffix.

    Returns:
        The two files.

    Raises:
        StorageError: a file cannot be written.
    """
    written = []
    for theme in (LIGHT, DARK):
        content = io.BytesIO()
        with style.context(["default", theme.settings]):
            draw(theme).savefig(content, format="svg", metadata={"Date": None, "Creator": None})
        written.append(Path(f"{os.fspath(path)}-{theme.name}.svg"))
        write_bytes(written[-1], content.getvalue())
    return written
