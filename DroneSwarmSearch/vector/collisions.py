"""Which drones of a batch share a cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from DroneSwarmSearch.rules import OFF_GRID

__all__ = ["Collisions"]

Ints = NDArray[np.int64]

_FEW = 32
"""Up to so many drones comparing every two of them is faster than sorting their cells."""

_NOBODY: Ints = np.empty(0, np.int64)


class Collisions:
    """Finds the drones that have collided, as `rules.same_cell` says, in many searches.

    Args:
        rows: the number of searches.
        drones: the drones in each.
        dtype: the type of integer that holds a cell.
    """

    def __init__(self, rows: int, drones: int, dtype: DTypeLike) -> None:
        self._arguments = rows, drones, dtype
        if drones > _FEW:
            return
        # With a run of memory for each drone many cells are compared at once.
        self._by_drone = np.empty((drones, rows), dtype)
        self._alike = np.empty((drones * (drones - 1) // 2, rows), np.bool_)  # for each pair
        pairs = np.empty((2, len(self._alike)), np.int64)
        self._comparisons: list[tuple[NDArray[Any], ...]] = []  # views: two sides, result
        first = 0
        for apart in range(1, drones):
            here = slice(first, first + drones - apart)
            sides = self._by_drone[apart:], self._by_drone[:-apart]
            self._comparisons.append((*sides, self._alike[here]))
            pairs[:, here] = np.arange(apart, drones), np.arange(drones - apart)
            first = here.stop
        # What is to be added to `drones` times a place in `_alike` for the pair's two drones.
        self._offsets = pairs - np.arange(pairs.shape[1]) * (rows * drones)
        # Numbers as arrays without axes, with which small arrays calculate faster.
        self._rows, self._drones = np.array(rows), np.array(drones)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments  # nothing here outlives a call

    def __call__(self, targets: NDArray[Any]) -> Ints:
        """The drones in whose cell another is after moving.

        Args:
            targets: where every drone tried to go, OFF_GRID out of the grid: shape
                (rows, drones).

        Returns:
            row * drones + drone for each of them, in no order and perhaps repeatedly.
        """
        return self._sorted(targets) if targets.shape[1] > _FEW else self._compared(targets)

    def _compared(self, targets: NDArray[Any]) -> Ints:
        self._by_drone[...] = targets.T
        for ahead, behind, alike in self._comparisons:
            np.equal(ahead, behind, out=alike)
        together = self._alike.reshape(-1).nonzero()[0]
        if not together.size:
            return _NOBODY
        both: Ints = self._offsets.take(np.floor_divide(together, self._rows), axis=1)
        both += np.multiply(together, self._drones)
        cells = targets.take(both[0])
        if np.minimum.reduce(cells) == OFF_GRID:  # each tried to leave on its own
            both = both[:, cells != OFF_GRID]
        return both.reshape(-1)

    def _sorted(self, targets: NDArray[Any]) -> Ints:
        cells = np.sort(targets, axis=1)
        alike = (cells[:, 1:] == cells[:, :-1]) & (cells[:, 1:] != OFF_GRID)
        rows = np.logical_or.reduce(alike, axis=1).nonzero()[0]
        order = targets[rows].argsort(axis=1, kind="stable") + (rows * targets.shape[1])[:, None]
        alike = alike[rows]
        named: Ints = np.concatenate([order[:, 1:][alike], order[:, :-1][alike]])
        return named
