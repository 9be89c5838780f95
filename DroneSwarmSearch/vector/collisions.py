"""Collisions of the drones in many searches: the array form of `rules.same_cell`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from DroneSwarmSearch.rules import OFF_GRID
from DroneSwarmSearch.vector.arrays import Ints

__all__ = ["Collisions"]

_FEW = 32
"""Up to this many drones, comparing all pairs is faster than sorting the cells."""

_NO_DRONES: Ints = np.empty(0, np.int64)


class Collisions:
    """Finds the drones that collided.

    Args:
        rows: the number of searches.
        drones: the drones in each.
        dtype: the integer type of the cells.
    """

    def __init__(self, rows: int, drones: int, dtype: DTypeLike) -> None:
        self._arguments = rows, drones, dtype
        if drones > _FEW:
            return
        # With the drones as the first axis, one call compares a pair in all rows.
        self._by_drone = np.empty((drones, rows), dtype)
        self._equal = np.empty((drones * (drones - 1) // 2, rows), np.bool_)  # for each pair
        pairs = np.empty((2, len(self._equal)), np.int64)
        self._comparisons: list[tuple[NDArray[Any], ...]] = []  # views: both sides, result
        first = 0
        for apart in range(1, drones):
            here = slice(first, first + drones - apart)
            sides = self._by_drone[apart:], self._by_drone[:-apart]
            self._comparisons.append((*sides, self._equal[here]))
            pairs[:, here] = np.arange(apart, drones), np.arange(drones - apart)
            first = here.stop
        # `drones` times an index into `_equal`, plus these, gives the numbers of the pair.
        self._offsets = pairs - np.arange(pairs.shape[1]) * (rows * drones)
        # NumPy calculates faster with 0-d arrays than with Python numbers.
        self._rows, self._drones = np.array(rows), np.array(drones)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments  # no state outlives a call

    def __call__(self, targets: NDArray[Any]) -> Ints:
        """Return the drones that share a cell with another drone after moving.

        Args:
            targets: the cell that each drone tried to enter, or OFF_GRID: shape
                (rows, drones).

        Returns:
            row * drones + drone for each of them; unordered, possibly with repetitions.
        """
        if targets.shape[1] == 1:
            return _NO_DRONES
        return self._sorted(targets) if targets.shape[1] > _FEW else self._compared(targets)

    def _compared(self, targets: NDArray[Any]) -> Ints:
        self._by_drone[...] = targets.T
        for one, other, equal in self._comparisons:
            np.equal(one, other, out=equal)
        together = self._equal.reshape(-1).nonzero()[0]
        if not together.size:
            return _NO_DRONES
        both: Ints = self._offsets.take(np.floor_divide(together, self._rows), axis=1)
        both += np.multiply(together, self._drones)
        cells = targets.take(both[0])
        if np.minimum.reduce(cells) == OFF_GRID:  # drones off the grid do not collide
            both = both[:, cells != OFF_GRID]
        return both.reshape(-1)

    def _sorted(self, targets: NDArray[Any]) -> Ints:
        cells = np.sort(targets, axis=1)
        equal = (cells[:, 1:] == cells[:, :-1]) & (cells[:, 1:] != OFF_GRID)
        rows = np.logical_or.reduce(equal, axis=1).nonzero()[0]
        order = targets[rows].argsort(axis=1, kind="stable") + (rows * targets.shape[1])[:, None]
        equal = equal[rows]
        drones: Ints = np.concatenate([order[:, 1:][equal], order[:, :-1][equal]])
        return drones
