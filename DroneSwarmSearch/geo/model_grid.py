"""The grid of a model: where positions on a plane lie in its rows and columns.

A grid is regular in latitude and longitude, or it has a latitude and a longitude for each cell, as
rotated, Lambert and polar stereographic grids have. Both become one table on the plane, between
whose nodes rows and columns are interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch.geo.plane import EQUATOR, TangentPlane

NODES_APART = 2000.0  # metres: the table is then right to 0.1 m on smooth grids
REACH = 300_000.0  # of the table to each side
ROUNDS = 12  # of Newton's method
ROUNDING = 1e-4  # of rows and columns


@dataclass(frozen=True, eq=False)
class PlaneTable:
    """Rows, columns and directions of a grid at the nodes of a square on the plane.

    Attributes:
        cells: the row and the column, which go on beyond the grid: float64, (n, n, 2), indexed
            [north, east].
        directions: cosine and sine of the angle from the east to the direction of the rows:
            float64, (n, n, 2); None if rows lead to the east.
        shape: the number of rows and of columns.
        reach: from the middle to each side, in metres.
    """

    cells: Floats
    directions: Floats | None
    shape: tuple[int, int]
    reach: float

    def cells_at(self, points: Floats) -> Floats:
        """The rows and columns of points, (2, n) in metres: (2, n)."""
        return self._at(points, self.cells)

    def turned(self, velocity: Floats, points: Floats) -> Floats:
        """Velocities along rows and columns at points as those to the east and north: (2, n)."""
        if self.directions is None:
            return velocity
        cosine, sine = self._at(points, self.directions)
        x, y = velocity
        return np.array([x * cosine - y * sine, x * sine + y * cosine])

    def _at(self, points: Floats, values: Floats) -> Floats:
        last = len(values) - 1
        at = np.clip((points + self.reach) / (2 * self.reach) * last, 0.0, last)
        before = np.minimum(at.astype(np.int64), last - 1)
        right, up = at - before
        column, row = before
        corner = np.array([0, 1, last + 1, last + 2])[:, None]
        shares = bilinear(up, right)
        taken = values.reshape(-1, 2).take(row * (last + 1) + column + corner, axis=0)  # (4, n, 2)
        found: Floats = (shares[..., None] * taken).sum(axis=0).T
        return found

    def is_beyond(self, points: Floats) -> Flags:
        """Whether points lie beyond the grid or the table: (n,)."""
        row, column = self.cells_at(points)
        rows, columns = self.shape
        beyond: Flags = np.any(np.abs(points) > self.reach, axis=0)
        beyond |= (row < -ROUNDING) | (row > rows - 1 + ROUNDING)
        beyond |= (column < -ROUNDING) | (column > columns - 1 + ROUNDING)
        return beyond


def bilinear(up: Floats, right: Floats) -> Floats:
    """The shares of four corners, the lower left one first, row by row: (4, n)."""
    return np.stack([(1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right])


def plane_table(latitudes: Floats, longitudes: Floats, plane: TangentPlane) -> PlaneTable:
    """The table of a grid with axes of latitude and longitude, or with both for each cell."""
    count = round(2 * REACH / NODES_APART) + 1
    nodes = np.linspace(-REACH, REACH, count)
    east, north = np.meshgrid(nodes, nodes)
    points = np.stack([east, north], axis=-1).reshape(-1, 2)
    square = (count, count, 2)
    if latitudes.ndim == 1:
        cells = _on_axes(latitudes, longitudes, plane, points)
        shape = len(latitudes), len(longitudes)
        return PlaneTable(cells.reshape(square), None, shape, REACH)
    cells, directions = _by_cells(latitudes, longitudes, plane, points)
    rows, columns = latitudes.shape
    return PlaneTable(cells.reshape(square), directions.reshape(square), (rows, columns), REACH)


def _on_axes(latitudes: Floats, longitudes: Floats, plane: TangentPlane, points: Floats) -> Floats:
    """Rows and columns on axes that increase: (n, 2)."""
    latitude, longitude = plane.degrees(points).T
    middle = longitudes.mean()
    longitude = (longitude - middle + 180) % 360 - 180 + middle
    row = _index(latitude, latitudes)
    column = _index(longitude, longitudes)
    return np.stack([row, column], axis=-1)


def _index(values: Floats, axis: Floats) -> Floats:
    """Where values lie on an axis, in units of its steps; linear beyond its ends."""
    before = np.clip(axis.searchsorted(values, side="right") - 1, 0, len(axis) - 2)
    index: Floats = before + (values - axis[before]) / (axis[before + 1] - axis[before])
    return index


def _by_cells(
    latitudes: Floats, longitudes: Floats, plane: TangentPlane, points: Floats
) -> tuple[Floats, Floats]:
    """Rows and columns by Newton's method, on a grid that is linear between its cells.

    And cosine and sine of the angle from the east to the direction of the rows; (n, 2) each.
    """
    cells = plane.metres(latitudes, longitudes)  # (rows, columns, 2)
    rows, columns = latitudes.shape
    at = _first_guess(cells, points)
    limits = np.array([rows, columns])
    for _ in range(ROUNDS):
        place, along_rows, along_columns = _between_cells(cells, at)
        away = points - place
        # Two linear equations: `along_rows` times the rows plus `along_columns` times the columns.
        determinant = (
            along_rows[:, 0] * along_columns[:, 1] - along_rows[:, 1] * along_columns[:, 0]
        )
        by_row = (away[:, 0] * along_columns[:, 1] - away[:, 1] * along_columns[:, 0]) / determinant
        by_column = (along_rows[:, 0] * away[:, 1] - along_rows[:, 1] * away[:, 0]) / determinant
        at = np.clip(at + np.stack([by_row, by_column], axis=-1), -limits, 2 * limits)
    _, _, along_columns = _between_cells(cells, at)
    angle = np.arctan2(along_columns[:, 1], along_columns[:, 0])
    # From the east, which is another direction far from the middle of the plane.
    angle -= np.tan(np.radians(plane.origin[0])) / EQUATOR * points[:, 0]
    return at, np.column_stack([np.cos(angle), np.sin(angle)])


def _first_guess(cells: Floats, points: Floats) -> Floats:
    """Rows and columns of points by the plane through all cells: (n, 2)."""
    rows, columns = np.indices(cells.shape[:2]).reshape(2, -1)
    flat = cells.reshape(-1, 2)
    known = np.isfinite(flat).all(axis=1)
    design = np.column_stack([np.ones(known.sum()), flat[known]])
    targets = np.column_stack([rows, columns])[known]
    solution, *_ = np.linalg.lstsq(design, targets, rcond=None)
    guess: Floats = np.column_stack([np.ones(len(points)), points]) @ solution
    return guess


def _between_cells(cells: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """The positions at rows and columns, and how they change with each: (n, 2) each."""
    last = np.array(cells.shape[:2]) - 2
    before = np.clip(np.floor(at).astype(np.int64), 0, last)
    row, column = before.T
    up, right = (at - before).T[:, :, None]
    here = cells[row, column]
    above = cells[row + 1, column]
    beside = cells[row, column + 1]
    across = cells[row + 1, column + 1]
    along_rows = (1 - right) * (above - here) + right * (across - beside)
    along_columns = (1 - up) * (beside - here) + up * (across - above)
    return here + up * (above - here) + right * along_columns, along_rows, along_columns
