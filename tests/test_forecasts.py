"""Tabulated and on-the-fly forecasts of a batch equal `ProbabilityMatrix`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from batches import moved
from helpers import plain

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import dispersion_rate
from DroneSwarmSearch.vector import tabulated_forecasts
from DroneSwarmSearch.vector.forecasts import (
    DriftParameters,
    Forecasts,
    Mixtures,
    OnTheFlyForecasts,
)
from DroneSwarmSearch.vector.tabulated_forecasts import (
    TabulatedForecasts,
    choose_forecasts,
    distinct,
    forecasts_of_situations,
)


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


def drift_of(row: int, person: int) -> Drift:
    diffusion = dispersion_rate(CONSTANTS[row])
    return Drift(STARTS[row][person], vector=DRIFTS[row], diffusion=diffusion)


def tabulated(steps: int, *parameters: DriftParameters) -> TabulatedForecasts:
    known = distinct(parameters)
    return TabulatedForecasts(SIZE, steps, Mixtures.of_numbers(known), 2, known)


def on_the_fly() -> OnTheFlyForecasts:
    return OnTheFlyForecasts(SIZE, Mixtures.of_numbers(SIX.as_numbers().reshape(-1, 5)), 2, 3)


def check_forecasts(
    made: Forecasts, steps: list[int], persons: Sequence[Sequence[Person | Drift]]
) -> None:
    """The forecasts of the three rows at some steps are those of `ProbabilityMatrix`."""
    every = np.arange(3)
    for number, of_rows in enumerate(persons):
        of = [ProbabilityMatrix(SIZE, person) for person in of_rows]
        out = np.empty((3, SIZE, SIZE), np.float32)
        made.write_matrices(number, slice(None), out)
        matrices = np.stack([forecast.at(step) for forecast, step in zip(of, steps, strict=True)])
        assert out.tobytes() == matrices.tobytes()
        joint = made.joint(number, every)
        for cell in (0, 13, 35):
            shown = made.probabilities(number, every, np.full(3, cell))
            assert shown.tolist() == matrices.reshape(3, -1)[:, cell].tolist()
            at_cell = made.joint_at(number, every, np.full(3, cell))
            assert at_cell.tolist() == joint.reshape(-1, SIZE**2, 3)[:, cell].tolist()
        right, left, down, up = made.moves(number, slice(None))
        for row, (forecast, step) in enumerate(zip(of, steps, strict=True)):
            own = len(forecast.weights)
            assert plain(joint[:own, ..., row]) == plain(forecast.joint(step))
            assert not joint[own:, ..., row].any()
            moves = [chances[:own, :, row] for chances in (right, left, down, up)]
            assert plain(moves) == plain(list(forecast.moves(step)))
        for axis, (higher, lower) in enumerate(((right, left), (down, up))):
            for at in range(SIZE):
                check_walk(made, number, axis, at, higher[0], lower[0])


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

    def __init__(self, made: Forecasts, numbers: np.ndarray | None = None) -> None:
        self.forecasts = made
        self._now, self._first = (np.zeros((len(made.increments), 3), np.int64) for _ in range(2))
        made.bind(self._now, self._first)
        rows = np.arange(3)
        numbers = made.numbers_of(rows, SIX) if numbers is None else numbers
        made.assign(rows, numbers, np.zeros_like(numbers))
        self.begin([0, 1, 2])

    def begin(self, rows: list[int]) -> None:
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.begin(np.array(rows))

    def advance(self, beginning: Sequence[int] = ()) -> None:
        rows = np.array(beginning, np.int64)
        self._now += self.forecasts.increments
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.advance(rows)


def check_every_step(make: Callable[[], Held], persons: Sequence[Sequence[Person | Drift]]) -> None:
    held, steps = make(), [0, 0, 0]
    for step in range(80):
        check_forecasts(held.forecasts, steps, persons)
        held.advance([2] if step == 20 else [])
        steps = [one + 1 for one in steps]
        if step == 20:
            steps[2] = 0
        if step in (5, 40):
            held.begin([1, 2])
            steps[1:] = 0, 0
    check_forecasts(held.forecasts, [80, 39, 39], persons)
    again = make()
    again.forecasts.catch_up(np.array([70, 0, 33]))
    check_forecasts(again.forecasts, [70, 0, 33], persons)


@pytest.mark.parametrize("make", [lambda: tabulated(80, SIX), on_the_fly])
def test_forecasts_are_those_of_the_matrix_at_every_rows_step(
    make: Callable[[], Forecasts],
) -> None:
    persons = [[drift_of(row, person) for row in range(3)] for person in range(2)]
    check_every_step(lambda: Held(make()), persons)


PRIOR = np.diag(np.arange(SIZE, dtype=float))
DIFFERENT = [
    Person([Drift((1.5, 2), start_sd=1, vector_sd=0.1), Drift((4, 4), diffusion=0.3, weight=2)]),
    Person(Drift((2, 2), vector=(0.3, 0.1), adrift=4, diffusion=0.2)),
    Person([Drift((5, 0), vector=(-0.2, 0.2), diffusion=0.1), Drift((0, 0)), Drift((3, 3))]),
    Person([Drift(PRIOR, diffusion=0.2), Drift((4, 1), vector=(-0.1, 0.1))]),
]


@pytest.mark.parametrize(("count", "table_bytes"), [(3, 2**26), (3, 0), (4, 0)])
def test_forecasts_of_hypotheses_are_those_of_the_matrix(
    count: int, table_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Forecasts with fewer hypotheses are padded; starts that are arrays are tabulated."""
    monkeypatch.setattr(tabulated_forecasts, "TABLE_BYTES", table_bytes)
    different = DIFFERENT[:count]
    numbers = np.array([[0, 1, count - 1], [2, 2, 1]])
    mixtures = Mixtures.of_persons(different)

    def make() -> Held:
        return Held(forecasts_of_situations(SIZE, 80, mixtures, 2, 3), numbers)

    assert isinstance(make().forecasts, TabulatedForecasts) == (table_bytes > 0 or count == 4)
    check_every_step(make, [[different[number] for number in row] for row in numbers.tolist()])


def filled_steps(tables: TabulatedForecasts) -> int:
    """The steps for which the tables of the three forecasts hold matrices."""
    return int(tables.matrices.reshape(3, 101, -1).any(axis=(0, 2)).sum())


def test_tables_fill_as_far_as_the_rows_come() -> None:
    tables = tabulated(100, SIX)
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
    assert len(tabulated(5, other).matrices) == 2 * 6
    twice = tabulated(5, SIX, SIX)
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
