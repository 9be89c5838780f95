"""The cells of a square grid by number, y * grid_size + x, and what lies around each.

The tables fill themselves as cells are visited, and all environments of a grid size
share them: looking a cell up is quicker than computing with coordinates.
"""

from __future__ import annotations

from functools import lru_cache

from DroneSwarmSearch.rules import neighbours

__all__ = ["Neighbours", "Positions", "grid_of"]


class Neighbours(dict[int, tuple[int, ...]]):
    """``neighbours[cell][action]`` is where an action leads, OFF_GRID if out of the grid."""

    def __init__(self, grid_size: int) -> None:
        super().__init__()
        self._grid_size = grid_size

    def __missing__(self, cell: int) -> tuple[int, ...]:
        self[cell] = around = neighbours(cell, self._grid_size)
        return around

    def __reduce__(self) -> tuple[object, ...]:
        return _neighbours_of, (self._grid_size,)


class Positions(dict[int, tuple[int, int]]):
    """``positions[cell]`` is the cell's (x, y)."""

    def __init__(self, grid_size: int) -> None:
        super().__init__()
        self._grid_size = grid_size

    def __missing__(self, cell: int) -> tuple[int, int]:
        y, x = divmod(cell, self._grid_size)
        self[cell] = position = (x, y)
        return position

    def __reduce__(self) -> tuple[object, ...]:
        return _positions_of, (self._grid_size,)


@lru_cache(maxsize=16)
def grid_of(grid_size: int) -> tuple[Neighbours, Positions]:
    """The tables of a grid size, made once."""
    return Neighbours(grid_size), Positions(grid_size)


def _neighbours_of(grid_size: int) -> Neighbours:
    return grid_of(grid_size)[0]


def _positions_of(grid_size: int) -> Positions:
    return grid_of(grid_size)[1]
