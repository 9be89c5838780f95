"""The world states of a batch: the array form of `world.WorldState`.

Each row is at its own step and in its own episode. The last axis of most arrays is the row.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.streams import GOLDEN, uniforms, uniforms_of
from DroneSwarmSearch.core.rules import COVERED_AT, PASS
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.belief import means_over_missing, shown_persons
from DroneSwarmSearch.drift.model import forecasts_of
from DroneSwarmSearch.drift.shared import SharedDrift, draws_given
from DroneSwarmSearch.vector.beliefs import Beliefs


class Catalogue:
    """The searches that episodes draw from, which differ in their persons only.

    Args:
        scenarios: the searches, all with the same number of persons.
        old: searches that episodes under way have, but new ones do not draw.
        cells: the drones' start cells in each search, (searches, n_drones), if they are its own.

    Attributes:
        choices: the number of searches that new episodes draw from.
        forecasts: the different forecasts of their persons.
        forecast_of: the index of each person's forecast in each search: int64, (persons, searches).
        detections: each person's probability of detection: float64, (persons, searches).
        shared_weights: of the hypotheses by which all persons of a search drift, padded with 0:
            float64, (hypotheses, searches); None if each person drifts alone.
        alive: the probability that each person is alive after some completed steps, the last of
            which stands for all later ones: float64, (searches, persons, steps).
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        old: Sequence[Scenario] = (),
        cells: Ints | None = None,
    ) -> None:
        self.scenarios = (*scenarios, *old)
        self.choices = len(scenarios)
        self.cells = cells
        self.forecasts, indices = forecasts_of(
            [model for scenario in self.scenarios for model in scenario.forecasts()],
            last=scenarios[0].timestep_limit,
            keeps_matrices=not scenarios[0].bayesian_update,
        )
        self.forecast_of: Ints = indices.reshape(len(self.scenarios), -1).T.copy()
        detections = np.array([scenario.detections for scenario in self.scenarios])
        self.detections: Floats = detections.T.copy()
        situations = [scenario.persons_to_find for scenario in self.scenarios]
        steps = range(max(len(one.survival or [1]) for persons in situations for one in persons))
        alive = [[[*map(person.alive, steps)] for person in persons] for persons in situations]
        self.alive: Floats = np.array(alive)
        self.shared_weights = _shared_weights(self.scenarios, self.forecasts.shape[0])
        self.forecasts.reach(0)


def _found_by(detections: Floats, turns: Ints) -> tuple[Floats, Floats]:
    """The limits of the draws with which the drone at a turn finds a person: (n,) each.

    See `world.WorldState._finder`.
    """
    first = np.zeros_like(detections)
    last = detections
    for turn in range(1, int(turns.max(initial=0)) + 1):
        first = np.where(turns >= turn, last, first)
        last = np.where(turns >= turn, last + (1.0 - last) * detections, last)
    return first, last


def _shared_weights(scenarios: Sequence[Scenario], layers: int) -> Floats | None:
    if not scenarios[0].shared_drift:
        return None
    weights = np.zeros((layers, len(scenarios)))
    for number, scenario in enumerate(scenarios):
        own = scenario.persons_to_find[0].drift.weights
        weights[: len(own), number] = own
    return weights


class BatchState:
    """The persons of many searches; `finds_last`: whether the last missing person can be found.

    Attributes:
        step: completed steps of every row: int64, (rows,).
        situation: the number of every row's search in the catalogue: int64, (rows,).
        missing: which persons have not been found: bool, (persons, rows).
        finds: the drone that found each person, numbered throughout the batch, and in which
            cell: int64, (2, persons, rows); the values of missing persons are meaningless.
        beliefs: or None if nothing depends on them.
    """

    def __init__(self, catalogue: Catalogue, rows: int, finds_last: bool) -> None:
        self._scenario = scenario = catalogue.scenarios[0]
        self._size = scenario.grid_size
        self._persons = len(catalogue.forecast_of)
        self._is_rescue = scenario.mission == "rescue"
        self._finds_last = finds_last
        self.catalogue = catalogue
        self.step = np.zeros(rows, np.int64)
        self.situation = np.zeros(rows, np.int64)
        self.missing = np.ones((self._persons, rows), np.bool_)
        self.finds = np.zeros((2, self._persons, rows), np.int64)
        self._entries = np.zeros((self._persons, rows), np.int64)  # in the catalogue's forecasts
        self.beliefs: Beliefs | None = None
        if scenario.keeps_beliefs:
            self.beliefs = Beliefs(self._size, catalogue.forecasts, self._entries)
        self._shared: SharedDrift | None = None  # of every row, if persons drift together
        if catalogue.shared_weights is not None:
            first = np.tile(catalogue.shared_weights[:, :1], rows)
            self._shared = SharedDrift.begun(first, self._persons)
        self._shown_beliefs = self.beliefs if scenario.bayesian_update else None
        self._states = np.zeros((self._persons, rows), np.int64)
        # The counters of a step's drift draws, from the key of the episode on.
        self._counters = np.arange(1, 2 * self._persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self._draws = np.zeros((2 * self._persons, rows), np.uint64)
        self._detection_keys = np.zeros(rows, np.uint64)

    # The start of an episode.

    def begin(self, rows: Ints, keys: Words, situation: Ints) -> None:
        """Start episodes; keys: uint64, (4, n), see `streams.stream_keys`; situation: (n,)."""
        forecasts = self.catalogue.forecasts
        models = self.catalogue.forecast_of.take(situation, axis=1)
        if (certain := forecasts.certain_starts) is not None:  # saves a tenth of a step
            self._states[:, rows] = certain.take(models)
        else:
            draws = self._start_draws(keys[3], situation)
            self._states[:, rows] = forecasts.start(models, draws)
        self.step[rows] = 0
        self.situation[rows] = situation
        self.missing[:, rows] = True
        self._entries[:, rows] = models
        self._draws[:, rows] = self._counters + keys[0]
        self._detection_keys[rows] = keys[1]
        if self.beliefs is not None:
            self.beliefs.forget(rows)
        weights = self.catalogue.shared_weights
        if weights is not None and self._shared is not None:
            new = SharedDrift.begun(weights.take(situation, axis=1), self._persons)
            self._shared.put(rows, new)

    def _start_draws(self, keys: Words, situation: Ints) -> Floats:
        """`world.WorldState._start_draws` for many rows: (persons, n)."""
        weights = self.catalogue.shared_weights
        n = self._persons
        indices = np.arange(n + (weights is not None), dtype=np.uint64)[:, None]
        draws = uniforms(keys, indices)
        if weights is None:
            return draws
        return draws_given(draws[n], draws[:n], weights.take(situation, axis=1))

    def extended(
        self, scenarios: Sequence[Scenario], starting: Ints, cells: Ints | None = None
    ) -> Catalogue:
        """A catalogue for `use` that keeps the searches of episodes other than those starting."""
        going = np.delete(self.situation, starting)
        old = [self.catalogue.scenarios[number] for number in np.unique(going)]
        return Catalogue(scenarios, old, cells)

    def use(self, catalogue: Catalogue, starting: Ints) -> None:
        """Use a catalogue from `extended`."""
        going = np.delete(np.arange(len(self.step)), starting)
        _, index = np.unique(self.situation[going], return_inverse=True)
        self.situation[going] = catalogue.choices + index
        self._entries[:, going] = catalogue.forecast_of.take(self.situation[going], axis=1)
        self._entries[:, going] += self.step[going] * catalogue.forecasts.count
        catalogue.forecasts.reach(int(self.step[going].max(initial=0)))
        if self.beliefs is not None:
            self.beliefs.use(catalogue.forecasts)
        if self._shared is not None:
            self._shared = self._shared.resized(catalogue.forecasts.shape[0])
        self.catalogue = catalogue

    # A step: `observed`, then `search`, then `advance`.

    def observed(self, rows: Ints, cells: Ints) -> Floats:
        """What searches pay for, float64, (n,), in ascending order of rows.

        See `world.WorldState.observed`.
        """
        if not self._scenario.reward_scheme.expected_finds:
            return self.probabilities(rows, cells).astype(np.float64)
        assert self.beliefs is not None
        self.beliefs.begin(rows)
        alive = self.catalogue.alive
        steps = np.minimum(self.step.take(rows), alive.shape[2] - 1)
        worths = self._detections_of(rows) * alive[self.situation.take(rows), :, steps].T
        if self._shared is not None:
            shared = self._shared.take(rows)
            missing = self.missing[:, rows]
            return self.beliefs.added_together(shared, rows, cells, missing, worths)
        return self.beliefs.added_success(rows, cells, worths)

    def search(self, rows: Ints, cells: Ints, drones: Ints) -> Ints:
        """Apply a step's searches: decide which of them find a person, update the beliefs.

        Searches are in ascending order of rows, and within a row of drones, which are numbered
        throughout the batch. Returns the drones that found someone, once for each person.
        """
        turns = self._turns(rows, cells)
        found = [drones[:0]]
        found_in = np.full(self.missing.shape, -1)  # the cells of this step's finds
        findable = self.missing.sum(axis=0) > (0 if self._finds_last else 1)
        for person, at in enumerate(self.person_cells) if self._is_rescue else ():
            right = (at.take(rows) == cells) & (self.missing[person] & findable).take(rows)
            hits = right.nonzero()[0]
            if not hits.size:
                continue
            where = rows.take(hits)
            indices = self.step[where] * self._persons + person
            draws = uniforms(self._detection_keys[where], indices.astype(np.uint64))
            first, last = _found_by(self._detections_of(where)[person], turns.take(hits))
            hits = hits[(draws >= first) & (draws < last)]
            where = rows.take(hits)
            self.missing[person, where] = False
            self.finds[:, person, where] = drones.take(hits), cells.take(hits)
            found_in[person, where] = cells.take(hits)
            found.append(drones.take(hits))
        if self.beliefs is not None:
            self.beliefs.begin(rows)
            self._update_beliefs(self.beliefs, rows, cells, turns, found_in)
        return np.concatenate(found)

    def _turns(self, rows: Ints, cells: Ints) -> Ints:
        """How many drones before it search the same cell of the same row: (n,)."""
        turns = np.zeros(len(rows), np.int64)
        if self._scenario.crash != PASS or not len(rows):  # no two drones share a cell
            return turns
        keys = rows * self._size**2 + cells
        order = keys.argsort(kind="stable")
        _, begins, counts = np.unique(keys[order], return_index=True, return_counts=True)
        turns[order] = np.arange(len(rows)) - begins.repeat(counts)
        return turns

    def _update_beliefs(
        self, beliefs: Beliefs, rows: Ints, cells: Ints, turns: Ints, found_in: Ints
    ) -> None:
        """Apply Bayes' rule to searches, and to the finds in some of the cells."""
        detections = self._detections_of(rows)
        if self._shared is None:
            beliefs.search(rows, cells, detections, turns)
        elif rows.size:
            which = np.unique(rows)
            shared = self._shared.take(which)
            after = beliefs.search_together(
                shared,
                rows,
                cells,
                detections,
                turns,
                found_in=found_in[:, which],
                missing=self.missing[:, which],
            )
            self._shared.put(which, after)

    def _detections_of(self, rows: Ints) -> Floats:
        """Each person's probability of detection in some rows: (persons, n)."""
        return self.catalogue.detections.take(self.situation.take(rows), axis=1)

    def all_found(self, rows: Ints) -> Ints:
        """Some of the rows: in which all persons have been found."""
        found: Ints = rows[~self.missing[:, rows].any(axis=0)]
        return found

    def covered(self) -> Ints:
        """The rows whose coverage mission is complete."""
        if self._is_rescue or self.beliefs is None:
            return np.empty(0, np.int64)
        return (self.beliefs.success() > COVERED_AT).nonzero()[0]

    def advance(self) -> None:
        """Let the persons and the beliefs drift by a step."""
        forecasts = self.catalogue.forecasts
        if self.beliefs is not None:
            self.beliefs.drift()
        draws = uniforms_of(self._draws).reshape(self._persons, 2, -1).swapaxes(0, 1)
        self._states = forecasts.walk(self._states, self._entries, draws)
        self._draws += self._counters[-1]
        self.step += 1
        self._entries += forecasts.count

    # What can be read.

    @property
    def person_cells(self) -> Ints:
        """Every person's cell, y * N + x: int64, (persons, rows)."""
        return self.catalogue.forecasts.cells(self._states, self._entries)

    # The matrices.

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The probability of one cell in the matrix of each of some rows: float32, (n,)."""
        if self._shown_beliefs is None:
            return self._forecast_at(rows, cells)
        begun = self._shown_beliefs.begun[rows]
        values = np.empty(len(rows), np.float32)
        here = rows[begun]
        counted = shown_persons(self.missing[:, rows[begun]])
        values[begun] = self._shown_beliefs.probabilities(here, cells[begun], counted)
        values[~begun] = self._forecast_at(rows[~begun], cells[~begun])
        return values

    def _forecast_at(self, rows: Ints, cells: Ints) -> Singles:
        """`probabilities` as forecasts without searches."""
        if self._persons == 1:
            return self.catalogue.forecasts.probabilities(self._entries[0].take(rows), cells)
        matrices = self._forecasts(rows).reshape(-1, self._size**2)
        return matrices[np.arange(len(rows)), cells]

    def matrices(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, shape (n, N, N)."""
        if self._shown_beliefs is None:
            return self._forecasts(rows)
        begun = self._shown_beliefs.begun[rows]
        here = rows[begun]
        counted = shown_persons(self.missing[:, rows[begun]])
        out = np.empty((len(rows), self._size, self._size), np.float32)
        out[begun] = self._shown_beliefs.matrices(here, counted)
        out[~begun] = self._forecasts(rows[~begun])
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, shape (rows, N, N)."""
        if self._shown_beliefs is not None:
            self._shown_beliefs.write_matrices(shown_persons(self.missing), out)
            others = (~self._shown_beliefs.begun).nonzero()[0]
            out[others] = self._forecasts(others)
        elif self._persons == 1:
            self.catalogue.forecasts.matrices(self._entries[0], out)
        else:
            out[...] = self._forecasts(np.arange(len(out)))

    def _forecasts(self, rows: Ints) -> Singles:
        """The matrices of some rows as forecasts without searches: float32, (n, N, N)."""
        forecasts = self.catalogue.forecasts
        entries = self._entries[:, rows]
        if self._persons == 1:
            return forecasts.matrices(entries[0])
        counted = shown_persons(self.missing[:, rows])
        first = np.take_along_axis(entries, counted.argmax(axis=0)[None], axis=0)
        matrices = forecasts.matrices(first[0])
        mixed = ((entries != first) & counted).any(axis=0)  # a mean of different forecasts
        maps = [
            forecasts.map(np.moveaxis(forecasts.joint(entry), 0, -1), entry)
            for entry in entries[:, mixed]
        ]
        mean = means_over_missing(maps, counted[:, mixed]).T.astype(np.float32)
        matrices[mixed] = mean.reshape(-1, self._size, self._size)
        return matrices
