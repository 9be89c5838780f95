"""Look-up tables for the cells of a square grid, numbered y * grid_size + x.

Entries are computed on first use. All environments of a grid size share the tables, because a
look-up is faster than arithmetic with coordinates.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeVar

from DroneSwarmSearch.rules import neighbours

__all__ = ["Neighbours", "Positions", "grid_of"]

Entry = TypeVar("Entry")


class _Table(dict[int, Entry]):
    """A table by cell, computed on first use. Copying or unpickling it returns the shared table."""

    def __init__(self, grid_size: int) -> None:
        super().__init__()
        self._grid_size = grid_size

    def __reduce__(self) -> tuple[Any, ...]:
        return _shared, (type(self), self._grid_size)


class Neighbours(_Table[tuple[int, ...]]):
    """``neighbours[cell][action]`` is the target cell of an action, or OFF_GRID."""

    def __missing__(self, cell: int) -> tuple[int, ...]:
        self[cell] = around = neighbours(cell, self._grid_size)
        return around


class Positions(_Table[tuple[int, int]]):
    """``positions[cell]`` is the cell's (x, y)."""

    def __missing__(self, cell: int) -> tuple[int, int]:
        y, x = divmod(cell, self._grid_size)
        self[cell] = position = (x, y)
        return position


def grid_of(grid_size: int) -> tuple[Neighbours, Positions]:
    """The shared tables of a grid size."""
    return _shared(Neighbours, grid_size), _shared(Positions, grid_size)


@lru_cache(maxsize=32)
def _shared(kind: Any, grid_size: int) -> Any:
    return kind(grid_size)
