"""The square grid: its cells, and the moves, neighbours and distances between them.

A cell is a position (x, y) or one number, y * size + x; y grows downward.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch._internal.cells import cell_number, cell_position

Cell = tuple[int, int]  # (x, y): column and row

MOVES: tuple[Cell, ...] = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""The steps (x, y) of the moves: left, right, up and down."""

WAITING = 2  # the actions after the moves that leave a drone in its cell: to search, and to idle
OFF_GRID = -1  # the target of a move that leaves the grid

Value = TypeVar("Value")


class CellTable(dict[int, Value], Generic[Value]):
    """A table by cell, whose entries are computed when they are needed."""

    def __init__(self, compute: Callable[[int], Value]) -> None:
        super().__init__()
        self._compute = compute

    def __missing__(self, cell: int) -> Value:
        self[cell] = value = self._compute(cell)
        return value


class Grid:
    """A grid of `size` by `size` cells; `Grid.of` returns the one that all of a size share.

    Attributes:
        size: cells along each side.
        neighbours: ``neighbours[cell][action]`` is the target cell of an action, or OFF_GRID.
        positions: ``positions[cell]`` is the cell's (x, y).
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.neighbours: CellTable[tuple[int, ...]] = CellTable(self._targets_of)
        self.positions: CellTable[Cell] = CellTable(lambda cell: cell_position(cell, size))

    @staticmethod
    @lru_cache(maxsize=64)
    def of(size: int) -> Grid:
        """The grid of a size; look-ups are faster than arithmetic, and their tables are shared."""
        return Grid(size)

    def __reduce__(self) -> tuple[Any, ...]:
        return Grid.of, (self.size,)

    def _targets_of(self, cell: int) -> tuple[int, ...]:
        x, y = self.positions[cell]
        inside = range(self.size)
        moves = (
            cell_number(x + dx, y + dy, self.size)
            if x + dx in inside and y + dy in inside
            else OFF_GRID
            for dx, dy in MOVES
        )
        return (*moves, *[cell] * WAITING)

    @cached_property
    def targets(self) -> Ints:
        """`neighbours` of all cells: int64, (size², 6), read-only.

        Raises:
            ValueError: there is not enough memory.
        """
        cells = np.arange(self.size**2)
        needed = 32 * (len(MOVES) + WAITING) * len(cells)
        checks.fits("the table of the cells' neighbours", needed, grid_size=self.size)
        x, y = cell_position(cells, self.size)
        targets = np.tile(cells[:, None], len(MOVES) + WAITING)
        for move, (dx, dy) in enumerate(MOVES):
            to_x = x + dx
            to_y = y + dy
            inside = (to_x >= 0) & (to_x < self.size) & (to_y >= 0) & (to_y < self.size)
            targets[:, move] = np.where(inside, cell_number(to_x, to_y, self.size), OFF_GRID)
        targets.flags.writeable = False
        return targets

    @cached_property
    def coordinates(self) -> NDArray[np.int32]:
        """`positions` of all cells: int32, (size², 2), read-only."""
        cells = np.arange(self.size**2, dtype=np.int32)
        coordinates = np.stack(cell_position(cells, self.size), axis=1)
        coordinates.flags.writeable = False
        return coordinates

    def distance(self, cells: Any, others: Any) -> Any:
        """The moves between cells, given as numbers."""
        x, y = cell_position(cells, self.size)
        to_x, to_y = cell_position(others, self.size)
        return moves_between(to_x - x, to_y - y)


def moves_between(dx: Any, dy: Any) -> Any:
    """The moves for a displacement (dx, dy)."""
    return abs(dx) + abs(dy)


def _leaving(dx: int, dy: int) -> tuple[Any, ...]:
    """The cells from which a displacement stays on the grid."""
    return ..., *(slice(max(-step, 0), min(-step, 0) or None) for step in (dy, dx))


SHIFTS = tuple((_leaving(dx, dy), _leaving(-dx, -dy)) for dx, dy in MOVES)
"""For each move, as indices of arrays (..., y, x): the cells that a drone can leave, and the
cells in which it then arrives."""


@lru_cache(maxsize=256)
def neighbours_in_box(height: int, width: int) -> Ints:
    """Each cell y * width + x of a box itself, then its neighbours by move: (5, height * width).

    At the border, a cell stands for its neighbours beyond it.
    """
    cells = np.arange(height * width).reshape(height, width)
    around = np.tile(cells, (1 + len(MOVES), 1, 1))
    for neighbour, (before, after) in zip(around[1:], SHIFTS, strict=True):
        neighbour[before] = cells[after]
    return around.reshape(len(around), -1)
