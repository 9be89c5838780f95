"""The searches that the episodes of a batch draw from, and their forecasts as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.streams import numbers as uniforms
from DroneSwarmSearch.drift.belief import after_drift, over_hypotheses
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.probability_matrix import joint_at_start, matrices_of
from DroneSwarmSearch.drift.tables import Axes, start_marginals, tabulate
from DroneSwarmSearch.scenario import Scenario, checked_persons

__all__ = ["Catalogue", "scenarios_of"]

_BLOCK_STEPS = 32
_BLOCK_BYTES = 2**22

_ABSENT = Drift((0, 0))
"""Stands for the hypotheses that a person has fewer than others; its weight is 0."""


class Catalogue:
    """Searches that differ in their persons only, and the forecasts of these persons.

    Equal persons share a forecast. Forecasts have numbers, and an entry of the tables is one
    step of one forecast: step * `count` + number. The tables grow with the largest step that an
    episode reaches, see `reach`.

    Args:
        scenarios: the searches; all with the same number of persons.
        hypotheses: the least number of hypotheses about each person. Persons with fewer are
            padded with hypotheses of weight 0.
        complete: make the tables for all steps at once.

    Attributes:
        scenarios: see above.
        numbers: the number of each person's forecast in each search: int64, (persons, searches).
        detections: each person's probability of detection: float64, (persons, searches).
        count: the number of different forecasts.
        hypotheses: the hypotheses of each, M.
        complete: see above.
    """

    def __init__(
        self, scenarios: Sequence[Scenario], hypotheses: int = 1, complete: bool = False
    ) -> None:
        self.scenarios = tuple(scenarios)
        self.complete = complete
        self._size, self._limit = scenarios[0].grid_size, scenarios[0].timestep_limit
        different: dict[object, tuple[int, Person]] = {}
        people = [scenario.situation for scenario in scenarios]
        numbers = [
            [different.setdefault(person.key, (len(different), person))[0] for person in persons]
            for persons in people
        ]
        self.numbers: Ints = np.array(numbers).T.copy()
        self.detections: Floats = np.array([scenario.detections for scenario in scenarios]).T.copy()
        persons = [person for _, person in different.values()]
        self.count = len(persons)
        self.hypotheses = most = max(hypotheses, *(len(person.drifts) for person in persons))
        drifts = [
            drift
            for person in persons
            for drift in (*person.drifts, *[_ABSENT] * (most - len(person.drifts)))
        ]
        self._axes = Axes.of(drifts)
        self._priors = [drift.prior for drift in drifts]
        self._weights = np.zeros((self.count, most))
        for weights, person in zip(self._weights, persons, strict=True):
            weights[: len(person.weights)] = person.weights

        # The tables, indexed [entry, ...].
        n, shape = self._size, (0, most, 2, self._size)
        self._factors, self._right, self._left = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        have_prior = [prior is not None for prior in self._priors]
        self._has_prior: Flags = np.logical_or.reduce(np.reshape(have_prior, (-1, most)), axis=1)
        self._joint = np.zeros((0, most, n, n)) if self._has_prior.any() else None
        shows_beliefs = scenarios[0].bayesian_update and not complete
        self._matrices = None if shows_beliefs else np.zeros((0, n, n), np.float32)
        self._cdf: Floats | None = None
        self._filled = 0  # steps
        if complete:
            checks.fits(
                f"the table of matrices for {self.count} different forecasts",
                self._step_bytes * (self._limit + 1),
                grid_size=self._size,
                timestep_limit=self._limit,
            )
        self.reach(self._limit if complete else 0)
        self._make_starts()

    def __len__(self) -> int:
        return len(self.scenarios)

    # Starts.

    def _make_starts(self) -> None:
        """Arrange the cumulative distributions of hypotheses and cells at step 0.

        Each forecast's is a square array, so that two short counts find an entry.
        """
        joint = self.joint(np.arange(self.count)).reshape(self.count, -1)
        possible = joint > 0.0
        self._known = possible.argmax(axis=1) if (possible.sum(axis=1) == 1).all() else None
        self._width = math.isqrt(joint.shape[1] - 1) + 1
        entries = np.full((self.count, self._width**2), 2.0)
        for place, values in zip(entries, joint, strict=True):
            last = values.nonzero()[0][-1]  # every uniform is below the 2 from here on
            place[:last] = values.cumsum()[:last]
        self._blocks = entries.reshape(-1, self._width)
        self._ends = self._blocks[:, -1].reshape(-1, self._width).copy()

    def starts(self, numbers: Ints, keys: Words) -> tuple[Ints, Ints]:
        """The hypothesis and the cell of each person at step 0, see `ProbabilityMatrix.start`.

        Args:
            numbers: the number of each person's forecast: int64, (persons, n).
            keys: the keys of the episodes' start streams: uint64, (n,).
        """
        if self._known is not None:  # saves a tenth of a step
            entry = self._known.take(numbers)
        else:
            places = np.arange(len(numbers), dtype=np.uint64)[:, None]
            above = uniforms(keys, places)[..., None]
            block = np.less_equal(self._ends.take(numbers, 0), above).sum(-1)
            rows = self._blocks.take(block + numbers * self._width, 0)
            entry = block * self._width + np.less_equal(rows, above).sum(-1)
        hypotheses, cells = np.divmod(entry, self._size**2)
        return hypotheses, cells

    # Forecasts.

    def walk_probabilities(
        self, entries: Ints, hypotheses: Ints, coordinates: Ints
    ) -> tuple[Floats, Floats]:
        """The probabilities of moves to the next higher and lower coordinate.

        Args:
            entries: the entry of each person: int64, (persons, n).
            hypotheses: the hypothesis that each person follows, of the same shape.
            coordinates: each person's x and y: int64, (persons, 2, n).

        Returns:
            float64, (persons, 2, n) each.
        """
        axes = (entries * self.hypotheses + hypotheses) * (2 * self._size)
        index = coordinates + axes[:, None]
        index[:, 1] += self._size
        return self._right.take(index, mode="clip"), self._left.take(index, mode="clip")

    def moves(self, entries: Ints) -> tuple[Floats, Floats, Floats, Floats]:
        """The probabilities of moves right, left, down and up: float64, (M, N, n) each."""
        right, left = (
            np.ascontiguousarray(table.take(entries, 0, mode="clip").transpose(2, 1, 3, 0))
            for table in (self._right, self._left)
        )
        return right[0], left[0], right[1], left[1]

    def joint(self, entries: Ints) -> Floats:
        """The probability of each hypothesis and cell: float64, (n, M, N, N)."""
        if self._joint is not None:
            return self._joint.take(entries, 0)
        factors = self._factors.take(entries, 0)
        products: Floats = factors[:, :, 1, :, None] * factors[:, :, 0, None, :]
        return products

    def matrices(self, entries: Ints, out: Singles | None = None) -> Singles:
        """The matrices: float32, (n, N, N)."""
        if self._matrices is not None:
            return self._matrices.take(entries, 0, out=out, mode="clip")
        matrices = matrices_of(self._factors.take(entries, 0))
        if self._joint is not None:
            carried = self._has_prior[entries % self.count]
            joint = self._joint[entries[carried]]
            matrices[carried] = over_hypotheses(joint.swapaxes(0, 1))
        if out is not None:
            out[...] = matrices
        return matrices

    def probabilities(self, entries: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some entries: float32, (n,)."""
        if self._matrices is not None:
            return self._matrices.take(entries * self._size**2 + cells, mode="clip")
        if self._joint is not None:
            return self.matrices(entries).reshape(-1, self._size**2)[np.arange(len(cells)), cells]
        y, x = np.divmod(cells, self._size)
        at_x, at_y = self._factors[entries, :, 0, x], self._factors[entries, :, 1, y]
        products = (at_y.astype(np.float32) * at_x.astype(np.float32)).T
        total: Singles = sum(products[1:], start=products[0])  # in the order of `matrices_of`
        return total

    @property
    def table(self) -> Singles:
        """The matrices of all entries: float32, (entries, N, N), read-only; only if complete."""
        assert self._matrices is not None
        table = self._matrices.view()
        table.flags.writeable = False
        return table

    # Filling the tables.

    @property
    def _step_bytes(self) -> int:
        joint = 8 * self._size**2 if self._joint is not None else 0
        matrices = 4 * self._size**2 if self._matrices is not None else 0
        return self.count * (matrices + self.hypotheses * (3 * 8 * 2 * self._size + joint))

    def reach(self, step: int) -> None:
        """Fill the tables up to this step, at most to the time limit."""
        step = min(step, self._limit)
        while self._filled <= step:
            usual = max(1, min(_BLOCK_STEPS, _BLOCK_BYTES // self._step_bytes), self._filled)
            self._fill(min(usual, self._limit + 1 - self._filled))

    def _fill(self, steps: int) -> None:
        """Fill the tables for some more steps."""
        size, first = self._size, self._filled
        tables = tabulate(
            size,
            self._axes,
            start_marginals(self._priors),
            first=first,
            count=steps,
            cdf=self._cdf,
        )
        shape = (steps * self.count, self.hypotheses, 2, size)
        factors = tables.probability.reshape(steps, *self._weights.shape, 2, size).copy()
        factors[..., 1, :] *= self._weights[..., None]
        factors = factors.reshape(shape)
        right, left = tables.right.reshape(shape), tables.left.reshape(shape)
        self._factors = np.concatenate([self._factors, factors])
        self._right = np.concatenate([self._right, right])
        self._left = np.concatenate([self._left, left])
        self._cdf, self._filled = tables.cdf, first + steps
        if self._joint is not None:
            more = np.empty((len(factors), *self._joint.shape[1:]))
            self._joint = np.concatenate([self._joint, more])
            by_step = self._joint.reshape(-1, self.count, *more.shape[1:])
            for step in range(first, first + steps):
                self._fill_joint(by_step, step)
        if self._matrices is not None:
            kept, self._matrices = self._matrices, None
            new = self.matrices(np.arange(len(kept), len(self._factors)))
            self._matrices = np.concatenate([kept, new])

    def _fill_joint(self, joint: Floats, step: int) -> None:
        """Fill a step of the joint table, indexed [step, number, ...], as `ProbabilityMatrix` does.

        All hypotheses of a forecast with an array as start are carried along by the moves.
        """
        size, most = self._size, self.hypotheses
        shape = (self._filled, self.count, most, 2, size)
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


def scenarios_of(
    scenario: Scenario, situations: object, persons: int | None = None
) -> list[Scenario]:
    """The searches of some situations.

    Args:
        scenario: what they share.
        situations: a sequence, each a `Person` or a sequence of them, all of the same number.
        persons: this number, if it is known.

    Raises:
        TypeError: they are not persons.
        ValueError: there is no situation, a start does not fit on the grid, or situations have
            different numbers of persons.
    """
    what = "a sequence of situations, each a sequence of Person"
    given = checks.items("situations", situations, what)
    if not given:
        raise ValueError(f"situations must hold at least one situation, got {situations!r}")
    made = []
    for place, each in enumerate(given):
        own = checked_persons(f"situations[{place}]", each, scenario.grid_size)
        persons = persons or len(own)
        if len(own) != persons:
            raise ValueError(
                f"situations must all hold the same number of persons, {persons}, got "
                f"{len(own)} in situations[{place}]"
            )
        made.append(scenario.replace(persons=own))
    return made
