"""The search patterns of the IAMSAR Manual on the grid; `geo.pattern_legs` has their legs.

A track is the turning points of a pattern, (x, y) in cells: float64, shape (n, 2). Whole numbers
are the centres of cells; y grows downward. Headings are in degrees, clockwise from up.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Floats, Ints, Pair
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.geo.pattern_legs import (
    Legs,
    parallel_legs,
    sector_legs,
    square_legs,
    turning_points,
)


class Rectangle(NamedTuple):
    """Consecutive columns, from x on, and rows, from y on, of the grid; at least one of each."""

    x: int
    y: int
    width: int
    height: int

    @property
    def centre(self) -> Pair:
        """The middle, which may lie between cells."""
        return self.x + (self.width - 1) / 2, self.y + (self.height - 1) / 2

    @property
    def corners(self) -> list[Cell]:
        """The cells at the corners, each once."""
        right = self.x + self.width - 1
        bottom = self.y + self.height - 1
        return sorted({(x, y) for x in (self.x, right) for y in (self.y, bottom)})

    @property
    def area(self) -> int:
        """The number of cells."""
        return self.width * self.height


def parallel_track(area: Rectangle, along_x: bool, corner: Cell) -> Floats:
    """Parallel legs from a corner of an area, over every cell of it once; one cell apart."""
    is_left = corner[0] == area.x
    is_top = corner[1] == area.y
    if along_x:
        heading = 90.0 if is_left else 270.0
        legs = _numbers_of_legs(area.height)
        length = area.width - 1
    else:
        heading = 180.0 if is_top else 0.0
        legs = _numbers_of_legs(area.width)
        length = area.height - 1
    turns_right = (is_left == is_top) == along_x
    return _track(corner, heading, parallel_legs(legs, length, 1.0), turns_right)


def _numbers_of_legs(lines: int) -> Ints:
    """The numbers of the legs along some parallel lines, and of those between them."""
    return np.arange(2 * lines - 1)


def strips_of(area: Rectangle, count: int, along_x: bool) -> list[Rectangle]:
    """Divide an area into a number of nearly equal strips of whole legs.

    With fewer legs than strips, the legs are cut; there are never more strips than cells.
    """
    legs, length = (area.height, area.width) if along_x else (area.width, area.height)
    across = min(count, legs)
    strips: list[Rectangle] = []
    for index, (first, lines) in enumerate(_divided(legs, across)):
        cuts = min(count // across + (index < count % across), length)
        for begin, run in _divided(length, cuts):
            if along_x:
                strips.append(Rectangle(area.x + begin, area.y + first, run, lines))
            else:
                strips.append(Rectangle(area.x + first, area.y + begin, lines, run))
    return strips


def parts_of(area: Rectangle, count: int) -> list[Rectangle]:
    """Divide an area into a number of nearly square parts, row after row; at most one a cell."""
    ideal = math.sqrt(count * area.height / area.width)
    rows = min(max(1, round(ideal)), count, area.height)
    parts = []
    # The middle rows have more parts: seven parts form rows of 2, 3 and 2.
    middle_first = sorted(range(rows), key=lambda row: abs(2 * row - rows + 1))
    longer = set(middle_first[: count % rows])
    for row, (top, height) in enumerate(_divided(area.height, rows)):
        columns = min(count // rows + (row in longer), area.width)
        for left, width in _divided(area.width, columns):
            parts.append(Rectangle(area.x + left, area.y + top, width, height))
    return parts


def _divided(length: int, parts: int) -> list[tuple[int, int]]:
    """The start and length of each part, as integers; lengths differ by at most 1."""
    borders = [length * part // parts for part in range(parts + 1)]
    return [(begin, end - begin) for begin, end in pairwise(borders)]


def expanding_square(datum: Pair, legs: int, heading: float = 0.0) -> Floats:
    """An expanding square with the first leg along a heading, and turns to the right.

    The spacing is one cell; turned by 45° it is the diagonal of a cell, so that the turning
    points, from the datum to the end, are at centres of cells again.
    """
    spacing = math.sqrt(2.0) if heading % 90.0 else 1.0
    return _track(datum, heading, square_legs(np.arange(legs), spacing))


def sector_search(datum: Pair, radius: float, heading: float = 0.0) -> Floats:
    """A sector search of three triangles, with the first leg along a heading, to the right."""
    return _track(datum, heading, sector_legs(np.arange(9), radius))


def _track(start: Pair, heading: float, legs: Legs, turns_right: bool = True) -> Floats:
    """The turning points of legs."""
    turns = legs.turns if turns_right else -legs.turns
    x, y = start
    east_and_north = turning_points((x, -y), np.radians(heading + turns), legs.lengths)
    track: Floats = east_and_north * (1.0, -1.0)
    return track


def cells_along(track: ArrayLike, grid_size: int) -> list[Cell]:
    """The cells (x, y) along a track, as often as it crosses them, each next to the one before.

    Legs that are not parallel to an axis become staircases. Cells outside the grid are left out.
    """
    corners = [(x, y) for x, y in np.floor(np.asarray(track) + 0.5).astype(np.int64).tolist()]
    cells = corners[:1]
    for begin, end in pairwise(corners):
        cells += _staircase(begin, end)
    inside = [(x, y) for x, y in cells if 0 <= x < grid_size and 0 <= y < grid_size]
    return [cell for i, cell in enumerate(inside) if i == 0 or cell != inside[i - 1]]


def _staircase(begin: Cell, end: Cell) -> list[Cell]:
    """The cells along the straight line from one cell to another, without the first."""
    x, y = begin
    end_x, end_y = end
    columns = abs(end_x - x)
    rows = abs(end_y - y)
    step_x = 1 if end_x > x else -1
    step_y = 1 if end_y > y else -1
    cells = []
    i = 0
    j = 0
    while i < columns or j < rows:
        # Cross the next border on the line: a column's or a row's.
        if (2 * i + 1) * rows < (2 * j + 1) * columns:
            i += 1
            x += step_x
        else:
            j += 1
            y += step_y
        cells.append((x, y))
    return cells
