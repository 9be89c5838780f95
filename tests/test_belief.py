"""Bayes' rule and the drift of a belief, against oracles and the forecast."""

from __future__ import annotations

import numpy as np
import pytest

from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.belief import (
    after_drift,
    after_search,
    after_unsuccessful_search,
    mean_over_missing,
    means_over_missing,
    normalise,
    shown_persons,
)


def test_oracle_of_two_cells() -> None:
    belief, kept = after_unsuccessful_search(np.array([[0.6, 0.4]]), [0], 0.8)
    np.testing.assert_allclose(belief, [[0.230769, 0.769231]], atol=1e-6)
    assert kept == pytest.approx(0.52)


def test_repeated_searches_in_any_order() -> None:
    prior = np.array([[0.1, 0.2], [0.3, 0.4]])
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
    prior = np.array([[0.1, 0.2], [0.3, 0.4]])
    belief, kept = after_unsuccessful_search(prior, [2, 3], 0.0)
    np.testing.assert_array_equal(belief, prior)
    assert kept == 1.0
    belief, kept = after_unsuccessful_search(prior, [2, 3], 1.0)
    assert belief[1, 0] == belief[1, 1] == 0.0
    assert kept == pytest.approx(0.3)


def test_a_search_that_contradicts_the_belief_does_not_change_it() -> None:
    prior = np.array([[0.0, 1.0]])
    belief, kept = after_unsuccessful_search(prior, [1], 1.0)
    np.testing.assert_array_equal(belief, prior)
    assert kept == 0.0


@pytest.mark.parametrize("drift", [(0, 0), (0.5, 0.5), (0.3, -0.2), (3.5, -0.5)])
@pytest.mark.parametrize("constant", [0, 1, 10, 100])
def test_belief_without_searches_is_the_forecast(
    drift: tuple[float, float], constant: float
) -> None:
    forecast = ProbabilityMatrix(15, (2, 11), drift, constant)
    belief = forecast.exact(0)
    for t in range(80):
        belief = after_drift(belief, *forecast.moves(t))
        np.testing.assert_allclose(belief, forecast.exact(t + 1), atol=1e-13)


def test_drift_of_batches() -> None:
    forecasts = [ProbabilityMatrix(9, (4, 4), (drift, 0.1), 5) for drift in (-0.4, 0.0, 0.9)]
    t = 6
    batch = after_drift(
        np.stack([forecast.exact(t) for forecast in forecasts], axis=-1),
        *(
            np.stack(tables, axis=-1)
            for tables in zip(*(forecast.moves(t) for forecast in forecasts), strict=True)
        ),
    )
    for k, forecast in enumerate(forecasts):
        np.testing.assert_allclose(batch[..., k], forecast.exact(t + 1), atol=1e-14)
        alone = after_drift(forecast.exact(t), *forecast.moves(t))
        np.testing.assert_array_equal(batch[..., k], alone)


@pytest.mark.parametrize("size", [2, 3, 9, 50])
@pytest.mark.parametrize("batch", [(1,), (2,), (3, 5)])
def test_normalising_a_batch_equals_normalising_each_belief(size: int, batch: tuple) -> None:
    beliefs = np.random.default_rng(size).random((size, size, *batch))
    beliefs[..., 0] *= 0.0
    rows = np.moveaxis(beliefs.reshape(size, size, -1), -1, 0).copy()
    totals = normalise(beliefs).reshape(-1)
    for k, alone in enumerate(rows):
        assert totals[k] == normalise(alone)
        np.testing.assert_array_equal(beliefs.reshape(size, size, -1)[..., k], alone)
        assert alone.sum() == pytest.approx(float(totals[k] > 0))


def test_searches_without_normalising_agree_with_bayes_rule() -> None:
    mass = np.array([[0.1, 0.2], [0.3, 0.4]])
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
