"""The forecasts of a batch: the distribution of each row's persons at the row's own step.

`TabulatedForecasts` looks forecasts up in tables: fast where many rows share few forecasts.
`OnTheFlyForecasts` computes them step by step: right where every row has its own drift, or
where tables of a whole episode would be too large. Both use the functions of
`drift.tables` and agree with the single environment bit for bit.

The last axis of most arrays is the row, so that the values of one cell or one person in all
rows are adjacent in memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats, Ints, Rows, Singles
from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift import person as person_rules
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import (
    Axes,
    dispersion_rate,
    distribution,
    exchange_rate,
    moves_between,
    reachable,
    start_distribution,
    start_marginals,
)

__all__ = ["DriftParameters", "Forecasts", "Mixtures", "OnTheFlyForecasts"]

_CHUNK_BYTES = 2**20
"""The size of the arrays that are computed at a time; larger ones are not faster."""

_ABSENT = Drift((0, 0))
"""Stands for the hypotheses that a person has fewer than others; its weight is 0."""


class DriftParameters(NamedTuple):
    """The drift parameters on which the forecasts of a batch depend.

    Attributes:
        start: each person's cell at step 0: int64, shape (persons, 2, rows), x first.
        drift: cells per step: float64, shape (2, rows), x first.
        disperse_constant: float64, shape (rows,).
    """

    start: Ints
    drift: Floats
    disperse_constant: Floats

    def as_numbers(self, rows: Rows = slice(None)) -> Floats:
        """Each person's forecast in some rows as five numbers: shape (persons, rows, 5)."""
        start = self.start[..., rows]
        persons, _, count = start.shape
        forecasts = np.empty((persons, count, 5))
        forecasts[..., :2] = start.swapaxes(1, 2)
        forecasts[..., 2:4] = self.drift[:, rows].T
        forecasts[..., 4] = self.disperse_constant[rows]
        return forecasts


class Mixtures(NamedTuple):
    """The parameters of n forecasts, each a mixture of M hypotheses.

    Forecasts with fewer hypotheses are padded with hypotheses of weight 0 after their own.

    Attributes:
        axes: the drift along x and y under each hypothesis: shape (n, M, 2), x first.
        weights: the probability of each hypothesis at step 0: shape (n, M).
        priors: the starts that are arrays, (N, N), by number of the forecast and hypothesis.
    """

    axes: Axes
    weights: Floats
    priors: dict[tuple[int, int], Floats]

    @classmethod
    def of_numbers(cls, forecasts: Floats) -> Mixtures:
        """The forecasts of drift parameters, see `DriftParameters.as_numbers`: shape (n, 5)."""
        start, drift, constant = np.split(forecasts[:, None], (2, 4), axis=2)
        zeros = np.zeros_like(start)
        diffusion = np.broadcast_to(dispersion_rate(constant), start.shape)
        return cls(Axes(start, zeros, drift, zeros, diffusion, zeros), np.ones(start.shape[:2]), {})

    @classmethod
    def of_persons(cls, persons: Sequence[Person]) -> Mixtures:
        """The forecasts of some persons."""
        most = max(len(person.drifts) for person in persons)
        padding = [most - len(person.drifts) for person in persons]
        pairs = [*zip(persons, padding, strict=True)]
        drifts = [drift for person, more in pairs for drift in (*person.drifts, *[_ABSENT] * more)]
        weights = np.array([(*person.weights, *[0.0] * more) for person, more in pairs])
        axes = Axes(*(values.reshape(-1, most, 2) for values in Axes.of(drifts)))
        priors = {
            divmod(place, most): drift.prior
            for place, drift in enumerate(drifts)
            if drift.prior is not None
        }
        return cls(axes, weights, priors)

    def starts(self) -> Sequence[Floats | None] | None:
        """The starts along each axis in the form that `tables.tabulate` takes."""
        if not self.priors:
            return None
        return start_marginals(map(self.priors.get, np.ndindex(self.weights.shape)))


class Forecasts(ABC):
    """The interface of both kinds of forecasts.

    Forecasts have numbers. Two persons in a row have the same forecast if their numbers are
    equal. Forecasts keep pointers for each row: for each person an entry, which follows from
    the number and the step, then the offsets for x and for y of what belongs to the person's
    hypothesis and step. The pointers are set when an episode begins and grow by a constant in
    every step. They live in an array of the caller, who sets and increments all of a row's
    counters at once.

    Attributes:
        grid_size: cells along each side, N.
        hypotheses: the hypotheses of each forecast, M.
        increments: the growth of the pointers in a step: int64, shape (3 persons, 1).
    """

    grid_size: int
    hypotheses: int
    increments: Ints

    def bind(self, now: Ints, first: Ints) -> None:
        """Keep the pointers in these arrays.

        Args:
            now: the pointers at the current steps: int64, shape (3 persons, rows).
            first: the pointers at step 0, of the same shape.
        """
        persons = len(now) // 3
        self._now, self._first = now, first
        self.entries: Ints = now[:persons]
        self._offsets: Ints = now[persons:].reshape(persons, 2, -1)

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
    def numbers_of(self, rows: Ints, parameters: DriftParameters) -> Ints:
        """The numbers of the persons' next forecasts in some rows: int64, (persons, n).

        Args:
            rows: their numbers.
            parameters: the drift parameters of all rows.
        """

    def assign(self, rows: Ints, numbers: Ints, hypotheses: Ints) -> None:
        """Set the pointers of the next episodes of some rows.

        Args:
            rows: their numbers.
            numbers: the number of each person's forecast: int64, (persons, n).
            hypotheses: the hypothesis that each person follows, of the same shape.
        """
        entries, offsets = self._pointers(rows, numbers, hypotheses)
        self._first[:, rows] = np.concatenate([entries, offsets.reshape(-1, len(rows))])

    @abstractmethod
    def _pointers(self, rows: Ints, numbers: Ints, hypotheses: Ints) -> tuple[Ints, Ints]:
        """The pointers at step 0: entries, (persons, n), and offsets, (persons, 2, n)."""

    @abstractmethod
    def begin(self, rows: Ints) -> None:
        """Put some rows at step 0; the caller has set their pointers."""

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
    def factors(self, person: int | Ints, rows: Rows) -> Floats:
        """See `probability_matrix.matrices_of`: float64, shape (rows, M, 2, N)."""

    @abstractmethod
    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of moves right, left, down and up: (M, N, rows) each."""

    def joint(self, person: int, rows: Rows) -> Floats:
        """The probability of each hypothesis and cell: float64, shape (M, N, N, rows)."""
        x, y = np.ascontiguousarray(self.factors(person, rows).transpose(2, 1, 3, 0))
        products: Floats = y[:, :, None] * x[:, None]
        return products

    def joint_at(self, person: int, rows: Ints, cells: Ints) -> Floats:
        """The probability of each hypothesis and one cell in each of some rows: (M, n)."""
        factors, n = self.factors(person, rows), np.arange(len(rows))
        y, x = np.divmod(cells, self.grid_size)
        products: Floats = factors[n, :, 1, y] * factors[n, :, 0, x]
        return products.T

    @abstractmethod
    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        """Write the matrices of some rows: float32, shape (rows, N, N)."""

    @abstractmethod
    def probabilities(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some rows: float32, shape (n,)."""


class OnTheFlyForecasts(Forecasts):
    """The forecasts of every row at its current step.

    The entries are the forecasts' numbers, and the offsets are constant.

    Args:
        grid_size: cells along each side, N.
        mixtures: the forecasts, none with a start that is an array. For drift parameters, the
            forecast of person k in row i has the number k * rows + i.
        persons: the number of persons in each row.
        rows: the number of rows.
    """

    def __init__(self, grid_size: int, mixtures: Mixtures, persons: int, rows: int) -> None:
        self.grid_size = grid_size
        self.hypotheses = hypotheses = mixtures.weights.shape[1]
        self.increments = np.zeros((3 * persons, 1), np.int64)
        self._shape = persons, hypotheses, 2, rows  # of values for each axis
        axes = 2 * persons * hypotheses
        self._columns = np.stack(mixtures.axes)
        self._weights = mixtures.weights
        self._axes = np.zeros((len(self._columns), axes, rows))
        self._step = np.zeros(rows)
        # The distribution function F of the next step, padded as in `start_distribution`.
        self._next_cdf = np.empty((grid_size + 2, axes, rows))
        self._probability, self._right, self._left = (
            np.empty((grid_size, axes, rows)) for _ in range(3)
        )
        self._chunk = max(1, _CHUNK_BYTES // (8 * axes * (grid_size + 2)))

    def numbers_of(self, rows: Ints, parameters: DriftParameters) -> Ints:
        persons, _, _, count = self._shape
        mixtures = Mixtures.of_numbers(parameters.as_numbers(rows).reshape(-1, 5))
        numbers = np.arange(persons)[:, None] * count + rows
        self._columns[:, numbers] = np.stack(mixtures.axes).reshape(-1, *numbers.shape, 1, 2)
        if persons > 1:  # those who start together have one number
            start = parameters.start[..., rows]
            same = (start[:, None] == start).all(axis=2)
            numbers = np.take_along_axis(numbers, same.argmax(axis=1), axis=0)
        return numbers

    def _pointers(self, rows: Ints, numbers: Ints, hypotheses: Ints) -> tuple[Ints, Ints]:
        persons, count, _, all_rows = self._shape
        axis = 2 * (np.arange(persons)[:, None] * count + hypotheses)
        return numbers, (axis[:, None] + np.arange(2)[:, None]) * all_rows + rows

    def _move_limits(self, coordinates: Ints) -> tuple[Floats, Floats]:
        index = coordinates * self._axes[0].size
        index += self._offsets
        right = self._right.reshape(-1).take(index, mode="clip")
        left = self._left.reshape(-1).take(index, mode="clip")
        return right * DENOMINATOR, (right + left) * DENOMINATOR

    def begin(self, rows: Ints) -> None:
        self._rewind(rows)
        for first in range(0, len(rows), self._chunk):
            self._compute(rows[first : first + self._chunk])

    def _rewind(self, rows: Ints) -> None:
        """Make step 0 the next step of some rows."""
        columns = self._columns[:, self.entries[:, rows]]  # (values, persons, n, M, 2)
        axes = columns.transpose(0, 1, 3, 4, 2).reshape(len(columns), -1, len(rows))
        self._axes[..., rows] = axes
        self._step[rows] = 0.0
        self._next_cdf[..., rows] = start_distribution(self.grid_size, Axes(*axes))

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
        """Compute the current step of some rows, and the F of the step after it."""
        axes, step = Axes(*self._axes[..., rows]), self._step[rows]
        before = self._next_cdf[..., rows]
        target = distribution(self.grid_size, axes, step + 1.0)
        after = np.empty_like(before)
        after[0], after[-1] = 0.0, 1.0
        reachable(before, target, out=after[1:-1])
        rate = exchange_rate(axes.diffusion, axes.shift(self.grid_size, step))
        probability, right, left = moves_between(before, after, rate)
        self._next_cdf[..., rows] = after
        self._probability[..., rows] = probability
        self._right[..., rows] = right
        self._left[..., rows] = left

    def factors(self, person: int | Ints, rows: Rows) -> Floats:
        probability = self._probability.reshape(self.grid_size, *self._shape)
        here = probability[:, person, :, :, rows]
        # NumPy puts the axis of indices first, if there is one.
        moved = (
            here.transpose(3, 1, 2, 0) if isinstance(rows, slice) else here.transpose(0, 2, 3, 1)
        )
        factors = np.ascontiguousarray(moved)
        if self.hypotheses > 1:
            factors[:, :, 1] *= self._weights[self.entries[person, rows]][..., None]
        return factors

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        right, left = (
            moves.reshape(self.grid_size, *self._shape)[:, person, ..., rows].swapaxes(0, 1)
            for moves in (self._right, self._left)
        )
        return right[:, :, 0], left[:, :, 0], right[:, :, 1], left[:, :, 1]

    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        factors = self.factors(person, rows).astype(np.float32)
        # Faster than `np.multiply` where the inner axis is short.
        np.einsum("ry,rx->ryx", factors[:, 0, 1], factors[:, 0, 0], out=out)
        for hypothesis in range(1, self.hypotheses):
            out += np.einsum("ry,rx->ryx", factors[:, hypothesis, 1], factors[:, hypothesis, 0])

    def probabilities(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        y, x = np.divmod(cells, self.grid_size)
        probability = self._probability.reshape(self.grid_size, *self._shape)
        of_x, of_y = probability[x, person, :, 0, rows], probability[y, person, :, 1, rows]
        if self.hypotheses > 1:
            of_y *= self._weights[self.entries[person, rows]]
        products = of_y.astype(np.float32) * of_x.astype(np.float32)
        values: Singles = products[:, 0]
        for hypothesis in range(1, self.hypotheses):
            values = values + products[:, hypothesis]
        return values
