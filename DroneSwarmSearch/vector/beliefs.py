"""The beliefs of a batch: each row's distribution of its persons given the searches made.

A row's beliefs begin with its first search; until then they equal the forecast. The arithmetic
is that of `drift.belief` and agrees with the single environment bit for bit.
"""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.drift.belief import means_over_missing, normalise
from DroneSwarmSearch.drift.model import Forecasts, over_layers
from DroneSwarmSearch.drift.shared import SharedDrift, layer_sums

_TILE_BYTES = 1600 * 2**10
"""The size of one person's beliefs in a tile: several such arrays fit into the cache."""

# the fewest and the most rows in a tile
_LEAST_ROWS = 64
_MOST_ROWS = 1024


class Beliefs:
    """The beliefs about every row's persons, each of the shape (M, L) of the forecasts' mass.

    A belief assumes that the person has not been found, even after the find. The rows are the
    last axis, because each has its own moves. They are divided into tiles that fit into the
    cache: row i is column i % width of tile i // width.

    Attributes:
        forecasts: where the persons may be; `entries` are the current ones of each person in each
            row there, an array that the caller changes: int64, (persons, rows).
        begun: which rows have beliefs: bool, (rows,).
        failure: the probability that no search so far finds the person: float64, (persons, rows).
    """

    def __init__(self, grid_size: int, forecasts: Forecasts, entries: Ints) -> None:
        self._size = grid_size
        self.forecasts = forecasts
        self._entries = entries
        persons, rows = entries.shape
        shape = forecasts.shape
        fit = _TILE_BYTES // (8 * shape[0] * shape[1])
        most = min(_MOST_ROWS, max(_LEAST_ROWS, fit))
        # An odd width: the cells of a row lie in different lines of the cache.
        self._width = -(-rows // -(-rows // most)) | 1
        tiles = -(-rows // self._width)
        # The columns after the last row are not used.
        self._mass = np.zeros((tiles, persons, *shape, self._width))
        self.begun = np.zeros(rows, np.bool_)
        self.failure = np.ones((persons, rows))

    def use(self, forecasts: Forecasts) -> None:
        """Use other forecasts; layers and slots without mass are added, or left out."""
        self.forecasts = forecasts
        shape = forecasts.shape
        layers, slots = np.maximum(np.subtract(shape, self._mass.shape[2:4]), 0)
        padded = np.pad(self._mass, [(0, 0), (0, 0), (0, layers), (0, slots), (0, 0)])
        self._mass = np.ascontiguousarray(padded[:, :, : shape[0], : shape[1]])

    def forget(self, rows: Ints) -> None:
        """Drop the beliefs of some rows, whose next episodes begin."""
        self.begun[rows] = False
        self.failure[:, rows] = 1.0

    def begin(self, rows: Ints) -> None:
        """Let the beliefs of some rows equal the forecast, unless they have begun."""
        new = np.unique(rows[~self.begun[rows]])
        tiles = new // self._width
        for tile in np.unique(tiles):
            some = new[tiles == tile]
            for mass, entry in zip(self._mass[tile], self._entries[:, some], strict=True):
                mass[..., some % self._width] = np.moveaxis(self.forecasts.joint(entry), 0, -1)
        self.begun[new] = True

    def search(self, rows: Ints, cells: Ints, detections: Floats, turns: Ints) -> None:
        """Apply searches that find nobody, in rows with beliefs.

        Args:
            rows: of each search.
            cells: of each search.
            detections: of each person at each search: (persons, n).
            turns: how many searches before it are of the same cell of the same row: (n,).
        """
        tile, column = np.divmod(rows, self._width)
        searched = np.zeros(self.begun.shape, np.bool_)
        searched[rows] = True
        for person, detection in enumerate(detections):
            slots = self.forecasts.slots(self._entries[person, rows], cells)
            where = tile, person, slice(None), slots, column
            before = self._mass[where]  # (n, M)
            self._multiply(person, rows, cells, detection, turns)
            missed = self._normalise(person, searched)
            # Rounding must not lower the probability of success.
            self.failure[person] *= np.where(searched, np.minimum(missed, 1.0), 1.0)
            undo = missed[rows] <= 0.0  # the searches contradict the belief: restore it
            if undo.any():
                where = tile[undo], person, slice(None), slots[undo], column[undo]
                self._mass[where] = before[undo]

    def _multiply(
        self, person: int, rows: Ints, cells: Ints, detection: Floats, turns: Ints
    ) -> None:
        """Leave what searches miss of a person's mass, one search of a cell after the other."""
        slots = self.forecasts.slots(self._entries[person, rows], cells)
        tile, column = np.divmod(rows, self._width)
        last = int(turns.max(initial=0))
        for turn in range(last + 1):
            which = slice(None) if last == 0 else turns == turn
            where = tile[which], person, slice(None), slots[which], column[which]
            self._mass[where] = self._mass[where] * (1.0 - detection[which, None])

    def search_together(
        self,
        shared: SharedDrift,
        rows: Ints,
        cells: Ints,
        detections: Floats,
        turns: Ints,
        found_in: Ints,
        missing: Flags,
    ) -> SharedDrift:
        """`search` for persons who drift by one hypothesis, see `shared.after_shared_search`.

        Args:
            shared: of the searched rows, in ascending order, before the step.
            rows: of each search.
            cells: of each search.
            detections: of each person at each search: (persons, n).
            turns: see `search`.
            found_in: the cell where each person is found in this step, or -1: (persons, searched
                rows).
            missing: the persons who are missing after it: bool, (persons, searched rows).

        Returns:
            The same after the step.
        """
        which = np.unique(rows)
        before = self.mass(which)
        for person, detection in enumerate(detections):
            self._multiply(person, rows, cells, detection, turns)
        searched = self.mass(which)
        persons, layers, slots_each, n = searched.shape
        by_row = searched.reshape(persons, layers, slots_each // self._size, self._size, n)
        sums = np.array([layer_sums(mass) for mass in by_row])
        seen = np.zeros(sums.shape)
        for person, at in enumerate(found_in):
            here = (at >= 0).nonzero()[0]
            slots = self.forecasts.slots(self._entries[person, which[here]], at[here])
            seen[person][:, here] = before[person][:, slots, here]
        after = shared.after_search(sums, found_in >= 0, seen, missing)
        factors = after.scale(sums)
        # Where the searches contradict the belief, it stays.
        is_possible = np.expand_dims(np.any(factors, axis=1), (1, 2))
        changed = np.where(is_possible, searched * factors[:, :, None], before)
        tile, column = np.divmod(which, self._width)
        self._mass[tile, :, :, :, column] = np.moveaxis(changed, -1, 0)
        self.failure[:, which] = after.failure(missing)
        return after

    def added_together(
        self, shared: SharedDrift, rows: Ints, cells: Ints, missing: Flags, worths: Floats
    ) -> Floats:
        """`added_success` for persons who drift together, see `shared.shared_added_success`.

        `shared` and `missing`, (persons, n), are those of each search's row.
        """
        tile, column = np.divmod(rows, self._width)
        by_layer = shared.worths(missing)
        added = np.empty(worths.shape)
        for person, worth in enumerate(worths):
            slots = self.forecasts.slots(self._entries[person, rows], cells)
            masses = self._mass[tile, person, :, slots, column].T  # (M, n)
            added[person] = worth * (by_layer[person] * masses).cumsum(axis=0)[-1]
        return means_over_missing(added, np.ones(added.shape, np.bool_))

    def _normalise(self, person: int, searched: Flags) -> Floats:
        """Normalise a person's beliefs in the searched rows; returns the sums before."""
        total = np.zeros(len(searched))
        for first, mass in zip(self._firsts(), self._mass[:, person], strict=True):
            some = searched[first : first + self._width]
            if some.any():
                here = np.zeros(self._width, np.bool_)
                here[: len(some)] = some
                sums = normalise(mass.reshape(len(mass), -1, self._size, self._width), here)
                total[first : first + self._width] = sums[: len(some)]
        return total

    def drift(self) -> None:
        """Let the beliefs drift by a step; the entries are those before it."""
        for first, tile in zip(self._firsts(), self._mass, strict=True):
            if self.begun[first : first + self._width].any():
                for mass, entry in zip(tile, self._of_columns(first), strict=True):
                    self.forecasts.drift(mass, entry)

    def _of_columns(self, first: int) -> Ints:
        """The entries of each column of a tile, whose first row is given; any after the last."""
        some = self._entries[:, first : first + self._width]
        of_columns = np.empty((len(some), self._width), np.int64)
        of_columns[:, : some.shape[1]] = some
        of_columns[:, some.shape[1] :] = some[:, :1]
        return of_columns

    def _firsts(self) -> range:
        """The first row of each tile."""
        return range(0, len(self.begun), self._width)

    # The matrices; `counted` are the persons in the mean, see `shown_persons`.

    def write_matrices(self, counted: Flags, out: Singles) -> None:
        """Write the matrices of all rows with beliefs; some others receive arbitrary values."""
        for first, tile in zip(self._firsts(), self._mass, strict=True):
            rows = slice(first, first + self._width)
            if self.begun[rows].any():
                here = counted[:, rows]
                pairs = zip(tile, self._of_columns(first), strict=True)
                maps = [self.forecasts.map(*pair)[:, : here.shape[1]] for pair in pairs]
                matrices = means_over_missing(maps, here).astype(np.float32).T
                out[rows] = matrices.reshape(-1, self._size, self._size)

    def matrices(self, rows: Ints, counted: Flags) -> Singles:
        """The matrices of some rows with beliefs: float32, (n, N, N); `counted` is of these."""
        maps = list(map(self.forecasts.map, self.mass(rows), self._entries[:, rows]))
        matrices = means_over_missing(maps, counted).T.astype(np.float32)
        return np.ascontiguousarray(matrices).reshape(-1, self._size, self._size)

    def mass(self, rows: Ints) -> Floats:
        """The beliefs in some rows: float64, (persons, M, L, n)."""
        tile, column = np.divmod(rows, self._width)
        return np.moveaxis(self._mass[tile, :, :, :, column], 0, -1)

    def probabilities(self, rows: Ints, cells: Ints, counted: Flags) -> Singles:
        """The probability of one cell in the matrix of each of some rows: float32, (n,)."""
        values: Singles = means_over_missing(self._at(rows, cells), counted).astype(np.float32)
        return values

    def _at(self, rows: Ints, cells: Ints) -> list[Floats]:
        """Each person's belief about one cell in each of some rows: (n,)."""
        tile, column = np.divmod(rows, self._width)
        slots = [self.forecasts.slots(entry, cells) for entry in self._entries[:, rows]]
        return [over_layers(self._mass[tile, k, :, slot, column].T) for k, slot in enumerate(slots)]

    # The probability of success.

    def success(self) -> Floats:
        """The cumulative probability of success (POS) in every row: float64, (rows,)."""
        return 1.0 - means_over_missing(self.failure, np.ones(self.failure.shape, np.bool_))

    def added_success(self, rows: Ints, cells: Ints, worths: Floats) -> Floats:
        """What each search adds to it, as if it were its row's only one: float64, (n,).

        `worths`, (persons, n), are each person's probability of detection times that of survival.
        """
        added = self.failure[:, rows] * worths * np.array(self._at(rows, cells))
        return means_over_missing(added, np.ones(added.shape, np.bool_))
