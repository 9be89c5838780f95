"""Bayes' rule and the drift of a belief, against oracles and the forecast."""

import numpy as np
import pytest

from DroneSwarmSearch.drift import Belief, ProbabilityMatrix
from DroneSwarmSearch.persons import Drift


def four_cells(detection: float) -> Belief:
    """A belief of .1, .2, .3 and .4 about the cells of a grid of 2 x 2."""
    prior = np.array([[0.1, 0.2], [0.3, 0.4]])
    forecast = ProbabilityMatrix(2, Drift(prior))
    return Belief(forecast, detection, forecast.joint(0))


def test_searches_in_any_order_follow_bayes_rule():
    prior = four_cells(0.7)
    expected = prior.mass * 0.3 ** np.array([[1, 1], [0, 3]])
    for order in ([0, 3, 3, 1, 3], [3, 1, 3, 3, 0]):
        belief = prior
        for cell in order:
            belief = belief.after_search([cell])
        np.testing.assert_allclose(belief.mass, expected / expected.sum())
        assert belief.failure == pytest.approx(expected.sum())
    np.testing.assert_array_equal(prior.mass, four_cells(0.7).mass)
    added = prior.added_success([0, 3])
    assert 1 - prior.after_search([0, 3]).failure == pytest.approx(added.sum())


def test_detection_probabilities_of_0_and_1():
    belief = four_cells(0.0).after_search([2, 3])
    np.testing.assert_allclose(belief.mass, four_cells(0.0).mass)
    assert belief.failure == pytest.approx(1)
    belief = four_cells(1.0).after_search([2, 3])
    assert belief.map()[1].tolist() == [0.0, 0.0]
    assert belief.failure == pytest.approx(0.3)


def test_a_search_that_contradicts_the_belief_does_not_change_it():
    forecast = ProbabilityMatrix(3, Drift((1, 0)))
    belief = Belief(forecast, 1.0, forecast.joint(0))
    after = belief.after_search([1])
    np.testing.assert_array_equal(after.mass, belief.mass)
    assert after.failure == 0.0


@pytest.mark.parametrize("vector", [(0, 0), (0.5, 0.5), (0.3, -0.2), (3.5, -0.5)])
@pytest.mark.parametrize("diffusion", [0, 0.11, 0.44, 2 / 3])
def test_belief_without_searches_is_the_forecast(vector, diffusion):
    forecast = ProbabilityMatrix(15, Drift((2, 11), vector=vector, diffusion=diffusion))
    belief = Belief(forecast, 1.0, forecast.joint(0))
    for t in range(80):
        belief = belief.after_drift(t)
        np.testing.assert_allclose(belief.mass, forecast.joint(t + 1), atol=1e-13)
