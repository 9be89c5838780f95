"""The belief about every person, tracked by the swarm itself.

The matrix is the mean over the missing persons, and may ignore searches. A swarm can compute
each person's exact posterior, bit for bit, and in most cases who has been found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from itertools import combinations, islice, product
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import MOVES, Cell
from DroneSwarmSearch.core.moves import moved, searched
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.belief import (
    Belief,
    begun_beliefs,
    drifted,
    of_each_kind,
    shown_matrix,
)
from DroneSwarmSearch.drift.shared import SharedDrift, after_shared_search

MOST_SETS = 4096  # how many sets of found persons are compared with the matrix, smallest first
HEADINGS = frozenset(map(Action, range(len(MOVES))))  # the actions that move a drone

FOLLOWED = 16
"""Steps for which an `Outlook` follows what a planned search finds; by then it has spread."""

TOLERANCE = 1e-5  # largest relative error of a matching matrix that went through another library


class BeliefTracker:
    """The belief about every person of one search.

    In every step, call `observe` with the matrix, choose the actions, and call `update` with them.
    Who was found is inferred from the matrix. Of persons with equal beliefs, one that was found may
    still count as missing, which does not change the mean.

    Copies are cheap; they share the forecasts and the beliefs, which never change.

    Args:
        scenario: the parameters of the search.

    Attributes:
        missing: the persons who count as missing, by number in ascending order; at least one.
        headings: the latest move of each drone, an `Action`; `Action.IDLE` before the first.
        in_range: the drones whose cells are known, by number; all unless they have radios.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.forecasts = scenario.forecasts()
        self.step = 0
        self.missing = tuple(range(len(self.forecasts)))
        self.headings = (int(Action.IDLE),) * scenario.n_drones
        self.in_range = tuple(range(scenario.n_drones))
        self._beliefs: tuple[Belief, ...] | None = None  # None before the first search
        self._perhaps_found: tuple[int, ...] = ()  # by the latest searches
        self._shared: SharedDrift | None = None  # of persons who drift together
        self._latest: _LatestSearches | None = None  # the same before the latest searches

    def __deepcopy__(self, memo: dict[int, Any]) -> BeliefTracker:
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)  # attributes are replaced, never changed in place
        return twin

    def belief(self, person: int) -> Floats:
        """Where a missing person is: float64, shape (N, N), indexed [y, x]; a new array."""
        if self._beliefs is None:
            return self.forecasts[person].exact(self.step)
        return self._beliefs[person].map().copy()

    def joint(self, person: int) -> Floats:
        """The probability of the person's states, see `DriftModel`; a new array."""
        if self._beliefs is None:
            return self.forecasts[person].joint(self.step)
        return self._beliefs[person].mass.copy()

    @property
    def success(self) -> Floats:
        """Probability of success (POS) of searching each cell: float64, shape (N, N), [y, x].

        The mean over the missing persons of probability of detection x belief, x the probability
        of being alive for those with `survival`. In the coverage mission, it is unknown who would
        have been found, so each person counts as much as the probability that no search so far
        has found them.
        """
        success: Floats = Outlook(self, 0).success[0]
        return success

    def success_ahead(self, steps: int) -> Floats:
        """`success` now and in some later steps, if nobody searches in between: a new array.

        float64, shape (steps + 1, N, N), indexed [steps from now, y, x].
        """
        return Outlook(self, steps).success

    def worth(self, person: int, step: int) -> float:
        """What turns a missing person's `weighed` mass into `success`, before the mean."""
        who = self.scenario.persons_to_find[person]
        failure = 1.0
        if self._beliefs is not None and self._shared is None:
            failure = self._beliefs[person].failure
        return who.probability_of_detection * failure * who.alive(step)

    def weighed(self, person: int) -> Floats:
        """`joint`; for persons who drift together in a coverage mission, as without the searches.

        Each layer then counts as much as the probability that no search so far has found the person
        in it.
        """
        mass = self.joint(person)
        if self._shared is None or self.scenario.mission != "coverage":
            return mass
        missing = np.ones(len(self.forecasts), np.bool_)
        weighed: Floats = mass * self._shared.worths(missing)[person][:, None, None]
        return weighed

    def matrix(self, missing: Sequence[int] | None = None) -> Singles:
        """The matrix shown while some persons, by default `missing`, are: float32, (N, N)."""
        persons = self.missing if missing is None else missing
        beliefs = self._beliefs if self.scenario.bayesian_update else None
        return shown_matrix(self.forecasts, beliefs, persons, self.step).copy()

    def observe(self, matrix: Singles) -> None:
        """Infer from this step's matrix, float32, shape (N, N), who was found in the last step.

        The smallest set of persons whose find explains the matrix counts as found, if any.
        """
        if not self._perhaps_found or len(self.missing) == 1:
            return
        closest = None
        for twin in islice(self._after_possible_finds(), MOST_SETS):
            expected = twin.matrix()
            if np.array_equal(expected, matrix):
                closest = twin
                break
            if closest is None and np.allclose(expected, matrix, rtol=TOLERANCE, atol=1e-12):
                closest = twin
        if closest is not None:
            self.__dict__.update(closest.__dict__)

    def _after_possible_finds(self) -> Iterator[BeliefTracker]:
        """What the swarm knows if some persons have been found, starting with nobody."""
        for count in range(len(self._perhaps_found) + 1):
            for found in combinations(self._perhaps_found, count):
                missing = tuple(person for person in self.missing if person not in found)
                if not missing:
                    continue
                if self._latest is None:
                    twin = copy(self)
                    twin.missing = missing
                    yield twin
                    continue
                for cells in product(*(self._latest.likeliest(person) for person in found)):
                    yield self._after_finds(dict(zip(found, cells, strict=True)), missing)

    def _after_finds(self, found: dict[int, int], missing: tuple[int, ...]) -> BeliefTracker:
        """What the swarm knows if persons who drift together have been found in some cells."""
        assert self._latest is not None
        shared, beliefs = self._latest.after(found, missing)
        twin = copy(self)
        twin.missing = missing
        twin._shared = shared
        twin._beliefs = tuple(drifted(beliefs, self.step - 1))
        return twin

    def update(self, cells: Sequence[Cell], actions: Sequence[int]) -> None:
        """Advance by a step in which the drones, in some cells (x, y), take actions."""
        actions = [*map(int, actions)]
        before = [cell_number(x, y, self.scenario.grid_size) for x, y in cells]
        after = moved(self.scenario, before, actions)
        self.learn(searched(self.scenario, after, actions), actions)

    def learn(self, searched: Sequence[int], actions: Sequence[int]) -> None:
        """Advance by a step: searches that did not find those still missing, then drift.

        Args:
            searched: the cells, y * N + x, each as often as it was searched.
            actions: of all drones; `Action.IDLE` where it is not known.
        """
        self.headings = tuple(
            int(action) if action in HEADINGS else before
            for action, before in zip(actions, self.headings, strict=True)
        )
        self._perhaps_found = ()
        self._latest = None
        if searched:
            self._update_beliefs([*searched])
        if self._beliefs is not None:
            self._beliefs = tuple(drifted(self._beliefs, self.step))
        self.step += 1

    def _update_beliefs(self, searched: list[int]) -> None:
        """Apply Bayes' rule for unsuccessful searches."""
        if self._beliefs is None:
            beliefs = begun_beliefs(self.forecasts, self.scenario.detections, self.step)
        else:
            beliefs = list(self._beliefs)
        self._perhaps_found = tuple(
            person
            for person in self.missing
            if beliefs[person].detection > 0.0 and beliefs[person].map().reshape(-1)[searched].any()
        )
        weights = self.scenario.shared_weights
        if weights is not None:
            shared = self._shared or SharedDrift.begun(weights, len(beliefs))
            self._latest = _LatestSearches(shared, tuple(beliefs), tuple(searched))
            self._shared, beliefs = self._latest.after({}, self.missing)
            self._beliefs = tuple(beliefs)
            return
        before = [beliefs[person] for person in self.missing]
        after = of_each_kind(lambda belief: belief.after_search(searched), before)
        for person, belief in zip(self.missing, after, strict=True):
            # The factor counts in coverage missions only, see `success`.
            is_coverage = self.scenario.mission == "coverage"
            failure = belief.failure if is_coverage else beliefs[person].failure
            beliefs[person] = belief._replace(failure=failure)
        self._beliefs = tuple(beliefs)


class _LatestSearches(NamedTuple):
    """What was known of persons who drift together before a step's searches, and their cells."""

    shared: SharedDrift
    beliefs: tuple[Belief, ...]
    cells: tuple[int, ...]

    def after(
        self, found: dict[int, int], missing: tuple[int, ...]
    ) -> tuple[SharedDrift, list[Belief]]:
        """What is known after the searches, if they find some persons in some cells."""
        return after_shared_search(self.shared, self.beliefs, self.cells, found, missing)

    def likeliest(self, person: int) -> list[int]:
        """The searched cells where a person may have been, the likeliest first."""
        at = self.beliefs[person].map().reshape(-1)[[*self.cells]]
        order = np.argsort(-at, kind="stable")
        return [self.cells[number] for number in order if at[number] > 0.0]


class Outlook:
    """The success of searches in the next steps, less what planned searches find before them.

    `success` is the probability that a search of each cell is the first to find, as in
    `BeliefTracker.success`: float64, shape (steps + 1, N, N), indexed [steps from now, y, x].
    Do not update the tracker while the outlook is in use.
    """

    def __init__(self, tracker: BeliefTracker, steps: int) -> None:
        size = tracker.scenario.grid_size
        self._tracker = tracker
        self._masses = {person: [tracker.weighed(person)] for person in tracker.missing}
        ahead = range(tracker.step, tracker.step + steps + 1)
        self._worths = {
            person: [tracker.worth(person, step) for step in ahead] for person in tracker.missing
        }
        self.success = np.zeros((steps + 1, size, size))
        for person, masses in self._masses.items():
            model = tracker.forecasts[person]
            for step in range(tracker.step, tracker.step + steps):
                masses.append(model.forward(masses[-1], step))
            for total, worth, mass in zip(self.success, self._worths[person], masses, strict=True):
                total += worth * model.map(mass)
        self.success /= len(tracker.missing)

    def search(self, cell: Cell, ahead: int) -> None:
        """Plan a search of a cell (x, y) some steps from now: subtract what it finds."""
        x, y = cell
        last = min(len(self.success) - 1, ahead + FOLLOWED)
        first = self._tracker.step
        for person, masses in self._masses.items():
            model = self._tracker.forecasts[person]
            detection = self._tracker.scenario.detections[person]
            found = np.zeros_like(masses[ahead])
            states = model.states(y * model.grid_size + x)
            found.reshape(-1)[states] = detection * masses[ahead].reshape(-1)[states]
            if not found.any():
                continue
            for later in range(ahead, last + 1):
                masses[later] -= found
                worth = self._worths[person][later] / len(self._masses)
                self.success[later] -= worth * model.map(found)
                if later < last:
                    found = model.forward(found, first + later)
