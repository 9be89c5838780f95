"""The person's walk, for given uniforms and in distribution."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.person import moves, walk


def test_uniforms_select_right_left_or_stay() -> None:
    forecast = ProbabilityMatrix(9, (4, 4), (0.1, -0.1), 10)
    right, left, down, up = forecast.moves(0)
    eps = 1e-9
    to_right, to_left, stay = right[4] - eps, right[4] + left[4] - eps, right[4] + left[4] + eps
    for u, x in ((0.0, 5), (to_right, 5), (right[4] + eps, 3), (to_left, 3), (stay, 4), (0.999, 4)):
        assert walk(forecast, 0, 4 * 9 + 4, [u], [0.9999]) == [4 * 9 + x]
    for v, y in ((0.0, 5), (down[4] + eps, 3), (down[4] + up[4] + eps, 4)):
        assert walk(forecast, 0, 4 * 9 + 4, [0.9999], [v]) == [y * 9 + 4]


def test_a_walk_can_be_computed_in_pieces() -> None:
    forecast = ProbabilityMatrix(20, (10, 10), (0.3, 0.2), 10)
    numbers = np.random.default_rng(5)
    for_x, for_y = numbers.random((2, 32)).tolist()
    whole = walk(forecast, 0, 210, for_x, for_y)
    first = walk(forecast, 0, 210, for_x[:8], for_y[:8])
    assert first + walk(forecast, 8, first[-1], for_x[8:], for_y[8:]) == whole
    assert len(walk(forecast, 24, 210, for_x, for_y)) == 8, "a walk ends with the block of tables"


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
def test_walks_are_distributed_as_the_matrix(
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
        assert not counts[expected == 0].any(), "a person is in a cell of probability 0"
        common = expected >= 5
        groups = np.append(counts[common], counts[~common].sum())
        means = np.append(expected[common], expected[~common].sum())
        groups, means = groups[means > 0.5], means[means > 0.5]
        statistic = ((groups - means) ** 2 / means).sum()
        freedom = max(len(groups) - 1, 1)
        # Four standard deviations of a chi-square of that freedom, by Wilson and Hilferty.
        limit = freedom * (1 - 2 / (9 * freedom) + 4 * (2 / (9 * freedom)) ** 0.5) ** 3
        assert statistic < limit, (t, statistic, freedom)


def test_several_persons_move_like_one() -> None:
    forecast = ProbabilityMatrix(9, (4, 4), (0.3, -0.2), 10)
    rng = np.random.default_rng(1)
    cells = rng.integers(0, 81, 500)
    y, x = np.divmod(cells, 9)
    u, v = rng.random((2, 500))
    right, left, down, up = forecast.moves(3)
    y, x = y + moves(v, down[y], down[y] + up[y]), x + moves(u, right[x], right[x] + left[x])
    for person, cell in enumerate(cells.tolist()):
        after = walk(forecast, 3, cell, [u[person]], [v[person]])
        assert after == [9 * y[person] + x[person]]
