"""The beliefs of a batch: what each row knows of its persons once it has searched.

A row's beliefs begin with its first search; until then the law says all there is to know.
The arithmetic is `belief`'s, and agrees with the single environment to the last bit.

Rows lie in tiles with the row as the last axis: the factors by which a belief drifts
differ from row to row, and this way they apply to runs of memory, not to single numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.belief import drift, normalise
from DroneSwarmSearch.vector.laws import Laws

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

_BUFFERED = 512
"""Elements of NumPy's buffers while beliefs drift. What is broadcast NumPy copies into its
buffers if it fits: with small ones it is read where it lies, which is faster."""

_STRIP_BYTES = 2**17
"""Of a tile's matrices this much is transposed at a time."""

_APART = 16
"""Numbers between the rows of what is transposed. Where rows lie a power of two apart, their
numbers for one search would drive each other out of the cache."""


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
        width = min(rows, _TILE_ROWS, max(_LEAST_ROWS, _TILE_BYTES // (8 * grid_size**2)))
        self._first = range(0, rows, width)  # of each tile's rows
        ends = [*self._first[1:], rows]
        self._rows = [slice(*ends_of) for ends_of in zip(self._first, ends, strict=True)]
        # [person, y, x, row of the tile]
        shape = (len(detections), grid_size, grid_size)
        self._tiles = [np.zeros((*shape, tile.stop - tile.start)) for tile in self._rows]
        self._spare = {tile.shape: (tile[0].copy(), tile[0].copy()) for tile in self._tiles}
        self.begun = np.zeros(rows, np.bool_)

    def forget(self, rows: Ints) -> None:
        """Some rows have begun anew."""
        self.begun[rows] = False

    def learn(self, rows: Ints, cells: Ints, missing: Flags, laws: Laws) -> None:
        """Take in that searches have not found those still missing.

        Args:
            rows: the row of every search, in rising order.
            cells: the cell of every search, y * N + x; in a row no two are alike.
            missing: the persons not found, shape (persons, rows of the batch).
            laws: of the rows, at the step of the search.
        """
        if not rows.size:
            return
        new = rows[~self.begun[rows]]
        if new.size:
            self._begin(np.unique(new), laws)
        for tile, here in self._parts(rows):
            columns = rows[here] - self._first[tile]
            for person, detection in enumerate(self._detections):
                still = missing[person, rows[here]]
                belief, searched = self._tiles[tile][person], columns[still]
                at = self._places(cells[here][still], searched, belief)
                self._learn(belief, at, searched, 1.0 - detection)

    @staticmethod
    def _learn(belief: Floats, at: Ints, columns: Ints, kept: float) -> None:
        """Take in searches for one person.

        Args:
            belief: about the person, a part of a tile.
            at: the places in it of the cells searched.
            columns: their columns in it.
            kept: what is left of a searched cell's probability.
        """
        flat = belief.reshape(-1)
        before = flat.take(at)
        flat[at] = before * kept
        searched = np.zeros(belief.shape[-1], np.bool_)
        searched[columns] = True
        impossible = searched & (normalise(belief, searched) <= 0.0)
        if impossible.any():  # the searches contradict the belief, which stays
            undo = impossible[columns]
            flat[at[undo]] = before[undo]

    @staticmethod
    def _places(cells: Ints, columns: Ints, belief: Floats) -> Ints:
        """Where in the flat belief of a tile's person some cells of some columns stand."""
        at: Ints = cells * belief.shape[-1] + columns
        return at

    def _begin(self, rows: Ints, laws: Laws) -> None:
        self.begun[rows] = True
        for person in range(len(self._detections)):
            x, y = laws.marginals(person, rows)
            products = (y[:, :, None] * x[:, None, :]).reshape(len(rows), -1)
            for tile, here in self._parts(rows):
                belief = self._tiles[tile][person].reshape(self._size**2, -1)
                columns = rows[here] - self._first[tile]
                for column, product in zip(columns.tolist(), products[here], strict=True):
                    belief[:, column] = product

    def _parts(self, rows: Ints) -> Iterator[tuple[int, slice]]:
        """The tiles in which rows in rising order lie, and for each the part of the rows."""
        ends = np.searchsorted(rows, [tile.stop for tile in self._rows]).tolist()
        for tile, here in enumerate(map(slice, [0, *ends], ends)):
            if here.start < here.stop:
                yield tile, here

    def drift(self, laws: Laws) -> None:
        """Let the persons drift by a step; the laws are still at the step before."""
        usual = np.setbufsize(_BUFFERED)
        try:
            for tile, rows in zip(self._tiles, self._rows, strict=True):
                if self.begun[rows].any():
                    for person, belief in enumerate(tile):
                        right, left, down, up = laws.moves(person, rows)
                        drift(belief, (right, left), (down, up), self._spare[tile.shape], belief)
        finally:
            np.setbufsize(usual)

    def write_matrices(self, shown: Flags, out: Singles) -> None:
        """Write the matrices of all rows that have beliefs, and something to other rows.

        Args:
            shown: the persons over which the mean is taken, bool, shape (persons, rows).
            out: float32, shape (rows, N, N).
        """
        cells = self._size**2
        for tile, rows in zip(self._tiles, self._rows, strict=True):
            if self.begun[rows].any():
                mean = self._mean(tile, shown[:, rows]).reshape(cells, -1)
                flat = out[rows].reshape(-1, cells)
                strip = max(1, _STRIP_BYTES // (4 * len(flat)))
                single = np.empty((strip, len(flat) + _APART), np.float32)[:, : len(flat)]
                for first in range(0, cells, strip):
                    here = slice(first, first + strip)
                    part = single[: cells - first]
                    part[...] = mean[here]
                    flat[:, here] = part.T

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
        out = np.empty(len(rows), np.float32)
        for tile, here in self._parts(rows):
            beliefs = self._tiles[tile]
            at = self._places(cells[here], rows[here] - self._first[tile], beliefs)
            of_cells = beliefs.reshape(len(beliefs), -1).take(at, axis=1)
            out[here] = self._mean(of_cells, shown[:, here])
        return out

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
