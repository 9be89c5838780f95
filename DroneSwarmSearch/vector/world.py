"""The seas of a batch: persons adrift, searches for them, and what is known of them.

`sea.Sea` for many rows at once, each at a step and in an episode of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import GOLDEN, numbers, numerators
from DroneSwarmSearch.vector.beliefs import Beliefs
from DroneSwarmSearch.vector.forecasts import DriftParameters, OnTheFlyForecasts, TabulatedForecasts

__all__ = ["BatchState"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]

_NOTHING: Ints = np.empty(0, np.int64)


class _State:
    """Integers of every row that the beginning of an episode sets: one array, and its parts.

    Args:
        persons: in each row.
        places: the numbers that the forecasts keep for each row.
        rows: the number of rows.

    Attributes:
        all: int64, (6 persons + 2 + places, rows); what follows are views of it.
        at: each person's x and y: int64, (persons, 2, rows).
        x: the first of these; y: the second: int64, (persons, rows).
        cells: y * N + x: int64, (persons, rows).
        missing: 1 for persons who have not been found, else 0: int64, (persons, rows).
        detection_keys: the key of the episode's detections: uint64, (rows,).
        growing: what grows by the same in every step, namely:
        step: completed steps: int64, (rows,).
        words: of the numbers by which the persons drift next: uint64, (2 persons, rows).
        places: what the forecasts keep: int64, (places, rows).
    """

    def __init__(self, persons: int, places: int, rows: int) -> None:
        self._persons = persons
        self.all = np.zeros((6 * persons + 2 + places, rows), np.int64)
        self._see()

    def _see(self) -> None:
        n = self._persons
        coordinates, self.cells, self.missing, keys, self.growing = np.split(
            self.all, (2 * n, 3 * n, 4 * n, 4 * n + 1)
        )
        self.at: Ints = coordinates.reshape(n, 2, -1)
        self.x, self.y = self.at[:, 0], self.at[:, 1]
        self.detection_keys: Words = keys[0].view(np.uint64)
        self.step: Ints = self.growing[0]
        self.words: Words = self.growing[1 : 2 * n + 1].view(np.uint64)
        self.places: Ints = self.growing[2 * n + 1 :]

    def with_places(self, places: int) -> _State:
        """The same with room for so many numbers of the forecasts."""
        other = _State(self._persons, places, self.all.shape[1])
        kept = len(self.all) - len(self.places)
        other.all[:kept] = self.all[:kept]
        return other

    def __getstate__(self) -> tuple[int, Ints]:
        return self._persons, self.all  # views would be arrays of their own in a copy

    def __setstate__(self, state: tuple[int, Ints]) -> None:
        self._persons, self.all = state
        self._see()


class BatchState:
    """The persons of many searches.

    Args:
        forecasts: of the rows.
        detections: every person's probability of detection.
        bayesian: whether the matrices are posteriors given the searches made.
        rows: the number of searches.
    """

    def __init__(
        self,
        forecasts: TabulatedForecasts | OnTheFlyForecasts,
        detections: Sequence[float],
        bayesian: bool,
        rows: int,
    ) -> None:
        persons = len(detections)
        self._size = forecasts.grid_size
        self._width = np.array(self._size)  # arrays calculate faster with it than with a number
        self._detections = detections
        self._beliefs = Beliefs(self._size, detections, rows) if bayesian else None
        # The words from which a step's drift numbers are made, counted from the episode's key.
        self._words = np.arange(1, 2 * persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self._now, self._first = (_State(persons, len(forecasts.growth), rows) for _ in range(2))
        self._take_forecasts(forecasts)
        self._first.missing[...] = 1
        self._finds = np.zeros((2, persons, rows), np.int64)
        # Of several persons: whose forecast is shown, and where no single forecast can be.
        self._leader = np.zeros(rows, np.int64)
        self._mixed = np.zeros(rows, np.bool_)

    def _take_forecasts(self, forecasts: TabulatedForecasts | OnTheFlyForecasts) -> None:
        self._forecasts = forecasts
        forecasts.bind(self._now.places, self._first.places)
        # By how much all that grows does so in a step; as much for all rows, but numbers that
        # lie side by side are added faster.
        words = np.broadcast_to(self._words[-1].view(np.int64), self._words.shape)
        growth = np.concatenate([np.ones((1, 1), np.int64), words, forecasts.growth])
        self._growth = growth.repeat(self._now.all.shape[1], axis=1)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._take_forecasts(self._forecasts)

    @property
    def forecasts(self) -> TabulatedForecasts | OnTheFlyForecasts:
        """The forecasts of the rows."""
        return self._forecasts

    @property
    def missing(self) -> Flags:
        """Who has not been found: bool, (persons, rows); a new array."""
        missing: Flags = self._now.missing != 0
        return missing

    @property
    def step(self) -> Ints:
        """Completed steps of every row: int64, (rows,)."""
        return self._now.step

    @property
    def person_cells(self) -> Ints:
        """Where every person is, y * N + x: int64, (persons, rows)."""
        return self._now.cells

    @property
    def finds(self) -> Ints:
        """Of persons found, the finder's number in the batch and the cell of the find.

        int64, (2, persons, rows), a new array; the values of missing persons mean nothing.
        """
        return self._finds.copy()

    # Beginning.

    def change_forecasts(
        self, forecasts: TabulatedForecasts | OnTheFlyForecasts, parameters: DriftParameters
    ) -> None:
        """Take other forecasts, which hold those of the rows under way as well."""
        rows = np.arange(len(self.step))
        self._now, self._first = (
            state.with_places(len(forecasts.growth)) for state in (self._now, self._first)
        )
        self._take_forecasts(forecasts)
        forecasts.assign(rows, parameters)
        self._now.places[...] = self._first.places
        forecasts.begin(rows)
        forecasts.catch_up(self.step)

    def prepare(self, rows: Ints, keys: Words) -> None:
        """Take the keys of the next episodes of some rows.

        Args:
            rows: their numbers.
            keys: for the persons' drift and for the detections, uint64, (2, n).
        """
        self._first.words[:, rows] = self._words + keys[0]
        self._first.detection_keys[rows] = keys[1]

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        """Let the next episodes of some rows have other parameters.

        Args:
            rows: their numbers.
            parameters: of all rows.
        """
        start = parameters.start[..., rows]
        self._first.at[..., rows] = start
        self._first.cells[:, rows] = start[:, 1] * self._size + start[:, 0]
        self._forecasts.assign(rows, parameters)

    def begin(self, rows: Ints) -> None:
        """Start the episodes of some rows, of which `prepare` and `assign` have been told."""
        self._set(rows)
        self._forecasts.begin(rows)

    def _set(self, rows: Ints) -> None:
        """Set what the beginning of an episode sets, but for what the forecasts work out."""
        self._now.all[:, rows] = self._first.all.take(rows, axis=1)
        if self._beliefs is not None:
            self._beliefs.forget(rows)
        if len(self._detections) > 1:
            self._choose_leaders(rows)

    # A step: searches, then persons walk, and beside it what is known goes on; then time passes.

    def search(self, rows: Ints, cells: Ints, drones: Ints) -> Ints:
        """Let a step's searches succeed or fail.

        Args:
            rows: the row of every search.
            cells: the cell of every search; in a row no two are alike.
            drones: the drone of every search, by its number in the batch.

        Returns:
            Which searches, by place in the arguments, have found somebody; each at most
            as often as it has found persons.
        """
        found = []
        now, several = self._now, len(self._detections) > 1
        for person, detection in enumerate(self._detections):
            right = now.cells[person].take(rows) == cells
            if several:  # a single person found ends the episode
                right &= now.missing[person].take(rows) != 0
            hits = right.nonzero()[0]
            if hits.size and 0.0 < detection < 1.0:
                where = rows[hits]
                places = now.step[where] * len(self._detections) + person
                luck = numbers(now.detection_keys[where], places.astype(np.uint64))
                hits = hits[luck < detection]
            if hits.size and detection > 0.0:
                where = rows.take(hits)
                now.missing[person][where] = 0
                self._finds[:, person, where] = drones.take(hits), cells.take(hits)
                found.append(hits)
        finds = np.concatenate(found) if len(found) > 1 else found[0] if found else _NOTHING
        if finds.size and several:
            self._choose_leaders(np.unique(rows[finds]))
        return finds

    def go_on(
        self,
        rows: Ints,
        cells: Ints,
        beginning: Ints,
        out: Singles | None,
        meanwhile: Callable[[], None],
    ) -> None:
        """Let what is known go on by a step, beside the rest of the step.

        Args:
            rows: the row of every search, in rising order.
            cells: the cell of every search, in which who is still missing is not.
            beginning: the rows in which the step does not pass: their episodes start.
            out: for the matrices after the step, float32, shape (rows, N, N), in part or
                all of them; what is missing `advance` writes.
            meanwhile: the rest of the step, in which persons may walk.
        """
        if self._beliefs is not None:
            shown = self._shown_persons(slice(None))
            self._beliefs.go_on(rows, cells, self.missing, shown, self._forecasts, out, meanwhile)
        elif out is not None and self._writes_beside(out):
            self._forecasts.write_next(beginning, out, meanwhile)
        else:
            meanwhile()

    def walk(self) -> None:
        """Let all persons walk by a step."""
        now = self._now
        self._forecasts.walk(now.at, numerators(now.words).reshape(now.at.shape))
        np.multiply(now.y, self._width, out=now.cells)
        now.cells += now.x

    def advance(self, beginning: Ints, out: Singles | None) -> None:
        """Let a step pass; what is known has gone on, and persons have walked.

        Args:
            beginning: the rows in which it does not pass: their episodes start.
            out: as for `go_on`.
        """
        self._now.growing += self._growth
        if beginning.size:
            self._set(beginning)
        self._forecasts.advance(beginning)
        if out is None or self._writes_beside(out):
            return
        if self._beliefs is not None and self._beliefs.begun.any():
            self._write_others(out)
        else:
            self.write_matrices(out)

    def _writes_beside(self, out: Singles) -> bool:
        """Whether `go_on` lets the forecasts write all matrices."""
        alone = self._beliefs is None and len(self._detections) == 1
        return alone and self._forecasts.writes_beside(out)

    def _choose_leaders(self, rows: Ints) -> None:
        """Note whose forecast is shown: that of those missing, or of all once none is."""
        shown = self._shown_persons(rows)
        self._leader[rows] = leader = shown.argmax(axis=0)
        start = self._first.at[..., rows]
        theirs = np.take_along_axis(start, leader[None, None], axis=0)
        self._mixed[rows] = ((start != theirs).any(axis=1) & shown).any(axis=0)

    def _shown_persons(self, rows: Ints | slice) -> Flags:
        """The persons over whom the matrix is the mean: (persons, n)."""
        if len(self._detections) == 1:
            number = len(self.step) if isinstance(rows, slice) else len(rows)
            return np.ones((1, number), np.bool_)
        missing: Flags = self._now.missing[:, rows] != 0
        shown: Flags = missing | ~missing.any(axis=0)
        return shown

    # What is known.

    def shown(self, rows: Ints, cells: Ints) -> Singles:
        """What the matrices of some rows say of a cell of each: float32, (n,)."""
        values = self._forecasts.shown(self._leaders(rows), rows, cells)
        if self._beliefs is None and len(self._detections) == 1:
            return values
        mixed, known = self._mixed_among(rows), self._known_among(rows)
        if mixed.size:
            here, n = rows[mixed], np.arange(len(mixed))
            y, x = np.divmod(cells[mixed], self._size)
            values[mixed] = self._mean_of_forecasts(
                here, lambda of_x, of_y: of_y[n, y] * of_x[n, x]
            )
        if known.size:
            here = rows[known]
            values[known] = self._known().shown(here, cells[known], self._shown_persons(here))
        return values

    def matrices(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, shape (n, N, N)."""
        out = np.empty((len(rows), self._size, self._size), np.float32)
        self._write_forecasts(rows, out)
        known = self._known_among(rows)
        if known.size:
            here = rows[known]
            out[known] = self._known().matrices(here, self._shown_persons(here))
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, shape (rows, N, N), C-contiguous."""
        if self._beliefs is not None and self._beliefs.begun.any():
            self._beliefs.write_matrices(self._shown_persons(slice(None)), out)
            self._write_others(out)
        else:
            alone = len(self._detections) == 1
            self._write_forecasts(slice(None) if alone else np.arange(len(self.step)), out)

    def _write_others(self, out: Singles) -> None:
        """Write the matrices of the rows that have no beliefs."""
        others = (~self._known().begun).nonzero()[0]
        out[others] = self.matrices(others)

    def _write_forecasts(self, rows: Ints | slice, out: Singles) -> None:
        """Write what the forecasts say of some rows; those that have beliefs get something."""
        self._forecasts.write_matrices(self._leaders(rows), rows, out)
        if isinstance(rows, slice):  # of one person, whose forecast it is
            return
        mixed = self._mixed_among(rows)
        if mixed.size:
            out[mixed] = self._mean_of_forecasts(rows[mixed], _outer_products)

    def _leaders(self, rows: Ints | slice) -> Ints | int:
        return self._leader[rows] if len(self._detections) > 1 else 0

    def _mixed_among(self, rows: Ints) -> Ints:
        """Those of some rows, by place, whose matrix is the mean of several forecasts."""
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

    def _mean_of_forecasts(self, rows: Ints, chance: Callable[[Floats, Floats], Floats]) -> Singles:
        """The mean over the persons shown of what follows from their chances along x and y."""
        shown = self._shown_persons(rows)
        total: Floats | float = 0.0
        for person, counts in enumerate(shown):
            values = chance(*self._forecasts.marginals(person, rows))
            total = total + values * counts.reshape(-1, *(1,) * (values.ndim - 1))
        number = shown.sum(axis=0).reshape(-1, *(1,) * (values.ndim - 1))
        mean: Singles = (total / number).astype(np.float32)
        return mean


def _outer_products(of_x: Floats, of_y: Floats) -> Floats:
    products: Floats = of_y[:, :, None] * of_x[:, None, :]
    return products
