"""The forecasts of a batch as tables: the array form of `ProbabilityMatrix`, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles
from DroneSwarmSearch.drift.belief import after_drift, drift, over_hypotheses
from DroneSwarmSearch.drift.model import DriftModel, Forecasts
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import (
    Axes,
    joint_at_start,
    matrices_of,
    moves,
    start_marginals,
    tabulate,
)

__all__ = ["ForecastTables"]

_ABSENT = Drift((0, 0))
"""Stands for the hypotheses that a person has fewer than others; its weight is 0."""


class ForecastTables(Forecasts):
    """Forecasts of which all steps so far are tables, indexed [entry, ...].

    Args:
        persons: the persons of the models.
        models: their models.
        options: see `Forecasts`.
    """

    def __init__(
        self, persons: Sequence[Person], models: Sequence[DriftModel], **options: Any
    ) -> None:
        super().__init__(models, **options)
        n, most = self._size, self.hypotheses
        drifts = [
            drift
            for person in persons
            for drift in (*person.drifts, *[_ABSENT] * (most - len(person.drifts)))
        ]
        self._axes = Axes.of(drifts)
        self._priors = [drift.prior for drift in drifts]
        self._weights = np.zeros((self.count, most))
        for weights, model in zip(self._weights, models, strict=True):
            weights[: len(model.weights)] = model.weights
        shape = (0, most, 2, n)
        self._factors, self._right, self._left = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        have_prior = [prior is not None for prior in self._priors]
        self._has_prior: Flags = np.logical_or.reduce(np.reshape(have_prior, (-1, most)), axis=1)
        self._joint = np.zeros((0, most, n, n)) if self._has_prior.any() else None
        self._cdf: Floats | None = None
        self._scratch = np.empty((2, 0))  # of `drift`

    # The tables.

    @property
    def step_bytes(self) -> int:
        joint = 8 * self._size**2 if self._joint is not None else 0
        matrices = 4 * self._size**2 if self._matrices is not None else 0
        return self.count * (matrices + self.hypotheses * (3 * 8 * 2 * self._size + joint))

    def _fill(self, steps: int) -> None:
        size, first = self._size, self._filled
        tables = tabulate(
            size,
            self._axes,
            start_marginals(self._priors),
            first=first,
            count=steps,
            cdf=self._cdf,
        )
        self._cdf = tables.cdf
        shape = (steps * self.count, self.hypotheses, 2, size)
        factors = tables.probability.reshape(steps, *self._weights.shape, 2, size).copy()
        factors[..., 1, :] *= self._weights[..., None]
        factors = factors.reshape(shape)
        right, left = tables.right.reshape(shape), tables.left.reshape(shape)
        self._factors = np.concatenate([self._factors, factors])
        self._right = np.concatenate([self._right, right])
        self._left = np.concatenate([self._left, left])
        if self._joint is not None:
            more = np.empty((len(factors), *self._joint.shape[1:]))
            self._joint = np.concatenate([self._joint, more])
            by_step = self._joint.reshape(-1, self.count, *more.shape[1:])
            for step in range(first, first + steps):
                self._fill_joint(by_step, step)

    def _fill_joint(self, joint: Floats, step: int) -> None:
        """Fill a step of the joint table, indexed [step, number, ...], as `ProbabilityMatrix` does.

        All hypotheses of a forecast with an array as start are carried along by the moves.
        """
        size, most = self._size, self.hypotheses
        shape = (-1, self.count, most, 2, size)
        factors, right, left = (
            table.reshape(shape) for table in (self._factors, self._right, self._left)
        )
        here = factors[step]
        joint[step] = here[..., 1, :, None] * here[..., 0, None, :]
        for number in self._has_prior.nonzero()[0]:
            if step == 0:
                priors = self._priors[number * most : (number + 1) * most]
                joint[0, number] = joint_at_start(here[number], self._weights[number], priors)
                continue
            to_higher, to_lower = right[step - 1, number], left[step - 1, number]
            joint[step, number] = after_drift(
                joint[step - 1, number],
                to_higher[:, 0],
                to_lower[:, 0],
                to_higher[:, 1],
                to_lower[:, 1],
            )

    # The forecast.

    def joint(self, entries: Ints) -> Floats:
        if self._joint is not None:
            return self._joint.take(entries, 0)
        factors = self._factors.take(entries, 0)
        products: Floats = factors[:, :, 1, :, None] * factors[:, :, 0, None, :]
        return products

    def _computed(self, entries: Ints) -> Singles:
        matrices = matrices_of(self._factors.take(entries, 0))
        if self._joint is not None:
            carried = self._has_prior[entries % self.count]
            joint = self._joint[entries[carried]]
            matrices[carried] = over_hypotheses(joint.swapaxes(0, 1))
        return matrices

    def probabilities(self, entries: Ints, cells: Ints) -> Singles:
        if self._matrices is not None or self._joint is not None:
            return super().probabilities(entries, cells)
        y, x = np.divmod(cells, self._size)
        at_x, at_y = self._factors[entries, :, 0, x], self._factors[entries, :, 1, y]
        products = (at_y.astype(np.float32) * at_x.astype(np.float32)).T
        total: Singles = sum(products[1:], start=products[0])  # in the order of `matrices_of`
        return total

    def drift(self, mass: Floats, entries: Ints) -> None:
        kind = mass.dtype
        right, left = (
            np.ascontiguousarray(table.take(entries, 0, mode="clip").transpose(2, 1, 3, 0), kind)
            for table in (self._right, self._left)
        )
        if self._scratch.shape[1:] != mass.shape:
            self._scratch = np.empty((2, *mass.shape), mass.dtype)
        higher, lower = self._scratch
        drift(mass, (right[0], left[0]), (right[1], left[1]), (higher, lower), mass)

    # Persons.

    def walk(self, states: Ints, entries: Ints, draws: Floats) -> Ints:
        size = self._size
        rows = states // size  # hypothesis * N + y
        hypotheses = rows // size
        index = np.empty((2, *states.shape), np.int64)
        np.subtract(states, rows * size, out=index[0])
        np.subtract(rows, hypotheses * size, out=index[1])
        index[1] += size
        index += (entries * self.hypotheses + hypotheses) * (2 * size)
        higher, either = self._right.take(index, mode="clip"), self._left.take(index, mode="clip")
        either += higher
        along_x, along_y = moves(draws, higher, either)
        after: Ints = states + along_x + np.multiply(along_y, size, dtype=np.int64)
        return after
