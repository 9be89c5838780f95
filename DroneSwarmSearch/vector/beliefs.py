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

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Rows, Singles
from DroneSwarmSearch.drift.belief import (
    drift,
    means_over_missing,
    normalise,
    over_hypotheses,
)
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
    """The searches of a step for one person, who may have been found.

    Attributes:
        rows: the row of every search, in ascending order.
        cells: the index of its cell in the flat beliefs: shape (M, n).
        before: the probabilities of that cell before the search, of the same shape.
        searched: which rows were searched: bool, shape (all rows,).
    """

    rows: Ints
    cells: Ints
    before: Floats
    searched: Flags


class Beliefs:
    """The beliefs about every row's persons.

    Every person's belief is that of a person who has not been found, even after the find.
    A step is `begin` and `search`, if there are searches, and then `drift`.

    Args:
        grid_size: cells along each side, N.
        persons: the number of persons.
        hypotheses: the hypotheses about each, M.
        rows: the number of rows.

    Attributes:
        begun: which rows have beliefs: bool, shape (rows,).
        kept: the probability that no search so far finds the person: float64, shape
            (persons, rows).
    """

    def __init__(self, grid_size: int, persons: int, hypotheses: int, rows: int) -> None:
        self._size = grid_size
        self._persons, self._hypotheses = persons, hypotheses
        cells = hypotheses * grid_size**2
        self._width = min(rows, _TILE_ROWS, max(_LEAST_ROWS, _TILE_BYTES // (8 * cells)))
        self._flat = np.zeros(persons * cells * rows)
        self.begun = np.zeros(rows, np.bool_)
        self.kept = np.ones((persons, rows))
        self._searches: list[_Searches] = []  # that `_normalise` has yet to complete
        self._make_views()

    def _make_views(self) -> None:
        persons, size, rows = self._persons, self._size, len(self.begun)
        cells = self._hypotheses * size**2
        self._first = range(0, rows, self._width)  # each tile's first row
        ends = [*self._first[1:], rows]
        self._rows = [slice(*ends_of) for ends_of in zip(self._first, ends, strict=True)]
        # The index of each row's first cell in the flat beliefs, and the distance between cells.
        columns = np.arange(rows) % self._width
        self._origin = columns + persons * cells * (np.arange(rows) - columns)
        self._stride = np.minimum(self._width, rows - (np.arange(rows) - columns))
        # Each indexed [person, hypothesis, y, x, row of the tile].
        self._tiles = [
            part.reshape(persons, self._hypotheses, size, size, -1)
            for part in np.split(self._flat, [persons * cells * end for end in ends[:-1]])
        ]
        self._spare: list[tuple[Floats, Floats]] = []  # scratch arrays, one pair per thread

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the views, which would become separate arrays in a copy."""
        views = ("_first", "_rows", "_origin", "_stride", "_tiles", "_spare")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._make_views()

    def forget(self, rows: Ints) -> None:
        """Drop the beliefs of rows that start an episode."""
        self.begun[rows] = False
        self.kept[:, rows] = 1.0

    # A step.

    def begin(self, rows: Ints, forecasts: Forecasts) -> None:
        """Set the beliefs of those of some rows that have none to the forecasts.

        Args:
            rows: their numbers, in ascending order, possibly with repetitions.
            forecasts: the rows' forecasts.
        """
        new = rows[~self.begun[rows]]
        if not new.size:
            return
        new = np.unique(new)
        cells = np.arange(self._hypotheses * self._size**2)[:, None]
        for person in range(self._persons):
            for first in range(0, len(new), _BEGIN_ROWS):
                some = new[first : first + _BEGIN_ROWS]
                # As in the tiles, the row is the last axis.
                joint = forecasts.joint(person, some)
                self._flat[self._index(person, some, cells).reshape(-1)] = joint.reshape(-1)
        self.begun[new] = True

    def search(self, rows: Ints, cells: Ints, detections: Sequence[float | Floats]) -> None:
        """Apply searches that find nobody, except for the normalisation.

        Args:
            rows: the row of every search, in ascending order; all of them have beliefs.
            cells: the cell of every search, y * N + x; different cells within a row.
            detections: each person's probability of detection: a number, or one for each
                search.
        """
        searched = np.zeros(len(self.begun), np.bool_)
        searched[rows] = True
        self._searches = []
        for person, detection in enumerate(detections):
            index = self._indices(person, rows, cells)
            before = self._flat.take(index)
            self._flat[index] = before * (1.0 - detection)
            self._searches.append(_Searches(rows, index, before, searched))

    def normalise(self) -> None:
        """Normalise the searched beliefs now, and not in `drift`: `kept` is up to date then."""
        for tile in range(len(self._tiles)):
            self._normalise(tile)
        self._searches = []

    def drift(
        self,
        forecasts: Forecasts,
        counted: Flags,
        out: Singles | None,
        foreground: Callable[[], None],
    ) -> None:
        """Let the beliefs drift by a step, in the background of something else.

        Normalise the searched beliefs, let all drift, then write the matrices of all rows with
        beliefs. Some other rows of `out` receive arbitrary values.

        Args:
            forecasts: the rows' forecasts; `foreground` must not advance them.
            counted: the persons in the mean that a matrix shows: bool, (persons, all rows).
            out: float32, shape (all rows, N, N), or None.
            foreground: the rest of the step.
        """

        def update_tile(tile: int) -> None:
            if not self.begun[self._rows[tile]].any():
                return
            self._normalise(tile)
            self._drift(tile, forecasts)
            if out is not None:
                self._write(tile, counted, out)

        shares = len(self._tiles) > 1 and self._tiles[0][0].nbytes >= _LEAST_SHARED_BYTES
        run_in_parts(update_tile, range(len(self._tiles)), foreground, shares)
        self._searches = []

    def _index(self, person: int, rows: Ints, cells: Ints) -> Ints:
        """The index of some rows' cells in the flat beliefs; rows and cells are broadcast.

        Args:
            person: the person's number.
            rows: the rows.
            cells: the hypothesis times N², plus the cell.
        """
        cells_before = person * self._hypotheses * self._size**2
        index: Ints = (cells + cells_before) * self._stride.take(rows)
        index += self._origin.take(rows)
        return index

    def _indices(self, person: int, rows: Ints, cells: Ints) -> Ints:
        """The indices of one cell of each row under every hypothesis: (M, n)."""
        if self._hypotheses == 1:
            return self._index(person, rows, cells)[None]
        first = np.arange(self._hypotheses)[:, None] * self._size**2
        return self._index(person, rows, first + cells)

    def _normalise(self, tile: int) -> None:
        """Normalise the beliefs of a tile's searched rows."""
        rows = self._rows[tile]
        for person, searches in enumerate(self._searches):
            searched = searches.searched[rows]
            if not searched.any():
                return
            total = normalise(self._tiles[tile][person], searched)
            possible = total > 0.0
            # Rounding must not lower the probability of success.
            missed = np.minimum(total, 1.0) * possible
            self.kept[person, rows] *= np.where(searched, missed, 1.0)
            impossible = searched & ~possible
            if impossible.any():  # the searches contradict the belief: restore it
                first, last = np.searchsorted(searches.rows, [rows.start, rows.stop])
                undo = first + impossible[searches.rows[first:last] - rows.start].nonzero()[0]
                self._flat[searches.cells[:, undo]] = searches.before[:, undo]

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
        beliefs = [*map(over_hypotheses, self._tiles[tile])]
        mean = means_over_missing(beliefs, counted[:, rows]).reshape(cells, -1)
        flat = out[rows].reshape(-1, cells)
        single = np.empty((cells, len(flat) + _PADDING), np.float32)[:, : len(flat)]
        single[...] = mean
        flat[...] = single.T

    def matrices(self, rows: Ints, counted: Flags) -> Singles:
        """The matrices of some rows with beliefs: float32, (n, N, N).

        Args:
            rows: their numbers, in ascending order.
            counted: the persons in the mean: bool, shape (persons, n).
        """
        out = np.empty((len(rows), self._size, self._size), np.float32)
        for tile, here in self._parts(rows):
            columns = self._tiles[tile].take(rows[here] - self._first[tile], axis=-1)
            beliefs = [*map(over_hypotheses, columns)]
            out[here] = np.moveaxis(means_over_missing(beliefs, counted[:, here]), -1, 0)
        return out

    def probabilities(self, rows: Ints, cells: Ints, counted: Flags) -> Singles:
        """The matrix entry of one cell in each of some rows, in ascending order: float32, (n,)."""
        of_cells = [self._probability(person, rows, cells) for person in range(self._persons)]
        values: Singles = means_over_missing(of_cells, counted).astype(np.float32)
        return values

    def _probability(self, person: int, rows: Ints, cells: Ints) -> Floats:
        """The belief about one cell in each of some rows, over all hypotheses: (n,)."""
        return over_hypotheses(self._flat.take(self._indices(person, rows, cells)))

    def weights(self, row: int) -> Floats:
        """The probability of each hypothesis about each person in a row: (persons, M)."""
        [(tile, _)] = self._parts(np.array([row]))
        belief = np.ascontiguousarray(self._tiles[tile][..., row - self._first[tile]])
        weights: Floats = belief.sum(axis=(2, 3))
        return weights

    # The probability of success.

    def success(self, rows: Rows) -> Floats:
        """The cumulative probability of success (POS) in some rows: float64, (n,)."""
        kept = self.kept[:, rows]
        return 1.0 - means_over_missing(kept, np.ones(kept.shape, np.bool_))

    def added_success(
        self, rows: Ints, cells: Ints, detections: Sequence[float | Floats]
    ) -> Floats:
        """The probability of success that searches add; arguments as for `search`, which follows.

        Returns:
            float64, shape (n,): for each search, as if it were its row's only one.
        """
        added = [
            self.kept[person].take(rows) * detection * self._probability(person, rows, cells)
            for person, detection in enumerate(detections)
        ]
        return means_over_missing(added, np.ones((self._persons, len(rows)), np.bool_))

    def _parts(self, rows: Ints) -> Iterator[tuple[int, slice]]:
        """The tiles of some rows in ascending order, and the slice of the rows in each."""
        ends = np.searchsorted(rows, [tile.stop for tile in self._rows]).tolist()
        for tile, here in enumerate(map(slice, [0, *ends], ends)):
            if here.start < here.stop:
                yield tile, here
