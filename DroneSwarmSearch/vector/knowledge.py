"""What is known about the persons of many searches: the array form of `core.knowledge`.

Each row has observers: all drones together, number 0, and with a radio range each drone k, number
k + 1. Observer k of row i has the number i * observers + k in the batch, and is the last axis of
most arrays. Observers who have heard of the same searches share their beliefs.
"""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.core.rules import PASS
from DroneSwarmSearch.drift.belief import means_over_missing, shown_persons
from DroneSwarmSearch.drift.shared import SharedDrift
from DroneSwarmSearch.vector.beliefs import Beliefs
from DroneSwarmSearch.vector.catalogue import Catalogue


class Knowledge:
    """What the observers of a batch know.

    Args:
        catalogue: the searches.
        rows: the number of rows.

    Attributes:
        observers: of each row.
        missing: the persons of whose find an observer knows nothing: bool, (persons, n).
        entries: the current entry of each person's forecast, see `drift.model.Forecasts`: int64,
            (persons, rows).
    """

    def __init__(self, catalogue: Catalogue, rows: int) -> None:
        scenario = catalogue.scenarios[0]
        persons = len(catalogue.forecast_of)
        self.observers = 1 if scenario.radio_range is None else 1 + scenario.n_drones
        n = rows * self.observers
        self._size = scenario.grid_size
        self._persons = persons
        # Drones that collide in flight search the cell in which they meet, too.
        self._shares_cells = scenario.crash == PASS or scenario.search_in_flight
        self._forecasts = catalogue.forecasts
        self._detections = np.zeros((persons, rows))
        self.entries = np.zeros((persons, rows), np.int64)
        self.missing = np.ones((persons, n), np.bool_)
        # The observer in whose place each one's beliefs are: the first who has heard the same.
        self._leader = np.arange(n)
        self._beliefs: Beliefs | None = None
        if scenario.keeps_beliefs:
            self._beliefs = Beliefs(catalogue, self.entries, self.observers)
        self._shared: SharedDrift | None = None  # of every observer, if persons drift together
        if catalogue.shared_weights is not None:
            first = np.tile(catalogue.shared_weights[:, :1], n)
            self._shared = SharedDrift.begun(first, persons)
        self._shown_beliefs = self._beliefs if scenario.bayesian_update else None

    def of_rows(self, rows: Ints) -> Ints:
        """All drones together in some rows: (n,)."""
        return rows if self.observers == 1 else rows * self.observers

    def of_drones(self, rows: Ints) -> Ints:
        """Who observes the matrices of the drones in some rows, those of each row together.

        Each drone, or without a radio range all of them.
        """
        return rows if self.observers == 1 else self._of_each(rows)[:, 1:].reshape(-1)

    def _of_each(self, rows: Ints) -> Ints:
        """All observers in some rows: (n, observers)."""
        every: Ints = rows[:, None] * self.observers + np.arange(self.observers)
        return every

    # Episodes, and searches to choose from.

    def begin(self, rows: Ints, catalogue: Catalogue, situation: Ints) -> None:
        """Start episodes in some rows, each with a search of the catalogue: (n,)."""
        self.entries[:, rows] = catalogue.forecast_of.take(situation, axis=1)
        self._detections[:, rows] = catalogue.detections.take(situation, axis=1)
        who = self._of_each(rows).reshape(-1)
        self.missing[:, who] = True
        self._leader[who] = self.of_rows(rows).repeat(self.observers)
        if self._beliefs is not None:
            self._beliefs.forget(who)
        if self._shared is not None and catalogue.shared_weights is not None:
            weights = catalogue.shared_weights.take(situation.repeat(self.observers), axis=1)
            self._shared.put(who, SharedDrift.begun(weights, self._persons))

    def use(self, catalogue: Catalogue, rows: Ints, situation: Ints, step: Ints) -> None:
        """Use another catalogue; episodes go on in some rows, which have steps behind them."""
        entries = catalogue.forecast_of.take(situation, axis=1) + step * catalogue.forecasts.count
        self.entries[:, rows] = entries
        self._forecasts = catalogue.forecasts
        if self._beliefs is not None:
            self._beliefs.use(catalogue)
        if self._shared is not None:
            self._shared = self._shared.resized(catalogue.forecasts.shape[0])

    # A step.

    def part(self, rows: Ints, told: Flags) -> None:
        """Let observers who will learn of different searches have beliefs of their own.

        To be called before beliefs begin in this step; arguments as for `update`.
        """
        if not rows.size:
            return
        searched, first, counts = np.unique(rows, return_index=True, return_counts=True)
        turn = np.arange(len(rows)) - first.repeat(counts)
        heard = np.zeros((len(searched), self.observers, counts.max()), np.bool_)
        heard[np.arange(len(searched)).repeat(counts), :, turn] = told
        packed = np.packbits(heard, axis=-1)
        every = self._of_each(searched)
        before = self._leader[every]
        alike = before[:, :, None] == before[:, None]
        alike &= (packed[:, :, None] == packed[:, None]).all(axis=-1)
        leader = np.take_along_axis(every, alike.argmax(axis=-1), axis=1)
        new = (leader == every) & (before != every)
        self._leader[every] = leader
        source = before[new]
        target = every[new]
        if self._beliefs is not None:
            self._beliefs.copy(source, target)
        if self._shared is not None:
            self._shared.put(target, self._shared.take(source))

    def update(self, rows: Ints, cells: Ints, told: Flags, found: Ints) -> None:
        """Apply Bayes' rule to the searches of a step, and to its finds.

        Args:
            rows: of each search, in ascending order, and within a row in the order of the drones.
            cells: of each search.
            told: which of its row's observers learn of each search: bool, (n, observers).
            found: which search finds each person, or -1: (persons, rows).
        """
        if not rows.size:
            return
        search, observer = told.nonzero()
        who = rows.take(search) * self.observers + observer
        learned = np.full(self.missing.shape, -1)  # where each observer learns that persons are
        for person, finder in enumerate(found):
            where = (finder >= 0).nonzero()[0]
            find, listener = told[finder[where]].nonzero()
            at = where[find]
            learned[person, at * self.observers + listener] = cells[finder[at]]
        self.missing &= learned < 0
        if self._beliefs is None:
            return
        leads = self._leader.take(who) == who
        who = who[leads]
        order = who.argsort(kind="stable")
        who = who[order]
        cells = cells.take(search[leads][order])
        self._beliefs.begin(who)
        detections = self.detections(who // self.observers)
        turns = self.turns(who, cells)
        if self._shared is None:
            self._beliefs.search(who, cells, detections, turns)
            return
        which = np.unique(who)
        after = self._beliefs.search_together(
            self._shared.take(which),
            who,
            cells,
            detections,
            turns,
            found_in=learned[:, which],
            missing=self.missing[:, which],
        )
        self._shared.put(which, after)

    def turns(self, who: Ints, cells: Ints) -> Ints:
        """How many searches of the same cell, for the same observer, come before each: (n,)."""
        turns = np.zeros(len(who), np.int64)
        if not self._shares_cells or not len(who):
            return turns
        keys = who * self._size**2 + cells
        order = keys.argsort(kind="stable")
        _, begins, counts = np.unique(keys[order], return_index=True, return_counts=True)
        turns[order] = np.arange(len(who)) - begins.repeat(counts)
        return turns

    def detections(self, rows: Ints) -> Floats:
        """Each person's probability of detection in some rows: (persons, n)."""
        return self._detections.take(rows, axis=1)

    def added_success(self, rows: Ints, cells: Ints, alive: Floats) -> Floats:
        """What searches add to the success, as if each were its row's only one: (n,).

        `alive`, (persons, n): the probability that each person is alive.
        """
        assert self._beliefs is not None
        who = self.of_rows(rows)
        self._beliefs.begin(who)
        worths = self.detections(rows) * alive
        if self._shared is not None:
            shared = self._shared.take(who)
            return self._beliefs.added_together(shared, who, cells, self.missing[:, who], worths)
        return self._beliefs.added_success(who, cells, worths)

    def expected_share(self, rows: Ints, cells: Ints, alive: Floats) -> Floats:
        """The share of the persons that each search finds in the mean: (n,).

        Arguments as for `added_success`.
        """
        assert self._beliefs is not None
        who = self.of_rows(rows)
        self._beliefs.begin(who)
        worths = self.detections(rows) * alive * self.missing[:, who]
        return self._beliefs.expected_share(who, cells, worths)

    def advance(self) -> None:
        """Complete a step: the beliefs drift."""
        if self._beliefs is not None:
            self._beliefs.drift()
        self.entries += self._forecasts.count

    # What all drones of each row together know.

    def success(self) -> Floats | None:
        """The cumulative probability of success (POS): (rows,); None without beliefs."""
        every = np.arange(self.missing.shape[1])[:: self.observers]
        return None if self._beliefs is None else self._beliefs.success(every)

    def failure(self) -> Floats | None:
        """The probability that no search finds each person: (persons, rows), or None."""
        return None if self._beliefs is None else self._beliefs.failure[:, :: self.observers]

    # What is shown.

    def shown_mass(self, observer: int) -> Floats | None:
        """The beliefs that an observer's matrix shows: (persons, M, L); None if it shows none."""
        leader = int(self._leader[observer])
        if self._shown_beliefs is None or not self._shown_beliefs.begun[leader]:
            return None
        return self._shown_beliefs.mass(leader)

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The probabilities of one cell in each of some rows' common matrices: float32, (n,)."""
        if self._shown_beliefs is None:
            return self._forecast_probabilities(rows, cells)
        who = self.of_rows(rows)
        begun = self._shown_beliefs.begun[who]
        counted = shown_persons(self.missing[:, who[begun]])
        values = np.empty(len(who), np.float32)
        values[begun] = self._shown_beliefs.probabilities(who[begun], cells[begun], counted)
        values[~begun] = self._forecast_probabilities(rows[~begun], cells[~begun])
        return values

    def _forecast_probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """`probabilities` as forecasts without searches."""
        if self._persons == 1:
            return self._forecasts.probabilities(self.entries[0].take(rows), cells)
        matrices = self._forecast_matrices(self.of_rows(rows)).reshape(-1, self._size**2)
        return matrices[np.arange(len(rows)), cells]

    def matrices(self, who: Ints) -> Singles:
        """The matrices of some observers: float32, shape (n, N, N)."""
        if self._shown_beliefs is None:
            return self._forecast_matrices(who)
        leader = self._leader.take(who)
        begun = self._shown_beliefs.begun[leader]
        counted = shown_persons(self.missing)
        out = np.empty((len(who), self._size, self._size), np.float32)
        out[begun] = self._shown_beliefs.matrices(leader[begun], counted)
        out[~begun] = self._forecast_matrices(who[~begun])
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of each row's drones together: float32, shape (rows, N, N)."""
        every = np.arange(len(out))
        if self._shown_beliefs is not None:
            who = self.of_rows(every)
            self._shown_beliefs.write_common_matrices(shown_persons(self.missing), out)
            others = (~self._shown_beliefs.begun[who]).nonzero()[0]
            out[others] = self._forecast_matrices(who[others])
        elif self._persons == 1:
            self._forecasts.matrices(self.entries[0], out)
        else:
            out[...] = self._forecast_matrices(self.of_rows(every))

    def matrices_of_drones(self) -> Singles:
        """The matrices that the drones of all rows observe, see `of_drones`."""
        who = self.of_drones(np.arange(self.entries.shape[1]))
        if self._shown_beliefs is None:
            return self._forecast_matrices(who)
        leader = self._leader.take(who)
        matrices = self._shown_beliefs.matrices_of_most(leader, shown_persons(self.missing))
        others = (~self._shown_beliefs.begun[leader]).nonzero()[0]
        matrices[others] = self._forecast_matrices(who[others])
        return matrices

    def _forecast_matrices(self, who: Ints) -> Singles:
        """The matrices of some observers as forecasts without searches: float32, (n, N, N)."""
        entries = self.entries[:, who // self.observers]
        if self._persons == 1:
            return self._forecasts.matrices(entries[0])
        counted = shown_persons(self.missing[:, who])
        first = np.take_along_axis(entries, counted.argmax(axis=0)[None], axis=0)
        matrices = self._forecasts.matrices(first[0])
        mixed = ((entries != first) & counted).any(axis=0)  # a mean of different forecasts
        maps = [
            self._forecasts.map(np.moveaxis(self._forecasts.joint(entry), 0, -1), entry)
            for entry in entries[:, mixed]
        ]
        mean = means_over_missing(maps, counted[:, mixed]).T.astype(np.float32)
        matrices[mixed] = mean.reshape(-1, self._size, self._size)
        return matrices
