"""The person's random walk, for given draws and in distribution."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.person import moves, walk


def test_draws_choose_right_left_and_stay() -> None:
    forecast = ProbabilityMatrix(9, (4, 4), (0.1, -0.1), 10)
    right, left, down, up = forecast.moves(0)
    eps = 1e-9
    to_right, to_left, stay = right[4] - eps, right[4] + left[4] - eps, right[4] + left[4] + eps
    for u, x in ((0.0, 5), (to_right, 5), (right[4] + eps, 3), (to_left, 3), (stay, 4), (0.999, 4)):
        assert walk(forecast, 0, 4 * 9 + 4, [u], [0.9999]) == [4 * 9 + x]
    for v, y in ((0.0, 5), (down[4] + eps, 3), (down[4] + up[4] + eps, 4)):
        assert walk(forecast, 0, 4 * 9 + 4, [0.9999], [v]) == [y * 9 + 4]


def test_a_walk_in_pieces_is_the_walk() -> None:
    forecast = ProbabilityMatrix(20, (10, 10), (0.3, 0.2), 10)
    numbers = np.random.default_rng(5)
    for_x, for_y = numbers.random((2, 32)).tolist()
    whole = walk(forecast, 0, 210, for_x, for_y)
    first = walk(forecast, 0, 210, for_x[:8], for_y[:8])
    assert first + walk(forecast, 8, first[-1], for_x[8:], for_y[8:]) == whole
    assert len(walk(forecast, 24, 210, for_x, for_y)) == 8, "a walk ends with the block of tables"


def test_many_persons_move_as_one_does() -> None:
    """Probabilities and draws may both be multiplied by 2**53, with integer draws."""
    size, persons = 9, 2000
    forecast = ProbabilityMatrix(size, (4, 4), (0.1, -0.3), 10)
    rng = np.random.default_rng(1)
    draws = np.floor(rng.random((2, persons)) * 2**53) / 2**53
    x, y = rng.integers(0, size, (2, persons))
    right, left, down, up = forecast.moves(3)
    for scale, kind in ((1.0, np.float64), (2.0**53, np.int64)):
        u, v = (draws * scale).astype(kind)
        ahead_x = x + moves(u, right[x] * scale, (right + left)[x] * scale)
        ahead_y = y + moves(v, down[y] * scale, (down + up)[y] * scale)
        one_by_one = [
            walk(forecast, 3, cell, [u], [v])[0]
            for cell, u, v in zip((y * size + x).tolist(), *draws.tolist(), strict=True)
        ]
        assert (ahead_y * size + ahead_x).tolist() == one_by_one


@pytest.mark.parametrize(
    ("start", "drift", "constant"),
    [
        ((10, 10), (0, 0), 10),
        ((10, 10), (0.5, 0.5), 3),
        ((10, 10), (0.3, -0.2), 100),
        ((2, 3), (1, 1), 0.5),
        ((10, 10), (3.5, -0.5), 10),
        ((0, 0), (-0.5, -0.5), 10),
        ((19, 0), (0.4, -3), 1),
        ((5, 5), (0, 0), 0),
        ((0, 5), (0.5, 0.25), 0),
    ],
)
def test_persons_are_where_the_matrix_says(
    start: tuple[int, int], drift: tuple[float, float], constant: float
) -> None:
    """Pearson's chi-square over the cells that hold enough, at three steps of 4,000 walks."""
    size, walks = 20, 4000
    forecast = ProbabilityMatrix(size, start, drift, constant)
    numbers = np.random.default_rng(20).random((walks, 2, 32)).tolist()
    paths = np.array([walk(forecast, 0, start[1] * size + start[0], *pair) for pair in numbers])
    for t in (1, 7, 31):
        counts = np.bincount(paths[:, t - 1], minlength=size**2)
        expected = walks * forecast.exact(t).ravel()
        assert not counts[expected == 0].any(), "a person stands where the matrix says nobody can"
        common = expected >= 5
        groups = np.append(counts[common], counts[~common].sum())
        means = np.append(expected[common], expected[~common].sum())
        groups, means = groups[means > 0.5], means[means > 0.5]
        statistic = ((groups - means) ** 2 / means).sum()
        freedom = max(len(groups) - 1, 1)
        # Four standard deviations of a chi-square of that freedom, by Wilson and Hilferty.
        limit = freedom * (1 - 2 / (9 * freedom) + 4 * (2 / (9 * freedom)) ** 0.5) ** 3
        assert statistic < limit, (t, statistic, freedom)
