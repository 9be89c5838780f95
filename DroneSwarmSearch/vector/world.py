"""The world states of a batch: the array form of `core.world.WorldState`.

Each row is at its own step and in its own episode. The last axis of most arrays is the row.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Words
from DroneSwarmSearch._internal.streams import GOLDEN, uniforms, uniforms_of
from DroneSwarmSearch.core.rules import COVERED_AT
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.shared import draws_given
from DroneSwarmSearch.vector.catalogue import Catalogue
from DroneSwarmSearch.vector.knowledge import Knowledge


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


class BatchState:
    """The persons of many searches; `finds_last`: whether the last missing person can be found.

    Attributes:
        step: completed steps of every row: int64, (rows,).
        situation: the number of every row's search in the catalogue: int64, (rows,).
        finds: the drone that found each person, numbered throughout the batch, and in which
            cell: int64, (2, persons, rows); the values of missing persons are meaningless.
        known: what the drones of each row know.
    """

    def __init__(self, catalogue: Catalogue, rows: int, finds_last: bool) -> None:
        self._scenario = scenario = catalogue.scenarios[0]
        self._persons = len(catalogue.forecast_of)
        self._is_rescue = scenario.mission == "rescue"
        self._finds_last = finds_last
        self.catalogue = catalogue
        self.step = np.zeros(rows, np.int64)
        self.situation = np.zeros(rows, np.int64)
        self.finds = np.zeros((2, self._persons, rows), np.int64)
        self.known = Knowledge(catalogue, rows)
        self._states = np.zeros((self._persons, rows), np.int64)
        # The counters of a step's drift draws, from the key of the episode on.
        self._counters = np.arange(1, 2 * self._persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self._draws = np.zeros((2 * self._persons, rows), np.uint64)
        self._detection_keys = np.zeros(rows, np.uint64)

    @property
    def missing(self) -> Flags:
        """Which persons have not been found: bool, (persons, rows)."""
        return self.known.missing[:, :: self.known.observers]

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
        self._draws[:, rows] = self._counters + keys[0]
        self._detection_keys[rows] = keys[1]
        self.known.begin(rows, self.catalogue, situation)

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
        catalogue.forecasts.reach(int(self.step[going].max(initial=0)))
        self.known.use(catalogue, going, self.situation[going], self.step[going])
        self.catalogue = catalogue

    # A step: `tell`, then `observed`, then `search`, then `advance`.

    def observed(self, rows: Ints, cells: Ints) -> Floats:
        """What searches pay for, float64, (n,), in ascending order of rows.

        See `world.WorldState.observed`.
        """
        scheme = self._scenario.reward_scheme
        if not scheme.expected_finds:
            return self.known.probabilities(rows, cells).astype(np.float64)
        alive = self.catalogue.alive
        steps = np.minimum(self.step.take(rows), alive.shape[2] - 1)
        pays = self.known.expected_share if scheme.given_misses else self.known.added_success
        return pays(rows, cells, alive[self.situation.take(rows), :, steps].T)

    def tell(self, rows: Ints, drones: Ints, heard: Flags | None) -> Flags:
        """Who learns of a step's searches: bool, (n, observers).

        Args:
            rows: of the searches, in ascending order.
            drones: of the searches, numbered throughout the batch, in ascending order.
            heard: which drone hears which, see `radio.hearing`: (rows, n_drones, n_drones); None if
                all hear each other.
        """
        everybody = np.ones((len(rows), 1), np.bool_)
        if heard is None:
            return everybody
        told = np.concatenate([everybody, heard[rows, :, drones % heard.shape[1]]], axis=1)
        self.known.part(rows, told)
        return told

    def search(self, rows: Ints, cells: Ints, drones: Ints, told: Flags) -> Ints:
        """Apply a step's searches: decide which of them find a person, update what is known.

        Args:
            rows: of the searches.
            cells: of the searches.
            drones: of the searches, see `tell`.
            told: from `tell`.

        Returns:
            The drones that found someone, once for each person.
        """
        found = np.full(self.missing.shape, -1)
        if self._is_rescue:
            turns = self.known.turns(rows, cells)
            findable = self.missing.sum(axis=0) > (0 if self._finds_last else 1)
            for person, at in enumerate(self.person_cells):
                right = (at.take(rows) == cells) & (self.missing[person] & findable).take(rows)
                hits = right.nonzero()[0]
                if not hits.size:
                    continue
                where = rows.take(hits)
                indices = self.step[where] * self._persons + person
                draws = uniforms(self._detection_keys[where], indices.astype(np.uint64))
                detections = self.known.detections(where)[person]
                first, last = _found_by(detections, turns.take(hits))
                hits = hits[(draws >= first) & (draws < last)]
                found[person, rows.take(hits)] = hits
        persons, found_at = (found >= 0).nonzero()
        which = found[persons, found_at]
        finders: Ints = drones.take(which)
        self.finds[:, persons, found_at] = finders, cells.take(which)
        self.known.update(rows, cells, told, found)
        return finders

    def all_found(self, rows: Ints) -> Ints:
        """Some of the rows: in which all persons have been found."""
        found: Ints = rows[~self.missing[:, rows].any(axis=0)]
        return found

    def covered(self) -> Ints:
        """The rows whose coverage mission is complete."""
        success = None if self._is_rescue else self.known.success()
        if success is None:
            return np.empty(0, np.int64)
        return (success > COVERED_AT).nonzero()[0]

    def advance(self) -> None:
        """Let the persons and the beliefs drift by a step."""
        forecasts = self.catalogue.forecasts
        draws = uniforms_of(self._draws).reshape(self._persons, 2, -1).swapaxes(0, 1)
        self._states = forecasts.walk(self._states, self.known.entries, draws)
        self._draws += self._counters[-1]
        self.step += 1
        self.known.advance()

    # What can be read.

    @property
    def person_cells(self) -> Ints:
        """Every person's cell, y * N + x: int64, (persons, rows)."""
        return self.catalogue.forecasts.cells(self._states, self.known.entries)
