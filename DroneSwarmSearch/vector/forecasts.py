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
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift import person as person_rules
from DroneSwarmSearch.vector.arrays import Floats, Ints, Rows, Singles

__all__ = ["DriftParameters", "Forecasts"]


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

    def writes_in_background(self, out: Singles) -> bool:
        """Whether `write_next` should write the matrices, on other threads."""
        return False

    def write_next(self, beginning: Ints, out: Singles, foreground: Callable[[], None]) -> None:
        """Write the matrices of the next step in the background of the present one.

        Args:
            beginning: rows that will be at step 0; their first pointers are set.
            out: for the matrix of each row's only person: float32, shape (rows, N, N).
            foreground: the rest of the step.
        """
        raise NotImplementedError

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
