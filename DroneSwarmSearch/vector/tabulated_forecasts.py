"""Forecasts in tables that all rows share, and the choice between tables and none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints, Rows, Singles
from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift.belief import after_drift, over_hypotheses
from DroneSwarmSearch.drift.probability_matrix import joint_at_start, matrices_of
from DroneSwarmSearch.drift.tables import Axes, tabulate
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.forecasts import (
    DriftParameters,
    Forecasts,
    Mixtures,
    OnTheFlyForecasts,
)
from DroneSwarmSearch.vector.threads import parts_of, run_in_parts

__all__ = [
    "TABLE_BYTES",
    "TabulatedForecasts",
    "check_table",
    "choose_forecasts",
    "distinct",
    "forecasts_of_situations",
    "table_bytes",
]

TABLE_BYTES = 64 * 2**20
"""The largest tables that a batch makes unless it needs them or is asked for them."""

_BLOCK_STEPS = 32


class TabulatedForecasts(Forecasts):
    """Tables of all forecasts, filled as far as the rows have come.

    An entry of the tables is one step of one forecast. Entries have the number of the
    forecast times the steps in an episode, plus the step.

    Args:
        grid_size: cells along each side, N.
        steps: the last step of an episode.
        mixtures: the forecasts, numbered in this order.
        persons: the number of persons in each row.
        drift_parameters: the forecasts as five numbers, if they have this form, see `distinct`.
    """

    def __init__(
        self,
        grid_size: int,
        steps: int,
        mixtures: Mixtures,
        persons: int,
        drift_parameters: Floats | None = None,
    ) -> None:
        self.grid_size = grid_size
        self._steps = steps
        # 0-d: NumPy calculates faster than with an int
        self._cells, self._entry_count = np.array(grid_size**2), np.array(steps + 1)
        self._mixtures = mixtures
        self._drift_parameters = drift_parameters
        count, self.hypotheses = mixtures.weights.shape
        shape = (count, steps + 1, self.hypotheses, 2, grid_size)
        self._factors = np.zeros(shape)
        # The probabilities to move right and left along x, then along y.
        self._moves = np.zeros((count, steps + 1, 2, 2, self.hypotheses, grid_size))
        # Probabilities of +1, and of +1 or -1, times 2**53, rounded up: draws are integers. The
        # steps are the last axis: persons often stay, and so do the cache's lines.
        self._limits = np.zeros((count, self.hypotheses, 2, grid_size, steps + 1, 2), np.int64)
        self._matrices = np.zeros((count, steps + 1, grid_size, grid_size), np.float32)
        # The probability of each hypothesis and cell, if there are starts that are arrays.
        self._joint: Floats | None = None
        if mixtures.priors:
            self._joint = np.zeros((count, steps + 1, self.hypotheses, grid_size, grid_size))
        self._public: Singles | None = None  # the copy that users get
        self._cdf: Floats | None = None
        self._filled = 0
        self._latest = 0  # an upper limit of the rows' steps
        self._make_views()
        self.increments = np.ones((3 * persons, 1), np.int64)
        self._fill()

    def _make_views(self) -> None:
        # One look-up returns both limits as if they were one number.
        self._flat_limits = self._limits.reshape(-1).view(np.complex128)
        self._by_entry = self._matrices.reshape(-1, self.grid_size, self.grid_size)
        self._flat_moves = self._moves.reshape(-1, *self._moves.shape[2:])
        self._flat_factors = self._factors.reshape(-1, *self._factors.shape[2:])
        self._flat_matrices = self._matrices.reshape(-1)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the views, which would become separate arrays in a copy."""
        views = ("entries", "_offsets", "_now", "_first", "_by_entry")
        return {
            name: value
            for name, value in self.__dict__.items()
            if name not in views and not name.startswith("_flat")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._public = None
        self._make_views()

    @property
    def matrices(self) -> Singles:
        """The matrices for users: float32, (entries, N, N), read-only, filled with the tables.

        A copy, because rewards depend on the tables and other libraries ignore the
        read-only flag.
        """
        if self._public is None:
            self._public = np.zeros_like(self._matrices)
            self._public[:, : self._filled] = self._matrices[:, : self._filled]
        matrices = self._public.reshape(self._by_entry.shape)
        matrices.flags.writeable = False
        return matrices

    def _move_limits(self, coordinates: Ints) -> tuple[Ints, Ints]:
        index = np.multiply(coordinates, self._entry_count)
        index += self._offsets
        limits = self._flat_limits.take(index, mode="clip").view(np.int64)
        return limits[..., ::2], limits[..., 1::2]

    def numbers_of(self, rows: Ints, parameters: DriftParameters) -> Ints:
        known = self._drift_parameters
        assert known is not None
        if len(known) == 1:
            return np.zeros((len(self.entries), len(rows)), np.int64)
        wanted = parameters.as_numbers(rows)
        merged = np.concatenate([known, wanted.reshape(-1, 5)])
        _, number = np.unique(merged, axis=0, return_inverse=True)
        return number.reshape(-1)[len(known) :].reshape(wanted.shape[:2])

    def _pointers(self, rows: Ints, numbers: Ints, hypotheses: Ints) -> tuple[Ints, Ints]:
        steps, axes = self._steps + 1, 2 * (numbers * self.hypotheses + hypotheses)
        offsets = (axes[:, None] + np.arange(2)[:, None]) * (self.grid_size * steps)
        return numbers * steps, offsets

    def begin(self, rows: Ints) -> None:
        pass  # the pointers are all there is to set

    def catch_up(self, steps: Ints) -> None:
        self._now += self.increments * steps
        self._latest = int(steps.max())
        while self._filled <= min(self._latest + 1, self._steps):
            self._fill()

    def advance(self, beginning: Ints) -> None:
        self._latest += 1
        if self._latest + 1 == self._filled <= self._steps:  # `write_next` looks a step ahead
            # Rows may have begun new episodes: fill only if one has really come this far.
            self._latest = int((self.entries % (self._steps + 1)).max())
            if self._latest + 1 == self._filled:
                self._fill()

    def write_next(self, beginning: Ints, out: Singles, foreground: Callable[[], None]) -> None:
        """Write the matrices of the next step in the background of the current one.

        Args:
            beginning: rows that will be at step 0; their first pointers are set.
            out: for the matrix of each row's only person: float32, shape (rows, N, N).
            foreground: the rest of the step.
        """
        entries = self.entries[0] + 1
        entries[beginning] = self._first[0].take(beginning)

        def write(rows: slice) -> None:
            self._by_entry.take(entries[rows], 0, out=out[rows], mode="clip")

        run_in_parts(write, parts_of(out), foreground)

    def factors(self, person: int | Ints, rows: Rows) -> Floats:
        factors: Floats = self._flat_factors.take(self._entries_of(person, rows), 0, mode="clip")
        return factors

    def joint(self, person: int, rows: Rows) -> Floats:
        if self._joint is None:
            return super().joint(person, rows)
        return np.ascontiguousarray(np.moveaxis(self._joint_of(person, rows), 0, -1))

    def joint_at(self, person: int, rows: Ints, cells: Ints) -> Floats:
        if self._joint is None:
            return super().joint_at(person, rows, cells)
        joint = self._joint_of(person, rows).reshape(len(rows), self.hypotheses, -1)
        return joint[np.arange(len(rows)), :, cells].T

    def _joint_of(self, person: int, rows: Rows) -> Floats:
        assert self._joint is not None
        by_entry = self._joint.reshape(-1, *self._joint.shape[2:])
        joint: Floats = by_entry.take(self._entries_of(person, rows), 0, mode="clip")
        return joint

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        moves = self._flat_moves.take(self.entries[person, rows], 0, mode="clip")
        (right, left), (down, up) = np.ascontiguousarray(np.moveaxis(moves, 0, -1))
        return right, left, down, up

    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        self._by_entry.take(self._entries_of(person, rows), 0, out=out, mode="clip")

    def probabilities(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        index = np.multiply(self._entries_of(person, rows), self._cells)
        index += cells
        values: Singles = self._flat_matrices.take(index, mode="clip")
        return values

    def _entries_of(self, person: int | Ints, rows: Rows) -> Ints:
        """The entries of one person in each of some rows."""
        entries: Ints
        if isinstance(person, int) and not isinstance(rows, slice):
            entries = self.entries[person].take(rows)
        else:
            entries = self.entries[person, rows]
        return entries

    def _fill(self) -> None:
        """Fill the tables for the next block of steps."""
        first, mixtures = self._filled, self._mixtures
        count = min(_BLOCK_STEPS, self._steps + 1 - first)
        tables = tabulate(
            self.grid_size,
            Axes(*(values.reshape(-1) for values in mixtures.axes)),
            mixtures.starts(),
            first=first,
            count=count,
            cdf=self._cdf,
        )
        self._cdf = tables.cdf
        here = np.s_[:, first : first + count]
        shape = (count, *mixtures.weights.shape, 2, self.grid_size)
        probability, right, left = (
            table.reshape(shape).swapaxes(0, 1)
            for table in (tables.probability, tables.right, tables.left)
        )
        factors = self._factors[here]
        factors[...] = probability
        factors[..., 1, :] *= mixtures.weights[:, None, :, None]
        self._moves[here] = np.stack([right, left]).transpose(1, 2, 4, 0, 3, 5)
        limits = np.ceil(np.stack([right, right + left]) * DENOMINATOR).transpose(1, 3, 4, 5, 2, 0)
        self._limits[..., first : first + count, :] = limits
        self._matrices[here] = matrices_of(factors)
        if self._joint is not None:
            self._fill_joint(self._joint, first, count)
        if self._public is not None:
            self._public[here] = self._matrices[here]
        self._filled = first + count

    def _fill_joint(self, joint: Floats, first: int, count: int) -> None:
        """Fill the table of hypotheses and cells, as `ProbabilityMatrix` does.

        The hypotheses of a forecast with an array as start are all carried along by the moves.
        """
        mixtures = self._mixtures
        here = np.s_[:, first : first + count]
        x, y = np.moveaxis(self._factors[here], 3, 0)
        np.multiply(y[..., :, None], x[..., None, :], out=joint[here])
        for number in {number for number, _ in mixtures.priors}:
            if first == 0:
                joint[number, 0] = joint_at_start(
                    self._factors[number, 0],
                    mixtures.weights[number],
                    [mixtures.priors.get((number, k)) for k in range(self.hypotheses)],
                )
            for step in range(max(first, 1), first + count):
                (right, left), (down, up) = self._moves[number, step - 1]
                joint[number, step] = after_drift(joint[number, step - 1], right, left, down, up)
            matrices = over_hypotheses(joint[number, first : first + count].swapaxes(0, 1))
            self._matrices[number, first : first + count] = matrices


def choose_forecasts(
    grid_size: int, steps: int, *parameters: DriftParameters, wants_table: bool = False
) -> Forecasts:
    """Return tabulated forecasts if they fit into `TABLE_BYTES`, else on-the-fly forecasts.

    Args:
        grid_size: cells along each side, N.
        steps: the last step of an episode.
        parameters: one or more sets of the rows' drift parameters. A row may get any forecast in
            any of them. The current ones come last.
        wants_table: tabulate however large the tables are.
    """
    persons, _, rows = parameters[-1].start.shape
    known = distinct(parameters)
    mixtures = Mixtures.of_numbers(known)
    if wants_table or table_bytes(grid_size, steps, mixtures) <= TABLE_BYTES:
        return TabulatedForecasts(grid_size, steps, mixtures, persons, known)
    mixtures = Mixtures.of_numbers(parameters[-1].as_numbers().reshape(-1, 5))
    return OnTheFlyForecasts(grid_size, mixtures, persons, rows)


def forecasts_of_situations(
    grid_size: int,
    steps: int,
    mixtures: Mixtures,
    persons: int,
    rows: int,
    wants_table: bool = False,
) -> Forecasts:
    """`choose_forecasts` for a catalogue; starts that are arrays are always tabulated.

    Args:
        grid_size: cells along each side, N.
        steps: the last step of an episode.
        mixtures: the forecasts.
        persons: the number of persons in each row.
        rows: the number of rows.
        wants_table: tabulate however large the tables are.
    """
    tabulates = wants_table or bool(mixtures.priors)
    if tabulates or table_bytes(grid_size, steps, mixtures) <= TABLE_BYTES:
        return TabulatedForecasts(grid_size, steps, mixtures, persons)
    return OnTheFlyForecasts(grid_size, mixtures, persons, rows)


def check_table(scenario: Scenario, mixtures: Mixtures) -> None:
    """Raise a ValueError if tables of some forecasts do not fit in memory."""
    size, steps = scenario.grid_size, scenario.timestep_limit
    checks.fits(
        f"the table of matrices for {len(mixtures.weights)} different forecasts",
        table_bytes(size, steps, mixtures),
        grid_size=size,
        timestep_limit=steps,
    )


def table_bytes(grid_size: int, steps: int, mixtures: Mixtures) -> int:
    """The memory of tables of some forecasts."""
    hypotheses = mixtures.weights.shape[1]
    joint = 8 * grid_size**2 if mixtures.priors else 0
    entry = 4 * grid_size**2 + hypotheses * (5 * 8 * 2 * grid_size + joint)
    count: int = entry * (steps + 1) * len(mixtures.weights)
    return count


def distinct(parameters: Sequence[DriftParameters]) -> Floats:
    """All forecasts of drift parameters without repetitions, as numbers: (forecasts, 5)."""
    forecasts = np.concatenate([each.as_numbers().reshape(-1, 5) for each in parameters])
    return np.unique(forecasts, axis=0)
