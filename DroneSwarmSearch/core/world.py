"""The world state: persons adrift, searches for them, and the matrix that the drones observe.

Persons walk only when a search or a picture needs their cells. Every draw belongs to an episode, a
step and a person, so it does not matter when draws are made, or how many at a time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.core.rules import COVERED_AT
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.belief import (
    Belief,
    begun_beliefs,
    mean_forecast,
    mean_over_missing,
    shown_matrix,
)
from DroneSwarmSearch.drift.shared import (
    SharedDrift,
    after_shared_search,
    draws_given,
    shared_added_success,
)

_FEWEST_AHEAD = 8
_MOST_AHEAD = 32
"""The steps that persons walk at a time, because each call has a fixed cost."""


class WorldState:
    """The persons of a search and what is known about them, in one episode after another.

    The matrix shows the beliefs once an episode with `bayesian_update` has seen a search, see
    `belief.shown_matrix`. Beliefs may also be kept without being shown, see
    `Scenario.keeps_beliefs`.

    Attributes:
        persons: all persons, by number.
        missing: the persons not yet found.
        finds: for every person found, the drone that found them, and the cell.
        step: completed steps.
        success: the cumulative probability of success (POS) of all searches so far, or None.
        is_rescue: whether the mission is to find the persons; else nobody is found.
        is_covered: whether a coverage mission is complete.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._models = scenario.forecasts()
        self._persons = scenario.persons_to_find
        self._detections = scenario.detections
        self._keeps_beliefs = scenario.keeps_beliefs
        self._shows_beliefs = scenario.bayesian_update
        self._shared_weights = scenario.shared_weights
        self._pays_expectation = scenario.reward_scheme.expected_finds
        self.is_rescue = scenario.mission == "rescue"
        self.persons = tuple(range(len(self._models)))

    def start(self, streams: Streams, episode: int) -> Singles:
        """Start the episode with this number since the seed; returns as `advance` does."""
        self._streams = streams
        self._episode = episode
        self.step = 0
        self.missing = self.persons
        self.finds: dict[int, tuple[int, int]] = {}
        self._paths: list[list[int]] = []  # each person's states over some steps
        self._paths_first = 0  # the first of these steps
        self._beliefs: list[Belief] | None = None  # from the first search on
        self._shared: SharedDrift | None = None  # the same, if persons drift together
        self.success = 0.0 if self._keeps_beliefs else None
        self.is_covered = False
        return self._shown_matrix()

    # Time.

    def advance(self) -> Singles:
        """Complete a step: the persons and the matrix drift; returns a read-only matrix."""
        if self._beliefs is not None:
            self._beliefs = [belief.after_drift(self.step) for belief in self._beliefs]
        self.step += 1
        return self._shown_matrix()

    def _shown_matrix(self) -> Singles:
        beliefs = self._beliefs if self._shows_beliefs else None
        self._matrix = shown_matrix(self._models, beliefs, self.missing, self.step)
        matrix = self._matrix.copy()
        matrix.setflags(write=False)
        return matrix

    # The persons.

    def person_cell(self, person: int) -> int:
        """A person's current cell, y * N + x."""
        if not self._paths:
            draws = self._start_draws()
            models = zip(self._models, draws, strict=True)
            self._paths = [[int(model.start(draw))] for model, draw in models]
        while self.step >= self._paths_first + len(self._paths[0]):
            self._walk()
        return int(self._models[person].cells(self._paths[person][self.step - self._paths_first]))

    def _start_draws(self) -> Any:
        """A uniform draw for the start of each person; after them comes that of a hypothesis."""
        n = len(self.persons)
        if self._shared_weights is None:
            return self._streams.start.between(self._episode, 0, n)
        *draws, hypothesis = self._streams.start.between(self._episode, 0, n + 1)
        return draws_given(np.array(hypothesis), np.array(draws), self._shared_weights)

    def _walk(self) -> None:
        """Let all persons walk some steps."""
        n = len(self._models)
        known = self._paths_first + len(self._paths[0]) - 1
        steps = min(max(_FEWEST_AHEAD, known), _MOST_AHEAD)
        first = 2 * n * known
        last = 2 * n * (known + steps)
        draws = self._streams.drift.between(self._episode, first, last)
        self._paths = [
            model.walk(path[-1], known, draws[2 * k :: 2 * n], draws[2 * k + 1 :: 2 * n])
            for k, (model, path) in enumerate(zip(self._models, self._paths, strict=True))
        ]
        self._paths_first = known + 1

    # Searches.

    def search(self, searches: Mapping[int, Sequence[int]]) -> set[int]:
        """Let drones, given by cell, search, and update the beliefs; returns those with a find."""
        finders = set()
        found = {}
        for person in self.missing if self.is_rescue else ():
            cell = self.person_cell(person)
            finder = self._finder(person, searches[cell]) if cell in searches else None
            if finder is not None:
                finders.add(finder)
                found[person] = cell
                self.finds[person] = finder, cell
                self.missing = tuple(other for other in self.missing if other != person)
        if self._keeps_beliefs:
            cells = [cell for cell, drones in searches.items() for _ in drones]
            self._update_beliefs(cells, found)
        return finders

    def _update_beliefs(self, cells: Collection[int], found: Mapping[int, int]) -> None:
        """Apply Bayes' rule to searches, and to the finds of persons in some of the cells."""
        beliefs = self._begun_beliefs()
        if self._shared is None:
            self._beliefs = [belief.after_search(cells) for belief in beliefs]
        else:
            self._shared, self._beliefs = after_shared_search(
                self._shared, beliefs, cells, found, self.missing
            )
        failures = [belief.failure for belief in self._beliefs]
        self.success = 1.0 - mean_over_missing(failures, ())
        self.is_covered = not self.is_rescue and self.success > COVERED_AT

    def _begun_beliefs(self) -> list[Belief]:
        """The beliefs, which begin with an episode's first search."""
        if self._beliefs is None:
            self._beliefs = begun_beliefs(self._models, self._detections, self.step)
            if self._shared_weights is not None:
                self._shared = SharedDrift.begun(self._shared_weights, len(self.persons))
        return self._beliefs

    def _finder(self, person: int, drones: Sequence[int]) -> int | None:
        """The first of the drones that search the person's cell who finds the person; or None."""
        detection = self._detections[person]
        if detection == 1.0:
            return drones[0]
        if detection == 0.0:
            return None
        index = self.step * len(self.persons) + person
        [draw] = self._streams.detection.between(self._episode, index, index + 1)
        found = detection  # the probability that drones so far find the person
        for drone in drones:
            if draw < found:
                return drone
            found = found + (1.0 - found) * detection
        return None

    def observed(self, searches: Mapping[int, Sequence[int]]) -> dict[int, float]:
        """What each search pays for, by drone, before `search`.

        The matrix's value for the cell; or, with `RewardScheme.expected_finds`, the added success
        times the probability that the person is alive.
        """
        if self._pays_expectation:
            beliefs = self._begun_beliefs()
            alive = [person.alive(self.step) for person in self._persons]
            cells = [*searches]
            if self._shared is None:
                pairs = zip(beliefs, alive, strict=True)
                added = [belief.added_success(cells, chance) for belief, chance in pairs]
            else:
                added = shared_added_success(self._shared, beliefs, cells, self.missing, alive)
            values = dict(zip(cells, mean_over_missing(added, ()).tolist(), strict=True))
        else:
            values = {cell: self._matrix.item(cell) for cell in searches}
        return {drone: values[cell] for cell, drones in searches.items() for drone in drones}

    # What is shown.

    def prior(self) -> Singles | None:
        """The forecast of the current step if the matrix shows the beliefs; a new array."""
        shows = self._beliefs is not None and self._shows_beliefs
        return mean_forecast(self._models, self.missing, self.step) if shows else None

    def hypotheses(self) -> tuple[tuple[float, ...], ...]:
        """The probability of each hypothesis about each person, as the matrix shows it."""
        if self._beliefs is not None and self._shows_beliefs:
            return tuple(belief.model.hypotheses(belief.mass) for belief in self._beliefs)
        return tuple(tuple(model.weights.tolist()) for model in self._models)
