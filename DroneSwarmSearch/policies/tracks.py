"""The search patterns of the International Aeronautical and Maritime Search and Rescue Manual.

Their geometry alone (IAMSAR Manual, volume II, IMO and ICAO, chapter on search techniques;
sweeping at equal spacing goes back to Koopman, Search and Screening, 1946). A track is a
list of turning points, joined by straight legs; `cells_along` lays it over the grid.

Points are (x, y) in cells, a cell's centre having whole numbers; y grows downward.
Headings are in degrees, clockwise from up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from DroneSwarmSearch.scenario import Cell

__all__ = [
    "Point",
    "Rectangle",
    "cells_along",
    "divided",
    "expanding_square",
    "sector_search",
    "strips",
    "sweep",
]

Point = tuple[float, float]


class Rectangle(NamedTuple):
    """Some columns and rows of the grid.

    Attributes:
        x: first column.
        y: first row.
        width: how many columns, at least 1.
        height: how many rows, at least 1.
    """

    x: int
    y: int
    width: int
    height: int

    @property
    def centre(self) -> Point:
        """The middle, which may lie between cells."""
        return self.x + (self.width - 1) / 2, self.y + (self.height - 1) / 2

    @property
    def corners(self) -> list[Cell]:
        """The cells at the corners, each once."""
        right, bottom = self.x + self.width - 1, self.y + self.height - 1
        return sorted({(x, y) for x in (self.x, right) for y in (self.y, bottom)})

    @property
    def area(self) -> int:
        """The number of cells."""
        return self.width * self.height


def sweep(area: Rectangle, along_x: bool, corner: Cell) -> list[Point]:
    """Parallel legs to and fro, one cell apart, the first and last half a cell from the edge.

    With the legs along the area's longer side this is the parallel sweep, PS; along the
    shorter side, the creeping line, CS.

    Args:
        area: what is swept.
        along_x: whether the legs lead along the x axis.
        corner: the corner at which the track begins.

    Returns:
        The turning points, two for each leg.
    """
    columns: Sequence[int] = range(area.x, area.x + area.width)
    rows: Sequence[int] = range(area.y, area.y + area.height)
    if corner[0] != area.x:
        columns = columns[::-1]
    if corner[1] != area.y:
        rows = rows[::-1]
    points: list[Point] = []
    for leg, line in enumerate(rows if along_x else columns):
        ends = (columns if along_x else rows)[:: -1 if leg % 2 else 1]
        pair = ends[0], ends[-1]
        points += [(end, line) if along_x else (line, end) for end in pair]
    return points


def strips(area: Rectangle, count: int, along_x: bool) -> list[Rectangle]:
    """An area in strips of whole legs for several drones, as nearly alike as can be.

    Args:
        area: what is divided.
        count: how many strips are wanted.
        along_x: whether legs lead along the x axis.

    Returns:
        The strips. Where there are fewer legs than drones, the legs are cut as well; there
        are never more strips than cells.
    """
    legs, length = (area.height, area.width) if along_x else (area.width, area.height)
    across = min(count, legs)
    parts = []
    for place, (first, lines) in enumerate(_shares(legs, across)):
        cuts = min(count // across + (place < count % across), length)
        for begin, run in _shares(length, cuts):
            x, y, width, height = (
                (begin, first, run, lines) if along_x else (first, begin, lines, run)
            )
            parts.append(Rectangle(area.x + x, area.y + y, width, height))
    return parts


def divided(area: Rectangle, count: int) -> list[Rectangle]:
    """An area in parts for several drones, as nearly square as can be.

    Args:
        area: what is divided.
        count: how many parts are wanted.

    Returns:
        The parts, row after row; never more than cells.
    """
    ideal = math.sqrt(count * area.height / area.width)
    rows = min(max(1, round(ideal)), count, area.height)
    parts = []
    # The shorter rows first and last: seven drones stand as 2, 3, 2.
    middle_first = sorted(range(rows), key=lambda row: abs(2 * row - rows + 1))
    longer = set(middle_first[: count % rows])
    for row, (top, height) in enumerate(_shares(area.height, rows)):
        here = min(count // rows + (row in longer), area.width)
        for left, width in _shares(area.width, here):
            parts.append(Rectangle(area.x + left, area.y + top, width, height))
    return parts


def expanding_square(datum: Point, legs: int, heading: float = 0.0) -> list[Point]:
    """The expanding square, SS: legs of S, S, 2S, 2S, 3S, 3S…, turns of 90° to the right.

    The spacing S is one cell. Turned by 45° it is a cell's diagonal, so that the turns are
    at centres of cells again.

    Args:
        datum: where it begins.
        legs: how many.
        heading: of the first leg.

    Returns:
        The turning points, datum and end included.
    """
    spacing = math.sqrt(2.0) if heading % 90.0 else 1.0
    lengths = [spacing * (leg // 2 + 1) for leg in range(legs)]
    return _flown(datum, lengths, [heading + 90.0 * leg for leg in range(legs)])


def sector_search(datum: Point, radius: float, heading: float = 0.0) -> list[Point]:
    """The sector search, VS: three triangles through the datum, each leg R, 9R in all.

    Out, across and back, every turn being of 120° to the right; over the datum it goes
    straight on into the next triangle.

    Args:
        datum: the point that every triangle touches.
        radius: the length of each leg, R.
        heading: of the first leg.

    Returns:
        The ten ends of the nine legs.
    """
    headings = [heading + 120.0 * turns for turns in (0, 1, 2, 2, 3, 4, 4, 5, 6)]
    return _flown(datum, [radius] * 9, headings)


def cells_along(points: Iterable[Point], grid_size: int) -> list[Cell]:
    """The cells that a track leads through, each beside the one before it.

    Legs that lie askew become staircases. What lies outside the grid is left out: there
    the drone flies on to where the track comes back, so that neighbours in the list may be
    apart.

    Args:
        points: the turning points.
        grid_size: cells along each side of the grid.

    Returns:
        The cells (x, y); one that is crossed twice is listed twice.
    """
    corners = [(math.floor(x + 0.5), math.floor(y + 0.5)) for x, y in points]
    cells = corners[:1]
    for begin, end in pairwise(corners):
        cells += _staircase(begin, end)
    inside = [(x, y) for x, y in cells if 0 <= x < grid_size and 0 <= y < grid_size]
    return [cell for i, cell in enumerate(inside) if i == 0 or cell != inside[i - 1]]


def _staircase(begin: Cell, end: Cell) -> list[Cell]:
    """The cells from one to another, the first left out, along the straight line."""
    (x, y), (far_x, far_y) = begin, end
    across, down = abs(far_x - x), abs(far_y - y)
    step_x, step_y = (1 if far_x > x else -1), (1 if far_y > y else -1)
    cells = []
    i = j = 0
    while i < across or j < down:
        # The next border that the line crosses: a column's, or a row's.
        if (2 * i + 1) * down < (2 * j + 1) * across:
            i, x = i + 1, x + step_x
        else:
            j, y = j + 1, y + step_y
        cells.append((x, y))
    return cells


def _flown(start: Point, lengths: Sequence[float], headings: Sequence[float]) -> list[Point]:
    """The ends of legs of some lengths and headings."""
    x, y = start
    points = [start]
    for length, heading in zip(lengths, headings, strict=True):
        x += length * math.sin(math.radians(heading))
        y -= length * math.cos(math.radians(heading))
        points.append((x, y))
    return points


def _shares(length: int, parts: int) -> list[tuple[int, int]]:
    """A length in whole parts that differ by 1 at most: where each begins, and how long it is."""
    borders = [length * part // parts for part in range(parts + 1)]
    return [(begin, end - begin) for begin, end in pairwise(borders)]
