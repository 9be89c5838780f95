"""The statistics of evaluations against textbooks, exact distributions and plain sums."""

from __future__ import annotations

import math

import numpy as np
import pytest

from DroneSwarmSearch.evaluation.statistics import (
    CHANCE_EDGES,
    RESAMPLES,
    Estimate,
    Reliability,
    bootstrap_mean,
    chance_bins,
    restricted_times,
    share_by_time,
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


def test_wilson_is_exact_at_none_and_all_and_takes_arrays():
    got = wilson(np.array([[0, 5], [2, 5]]), 5)
    assert got.low[0, 0] == 0.0
    assert got.high[0, 1] == got.high[1, 1] == 1.0
    assert got.at((1, 0)) == Estimate(0.4, float(got.low[1, 0]), float(got.high[1, 0]))  # type: ignore[arg-type]


def test_wilson_mirrors():
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
def test_wilson_refuses_what_is_no_count(successes, trials, error, message):
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


def test_bootstrap_is_the_same_every_time_and_for_no_spread_a_point():
    sample = np.arange(50) % 7
    assert bootstrap_mean(sample) == bootstrap_mean(sample.copy())
    assert bootstrap_mean([3.5, 3.5, 3.5]) == (3.5, 3.5, 3.5)
    assert bootstrap_mean([2]) == (2.0, 2.0, 2.0)


def test_bootstrap_in_portions_draws_what_it_draws_at_once(monkeypatch):
    sample = np.arange(30.0) ** 2
    whole = bootstrap_mean(sample)
    monkeypatch.setattr("DroneSwarmSearch.evaluation.statistics._AT_ONCE", 30 * 7)
    assert RESAMPLES % 7
    assert bootstrap_mean(sample) == whole


def test_bootstrap_of_several_samples_is_of_the_mean_of_their_means():
    steady, spread = np.full(10, 2.0), np.tile([0.0, 10.0], 500)
    alone, both = bootstrap_mean(spread), bootstrap_mean(spread, steady)
    assert both.value == pytest.approx((5.0 + 2.0) / 2)
    assert both.high - both.low == pytest.approx((alone.high - alone.low) / 2)
    twice = bootstrap_mean(spread, spread[::-1])  # independent: errors add as squares
    assert twice.high - twice.low == pytest.approx((alone.high - alone.low) / math.sqrt(2), rel=0.1)


def test_bootstrap_refuses_other_shapes():
    with pytest.raises(ValueError, match="samples must be at least one array, got none"):
        bootstrap_mean()
    with pytest.raises(ValueError, match=r"samples\[1\] must have the shape \(n,\).* got \(0,\)"):
        bootstrap_mean([1.0], [])
    with pytest.raises(ValueError, match=r"samples\[0\].* got \(1, 2\)"):
        bootstrap_mean([[1.0, 2.0]])


def test_restricted_mean_time_is_the_area_under_the_share_not_found():
    """Royston and Parmar's definition: the integral of the survival function up to L."""
    times = np.array([0, 3, 1, 10, 0, 7, 7, 2])
    limit = 10
    share = share_by_time(times, limit).value
    area = sum(1 - share[t] for t in range(limit))
    assert restricted_times(times, limit).mean() == pytest.approx(area)
    assert restricted_times(times, limit).tolist() == [10, 3, 1, 10, 10, 7, 7, 2]


def test_share_by_time_counts_steps_completed():
    band = share_by_time([1, 4, 0, 4], 5)
    assert band.value.tolist() == [0, 0.25, 0.25, 0.25, 0.75, 0.75]
    assert (band.low <= band.value).all()
    assert (band.value <= band.high).all()
    assert band.at(-1) == wilson([3], 4).at(0)
    assert share_by_time([0, 0], 2).value.tolist() == [0, 0, 0]


def test_bins_hold_their_lower_edge():
    assert chance_bins(np.array([0.0, 0.000999, 0.001, 0.05, 0.4999, 0.5, 1.0, 2.5])).tolist() == [
        *(0, 0, 1, 6, 8, 9, 9, 9)
    ]
    assert list(CHANCE_EDGES) == sorted({*CHANCE_EDGES})


def test_reliability_by_hand():
    table = Reliability.empty()
    table.count(np.array([0.5, 0.75, 0.25]), np.array([1, 0, 0]))
    table.count(np.array([0.25]), np.array([1]))
    assert table.searches.tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 2, 2]
    assert table.mean_promised[-2:].tolist() == [0.25, 0.625]
    assert table.share_found[-2:].tolist() == [0.5, 0.5]
    assert np.isnan(table.mean_promised[:-2]).all()
    # Half the searches promise 1/4 too little, half 1/8 too much.
    assert table.expected_error == pytest.approx((0.25 + 0.125) / 2)


def test_reliability_adds_up():
    parts = []
    for k in range(3):
        parts.append(Reliability.empty())
        parts[-1].count(np.linspace(0, 1, 10 + k), np.arange(10 + k) % 2)
    whole = Reliability.total(parts)
    assert whole.searches.sum() == 33
    assert whole.found.sum() == sum(part.found.sum() for part in parts)
    assert whole.promised.sum() == pytest.approx(33 / 2)
    assert Reliability.total([]).expected_error == 0.0
