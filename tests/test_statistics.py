"""The statistics of evaluations against textbooks, exact distributions and plain sums."""

import math

import numpy as np
import pytest

from DroneSwarmSearch.evaluation import Estimate, bounded_mean, mean_of, stratified_mean
from DroneSwarmSearch.evaluation.episodes import Reliability


def test_limits_solve_halls_equation():
    """His transformation of Student's statistic has the quantiles of the normal distribution."""
    sample = np.random.default_rng(2).exponential(size=80) / 50
    mean = sample.mean()
    n = len(sample)
    deviation = sample.std(ddof=1)
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
    trials = 1000
    exponential = np.random.default_rng(n).exponential(size=(n, trials))
    samples = np.minimum(exponential**2 / 1000, 1.0).T
    limits = np.array([bounded_mean(sample) for sample in samples])
    too_high = (limits[:, 1] > 0.002).mean()
    too_low = (limits[:, 2] < 0.002).mean()
    assert too_high < 0.05
    assert too_low < 0.025 + 3.0 / n + 0.03
    assert 1.0 - too_high - too_low > 0.9


def test_equal_values_leave_room_for_others():
    """In the share of trials that Wilson's interval for 0 of n holds."""
    share = 0.1611  # R. Newcombe, Statistics in Medicine 17, 1998, table I, method 3
    for value in (0.0, 0.3, 1.0):
        expected = value, value * (1 - share), value + (1 - value) * share
        assert bounded_mean([value] * 20) == pytest.approx(expected, abs=5e-5)
    assert bounded_mean([2.0] * 20, -10, 10) == pytest.approx(
        (2.0, 2.0 - 12 * share, 2.0 + 8 * share), abs=1e-3
    )
    assert bounded_mean([0.3]).high > 0.8


def test_the_mean_of_estimates_adds_their_errors_in_squares():
    got = mean_of([Estimate(0.5, 0.2, 0.9), Estimate(0.7, 0.3, 1.0)])
    assert got == pytest.approx((0.6, 0.6 - 0.25, 0.6 + 0.25))
    assert mean_of([Estimate(0.5, 0.2, 0.9)]) == pytest.approx((0.5, 0.2, 0.9))


def test_the_expected_calibration_error_by_hand():
    searches = np.array([2.0, 2.0])
    forecast = np.array([0.5, 1.25])
    found = np.array([1.0, 1.0])
    # Half of the forecasts are 1/4 too low on average, the other half 1/8 too high.
    error = Reliability(searches, forecast, found).expected_error
    assert error == pytest.approx((0.25 + 0.125) / 2)


def test_stratified_means_cover_the_mean_over_given_strata():
    """Strata differ much more than their values; 95% of the intervals hold the mean."""
    rng = np.random.default_rng(0)
    middles = rng.uniform(0.1, 0.9, 50)
    held = []
    widths = []
    for _ in range(400):
        value, low, high = stratified_mean(rng.normal(middles, 0.05, (4, 50)).ravel(), 50)
        held.append(low <= middles.mean() <= high)
        widths.append(high - low)
        assert low < value < high
    assert 0.92 < np.mean(held) < 0.98
    assert np.mean(widths) == pytest.approx(2 * 1.96 * 0.05 / math.sqrt(200), rel=0.03)


def test_estimates_are_printed_with_three_decimals():
    assert str(Estimate(0.61273824, 0.60812, 0.61571)) == "0.613 (0.608 to 0.616)"
    assert str(Estimate.exact(0.61273824)) == "0.613"
