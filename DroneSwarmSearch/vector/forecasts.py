"""The forecasts of a batch: where each row's persons may be, and how they move, at its step.

Both classes answer the same questions about every row at the step it has come to.
`TabulatedForecasts` looks them up: right for the ordinary batch, in which few forecasts serve
many rows. `OnTheFlyForecasts` computes them step by step: right where every row has its
own, or an episode lasts too long for a table. Both use the functions of
`probability_matrix` and agree with the single environment to the last bit.

Arrays have the rows of the batch as their last axis: what is looked up for one cell or
one person of every row then lies side by side in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.streams import DENOMINATOR
from DroneSwarmSearch.drift.tables import (
    gaussian_cdf,
    moves_between,
    point_mass,
    reachable,
    tabulate,
)
from DroneSwarmSearch.vector.threads import parts_of, run_in_parts, worth_sharing

__all__ = [
    "TABLE_BYTES",
    "DriftParameters",
    "Forecasts",
    "OnTheFlyForecasts",
    "TabulatedForecasts",
    "check_table",
    "choose_forecasts",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]
Rows = Any  # a slice or an array of row numbers

TABLE_BYTES = 64 * 2**20
"""The most that tables may take where they are not asked for; beyond it forecasts are followed."""

_BLOCK_STEPS = 32
_CHUNK_BYTES = 2**20  # of one of the arrays that are worked on; larger ones are not faster


class DriftParameters(NamedTuple):
    """What the forecasts of a batch depend on.

    Attributes:
        start: each person's cell at step 0: int64, shape (persons, 2, rows), x first.
        drift: cells per step: float64, shape (2, rows), x first.
        disperse_constant: float64, shape (rows,).
    """

    start: Ints
    drift: Floats
    disperse_constant: Floats


class Forecasts:
    """What both kinds of forecasts do; every row is at a step of its own.

    Forecasts may keep some integers for each row, its places, that are set anew when an episode
    begins and grow from step to step. They lie where `bind` is told, next to what else
    begins and grows with an episode, so that all of it is set and grows at once.

    Attributes:
        grid_size: cells along each side, N.
        growth: by how much each of a row's places grows in a step: int64, (places, 1).
    """

    grid_size: int
    growth: Ints

    def bind(self, now: Ints, first: Ints) -> None:
        """Keep the places in given arrays from now on.

        Args:
            now: for those of the present steps: int64, shape (places, rows).
            first: for those of step 0, likewise.
        """
        raise NotImplementedError

    def walk(self, at: Ints, luck: Ints) -> None:
        """Let all persons walk by a step, as `person.walk` does.

        Args:
            at: the persons' cells, x and y apart, int64, (persons, 2, rows); overwritten.
            luck: what decides each move, see `streams.numerators`, of the same shape.
        """
        higher, either = self._thresholds(at)
        # +1 below the first threshold, -1 from there to the second: 2 a - (a or b).
        move = np.less(luck, higher).view(np.int8)
        move += move
        move -= np.less(luck, either).view(np.int8)
        at += move

    def _thresholds(self, at: Ints) -> tuple[NDArray[Any], NDArray[Any]]:
        """The chances of every person to move higher, and to move at all, as numerators.

        Rounded up to integers or not: it makes no difference to the integers compared with them.
        """
        raise NotImplementedError

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        """Give some rows other forecasts, with which their next episodes begin.

        Args:
            rows: their numbers.
            parameters: the forecasts of all rows.
        """
        raise NotImplementedError

    def begin(self, rows: Ints) -> None:
        """Put some rows at step 0. Their places are set by whoever holds them."""
        raise NotImplementedError

    def catch_up(self, steps: Ints) -> None:
        """Put rows that all stand at step 0 at other steps: int64, (rows,)."""
        raise NotImplementedError

    def advance(self, beginning: Ints) -> None:
        """Every row goes on by a step. Their places say so already.

        Args:
            beginning: the rows that are put at step 0 instead.
        """
        raise NotImplementedError

    def writes_beside(self, out: Singles) -> bool:
        """Whether to write the matrices of the next step beside the present one.

        Args:
            out: as for `write_next`.
        """
        return False

    def write_next(self, beginning: Ints, out: Singles, meanwhile: Callable[[], None]) -> None:
        """Write the matrices of the next step beside the present one.

        Args:
            beginning: the rows that will be at step 0 then; their places have been told.
            out: for the matrices of every row, of its only person: float32, shape (rows, N, N).
            meanwhile: the rest of the step.
        """
        raise NotImplementedError

    def marginals(self, person: int | Ints, rows: Rows) -> tuple[Floats, Floats]:
        """The chances of every column and of every row of the grid: (rows, N) each."""
        raise NotImplementedError

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        """The chances to move right, left, down and up: (N, rows) each."""
        raise NotImplementedError

    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        """Write the matrices of some rows, float32, shape (rows, N, N)."""
        x, y = self.marginals(person, rows)
        # Where runs of memory are as short as a row of cells, faster than `np.multiply`.
        np.einsum("ry,rx->ryx", y.astype(np.float32), x.astype(np.float32), out=out)

    def shown(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        """What the matrices of some rows say of a cell of each, y * N + x: float32, (n,)."""
        raise NotImplementedError


class TabulatedForecasts(Forecasts):
    """A table of every forecast, filled as far as the rows have come.

    Args:
        grid_size: cells along each side, N.
        steps: the last step that any row comes to.
        parameters: of the rows, one set or several: a row that begins may have any of
            the forecasts in any of them.
    """

    def __init__(self, grid_size: int, steps: int, *parameters: DriftParameters) -> None:
        self.grid_size = grid_size
        self._steps = steps
        self._cells = np.array(grid_size**2)  # arrays calculate faster with it than with a number
        self._forecasts = _different_forecasts(parameters)
        count, persons = len(self._forecasts), len(parameters[0].start)
        shape = (count, steps + 1, 2, grid_size)
        self._probability = np.zeros(shape)
        # To move right and left: as `moves` returns them, with the entries as the last axis.
        self._moves = np.zeros((2, 2, grid_size, count, steps + 1))
        # What numbers drawn, as integers, are compared with where persons walk.
        self._higher, self._either = (np.zeros(shape, np.int64) for _ in range(2))
        self._matrices = np.zeros((count, steps + 1, grid_size, grid_size), np.float32)
        self._handed: Singles | None = None
        self._cdf: Floats | None = None
        self._filled = 0
        self._latest = 0  # no row has come further
        self._see_flat()
        # Of every row and person: an entry of the tables, then where in the entry the chances
        # for x begin and those for y.
        self.growth = np.array([1] * persons + [2 * grid_size] * 2 * persons)[:, None]
        self._fill()

    def _places_of(self, entries: Ints) -> Ints:
        """The places that go with some entries of the tables, (persons, n)."""
        of_axes = 2 * self.grid_size * entries[:, None] + self.grid_size * np.arange(2)[:, None]
        return np.concatenate([entries, of_axes.reshape(-1, entries.shape[1])])

    def bind(self, now: Ints, first: Ints) -> None:
        persons = len(now) // 3
        self._now, self._first = now, first
        self.entries: Ints = now[:persons]
        self._axes: Ints = now[persons:].reshape(persons, 2, -1)

    def _see_flat(self) -> None:
        """Make the views of the tables."""
        self._flat_higher, self._flat_either = self._higher.reshape(-1), self._either.reshape(-1)
        self._by_entry = self._matrices.reshape(-1, self.grid_size, self.grid_size)
        self._flat_moves = self._moves.reshape(2, 2, self.grid_size, -1)
        self._flat_probability = self._probability.reshape(-1, 2, self.grid_size)
        self._flat_matrices = self._matrices.reshape(-1)

    def __getstate__(self) -> dict[str, Any]:
        """Views would be arrays of their own in a copy; who has bound places binds them again."""
        views = ("entries", "_axes", "_now", "_first", "_by_entry")
        return {
            name: value
            for name, value in self.__dict__.items()
            if name not in views and not name.startswith("_flat")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._handed = None
        self._see_flat()

    @property
    def matrices(self) -> Singles:
        """The matrices for users: float32, (entries, N, N), read-only, filled with the tables.

        A copy, because rewards follow from the tables: the flag does not stop other
        libraries from writing into memory that they are given.
        """
        if self._handed is None:
            self._handed = np.zeros_like(self._matrices)
            self._handed[:, : self._filled] = self._matrices[:, : self._filled]
        matrices = self._handed.reshape(self._by_entry.shape)
        matrices.flags.writeable = False
        return matrices

    def _thresholds(self, at: Ints) -> tuple[Ints, Ints]:
        places = at + self._axes
        return (
            self._flat_higher.take(places, mode="clip"),
            self._flat_either.take(places, mode="clip"),
        )

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        entries = self._numbers(parameters, rows) * (self._steps + 1)
        self._first[:, rows] = self._places_of(entries)

    def begin(self, rows: Ints) -> None:
        pass  # their places say all

    def catch_up(self, steps: Ints) -> None:
        self._now += self.growth * steps
        self._latest = int(steps.max())
        while self._filled <= min(self._latest + 1, self._steps):
            self._fill()

    def advance(self, beginning: Ints) -> None:
        self._latest += 1
        if self._latest + 1 == self._filled <= self._steps:  # the next step may be asked for
            # Rows have begun anew since; perhaps none has come that far.
            self._latest = int((self.entries % (self._steps + 1)).max())
            if self._latest + 1 == self._filled:
                self._fill()

    def writes_beside(self, out: Singles) -> bool:
        return worth_sharing(out)

    def write_next(self, beginning: Ints, out: Singles, meanwhile: Callable[[], None]) -> None:
        entries = self.entries[0] + 1
        entries[beginning] = self._first[0].take(beginning)

        def write(rows: slice) -> None:
            self._by_entry.take(entries[rows], 0, out=out[rows], mode="clip")

        run_in_parts(write, parts_of(out), meanwhile)

    def marginals(self, person: int | Ints, rows: Rows) -> tuple[Floats, Floats]:
        both = self._flat_probability.take(self._at(person, rows), 0, mode="clip")
        return both[:, 0], both[:, 1]

    def moves(self, person: int, rows: slice) -> tuple[Floats, Floats, Floats, Floats]:
        entries = self.entries[person, rows]
        (right, down), (left, up) = self._flat_moves.take(entries, 3, mode="clip")
        return right, left, down, up

    def write_matrices(self, person: int | Ints, rows: Rows, out: Singles) -> None:
        self._by_entry.take(self._at(person, rows), 0, out=out, mode="clip")

    def shown(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        places = np.multiply(self._at(person, rows), self._cells)
        places += cells
        values: Singles = self._flat_matrices.take(places, mode="clip")
        return values

    def _at(self, person: int | Ints, rows: Rows) -> Ints:
        """The entries of one person of each of some rows."""
        entries: Ints
        if isinstance(person, int) and not isinstance(rows, slice):
            entries = self.entries[person].take(rows)
        else:
            entries = self.entries[person, rows]
        return entries

    def _numbers(self, parameters: DriftParameters, rows: Ints) -> Ints:
        """The number of each person's forecast: (persons, rows)."""
        if len(self._forecasts) == 1:
            return np.zeros((len(self.entries), len(rows)), np.int64)
        wanted = _forecasts(parameters, rows)
        merged = np.concatenate([self._forecasts, wanted.reshape(-1, 5)])
        _, number = np.unique(merged, axis=0, return_inverse=True)
        return number.reshape(-1)[len(self._forecasts) :].reshape(wanted.shape[:2])

    def _fill(self) -> None:
        """Fill the tables for the next steps."""
        first = self._filled
        count = min(_BLOCK_STEPS, self._steps + 1 - first)
        start, drift, constant = (
            self._forecasts[:, :2],
            self._forecasts[:, 2:4],
            self._forecasts[:, 4],
        )
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
        x, y = np.moveaxis(self._probability[here].astype(np.float32), 2, 0)
        np.multiply(y[..., :, None], x[..., None, :], out=self._matrices[here])
        if self._handed is not None:
            self._handed[here] = self._matrices[here]
        self._filled = first + count


class OnTheFlyForecasts(Forecasts):
    """Every row's forecasts worked out from step to step.

    Args:
        grid_size: cells along each side, N.
        parameters: of the rows.
    """

    def __init__(self, grid_size: int, parameters: DriftParameters) -> None:
        persons, _, rows = parameters.start.shape
        self.grid_size = grid_size
        self.growth = np.empty((0, 1), np.int64)
        self._axes = axes = 2 * persons
        self._start = np.empty((axes, rows), np.int64)
        self._drift = np.empty((axes, rows))
        self._constant = np.empty(rows)
        self._step = np.zeros(rows)
        self._after = np.empty((grid_size + 2, axes, rows))  # F, padded as in `point_mass`
        self._probability, self._right, self._left = (
            np.empty((grid_size, axes, rows)) for _ in range(3)
        )
        self._offset = np.arange(axes * rows).reshape(persons, 2, rows)
        self._chunk = max(1, _CHUNK_BYTES // (8 * axes * (grid_size + 2)))

    def _thresholds(self, at: Ints) -> tuple[Floats, Floats]:
        places = at * self._offset.size
        places += self._offset
        right = self._right.reshape(-1).take(places, mode="clip")
        left = self._left.reshape(-1).take(places, mode="clip")
        return right * DENOMINATOR, (right + left) * DENOMINATOR

    def bind(self, now: Ints, first: Ints) -> None:
        pass  # it has none

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        persons = len(parameters.start)
        self._start[:, rows] = parameters.start[..., rows].reshape(self._axes, -1)
        self._drift[:, rows] = np.tile(parameters.drift[:, rows], (persons, 1))
        self._constant[rows] = parameters.disperse_constant[rows]

    def begin(self, rows: Ints) -> None:
        self._rewind(rows)
        for first in range(0, len(rows), self._chunk):
            self._go_on(rows[first : first + self._chunk])

    def _rewind(self, rows: Ints) -> None:
        """Let some rows go on to step 0."""
        self._step[rows] = 0.0
        self._after[..., rows] = point_mass(self.grid_size, self._start[:, rows])

    def catch_up(self, steps: Ints) -> None:
        for step in range(int(steps.max())):
            rows = np.flatnonzero(steps > step)
            self._step[rows] += 1.0
            self._go_on(rows)

    def advance(self, beginning: Ints) -> None:
        self._step += 1.0
        if beginning.size:
            self._rewind(beginning)
        for first in range(0, len(self._step), self._chunk):
            self._go_on(slice(first, first + self._chunk))

    def _go_on(self, rows: Rows) -> None:
        """Work out the step of some rows, whose F is known, and the F of the step after it."""
        before = self._after[..., rows]
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
        self._after[..., rows] = after
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

    def shown(self, person: int | Ints, rows: Ints, cells: Ints) -> Singles:
        y, x = np.divmod(cells, self.grid_size)
        axis = 2 * np.asarray(person)
        of_x = self._probability[x, axis, rows].astype(np.float32)
        of_y = self._probability[y, axis + 1, rows].astype(np.float32)
        values: Singles = of_y * of_x
        return values


def _forecasts(parameters: DriftParameters, rows: Rows = slice(None)) -> Floats:
    """Each person's forecast as numbers: (persons, rows, 5)."""
    start = parameters.start[..., rows]
    persons, _, count = start.shape
    forecasts = np.empty((persons, count, 5))
    forecasts[..., :2] = start.swapaxes(1, 2)
    forecasts[..., 2:4] = parameters.drift[:, rows].T
    forecasts[..., 4] = parameters.disperse_constant[rows]
    return forecasts


def choose_forecasts(
    grid_size: int, steps: int, *parameters: DriftParameters, wants_table: bool = False
) -> TabulatedForecasts | OnTheFlyForecasts:
    """Tabulated forecasts where they fit into `TABLE_BYTES` or are requested, else on-the-fly.

    Args:
        grid_size: cells along each side, N.
        steps: the last step that any row comes to.
        parameters: see `TabulatedForecasts`; the rows have the last ones now.
        wants_table: take tables, however large.
    """
    affordable = TABLE_BYTES // _forecast_bytes(grid_size, steps)
    if wants_table or len(_different_forecasts(parameters)) <= affordable:
        return TabulatedForecasts(grid_size, steps, *parameters)
    return OnTheFlyForecasts(grid_size, parameters[-1])


def check_table(grid_size: int, steps: int, parameters: DriftParameters) -> None:
    """Refuse tables that do not fit in memory; arguments as for `TabulatedForecasts`."""
    forecasts = len(_different_forecasts([parameters]))
    checks.fits(
        f"the table of matrices for {forecasts} different forecasts",
        _forecast_bytes(grid_size, steps) * forecasts,
        grid_size=grid_size,
        timestep_limit=steps,
    )


def _forecast_bytes(grid_size: int, steps: int) -> int:
    """What the tables of a forecast take."""
    return (4 * grid_size**2 + 5 * 8 * 2 * grid_size) * (steps + 1)


def _different_forecasts(parameters: Sequence[DriftParameters]) -> Floats:
    """All forecasts, each once: (forecasts, 5)."""
    forecasts = np.concatenate([_forecasts(each).reshape(-1, 5) for each in parameters])
    return np.unique(forecasts, axis=0)
