"""Tabulated and on-the-fly forecasts of a batch equal `ProbabilityMatrix`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from batches import moved
from helpers import plain

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.vector import tabulated_forecasts
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts, OnTheFlyForecasts
from DroneSwarmSearch.vector.tabulated_forecasts import TabulatedForecasts, choose_forecasts


def parameters_of(
    starts: list[list[tuple[int, int]]], drifts: list[tuple[float, float]], constants: list[float]
) -> DriftParameters:
    """Forecasts of some rows: the persons' starts, the drift and the constant of each."""
    return DriftParameters(
        np.array(starts).transpose(1, 2, 0).copy(), np.array(drifts).T.copy(), np.array(constants)
    )


# Three rows of two persons on 6 x 6 cells.
SIZE = 6
STARTS = [[(0, 0), (2, 3)], [(5, 1), (5, 1)], [(2, 3), (0, 0)]]
DRIFTS = [(0.3, -0.2), (-0.5, 0.0), (0.3, -0.2)]
CONSTANTS = [3.0, 0.0, 3.0]
SIX = parameters_of(STARTS, DRIFTS, CONSTANTS)  # of the six forecasts three differ


def check_forecasts(made: Forecasts, steps: list[int]) -> None:
    """The forecasts of the three rows at some steps are those of `ProbabilityMatrix`."""
    every = np.arange(3)
    for person in range(2):
        of = [
            ProbabilityMatrix(SIZE, STARTS[row][person], DRIFTS[row], CONSTANTS[row])
            for row in every
        ]
        out = np.empty((3, SIZE, SIZE), np.float32)
        made.write_matrices(person, slice(None), out)
        matrices = np.stack([forecast.at(step) for forecast, step in zip(of, steps, strict=True)])
        assert out.tobytes() == matrices.tobytes()
        for cell in (0, 13, 35):
            shown = made.probabilities(person, every, np.full(3, cell))
            assert shown.tolist() == matrices.reshape(3, -1)[:, cell].tolist()
        x, y = made.marginals(person, every)
        right, left, down, up = made.moves(person, slice(None))
        for row, (forecast, step) in enumerate(zip(of, steps, strict=True)):
            assert plain([x[row], y[row]]) == plain(list(forecast.marginals(step)))
            moves = [chances[:, row] for chances in (right, left, down, up)]
            assert plain(moves) == plain(list(forecast.moves(step)))
        for axis, (higher, lower) in enumerate(((right, left), (down, up))):
            for at in range(SIZE):
                check_walk(made, person, axis, at, higher, lower)


def check_walk(
    made: Forecasts,
    person: int,
    axis: int,
    at: int,
    higher: np.ndarray,
    lower: np.ndarray,
) -> None:
    """From a cell persons walk as their chances say, to the last bit of the numbers drawn."""
    for chances in (higher[at], higher[at] + lower[at]):
        for numerators in (np.ceil(chances * 2**53) - 1, np.ceil(chances * 2**53)):
            draws = np.zeros((2, 2, 3), np.int64)
            draws[person, axis] = np.clip(numerators, 0, 2**53 - 1)
            cells = np.full(draws.shape, at)
            made.walk(cells, draws)
            assert cells[person, axis].tolist() == [
                moved(at, number, higher[:, row], lower[:, row])
                for row, number in enumerate((draws[person, axis] * 2.0**-53).tolist())
            ]


class Held:
    """Forecasts of three rows, with pointers that advance as in `BatchState`."""

    def __init__(self, made: Forecasts) -> None:
        self.forecasts = made
        self._now, self._first = (np.zeros((len(made.increments), 3), np.int64) for _ in range(2))
        made.bind(self._now, self._first)
        made.assign(np.arange(3), SIX)
        self.begin([0, 1, 2])

    def begin(self, rows: list[int]) -> None:
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.begin(np.array(rows))

    def advance(self, beginning: Sequence[int] = ()) -> None:
        rows = np.array(beginning, np.int64)
        self._now += self.forecasts.increments
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.advance(rows)


@pytest.mark.parametrize(
    "make", [lambda: TabulatedForecasts(SIZE, 80, SIX), lambda: OnTheFlyForecasts(SIZE, SIX)]
)
def test_forecasts_are_those_of_the_matrix_at_every_rows_step(
    make: Callable[[], Forecasts],
) -> None:
    held, steps = Held(make()), [0, 0, 0]
    for step in range(80):
        check_forecasts(held.forecasts, steps)
        held.advance([2] if step == 20 else [])
        steps = [one + 1 for one in steps]
        if step == 20:
            steps[2] = 0
        if step in (5, 40):
            held.begin([1, 2])
            steps[1:] = 0, 0
    check_forecasts(held.forecasts, [80, 39, 39])
    again = Held(make())
    again.forecasts.catch_up(np.array([70, 0, 33]))
    check_forecasts(again.forecasts, [70, 0, 33])


def filled_steps(tables: TabulatedForecasts) -> int:
    """The steps for which the tables of the three forecasts hold matrices."""
    return int(tables.matrices.reshape(3, 101, -1).any(axis=(0, 2)).sum())


def test_tables_fill_as_far_as_the_rows_come() -> None:
    tables = TabulatedForecasts(SIZE, 100, SIX)
    held = Held(tables)
    filled = []
    for step in range(100):
        held.advance()
        if step == 40:
            held.begin([0, 1, 2])
        filled.append(filled_steps(tables))
    # One step ahead. Rows that restarted after step 41 must reach step 63 for the third block.
    assert filled == [32] * 30 + [64] * 70
    for _ in range(41):
        held.advance()
        filled.append(filled_steps(tables))
    assert filled[100:] == [64] * 3 + [96] * 32 + [101] * 6
    assert len(tables.matrices) == 3 * 101


def test_equal_forecasts_are_stored_once_even_with_signed_zeros() -> None:
    other = parameters_of([[(0, 0)]] * 3, [(0.0, 1.0), (-0.0, 1.0), (0.0, 2.0)], [0.0, -0.0, 0.0])
    assert len(TabulatedForecasts(SIZE, 5, other).matrices) == 2 * 6
    twice = TabulatedForecasts(SIZE, 5, SIX, SIX)
    assert twice.matrices.shape == (3 * 6, SIZE, SIZE)


def test_forecasts_are_tabulated_if_tables_are_small_or_requested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A step of a forecast takes its matrix in single precision, and of each axis the chances of
    # every cell, and of a move up and down, and what decides moves, 8 bytes each.
    step_bytes = 4 * SIZE**2 + 2 * 5 * 8 * SIZE
    monkeypatch.setattr(tabulated_forecasts, "TABLE_BYTES", 3 * 101 * step_bytes)
    assert isinstance(choose_forecasts(SIZE, 100, SIX), TabulatedForecasts)
    assert isinstance(choose_forecasts(SIZE, 101, SIX), OnTheFlyForecasts)
    assert isinstance(choose_forecasts(SIZE, 101, SIX, wants_table=True), TabulatedForecasts)
    fourth = parameters_of([[(4, 4), (5, 1)]] * 3, [(-0.5, 0.0)] * 3, [0.0] * 3)
    assert isinstance(choose_forecasts(SIZE, 100, SIX, fourth), OnTheFlyForecasts)
    assert isinstance(choose_forecasts(SIZE, 100, SIX, SIX), TabulatedForecasts)
