"""What is known about the persons of many searches: the array form of `core.knowledge`.

Each row has observers: one for all drones together, or one for each drone. Observer k of row i has
the number i * observers + k, and is the last axis of most arrays.
"""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
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
        observers: of each row.
        keeps_beliefs: whether to compute the posteriors.

    Attributes:
        observers: of each row.
        missing: the persons of whose find an observer knows nothing: bool, (persons, n).
        entries: the current entry of each person's forecast, see `drift.model.Forecasts`: int64,
            (persons, n).
        beliefs: or None.
    """

    def __init__(
        self, catalogue: Catalogue, rows: int, observers: int, *, keeps_beliefs: bool
    ) -> None:
        scenario = catalogue.scenarios[0]
        n = rows * observers
        persons = len(catalogue.forecast_of)
        self.observers = observers
        self._size = scenario.grid_size
        self._persons = persons
        # Drones that collide in flight search the cell in which they meet, too.
        self._shares_cells = scenario.crash == PASS or scenario.search_in_flight
        self._forecasts = catalogue.forecasts
        self._detections = np.zeros((persons, n))
        self.entries = np.zeros((persons, n), np.int64)
        self.missing = np.ones((persons, n), np.bool_)
        self.beliefs: Beliefs | None = None
        if keeps_beliefs:
            self.beliefs = Beliefs(self._size, self._forecasts, self.entries)
        self._shared: SharedDrift | None = None  # of every observer, if persons drift together
        if catalogue.shared_weights is not None:
            first = np.tile(catalogue.shared_weights[:, :1], n)
            self._shared = SharedDrift.begun(first, persons)
        self._shown_beliefs = self.beliefs if scenario.bayesian_update else None

    def of_rows(self, rows: Ints) -> Ints:
        """The observers of some rows: (rows * observers,)."""
        if self.observers == 1:
            return rows
        observers: Ints = (rows[:, None] * self.observers + np.arange(self.observers)).reshape(-1)
        return observers

    # Episodes, and searches to choose from.

    def begin(self, rows: Ints, catalogue: Catalogue, situation: Ints) -> None:
        """Start episodes in some rows, each with a search of the catalogue: (n,)."""
        who = self.of_rows(rows)
        situation = situation.repeat(self.observers)
        self.missing[:, who] = True
        self.entries[:, who] = catalogue.forecast_of.take(situation, axis=1)
        self._detections[:, who] = catalogue.detections.take(situation, axis=1)
        if self.beliefs is not None:
            self.beliefs.forget(who)
        if self._shared is not None and catalogue.shared_weights is not None:
            weights = catalogue.shared_weights.take(situation, axis=1)
            self._shared.put(who, SharedDrift.begun(weights, self._persons))

    def use(self, catalogue: Catalogue, rows: Ints, situation: Ints, step: Ints) -> None:
        """Use another catalogue; episodes go on in some rows, which have steps behind them."""
        who = self.of_rows(rows)
        entries = catalogue.forecast_of.take(situation, axis=1) + step * catalogue.forecasts.count
        self.entries[:, who] = entries.repeat(self.observers, axis=1)
        self._forecasts = catalogue.forecasts
        if self.beliefs is not None:
            self.beliefs.use(catalogue.forecasts)
        if self._shared is not None:
            self._shared = self._shared.resized(catalogue.forecasts.shape[0])

    # A step.

    def update(self, who: Ints, cells: Ints, found_in: Ints) -> None:
        """Apply Bayes' rule to searches, and to finds.

        Args:
            who: the observer that learns of each search, in ascending order.
            cells: the cell of each search; of one observer, in the order of the drones.
            found_in: the cell where each person is found, as far as each observer learns of it in
                this step, or -1: (persons, n).
        """
        self.missing &= found_in < 0
        if self.beliefs is None or not who.size:
            return
        self.beliefs.begin(who)
        detections = self.detections(who)
        turns = self.turns(who, cells)
        if self._shared is None:
            self.beliefs.search(who, cells, detections, turns)
            return
        which = np.unique(who)
        after = self.beliefs.search_together(
            self._shared.take(which),
            who,
            cells,
            detections,
            turns,
            found_in=found_in[:, which],
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

    def detections(self, who: Ints) -> Floats:
        """Each person's probability of detection: (persons, n)."""
        return self._detections.take(who, axis=1)

    def added_success(self, who: Ints, cells: Ints, alive: Floats) -> Floats:
        """What searches add to the success, as if each were its observer's only one: (n,).

        `alive`, (persons, n): the probability that each person is alive.
        """
        assert self.beliefs is not None
        self.beliefs.begin(who)
        worths = self.detections(who) * alive
        if self._shared is not None:
            shared = self._shared.take(who)
            return self.beliefs.added_together(shared, who, cells, self.missing[:, who], worths)
        return self.beliefs.added_success(who, cells, worths)

    def advance(self) -> None:
        """Complete a step: the beliefs drift."""
        if self.beliefs is not None:
            self.beliefs.drift()
        self.entries += self._forecasts.count

    # The matrices.

    def probabilities(self, who: Ints, cells: Ints) -> Singles:
        """The probabilities of one cell in each of some observers' matrices: float32, (n,)."""
        if self._shown_beliefs is None:
            return self._forecast_probabilities(who, cells)
        begun = self._shown_beliefs.begun[who]
        counted = shown_persons(self.missing[:, who[begun]])
        values = np.empty(len(who), np.float32)
        values[begun] = self._shown_beliefs.probabilities(who[begun], cells[begun], counted)
        values[~begun] = self._forecast_probabilities(who[~begun], cells[~begun])
        return values

    def _forecast_probabilities(self, who: Ints, cells: Ints) -> Singles:
        """`probabilities` as forecasts without searches."""
        if self._persons == 1:
            return self._forecasts.probabilities(self.entries[0].take(who), cells)
        matrices = self._forecast_matrices(who).reshape(-1, self._size**2)
        return matrices[np.arange(len(who)), cells]

    def matrices(self, who: Ints) -> Singles:
        """The matrices of some observers: float32, shape (n, N, N)."""
        if self._shown_beliefs is None:
            return self._forecast_matrices(who)
        begun = self._shown_beliefs.begun[who]
        counted = shown_persons(self.missing[:, who[begun]])
        out = np.empty((len(who), self._size, self._size), np.float32)
        out[begun] = self._shown_beliefs.matrices(who[begun], counted)
        out[~begun] = self._forecast_matrices(who[~begun])
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every observer: float32, shape (n, N, N)."""
        if self._shown_beliefs is not None:
            self._shown_beliefs.write_matrices(shown_persons(self.missing), out)
            others = (~self._shown_beliefs.begun).nonzero()[0]
            out[others] = self._forecast_matrices(others)
        elif self._persons == 1:
            self._forecasts.matrices(self.entries[0], out)
        else:
            out[...] = self._forecast_matrices(np.arange(len(out)))

    def _forecast_matrices(self, who: Ints) -> Singles:
        """The matrices of some observers as forecasts without searches: float32, (n, N, N)."""
        entries = self.entries[:, who]
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
