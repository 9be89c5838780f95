"""TabulatedForecasts for the terminal: drawn with rich where it is installed, else plain text."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from DroneSwarmSearch.evaluation.statistics import Estimate

__all__ = ["figure", "percent", "print_table", "signed"]


def percent(estimate: Estimate | None) -> str:
    """A share with its interval, in percent; "-" for none."""
    return "-" if estimate is None else figure(estimate.scaled(100.0))


def figure(estimate: Estimate) -> str:
    """A figure of at least 0 with its interval."""
    return f"{estimate.value:.1f} ({estimate.low:.1f}-{estimate.high:.1f})"


def signed(estimate: Estimate) -> str:
    """A difference with its interval, each with its sign."""
    value, low, high = (round(number, 1) + 0.0 for number in estimate)  # + 0.0: no "-0.0"
    return f"{value:+.1f} ({low:+.1f} to {high:+.1f})"


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 2) -> None:
    """Print a table on stdout.

    Args:
        headers: of the columns.
        rows: the cells of each row.
        words: so many columns, the first, are words; the others are numbers.
    """
    if sys.stdout.isatty() and _print_rich(headers, rows, words):
        return
    lines = [list(headers), *map(list, rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    for line in lines:
        cells = [
            cell.ljust(width) if place < words else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())


def _print_rich(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int) -> bool:
    """Print it with rich; False where rich is missing."""
    try:
        from rich.box import SIMPLE_HEAD
        from rich.console import Console
        from rich.table import Table
    except ImportError:
        return False
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=0)
    for place, header in enumerate(headers):
        if place < words:
            table.add_column(header, no_wrap=True)
        else:
            table.add_column(header, justify="right", overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(markup=False, highlight=False).print(table)
    return True
