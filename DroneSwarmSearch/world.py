"""The world state: persons adrift, searches for them, and the matrix that the drones observe.

Persons move lazily: nobody observes them, so they walk only when a search, a picture or the
end of a block of tables needs their cells. Every random draw belongs to an episode, a step
and a person, so it does not matter when draws are made, or how many at a time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.drift.belief import mean_over_missing
from DroneSwarmSearch.drift.person import start, walk
from DroneSwarmSearch.drift.posteriors import Posteriors
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.rules import COVERED_AT
from DroneSwarmSearch.scenario import Scenario

__all__ = ["WorldState"]

Matrix = NDArray[np.float32]

_STEPS_AHEAD = 8
"""The fewest steps that persons walk at a time, because each call has a fixed cost."""


class WorldState:
    """The persons of a search and what is known about them, in one episode after another.

    `start` begins an episode and `advance` completes a step.

    The matrix comes from one of three sources: the tables of a forecast, if the shown persons
    share one; the mean of several forecasts; or the posteriors, once an episode with
    `bayesian_update` has seen a search. Posteriors may also be kept without being shown, see
    `Scenario.keeps_beliefs`.

    Args:
        scenario: the search.

    Attributes:
        persons: all persons, by number.
        missing: the persons not yet found.
        finds: for every person found, the drone that found them, and the cell.
        step: completed steps.
        success: the cumulative probability of success (POS) of all searches so far, or None
            without posteriors.
        is_rescue: whether the mission is to find the persons; else nobody is found.
        is_covered: whether a coverage mission is complete.
    """

    def __init__(self, scenario: Scenario) -> None:
        size = scenario.grid_size
        self._grid_cells = size**2
        self._detections = scenario.detections
        self._forecasts = scenario.forecasts()
        self._posteriors = (
            Posteriors(self._forecasts, self._detections) if scenario.keeps_beliefs else None
        )
        self._shows_posteriors = scenario.bayesian_update
        self._pays_expectation = scenario.reward_scheme.expected_finds
        self.is_rescue = scenario.mission == "rescue"
        known_starts = [forecast.known_start for forecast in self._forecasts]
        self._start_paths = [[cell or 0] for cell in known_starts]
        self._starts_known = None not in known_starts
        self._hypotheses = [0] * len(self._forecasts)  # that each person follows
        self._block_steps = min(forecast.block_steps for forecast in self._forecasts)
        self.persons = tuple(range(len(self._forecasts)))
        self._start_forecast = self._shared_forecast(self.persons)
        if self._start_forecast is not None:
            self._start_matrices = self._start_forecast.block(0).matrices_at(0)

    def start(self, streams: Streams, episode: int) -> Matrix:
        """Start an episode.

        Args:
            streams: the random streams.
            episode: the number of the episode since the seed, from 0.

        Returns:
            The matrix of step 0, see `advance`.
        """
        self._streams = streams
        self._episode = episode
        self.step = 0
        self.missing = self.persons
        self.finds: dict[int, tuple[int, int]] = {}
        self._paths = self._start_paths  # each person's cells over some steps
        self._paths_first = 0  # the first of these steps
        if not self._starts_known:
            self._paths = self._start_paths.copy()
            self._draw_starts()
        self.success = None if self._posteriors is None else 0.0
        self.is_covered = False
        self._hidden_posteriors: Posteriors | None = None  # from the first search on, unless shown
        self._shown_posteriors: Posteriors | None = None  # from the first search on, if shown
        self._forecast = self._start_forecast  # the source of the matrices, or None
        self._block_end = self._block_steps
        self._loaded_first = 0
        if self._forecast is None:
            self._load_matrices()
        else:
            self._set_matrices(self._start_matrices)
        first: Matrix = self._returned[0]
        return first

    # Time.

    def advance(self) -> Matrix:
        """Complete a step: the persons and the matrix drift.

        Returns:
            The matrix of the new step, float32, shape (N, N), indexed [y, x]: a read-only
            copy for the caller, which the world never reads again.
        """
        self.step += 1
        if self._hidden_posteriors is not None:
            self._hidden_posteriors.drift(self.step - 1)
        if self.step == self._loaded_end:
            if self.step == self._block_end:
                self.person_cell(0)  # the walk must not leave the block of tables
                self._block_end += self._block_steps
            if self._shown_posteriors is not None:
                self._shown_posteriors.drift(self.step - 1)
            self._load_matrices()
        matrix: Matrix = self._returned[self.step - self._loaded_first]
        return matrix

    def _load_matrices(self) -> None:
        """Get the matrix of this step and, from tables, those of the following steps too."""
        self._loaded_first = self.step
        if self._shown_posteriors is not None:
            matrix = self._shown_posteriors.matrix(self.missing)
            matrix.setflags(write=False)
            self._returned: Any = (matrix,)
            self._loaded_end = self.step + 1
            return
        if self._forecast is not None:
            matrices = self._forecast.block(self.step).matrices_at(self.step)
            self._loaded_first -= self.step % len(matrices)
        else:
            matrices = self._mean_forecast()[None]
        self._set_matrices(matrices)

    def _set_matrices(self, matrices: Matrix) -> None:
        self._loaded = matrices
        self._loaded_end = self._loaded_first + len(matrices)
        self._returned = matrices.copy()
        self._returned.setflags(write=False)

    # The persons.

    def _draw_starts(self) -> None:
        """Draw the hypothesis and the cell at step 0 of every person where they are uncertain."""
        draws = self._streams.start.draw(self._episode, len(self.persons))
        for person, (forecast, draw) in enumerate(zip(self._forecasts, draws, strict=True)):
            if forecast.known_start is None:
                self._hypotheses[person], cell = start(forecast, draw)
                self._paths[person] = [cell]

    def person_cell(self, person: int) -> int:
        """A person's current cell, y * N + x."""
        if self.step >= self._paths_first + len(self._paths[0]):
            self._walk()
        return self._paths[person][self.step - self._paths_first]

    def _walk(self) -> None:
        """Let all persons walk to the current step, and some steps ahead within the block."""
        n = len(self._forecasts)
        known = self._paths_first + len(self._paths[0]) - 1
        ahead = known + max(_STEPS_AHEAD, known)
        steps = min(max(self.step, ahead), self._block_end) - known
        draws = self._streams.drift.draw(self._episode, 2 * n * steps)
        self._paths = [
            walk(
                forecast,
                self._hypotheses[k],
                known,
                path[-1],
                draws[2 * k :: 2 * n],
                draws[2 * k + 1 :: 2 * n],
            )
            for k, (forecast, path) in enumerate(zip(self._forecasts, self._paths, strict=True))
        ]
        self._paths_first = known + 1

    # Searches.

    def search(self, searches: Mapping[int, int]) -> set[int]:
        """Resolve the searches of a step, and update the posteriors.

        Args:
            searches: the drone that searches each searched cell, by cell.

        Returns:
            The drones that have found a person.
        """
        finders = set()
        for person in self.missing if self.is_rescue else ():
            cell = self.person_cell(person)
            if cell in searches and self._is_detected(person):
                finders.add(searches[cell])
                self.finds[person] = searches[cell], cell
                self.missing = tuple(other for other in self.missing if other != person)
        if self._posteriors is not None:
            posteriors = self._begun_posteriors(self._posteriors)
            posteriors.search(searches)
            self.success = posteriors.probability_of_success()
            self.is_covered = not self.is_rescue and self.success > COVERED_AT
        if finders and self._shown_posteriors is None and len(self.persons) > 1:
            self._forecast = self._shared_forecast(self.missing or self.persons)
            self._loaded_end = self.step + 1
        return finders

    def _begun_posteriors(self, posteriors: Posteriors) -> Posteriors:
        """The posteriors, which begin with an episode's first search."""
        if self._shown_posteriors is None and self._hidden_posteriors is None:
            posteriors.start(self.step)
            if self._shows_posteriors:
                self._shown_posteriors = posteriors
                self._loaded_end = self.step + 1
            else:
                self._hidden_posteriors = posteriors
        return posteriors

    def _is_detected(self, person: int) -> bool:
        """Whether a search of the person's cell finds the person in this step."""
        detection = self._detections[person]
        if detection in (0.0, 1.0):
            return detection == 1.0
        row = self._streams.detection.row(self._episode, self.step, len(self.persons))
        return row[person] < detection

    # The matrix.

    def matrix(self) -> Matrix:
        """The matrix of the current step: float32, shape (N, N), indexed [y, x]; a new array."""
        if self._shown_posteriors is not None:
            return self._shown_posteriors.matrix(self.missing)
        matrix: Matrix = self._loaded[self.step - self._loaded_first]
        return matrix.copy()

    def prior(self) -> Matrix | None:
        """The forecast of the current step, where `matrix` is the posterior; a new array."""
        return None if self._shown_posteriors is None else self._mean_forecast()

    def loaded_matrices(self) -> tuple[Sequence[Matrix], int]:
        """Matrices of some steps, and the index of the current step's among them.

        Returns:
            Float32 arrays of shape (N, N), for reading only, and the index. The same object
            always holds the matrices of the same steps.
        """
        if self._shown_posteriors is not None:
            return self._returned, 0
        matrices: Any = self._loaded  # float32, (n, N, N)
        return matrices, self.step - self._loaded_first

    def observed(self, searches: Mapping[int, int]) -> dict[int, float]:
        """What each search pays for, by drone, before `search`.

        What the matrix of the current step holds for the searched cell; or, with
        `RewardScheme.expected_finds`, the probability of success that the search adds.

        Args:
            searches: as for `search`.
        """
        if self._pays_expectation:
            assert self._posteriors is not None
            added = self._begun_posteriors(self._posteriors).added_success(searches)
            return dict(zip(searches.values(), added, strict=True))
        if self._shown_posteriors is not None:
            probabilities = self._shown_posteriors.probabilities(searches, self.missing)
            return dict(zip(searches.values(), probabilities, strict=True))
        first = (self.step - self._loaded_first) * self._grid_cells
        item = self._loaded.item
        return {drone: item(first + cell) for cell, drone in searches.items()}

    def hypotheses(self) -> tuple[tuple[float, ...], ...]:
        """The probability of each hypothesis about each person, as far as the matrix shows it."""
        if self._shown_posteriors is not None:
            return self._shown_posteriors.weights()
        return tuple(tuple(forecast.weights.tolist()) for forecast in self._forecasts)

    def _mean_forecast(self) -> Matrix:
        forecasts = [forecast.exact(self.step) for forecast in self._forecasts]
        return mean_over_missing(forecasts, self.missing).astype(np.float32)

    def _shared_forecast(self, persons: Sequence[int]) -> ProbabilityMatrix | None:
        """The forecast of some persons, or None if they differ."""
        first, *others = (self._forecasts[person] for person in persons)
        same = all(forecast.is_same(first) for forecast in others)
        return first if same else None

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if "_returned" in state:  # copies of arrays are writeable
            returned = self._returned
            for matrices in returned if isinstance(returned, tuple) else (returned,):
                matrices.setflags(write=False)
