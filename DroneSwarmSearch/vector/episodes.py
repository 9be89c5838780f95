"""Which episode each row of a batch is in, and the integers that its start sets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Ints, Words
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, stream_keys

__all__ = ["Episodes", "RowState"]


class Episodes:
    """A counter for each random stream of each row: the stream's key plus the episode's number.

    The key of an episode's sequence is the mixed counter, see `streams.mixed`.

    A row is prepared once its counters stand at its next episode. The batch prepares all rows
    at a time, because an array call for one row costs as much as for hundreds.

    Args:
        rows: the number of rows.
        streams: how many of the streams are used, in the order of `stream_keys`.

    Attributes:
        seeded: which rows have begun an episode: bool, (rows,).
    """

    def __init__(self, rows: int, streams: int) -> None:
        self._counters = np.zeros((streams, rows), np.uint64)
        self._prepared = np.zeros(rows, np.bool_)
        self.seeded: Flags = np.zeros(rows, np.bool_)

    def prepared(self, rows: Ints) -> bool:
        """Whether all of these rows are prepared."""
        return int(np.count_nonzero(self._prepared.take(rows))) == len(rows)

    def prepare_all(self) -> tuple[Ints, Words]:
        """Prepare all rows that are not.

        Returns:
            Their numbers, and the counters of their next episodes: uint64, (streams, n).
        """
        rows = (~self._prepared).nonzero()[0]
        counters = self._counters[:, rows] + GOLDEN
        self._counters[:, rows] = counters
        self._prepared[rows] = True
        return rows, counters

    def sampling_keys(self, rows: Ints) -> Words:
        """The sampling keys of the next episodes of some prepared rows."""
        return mixed(self._counters[2].take(rows))

    def reseeded(self, rows: Ints, seeds: Sequence[int | None] | None) -> Words:
        """The counters of some prepared rows' next episodes, given new seeds: (streams, n).

        Rows without a seed continue their sequence, or start one from system entropy.
        """
        counters: Words = self._counters[:, rows]
        for index, seed in enumerate([None] * len(rows) if seeds is None else seeds):
            if seed is not None or not self.seeded[rows[index]]:
                counters[:, index] = stream_keys(seed)[: len(counters)] + GOLDEN
        return counters

    def assign(self, rows: Ints, counters: Words) -> None:
        """Set the counters of some rows."""
        self._counters[:, rows] = counters
        self.seeded[rows] = True

    def begin(self, rows: Ints) -> None:
        """Note that some rows begin the episodes they are prepared for."""
        self._prepared[rows] = False

    def forget_prepared(self) -> None:
        """Put the counters of all rows back at their current episodes."""
        self._counters[:, self._prepared] -= GOLDEN
        self._prepared[...] = False


class RowState:
    """The integers of every row that the start of an episode sets.

    They are one array, so that one assignment starts an episode and one addition makes a step.

    Args:
        persons: the persons in each row.
        rows: the number of rows.

    Attributes:
        all: int64, (9 persons + 3, rows). The other attributes are views of it.
        coordinates: each person's x and y: int64, (persons, 2, rows).
        x: the first of these: int64, (persons, rows).
        y: the second of these.
        cells: y * N + x: int64, (persons, rows).
        missing: 1 for persons who have not been found, else 0: int64, (persons, rows).
        detection_keys: the key of the episode's detections: uint64, (rows,).
        situation: the number of the situation; 0 without a catalogue: int64, (rows,).
        counters: all integers that grow by a constant in every step, which are:
        step: completed steps: int64, (rows,).
        draws: counters of the next drift draws: uint64, (2 persons, rows).
        pointers: the pointers of the forecasts: int64, (3 persons, rows).
    """

    def __init__(self, persons: int, rows: int) -> None:
        self._persons = persons
        self.all = np.zeros((9 * persons + 3, rows), np.int64)
        self._make_views()

    def _make_views(self) -> None:
        n = self._persons
        coordinates, self.cells, self.missing, keys, situation, self.counters = np.split(
            self.all, (2 * n, 3 * n, 4 * n, 4 * n + 1, 4 * n + 2)
        )
        self.coordinates: Ints = coordinates.reshape(n, 2, -1)
        self.x, self.y = self.coordinates[:, 0], self.coordinates[:, 1]
        self.detection_keys: Words = keys[0].view(np.uint64)
        self.situation: Ints = situation[0]
        self.step: Ints = self.counters[0]
        self.draws: Words = self.counters[1 : 2 * n + 1].view(np.uint64)
        self.pointers: Ints = self.counters[2 * n + 1 :]

    def __getstate__(self) -> tuple[int, Ints]:
        return self._persons, self.all  # views would become separate arrays in a copy

    def __setstate__(self, state: tuple[int, Ints]) -> None:
        self._persons, self.all = state
        self._make_views()
