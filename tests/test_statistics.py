"""The statistics of evaluations against textbooks, exact distributions and plain sums."""

from __future__ import annotations

import math

import numpy as np
import pytest

from DroneSwarmSearch.evaluation.episodes import Reliability
from DroneSwarmSearch.evaluation.statistics import (
    RESAMPLES,
    Estimate,
    bootstrap_mean,
    bounded_mean,
    bounded_means,
    mean_of,
    wilson,
)

# R. Newcombe, Two-sided confidence intervals for the single proportion, Statistics in
# Medicine 17, 1998, table I, method 3.
NEWCOMBE = [
    (81, 263, 0.2553, 0.3662),
    (15, 148, 0.0624, 0.1605),
    (0, 20, 0.0000, 0.1611),
    (1, 29, 0.0061, 0.1718),
]


@pytest.mark.parametrize(("successes", "trials", "low", "high"), NEWCOMBE)
def test_wilson_intervals_are_the_published_ones(successes, trials, low, high):
    got = wilson(successes, trials)
    assert got.value == pytest.approx(successes / trials)
    assert got.low == pytest.approx(low, abs=5e-5)
    assert got.high == pytest.approx(high, abs=5e-5)


def test_wilson_interval_solves_the_score_equation():
    """Its ends are the shares from which the observed one is z standard errors away."""
    for successes, trials in ((1, 3), (7, 10), (1999, 2000)):
        got = wilson(successes, trials)
        for end in (float(got.low), float(got.high)):
            error = math.sqrt(end * (1 - end) / trials)
            assert abs(float(got.value) - end) / error == pytest.approx(1.959964, abs=1e-6)


def test_wilson_is_exact_at_0_and_1_and_takes_arrays():
    got = wilson(np.array([[0, 5], [2, 5]]), 5)
    assert got.low[0, 0] == 0.0
    assert got.high[0, 1] == got.high[1, 1] == 1.0
    assert got.at((1, 0)) == Estimate(0.4, float(got.low[1, 0]), float(got.high[1, 0]))


def test_wilson_is_symmetric():
    few, many = wilson(3, 40), wilson(37, 40)
    assert few.low == pytest.approx(1 - many.high, abs=1e-15)
    assert few.high == pytest.approx(1 - many.low, abs=1e-15)


@pytest.mark.parametrize(
    ("successes", "trials", "error", "message"),
    [
        (1, 0, ValueError, "trials must be an integer of at least 1, got 0"),
        (1, 2.0, TypeError, "trials must be an integer"),
        (3, 2, ValueError, "successes must be from 0 to trials, 2, got 3"),
        (-1, 2, ValueError, "successes must be from 0 to trials, 2, got -1"),
    ],
)
def test_wilson_refuses_wrong_counts(successes, trials, error, message):
    with pytest.raises(error, match=message):
        wilson(successes, trials)


def test_bootstrap_of_two_values_is_binomial():
    """40 ones in 100: a resample's mean is binomial, whose quantiles are known."""
    sample = np.repeat([0.0, 1.0], [60, 40])
    got = bootstrap_mean(sample)
    chances = np.array([math.comb(100, k) * 0.4**k * 0.6 ** (100 - k) for k in range(101)])
    below = chances.cumsum()
    # The order statistics of 2,000 draws: a quantile may be off by as many steps as the
    # share of draws below it is, whose standard deviation is 0.0035.
    assert got.value == pytest.approx(0.4)
    for end, share in ((got.low, 0.025), (got.high, 0.975)):
        place = round(end * 100)
        assert below[place - 1] - 0.015 <= share <= below[place] + 0.015


def test_bootstrap_of_many_values_is_nearly_normal():
    """Efron and Tibshirani: the ideal standard error is the plug-in one, sd / sqrt(n)."""
    sample = np.sin(np.arange(2000.0)) + np.arange(2000) / 1000
    got = bootstrap_mean(sample)
    error = sample.std() / math.sqrt(len(sample))
    assert got.low == pytest.approx(got.value - 1.96 * error, abs=0.2 * error)
    assert got.high == pytest.approx(got.value + 1.96 * error, abs=0.2 * error)


def test_bootstrap_of_the_mouse_data():
    """Efron and Tibshirani, An Introduction to the Bootstrap, table 2.1: the treated mice."""
    mice = [94, 197, 16, 38, 99, 141, 23]
    got = bootstrap_mean(mice)
    assert got.value == pytest.approx(86.86, abs=0.005)
    error = 23.36  # the book's ideal bootstrap standard error, with infinitely many samples
    assert np.std(mice) / math.sqrt(7) == pytest.approx(error, abs=0.005)
    assert got.low == pytest.approx(86.86 - 1.96 * error, abs=0.25 * error)
    assert got.high == pytest.approx(86.86 + 1.96 * error, abs=0.25 * error)


def test_bootstrap_is_reproducible():
    sample = np.arange(50) % 7
    assert bootstrap_mean(sample) == bootstrap_mean(sample.copy())
    assert bootstrap_mean([3.5, 3.5, 3.5]) == (3.5, 3.5, 3.5)
    assert bootstrap_mean([2]) == (2.0, 2.0, 2.0)


def test_bootstrap_does_not_depend_on_its_portions(monkeypatch):
    sample = np.arange(30.0) ** 2
    whole = bootstrap_mean(sample)
    monkeypatch.setattr("DroneSwarmSearch.evaluation.statistics._AT_ONCE", 30 * 7)
    assert RESAMPLES % 7
    assert bootstrap_mean(sample) == whole


@pytest.mark.parametrize("sample", [[], [[1.0, 2.0]], 3.0])
def test_bootstrap_refuses_other_shapes(sample):
    with pytest.raises(ValueError, match=r"sample must have the shape \(n,\) with n >= 1, got"):
        bootstrap_mean(sample)


# Means of bounded quantities.


def test_bounded_means_without_skewness_have_nearly_normal_intervals():
    sample = np.repeat([0.2, 0.3, 0.4, 0.5], 50)
    got = bounded_mean(sample)
    error = sample.std(ddof=1) / math.sqrt(200)
    assert got == pytest.approx((0.35, 0.35 - 1.96 * error, 0.35 + 1.96 * error), rel=1e-4)
    assert not got.is_exact


def test_limits_solve_halls_equation():
    """His transformation of Student's statistic has the quantiles of the normal distribution."""
    sample = np.random.default_rng(2).exponential(size=80) / 50
    mean, n, deviation = sample.mean(), len(sample), sample.std(ddof=1)
    skewness = ((sample - mean) ** 3).mean() / deviation**3
    got = bounded_mean(sample)
    for end, quantile in ((got.low, 1.959964), (got.high, -1.959964)):
        w = (mean - end) / deviation
        transformed = w + skewness * w**2 / 3 + skewness**2 * w**3 / 27 + skewness / (6 * n)
        assert math.sqrt(n) * transformed == pytest.approx(quantile, abs=1e-6)
    assert got.high - mean > mean - got.low


@pytest.mark.parametrize("n", [50, 500])
def test_bounded_means_cover_skewed_probabilities(n):
    """Small probabilities of which most are nearly 0: the skewness of each is 5.2."""
    trials = 2000
    exponential = np.random.default_rng(n).exponential(size=(n, trials))
    band = bounded_means(np.minimum(exponential**2 / 1000, 1.0))
    too_high, too_low = (band.low > 0.002).mean(), (band.high < 0.002).mean()
    assert too_high < 0.05
    assert too_low < 0.025 + 3.0 / n + 0.03
    assert 1.0 - too_high - too_low > 0.9


def test_equal_values_leave_room_for_others():
    """In the share of trials that Wilson's interval for 0 of n holds."""
    share = wilson(0, 20).high
    for value in (0.0, 0.3, 1.0):
        expected = value, value * (1 - share), value + (1 - value) * share
        assert bounded_mean([value] * 20) == pytest.approx(expected)
    assert bounded_mean([2.0] * 20, -10, 10) == pytest.approx(
        (2.0, 2.0 - 12 * share, 2.0 + 8 * share)
    )
    assert bounded_mean([0.3]).high > 0.8


def test_bounded_means_are_those_of_each_column():
    samples = np.random.default_rng(5).random((50, 3)) ** 4
    samples[:, 1] = 0.25
    band = bounded_means(samples)
    for column in range(3):
        assert band.at(column) == pytest.approx(bounded_mean(samples[:, column]))
    assert (band.low >= 0.0).all()
    mirrored = bounded_means(1.0 - samples)
    assert mirrored.low == pytest.approx(1.0 - band.high)
    assert mirrored.high == pytest.approx(1.0 - band.low)


def test_bounded_means_refuse_other_values():
    with pytest.raises(ValueError, match=r"sample must have the shape \(n,\) with n >= 1"):
        bounded_mean([])
    with pytest.raises(ValueError, match=r"samples must have the shape \(n, k\) with n >= 1"):
        bounded_means([0.5])
    for wrong in ([0.5, 1.5], [-0.1, 0.0], [0.5, math.nan]):
        with pytest.raises(ValueError, match="samples must be from 0 to 1, got"):
            bounded_mean(wrong)
    assert bounded_mean([-3.0, 1.0], -3.0).value == -1.0


def test_the_mean_of_estimates_adds_their_errors_in_squares():
    got = mean_of([Estimate(0.5, 0.2, 0.9), Estimate(0.7, 0.3, 1.0)])
    assert got == pytest.approx((0.6, 0.6 - 0.25, 0.6 + 0.25))
    assert mean_of([Estimate(0.5, 0.2, 0.9)]) == pytest.approx((0.5, 0.2, 0.9))
    with pytest.raises(ValueError, match="estimates must be at least one, got none"):
        mean_of([])


def test_bins_include_their_lower_edge():
    table = Reliability.empty()
    forecasts = np.array([0.0, 0.000999, 0.001, 0.05, 0.4999, 0.5, 1.0, 2.5])
    table.count(forecasts, np.zeros(8, np.int64))
    assert table.searches.tolist() == [2, 1, 0, 0, 0, 0, 1, 0, 1, 3]


def test_reliability_by_hand():
    table = Reliability.empty()
    table.count(np.array([0.5, 0.75, 0.25]), np.array([1, 0, 0]))
    table.count(np.array([0.25]), np.array([1]))
    assert table.searches.tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 2, 2]
    assert table.mean_forecast[-2:].tolist() == [0.25, 0.625]
    assert table.share_found[-2:].tolist() == [0.5, 0.5]
    assert np.isnan(table.mean_forecast[:-2]).all()
    # Half of the forecasts are 1/4 too low on average, the other half 1/8 too high.
    assert table.expected_error == pytest.approx((0.25 + 0.125) / 2)


def test_tables_add_up():
    parts = []
    for k in range(3):
        parts.append(Reliability.empty())
        parts[-1].count(np.linspace(0, 1, 10 + k), np.arange(10 + k) % 2)
    whole = Reliability.total(parts)
    assert whole.searches.sum() == 33
    assert whole.found.sum() == sum(part.found.sum() for part in parts)
    assert whole.forecast.sum() == pytest.approx(33 / 2)
    assert Reliability.total([]).expected_error == 0.0
