"""The beliefs of a batch: each row's distribution of its persons given the searches made.

A row's beliefs begin with its first search; until then they equal the forecast. The arithmetic
is that of `drift.belief` and agrees with the single environment bit for bit.

Rows are stored in tiles with the row as the last axis. The probabilities of moves differ from
row to row; in this layout each array operation works on contiguous memory. Tiles are updated
independently of each other, by several threads if they are large.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.drift.belief import drift, means_over_missing, normalise
from DroneSwarmSearch.vector.forecasts import Forecasts
from DroneSwarmSearch.vector.threads import run_in_parts

__all__ = ["Beliefs"]

_TILE_ROWS = 1024
"""The largest number of rows in a tile."""

_LEAST_ROWS = 64
"""The smallest number of rows in a tile, however much memory they need."""

_TILE_BYTES = 1600 * 2**10
"""The size of one person's beliefs in a tile: several such arrays fit into the cache."""

_LEAST_SHARED_BYTES = 2**20
"""Tiles smaller than this are updated by one thread."""

_BEGIN_ROWS = 256
"""The rows whose beliefs are initialised at a time, which limits scratch memory."""

_BUFFER_SIZE = 512
"""NumPy's buffer size, in elements, while beliefs drift. With its larger default NumPy copies
broadcast operands into buffers, which is slower."""

_PADDING = 16
"""Extra elements in each row of an array to be transposed. With rows a power of two apart,
the elements of a column would evict each other from the cache."""


class _Searches(NamedTuple):
    """The searches of a step that did not find one of the missing persons.

    Attributes:
        rows: the row of every search, in rising order.
        cells: the index of its cell in the flat beliefs.
        before: the probability of that cell before the search.
        searched: which rows were searched: bool, shape (all rows,).
    """

    rows: Ints
    cells: Ints
    before: Floats
    searched: Flags


class Beliefs:
    """The beliefs about every row's persons.

    Args:
        grid_size: cells along each side, N.
        detections: each person's probability of detection.
        rows: the number of rows.

    Attributes:
        begun: which rows have beliefs: bool, shape (rows,).
    """

    def __init__(self, grid_size: int, detections: Sequence[float], rows: int) -> None:
        self._size = grid_size
        self._detections = detections
        self._width = min(rows, _TILE_ROWS, max(_LEAST_ROWS, _TILE_BYTES // (8 * grid_size**2)))
        self._flat = np.zeros(len(detections) * grid_size**2 * rows)
        self.begun = np.zeros(rows, np.bool_)
        self._make_views()

    def _make_views(self) -> None:
        persons, size, rows = len(self._detections), self._size, len(self.begun)
        self._first = range(0, rows, self._width)  # each tile's first row
        ends = [*self._first[1:], rows]
        self._rows = [slice(*ends_of) for ends_of in zip(self._first, ends, strict=True)]
        # The index of each row's first cell in the flat beliefs, and the distance between cells.
        columns = np.arange(rows) % self._width
        self._origin = columns + persons * size**2 * (np.arange(rows) - columns)
        self._stride = np.minimum(self._width, rows - (np.arange(rows) - columns))
        # Each indexed [person, y, x, row of the tile].
        self._tiles = [
            part.reshape(persons, size, size, -1)
            for part in np.split(self._flat, [persons * size**2 * end for end in ends[:-1]])
        ]
        self._spare: list[tuple[Floats, Floats]] = []  # scratch arrays, one pair per thread

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the views, which would become arrays of their own in a copy."""
        views = ("_first", "_rows", "_origin", "_stride", "_tiles", "_spare")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._make_views()

    def forget(self, rows: Ints) -> None:
        """Drop the beliefs of rows that start an episode."""
        self.begun[rows] = False

    # A step.

    def update(
        self,
        rows: Ints,
        cells: Ints,
        missing: Flags,
        counted: Flags,
        forecasts: Forecasts,
        out: Singles | None,
        foreground: Callable[[], None],
    ) -> None:
        """Update the beliefs by a step, in the background of something else.

        Bayes' rule for the searches that found nobody, then drift, then write the matrices
        of all rows with beliefs. Some other rows of `out` receive arbitrary values.

        Args:
            rows: the row of every search, in rising order.
            cells: the cell of every search, y * N + x; different cells within a row.
            missing: the persons not found: bool, shape (persons, all rows).
            counted: the persons in the mean that a matrix shows, of the same shape.
            forecasts: the rows' forecasts; `foreground` must not advance them.
            out: float32, shape (all rows, N, N), or None.
            foreground: the rest of the step.
        """
        new = rows[~self.begun[rows]]
        if new.size:
            self._begin(np.unique(new), forecasts)
        by_person = [
            self._multiply(person, rows[still], cells[still])
            for person, still in enumerate(missing[:, rows])
        ]

        def update_tile(tile: int) -> None:
            if not self.begun[self._rows[tile]].any():
                return
            for person, searches in enumerate(by_person):
                self._normalise(tile, person, searches)
            self._drift(tile, forecasts)
            if out is not None:
                self._write(tile, counted, out)

        shares = len(self._tiles) > 1 and self._tiles[0][0].nbytes >= _LEAST_SHARED_BYTES
        run_in_parts(update_tile, range(len(self._tiles)), foreground, shares)

    def _begin(self, rows: Ints, forecasts: Forecasts) -> None:
        self.begun[rows] = True
        cells = np.arange(self._size**2)[:, None]
        for person in range(len(self._detections)):
            for first in range(0, len(rows), _BEGIN_ROWS):
                some = rows[first : first + _BEGIN_ROWS]
                x, y = forecasts.marginals(person, some)
                # As in the tiles, the row is the last axis.
                products = y.T[:, None] * x.T
                self._flat[self._index(person, some, cells).reshape(-1)] = products.reshape(-1)

    def _multiply(self, person: int, rows: Ints, cells: Ints) -> _Searches:
        """Multiply searched cells by the probability that the search misses the person."""
        index = self._index(person, rows, cells)
        before = self._flat.take(index)
        self._flat[index] = before * (1.0 - self._detections[person])
        searched = np.zeros(len(self.begun), np.bool_)
        searched[rows] = True
        return _Searches(rows, index, before, searched)

    def _index(self, person: int, rows: Ints, cells: Ints) -> Ints:
        """The index of some rows' cells in the flat beliefs; rows and cells are broadcast."""
        index: Ints = (cells + person * self._size**2) * self._stride.take(rows)
        index += self._origin.take(rows)
        return index

    def _normalise(self, tile: int, person: int, searches: _Searches) -> None:
        """Normalise the beliefs of a tile's searched rows."""
        rows = self._rows[tile]
        searched = searches.searched[rows]
        if not searched.any():
            return
        impossible = searched & (normalise(self._tiles[tile][person], searched) <= 0.0)
        if impossible.any():  # the searches contradict the belief: restore it
            first, last = np.searchsorted(searches.rows, [rows.start, rows.stop])
            undo = first + impossible[searches.rows[first:last] - rows.start].nonzero()[0]
            self._flat[searches.cells[undo]] = searches.before[undo]

    def _drift(self, tile: int, forecasts: Forecasts) -> None:
        """Drift the beliefs of a tile by a step; the forecasts are still at the step before."""
        beliefs = self._tiles[tile]
        try:
            spare = self._spare.pop()
        except IndexError:
            spare = np.empty(self._tiles[0][0].size), np.empty(self._tiles[0][0].size)
        higher, lower = (array[: beliefs[0].size].reshape(beliefs[0].shape) for array in spare)
        usual = np.getbufsize()
        try:
            np.setbufsize(_BUFFER_SIZE)
            for person, belief in enumerate(beliefs):
                right, left, down, up = forecasts.moves(person, self._rows[tile])
                drift(belief, (right, left), (down, up), (higher, lower), belief)
        finally:
            np.setbufsize(usual)
        self._spare.append(spare)

    # The matrices.

    def write_matrices(self, counted: Flags, out: Singles) -> None:
        """Write the matrices of all rows with beliefs; some others receive arbitrary values.

        Args:
            counted: the persons in the mean: bool, shape (persons, rows).
            out: float32, shape (rows, N, N).
        """
        for tile, rows in enumerate(self._rows):
            if self.begun[rows].any():
                self._write(tile, counted, out)

    def _write(self, tile: int, counted: Flags, out: Singles) -> None:
        """Write the matrices of a tile."""
        cells, rows = self._size**2, self._rows[tile]
        mean = means_over_missing(self._tiles[tile], counted[:, rows]).reshape(cells, -1)
        flat = out[rows].reshape(-1, cells)
        single = np.empty((cells, len(flat) + _PADDING), np.float32)[:, : len(flat)]
        single[...] = mean
        flat[...] = single.T

    def matrices(self, rows: Ints, counted: Flags) -> Singles:
        """The matrices of some rows with beliefs: float32, (n, N, N).

        Args:
            rows: their numbers, in rising order.
            counted: the persons in the mean: bool, shape (persons, n).
        """
        out = np.empty((len(rows), self._size, self._size), np.float32)
        for tile, here in self._parts(rows):
            beliefs = self._tiles[tile].take(rows[here] - self._first[tile], axis=-1)
            out[here] = np.moveaxis(means_over_missing(beliefs, counted[:, here]), -1, 0)
        return out

    def probabilities(self, rows: Ints, cells: Ints, counted: Flags) -> Singles:
        """The matrix entry of one cell in each of some rows, in rising order: float32, (n,)."""
        persons = range(len(self._detections))
        of_cells = np.stack([self._flat.take(self._index(k, rows, cells)) for k in persons])
        values: Singles = means_over_missing(of_cells, counted).astype(np.float32)
        return values

    def _parts(self, rows: Ints) -> Iterator[tuple[int, slice]]:
        """The tiles of some rows in rising order, and the slice of the rows in each."""
        ends = np.searchsorted(rows, [tile.stop for tile in self._rows]).tolist()
        for tile, here in enumerate(map(slice, [0, *ends], ends)):
            if here.start < here.stop:
                yield tile, here
