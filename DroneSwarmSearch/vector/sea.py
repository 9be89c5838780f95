"""The seas of a batch: persons adrift, searches for them, and what is known of them.

`sea.Sea` for many rows at once, each at a step and in an episode of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.streams import GOLDEN, numbers, unit_numbers
from DroneSwarmSearch.vector.beliefs import Beliefs
from DroneSwarmSearch.vector.laws import Followed, LawParameters, Tables

__all__ = ["Seas"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]

_NOTHING: Ints = np.empty(0, np.int64)


class Seas:
    """The persons of many searches.

    Args:
        laws: of the rows.
        detections: every person's probability of detection.
        bayesian: whether the matrices are posteriors given the searches made.
        rows: the number of searches.

    Attributes:
        step: completed steps of every row: int64, (rows,).
        person_cells: y * N + x: int64, (persons, rows).
        missing: who has not been found: bool, (persons, rows).
    """

    def __init__(
        self, laws: Tables | Followed, detections: Sequence[float], bayesian: bool, rows: int
    ) -> None:
        persons = len(detections)
        self._size = laws.grid_size
        self._laws = laws
        self._detections = detections
        self._beliefs = Beliefs(self._size, detections, rows) if bayesian else None
        # What a new episode sets lies in one array, and so do the values that it sets.
        self._state = np.zeros((3 * persons + 3, rows), np.int64)
        self._first_state = np.zeros((3 * persons + 1, rows), np.int64)
        self._see_state()
        # By how much the counter of drift numbers grows up to each of a step's numbers.
        self._in_a_step = np.arange(1, 2 * persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self.missing = np.ones((persons, rows), np.bool_)
        # Of several persons: whose law is shown, and where no single law can be.
        self._leader = np.zeros(rows, np.int64)
        self._mixed = np.zeros(rows, np.bool_)

    def _see_state(self) -> None:
        """Make the views of the state."""
        persons, state = len(self._detections), self._state
        self._at: Ints = state[: 2 * persons].reshape(persons, 2, -1)  # each person's x and y
        self.person_cells: Ints = state[2 * persons : 3 * persons]
        self.step: Ints = state[3 * persons]
        # The key of the episode's drift plus what counts the numbers drawn.
        self._drift_counters, self._detection_keys = state[-2:].view(np.uint64)

    def __getstate__(self) -> dict[str, Any]:
        """Views would be arrays of their own in a copy."""
        views = ("_at", "person_cells", "step", "_drift_counters", "_detection_keys")
        return {name: value for name, value in self.__dict__.items() if name not in views}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._see_state()

    @property
    def laws(self) -> Tables | Followed:
        """The laws of the rows."""
        return self._laws

    def change_laws(self, laws: Tables | Followed, parameters: LawParameters) -> None:
        """Take other laws, which hold those of the rows under way as well."""
        self._laws = laws
        laws.begin(np.arange(len(self.step)), parameters)
        laws.catch_up(self.step)

    def begin(self, rows: Ints, keys: Words, parameters: LawParameters | None) -> None:
        """Start the episodes of some rows.

        Args:
            rows: their numbers.
            keys: of the episodes, for the persons' drift and for the detections: (2, n).
            parameters: of all rows, where those of some may have changed.
        """
        if parameters is not None:
            at, n = parameters.start[..., rows], len(rows)
            self._first_state[: 2 * len(at), rows] = at.reshape(-1, n)
            self._first_state[2 * len(at) : -1, rows] = at[:, 1] * self._size + at[:, 0]
        self._laws.begin(rows, parameters)
        self._state[:-2, rows] = self._first_state.take(rows, axis=1)
        self._state[-2:, rows] = keys.view(np.int64)
        self.missing[:, rows] = True
        if self._beliefs is not None:
            self._beliefs.forget(rows)
        if len(self._detections) > 1:
            self._choose_leaders(rows)

    def advance(self) -> None:
        """Let a step pass in every row: persons drift, and what is known of them."""
        laws, at = self._laws, self._at
        luck = unit_numbers(self._drift_counters + self._in_a_step).reshape(at.shape)
        self._drift_counters += self._in_a_step[-1]
        # As `person.walk`: +1 below one threshold, -1 from there to the other; 2 a - (a or b).
        places = laws.places(at)
        threshold = laws.right.take(places, mode="clip")
        higher = luck < threshold
        threshold += laws.left.take(places, mode="clip")
        either = luck < threshold
        move = higher.view(np.int8)
        move += move
        move -= either.view(np.int8)
        at += move
        np.multiply(at[:, 1], self._size, out=self.person_cells)
        self.person_cells += at[:, 0]
        if self._beliefs is not None:
            self._beliefs.drift(laws)
        laws.advance()
        self.step += 1

    # Searches.

    def search(self, rows: Ints, cells: Ints) -> Ints:
        """Let a step's searches succeed or fail, and take in what they teach.

        Args:
            rows: the row of every search.
            cells: the cell of every search; in a row no two are alike.

        Returns:
            Which searches, by place in the arguments, have found somebody; each at most
            as often as it has found persons.
        """
        found = []
        for person, detection in enumerate(self._detections):
            right = self.person_cells[person].take(rows) == cells
            if len(self._detections) > 1:  # a single person found ends the episode
                right &= self.missing[person].take(rows)
            hits = right.nonzero()[0]
            if hits.size and 0.0 < detection < 1.0:
                where = rows[hits]
                places = self.step[where] * len(self._detections) + person
                luck = numbers(self._detection_keys[where], places.astype(np.uint64))
                hits = hits[luck < detection]
            if hits.size and detection > 0.0:
                self.missing[person, rows[hits]] = False
                found.append(hits)
        finds = np.concatenate(found) if found else _NOTHING
        if finds.size and len(self._detections) > 1:
            self._choose_leaders(np.unique(rows[finds]))
        if self._beliefs is not None:
            self._beliefs.learn(rows, cells, self.missing, self._laws)
        return finds

    def _choose_leaders(self, rows: Ints) -> None:
        """Note whose law is shown: that of those missing, or of all once none is."""
        shown = self._shown_persons(rows)
        self._leader[rows] = leader = shown.argmax(axis=0)
        persons = len(self._detections)
        start = self._first_state[: 2 * persons, rows].reshape(persons, 2, -1)
        theirs = np.take_along_axis(start, leader[None, None], axis=0)
        self._mixed[rows] = ((start != theirs).any(axis=1) & shown).any(axis=0)

    def _shown_persons(self, rows: Ints | slice) -> Flags:
        """The persons over whom the matrix is the mean: (persons, n)."""
        missing = self.missing[:, rows]
        return missing | ~missing.any(axis=0)

    # What is known.

    def shown(self, rows: Ints, cells: Ints) -> Singles:
        """What the matrices of some rows say of a cell of each: float32, (n,)."""
        values = self._laws.shown(self._leaders(rows), rows, cells)
        mixed, known = self._mixed_among(rows), self._known_among(rows)
        if mixed.size:
            here, n = rows[mixed], np.arange(len(mixed))
            y, x = np.divmod(cells[mixed], self._size)
            values[mixed] = self._mean_of_laws(here, lambda of_x, of_y: of_y[n, y] * of_x[n, x])
        if known.size:
            here = rows[known]
            values[known] = self._known().shown(here, cells[known], self._shown_persons(here))
        return values

    def matrices(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, shape (n, N, N)."""
        out = np.empty((len(rows), self._size, self._size), np.float32)
        self._write_laws(rows, out)
        known = self._known_among(rows)
        if known.size:
            here = rows[known]
            out[known] = self._known().matrices(here, self._shown_persons(here))
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, shape (rows, N, N), C-contiguous."""
        if self._beliefs is not None and self._beliefs.begun.any():
            self._beliefs.write_matrices(self._shown_persons(slice(None)), out)
            others = (~self._beliefs.begun).nonzero()[0]
            out[others] = self.matrices(others)
        else:
            alone = len(self._detections) == 1
            self._write_laws(slice(None) if alone else np.arange(len(self.step)), out)

    def _write_laws(self, rows: Ints | slice, out: Singles) -> None:
        """Write what the laws say of some rows; those that have beliefs get something."""
        self._laws.write_matrices(self._leaders(rows), rows, out)
        if isinstance(rows, slice):  # of one person, whose law it is
            return
        mixed = self._mixed_among(rows)
        if mixed.size:
            out[mixed] = self._mean_of_laws(rows[mixed], _outer_products)

    def _leaders(self, rows: Ints | slice) -> Ints | int:
        return self._leader[rows] if len(self._detections) > 1 else 0

    def _mixed_among(self, rows: Ints) -> Ints:
        """Those of some rows, by place, whose matrix is the mean of several laws."""
        if len(self._detections) == 1:
            return _NOTHING
        mixed = self._mixed[rows]
        if self._beliefs is not None:
            mixed &= ~self._beliefs.begun[rows]
        return np.flatnonzero(mixed)

    def _known_among(self, rows: Ints) -> Ints:
        """Those of some rows, by place, that have beliefs."""
        if self._beliefs is None:
            return _NOTHING
        return np.flatnonzero(self._beliefs.begun[rows])

    def _known(self) -> Beliefs:
        assert self._beliefs is not None
        return self._beliefs

    def _mean_of_laws(self, rows: Ints, chance: Callable[[Floats, Floats], Floats]) -> Singles:
        """The mean over the persons shown of what follows from their chances along x and y."""
        shown = self._shown_persons(rows)
        total: Floats | float = 0.0
        for person, counts in enumerate(shown):
            values = chance(*self._laws.marginals(person, rows))
            total = total + values * counts.reshape(-1, *(1,) * (values.ndim - 1))
        number = shown.sum(axis=0).reshape(-1, *(1,) * (values.ndim - 1))
        mean: Singles = (total / number).astype(np.float32)
        return mean


def _outer_products(of_x: Floats, of_y: Floats) -> Floats:
    products: Floats = of_y[:, :, None] * of_x[:, None, :]
    return products
