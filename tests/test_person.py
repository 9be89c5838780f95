"""The person's walk, for given uniforms and in distribution."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import Drift, Person, ProbabilityMatrix
from DroneSwarmSearch.drift.person import Starts, moves, start, walk


def test_uniforms_select_right_left_or_stay() -> None:
    forecast = ProbabilityMatrix(9, Drift((4, 4), vector=(0.1, -0.1), diffusion=4 / 9))
    right, left, down, up = (chances[0] for chances in forecast.moves(0))
    eps = 1e-9
    to_right, to_left, stay = right[4] - eps, right[4] + left[4] - eps, right[4] + left[4] + eps
    for u, x in ((0.0, 5), (to_right, 5), (right[4] + eps, 3), (to_left, 3), (stay, 4), (0.999, 4)):
        assert walk(forecast, 0, 0, 4 * 9 + 4, [u], [0.9999]) == [4 * 9 + x]
    for v, y in ((0.0, 5), (down[4] + eps, 3), (down[4] + up[4] + eps, 4)):
        assert walk(forecast, 0, 0, 4 * 9 + 4, [0.9999], [v]) == [y * 9 + 4]


def test_a_walk_can_be_computed_in_pieces() -> None:
    forecast = ProbabilityMatrix(20, Drift((10, 10), vector=(0.3, 0.2), diffusion=4 / 9))
    numbers = np.random.default_rng(5)
    for_x, for_y = numbers.random((2, 32)).tolist()
    whole = walk(forecast, 0, 0, 210, for_x, for_y)
    first = walk(forecast, 0, 0, 210, for_x[:8], for_y[:8])
    assert first + walk(forecast, 0, 8, first[-1], for_x[8:], for_y[8:]) == whole
    assert len(walk(forecast, 0, 24, 210, for_x, for_y)) == 8, (
        "a walk ends with the block of tables"
    )


def known(start: tuple[int, int], vector: tuple[float, float], diffusion: float) -> Person:
    return Person(Drift(start, vector=vector, diffusion=diffusion))


@pytest.mark.parametrize(
    "person",
    [
        known((10, 10), (0, 0), 0.4),
        known((10, 10), (0.5, 0.5), 0.25),
        known((10, 10), (0.3, -0.2), 0.64),
        known((2, 3), (1, 1), 0.06),
        known((10, 10), (3.5, -0.5), 0.4),
        known((0, 0), (-0.5, -0.5), 0.4),
        known((19, 0), (0.4, -3), 0.11),
        known((5, 5), (0, 0), 0),
        known((0, 5), (0.5, 0.25), 0),
        Person(Drift((25.5, 4), start_sd=3, vector=(-0.3, 0.1), vector_sd=0.05, adrift=5)),
        Person(
            [
                Drift((4, 4), start_sd=(1, 0), vector=(0.2, 0.2), diffusion=0.05, weight=3),
                Drift(np.eye(20)[::-1], vector=(0.1, 0), vector_sd=0.02, diffusion=0.3),
            ]
        ),
    ],
)
def test_walks_are_distributed_as_the_matrix(person: Person) -> None:
    """Pearson's chi-square over the cells that hold enough, at four steps of 4,000 walks."""
    size, walks = 20, 4000
    forecast = ProbabilityMatrix(size, person)
    rng = np.random.default_rng(20)
    paths = []
    for draw, *draws in zip(rng.random(walks), *rng.random((2, walks, 32)).tolist(), strict=True):
        hypothesis, cell = start(forecast, draw)
        paths.append([cell, *walk(forecast, hypothesis, 0, cell, *draws)])
    cells = np.array(paths)
    for t in (0, 1, 7, 31):
        counts = np.bincount(cells[:, t], minlength=size**2)
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
    forecast = ProbabilityMatrix(9, Drift((4, 4), vector=(0.3, -0.2), diffusion=4 / 9))
    rng = np.random.default_rng(1)
    cells = rng.integers(0, 81, 500)
    y, x = np.divmod(cells, 9)
    u, v = rng.random((2, 500))
    right, left, down, up = (chances[0] for chances in forecast.moves(3))
    y, x = y + moves(v, down[y], down[y] + up[y]), x + moves(u, right[x], right[x] + left[x])
    for person, cell in enumerate(cells.tolist()):
        after = walk(forecast, 0, 3, cell, [u[person]], [v[person]])
        assert after == [9 * y[person] + x[person]]


def test_the_starts_of_several_persons_are_drawn_like_one() -> None:
    persons = [
        Person([Drift((1, 1), weight=0.4), Drift((2, 2), start_sd=1)]),
        Person(Drift(np.eye(5))),
        Person(Drift((3, 3))),
    ]
    forecasts = [ProbabilityMatrix(5, person) for person in persons]
    drawn_starts = Starts(forecasts)
    draws = np.append(np.random.default_rng(3).random(200), [0.0, 1 - 2**-53])
    for number, forecast in enumerate(forecasts):
        drawn = drawn_starts(np.full(len(draws), number), draws)
        assert [divmod(index, 25) for index in drawn.tolist()] == [
            start(forecast, draw) for draw in draws.tolist()
        ]
    numbers = np.arange(3)[:, None].repeat(4, axis=1)
    together = drawn_starts(numbers, draws[:12].reshape(3, 4))
    assert together[1].tolist() == drawn_starts(numbers[1], draws[4:8]).tolist()
    assert start(forecasts[2], 0.5) == (0, forecasts[2].known_start)
