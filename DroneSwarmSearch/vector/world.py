"""The world states of a batch: the persons, the searches for them, and the matrices.

The array form of `world.WorldState`: many rows, each at its own step and in its own episode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.streams import GOLDEN, numbers, numerators
from DroneSwarmSearch.drift.belief import means_over_missing, shown_persons
from DroneSwarmSearch.vector.beliefs import Beliefs
from DroneSwarmSearch.vector.episodes import RowState
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts
from DroneSwarmSearch.vector.tabulated_forecasts import TabulatedForecasts
from DroneSwarmSearch.vector.threads import worth_sharing

__all__ = ["BatchState"]

_NO_ROWS: Ints = np.empty(0, np.int64)


class BatchState:
    """The persons of many searches.

    Args:
        forecasts: the rows' forecasts.
        detections: each person's probability of detection.
        bayesian: whether the matrices are posteriors given the searches made.
        rows: the number of searches.
    """

    def __init__(
        self,
        forecasts: Forecasts,
        detections: Sequence[float],
        bayesian: bool,
        rows: int,
    ) -> None:
        persons = len(detections)
        self._size = forecasts.grid_size
        self._width = np.array(self._size)  # 0-d: NumPy calculates faster than with an int
        self._detections = detections
        self._beliefs = Beliefs(self._size, detections, rows) if bayesian else None
        # The counters of a step's drift draws, from the key of the episode on.
        self._draws = np.arange(1, 2 * persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self._now, self._first = (
            RowState(persons, len(forecasts.increments), rows) for _ in range(2)
        )
        self._set_forecasts(forecasts)
        self._first.missing[...] = 1
        self._finds = np.zeros((2, persons, rows), np.int64)  # see `finds`
        # With several persons: whose forecast is shown, and in which rows it is a mean.
        self._shown_person = np.zeros(rows, np.int64)
        self._mixed = np.zeros(rows, np.bool_)

    def _set_forecasts(self, forecasts: Forecasts) -> None:
        self._forecasts = forecasts
        forecasts.bind(self._now.pointers, self._first.pointers)
        # Per-step increment of each counter, repeated for all rows: adding contiguous arrays
        # is faster than broadcasting.
        draws = np.broadcast_to(self._draws[-1].view(np.int64), self._draws.shape)
        increments = np.concatenate([np.ones((1, 1), np.int64), draws, forecasts.increments])
        self._increments = increments.repeat(self._now.all.shape[1], axis=1)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._set_forecasts(self._forecasts)

    @property
    def forecasts(self) -> Forecasts:
        """The rows' forecasts."""
        return self._forecasts

    def tabulated(self) -> TabulatedForecasts:
        """The table that shows the matrix of every row.

        Raises:
            ValueError: the matrices depend on the searches, or do not fit into a table.
        """
        if self._beliefs is not None or len(self._detections) > 1:
            raise ValueError(
                "with bayesian_update or several persons there is no table of matrices"
            )
        if not isinstance(self._forecasts, TabulatedForecasts):
            raise ValueError(
                "there is no table of matrices: there are too many forecasts, or a sampler"
            )
        return self._forecasts

    @property
    def missing(self) -> Flags:
        """Which persons have not been found: bool, (persons, rows); a new array."""
        missing: Flags = self._now.missing != 0
        return missing

    @property
    def step(self) -> Ints:
        """Completed steps of every row: int64, (rows,)."""
        return self._now.step

    @property
    def person_cells(self) -> Ints:
        """Every person's cell, y * N + x: int64, (persons, rows)."""
        return self._now.cells

    @property
    def finds(self) -> Ints:
        """The drone that found each person, numbered throughout the batch, and in which cell.

        int64, (2, persons, rows); the values of missing persons are meaningless.
        """
        return self._finds

    # The start of an episode.

    def change_forecasts(self, forecasts: Forecasts, parameters: DriftParameters) -> None:
        """Replace the forecasts in mid-episode; the new ones include those in use."""
        rows = np.arange(len(self.step))
        self._now, self._first = (
            state.with_pointers(len(forecasts.increments)) for state in (self._now, self._first)
        )
        self._set_forecasts(forecasts)
        forecasts.assign(rows, parameters)
        self._now.pointers[...] = self._first.pointers
        forecasts.begin(rows)
        forecasts.catch_up(self.step)

    def prepare(self, rows: Ints, keys: Words) -> None:
        """Set the keys of the next episodes of some rows.

        Args:
            rows: their numbers.
            keys: for the persons' drift and for the detections: uint64, (2, n).
        """
        self._first.draws[:, rows] = self._draws + keys[0]
        self._first.detection_keys[rows] = keys[1]

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        """Set the parameters of the next episodes of some rows.

        Args:
            rows: their numbers.
            parameters: the parameters of all rows.
        """
        start = parameters.start[..., rows]
        self._first.coordinates[..., rows] = start
        self._first.cells[:, rows] = start[:, 1] * self._size + start[:, 0]
        self._forecasts.assign(rows, parameters)

    def begin(self, rows: Ints) -> None:
        """Start the episodes of some rows after `prepare` and `assign`."""
        self._restart(rows)
        self._forecasts.begin(rows)

    def _restart(self, rows: Ints) -> None:
        """Put some rows at step 0, except for their forecasts."""
        self._now.all[:, rows] = self._first.all.take(rows, axis=1)
        if self._beliefs is not None:
            self._beliefs.forget(rows)
        if len(self._detections) > 1:
            self._choose_shown_person(rows)

    # A step: `search`, then `advance`.

    def search(self, rows: Ints, cells: Ints, drones: Ints) -> Ints:
        """Decide which of a step's searches find a person.

        Args:
            rows: the row of every search.
            cells: the cell of every search; different cells within a row.
            drones: the drone of every search, numbered throughout the batch.

        Returns:
            The searches that found someone, as indices into the arguments; a search that
            found several persons may occur several times.
        """
        found = []
        now, several = self._now, len(self._detections) > 1
        for person, detection in enumerate(self._detections):
            right = now.cells[person].take(rows) == cells
            if several:  # with one person, a find ends the episode
                right &= now.missing[person].take(rows) != 0
            hits = right.nonzero()[0]
            if hits.size and 0.0 < detection < 1.0:
                where = rows[hits]
                places = now.step[where] * len(self._detections) + person
                uniforms = numbers(now.detection_keys[where], places.astype(np.uint64))
                hits = hits[uniforms < detection]
            if hits.size and detection > 0.0:
                where = rows.take(hits)
                now.missing[person][where] = 0
                self._finds[:, person, where] = drones.take(hits), cells.take(hits)
                found.append(hits)
        finds = np.concatenate(found) if len(found) > 1 else found[0] if found else _NO_ROWS
        if finds.size and several:
            self._choose_shown_person(np.unique(rows[finds]))
        return finds

    def all_found(self, rows: Ints) -> Ints:
        """Those of some rows in which all persons have been found."""
        if len(self._detections) == 1:
            return rows
        found: Ints = rows[~self._now.missing.take(rows, axis=1).any(axis=0)]
        return found

    def advance(
        self,
        rows: Ints,
        cells: Ints,
        beginning: Ints,
        out: Singles | None,
        foreground: Callable[[], None],
    ) -> None:
        """Advance the persons and the beliefs by a step, after `search`.

        Args:
            rows: the row of every search, in rising order.
            cells: the cell of every search.
            beginning: rows that start an episode instead.
            out: receives the matrices after the step: float32, shape (rows, N, N), or None.
            foreground: the rest of the step, which this thread runs while background threads
                write matrices and update beliefs.
        """
        now, forecasts = self._now, self._forecasts

        def finish_step() -> None:
            foreground()
            draws = numerators(now.draws).reshape(now.coordinates.shape)
            forecasts.walk(now.coordinates, draws)
            np.multiply(now.y, self._width, out=now.cells)
            now.cells += now.x

        written = False
        if self._beliefs is not None:
            counted = self._counted_persons(slice(None))
            self._beliefs.update(rows, cells, self.missing, counted, forecasts, out, finish_step)
        elif (
            out is not None
            and worth_sharing(out)
            and len(self._detections) == 1
            and isinstance(forecasts, TabulatedForecasts)
        ):
            forecasts.write_next(beginning, out, finish_step)
            written = True
        else:
            finish_step()
        now.counters += self._increments
        if beginning.size:
            self._restart(beginning)
        forecasts.advance(beginning)
        if out is None or written:
            return
        if self._beliefs is not None and self._beliefs.begun.any():
            self._write_others(out)
        else:
            self.write_matrices(out)

    # Which persons the matrix shows.

    def _choose_shown_person(self, rows: Ints) -> None:
        """Note the first person that counts, and whether others have another forecast."""
        counted = self._counted_persons(rows)
        self._shown_person[rows] = person = counted.argmax(axis=0)
        start = self._first.coordinates[..., rows]
        shown = np.take_along_axis(start, person[None, None], axis=0)
        self._mixed[rows] = ((start != shown).any(axis=1) & counted).any(axis=0)

    def _counted_persons(self, rows: Ints | slice) -> Flags:
        """The persons in the mean: those missing, or all once all are found: (persons, n)."""
        if len(self._detections) == 1:
            number = len(self.step) if isinstance(rows, slice) else len(rows)
            return np.ones((1, number), np.bool_)
        return shown_persons(self._now.missing[:, rows] != 0)

    # The matrices.

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some rows, in rising order: float32, (n,)."""
        if self._beliefs is None and len(self._detections) == 1:
            return self._forecasts.probabilities(0, rows, cells)
        values = self._forecasts.probabilities(self._shown_persons(rows), rows, cells)
        mixed, believed = self._mixed_among(rows), self._believed_among(rows)
        if mixed.size:
            here, n = rows[mixed], np.arange(len(mixed))
            y, x = np.divmod(cells[mixed], self._size)
            values[mixed] = self._mean_of_forecasts(
                here, lambda of_x, of_y: of_y[n, y] * of_x[n, x]
            )
        if self._beliefs is not None and believed.size:
            here = rows[believed]
            values[believed] = self._beliefs.probabilities(
                here, cells[believed], self._counted_persons(here)
            )
        return values

    def matrices(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, shape (n, N, N)."""
        out = np.empty((len(rows), self._size, self._size), np.float32)
        self._write_forecasts(rows, out)
        believed = self._believed_among(rows)
        if self._beliefs is not None and believed.size:
            here = rows[believed]
            out[believed] = self._beliefs.matrices(here, self._counted_persons(here))
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, shape (rows, N, N), C-contiguous."""
        if self._beliefs is not None and self._beliefs.begun.any():
            self._beliefs.write_matrices(self._counted_persons(slice(None)), out)
            self._write_others(out)
        else:
            one_person = len(self._detections) == 1
            self._write_forecasts(slice(None) if one_person else np.arange(len(self.step)), out)

    def _write_others(self, out: Singles) -> None:
        """Write the matrices of the rows without beliefs."""
        assert self._beliefs is not None
        others = (~self._beliefs.begun).nonzero()[0]
        out[others] = self.matrices(others)

    def _write_forecasts(self, rows: Ints | slice, out: Singles) -> None:
        """Write the forecasts of some rows; rows with beliefs receive arbitrary values."""
        self._forecasts.write_matrices(self._shown_persons(rows), rows, out)
        if isinstance(rows, slice):  # there is only one person
            return
        mixed = self._mixed_among(rows)
        if mixed.size:
            out[mixed] = self._mean_of_forecasts(rows[mixed], _outer_products)

    def _shown_persons(self, rows: Ints | slice) -> Ints | int:
        return self._shown_person[rows] if len(self._detections) > 1 else 0

    def _mixed_among(self, rows: Ints) -> Ints:
        """The indices of those rows whose matrix is a mean of forecasts."""
        if len(self._detections) == 1:
            return _NO_ROWS
        mixed = self._mixed[rows]
        if self._beliefs is not None:
            mixed &= ~self._beliefs.begun[rows]
        return np.flatnonzero(mixed)

    def _believed_among(self, rows: Ints) -> Ints:
        """The indices of those rows that have beliefs."""
        if self._beliefs is None:
            return _NO_ROWS
        return np.flatnonzero(self._beliefs.begun[rows])

    def _mean_of_forecasts(
        self, rows: Ints, probability: Callable[[Floats, Floats], Floats]
    ) -> Singles:
        """The mean over the counted persons of a function of their marginals."""
        persons = range(len(self._detections))
        values = [probability(*self._forecasts.marginals(person, rows)) for person in persons]
        counted = self._counted_persons(rows)
        shown = counted.reshape(counted.shape + (1,) * (values[0].ndim - 1))
        return means_over_missing(values, shown).astype(np.float32)


def _outer_products(of_x: Floats, of_y: Floats) -> Floats:
    products: Floats = of_y[:, :, None] * of_x[:, None, :]
    return products
