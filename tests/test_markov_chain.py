"""The person's Markov chain: forward agrees with the belief's drift, backward is its adjoint."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from small_searches import uncertain_persons

from DroneSwarmSearch.drift import Drift, ProbabilityMatrix
from DroneSwarmSearch.drift.belief import after_drift
from DroneSwarmSearch.drift.markov_chain import MarkovChain, transition_matrices


@st.composite
def forecasts(draw: st.DrawFn) -> ProbabilityMatrix:
    size = draw(st.integers(2, 7))
    return ProbabilityMatrix(size, draw(uncertain_persons(size)))


def one_hypothesis(size: int, cell: tuple[int, int], vector: tuple[float, float]) -> Any:
    return ProbabilityMatrix(size, Drift(cell, vector=vector, diffusion=0.33))


def random_grid(forecast: ProbabilityMatrix, seed: int, *axes: int) -> np.ndarray:
    shape = (*axes, len(forecast.weights), forecast.grid_size, forecast.grid_size)
    return np.random.default_rng(seed).random(shape)


@settings(deadline=None, max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(1, 6), st.integers(0, 99))
def test_forward_is_the_drift_of_a_belief(
    forecast: ProbabilityMatrix, first: int, steps: int, seed: int
) -> None:
    chain = MarkovChain(forecast)
    for step in range(first, first + steps):
        mass = random_grid(forecast, seed + step)
        after = chain.forward(mass, step)
        np.testing.assert_allclose(after, after_drift(mass, *forecast.moves(step)), atol=1e-13)
        assert after.sum() == pytest.approx(mass.sum(), rel=1e-12)
        assert (after >= 0).all()
        np.testing.assert_allclose(
            chain.forward(forecast.joint(step), step), forecast.joint(step + 1), atol=1e-13
        )


@settings(deadline=None, max_examples=50, derandomize=True)
@given(forecasts(), st.integers(0, 12), st.integers(0, 99))
def test_backward_is_the_adjoint_of_forward(
    forecast: ProbabilityMatrix, step: int, seed: int
) -> None:
    chain = MarkovChain(forecast)
    mass, value = random_grid(forecast, seed), random_grid(forecast, seed + 1)
    now = float(np.vdot(chain.backward(value, step), mass))
    assert now == pytest.approx(float(np.vdot(value, chain.forward(mass, step))), rel=1e-12)
    np.testing.assert_allclose(chain.backward(np.ones_like(mass), step), 1.0, rtol=1e-12)


def test_backward_in_a_corner_is_the_mean_over_the_moves_there() -> None:
    forecast = one_hypothesis(4, (0, 3), (0.4, 0.1))
    right, left, down, up = (chances[0] for chances in forecast.moves(2))
    value = random_grid(forecast, 3)
    expected = 0.0
    for dx, along_x in ((0, 1 - right[0] - left[0]), (1, right[0])):
        for dy, along_y in ((0, 1 - down[3] - up[3]), (-1, up[3])):
            expected += along_x * along_y * value[0, 3 + dy, dx]
    before = MarkovChain(forecast).backward(value, 2)
    assert before[0, 3, 0] == pytest.approx(expected, rel=1e-12)
    assert 0.0 < right[0] < 1.0
    assert 0.0 < up[3] < 1.0


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
def test_steps_may_be_taken_in_any_order_and_from_copies(duplicate: Any) -> None:
    forecast = one_hypothesis(6, (2, 3), (0.3, -0.2))
    mass = random_grid(forecast, 4)
    chain, other = MarkovChain(forecast), MarkovChain(forecast)
    after = {step: chain.forward(mass, step) for step in (3, 33, 70, 71)}
    for step in (70, 3, 71, 33):
        assert np.array_equal(other.forward(mass, step), after[step])
        assert np.array_equal(duplicate(chain).forward(mass, step), after[step])


def test_leading_axes_are_batch_axes() -> None:
    forecast = one_hypothesis(5, (2, 3), (0.3, -0.2))
    chain, batch = MarkovChain(forecast), random_grid(forecast, 5, 2, 3)
    for direction in (chain.forward, chain.backward):
        together = direction(batch, 1)
        for i, j in np.ndindex(2, 3):
            np.testing.assert_allclose(together[i, j], direction(batch[i, j], 1), rtol=1e-13)


def test_transition_matrices_are_stochastic_and_tridiagonal() -> None:
    forecast = one_hypothesis(6, (2, 3), (0.3, -0.2))
    right, left, *_ = (
        np.array(chances)[:, 0] for chances in zip(*map(forecast.moves, range(4)), strict=True)
    )
    matrices = transition_matrices(right, left)
    np.testing.assert_allclose(matrices.sum(axis=2), 1.0, rtol=1e-12)
    i, j = np.indices((6, 6))
    assert not matrices[:, abs(i - j) > 1].any()
    assert np.array_equal(matrices[:, np.arange(5), np.arange(1, 6)], right[:, :-1])
    assert np.array_equal(matrices[:, np.arange(1, 6), np.arange(5)], left[:, 1:])
