"""Forecasts that every row computes step by step, without tables."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift.tables import (
    gaussian_cdf,
    moves_between,
    point_mass,
    reachable,
)
from DroneSwarmSearch.vector.arrays import Floats, Ints, Rows, Singles
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts

__all__ = ["OnTheFlyForecasts"]

_CHUNK_BYTES = 2**20
"""The size of the arrays that are computed at a time; larger ones are not faster."""


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
