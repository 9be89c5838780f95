"""Bayes' rule and the drift of a belief, against oracles and the forecast."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import Drift, Person, ProbabilityMatrix
from DroneSwarmSearch.drift.belief import (
    Belief,
    mean_over_missing,
    means_over_missing,
    normalise,
    shown_persons,
)
from DroneSwarmSearch.drift.model import forecasts_of


def four_cells(detection: float) -> Belief:
    """A belief of .1, .2, .3 and .4 about the cells of a grid of 2 x 2."""
    prior = np.array([[0.1, 0.2], [0.3, 0.4]])
    forecast = ProbabilityMatrix(2, Drift(prior))
    return Belief(forecast, detection, forecast.joint(0))


def test_searches_in_any_order_follow_bayes_rule() -> None:
    prior = four_cells(0.7)
    expected = prior.mass * 0.3 ** np.array([[1, 1], [0, 3]])
    for order in ([0, 3, 3, 1, 3], [3, 1, 3, 3, 0]):
        belief = prior
        for cell in order:
            belief = belief.after_search([cell])
        np.testing.assert_allclose(belief.mass, expected / expected.sum())
        assert belief.kept == pytest.approx(expected.sum())
    np.testing.assert_array_equal(prior.mass, four_cells(0.7).mass)
    added = prior.added_success([0, 3])
    assert 1 - prior.after_search([0, 3]).kept == pytest.approx(added.sum())


def test_detection_probabilities_of_0_and_1() -> None:
    belief = four_cells(0.0).after_search([2, 3])
    np.testing.assert_allclose(belief.mass, four_cells(0.0).mass)
    assert belief.kept == pytest.approx(1)
    belief = four_cells(1.0).after_search([2, 3])
    assert belief.map()[1].tolist() == [0.0, 0.0]
    assert belief.kept == pytest.approx(0.3)


def test_a_search_that_contradicts_the_belief_does_not_change_it() -> None:
    forecast = ProbabilityMatrix(3, Drift((1, 0)))
    belief = Belief(forecast, 1.0, forecast.joint(0))
    after = belief.after_search([1])
    np.testing.assert_array_equal(after.mass, belief.mass)
    assert after.kept == 0.0


def test_weights_of_two_hypotheses_far_apart_follow_bayes_rule() -> None:
    person = Person([Drift((2, 2), weight=0.7), Drift((12, 12), weight=0.3)], 0.8)
    forecast = ProbabilityMatrix(15, person.drift)
    belief = Belief(forecast, 0.8, forecast.joint(5)).after_search([32])
    assert belief.kept == pytest.approx(0.7 * 0.2 + 0.3)
    left = np.array([0.7 * 0.2, 0.3])
    assert forecast.hypotheses(belief.mass) == pytest.approx(tuple(left / left.sum()))


@pytest.mark.parametrize("vector", [(0, 0), (0.5, 0.5), (0.3, -0.2), (3.5, -0.5)])
@pytest.mark.parametrize("diffusion", [0, 0.11, 0.44, 2 / 3])
def test_belief_without_searches_is_the_forecast(
    vector: tuple[float, float], diffusion: float
) -> None:
    forecast = ProbabilityMatrix(15, Drift((2, 11), vector=vector, diffusion=diffusion))
    belief = Belief(forecast, 1.0, forecast.joint(0))
    for t in range(80):
        belief = belief.after_drift(t)
        np.testing.assert_allclose(belief.mass, forecast.joint(t + 1), atol=1e-13)


def mixture(velocity: float) -> Person:
    """Two hypotheses, one with an uncertain start."""
    return Person(
        [
            Drift((4, 4), vector=(velocity, 0.1), diffusion=0.3),
            Drift((5, 3), start_sd=1, vector=(0.1, velocity), vector_sd=0.1, weight=2),
        ],
        0.6,
    )


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_drift_of_batches(kind: type) -> None:
    persons = [mixture(velocity) for velocity in (-0.4, 0.0, 0.9)]
    persons.append(Person([Drift((x, 4), diffusion=0.1) for x in (2, 4, 6)]))
    models = [ProbabilityMatrix(9, person.drift) for person in persons]
    forecasts, numbers = forecasts_of(models, last=7, keeps_matrices=False)
    forecasts.reach(7)
    joints = forecasts.joint(6 * len(models) + numbers)
    batch = np.ascontiguousarray(np.moveaxis(joints, 0, -1), kind)
    forecasts.drift(batch, 6 * len(models) + numbers)
    for model, after in zip(models, np.moveaxis(batch, -1, 0).reshape(-1, 3, 9, 9), strict=True):
        own, rest = np.split(after, [len(model.weights)])
        np.testing.assert_allclose(own, model.joint(7), atol=1e-14 if kind is np.float64 else 1e-7)
        assert not rest.any()
        if kind is np.float64:
            np.testing.assert_array_equal(own, model.drift(model.joint(6), 6))


@pytest.mark.parametrize("size", [2, 3, 9, 50])
@pytest.mark.parametrize("batch", [(1,), (2,), (3, 5)])
def test_normalising_a_batch_equals_normalising_each_belief(size: int, batch: tuple) -> None:
    beliefs = np.random.default_rng(size).random((2, size, size, *batch))
    beliefs[..., 0] *= 0.0
    rows = np.moveaxis(beliefs.reshape(2, size, size, -1), -1, 0).copy()
    totals = normalise(beliefs).reshape(-1)
    for k, alone in enumerate(rows):
        assert totals[k] == normalise(alone)
        np.testing.assert_array_equal(beliefs.reshape(2, size, size, -1)[..., k], alone)
        assert alone.sum() == pytest.approx(float(totals[k] > 0))


@pytest.mark.parametrize("missing", [(0, 1, 2), (0, 2), (1,), ()])
def test_the_mean_over_missing_persons_in_a_batch_equals_that_of_each_search(
    missing: tuple[int, ...],
) -> None:
    beliefs = list(np.random.default_rng(1).random((3, 5, 5)))
    one = mean_over_missing(beliefs, missing)
    np.testing.assert_allclose(one, np.mean([beliefs[k] for k in missing or range(3)], axis=0))
    is_missing = np.array([[person in missing] for person in range(3)])
    batch = means_over_missing(
        [b[..., None] for b in beliefs], shown_persons(is_missing)[:, None, None]
    )
    assert batch[..., 0].tobytes() == one.tobytes()
