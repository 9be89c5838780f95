"""The forecasts of a batch: the distribution of each row's persons at the row's own step.

`TabulatedForecasts` looks forecasts up in tables: fast where many rows share few forecasts.
`OnTheFlyForecasts` computes them step by step: right where every row has its own drift, or
where tables of a whole episode would be too large. Both use the functions of
`probability_matrix` and agree with the single environment bit for bit.

The last axis of the arrays is the row, so that the values of one cell or one person in all
rows are adjacent in memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Ints, Rows, Singles
from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift import person as person_rules
from DroneSwarmSearch.drift.tables import (
    gaussian_cdf,
    moves_between,
    point_mass,
    reachable,
)

__all__ = ["DriftParameters", "Forecasts", "OnTheFlyForecasts"]

_CHUNK_BYTES = 2**20
"""The size of the arrays that are computed at a time; larger ones are not faster."""


class DriftParameters(NamedTuple):
    """The parameters on which the forecasts of a batch depend.

    Attributes:
        start: each person's cell at step 0: int64, shape (persons, 2, rows), x first.
        drift: cells per step: float64, shape (2, rows), x first.
        disperse_constant: float64, shape (rows,).
    """

    start: Ints
    drift: Floats
    disperse_constant: Floats


class Forecasts(ABC):
    """The interface of both kinds of forecasts.

    Forecasts may keep pointers: integers for each row that are set when an episode begins
    and grow by a constant in every step. They live in an array of the caller, who sets and
    increments all of a row's counters at once.

    Attributes:
        grid_size: cells along each side, N.
        increments: the growth of the pointers in a step: int64, shape (pointers, 1).
    """

    grid_size: int
    increments: Ints

    @abstractmethod
    def bind(self, now: Ints, first: Ints) -> None:
        """Keep the pointers in these arrays.

        Args:
            now: the pointers at the present steps: int64, shape (pointers, rows).
            first: the pointers at step 0, of the same shape.
        """

    def walk(self, coordinates: Ints, draws: Ints) -> None:
        """Move all persons by a step, as `person.walk` does.

        Args:
            coordinates: the persons' x and y: int64, shape (persons, 2, rows); overwritten.
            draws: the random draws, see `streams.numerators`, of the same shape.
        """
        coordinates += person_rules.moves(draws, *self._move_limits(coordinates))

    @abstractmethod
    def _move_limits(self, coordinates: Ints) -> tuple[NDArray[Any], NDArray[Any]]:
        """The probabilities of +1, and of +1 or -1, times 2**53, at these coordinates."""

    @abstractmethod
    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        """Set the forecasts of the next episodes of some rows.

        Args:
            rows: their numbers.
            parameters: the parameters of all rows.
        """

    @abstractmethod
    def begin(self, rows: Ints) -> None:
        """Put some rows at step 0; the caller sets their pointers."""

    @abstractmethod
    def catch_up(self, steps: Ints) -> None:
        """Advance rows that are all at step 0 to these steps: int64, shape (rows,)."""

    @abstractmethod
    def advance(self, beginning: Ints) -> None:
        """Advance all rows by a step; the caller has advanced their pointers.

        Args:
            beginning: rows that are put at step 0 instead.
        """

    @abstractmethod
    def marginals(self, person: int | Ints, rows: Rows) -> tuple[Floats, Floats]:
        """The probabilities of each column and of each row of the grid: (rows, N) each."""

    @abstractmethod
    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of moves right, left, down and up: (N, rows) each."""

    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        """Write the matrices of some rows: float32, shape (rows, N, N)."""
        x, y = self.marginals(person, rows)
        # Faster than `np.multiply` where the inner axis is short.
        np.einsum("ry,rx->ryx", y.astype(np.float32), x.astype(np.float32), out=out)

    @abstractmethod
    def probabilities(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some rows: float32, shape (n,)."""


class OnTheFlyForecasts(Forecasts):
    """The forecasts of every row at its present step, without pointers.

    Args:
        grid_size: cells along each side, N.
        parameters: the rows' parameters.
    """

    def __init__(self, grid_size: int, parameters: DriftParameters) -> None:
        persons, _, rows = parameters.start.shape
        self.grid_size = grid_size
        self.increments = np.empty((0, 1), np.int64)
        self._axes = axes = 2 * persons  # x and y of each person
        self._start = np.empty((axes, rows), np.int64)
        self._drift = np.empty((axes, rows))
        self._constant = np.empty(rows)
        self._step = np.zeros(rows)
        # The distribution function F of the next step, padded as in `point_mass`.
        self._next_cdf = np.empty((grid_size + 2, axes, rows))
        self._probability, self._right, self._left = (
            np.empty((grid_size, axes, rows)) for _ in range(3)
        )
        self._offsets = np.arange(axes * rows).reshape(persons, 2, rows)
        self._chunk = max(1, _CHUNK_BYTES // (8 * axes * (grid_size + 2)))

    def bind(self, now: Ints, first: Ints) -> None:
        pass

    def _move_limits(self, coordinates: Ints) -> tuple[Floats, Floats]:
        index = coordinates * self._offsets.size
        index += self._offsets
        right = self._right.reshape(-1).take(index, mode="clip")
        left = self._left.reshape(-1).take(index, mode="clip")
        return right * DENOMINATOR, (right + left) * DENOMINATOR

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        persons = len(parameters.start)
        self._start[:, rows] = parameters.start[..., rows].reshape(self._axes, -1)
        self._drift[:, rows] = np.tile(parameters.drift[:, rows], (persons, 1))
        self._constant[rows] = parameters.disperse_constant[rows]

    def begin(self, rows: Ints) -> None:
        self._rewind(rows)
        for first in range(0, len(rows), self._chunk):
            self._compute(rows[first : first + self._chunk])

    def _rewind(self, rows: Ints) -> None:
        """Make step 0 the next step of some rows."""
        self._step[rows] = 0.0
        self._next_cdf[..., rows] = point_mass(self.grid_size, self._start[:, rows])

    def catch_up(self, steps: Ints) -> None:
        for step in range(int(steps.max())):
            rows = np.flatnonzero(steps > step)
            self._step[rows] += 1.0
            self._compute(rows)

    def advance(self, beginning: Ints) -> None:
        self._step += 1.0
        if beginning.size:
            self._rewind(beginning)
        for first in range(0, len(self._step), self._chunk):
            self._compute(slice(first, first + self._chunk))

    def _compute(self, rows: Rows) -> None:
        """Compute the present step of some rows, and the F of the step after it."""
        before = self._next_cdf[..., rows]
        target = gaussian_cdf(
            self.grid_size,
            self._start[:, rows],
            self._drift[:, rows],
            self._constant[rows],
            self._step[rows] + 1.0,
        )
        after = np.empty_like(before)
        after[0], after[-1] = 0.0, 1.0
        reachable(before, target, out=after[1:-1])
        probability, right, left = moves_between(before, after)
        self._next_cdf[..., rows] = after
        self._probability[..., rows] = probability
        self._right[..., rows] = right
        self._left[..., rows] = left

    def marginals(self, person: int | Ints, rows: Rows) -> tuple[Floats, Floats]:
        axis = 2 * np.asarray(person)
        x, y = self._probability[:, axis, rows], self._probability[:, axis + 1, rows]
        return np.ascontiguousarray(x.T), np.ascontiguousarray(y.T)

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        x, y = np.s_[:, 2 * person, rows], np.s_[:, 2 * person + 1, rows]
        return self._right[x], self._left[x], self._right[y], self._left[y]

    def probabilities(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        y, x = np.divmod(cells, self.grid_size)
        axis = 2 * np.asarray(person)
        of_x = self._probability[x, axis, rows].astype(np.float32)
        of_y = self._probability[y, axis + 1, rows].astype(np.float32)
        values: Singles = of_y * of_x
        return values
