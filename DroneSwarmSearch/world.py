"""The sea: persons adrift, searches for them, and what is known of where they are.

The environment lets time pass here and asks what the matrix is. Where the persons are is
worked out late: nobody is shown it, so they walk only when a search, a picture or the end
of the tables they need asks for it. Every random number belongs to an episode, a step and
a person, so that the portions in which numbers are drawn change nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import Streams
from DroneSwarmSearch.drift.belief import after_drift, after_unsuccessful_search
from DroneSwarmSearch.drift.person import walk
from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.scenario import Scenario

__all__ = ["WorldState"]

Matrix = NDArray[np.float32]

_AHEAD = 8
"""Steps that persons who have to walk go at first, and more later: each portion costs."""


class WorldState:
    """The persons of a search; `begin` starts an episode, `advance` lets a step pass.

    Args:
        search: the search; its tables are looked up or made at once.

    Attributes:
        everybody: the persons, by number.
        missing: those not yet found.
        finds: for every person found, the drone that found them, and in which cell.
        step: completed steps.
    """

    def __init__(self, search: Scenario) -> None:
        size = search.grid_size
        self._cells = size**2
        self._bayesian = search.bayesian_update
        self._detections = search.detections
        self._forecasts = search.forecasts()
        self._paths_at_start = [[y * size + x] for x, y in search.person_initial_position]
        self._block_steps = self._forecasts[0].block_steps
        self.everybody = tuple(range(len(self._forecasts)))
        self._forecast_at_start = forecast = self._one_forecast(self.everybody)
        if forecast is not None:
            self._shown_at_start = forecast.block(0).matrices_from(0)

    def begin(self, streams: Streams, episode: int) -> Matrix:
        """Start an episode.

        Args:
            streams: the random numbers.
            episode: the episode's number since the seed, which they depend on.

        Returns:
            The matrix of step 0, to hand out; see `advance`.
        """
        self._streams = streams
        self._episode = episode
        self.step = 0
        self.missing = self.everybody
        self.finds: dict[int, tuple[int, int]] = {}
        self._paths = self._paths_at_start  # each person's cells for some steps
        self._paths_begin = 0
        self._beliefs: dict[int, NDArray[np.float64]] = {}  # of persons searched for
        self._forecast = self._forecast_at_start  # whose matrix is the one to show, if there is one
        self._block_end = self._block_steps
        self._show(self._mean()[None] if self._forecast is None else self._shown_at_start)
        first: Matrix = self._handed[0]
        return first

    # Time.

    def advance(self) -> Matrix:
        """Let a step pass: the persons drift, and what is known of them.

        Returns:
            `matrix` of the new step, read-only, to hand out: nothing reads it again, so
            that whatever its owner does to it changes no episode.
        """
        self.step += 1
        if self.step == self._shown_end:
            self._go_on()
        matrix: Matrix = self._handed[self.step - self._shown_first]
        return matrix

    def _go_on(self) -> None:
        """Get the matrices of the present step and, where tables have them, of some more."""
        if self.step == self._block_end:
            self.person_cell(0)  # everybody walks out of the last block
            self._block_end += self._block_steps
        if self._forecast is not None:
            self._show(self._forecast.block(self.step).matrices_from(self.step))
        else:
            for person, belief in self._beliefs.items():
                moves = self._forecasts[person].moves(self.step - 1)
                self._beliefs[person] = after_drift(belief, *moves)
            self._show(self._mean()[None])

    def _show(self, matrices: Matrix) -> None:
        """Take the matrices of some steps: rewards follow from these, users get copies.

        Args:
            matrices: float32, shape (n, N, N): of the present step among others, the first
                of which is a multiple of n.
        """
        self._shown = matrices
        self._shown_first = self.step - self.step % len(matrices)
        self._shown_end = self._shown_first + len(matrices)
        self._handed = matrices.copy()
        self._handed.setflags(write=False)

    # The persons.

    def person_cell(self, person: int) -> int:
        """Where a person is now, y * grid_size + x."""
        if self.step >= self._paths_begin + len(self._paths[0]):
            self._walk_on()
        return self._paths[person][self.step - self._paths_begin]

    def _walk_on(self) -> None:
        """Let everybody walk up to the present step, and a little ahead within the block."""
        n = len(self._forecasts)
        known = self._paths_begin + len(self._paths[0]) - 1
        ahead = known + max(_AHEAD, known)
        steps = min(max(self.step, ahead), self._block_end) - known
        numbers = self._streams.drift.draw(self._episode, 2 * n * steps)
        self._paths = [
            walk(forecast, known, path[-1], numbers[2 * k :: 2 * n], numbers[2 * k + 1 :: 2 * n])
            for k, (forecast, path) in enumerate(zip(self._forecasts, self._paths, strict=True))
        ]
        self._paths_begin = known + 1

    # Searches.

    def search(self, searches: Mapping[int, int]) -> set[int]:
        """Let a step's searches succeed or fail, and take in what they teach.

        Args:
            searches: the drone that searches each cell, by cell.

        Returns:
            The drones that have found somebody.
        """
        finders = set()
        for person in self.missing:
            cell = self.person_cell(person)
            if cell in searches and self._luck(person):
                finders.add(searches[cell])
                self.finds[person] = searches[cell], cell
                self.missing = tuple(other for other in self.missing if other != person)
        if finders and len(self.everybody) > 1 and not self._beliefs:
            self._use_forecast(self._one_forecast(self.missing or self.everybody))
        if self._bayesian:
            self._learn(list(searches))
        return finders

    def _luck(self, person: int) -> bool:
        """Whether a search of a person's cell finds that person in this step."""
        detection = self._detections[person]
        if detection in (0.0, 1.0):
            return detection == 1.0
        row = self._streams.detection.row(self._episode, self.step, len(self.everybody))
        return row[person] < detection

    def _learn(self, cells: Sequence[int]) -> None:
        """Take in that searches of some cells have not found those still missing."""
        if not self._beliefs:
            self._beliefs = {person: self._belief(person) for person in self.everybody}
            self._use_forecast(None)
        for person in self.missing:
            self._beliefs[person], _ = after_unsuccessful_search(
                self._beliefs[person], cells, self._detections[person]
            )

    # What is known.

    def _belief(self, person: int) -> NDArray[np.float64]:
        """The belief about a person, float64, (N, N); the forecast before the first search."""
        belief = self._beliefs.get(person)
        return self._forecasts[person].exact(self.step) if belief is None else belief

    def matrix(self) -> Matrix:
        """The matrix of the present step: float32, shape (N, N), indexed [y, x]; a new array."""
        matrix: Matrix = self._shown[self.step - self._shown_first]
        return matrix.copy()

    def probability(self, cell: int) -> float:
        """What the drones were shown of a cell, y * grid_size + x, before they acted."""
        return self._shown.item((self.step - self._shown_first) * self._cells + cell)

    def _mean(self) -> Matrix:
        """The mean over the persons missing, or over all of them once none is."""
        shown = self.missing or self.everybody
        total = self._belief(shown[0])
        for person in shown[1:]:
            total = total + self._belief(person)
        return (total / len(shown)).astype(np.float32)

    def _use_forecast(self, forecast: ProbabilityMatrix | None) -> None:
        """From the next step on show a forecast's matrices, or means (None)."""
        self._forecast = forecast
        self._shown_end = self.step + 1

    def _one_forecast(self, persons: Sequence[int]) -> ProbabilityMatrix | None:
        """The forecast of some persons if it is one and the same."""
        forecasts = [self._forecasts[person] for person in persons]
        same = all(forecast.parameters == forecasts[0].parameters for forecast in forecasts)
        return forecasts[0] if same else None

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if "_handed" in state:  # no array stays read-only through a pickle
            self._handed = self._handed.copy()
            self._handed.setflags(write=False)
