"""What the benchmark tells: tables, data for a file, and where it stands."""

from __future__ import annotations

import importlib.metadata
import platform
import sys
from collections.abc import Sequence
from typing import Any

import DroneSwarmSearch
from DroneSwarmSearch.bench.cases import Size
from DroneSwarmSearch.bench.memory import Figures
from DroneSwarmSearch.bench.turns import Spread
from DroneSwarmSearch.vector import threads

__all__ = [
    "Progress",
    "Row",
    "heading",
    "left_out_text",
    "memory_text",
    "size_text",
    "surroundings",
]

Row = tuple[str, int | None, Spread]
"""A figure's name, the number of searches (None: one environment, which stands for any
number of them), and its values."""

_SHOWN = ("numpy", "gymnasium", "DSSE", "jax", "jaxmarl")

NOTES = """\
Speeds are steps of whole swarms per second, resets included; rows of a batch that begin
anew in place of a step do not count. Medians of rounds taken in turns, and quartiles;
ratios are formed round by round. What one environment's step costs does not depend on how
many there are: one is measured, and a loop over any number has its speed."""


def surroundings() -> dict[str, Any]:
    """What the figures depend on besides the parameters: versions and processors."""
    versions = {"python": platform.python_version(), "package": DroneSwarmSearch.__version__}
    for name in _SHOWN:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    counts = {"cpus": threads.processors(), "threads": threads.usual_number()}
    return {"versions": versions, **counts, "system": platform.platform()}


def heading(command: str, around: dict[str, Any], parameters: dict[str, Any]) -> str:
    """What comes before the figures."""
    versions = dict(around["versions"])
    lines = [
        f"# DroneSwarmSearch {versions.pop('package')}: speed and memory",
        "",
        f"    {command}",
        "",
        ", ".join(f"{name} {version}" for name, version in versions.items())
        + f"; processors: {around['cpus']}, threads: {around['threads']}",
        ", ".join(f"{name.replace('_', ' ')}: {_words(v)}" for name, v in parameters.items()),
        "",
        NOTES,
    ]
    return "\n".join(lines)


def _words(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def size_text(
    size: Size, speeds: Sequence[Row], ratios: Sequence[Row], left_out: Sequence[str]
) -> str:
    """All that is told of a size."""
    cells, drones = size
    parts = [f"\n## {cells} x {cells} cells, {drones} drone{'' if drones == 1 else 's'}"]
    if speeds:
        parts.append(_table("steps per second", speeds))
    if ratios:
        parts.append(_table("ratio of speeds", ratios))
    parts.extend(left_out_text(line) for line in left_out)
    return "\n\n".join(parts)


def left_out_text(line: str) -> str:
    """What is told of something that is not measured."""
    return f"left out: {line}"


def memory_text(figures: Figures) -> str:
    """What is told of memory."""
    first, last = figures["steps"]
    return (
        f"\n## Memory\n\n{figures['num_envs']:,} searches by index, "
        f"{figures['grid_size']} x {figures['grid_size']} cells, {figures['n_drones']} drones, "
        f"in a process of their own:\npeak after {first} steps {figures['peak_mib']:,.0f} MiB, "
        f"of which {figures['peak_mib_before']:,.0f} MiB were taken before the batch was made;\n"
        f"growth of the peak up to step {last}: {figures['growth_mib']:,.1f} MiB"
    )


def _table(what: str, rows: Sequence[Row]) -> str:
    """A table in Markdown, aligned as plain text."""
    lines = [[what, "searches", "median", "lower quartile", "upper quartile"]]
    for name, num_envs, figures in rows:
        searches = "any" if num_envs is None else f"{num_envs:,}"
        lines.append([name, searches, *map(_number, figures)])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    lines.insert(1, rule)
    return "\n".join(
        f"| {line[0]:<{widths[0]}} | "
        + " | ".join(f"{cell:>{w}}" for cell, w in zip(line[1:], widths[1:], strict=True))
        + " |"
        for line in lines
    )


def _number(value: float) -> str:
    """A figure with two digits at least."""
    if value >= 100:
        return f"{value:,.0f}"
    if value >= 1:
        return f"{value:.1f}" if value >= 10 else f"{value:.2f}"
    return f"{value:#.2g}"


class Progress:
    """A line on stderr, rewritten over and over, if somebody sees it."""

    def __init__(self) -> None:
        self._seen = sys.stderr.isatty()

    def __call__(self, line: str) -> None:
        """Show another line; an empty one wipes it away."""
        if self._seen:
            print(f"\r\x1b[2K{line[:79]}", end="", file=sys.stderr, flush=True)
