"""The best path for given gains equals the best of all paths."""

from __future__ import annotations

from collections.abc import Iterator

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from DroneSwarmSearch.planning.paths import FORBIDDEN, best_path, values_to_go

Option = tuple[float, list[int], list[bool]]


def all_paths(
    gains: np.ndarray, at_end: np.ndarray, blocked: list[list[int]], start: int, step: int = 0
) -> Iterator[Option]:
    """All paths of a drone with their gains: staying first, then left, right, up, down."""
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
        for more, cells, searches in all_paths(gains, at_end, blocked, cell, step + 1):
            yield gained + more, [start, *cells], [gained > 0.0, *searches]


@st.composite
def boards(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, list[list[int]]]:
    """Gains, final values and blocked cells. Whole numbers make sums exact and ties frequent."""
    size, n = draw(st.integers(2, 3)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    gains = rng.integers(0, draw(st.integers(1, 9)) + 1, (n, size, size)).astype(float)
    end = draw(st.sampled_from(["anywhere", "one cell", "varied"]))
    at_end = np.zeros((size, size))
    if end == "one cell":
        at_end[...] = FORBIDDEN
        at_end.reshape(-1)[draw(st.integers(0, size**2 - 1))] = 0.0
    elif end == "varied":
        at_end = rng.integers(0, 5, (size, size)).astype(float)
    most = draw(st.integers(0, 3))
    blocked = [rng.integers(0, size**2, most).tolist() for _ in range(n)]
    return gains, at_end, blocked


@settings(deadline=None, max_examples=60, derandomize=True)
@given(boards())
def test_the_best_path_is_the_first_of_all_best_paths(
    board: tuple[np.ndarray, np.ndarray, list[list[int]]],
) -> None:
    gains, at_end, blocked = board
    values = values_to_go(gains, at_end, blocked)
    assert values.shape == (len(gains) + 1, *at_end.shape)
    assert np.array_equal(values[-1], at_end)
    for start, value in enumerate(values[0].reshape(-1)):
        options = [it for it in all_paths(gains, at_end, blocked, start) if it[0] > FORBIDDEN]
        if not options:
            assert value == FORBIDDEN
            continue
        gained, cells, searches = max(options, key=lambda it: it[0])  # the first of equals
        assert value == gained
        path = best_path(gains, values, start, blocked)
        assert path.cells.tolist() == cells
        assert path.searches.tolist() == searches


@settings(deadline=None, max_examples=20, derandomize=True)
@given(boards())
def test_values_do_not_depend_on_earlier_steps(
    board: tuple[np.ndarray, np.ndarray, list[list[int]]],
) -> None:
    gains, at_end, blocked = board
    values = values_to_go(gains, at_end, blocked)
    for step in range(len(gains)):
        assert np.array_equal(values[step:], values_to_go(gains[step:], at_end, blocked[step:]))


def test_real_gains_are_summed() -> None:
    rng = np.random.default_rng(1)
    gains, nothing = rng.random((5, 3, 3)), np.zeros((3, 3))
    values = values_to_go(gains, nothing)
    for start in range(9):
        most = max(it[0] for it in all_paths(gains, nothing, [[]] * 5, start))
        assert values[0].reshape(-1)[start] == pytest.approx(most, rel=1e-12)
        path = best_path(gains, values, start)
        flat = gains.reshape(5, -1)[np.arange(5), path.cells[:-1]]
        assert flat[path.searches].sum() == pytest.approx(most, rel=1e-12)


def test_a_drone_without_gains_idles() -> None:
    gains = np.zeros((4, 3, 3))
    path = best_path(gains, values_to_go(gains, gains[0]), 4)
    assert path.cells.tolist() == [4] * 5
    assert not path.searches.any()


def test_arguments_are_not_changed() -> None:
    rng = np.random.default_rng(2)
    arrays = rng.random((4, 3, 3)), rng.random((3, 3))
    before = [array.copy() for array in arrays]
    blocked = [[1, 4], [], [8], [0]]
    best_path(arrays[0], values_to_go(*arrays, blocked), 0, blocked)
    assert all(np.array_equal(*pair) for pair in zip(arrays, before, strict=True))
    assert blocked == [[1, 4], [], [8], [0]]
