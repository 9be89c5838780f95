"""The beliefs of a batch: what each row knows of its persons once it has searched.

A row's beliefs begin with its first search; until then the forecast says all there is to know.
The arithmetic is `belief`'s, and agrees with the single environment to the last bit.

Rows lie in tiles with the row as the last axis: the factors by which a belief drifts
differ from row to row, and this way they apply to runs of memory, not to single numbers.
Tiles go on independently, where there are several in as many threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import drift, normalise
from DroneSwarmSearch.vector.forecasts import Forecasts
from DroneSwarmSearch.vector.threads import run_in_parts

__all__ = ["Beliefs"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]

_TILE_ROWS = 1024
"""The most rows in a tile."""

_LEAST_ROWS = 64
"""Fewer rows than these are not worth a tile, whatever they take."""

_TILE_BYTES = 1600 * 2**10
"""The most that a person's beliefs in a tile take: several such arrays fit a cache, and
runs of memory are long."""

_LEAST_SHARED_BYTES = 2**20
"""If a person's beliefs in a tile take less, it is not worth another thread."""

_BEGUN_AT_ONCE = 256
"""For so many rows memory is taken when their beliefs begin."""

_BUFFERED = 512
"""Elements of NumPy's buffers while beliefs drift. What is broadcast NumPy copies into its
buffers if it fits: with small ones it is read where it lies, which is faster."""

_APART = 16
"""Numbers between the rows of what is transposed. Where rows lie a power of two apart, their
numbers for one search would drive each other out of the cache."""


class _Searches(NamedTuple):
    """The searches of a step for one person, who is still missing.

    Attributes:
        rows: the row of every search, in rising order.
        at: the place of its cell among all beliefs.
        before: what was believed of that cell.
        searched: which rows have been searched: bool, (rows of the batch,).
    """

    rows: Ints
    at: Ints
    before: Floats
    searched: Flags


class Beliefs:
    """What is known of every row's persons.

    Args:
        grid_size: cells along each side, N.
        detections: every person's probability of detection.
        rows: the number of rows.

    Attributes:
        begun: which rows have beliefs, bool, shape (rows,).
    """

    def __init__(self, grid_size: int, detections: Sequence[float], rows: int) -> None:
        self._size = grid_size
        self._detections = detections
        self._width = min(rows, _TILE_ROWS, max(_LEAST_ROWS, _TILE_BYTES // (8 * grid_size**2)))
        self._flat = np.zeros(len(detections) * grid_size**2 * rows)
        self.begun = np.zeros(rows, np.bool_)
        self._see()

    def _see(self) -> None:
        """Make the views of the beliefs."""
        persons, size, rows = len(self._detections), self._size, len(self.begun)
        self._first = range(0, rows, self._width)  # of each tile's rows
        ends = [*self._first[1:], rows]
        self._rows = [slice(*ends_of) for ends_of in zip(self._first, ends, strict=True)]
        # Where among all beliefs a row's are: of its first cell, and how far apart from there on.
        columns = np.arange(rows) % self._width
        self._origin = columns + persons * size**2 * (np.arange(rows) - columns)
        self._stride = np.minimum(self._width, rows - (np.arange(rows) - columns))
        # [person, y, x, row of the tile]
        self._tiles = [
            part.reshape(persons, size, size, -1)
            for part in np.split(self._flat, [persons * size**2 * end for end in ends[:-1]])
        ]
        # For each thread that lets beliefs drift two arrays to work in.
        self._spare: list[tuple[Floats, Floats]] = []

    def __getstate__(self) -> dict[str, Any]:
        """Views would be arrays of their own in a copy."""
        views = ("_first", "_rows", "_origin", "_stride", "_tiles", "_spare")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._see()

    def forget(self, rows: Ints) -> None:
        """Some rows have begun anew."""
        self.begun[rows] = False

    # A step.

    def go_on(
        self,
        rows: Ints,
        cells: Ints,
        missing: Flags,
        shown: Flags,
        forecasts: Forecasts,
        out: Singles | None,
        meanwhile: Callable[[], None],
    ) -> None:
        """Let the beliefs go on by a step, beside something else.

        They take in that searches have not found those still missing; the persons drift;
        then the matrices of all rows that have beliefs are written, and something to some
        other rows.

        Args:
            rows: the row of every search, in rising order.
            cells: the cell of every search, y * N + x; in a row no two are alike.
            missing: the persons not found, bool, shape (persons, rows of the batch).
            shown: the persons over which a matrix is the mean, likewise.
            forecasts: of the rows; `meanwhile` must leave them at the step of the search.
            out: float32, shape (rows of the batch, N, N); None: no matrices are written.
            meanwhile: the rest of the step.
        """
        new = rows[~self.begun[rows]]
        if new.size:
            self._begin(np.unique(new), forecasts)
        by_person = [
            self._take_in(person, rows[still], cells[still])
            for person, still in enumerate(missing[:, rows])
        ]

        def go_on_in(tile: int) -> None:
            if not self.begun[self._rows[tile]].any():
                return
            for person, searches in enumerate(by_person):
                self._normalise(tile, person, searches)
            self._drift(tile, forecasts)
            if out is not None:
                self._write(tile, shown, out)

        shares = len(self._tiles) > 1 and self._tiles[0][0].nbytes >= _LEAST_SHARED_BYTES
        run_in_parts(go_on_in, range(len(self._tiles)), meanwhile, shares)

    def _begin(self, rows: Ints, forecasts: Forecasts) -> None:
        self.begun[rows] = True
        cells = np.arange(self._size**2)[:, None]
        for person in range(len(self._detections)):
            for first in range(0, len(rows), _BEGUN_AT_ONCE):
                some = rows[first : first + _BEGUN_AT_ONCE]
                x, y = forecasts.marginals(person, some)
                # In the order of tiles: cells first, for which rows lie side by side.
                products = y.T[:, None] * x.T
                self._flat[self._places(person, some, cells).reshape(-1)] = products.reshape(-1)

    def _take_in(self, person: int, rows: Ints, cells: Ints) -> _Searches:
        """Lower what is believed of cells searched; what the beliefs sum to is lower, too."""
        at = self._places(person, rows, cells)
        before = self._flat.take(at)
        self._flat[at] = before * (1.0 - self._detections[person])
        searched = np.zeros(len(self.begun), np.bool_)
        searched[rows] = True
        return _Searches(rows, at, before, searched)

    def _places(self, person: int, rows: Ints, cells: Ints) -> Ints:
        """Where among all beliefs those of some rows about a person and some cells are.

        Rows and cells are broadcast.
        """
        places: Ints = (cells + person * self._size**2) * self._stride.take(rows)
        places += self._origin.take(rows)
        return places

    def _normalise(self, tile: int, person: int, searches: _Searches) -> None:
        """Let beliefs sum to 1 again that have taken in searches."""
        rows = self._rows[tile]
        searched = searches.searched[rows]
        if not searched.any():
            return
        impossible = searched & (normalise(self._tiles[tile][person], searched) <= 0.0)
        if impossible.any():  # the searches contradict the belief, which stays
            first, last = np.searchsorted(searches.rows, [rows.start, rows.stop])
            undo = first + impossible[searches.rows[first:last] - rows.start].nonzero()[0]
            self._flat[searches.at[undo]] = searches.before[undo]

    def _drift(self, tile: int, forecasts: Forecasts) -> None:
        """Let the persons of a tile drift by a step; the forecasts are still at the step before."""
        beliefs = self._tiles[tile]
        try:
            spare = self._spare.pop()
        except IndexError:
            spare = np.empty(self._tiles[0][0].size), np.empty(self._tiles[0][0].size)
        higher, lower = (array[: beliefs[0].size].reshape(beliefs[0].shape) for array in spare)
        usual = np.getbufsize()
        try:
            np.setbufsize(_BUFFERED)
            for person, belief in enumerate(beliefs):
                right, left, down, up = forecasts.moves(person, self._rows[tile])
                drift(belief, (right, left), (down, up), (higher, lower), belief)
        finally:
            np.setbufsize(usual)
        self._spare.append(spare)

    # What is known.

    def write_matrices(self, shown: Flags, out: Singles) -> None:
        """Write the matrices of all rows that have beliefs, and something to some other rows.

        Args:
            shown: the persons over which the mean is taken, bool, shape (persons, rows).
            out: float32, shape (rows, N, N).
        """
        for tile, rows in enumerate(self._rows):
            if self.begun[rows].any():
                self._write(tile, shown, out)

    def _write(self, tile: int, shown: Flags, out: Singles) -> None:
        """Write the matrices of a tile."""
        cells, rows = self._size**2, self._rows[tile]
        mean = self._mean(self._tiles[tile], shown[:, rows]).reshape(cells, -1)
        flat = out[rows].reshape(-1, cells)
        single = np.empty((cells, len(flat) + _APART), np.float32)[:, : len(flat)]
        single[...] = mean
        flat[...] = single.T

    def matrices(self, rows: Ints, shown: Flags) -> Singles:
        """The matrices of some rows that have beliefs: float32, (n, N, N).

        Args:
            rows: their numbers, in rising order.
            shown: the persons over which the mean is taken, bool, shape (persons, n).
        """
        out = np.empty((len(rows), self._size, self._size), np.float32)
        for tile, here in self._parts(rows):
            beliefs = self._tiles[tile].take(rows[here] - self._first[tile], axis=-1)
            out[here] = np.moveaxis(self._mean(beliefs, shown[:, here]), -1, 0)
        return out

    def shown(self, rows: Ints, cells: Ints, shown: Flags) -> Singles:
        """What the matrices of some rows, in rising order, say of a cell of each: float32, (n,)."""
        places = (self._places(person, rows, cells) for person in range(len(self._detections)))
        of_cells = np.stack([self._flat.take(at) for at in places])
        values: Singles = self._mean(of_cells, shown).astype(np.float32)
        return values

    def _parts(self, rows: Ints) -> Iterator[tuple[int, slice]]:
        """The tiles in which rows in rising order lie, and for each the part of the rows."""
        ends = np.searchsorted(rows, [tile.stop for tile in self._rows]).tolist()
        for tile, here in enumerate(map(slice, [0, *ends], ends)):
            if here.start < here.stop:
                yield tile, here

    @staticmethod
    def _mean(beliefs: Floats, shown: Flags) -> Floats:
        """The mean over the persons shown: beliefs of shape (persons, ..., n) and (persons, n)."""
        mean: Floats = beliefs[0]
        if len(beliefs) > 1:
            total = np.zeros(mean.shape)
            for belief, counts in zip(beliefs, shown, strict=True):
                np.add(total, belief, out=total, where=counts)
            mean = total / shown.sum(axis=0)
        return mean
