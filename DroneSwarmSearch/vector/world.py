"""The world states of a batch: the persons, the searches for them, and the matrices.

The array form of `world.WorldState`: many rows, each at its own step and in its own episode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Singles, Words
from DroneSwarmSearch._internal.streams import GOLDEN, mixed, numbers, numerators
from DroneSwarmSearch.drift.belief import means_over_missing, over_hypotheses, shown_persons
from DroneSwarmSearch.rules import COVERED_AT
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.beliefs import Beliefs
from DroneSwarmSearch.vector.episodes import RowState
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts
from DroneSwarmSearch.vector.situations import Situations
from DroneSwarmSearch.vector.tabulated_forecasts import TabulatedForecasts
from DroneSwarmSearch.vector.threads import worth_sharing

__all__ = ["BatchState"]

_NO_ROWS: Ints = np.empty(0, np.int64)


class BatchState:
    """The persons of many searches.

    Args:
        scenario: the shared parameters.
        forecasts: the rows' forecasts.
        situations: the catalogue, or None.
        rows: the number of searches.
        finds_last: whether a search's last missing person can be found.
    """

    def __init__(
        self,
        scenario: Scenario,
        forecasts: Forecasts,
        situations: Situations | None,
        rows: int,
        finds_last: bool,
    ) -> None:
        detections: Sequence[float | Floats] = scenario.detections
        if situations is not None:
            detections = situations.detections
        self._detections = detections
        self._persons = persons = len(detections)
        self._situations = situations
        self._size = scenario.grid_size
        self._width = np.array(self._size)  # 0-d: NumPy calculates faster than with an int
        self._is_rescue = scenario.mission == "rescue"
        self._finds_last = finds_last
        self._pays_expectation = scenario.reward_scheme.expected_finds
        self._beliefs: Beliefs | None = None
        if scenario.keeps_beliefs:
            self._beliefs = Beliefs(self._size, persons, forecasts.hypotheses, rows)
        self._shown_beliefs = self._beliefs if scenario.bayesian_update else None
        # The counters of a step's drift draws, from the key of the episode on.
        self._draws = np.arange(1, 2 * persons + 1, dtype=np.uint64)[:, None] * GOLDEN
        self._now, self._first = (RowState(persons, rows) for _ in range(2))
        self._start_draws = np.zeros((persons, rows))  # of the next episodes
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
        if self._shown_beliefs is not None or self._persons > 1:
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
    def situation(self) -> Ints:
        """The number of every row's situation, 0 without a catalogue: int64, (rows,)."""
        return self._now.situation

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
        self._set_forecasts(forecasts)
        self.assign(rows, parameters)
        self._now.pointers[...] = self._first.pointers
        forecasts.begin(rows)
        forecasts.catch_up(self.step)

    def prepare(self, rows: Ints, counters: Words, situation: Ints | None) -> None:
        """Draw what the next episodes of some rows begin with.

        Args:
            rows: their numbers.
            counters: the counters of these episodes, see `Episodes`: uint64, (streams, n).
            situation: the number of each row's situation, int64, (all rows,); or None to
                draw one for each episode.
        """
        situations = self._situations
        keys = mixed(counters[:2] if situations is None else counters)
        self._first.draws[:, rows] = self._draws + keys[0]
        self._first.detection_keys[rows] = keys[1]
        if situations is None:
            return
        # The sampling stream begins with the draw of the situation.
        places = np.arange(-1, self._persons).clip(0).astype(np.uint64)[:, None]
        drawn, *starts = numbers(keys[[2, *[3] * self._persons]], places)
        self._start_draws[:, rows] = starts
        if situation is None:
            number = (drawn * len(situations)).astype(np.int64)
        else:
            number = situation[rows]
        self.choose(rows, number)

    def choose(self, rows: Ints, situation: Ints) -> None:
        """Set the situations of the next episodes of some rows after `prepare`.

        Args:
            rows: their numbers.
            situation: the number of each row's situation: int64, (n,).
        """
        assert self._situations is not None
        self._first.situation[rows] = situation
        forecasts = self._situations.numbers.take(situation, axis=1)
        starts = self._situations.starts(forecasts, self._start_draws[:, rows])
        hypotheses, cells = np.divmod(starts, self._size**2)
        self._first.y[:, rows], self._first.x[:, rows] = np.divmod(cells, self._size)
        self._first.cells[:, rows] = cells
        self._forecasts.assign(rows, forecasts, hypotheses)

    def assign(self, rows: Ints, parameters: DriftParameters) -> None:
        """Set the drift parameters of the next episodes of some rows.

        Args:
            rows: their numbers.
            parameters: the parameters of all rows.
        """
        start = parameters.start[..., rows]
        self._first.coordinates[..., rows] = start
        self._first.cells[:, rows] = start[:, 1] * self._size + start[:, 0]
        forecasts = self._forecasts.numbers_of(rows, parameters)
        self._forecasts.assign(rows, forecasts, np.zeros_like(forecasts))

    def begin(self, rows: Ints) -> None:
        """Start the episodes of some rows after `prepare` and `assign` or `choose`."""
        self._restart(rows)
        self._forecasts.begin(rows)

    def _restart(self, rows: Ints) -> None:
        """Put some rows at step 0, except for their forecasts."""
        self._now.all[:, rows] = self._first.all.take(rows, axis=1)
        if self._beliefs is not None:
            self._beliefs.forget(rows)
        if self._persons > 1:
            self._choose_shown_person(rows)

    # A step: `observed`, then `search`, then `advance`.

    def observed(self, rows: Ints, cells: Ints) -> Floats:
        """What searches pay for: float64, (n,); see `world.WorldState.observed`.

        Args:
            rows: the row of every search, in ascending order.
            cells: the cell of every search.
        """
        if not self._pays_expectation:
            return self.probabilities(rows, cells).astype(np.float64)
        assert self._beliefs is not None
        self._beliefs.begin(rows, self._forecasts)
        return self._beliefs.added_success(rows, cells, self._detections_of(rows))

    def search(self, rows: Ints, cells: Ints, drones: Ints) -> Ints:
        """Apply a step's searches: decide which of them find a person, update the beliefs.

        Args:
            rows: the row of every search, in ascending order.
            cells: the cell of every search; different cells within a row.
            drones: the drone of every search, numbered throughout the batch.

        Returns:
            The searches that found someone, as indices into the arguments; a search that
            found several persons may occur several times.
        """
        finds = self._finds_of(rows, cells, drones) if self._is_rescue else _NO_ROWS
        if self._beliefs is not None and rows.size:
            self._beliefs.begin(rows, self._forecasts)
            self._beliefs.search(rows, cells, self._detections_of(rows))
            if not self._is_rescue:  # the rules need the probability of success
                self._beliefs.normalise()
        return finds

    def _finds_of(self, rows: Ints, cells: Ints, drones: Ints) -> Ints:
        found = []
        now, several = self._now, self._persons > 1
        is_last = None if self._finds_last else now.missing.sum(axis=0) == 1
        for person in range(self._persons):
            right = now.cells[person].take(rows) == cells
            if several:  # with one person, a find ends the episode
                right &= now.missing[person].take(rows) != 0
            if is_last is not None:
                right &= ~is_last.take(rows)
            hits = right.nonzero()[0]
            if hits.size:
                where = rows.take(hits)
                chance = self._detection(person, where)
                if not (isinstance(chance, float) and chance == 1.0):
                    places = now.step[where] * self._persons + person
                    uniforms = numbers(now.detection_keys[where], places.astype(np.uint64))
                    hits = hits[uniforms < chance]
                    where = rows.take(hits)
                now.missing[person][where] = 0
                self._finds[:, person, where] = drones.take(hits), cells.take(hits)
                found.append(hits)
        finds = np.concatenate(found) if len(found) > 1 else found[0] if found else _NO_ROWS
        if finds.size and several:
            self._choose_shown_person(np.unique(rows[finds]))
        return finds

    def _detection(self, person: int, rows: Ints) -> float | Floats:
        """A person's probability of detection in some rows: a number, or one for each row."""
        detection = self._detections[person]
        if isinstance(detection, float):
            return detection
        of_rows: Floats = detection.take(self._now.situation.take(rows))
        return of_rows

    def _detections_of(self, rows: Ints) -> list[float | Floats]:
        return [self._detection(person, rows) for person in range(self._persons)]

    def all_found(self, rows: Ints) -> Ints:
        """Those of some rows in which all persons have been found."""
        if self._persons == 1:
            return rows
        found: Ints = rows[~self._now.missing.take(rows, axis=1).any(axis=0)]
        return found

    def covered(self, rows: Ints) -> Ints:
        """Those of some searched rows whose coverage mission is complete."""
        if self._is_rescue or not rows.size:
            return _NO_ROWS
        assert self._beliefs is not None
        covered: Ints = rows[self._beliefs.success(rows) > COVERED_AT]
        return covered

    def success(self) -> Floats | None:
        """The probability of success of every row, (rows,); None without beliefs."""
        return None if self._beliefs is None else self._beliefs.success(slice(None))

    def failure(self) -> Floats | None:
        """The probability that no search finds each person, (rows, persons), or None."""
        return None if self._beliefs is None else self._beliefs.kept.T.copy()

    def advance(self, beginning: Ints, out: Singles | None, foreground: Callable[[], None]) -> None:
        """Advance the persons and the beliefs by a step, after `search`.

        Args:
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
            shown = None if self._shown_beliefs is None else out
            counted = self._counted_persons(slice(None))
            self._beliefs.drift(forecasts, counted, shown, finish_step)
        elif (
            out is not None
            and worth_sharing(out)
            and self._persons == 1
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
        if self._shown_beliefs is not None and self._shown_beliefs.begun.any():
            self._write_others(out)
        else:
            self.write_matrices(out)

    # Which persons the matrix shows.

    def _choose_shown_person(self, rows: Ints) -> None:
        """Note the first person that counts, and whether others have another forecast."""
        counted = self._counted_persons(rows)
        self._shown_person[rows] = person = counted.argmax(axis=0)
        forecasts = self._now.pointers[: self._persons, rows]
        shown = np.take_along_axis(forecasts, person[None], axis=0)
        self._mixed[rows] = ((forecasts != shown) & counted).any(axis=0)

    def _counted_persons(self, rows: Ints | slice) -> Flags:
        """The persons in the mean: those missing, or all once all are found: (persons, n)."""
        if self._persons == 1:
            number = len(self.step) if isinstance(rows, slice) else len(rows)
            return np.ones((1, number), np.bool_)
        return shown_persons(self._now.missing[:, rows] != 0)

    # The matrices.

    def probabilities(self, rows: Ints, cells: Ints) -> Singles:
        """The matrix entry of one cell in each of some rows, in ascending order: float32, (n,)."""
        if self._shown_beliefs is None and self._persons == 1:
            return self._forecasts.probabilities(0, rows, cells)
        values = self._forecasts.probabilities(self._shown_persons(rows), rows, cells)
        mixed, believed = self._mixed_among(rows), self._believed_among(rows)
        if mixed.size:
            here, there = rows[mixed], cells[mixed]
            values[mixed] = self._mean_of_forecasts(
                here, lambda person: self._forecasts.joint_at(person, here, there)
            )
        if self._shown_beliefs is not None and believed.size:
            here = rows[believed]
            values[believed] = self._shown_beliefs.probabilities(
                here, cells[believed], self._counted_persons(here)
            )
        return values

    def matrices(self, rows: Ints) -> Singles:
        """The matrices of some rows: float32, shape (n, N, N)."""
        out = np.empty((len(rows), self._size, self._size), np.float32)
        self._write_forecasts(rows, out)
        believed = self._believed_among(rows)
        if self._shown_beliefs is not None and believed.size:
            here = rows[believed]
            out[believed] = self._shown_beliefs.matrices(here, self._counted_persons(here))
        return out

    def write_matrices(self, out: Singles) -> None:
        """Write the matrix of every row: float32, shape (rows, N, N), C-contiguous."""
        if self._shown_beliefs is not None and self._shown_beliefs.begun.any():
            self._shown_beliefs.write_matrices(self._counted_persons(slice(None)), out)
            self._write_others(out)
        else:
            one_person = self._persons == 1
            self._write_forecasts(slice(None) if one_person else np.arange(len(self.step)), out)

    def _write_others(self, out: Singles) -> None:
        """Write the matrices of the rows without beliefs."""
        assert self._shown_beliefs is not None
        others = (~self._shown_beliefs.begun).nonzero()[0]
        out[others] = self.matrices(others)

    def _write_forecasts(self, rows: Ints | slice, out: Singles) -> None:
        """Write the forecasts of some rows; rows with beliefs receive arbitrary values."""
        self._forecasts.write_matrices(self._shown_persons(rows), rows, out)
        if isinstance(rows, slice):  # there is only one person
            return
        mixed = self._mixed_among(rows)
        if mixed.size:
            here = rows[mixed]
            mean = self._mean_of_forecasts(here, lambda person: self._forecasts.joint(person, here))
            out[mixed] = np.moveaxis(mean, -1, 0)

    def _shown_persons(self, rows: Ints | slice) -> Ints | int:
        return self._shown_person[rows] if self._persons > 1 else 0

    def _mixed_among(self, rows: Ints) -> Ints:
        """The indices of those rows whose matrix is a mean of forecasts."""
        if self._persons == 1:
            return _NO_ROWS
        mixed = self._mixed[rows]
        if self._shown_beliefs is not None:
            mixed &= ~self._shown_beliefs.begun[rows]
        return np.flatnonzero(mixed)

    def _believed_among(self, rows: Ints) -> Ints:
        """The indices of those rows that have beliefs."""
        if self._shown_beliefs is None:
            return _NO_ROWS
        return np.flatnonzero(self._shown_beliefs.begun[rows])

    def _mean_of_forecasts(self, rows: Ints, joint: Callable[[int], Floats]) -> Singles:
        """The mean over the counted persons of a joint probability.

        Args:
            rows: the rows, shape (n,).
            joint: that of each person, shape (M, ..., n).

        Returns:
            float32, shape (..., n).
        """
        values = [over_hypotheses(joint(person)) for person in range(self._persons)]
        return means_over_missing(values, self._counted_persons(rows)).astype(np.float32)

    # The probabilities of the hypotheses.

    def shown_weights(self, row: int) -> Floats | None:
        """The probability of each hypothesis under the belief shown: (persons, M); or None."""
        if self._shown_beliefs is None or not self._shown_beliefs.begun[row]:
            return None
        return self._shown_beliefs.weights(row)
