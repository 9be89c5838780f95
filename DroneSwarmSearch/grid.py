"""Look-up tables for the cells of a square grid, numbered y * grid_size + x.

All environments of a grid size share the tables, because a look-up is faster than arithmetic with
coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Generic, TypeVar

from DroneSwarmSearch.rules import neighbours

Entry = TypeVar("Entry")


class CellTable(dict[int, Entry], Generic[Entry]):
    """A table by cell; computes entries from the cell and the grid size when they are needed."""

    def __init__(self, entry: Callable[[int, int], Entry], grid_size: int) -> None:
        super().__init__()
        self._entry, self._grid_size = entry, grid_size

    def __missing__(self, cell: int) -> Entry:
        self[cell] = entry = self._entry(cell, self._grid_size)
        return entry

    def __reduce__(self) -> tuple[Any, ...]:
        return _table, (self._entry, self._grid_size)  # copies share it, too


Neighbours = CellTable[tuple[int, ...]]
"""``neighbours[cell][action]`` is the target cell of an action, or OFF_GRID."""

Positions = CellTable[tuple[int, int]]
"""``positions[cell]`` is the cell's (x, y)."""


def grid_of(grid_size: int) -> tuple[Neighbours, Positions]:
    """The shared tables of a grid size."""
    return _table(neighbours, grid_size), _table(_position, grid_size)


def _position(cell: int, grid_size: int) -> tuple[int, int]:
    return cell % grid_size, cell // grid_size


@lru_cache(maxsize=64)
def _table(entry: Any, grid_size: int) -> Any:
    return CellTable(entry, grid_size)
