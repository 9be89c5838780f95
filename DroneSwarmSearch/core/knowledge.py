"""What is known about the persons of one search, given searches and finds.

`vector.knowledge` has the array form.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.belief import (
    Belief,
    begun_beliefs,
    drifted,
    mean_forecast,
    mean_over_missing,
    of_each_kind,
    shown_matrix,
)
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.drift.shared import SharedDrift, after_shared_search, shared_added_success


class Knowledge:
    """What is known about the persons in an episode: by all drones together, or by one of them.

    Beliefs begin with the first search that is known of, see `belief.begun_beliefs`. They may be
    kept without being shown, see `Scenario.keeps_beliefs`.

    Args:
        scenario: the search.
        models: the drift model of each person.
        keeps_beliefs: whether to compute the posteriors.

    Attributes:
        step: completed steps.
        missing: the persons of whose find nothing is known.
        success: the cumulative probability of success (POS) of the known searches, or None without
            beliefs.
    """

    def __init__(
        self, scenario: Scenario, models: Sequence[DriftModel], keeps_beliefs: bool
    ) -> None:
        self._models = models
        self._persons = scenario.persons_to_find
        self._detections = scenario.detections
        self._shared_weights = scenario.shared_weights
        self._keeps_beliefs = keeps_beliefs
        self._shows_beliefs = scenario.bayesian_update

    def start(self) -> None:
        """Start an episode."""
        self.step = 0
        self.missing = tuple(range(len(self._models)))
        self.success = 0.0 if self._keeps_beliefs else None
        self._beliefs: list[Belief] | None = None  # from the first search on
        self._shared: SharedDrift | None = None  # the same, if persons drift together

    def copy(self) -> Knowledge:
        """The same knowledge of a single drone, which keeps beliefs only if it shows them."""
        twin = copy.copy(self)  # attributes are replaced, never changed in place
        if not self._shows_beliefs:
            twin._keeps_beliefs = False
            twin._beliefs = None
        return twin

    def advance(self) -> None:
        """Complete a step: the beliefs drift."""
        if self._beliefs is not None:
            self._beliefs = drifted(self._beliefs, self.step)
        self.step += 1

    def update(self, cells: Sequence[int], found: Mapping[int, int]) -> None:
        """Apply Bayes' rule to a step's searches of cells, and to finds: persons, by cell."""
        if found:
            self.missing = tuple(person for person in self.missing if person not in found)
        if not self._keeps_beliefs:
            return
        beliefs, shared = self._begun()
        if shared is None:
            self._beliefs = of_each_kind(lambda belief: belief.after_search(cells), beliefs)
        else:
            self._shared, self._beliefs = after_shared_search(
                shared, beliefs, cells, found, self.missing
            )
        failures = [belief.failure for belief in self._beliefs]
        self.success = 1.0 - mean_over_missing(failures, ())

    def added_success(self, cells: Sequence[int]) -> Floats:
        """What a search of each cell adds to the success, if the person is alive: (n,)."""
        beliefs, shared = self._begun()
        alive = [person.alive(self.step) for person in self._persons]
        if shared is None:
            pairs = zip(beliefs, alive, strict=True)
            added = [belief.added_success(cells, chance) for belief, chance in pairs]
        else:
            added = shared_added_success(shared, beliefs, cells, self.missing, alive)
        return mean_over_missing(added, ())

    def expected_share(self, cells: Sequence[int]) -> Floats:
        """The share of the persons that a search of each cell finds in the mean: (n,).

        Given all that is known, persons who are missing have been missed so far.
        """
        beliefs, _ = self._begun()
        shares = np.zeros((len(beliefs), len(cells)))
        for person in self.missing:
            belief = beliefs[person]
            worth = belief.detection * self._persons[person].alive(self.step)
            shares[person] = worth * belief.map().reshape(-1)[cells]
        return mean_over_missing(list(shares), ())

    def _begun(self) -> tuple[list[Belief], SharedDrift | None]:
        """The beliefs, which begin with the first search, and what they share."""
        if self._beliefs is not None:
            return self._beliefs, self._shared
        beliefs = begun_beliefs(self._models, self._detections, self.step)
        if self._shared_weights is None:
            return beliefs, None
        return beliefs, SharedDrift.begun(self._shared_weights, len(self._models))

    # What is shown.

    @property
    def _shown_beliefs(self) -> list[Belief] | None:
        return self._beliefs if self._shows_beliefs else None

    def matrix(self) -> Singles:
        """The matrix, for reading only: float32, (N, N)."""
        return shown_matrix(self._models, self._shown_beliefs, self.missing, self.step)

    def prior(self) -> Singles | None:
        """The forecast of the current step if the matrix shows the beliefs; a new array."""
        if self._shown_beliefs is None:
            return None
        return mean_forecast(self._models, self.missing, self.step)

    def hypotheses(self) -> tuple[tuple[float, ...], ...]:
        """The probability of each hypothesis about each person, as the matrix shows it."""
        beliefs = self._shown_beliefs
        if beliefs is None:
            return tuple(tuple(model.weights.tolist()) for model in self._models)
        return tuple(belief.model.hypotheses(belief.mass) for belief in beliefs)
