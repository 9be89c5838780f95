"""The statistics of evaluations: shares, means, times, curves and calibration.

Intervals hold the true value in 95 of 100 cases. Random numbers come from a fixed
sequence of our own, so that the same figures always get the same intervals, whatever the
version of NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.streams import numbers

__all__ = [
    "CHANCE_EDGES",
    "CONFIDENCE",
    "Band",
    "Estimate",
    "Reliability",
    "bootstrap_mean",
    "chance_bins",
    "restricted_times",
    "share_by_time",
    "wilson",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CONFIDENCE = 0.95
"""The share of cases in which an interval holds the true value."""

Z = 1.959963984540054
"""The normal distribution's quantile for `CONFIDENCE`."""

RESAMPLES = 2000
"""Bootstrap samples; Efron and Tibshirani ask for a thousand or more for percentiles."""

CHANCE_EDGES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, math.inf)
"""The bins of `Reliability`. Chances in single cells are small, so bins of equal width
would hold nearly all searches in the first."""

_KEY = 0x5EA0F57A71571C5
_AT_ONCE = 2**20
"""So many random numbers are drawn at a time."""


class Estimate(NamedTuple):
    """A figure with its interval."""

    value: float
    low: float
    high: float

    def scaled(self, factor: float) -> Estimate:
        """The figure and its interval times a number of at least 0."""
        return Estimate(*(each * factor for each in self))


class Band(NamedTuple):
    """A curve with its interval at every point: float64 arrays of one shape."""

    value: Floats
    low: Floats
    high: Floats

    def at(self, index: int) -> Estimate:
        """A point of it."""
        return Estimate(*(float(each[index]) for each in self))


def wilson(successes: ArrayLike, trials: int) -> Band:
    """Shares with Wilson's score interval.

    E. B. Wilson, Probable inference, the forecast of succession, and statistical inference,
    Journal of the American Statistical Association 22, 1927. Unlike the normal
    approximation it holds for small numbers and for shares near 0 and 1.

    Args:
        successes: integers from 0 to `trials`, of any shape.
        trials: at least 1.

    Raises:
        TypeError: `trials` is no integer.
        ValueError: `trials` is less than 1, or `successes` is out of range.
    """
    n = checks.integer("trials", trials, 1)
    share = np.asarray(successes, np.float64) / n
    if share.size and not (share.min() >= 0.0 and share.max() <= 1.0):
        raise ValueError(f"successes must be from 0 to trials, {n}, got {successes!r}")
    shrink = 1.0 / (1.0 + Z**2 / n)
    middle = shrink * (share + Z**2 / (2 * n))
    half = shrink * Z * np.sqrt(share * (1.0 - share) / n + (Z / (2 * n)) ** 2)
    # The interval's ends at shares of 0 and 1 are exact; rounding would miss them.
    low = np.where(share == 0.0, 0.0, middle - half)
    high = np.where(share == 1.0, 1.0, middle + half)
    return Band(share, low, high)


def bootstrap_mean(*samples: ArrayLike) -> Estimate:
    """A mean with its percentile bootstrap interval.

    B. Efron, Bootstrap methods: another look at the jackknife, Annals of Statistics 7,
    1979; percentiles: B. Efron and R. Tibshirani, An Introduction to the Bootstrap, 1993,
    chapter 13.

    Args:
        samples: one sample or several, each of real numbers, shape (n,), n >= 1. Of
            several the mean of their means is taken, and each is resampled by itself: a
            suite's searches are fixed, their episodes are not.

    Raises:
        ValueError: there is no sample, or one has another shape.
    """
    if not samples:
        raise ValueError("samples must be at least one array, got none")
    value, means = 0.0, np.zeros(RESAMPLES)
    for place, sample in enumerate(samples):
        values = np.asarray(sample, np.float64)
        if values.ndim != 1 or not values.size:
            raise ValueError(
                f"samples[{place}] must have the shape (n,) with n >= 1, got {values.shape}"
            )
        value += math.fsum(values.tolist()) / values.size / len(samples)
        means += _resampled_means(values, place) / len(samples)
    tail = (1.0 - CONFIDENCE) / 2
    low, high = np.quantile(means, (tail, 1.0 - tail)).tolist()
    return Estimate(value, low, high)


def _resampled_means(values: Floats, place: int) -> Floats:
    """The means of `RESAMPLES` samples drawn from some values with replacement."""
    n = len(values)
    if values.min() == values.max():
        return np.full(RESAMPLES, values[0])
    means = np.empty(RESAMPLES)
    at_once = max(1, _AT_ONCE // n)
    key = np.array([_KEY + place], np.uint64)
    for first in range(0, RESAMPLES, at_once):
        last = min(first + at_once, RESAMPLES)
        places = np.arange(first * n, last * n, dtype=np.uint64)
        drawn = (numbers(key, places) * n).astype(np.int64).reshape(-1, n)
        means[first:last] = values[drawn].mean(axis=1)
    return means


def restricted_times(times: ArrayLike, limit: int) -> Floats:
    """Times to find, restricted to a limit; their mean is the restricted mean time.

    The mean of min(time, limit) is the area under the share not yet found up to the
    limit, which is defined even where many are never found: P. Royston and M. Parmar,
    Restricted mean survival time: an alternative to the hazard ratio, BMC Medical Research
    Methodology 13:152, 2013.

    Args:
        times: the step by which everybody was found, 0 for never; integers, shape (n,).
        limit: the steps of an episode, L.

    Returns:
        float64, shape (n,): the times, with L for never.
    """
    found_at = np.asarray(times)
    return np.where(found_at == 0, limit, np.minimum(found_at, limit)).astype(np.float64)


def share_by_time(times: ArrayLike, limit: int) -> Band:
    """The share found within t steps, for t = 0..limit, with Wilson's interval at each.

    Args:
        times: the step by which everybody was found, 0 for never; integers, shape (n,).
        limit: the steps of an episode, L.

    Returns:
        Arrays of shape (L + 1,).
    """
    found_at = np.asarray(times, np.int64)
    at_step = np.bincount(found_at[found_at > 0], minlength=limit + 1)[: limit + 1]
    return wilson(at_step.cumsum(), len(found_at))


def chance_bins(chances: Floats) -> Ints:
    """The bin of `CHANCE_EDGES` in which each chance lies, from 0: lower <= chance < upper."""
    bins: Ints = np.searchsorted(CHANCE_EDGES, chances, side="right").astype(np.int64) - 1
    return bins


@dataclass(frozen=True, eq=False)
class Reliability:
    """Searches by the chance that the matrix gave them: what was promised, what came.

    For every search made, the promise is the probability that the matrix shown gives to the
    searched cell, times the probability of detection. For several persons, where the
    matrix is the mean over those missing, it is the expected number of persons found: the
    probability shown times the sum of the missing persons' probabilities of detection;
    exact if these, or the persons' forecasts, are alike.

    A posterior is calibrated: promise and outcome agree in every bin, up to chance. A
    prior, which shows the drift alone, promises too much wherever cells are searched that
    were searched before, and for other cells too little as long as nothing is found.

    Reliability tables: A. H. Murphy, A new vector partition of the probability score,
    Journal of Applied Meteorology 12, 1973; M. DeGroot and S. Fienberg, The comparison and
    evaluation of forecasters, The Statistician 32, 1983.

    Attributes:
        searches: how many searches lie in each bin of `CHANCE_EDGES`: int64, (bins,).
        promised: the sum of the chances in each bin: float64, (bins,).
        found: the persons found by the searches of each bin: int64, (bins,).
    """

    searches: Ints
    promised: Floats
    found: Ints

    @classmethod
    def empty(cls) -> Reliability:
        """No searches."""
        bins = len(CHANCE_EDGES) - 1
        return cls(np.zeros(bins, np.int64), np.zeros(bins), np.zeros(bins, np.int64))

    @classmethod
    def total(cls, parts: Sequence[Reliability]) -> Reliability:
        """Several tables in one; summed in their order, so that rounding is always alike."""
        whole = cls.empty()
        for part in parts:
            whole.searches[:] += part.searches
            whole.promised[:] += part.promised
            whole.found[:] += part.found
        return whole

    def count(self, chances: Floats, found: Ints) -> None:
        """Add searches, in place.

        Args:
            chances: of each, shape (n,).
            found: how many persons each found, shape (n,).
        """
        bins, count = chance_bins(chances), len(self.searches)
        self.searches[:] += np.bincount(bins, minlength=count)
        self.promised[:] += np.bincount(bins, chances, minlength=count)
        self.found[:] += np.bincount(bins, found, minlength=count).astype(np.int64)

    @property
    def mean_promised(self) -> Floats:
        """The mean chance in each bin; NaN where there are no searches."""
        return _ratio(self.promised, self.searches)

    @property
    def share_found(self) -> Floats:
        """Persons found per search in each bin; NaN where there are no searches."""
        return _ratio(self.found, self.searches)

    @property
    def expected_error(self) -> float:
        """The expected calibration error: how far promise and outcome differ, in the mean.

        The mean is over all searches; 0 without any. As M. Naeini, G. Cooper and M.
        Hauskrecht, Obtaining well calibrated probabilities using Bayesian binning, AAAI
        2015, but with bins of our own.
        """
        total = int(self.searches.sum())
        if not total:
            return 0.0
        return float(np.abs(self.promised - self.found).sum() / total)


def _ratio(above: NDArray[np.number], below: Ints) -> Floats:
    out = np.full(len(below), np.nan)
    np.divide(above, below, out=out, where=below > 0)
    return out
