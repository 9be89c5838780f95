"""Which episode each row of a batch is in, and the keys of its random numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Ints, Words
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, stream_keys

__all__ = ["Episodes"]


class Episodes:
    """A counter for each random stream of each row: the stream's key plus the episode's number.

    A row is prepared once its counters stand at its next episode. The batch prepares all rows
    at a time, because an array call for one row costs as much as for hundreds.

    Args:
        rows: the number of rows.
    """

    def __init__(self, rows: int) -> None:
        self._counters = np.zeros((3, rows), np.uint64)  # drift, detection, sampling
        self._prepared = np.zeros(rows, np.bool_)
        self._seeded = np.zeros(rows, np.bool_)

    @property
    def seeded(self) -> Flags:
        """Which rows have begun an episode."""
        return self._seeded

    def prepared(self, rows: Ints) -> bool:
        """Whether all of these rows are prepared."""
        return int(np.count_nonzero(self._prepared.take(rows))) == len(rows)

    def prepare_all(self) -> tuple[Ints, Words]:
        """Prepare all rows that are not.

        Returns:
            Their numbers, and the keys of their next episodes for drift and detection,
            (2, n).
        """
        rows = (~self._prepared).nonzero()[0]
        counters = self._counters[:, rows] + GOLDEN
        self._counters[:, rows] = counters
        self._prepared[rows] = True
        return rows, mixed(counters[:2])

    def sampling_keys(self, rows: Ints) -> Words:
        """The sampling keys of the next episodes of some prepared rows."""
        return mixed(self._counters[2].take(rows))

    def reseeded(self, rows: Ints, seeds: Sequence[int | None] | None) -> Words:
        """The counters of the next episodes of some prepared rows, given new seeds: (3, n).

        Rows without a seed continue their sequence, or start one from system entropy.
        """
        counters: Words = self._counters[:, rows]
        for index, seed in enumerate([None] * len(rows) if seeds is None else seeds):
            if seed is not None or not self._seeded[rows[index]]:
                counters[:, index] = stream_keys(seed) + GOLDEN
        return counters

    def assign(self, rows: Ints, counters: Words) -> Words:
        """Set the counters of some rows; returns their keys for drift and detection."""
        self._counters[:, rows] = counters
        self._seeded[rows] = True
        return mixed(counters[:2])

    def begin(self, rows: Ints) -> None:
        """Note that some rows begin the episodes they are prepared for."""
        self._prepared[rows] = False

    def forget_prepared(self) -> None:
        """Put the counters of all rows back at their present episodes."""
        self._counters[:, self._prepared] -= GOLDEN
        self._prepared[...] = False
