"""The geometry of the search patterns of the IAMSAR Manual.

Source: International Aeronautical and Maritime Search and Rescue Manual, volume II, IMO and
ICAO, chapter on search techniques; sweeps at equal spacing go back to B. O. Koopman, Search and
Screening, 1946. A track is a list of turning points joined by straight legs.

Points are (x, y) in cells, whole numbers at the centres of cells; y grows downward. Headings are
in degrees, clockwise from up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch.core.grid import Cell


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


def parallel_legs(area: Rectangle, along_x: bool, corner: Cell) -> list[Pair]:
    """The turning points of parallel legs in alternating directions, one cell apart.

    With legs along the area's longer side this is the parallel sweep search, PS; along the
    shorter side, the creeping line search, CS. The track starts in a corner.
    """
    columns = range(area.x, area.x + area.width)[:: 1 if corner[0] == area.x else -1]
    rows = range(area.y, area.y + area.height)[:: 1 if corner[1] == area.y else -1]
    points: list[Pair] = []
    for leg, line in enumerate(rows if along_x else columns):
        ends = (columns if along_x else rows)[:: -1 if leg % 2 else 1]
        points += [(end, line) if along_x else (line, end) for end in (ends[0], ends[-1])]
    return points


def strips_of(area: Rectangle, count: int, along_x: bool) -> list[Rectangle]:
    """Divide an area into a number of nearly equal strips of whole legs.

    With fewer legs than strips, the legs are cut; there are never more strips than cells.
    """
    legs, length = (area.height, area.width) if along_x else (area.width, area.height)
    across = min(count, legs)
    strips = []
    for index, (first, lines) in enumerate(_divided(legs, across)):
        cuts = min(count // across + (index < count % across), length)
        for begin, run in _divided(length, cuts):
            x, y, width, height = (
                (begin, first, run, lines) if along_x else (first, begin, lines, run)
            )
            strips.append(Rectangle(area.x + x, area.y + y, width, height))
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


def expanding_square(datum: Pair, legs: int, heading: float = 0.0) -> list[Pair]:
    """The expanding square search, SS: legs of S, S, 2S, 2S, 3S, 3S…, turns of 90° to the right.

    The spacing S is one cell; turned by 45° it is the diagonal of a cell, so that the turning
    points, from the datum to the end, are at centres of cells again.
    """
    spacing = math.sqrt(2.0) if heading % 90.0 else 1.0
    lengths = [spacing * (leg // 2 + 1) for leg in range(legs)]
    return _ends_of_legs(datum, lengths, [heading + 90.0 * leg for leg in range(legs)])


def sector_search(datum: Pair, radius: float, heading: float = 0.0) -> list[Pair]:
    """The sector search, VS: three triangles through the datum, with nine legs of length R.

    All turns are 120° to the right; over the datum the track continues straight into the next
    triangle. Returns the ten ends of the legs.
    """
    headings = [heading + 120.0 * turns for turns in (0, 1, 2, 2, 3, 4, 4, 5, 6)]
    return _ends_of_legs(datum, [radius] * 9, headings)


def _ends_of_legs(start: Pair, lengths: Sequence[float], headings: Sequence[float]) -> list[Pair]:
    points = [start]
    for length, heading in zip(lengths, headings, strict=True):
        x, y = points[-1]
        angle = math.radians(heading)
        points.append((x + length * math.sin(angle), y - length * math.cos(angle)))
    return points


def cells_along(points: Iterable[Pair], grid_size: int) -> list[Cell]:
    """The cells (x, y) along a track, as often as it crosses them, each next to the one before.

    Legs that are not parallel to an axis become staircases. Cells outside the grid are left out.
    """
    corners = [(math.floor(x + 0.5), math.floor(y + 0.5)) for x, y in points]
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
