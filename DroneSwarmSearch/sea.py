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

from DroneSwarmSearch.belief import after_drift, after_fruitless_search
from DroneSwarmSearch.person import walk
from DroneSwarmSearch.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.streams import Streams

__all__ = ["Sea"]

Matrix = NDArray[np.float32]

_AHEAD = 8
"""Steps that persons who have to walk go at first, and more later: each portion costs."""


class Sea:
    """The persons of a search; `begin` starts an episode, `advance` lets a step pass.

    Args:
        search: the search; its tables are looked up or made at once.

    Attributes:
        everybody: the persons, by number.
        missing: those not yet found.
        step: completed steps.
        matrix: the matrix of this step, float32, shape (N, N), indexed [y, x]; read-only.
            With several persons it is the mean over those missing, or over all of them
            once none is.
    """

    def __init__(self, search: Scenario) -> None:
        size = search.grid_size
        self._bayesian = search.bayesian_update
        self._detections = search.detections
        self._laws = search.laws()
        self._paths_at_start = [[y * size + x] for x, y in search.persons]
        self._block_steps = self._laws[0].block_steps
        self.everybody = tuple(range(len(self._laws)))
        self._law_at_start = self._one_law(self.everybody)
        self._matrices_at_start = self._ready_made(self._law_at_start, 0)
        self._rewind()

    def begin(self, streams: Streams, episode: int) -> None:
        """Start an episode.

        Args:
            streams: the random numbers.
            episode: the episode's number since the seed, which they depend on.
        """
        self._streams = streams
        self._episode = episode
        self._rewind()

    def _rewind(self) -> None:
        self.step = 0
        self.missing = self.everybody
        self._paths = self._paths_at_start  # each person's cells for some steps
        self._paths_begin = 0
        self._beliefs: dict[int, NDArray[np.float64]] = {}  # of persons searched for
        self._law = self._law_at_start  # whose matrix is the one to show, if there is one
        # The matrices of the block of steps that ends before `_block_end`; None where one
        # has not been made yet, or depends on searches.
        self._block_end = self._block_steps
        self._matrices = self._matrices_at_start
        self.matrix = self._matrix_now()

    # Time.

    def advance(self) -> Matrix:
        """Let a step pass: the persons drift, and what is known of them; returns the matrix."""
        self.step += 1
        if self.step == self._block_end:
            self._enter_block()
        matrix = self._matrices[self.step - self._block_end]
        if matrix is None:
            matrix = self._drifted_matrix()
        self.matrix = matrix
        return matrix

    def _enter_block(self) -> None:
        """Go on to the next block of the laws' tables; everybody walks out of the last one."""
        self.person_cell(0)
        self._block_end += self._block_steps
        self._fetch_matrices()

    def _drifted_matrix(self) -> Matrix:
        """The matrix where none is ready-made; beliefs have drifted since the last step."""
        for person, belief in self._beliefs.items():
            self._beliefs[person] = after_drift(belief, *self._laws[person].moves(self.step - 1))
        return self._matrix_now()

    # The persons.

    def person_cell(self, person: int) -> int:
        """Where a person is now, y * grid_size + x."""
        if self.step >= self._paths_begin + len(self._paths[0]):
            self._walk_on()
        return self._paths[person][self.step - self._paths_begin]

    def _walk_on(self) -> None:
        """Let everybody walk up to the present step, and a little ahead within the block."""
        n = len(self._laws)
        known = self._paths_begin + len(self._paths[0]) - 1
        ahead = known + max(_AHEAD, known)
        steps = min(max(self.step, ahead), self._block_end) - known
        numbers = self._streams.drift.draw(self._episode, 2 * n * steps)
        self._paths = [
            walk(law, known, path[-1], numbers[2 * k :: 2 * n], numbers[2 * k + 1 :: 2 * n])
            for k, (law, path) in enumerate(zip(self._laws, self._paths, strict=True))
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
                self.missing = tuple(other for other in self.missing if other != person)
        if finders and len(self.everybody) > 1:
            self._choose_law()
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
            self._law = None
            self._fetch_matrices()
        for person in self.missing:
            self._beliefs[person], _ = after_fruitless_search(
                self._beliefs[person], cells, self._detections[person]
            )

    # What is known.

    def _belief(self, person: int) -> NDArray[np.float64]:
        """What is known of a person, float64, shape (N, N); the law while nobody has searched."""
        belief = self._beliefs.get(person)
        return self._laws[person].exact(self.step) if belief is None else belief

    def _matrix_now(self) -> Matrix:
        """The matrix of the present step."""
        if self._law is not None:
            return self._law.at(self.step)
        shown = self.missing or self.everybody
        total = self._belief(shown[0])
        for person in shown[1:]:
            total = total + self._belief(person)
        matrix = (total / len(shown)).astype(np.float32)
        matrix.flags.writeable = False
        return matrix

    def _choose_law(self) -> None:
        """Note whether one law's ready-made matrix is the one to show."""
        self._law = None if self._beliefs else self._one_law(self.missing or self.everybody)
        self._fetch_matrices()

    def _one_law(self, persons: Sequence[int]) -> ProbabilityMatrix | None:
        """The law of some persons if it is one and the same."""
        laws = [self._laws[person] for person in persons]
        same = all(law.parameters == laws[0].parameters for law in laws)
        return laws[0] if same else None

    def _fetch_matrices(self) -> None:
        self._matrices = self._ready_made(self._law, self._block_end - self._block_steps)

    def _ready_made(self, law: ProbabilityMatrix | None, first: int) -> list[Matrix | None]:
        """The matrices of a law's block of steps, which fills up as they are made."""
        return [None] * self._block_steps if law is None else law.block(first).matrices

    # Arrays do not stay read-only through a pickle: matrices are made anew.

    def __getstate__(self) -> dict[str, Any]:
        made_anew = ("matrix", "_matrices", "_matrices_at_start")
        return {**self.__dict__, **dict.fromkeys(made_anew)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._matrices_at_start = self._ready_made(self._law_at_start, 0)
        self._fetch_matrices()
        self.matrix = self._matrix_now()
