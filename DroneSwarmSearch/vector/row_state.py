"""The integers of every row that the start of an episode sets, in one array."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch.vector.arrays import Ints, Words

__all__ = ["RowState"]


class RowState:
    """One array, so that one assignment starts an episode and one addition makes a step.

    Args:
        persons: the persons in each row.
        pointers: the pointers that the forecasts keep for each row.
        rows: the number of rows.

    Attributes:
        all: int64, (6 persons + 2 + pointers, rows). The other attributes are views of it.
        coordinates: each person's x and y: int64, (persons, 2, rows).
        x: the first of these: int64, (persons, rows).
        y: the second of these.
        cells: y * N + x: int64, (persons, rows).
        missing: 1 for persons who have not been found, else 0: int64, (persons, rows).
        detection_keys: the key of the episode's detections: uint64, (rows,).
        counters: all integers that grow by a constant in every step, which are:
        step: completed steps: int64, (rows,).
        draws: counters of the next drift draws: uint64, (2 persons, rows).
        pointers: the pointers of the forecasts: int64, (pointers, rows).
    """

    def __init__(self, persons: int, pointers: int, rows: int) -> None:
        self._persons = persons
        self.all = np.zeros((6 * persons + 2 + pointers, rows), np.int64)
        self._make_views()

    def _make_views(self) -> None:
        n = self._persons
        coordinates, self.cells, self.missing, keys, self.counters = np.split(
            self.all, (2 * n, 3 * n, 4 * n, 4 * n + 1)
        )
        self.coordinates: Ints = coordinates.reshape(n, 2, -1)
        self.x, self.y = self.coordinates[:, 0], self.coordinates[:, 1]
        self.detection_keys: Words = keys[0].view(np.uint64)
        self.step: Ints = self.counters[0]
        self.draws: Words = self.counters[1 : 2 * n + 1].view(np.uint64)
        self.pointers: Ints = self.counters[2 * n + 1 :]

    def with_pointers(self, pointers: int) -> RowState:
        """A copy with room for another number of pointers."""
        other = RowState(self._persons, pointers, self.all.shape[1])
        kept = len(self.all) - len(self.pointers)
        other.all[:kept] = self.all[:kept]
        return other

    def __getstate__(self) -> tuple[int, Ints]:
        return self._persons, self.all  # views would become arrays of their own in a copy

    def __setstate__(self, state: tuple[int, Ints]) -> None:
        self._persons, self.all = state
        self._make_views()
