"""The best path for given gains, and the person's chain forecast, by slower means."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.belief import after_drift
from DroneSwarmSearch.planning.chain import Chain, transitions
from DroneSwarmSearch.planning.paths import NOWHERE, best_path, values_to_go

# Paths.

Way = tuple[float, list[int], list[bool]]


def ways(
    gains: np.ndarray, at_end: np.ndarray, blocked: list[list[int]], start: int, step: int = 0
) -> Iterator[Way]:
    """All that a drone can do, with what it gains: staying first, then left, right, up, down."""
    n, size = len(gains), gains.shape[-1]
    y, x = divmod(start, size)
    if step == n:
        yield float(at_end[y, x]), [start], []
        return
    gain = float(gains[step, y, x])
    for v, u in ((y, x), (y, x - 1), (y, x + 1), (y - 1, x), (y + 1, x)):
        cell = v * size + u
        if not (0 <= u < size and 0 <= v < size) or cell in blocked[step]:
            continue
        gained = gain if cell == start else 0.0
        for more, cells, searches in ways(gains, at_end, blocked, cell, step + 1):
            yield gained + more, [start, *cells], [gained > 0.0, *searches]


@st.composite
def boards(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, list[list[int]]]:
    """Gains, ends and blocked cells. Whole numbers: sums are exact, and ties frequent."""
    size, n = draw(st.integers(2, 3)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    gains = rng.integers(0, draw(st.integers(1, 9)) + 1, (n, size, size)).astype(float)
    end = draw(st.sampled_from(["anywhere", "one cell", "of different worth"]))
    at_end = np.zeros((size, size))
    if end == "one cell":
        at_end[...] = NOWHERE
        at_end.reshape(-1)[draw(st.integers(0, size**2 - 1))] = 0.0
    elif end == "of different worth":
        at_end = rng.integers(0, 5, (size, size)).astype(float)
    most = draw(st.integers(0, 3))
    blocked = [rng.integers(0, size**2, most).tolist() for _ in range(n)]
    return gains, at_end, blocked


@settings(deadline=None, max_examples=60, derandomize=True)
@given(boards())
def test_the_path_is_the_first_of_the_best_there_are(
    board: tuple[np.ndarray, np.ndarray, list[list[int]]],
) -> None:
    gains, at_end, blocked = board
    values = values_to_go(gains, at_end, blocked)
    assert values.shape == (len(gains) + 1, *at_end.shape)
    assert np.array_equal(values[-1], at_end)
    for start, promised in enumerate(values[0].reshape(-1)):
        every = [way for way in ways(gains, at_end, blocked, start) if way[0] > NOWHERE]
        if not every:
            assert promised == NOWHERE
            continue
        gained, cells, searches = max(every, key=lambda way: way[0])  # the first of equals
        assert promised == gained
        path = best_path(gains, values, start, blocked)
        assert path.cells.tolist() == cells
        assert path.searches.tolist() == searches


@settings(deadline=None, max_examples=20, derandomize=True)
@given(boards())
def test_values_of_later_steps_are_those_of_what_is_left(
    board: tuple[np.ndarray, np.ndarray, list[list[int]]],
) -> None:
    gains, at_end, blocked = board
    values = values_to_go(gains, at_end, blocked)
    for step in range(len(gains)):
        assert np.array_equal(values[step:], values_to_go(gains[step:], at_end, blocked[step:]))


def test_gains_of_any_size_are_summed_up() -> None:
    rng = np.random.default_rng(1)
    gains, nothing = rng.random((5, 3, 3)), np.zeros((3, 3))
    values = values_to_go(gains, nothing)
    for start in range(9):
        most = max(way[0] for way in ways(gains, nothing, [[]] * 5, start))
        assert values[0].reshape(-1)[start] == pytest.approx(most, rel=1e-12)
        path = best_path(gains, values, start)
        flat = gains.reshape(5, -1)[np.arange(5), path.cells[:-1]]
        assert flat[path.searches].sum() == pytest.approx(most, rel=1e-12)


def test_a_drone_with_nothing_to_gain_stays_and_does_not_search() -> None:
    gains = np.zeros((4, 3, 3))
    path = best_path(gains, values_to_go(gains, gains[0]), 4)
    assert path.cells.tolist() == [4] * 5
    assert not path.searches.any()


def test_what_was_given_is_not_changed() -> None:
    rng = np.random.default_rng(2)
    given_arrays = rng.random((4, 3, 3)), rng.random((3, 3))
    before = [array.copy() for array in given_arrays]
    blocked = [[1, 4], [], [8], [0]]
    best_path(given_arrays[0], values_to_go(*given_arrays, blocked), 0, blocked)
    assert all(np.array_equal(*pair) for pair in zip(given_arrays, before, strict=True))
    assert blocked == [[1, 4], [], [8], [0]]


# The chain.


@st.composite
def forecasts(draw: st.DrawFn) -> ProbabilityMatrix:
    size = draw(st.integers(2, 7))
    cell = st.integers(0, size - 1)
    drift = st.sampled_from([0.0, 0.3, -0.5, 1.0, -2.5])
    return ProbabilityMatrix(
        size,
        (draw(cell), draw(cell)),
        (draw(drift), draw(drift)),
        draw(st.sampled_from([0.0, 0.5, 10.0, 1000.0])),
    )


def masses(forecast: ProbabilityMatrix, seed: int, *axes: int) -> np.ndarray:
    return np.random.default_rng(seed).random((*axes, forecast.grid_size, forecast.grid_size))


@settings(deadline=None, max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(1, 6), st.integers(0, 99))
def test_forth_is_the_drift_of_a_belief(
    forecast: ProbabilityMatrix, begin: int, steps: int, seed: int
) -> None:
    chain = Chain(forecast, 0.5, begin, begin + steps)
    for step in range(begin, begin + steps):
        mass = masses(forecast, seed + step)
        after = chain.forward(mass, step)
        np.testing.assert_allclose(after, after_drift(mass, *forecast.moves(step)), atol=1e-13)
        assert after.sum() == pytest.approx(mass.sum(), rel=1e-12)
        assert (after >= 0).all()
        np.testing.assert_allclose(
            chain.forward(forecast.exact(step), step), forecast.exact(step + 1), atol=1e-13
        )


@settings(deadline=None, max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(0, 99))
def test_back_is_the_adjoint_of_forth(forecast: ProbabilityMatrix, step: int, seed: int) -> None:
    chain = Chain(forecast, 1.0, step, step + 1)
    mass, value = masses(forecast, seed), masses(forecast, seed + 1)
    now = float(np.vdot(chain.backward(value, step), mass))
    assert now == pytest.approx(float(np.vdot(value, chain.forward(mass, step))), rel=1e-12)
    np.testing.assert_allclose(chain.backward(np.ones_like(mass), step), 1.0, rtol=1e-12)


def test_a_value_seen_from_a_corner_is_the_mean_over_the_moves_there() -> None:
    forecast = ProbabilityMatrix(4, (0, 3), (0.4, 0.1), 10)
    right, left, down, up = forecast.moves(2)
    value = masses(forecast, 3)
    expected = 0.0
    for dx, across in ((0, 1 - right[0] - left[0]), (1, right[0])):
        for dy, along in ((0, 1 - down[3] - up[3]), (-1, up[3])):
            expected += across * along * value[3 + dy, dx]
    seen = Chain(forecast, 1.0, 0, 5).backward(value, 2)[3, 0]
    assert seen == pytest.approx(expected, rel=1e-12)
    assert 0.0 < right[0] < 1.0
    assert 0.0 < up[3] < 1.0


def test_steps_keep_their_numbers_wherever_a_chain_begins() -> None:
    forecast = ProbabilityMatrix(6, (2, 3), (0.3, -0.2), 5)
    mass = masses(forecast, 4)
    whole, part = Chain(forecast, 0.7, 0, 9), Chain(forecast, 0.7, 4, 7)
    assert (whole.detection, part.detection) == (0.7, 0.7)
    for step in (4, 5, 6):
        assert np.array_equal(whole.forward(mass, step), part.forward(mass, step))
        assert np.array_equal(whole.backward(mass, step), part.backward(mass, step))


def test_leading_axes_are_carried_along() -> None:
    forecast = ProbabilityMatrix(5, (2, 3), (0.3, -0.2), 5)
    chain, many = Chain(forecast, 1.0, 0, 3), masses(forecast, 5, 2, 3)
    way: Any
    for way in (chain.forward, chain.backward):
        together = way(many, 1)
        for i, j in np.ndindex(2, 3):
            np.testing.assert_allclose(together[i, j], way(many[i, j], 1), rtol=1e-13)


def test_transitions_are_stochastic_and_tridiagonal() -> None:
    forecast = ProbabilityMatrix(6, (2, 3), (0.3, -0.2), 5)
    right, left, *_ = (
        np.array(chances) for chances in zip(*map(forecast.moves, range(4)), strict=True)
    )
    matrices = transitions(right, left)
    np.testing.assert_allclose(matrices.sum(axis=2), 1.0, rtol=1e-12)
    i, j = np.indices((6, 6))
    assert not matrices[:, abs(i - j) > 1].any()
    assert np.array_equal(matrices[:, np.arange(5), np.arange(1, 6)], right[:, :-1])
    assert np.array_equal(matrices[:, np.arange(1, 6), np.arange(5)], left[:, 1:])
