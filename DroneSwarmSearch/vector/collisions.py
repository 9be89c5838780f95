"""Which drones of a batch share a cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        cells: the number of cells of the grid.
    """

    def __init__(self, rows: int, drones: int, cells: int) -> None:
        self._arguments = rows, drones, cells
        if drones > _FEW:
            return
        # Narrow integers, with a run of memory for each drone: many are compared at once.
        narrow = np.int16 if cells <= 2**15 else np.int32
        self._by_drone = np.empty((drones, rows), narrow)
        self._alike = np.empty((drones * (drones - 1) // 2, rows), np.bool_)  # for each pair
        self._pairs = np.empty((2, len(self._alike)), np.int64)
        self._comparisons: list[tuple[NDArray[Any], ...]] = []  # views: two sides, result
        first = 0
        for apart in range(1, drones):
            here = slice(first, first + drones - apart)
            sides = self._by_drone[apart:], self._by_drone[:-apart]
            self._comparisons.append((*sides, self._alike[here]))
            self._pairs[:, here] = np.arange(apart, drones), np.arange(drones - apart)
            first = here.stop

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments  # nothing here outlives a call

    def __call__(self, targets: Ints) -> Ints:
        """The drones in whose cell another is after moving.

        Args:
            targets: where every drone tried to go, OFF_GRID out of the grid: shape
                (rows, drones).

        Returns:
            row * drones + drone for each of them, in no order and perhaps repeatedly.
        """
        return self._sorted(targets) if targets.shape[1] > _FEW else self._compared(targets)

    def _compared(self, targets: Ints) -> Ints:
        self._by_drone[...] = targets.astype(self._by_drone.dtype).T
        for ahead, behind, alike in self._comparisons:
            np.equal(ahead, behind, out=alike)
        together = self._alike.reshape(-1).nonzero()[0]
        if not together.size:
            return _NOBODY
        pair, row = np.divmod(together, len(targets))
        both: Ints = self._pairs.take(pair, axis=1) + row * targets.shape[1]
        inside = targets.take(both[0]) != OFF_GRID  # each tried to leave on its own
        named: Ints = both[:, inside].reshape(-1)
        return named

    def _sorted(self, targets: Ints) -> Ints:
        cells = np.sort(targets, axis=1)
        alike = (cells[:, 1:] == cells[:, :-1]) & (cells[:, 1:] != OFF_GRID)
        rows = np.logical_or.reduce(alike, axis=1).nonzero()[0]
        order = targets[rows].argsort(axis=1, kind="stable") + (rows * targets.shape[1])[:, None]
        alike = alike[rows]
        named: Ints = np.concatenate([order[:, 1:][alike], order[:, :-1][alike]])
        return named
