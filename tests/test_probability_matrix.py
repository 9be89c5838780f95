"""The forecast compared with a plain implementation of its formulas."""

from __future__ import annotations

import copy
import math
import os
import pickle
import signal
import threading
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch._internal.erf import erf
from DroneSwarmSearch.drift import ProbabilityMatrix, tables
from DroneSwarmSearch.drift import probability_matrix as module
from DroneSwarmSearch.drift.tables import dispersion_rate

DRIFTS = [(0, 0), (0.5, 0.5), (0.3, -0.2), (1, 1), (3.5, -0.5), (-1e300, 7), (-0.7, 0.01)]
CONSTANTS = [0, 0.5, 3, 10, 100, 1e308]


def plain_cdfs(size: int, start: int, drift: float, constant: float, steps: int) -> np.ndarray:
    """F_0 ... F_steps of one axis, cell by cell."""
    rate = (2 / 3) * constant / (constant + 5) if constant < 1e300 else 2 / 3
    rows = [[1.0 if x >= start else 0.0 for x in range(size)]]
    for t in range(1, steps + 1):
        mean = min(max(start + drift * t, 0), size - 1)
        deviation = math.sqrt(rate * t)

        def phi(edge: float, mean: float = mean, deviation: float = deviation) -> float:
            if deviation == 0:
                return 1.0 if edge + 0.5 > round(mean) else 0.0
            return 0.5 * (1 + math.erf((edge - mean) / (deviation * math.sqrt(2))))

        before, row = rows[-1], []
        for x in range(size):
            total = phi(size - 0.5) - phi(-0.5)
            target = (phi(x + 0.5) - phi(-0.5)) / total if deviation else phi(x)
            low = before[x - 1] if x > 0 else 0.0
            high = before[x + 1] if x < size - 1 else 1.0
            row.append(min(max(target, low), high))
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("drift", DRIFTS)
@pytest.mark.parametrize("constant", CONSTANTS)
def test_forecast_is_the_clipped_gaussian(drift: tuple[float, float], constant: float) -> None:
    size, start, steps = 11, (4, 9), 70
    forecast = ProbabilityMatrix(size, start, drift, constant)
    columns, rows = (
        np.diff(plain_cdfs(size, start[axis], drift[axis], constant, steps), prepend=0.0)
        for axis in (0, 1)
    )
    for t in range(steps + 1):
        x, y = forecast.marginals(t)
        np.testing.assert_allclose(x, columns[t], atol=1e-12)
        np.testing.assert_allclose(y, rows[t], atol=1e-12)
        np.testing.assert_allclose(forecast.at(t), np.outer(rows[t], columns[t]), atol=1e-7)


@pytest.mark.parametrize("drift", DRIFTS)
@pytest.mark.parametrize("constant", CONSTANTS)
def test_moves_map_each_forecast_to_the_next(drift: tuple[float, float], constant: float) -> None:
    forecast = ProbabilityMatrix(11, (4, 9), drift, constant)
    for t in range(100):
        right, left, down, up = forecast.moves(t)
        for axis, (higher, lower) in enumerate(((right, left), (down, up))):
            now, after = forecast.marginals(t)[axis], forecast.marginals(t + 1)[axis]
            stay = 1 - higher - lower
            assert min(higher.min(), lower.min(), stay.min()) >= -1e-12
            moved = now * stay
            moved[1:] += (now * higher)[:-1]
            moved[:-1] += (now * lower)[1:]
            np.testing.assert_allclose(moved, after, atol=1e-14)
            assert higher[-1] == 0.0 == lower[0]


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    size=st.integers(2, 30),
    place=st.tuples(st.floats(0, 0.999), st.floats(0, 0.999)),
    drift=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 2),
    constant=st.floats(0, 1e308),
    t=st.integers(0, 90),
)
def test_matrix_properties(size: int, place: tuple, drift: tuple, constant: float, t: int) -> None:
    start = int(place[0] * size), int(place[1] * size)
    matrix = ProbabilityMatrix(size, start, drift, constant).at(t)
    assert matrix.dtype == np.float32 and matrix.shape == (size, size)
    assert matrix.min() >= 0
    assert matrix.sum(dtype=np.float64) == pytest.approx(1, abs=1e-6)
    y, x = np.nonzero(matrix)
    assert np.abs(x - start[0]).max() <= t and np.abs(y - start[1]).max() <= t


def moments(probability: np.ndarray) -> tuple[float, float]:
    cells = np.arange(len(probability))
    mean = probability @ cells
    return mean, math.sqrt(probability @ (cells - mean) ** 2)


def test_oracles() -> None:
    x, _ = ProbabilityMatrix(40, (20, 20), (0, 0), 10).marginals(40)
    assert moments(x) == pytest.approx((20.00, 4.22), abs=0.01)
    x, _ = ProbabilityMatrix(40, (20, 20), (0.5, 0), 3).marginals(20)
    assert moments(x) == pytest.approx((30.00, 2.25), abs=0.01)


def test_drift_is_limited_to_one_cell_per_step() -> None:
    fast = ProbabilityMatrix(40, (3, 20), (9.0, 0), 10)
    for t in range(1, 25):
        assert moments(fast.marginals(t)[0])[0] == pytest.approx(3 + t, abs=0.01)


def test_probabilities_are_not_negative_for_any_rounding_of_erf(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    noise = np.random.default_rng(0)

    def rounded(z: np.ndarray) -> np.ndarray:
        return erf(z) + noise.uniform(-1e-9, 1e-9, z.shape)

    monkeypatch.setattr(tables, "erf", rounded)
    of = {"start": np.array([4, 9]), "drift": np.array([0.3, -0.8])}
    constant, steps = np.array(5.0), np.arange(1.0, 41.0)[:, None]
    cdf = tables.gaussian_cdf(30, **of, disperse_constant=constant, step=steps)
    assert np.diff(cdf, axis=0).min() == 0.0


def test_dispersion_rate_grows_to_two_thirds() -> None:
    rates = [dispersion_rate(constant) for constant in (0, 0.5, 3, 10, 100, 1e9)]
    assert rates == sorted(rates) and rates[0] == 0
    assert rates[3] == pytest.approx(4 / 9) and rates[-1] == pytest.approx(2 / 3)


def test_steps_can_be_read_in_any_order() -> None:
    one, other = (ProbabilityMatrix(9, (4, 4), (0.1, 0.2), 5) for _ in range(2))
    expected = [one.at(t).copy() for t in range(100)]
    for t in (99, 0, 33, 32, 31, 64, 98, 1):
        np.testing.assert_array_equal(other.at(t), expected[t])


def test_matrices_are_new_arrays() -> None:
    forecast = ProbabilityMatrix(9, (4, 4), (0.1, 0.2), 5)
    expected = forecast.at(7)
    for array in (forecast.at(7), forecast.exact(7), *forecast.marginals(7), *forecast.moves(7)):
        array[...] = 5.0
    for same in (forecast, copy.deepcopy(forecast), pickle.loads(pickle.dumps(forecast))):
        np.testing.assert_array_equal(same.at(7), expected)
        assert same.exact(7).sum() == pytest.approx(1)
        assert max(chances.max() for chances in same.moves(7)) <= 1


def test_memory_is_bounded_over_thousands_of_steps() -> None:
    """Cached tables of all forecasts together stay within a limit."""
    tracemalloc.start()
    try:
        forecast = ProbabilityMatrix(64, (4, 4), (0.1, 0.2), 5)
        for t in range(4000):  # 62 MiB of matrices
            forecast.at(t)
        again = ProbabilityMatrix(64, (4, 4), (0.1, 0.2), 5)
        assert forecast.block(3) is again.block(3), "the earliest are kept"
        for start in range(10):
            other = ProbabilityMatrix(64, (start, 4), (0.1, 0.2), 5)
            for t in range(100):
                other.at(t)
        assert tracemalloc.get_traced_memory()[1] < 64 * 2**20
    finally:
        tracemalloc.stop()


def test_blocks_of_huge_grids_are_small() -> None:
    assert ProbabilityMatrix(1500, (0, 0), (0, 0), 1).block_steps == 1
    assert ProbabilityMatrix(300, (0, 0), (0, 0), 1).block_steps == 8
    assert ProbabilityMatrix(50, (0, 0), (0, 0), 1).block_steps == 32


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((1, (0, 0), (0, 0), 1), "grid_size must be an integer of at least 2, got 1"),
        ((5, (9, 9), (0, 0), 1), r"start must be a cell .* got \(9, 9\)"),
        ((5, (1, 1), (0, math.nan), 1), r"vector\[1\] must be a finite number, got nan"),
        (
            (5, (1, 1), (0, 0), -5),
            "disperse_constant must be a finite number of at least 0, got -5",
        ),
    ],
)
def test_bad_arguments(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ProbabilityMatrix(*arguments)


def test_steps_before_the_first() -> None:
    with pytest.raises(ValueError, match="step must be an integer of at least 0, got -1"):
        ProbabilityMatrix(5, (1, 1), (0, 0), 1).at(-1)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_process_can_be_forked_while_another_thread_makes_tables() -> None:
    held, forking = threading.Event(), threading.Event()

    def hold() -> None:
        with module._cache.lock:
            held.set()
            forking.wait(60)
            time.sleep(0.05)

    thread = threading.Thread(target=hold)
    thread.start()
    held.wait(60)
    forking.set()
    child = os.fork()
    if child == 0:  # pragma: no cover (in another process)
        signal.alarm(30)  # ends a child that hangs
        ProbabilityMatrix(8, (3, 2), (0.123, 0.456), 5).at(40)
        os._exit(0)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
    ProbabilityMatrix(8, (3, 2), (0.321, 0.456), 5).at(40)
