"""Tables of figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from DroneSwarmSearch.evaluation.statistics import Estimate

__all__ = ["figure", "percent", "print_table", "signed"]

MOST_DECIMALS = 4
"""Decimals of figures with a narrow interval; those with a wide one have one."""


def percent(estimate: Estimate | None) -> str:
    """A share in percent, with its interval unless it is exact; "-" for None."""
    return "-" if estimate is None else figure(estimate.scaled(100.0))


def figure(estimate: Estimate) -> str:
    """A value of at least 0, with its interval unless it is exact."""
    if estimate.is_exact:
        return f"{estimate.value:.1f}"
    value, low, high = (f"{number:.{_decimals(estimate)}f}" for number in estimate)
    return f"{value} ({low}-{high})"


def signed(estimate: Estimate) -> str:
    """A difference with its interval unless it is exact, all with their signs."""
    digits = _decimals(estimate)
    rounded = (round(number, digits) + 0.0 for number in estimate)  # + 0.0: no "-0.0"
    value, low, high = (f"{number:+.{digits}f}" for number in rounded)
    return value if estimate.is_exact else f"{value} ({low} to {high})"


def _decimals(estimate: Estimate) -> int:
    """As many decimals as show the interval."""
    width = estimate.high - estimate.low
    if not width > 0.0:
        return 1
    return min(max(math.ceil(-math.log10(width)), 1), MOST_DECIMALS)


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 2) -> None:
    """Print a table on stdout.

    Args:
        headers: of the columns.
        rows: the cells of each row.
        words: the number of columns, from the left, that hold words. Words are aligned to
            the left, numbers to the right.
    """
    heading, *others = _aligned([headers, *rows], words)
    for line in (heading, ["-" * len(cell) for cell in heading], *others):
        print("  ".join(line).rstrip())


def _aligned(rows: Sequence[Sequence[str]], words: int) -> list[list[str]]:
    """The rows with their cells padded to the widths of the columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        [
            cell.ljust(width) if column < words else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        for row in rows
    ]
