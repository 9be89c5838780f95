"""A drift model's steps: of a distribution, forward and backward, and of a person."""

import copy
import pickle
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from small_searches import uncertain_persons

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.persons import Drift, Person


@st.composite
def forecasts(draw: st.DrawFn) -> ProbabilityMatrix:
    size = draw(st.integers(2, 7))
    return ProbabilityMatrix(size, draw(uncertain_persons(size)))


def one_hypothesis(size: int, cell: tuple[int, int], vector: tuple[float, float]) -> Any:
    return ProbabilityMatrix(size, Drift(cell, vector=vector, diffusion=0.33))


def random_grid(forecast: ProbabilityMatrix, seed: int, *axes: int) -> np.ndarray:
    shape = (*axes, len(forecast.weights), forecast.grid_size, forecast.grid_size)
    return np.random.default_rng(seed).random(shape)


@settings(max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(1, 6), st.integers(0, 99))
def test_forward_is_the_drift_of_a_belief(forecast, first, steps, seed):
    for step in range(first, first + steps):
        mass = random_grid(forecast, seed + step)
        after = forecast.forward(mass, step)
        np.testing.assert_allclose(after, forecast.drift(mass, step), atol=1e-13)
        assert after.sum() == pytest.approx(mass.sum(), rel=1e-12)
        assert (after >= 0).all()
        np.testing.assert_allclose(
            forecast.forward(forecast.joint(step), step), forecast.joint(step + 1), atol=1e-13
        )


@settings(max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(0, 99))
def test_backward_is_the_adjoint_of_forward(forecast, step, seed):
    mass = random_grid(forecast, seed)
    value = random_grid(forecast, seed + 1)
    now = float(np.vdot(forecast.backward(value, step), mass))
    assert now == pytest.approx(float(np.vdot(value, forecast.forward(mass, step))), rel=1e-12)
    np.testing.assert_allclose(forecast.backward(np.ones_like(mass), step), 1.0, rtol=1e-12)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_steps_may_be_taken_in_any_order_and_from_copies(duplicate):
    forecast, other = (one_hypothesis(6, (2, 3), (0.3, -0.2)) for _ in range(2))
    mass = random_grid(forecast, 4)
    after = {step: forecast.forward(mass, step) for step in (3, 33, 70, 71)}
    for step in (70, 3, 71, 33):
        assert np.array_equal(other.forward(mass, step), after[step])
        assert np.array_equal(duplicate(forecast).forward(mass, step), after[step])


def test_uniforms_select_right_left_or_stay():
    forecast = ProbabilityMatrix(9, Drift((4, 4), vector=(0.1, -0.1), diffusion=4 / 9))
    right, left, down, up = (chances[0] for chances in forecast.moves(0))
    eps = 1e-9
    to_right = right[4] - eps
    to_left = right[4] + left[4] - eps
    stay = right[4] + left[4] + eps
    for u, x in ((0.0, 5), (to_right, 5), (right[4] + eps, 3), (to_left, 3), (stay, 4), (0.999, 4)):
        assert forecast.walk(4 * 9 + 4, 0, [u], [0.9999]) == [4 * 9 + x]
    for v, y in ((0.0, 5), (down[4] + eps, 3), (down[4] + up[4] + eps, 4)):
        assert forecast.walk(4 * 9 + 4, 0, [0.9999], [v]) == [y * 9 + 4]


def known(start: tuple[int, int], vector: tuple[float, float], diffusion: float) -> Person:
    return Person(Drift(start, vector=vector, diffusion=diffusion))


@pytest.mark.parametrize(
    "person",
    [
        known((10, 10), (0.3, -0.2), 0.64),
        known((2, 3), (1, 1), 0.06),
        known((19, 0), (0.4, -3), 0.11),
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
def test_walks_are_distributed_as_the_matrix(person):
    """Pearson's chi-square over the cells that hold enough, at four steps of 4,000 walks."""
    size = 20
    walks = 4000
    forecast = ProbabilityMatrix(size, person.drift)
    rng = np.random.default_rng(20)
    paths = []
    for draw, *draws in zip(rng.random(walks), *rng.random((2, walks, 32)).tolist(), strict=True):
        state = forecast.start(draw)
        paths.append([state, *forecast.walk(state, 0, *draws)])
    cells = forecast.cells(np.array(paths))
    for t in (0, 1, 7, 31):
        counts = np.bincount(cells[:, t], minlength=size**2)
        expected = walks * forecast.exact(t).ravel()
        assert not counts[expected == 0].any(), "a person is in a cell of probability 0"
        common = expected >= 5
        groups = np.append(counts[common], counts[~common].sum())
        means = np.append(expected[common], expected[~common].sum())
        groups = groups[means > 0.5]
        means = means[means > 0.5]
        statistic = ((groups - means) ** 2 / means).sum()
        freedom = max(len(groups) - 1, 1)
        # Four standard deviations of a chi-square of that freedom, by Wilson and Hilferty.
        limit = freedom * (1 - 2 / (9 * freedom) + 4 * (2 / (9 * freedom)) ** 0.5) ** 3
        assert statistic < limit, (t, statistic, freedom)


def test_the_starts_of_several_persons_are_drawn_like_one():
    forecast = ProbabilityMatrix(5, Person([Drift((1, 1), weight=0.4), Drift(np.eye(5))]))
    draws = np.append(np.random.default_rng(3).random(200), [0.0, 1 - 2**-53])
    drawn = forecast.start(draws)
    assert drawn.tolist() == [forecast.start(draw) for draw in draws.tolist()]
    assert (forecast.joint(0).reshape(-1)[drawn] > 0).all()
    assert ProbabilityMatrix(5, Drift((3, 3))).start(0.5) == 18
