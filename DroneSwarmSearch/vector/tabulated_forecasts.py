"""Forecasts in tables that all rows share, and the choice between tables and none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints, Rows, Singles
from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift.tables import tabulate
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts, OnTheFlyForecasts
from DroneSwarmSearch.vector.threads import parts_of, run_in_parts

__all__ = ["TABLE_BYTES", "TabulatedForecasts", "check_table", "choose_forecasts"]

TABLE_BYTES = 64 * 2**20
"""The largest tables that a batch makes unless it is asked for them."""

_BLOCK_STEPS = 32


class TabulatedForecasts(Forecasts):
    """Tables of all forecasts, filled as far as the rows have come.

    An entry of the tables is one step of one forecast. The pointers of a row are, for each
    person, the number of its entry, then the offsets of the entry's values for x and for y.

    Args:
        grid_size: cells along each side, N.
        steps: the last step of an episode.
        parameters: one or more sets of the rows' parameters. A row may be assigned any
            forecast in any of them.
    """

    def __init__(self, grid_size: int, steps: int, *parameters: DriftParameters) -> None:
        self.grid_size = grid_size
        self._steps = steps
        self._cells = np.array(grid_size**2)  # 0-d: NumPy calculates faster than with an int
        self._forecasts = _distinct(parameters)
        count, persons = len(self._forecasts), len(parameters[0].start)
        shape = (count, steps + 1, 2, grid_size)
        self._probability = np.zeros(shape)
        # Moves right and left in the order that `moves` returns: entries are the last axes.
        self._moves = np.zeros((2, 2, grid_size, count, steps + 1))
        # Probabilities of +1, and of +1 or -1, times 2**53, rounded up: draws are integers.
        self._higher, self._either = (np.zeros(shape, np.int64) for _ in range(2))
        self._matrices = np.zeros((count, steps + 1, grid_size, grid_size), np.float32)
        self._public: Singles | None = None  # the copy that users get
        self._cdf: Floats | None = None
        self._filled = 0
        self._latest = 0  # an upper limit of the rows' steps
        self._make_views()
        self.increments = np.array([1] * persons + [2 * grid_size] * 2 * persons)[:, None]
        self._fill()

    def bind(self, now: Ints, first: Ints) -> None:
        persons = len(now) // 3
        self._now, self._first = now, first
        self.entries: Ints = now[:persons]
        self._offsets: Ints = now[persons:].reshape(persons, 2, -1)

    def _make_views(self) -> None:
        self._flat_higher, self._flat_either = self._higher.reshape(-1), self._either.reshape(-1)
        self._by_entry = self._matrices.reshape(-1, self.grid_size, self.grid_size)
        self._flat_moves = self._moves.reshape(2, 2, self.grid_size, -1)
        self._flat_probability = self._probability.reshape(-1, 2, self.grid_size)
        self._flat_matrices = self._matrices.reshape(-1)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the views, which would become arrays of their own in a copy."""
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
        index = coordinates + self._offsets
        return (
            self._flat_higher.take(index, mode="clip"),
            self._flat_either.take(index, mode="clip"),
        )

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        entries = self._find(parameters, rows) * (self._steps + 1)
        axes = 2 * self.grid_size * entries[:, None] + self.grid_size * np.arange(2)[:, None]
        self._first[:, rows] = np.concatenate([entries, axes.reshape(-1, len(rows))])

    def _find(self, parameters: DriftParameters, rows: Ints) -> Ints:
        """The number of each person's forecast: (persons, rows)."""
        if len(self._forecasts) == 1:
            return np.zeros((len(self.entries), len(rows)), np.int64)
        wanted = _as_numbers(parameters, rows)
        merged = np.concatenate([self._forecasts, wanted.reshape(-1, 5)])
        _, number = np.unique(merged, axis=0, return_inverse=True)
        return number.reshape(-1)[len(self._forecasts) :].reshape(wanted.shape[:2])

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
        """Write the matrices of the next step in the background of the present one.

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

    def marginals(self, person: int | Ints, rows: Rows) -> tuple[Floats, Floats]:
        both = self._flat_probability.take(self._entries_of(person, rows), 0, mode="clip")
        return both[:, 0], both[:, 1]

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        entries = self.entries[person, rows]
        (right, down), (left, up) = self._flat_moves.take(entries, 3, mode="clip")
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
        first = self._filled
        count = min(_BLOCK_STEPS, self._steps + 1 - first)
        start, drift, constant = np.split(self._forecasts, (2, 4), axis=1)
        tables = tabulate(
            self.grid_size,
            start.reshape(-1),
            drift.reshape(-1),
            constant.repeat(2),
            first=first,
            count=count,
            cdf=self._cdf,
        )
        self._cdf = tables.cdf
        here = np.s_[:, first : first + count]
        shape = (count, len(self._forecasts), 2, self.grid_size)
        probability, right, left = (
            table.reshape(shape).swapaxes(0, 1)
            for table in (tables.probability, tables.right, tables.left)
        )
        self._probability[here] = probability
        self._higher[here] = np.ceil(right * DENOMINATOR)
        self._either[here] = np.ceil((right + left) * DENOMINATOR)
        self._moves[..., first : first + count] = np.stack([right, left]).transpose(0, 3, 4, 1, 2)
        x, y = np.moveaxis(probability.astype(np.float32), 2, 0)
        np.multiply(y[..., :, None], x[..., None, :], out=self._matrices[here])
        if self._public is not None:
            self._public[here] = self._matrices[here]
        self._filled = first + count


def choose_forecasts(
    grid_size: int, steps: int, *parameters: DriftParameters, wants_table: bool = False
) -> Forecasts:
    """Return tabulated forecasts if they fit into `TABLE_BYTES`, else on-the-fly forecasts.

    Args:
        grid_size: cells along each side, N.
        steps: the last step of an episode.
        parameters: see `TabulatedForecasts`; the rows' present ones come last.
        wants_table: tabulate however large the tables are.
    """
    affordable = TABLE_BYTES // _forecast_bytes(grid_size, steps)
    if wants_table or len(_distinct(parameters)) <= affordable:
        return TabulatedForecasts(grid_size, steps, *parameters)
    return OnTheFlyForecasts(grid_size, parameters[-1])


def check_table(scenario: Scenario, parameters: DriftParameters) -> None:
    """Raise a ValueError if tables of these forecasts do not fit in memory."""
    size, steps = scenario.grid_size, scenario.timestep_limit
    forecasts = len(_distinct([parameters]))
    checks.fits(
        f"the table of matrices for {forecasts} different forecasts",
        _forecast_bytes(size, steps) * forecasts,
        grid_size=size,
        timestep_limit=steps,
    )


def _forecast_bytes(grid_size: int, steps: int) -> int:
    """The memory of one forecast's tables."""
    return (4 * grid_size**2 + 5 * 8 * 2 * grid_size) * (steps + 1)


def _as_numbers(parameters: DriftParameters, rows: Rows = slice(None)) -> Floats:
    """Each person's forecast as five numbers: shape (persons, rows, 5)."""
    start = parameters.start[..., rows]
    persons, _, count = start.shape
    forecasts = np.empty((persons, count, 5))
    forecasts[..., :2] = start.swapaxes(1, 2)
    forecasts[..., 2:4] = parameters.drift[:, rows].T
    forecasts[..., 4] = parameters.disperse_constant[rows]
    return forecasts


def _distinct(parameters: Sequence[DriftParameters]) -> Floats:
    """All forecasts without repetitions: shape (forecasts, 5)."""
    forecasts = np.concatenate([_as_numbers(each).reshape(-1, 5) for each in parameters])
    return np.unique(forecasts, axis=0)
