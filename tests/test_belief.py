"""Bayes' rule and the drift of a belief, against oracles and the forecast."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import Drift, Person, ProbabilityMatrix
from DroneSwarmSearch.drift.belief import (
    after_drift,
    after_search,
    after_unsuccessful_search,
    mean_over_missing,
    means_over_missing,
    normalise,
    over_hypotheses,
    shown_persons,
)
from DroneSwarmSearch.drift.posteriors import Posteriors


def test_oracle_of_two_cells() -> None:
    belief, kept = after_unsuccessful_search(np.array([[[0.6, 0.4]]]), [0], 0.8)
    np.testing.assert_allclose(belief, [[[0.230769, 0.769231]]], atol=1e-6)
    assert kept == pytest.approx(0.52)


def test_repeated_searches_in_any_order() -> None:
    prior = np.array([[[0.1, 0.2], [0.3, 0.4]]])
    searches = [0, 3, 3, 1, 3]
    expected = prior * 0.3 ** np.array([[1, 1], [0, 3]])
    for order in (searches, searches[::-1]):
        belief, chance = prior, 1.0
        for cell in order:
            belief, kept = after_unsuccessful_search(belief, [cell], 0.7)
            chance *= kept
        np.testing.assert_allclose(belief, expected / expected.sum())
        assert chance == pytest.approx(expected.sum())
    together, kept = after_unsuccessful_search(prior, searches, 0.7)
    np.testing.assert_allclose(together, expected / expected.sum())
    assert kept == pytest.approx(expected.sum())


def test_detection_probabilities_of_0_and_1() -> None:
    prior = np.array([[[0.1, 0.2], [0.3, 0.4]]])
    belief, kept = after_unsuccessful_search(prior, [2, 3], 0.0)
    np.testing.assert_array_equal(belief, prior)
    assert kept == 1.0
    belief, kept = after_unsuccessful_search(prior, [2, 3], 1.0)
    assert belief[0, 1, 0] == belief[0, 1, 1] == 0.0
    assert kept == pytest.approx(0.3)


def test_a_search_that_contradicts_the_belief_does_not_change_it() -> None:
    prior = np.array([[[0.0, 1.0]]])
    belief, kept = after_unsuccessful_search(prior, [1], 1.0)
    np.testing.assert_array_equal(belief, prior)
    assert kept == 0.0


def test_weights_of_two_hypotheses_far_apart_follow_bayes_rule() -> None:
    person = Person([Drift((2, 2), weight=0.7), Drift((12, 12), weight=0.3)], 0.8)
    belief, missed = after_unsuccessful_search(ProbabilityMatrix(15, person).joint(5), [32], 0.8)
    assert missed == pytest.approx(0.7 * 0.2 + 0.3)
    left = np.array([0.7 * 0.2, 0.3])
    np.testing.assert_allclose(belief.sum(axis=(1, 2)), left / left.sum())


@pytest.mark.parametrize("vector", [(0, 0), (0.5, 0.5), (0.3, -0.2), (3.5, -0.5)])
@pytest.mark.parametrize("diffusion", [0, 0.11, 0.44, 2 / 3])
def test_belief_without_searches_is_the_forecast(
    vector: tuple[float, float], diffusion: float
) -> None:
    forecast = ProbabilityMatrix(15, Drift((2, 11), vector=vector, diffusion=diffusion))
    belief = forecast.joint(0)
    for t in range(80):
        belief = after_drift(belief, *forecast.moves(t))
        np.testing.assert_allclose(belief, forecast.joint(t + 1), atol=1e-13)


def mixture(velocity: float) -> Person:
    """Two hypotheses, one with an uncertain start."""
    return Person(
        [
            Drift((4, 4), vector=(velocity, 0.1), diffusion=0.3),
            Drift((5, 3), start_sd=1, vector=(0.1, velocity), vector_sd=0.1, weight=2),
        ],
        0.6,
    )


def test_drift_of_batches() -> None:
    forecasts = [ProbabilityMatrix(9, mixture(velocity)) for velocity in (-0.4, 0.0, 0.9)]
    t = 6
    batch = after_drift(
        np.stack([forecast.joint(t) for forecast in forecasts], axis=-1),
        *(
            np.stack(tables, axis=-1)
            for tables in zip(*(forecast.moves(t) for forecast in forecasts), strict=True)
        ),
    )
    for k, forecast in enumerate(forecasts):
        np.testing.assert_allclose(batch[..., k], forecast.joint(t + 1), atol=1e-14)
        alone = after_drift(forecast.joint(t), *forecast.moves(t))
        np.testing.assert_array_equal(batch[..., k], alone)


def test_posteriors_of_a_search_equal_the_functions_above() -> None:
    """Also to the last bit, and the probability of success is that of the kept fractions."""
    persons = mixture(0.2), Person(Drift(np.eye(9), vector=(0.3, 0), diffusion=0.2), 1.0)
    forecasts = [ProbabilityMatrix(9, person) for person in persons]
    detections = [person.probability_of_detection for person in persons]
    posteriors = Posteriors(forecasts, detections)
    beliefs, kept = [forecast.joint(3) for forecast in forecasts], np.ones(2)
    posteriors.start(3)
    rng = np.random.default_rng(4)
    for t in range(3, 40):
        cells = rng.choice(81, 3, replace=False).tolist()
        added = posteriors.added_success(cells)
        before = posteriors.probability_of_success()
        if t % 3:
            posteriors.search(cells)
            assert posteriors.probability_of_success() == pytest.approx(before + sum(added))
            for k, detection in enumerate(detections):
                beliefs[k], missed = after_unsuccessful_search(beliefs[k], cells, detection)
                kept[k] *= missed
        posteriors.drift(t)
        beliefs = [
            after_drift(belief, *forecast.moves(t))
            for belief, forecast in zip(beliefs, forecasts, strict=True)
        ]
        cells_of = [over_hypotheses(belief) for belief in beliefs]
        for missing in ((0, 1), (1,), ()):
            expected = mean_over_missing(cells_of, missing).astype(np.float32)
            np.testing.assert_array_equal(posteriors.matrix(missing), expected)
            shown = [float(expected.flat[cell]) for cell in cells]
            assert posteriors.probabilities(cells, missing) == shown
        assert posteriors.probability_of_success() == 1 - kept.mean()
        for shares, belief in zip(posteriors.weights(), beliefs, strict=True):
            np.testing.assert_allclose(shares, belief.sum(axis=(1, 2)))


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


def test_searches_without_normalising_agree_with_bayes_rule() -> None:
    mass = np.array([[[0.1, 0.2], [0.3, 0.4]]])
    before = mass.copy()
    left, found = after_search(mass, [3, 1], 0.7)
    belief, kept = after_unsuccessful_search(mass, [3, 1], 0.7)
    assert found == pytest.approx(0.7 * 0.6) == 1 - kept
    np.testing.assert_allclose(left / left.sum(), belief)
    assert after_search(mass, [], 0.7)[1] == 0.0
    np.testing.assert_array_equal(mass, before)


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
