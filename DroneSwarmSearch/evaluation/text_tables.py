"""Tables of figures."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from itertools import zip_longest

from DroneSwarmSearch.evaluation.statistics import Estimate
from DroneSwarmSearch.rendering.text import WIDTH

MOST_DECIMALS = 4  # decimals of figures with a narrow interval; those with a wide one have one


def percent(estimate: Estimate | None) -> str:
    """A share in percent, as `figure` shows it; "-" for None."""
    return "-" if estimate is None else figure(estimate.scaled(100.0))


def figure(estimate: Estimate) -> str:
    """A value of at least 0, with its interval unless it is exact."""
    return _figures(estimate, "", "-")


def signed(estimate: Estimate) -> str:
    """A difference with its interval unless it is exact, all with their signs."""
    return _figures(estimate, "+", " to ")


def _figures(estimate: Estimate, sign: str, to: str) -> str:
    """The figures with as many decimals as show the interval."""
    digits = 1
    width = estimate.high - estimate.low
    if width > 0.0:
        digits = min(max(math.ceil(-math.log10(width)), 1), MOST_DECIMALS)
    rounded = (round(number, digits) + 0.0 for number in estimate)  # + 0.0: no "-0.0"
    value, low, high = (f"{number:{sign}.{digits}f}" for number in rounded)
    return value if estimate.is_exact else f"{value} ({low}{to}{high})"


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 2) -> None:
    """Print a table on stdout; the first columns, `words` of them, are aligned to the left.

    If it is wider than `WIDTH`, headers take several lines; columns that still do not fit follow in
    another table, after the first columns.
    """
    columns = [*zip(headers, *rows, strict=True)]
    widths = [max(map(len, column)) for column in columns]
    fitting = len(widths)
    if sum(widths) + 2 * (fitting - 1) > WIDTH:
        widths = [max(map(len, [*header.split(), *cells])) for header, *cells in columns]
    while fitting > words + 1 and sum(widths[:fitting]) + 2 * (fitting - 1) > WIDTH:
        fitting -= 1
    heads = zip_longest(*map(textwrap.wrap, headers, widths), fillvalue="")
    for line in (*heads, ["-" * width for width in widths], *rows):
        cells = [
            cell.ljust(width) if index < words else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        print("  ".join(cells[:fitting]).rstrip())
    if fitting < len(widths):
        print()
        rest, *more = ([*line[:words], *line[fitting:]] for line in (headers, *rows))
        print_table(rest, more, words)
