"""What a swarm knows of every person: the exact posteriors, kept by the swarm itself.

The environment shows one matrix, the mean over the persons still missing, and perhaps
without what the searches have taught. Who knows the scenario, the searches made and what
was shown can tell more: each person's own posterior, and in most cases who was found, which
observations do not say. The arithmetic is that of the environment (`belief`), in the same
order and to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations, islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import after_drift, after_unsuccessful_search
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["BeliefTracker"]

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

MOST_EXPLANATIONS = 4096
"""How many sets of persons are tried, smallest first, to explain what is shown."""

ROUNDING = 1e-5
"""How far what is shown may be from what an explanation says, as a share of the cell's
probability: some roundings of single precision. To the last bit would do in this package's
environments; matrices that went through other libraries are less exact."""


class BeliefTracker:
    """What is known of the persons of one search.

    In every step, `observe` what is shown, choose, and tell by `acted` what was chosen.

    Neither observations nor a drone's infos say which of several persons was found (a batch's
    infos do, but policies are not shown them): it is inferred from how the matrix shown
    changes. Persons of whom all the same is known and shown cannot be told apart, and one of
    them that was found is still held to be missing; the mean over the missing is the same.

    Copies share the forecasts and the arrays, which are never changed, so that they cost little.

    Args:
        scenario: the parameters of the search.

    Attributes:
        scenario: the same.
        forecasts: each person's forecast.
        step: completed steps.
        missing: the persons not yet found, by number, as far as can be told; in rising
            order, never none.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.forecasts = scenario.forecasts()
        self.step = 0
        self.missing = tuple(range(len(self.forecasts)))
        self._beliefs: tuple[Floats, ...] | None = None  # None: nobody has searched yet
        self._suspects: tuple[int, ...] = ()  # whom the last searches may have found

    def __deepcopy__(self, memo: dict[int, Any]) -> BeliefTracker:
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)  # all of it is replaced, never changed
        return twin

    # What is known.

    def belief(self, person: int) -> Floats:
        """Where a person is who has not been found.

        float64, shape (N, N), indexed [y, x]; a new array.
        """
        if self._beliefs is None:
            return self.forecasts[person].exact(self.step)
        return self._beliefs[person].copy()

    @property
    def beliefs(self) -> Floats:
        """`belief` of every person, float64, shape (persons, N, N); of no use for those found."""
        return np.array([self.belief(person) for person in range(len(self.forecasts))])

    @property
    def success(self) -> Floats:
        """How likely a search of each cell finds somebody missing, POS, in the mean over them.

        float64, shape (N, N), indexed [y, x]: the mean of POD x belief.
        """
        detections = self.scenario.detections
        total = np.zeros((self.scenario.grid_size,) * 2)
        for person in self.missing:
            total += detections[person] * self.belief(person)
        return total / len(self.missing)

    def shown(self, missing: Sequence[int] | None = None) -> Singles:
        """The matrix that the environment shows while some persons are missing.

        Args:
            missing: these; without it, those held to be missing.

        Returns:
            float32, shape (N, N), indexed [y, x].
        """
        persons = self.missing if missing is None else missing
        if self.scenario.bayesian_update and self._beliefs is not None:
            return self._mean([self._beliefs[person] for person in persons])
        forecasts = [self.forecasts[person] for person in persons]
        if all(forecast.parameters == forecasts[0].parameters for forecast in forecasts):
            return forecasts[0].at(self.step)
        return self._mean([forecast.exact(self.step) for forecast in forecasts])

    @staticmethod
    def _mean(matrices: Sequence[Floats]) -> Singles:
        total = matrices[0]
        for matrix in matrices[1:]:
            total = total + matrix
        return (total / len(matrices)).astype(np.float32)

    # What happens.

    def observe(self, matrix: Singles) -> None:
        """Take in the matrix shown in this step, which may tell who was found in the last.

        The smallest set of persons whom the last searches may have found and whose find
        explains the matrix is taken to be found; where no set explains it, nobody.

        Args:
            matrix: float32, shape (N, N), indexed [y, x].
        """
        if not self._suspects or len(self.missing) == 1:
            return
        nearly = None
        for missing in islice(self._explanations(), MOST_EXPLANATIONS):
            expected = self.shown(missing)
            if np.array_equal(expected, matrix):
                self.missing = missing
                return
            if nearly is None and np.allclose(expected, matrix, rtol=ROUNDING, atol=1e-12):
                nearly = missing
        if nearly is not None:
            self.missing = nearly

    def _explanations(self) -> Iterator[tuple[int, ...]]:
        """Who may be missing now, beginning with all those who were."""
        for count in range(len(self._suspects) + 1):
            for found in combinations(self._suspects, count):
                missing = tuple(person for person in self.missing if person not in found)
                if missing:
                    yield missing

    def acted(self, cells: Sequence[Cell], actions: Iterable[int]) -> None:
        """Take in a step: searches that have not found those still missing, then drift.

        Args:
            cells: every drone's (x, y) before the step.
            actions: what each of them does, see `rules.Action`.
        """
        size = self.scenario.grid_size
        searched = [
            y * size + x
            for (x, y), action in zip(cells, actions, strict=True)
            if action == Action.SEARCH
        ]
        self._suspects = ()
        if searched:
            self._learn(searched)
        if self._beliefs is not None:
            self._beliefs = tuple(
                after_drift(belief, *forecast.moves(self.step))
                for belief, forecast in zip(self._beliefs, self.forecasts, strict=True)
            )
        self.step += 1

    def _learn(self, searched: list[int]) -> None:
        """Bayes' rule for searches that have not found those still missing."""
        beliefs = [self.belief(person) for person in range(len(self.forecasts))]
        suspects = []
        for person in self.missing:
            detection = self.scenario.detections[person]
            if detection > 0.0 and beliefs[person].reshape(-1)[searched].any():
                suspects.append(person)
            beliefs[person], _ = after_unsuccessful_search(beliefs[person], searched, detection)
        self._suspects, self._beliefs = tuple(suspects), tuple(beliefs)
