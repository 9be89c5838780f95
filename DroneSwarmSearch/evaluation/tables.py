"""Tables of figures."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from itertools import zip_longest

from DroneSwarmSearch.evaluation.statistics import Estimate

WIDTH = 80  # characters in a line of a table
MOST_DECIMALS = 4  # decimals of figures with a narrow interval; those with a wide one have one


def percent(estimate: Estimate | None) -> str:
    """A share in percent, as `figure` shows it; "-" for None."""
    return "-" if estimate is None else figure(estimate.scaled(100.0))


def figure(estimate: Estimate) -> str:
    """A value of at least 0, with its interval unless it is exact."""
    return _shown(estimate, "", "-")


def signed(estimate: Estimate) -> str:
    """A difference with its interval unless it is exact, all with their signs."""
    return _shown(estimate, "+", " to ")


def _shown(estimate: Estimate, sign: str, to: str) -> str:
    """The figures with as many decimals as show the interval."""
    digits, width = 1, estimate.high - estimate.low
    if width > 0.0:
        digits = min(max(math.ceil(-math.log10(width)), 1), MOST_DECIMALS)
    rounded = (round(number, digits) + 0.0 for number in estimate)  # + 0.0: no "-0.0"
    value, low, high = (f"{number:{sign}.{digits}f}" for number in rounded)
    return value if estimate.is_exact else f"{value} ({low}{to}{high})"


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], words: int = 2) -> None:
    """Print a table on stdout; the first columns, `words` of them, are aligned to the left.

    A table wider than `WIDTH` breaks its headers into lines, and then itself into several tables,
    each with the first columns.
    """
    columns = [*zip(headers, *rows, strict=True)]
    widths = [max(map(len, column)) for column in columns]
    if _total(widths) > WIDTH:
        parts = [textwrap.wrap(header, 1, break_long_words=False) for header in headers]
        widths = [
            max(map(len, [*each, *cells])) for each, (_, *cells) in zip(parts, columns, strict=True)
        ]
    tables = [[*range(words)]]
    for place in range(words, len(widths)):
        if _total([widths[each] for each in [*tables[-1], place]]) > WIDTH:
            tables.append([*range(words)])
        tables[-1].append(place)
    for number, places in enumerate(tables):
        if number:
            print()
        wrapped = [textwrap.wrap(headers[place], widths[place]) for place in places]
        rules = ["-" * widths[place] for place in places]
        shown = ([row[place] for place in places] for row in rows)
        for line in (*zip_longest(*wrapped, fillvalue=""), rules, *shown):
            cells = [
                cell.ljust(widths[place]) if place < words else cell.rjust(widths[place])
                for place, cell in zip(places, line, strict=True)
            ]
            print("  ".join(cells).rstrip())


def _total(widths: Sequence[int]) -> int:
    """The width of a table, with two spaces between its columns."""
    return sum(widths) + 2 * (len(widths) - 1)
