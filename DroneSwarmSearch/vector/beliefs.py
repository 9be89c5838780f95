"""The beliefs of a batch: distributions of the persons of its rows, given the searches made.

Beliefs begin with the first search that an observer, see `vector.knowledge`, knows of; until then
they equal the forecast. The arithmetic is that of `drift.belief` and agrees with the single
environment bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.drift.belief import means_over_missing, normalise
from DroneSwarmSearch.drift.model import over_layers
from DroneSwarmSearch.drift.shared import SharedDrift, layer_sums
from DroneSwarmSearch.vector.catalogue import Catalogue

_TILE_BYTES = 800 * 2**10
"""The size of one person's beliefs in a tile: several such arrays fit into the cache."""

# the fewest and the most columns of a tile
_LEAST_COLUMNS = 64
_MOST_COLUMNS = 1024


def representatives(kinds: Ints) -> Ints:
    """The first person of each kind; kinds: of each person, numbered from 0."""
    _, first = np.unique(kinds, return_index=True)
    return first


class Beliefs:
    """The beliefs of observers, each of the shape (M, L) of the forecasts' mass.

    A belief assumes that the person has not been found, even after the find. Persons of one kind
    share it, see `Catalogue.kinds`.

    The beliefs of an observer are a column, the last axis, because each has its own moves. The
    first observer of row i has the column i; other observers with beliefs have any of those after
    the last row. The columns are divided into tiles that fit into the cache: column c is column
    c % width of tile c // width.

    Args:
        catalogue: the searches.
        entries: the current entry of each person's forecast in each row, see
            `drift.model.Forecasts`, an array that the caller changes: int64, (persons, rows).
        observers: of each row.

    Attributes:
        begun: which observers have beliefs: bool, (n,).
        failure: the probability that no search that an observer knows of finds the person:
            float64, (persons, n).
    """

    def __init__(self, catalogue: Catalogue, entries: Ints, observers: int) -> None:
        self._size = catalogue.scenarios[0].grid_size
        self._forecasts = catalogue.forecasts
        self._kinds = catalogue.kinds
        self._representatives = representatives(self._kinds)
        self._entries = entries
        self._observers = observers
        persons, self._rows = entries.shape
        n = self._rows * observers
        shape = self._forecasts.shape
        fit = _TILE_BYTES // (8 * shape[0] * shape[1])
        most = min(_MOST_COLUMNS, max(_LEAST_COLUMNS, fit))
        # An odd width: the cells of a column lie in different lines of the cache.
        self._width = -(-n // -(-n // most)) | 1
        tiles = -(-n // self._width)
        self._mass = np.zeros((tiles, len(self._representatives), *shape, self._width))
        self.begun = np.zeros(n, np.bool_)
        self.failure = np.ones((persons, n))
        # The column of each observer, and the observer of each column, any if it is not in use.
        self._column = np.zeros(n, np.int64)
        self._observer = np.zeros(tiles * self._width, np.int64)
        self._is_used = np.zeros(tiles * self._width, np.bool_)
        self._by_column: Singles | None = None  # for `matrices_of_most`; a new one costs time
        first = np.arange(0, n, observers)
        self._column[first] = np.arange(self._rows)
        self._observer[: self._rows] = first

    def use(self, catalogue: Catalogue) -> None:
        """Use another catalogue; layers and slots without mass are added, or left out."""
        self._representatives = representatives(catalogue.kinds)
        mass = self._mass[:, self._kinds[self._representatives]]
        self._kinds = catalogue.kinds
        self._forecasts = catalogue.forecasts
        shape = self._forecasts.shape
        layers, slots = np.maximum(np.subtract(shape, mass.shape[2:4]), 0)
        padded = np.pad(mass, [(0, 0), (0, 0), (0, layers), (0, slots), (0, 0)])
        self._mass = np.ascontiguousarray(padded[:, :, : shape[0], : shape[1]])

    # Columns.

    def _take_columns(self, who: Ints) -> None:
        """Give columns to observers without beliefs."""
        if self._observers > 1:
            others = who[who % self._observers > 0]
            free = np.flatnonzero(~self._is_used[self._rows :])[: len(others)] + self._rows
            self._column[others] = free
            self._observer[free] = others
        self._is_used[self._column[who]] = True
        self.begun[who] = True

    def _places(self, who: Ints) -> tuple[Ints, Ints]:
        """The tile of each observer's column, and its number there."""
        return np.divmod(self._column.take(who), self._width)

    def _tiles(self) -> Iterator[tuple[int, Floats]]:
        """The number and the mass of each tile that is in use."""
        for tile, mass in enumerate(self._mass):
            if self._is_used[self._columns(tile)].any():
                yield tile, mass

    def _columns(self, tile: int) -> slice:
        return slice(tile * self._width, (tile + 1) * self._width)

    def _entries_of(self, who: Ints) -> Ints:
        """The entries of each kind of person for some observers: (kinds, n)."""
        return self._entries[self._representatives[:, None], who // self._observers]

    # The beginning and the end of beliefs.

    def forget(self, who: Ints) -> None:
        """Drop the beliefs of some observers."""
        begun = who[self.begun[who]]
        self._is_used[self._column[begun]] = False
        self.begun[begun] = False
        self.failure[:, who] = 1.0

    def begin(self, who: Ints) -> None:
        """Let the beliefs of some observers equal the forecast, unless they have begun."""
        new = np.unique(who[~self.begun[who]])
        self._take_columns(new)
        tiles, columns = self._places(new)
        for tile in np.unique(tiles):
            here = tiles == tile
            for mass, entries in zip(self._mass[tile], self._entries_of(new[here]), strict=True):
                mass[..., columns[here]] = np.moveaxis(self._forecasts.joint(entries), 0, -1)

    def copy(self, source: Ints, target: Ints) -> None:
        """Let observers without beliefs, `target`, have those of others: (n,) each."""
        begun = self.begun[source]
        source = source[begun]
        target = target[begun]
        self._take_columns(target)
        from_tile, from_column = self._places(source)
        tile, column = self._places(target)
        self._mass[tile, ..., column] = self._mass[from_tile, ..., from_column]
        self.failure[:, target] = self.failure[:, source]

    # A step.

    def search(self, who: Ints, cells: Ints, detections: Floats, turns: Ints) -> None:
        """Apply searches that find nobody, for observers with beliefs.

        Args:
            who: the observer of each search.
            cells: of each search.
            detections: of each person at each search: (persons, n).
            turns: how many searches before it are of the same cell, for the same observer: (n,).
        """
        tile, column = self._places(who)
        searched = np.zeros(len(self._is_used), np.bool_)
        searched[self._column.take(who)] = True
        which = np.unique(who)
        for kind, (detection, entries) in enumerate(
            zip(detections[self._representatives], self._entries_of(who), strict=True)
        ):
            slots = self._forecasts.slots(entries, cells)
            where = tile, kind, slice(None), slots, column
            before = self._mass[where]  # (n, M)
            self._multiply(where, detection, turns)
            missed = self._normalise(kind, searched)
            # Rounding must not lower the probability of success.
            left = np.minimum(missed.take(self._column.take(which)), 1.0)
            persons = (self._kinds == kind).nonzero()[0]
            self.failure[persons[:, None], which] *= left
            undo = missed.take(self._column.take(who)) <= 0.0
            if undo.any():  # the searches contradict the belief: restore it
                where = tile[undo], kind, slice(None), slots[undo], column[undo]
                self._mass[where] = before[undo]

    def _multiply(
        self, where: tuple[Ints, int, slice, Ints, Ints], detection: Floats, turns: Ints
    ) -> None:
        """Leave what searches miss of the mass of a kind, one search of a cell after the other.

        Args:
            where: the index of each searched cell's mass.
            detection: at each search: (n,).
            turns: see `search`.
        """
        tile, kind, layers, slots, column = where
        last = int(turns.max(initial=0))
        for turn in range(last + 1):
            which = slice(None) if last == 0 else turns == turn
            here = tile[which], kind, layers, slots[which], column[which]
            self._mass[here] = self._mass[here] * (1.0 - detection[which, None])

    def _normalise(self, kind: int, searched: Flags) -> Floats:
        """Normalise the beliefs about a kind in the searched columns; returns the sums before."""
        total = np.zeros(len(searched))
        for tile, mass in self._tiles():
            columns = self._columns(tile)
            if searched[columns].any():
                of_kind = mass[kind].reshape(len(mass[kind]), -1, self._size, self._width)
                total[columns] = normalise(of_kind, searched[columns])
        return total

    def search_together(
        self,
        shared: SharedDrift,
        who: Ints,
        cells: Ints,
        detections: Floats,
        turns: Ints,
        found_in: Ints,
        missing: Flags,
    ) -> SharedDrift:
        """`search` for persons who drift by one hypothesis, see `shared.after_shared_search`.

        Args:
            shared: of those who search, in ascending order, before the step.
            who: the observer of each search.
            cells: of each search.
            detections: of each person at each search: (persons, n).
            turns: see `search`.
            found_in: the cell where each person is found in this step, or -1: (persons, observers
                that search).
            missing: the persons who are missing after it: bool, (persons, observers that search).

        Returns:
            The same after the step.
        """
        which = np.unique(who)
        before = self._mass_of_kinds(which)
        tile, column = self._places(who)
        for kind, (detection, entries) in enumerate(
            zip(detections[self._representatives], self._entries_of(who), strict=True)
        ):
            slots = self._forecasts.slots(entries, cells)
            self._multiply((tile, kind, slice(None), slots, column), detection, turns)
        searched = self._mass_of_kinds(which)
        kinds, layers, slots_each, n = searched.shape
        by_row = searched.reshape(kinds, layers, slots_each // self._size, self._size, n)
        sums = np.array([layer_sums(mass) for mass in by_row])[self._kinds]
        seen = np.zeros(sums.shape)
        for person, at in enumerate(found_in):
            here = (at >= 0).nonzero()[0]
            entries = self._entries[person, which[here] // self._observers]
            slots = self._forecasts.slots(entries, at[here])
            seen[person][:, here] = before[self._kinds[person]][:, slots, here]
        after = shared.after_search(sums, found_in >= 0, seen, missing)
        factors = after.scale(sums)[self._representatives]
        # Where the searches contradict the belief, it stays.
        is_possible = np.expand_dims(np.any(factors, axis=1), (1, 2))
        changed = np.where(is_possible, searched * factors[:, :, None], before)
        tile, column = self._places(which)
        self._mass[tile, ..., column] = np.moveaxis(changed, -1, 0)
        self.failure[:, which] = after.failure(missing)
        return after

    def drift(self) -> None:
        """Let the beliefs drift by a step; the entries are those before it."""
        for tile, masses in self._tiles():
            entries = self._entries_of(self._observer[self._columns(tile)])
            for mass, entry in zip(masses, entries, strict=True):
                self._forecasts.drift(mass, entry)

    # The matrices; `counted`, (persons, n), are the persons in the mean, see `shown_persons`.

    def write_common_matrices(self, counted: Flags, out: Singles) -> None:
        """Write the matrix of each row's first observer: float32, (rows, N, N).

        Those without beliefs receive arbitrary values. `counted` is of all observers.
        """
        for tile, masses in self._tiles():
            columns = self._columns(tile)
            if columns.start < len(out):
                matrices = self._matrices(masses, self._observer[columns], counted)
                out[columns] = matrices[: len(out) - columns.start]

    def matrices_of_most(self, who: Ints, counted: Flags) -> Singles:
        """`matrices`, fast if they are of most observers; arbitrary for those without beliefs."""
        if self._by_column is None:
            shape = len(self._is_used), self._size, self._size
            self._by_column = np.empty(shape, np.float32)
        for tile, masses in self._tiles():
            columns = self._columns(tile)
            self._by_column[columns] = self._matrices(masses, self._observer[columns], counted)
        return self._by_column.take(self._column.take(who), axis=0)

    def _matrices(self, masses: Floats, who: Ints, counted: Flags) -> Singles:
        """The matrices of the observers that have the columns of some masses: (n, N, N)."""
        of_kinds = list(map(self._forecasts.map, masses, self._entries_of(who)))
        maps = [of_kinds[kind] for kind in self._kinds]
        mean = means_over_missing(maps, counted[:, who]).astype(np.float32)
        return mean.T.reshape(-1, self._size, self._size)

    def matrices(self, who: Ints, counted: Flags) -> Singles:
        """The matrices of some observers with beliefs: float32, (n, N, N)."""
        matrices = self._matrices(self._mass_of_kinds(who), who, counted)
        return np.ascontiguousarray(matrices)

    def mass(self, observer: int) -> Floats:
        """The beliefs of an observer who has them: float64, (persons, M, L)."""
        return self._mass_of_kinds(np.array([observer]))[self._kinds, ..., 0]

    def _mass_of_kinds(self, who: Ints) -> Floats:
        """The beliefs of some observers: (kinds, M, L, n)."""
        tile, column = self._places(who)
        return np.moveaxis(self._mass[tile, ..., column], 0, -1)

    def probabilities(self, who: Ints, cells: Ints, counted: Flags) -> Singles:
        """The probability of one cell in the matrix of each of some observers: float32, (n,)."""
        values: Singles = means_over_missing(self._at(who, cells), counted).astype(np.float32)
        return values

    def _at(self, who: Ints, cells: Ints) -> list[Floats]:
        """The belief about each person and one cell, of each of some observers: (n,)."""
        of_kinds = [over_layers(masses) for masses in self._layers_at(who, cells)]
        return [of_kinds[kind] for kind in self._kinds]

    def _layers_at(self, who: Ints, cells: Ints) -> list[Floats]:
        """The mass of each kind in one cell, for each of some observers: (M, n)."""
        tile, column = self._places(who)
        slots = [self._forecasts.slots(entry, cells) for entry in self._entries_of(who)]
        return [self._mass[tile, kind, :, slot, column].T for kind, slot in enumerate(slots)]

    # The probability of success.

    def success(self, who: Ints) -> Floats:
        """The cumulative probability of success (POS), for some observers: float64, (n,)."""
        failure = self.failure[:, who]
        return 1.0 - means_over_missing(failure, np.ones(failure.shape, np.bool_))

    def added_success(self, who: Ints, cells: Ints, worths: Floats) -> Floats:
        """What each search adds to it, as if it were its observer's only one: float64, (n,).

        `worths`, (persons, n), are each person's probability of detection times that of survival.
        """
        added = self.failure[:, who] * worths * np.array(self._at(who, cells))
        return means_over_missing(added, np.ones(added.shape, np.bool_))

    def expected_share(self, who: Ints, cells: Ints, worths: Floats) -> Floats:
        """The share of the persons that each search finds in the mean: float64, (n,).

        `worths`, (persons, n), as for `added_success`, and 0 for persons who have been found.
        """
        shares = worths * np.array(self._at(who, cells))
        return means_over_missing(shares, np.ones(shares.shape, np.bool_))

    def added_together(
        self, shared: SharedDrift, who: Ints, cells: Ints, missing: Flags, worths: Floats
    ) -> Floats:
        """`added_success` for persons who drift together, see `shared.shared_added_success`.

        `shared` and `missing`, (persons, n), are those of each search's observer.
        """
        masses = self._layers_at(who, cells)
        added = np.empty(worths.shape)
        for person, (layers, worth) in enumerate(zip(shared.worths(missing), worths, strict=True)):
            added[person] = worth * (layers * masses[self._kinds[person]]).cumsum(axis=0)[-1]
        return means_over_missing(added, np.ones(added.shape, np.bool_))
