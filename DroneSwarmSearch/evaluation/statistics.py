"""Exact values, and interval estimates: shares, differences and means.

All intervals have a confidence of 95%; that of an exact value has width zero. The bootstrap draws
from a fixed sequence of random numbers, so equal data always give equal intervals, with every
version of NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.streams import numbers

__all__ = [
    "CONFIDENCE",
    "ROUNDING",
    "Band",
    "Estimate",
    "ExactValue",
    "bootstrap_mean",
    "bounded_mean",
    "bounded_means",
    "difference",
    "mean_of",
    "wilson",
]

Floats = NDArray[np.float64]

CONFIDENCE = 0.95
"""The confidence of every interval."""

Z = 1.959963984540054
"""The quantile of the normal distribution for `CONFIDENCE`."""

RESAMPLES = 2000
"""Bootstrap samples. Efron and Tibshirani recommend at least 1,000 for percentiles."""

_SYMMETRIC = 1e-6
"""Skewness below this counts as none, since its effect is lost in rounding."""

_KEY = 0x5EA0F57A71571C5
_AT_ONCE = 2**20
"""Random numbers drawn at a time."""


ROUNDING = 1e-9
"""Exact values that differ by less are equal: they are sums of rounded numbers."""


class Estimate(NamedTuple):
    """A value with its 95% confidence interval; of an exact value, the interval has width zero."""

    value: float
    low: float
    high: float

    @property
    def is_exact(self) -> bool:
        """Whether the value has no sampling error."""
        return isinstance(self, ExactValue)

    @property
    def data(self) -> dict[str, Any]:
        """Plain JSON data: value, low, high and exact."""
        return {**self._asdict(), "exact": self.is_exact}

    def scaled(self, factor: float) -> Estimate:
        """The estimate times a factor of at least 0."""
        return type(self)(*(each * factor for each in self))


class ExactValue(Estimate):
    """A value without sampling error; `ExactValue.of` makes one."""

    @classmethod
    def of(cls, value: float) -> ExactValue:
        """The value, with an interval of width zero."""
        return cls(value, value, value)


class Band(NamedTuple):
    """A curve with a pointwise confidence interval: float64 arrays of equal shape."""

    value: Floats
    low: Floats
    high: Floats

    def at(self, index: int | tuple[()]) -> Estimate:
        """The estimate at one point."""
        return Estimate(*(float(each[index]) for each in self))


def wilson(successes: ArrayLike, trials: int) -> Band:
    """Estimate shares, with Wilson's score interval.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference,
    Journal of the American Statistical Association 22, 1927. Unlike the normal
    approximation, it holds for few trials and for shares near 0 and 1.

    Args:
        successes: integers from 0 to `trials`, of any shape.
        trials: at least 1.

    Raises:
        TypeError: `trials` is not an integer.
        ValueError: `trials` is less than 1, or `successes` is out of range.
    """
    n = checks.integer("trials", trials, 1)
    share = np.asarray(successes, np.float64) / n
    if share.size and not (share.min() >= 0.0 and share.max() <= 1.0):
        raise ValueError(f"successes must be from 0 to trials, {n}, got {successes!r}")
    shrink = 1.0 / (1.0 + Z**2 / n)
    middle = shrink * (share + Z**2 / (2 * n))
    half = shrink * Z * np.sqrt(share * (1.0 - share) / n + (Z / (2 * n)) ** 2)
    # At shares of 0 and 1, rounding would miss the exact limits.
    low = np.where(share == 0.0, 0.0, middle - half)
    high = np.where(share == 1.0, 1.0, middle + half)
    return Band(share, low, high)


def mean_of(estimates: Iterable[Estimate]) -> Estimate:
    """Estimate the mean of independent quantities from the estimate of each.

    The distances from the values to their limits are added in squares (MOVER): G. Y. Zou and
    A. Donner, Construction of confidence limits about effect measures: a general approach,
    Statistics in Medicine 27:1693-1702, 2008.

    Raises:
        ValueError: there is no estimate.
    """
    all_estimates = list(estimates)
    if not all_estimates:
        raise ValueError("estimates must be at least one, got none")
    n = len(all_estimates)
    value = math.fsum(each.value for each in all_estimates) / n
    if all(each.is_exact for each in all_estimates):
        return ExactValue.of(value)
    below = math.hypot(*(each.value - each.low for each in all_estimates)) / n
    above = math.hypot(*(each.high - each.value for each in all_estimates)) / n
    return Estimate(value, value - below, value + above)


def difference(first: Estimate, second: Estimate) -> Estimate:
    """Estimate the difference of two independent quantities, first minus second.

    If both are exact, so is the difference; less than `ROUNDING` is 0. Otherwise, the distances
    from the values to their limits are added in squares, as in `mean_of`; an exact value adds none.
    """
    value = first.value - second.value
    if first.is_exact and second.is_exact:
        return ExactValue.of(value if abs(value) >= ROUNDING else 0.0)
    below = math.hypot(first.value - first.low, second.high - second.value)
    above = math.hypot(first.high - first.value, second.value - second.low)
    return Estimate(value, value - below, value + above)


def bootstrap_mean(sample: ArrayLike) -> Estimate:
    """Estimate a mean, with its percentile bootstrap interval.

    B. Efron, Bootstrap methods: another look at the jackknife, Annals of Statistics 7,
    1979; percentiles: B. Efron and R. Tibshirani, An Introduction to the Bootstrap, 1993,
    chapter 13.

    Args:
        sample: real numbers, shape (n,), n >= 1.

    Raises:
        ValueError: the sample has another shape.
    """
    values = _column(sample)[:, 0]
    n, mean = len(values), math.fsum(values.tolist()) / len(values)
    if (values == values[0]).all():
        return Estimate(mean, mean, mean)
    means, at_once, key = np.empty(RESAMPLES), max(1, _AT_ONCE // n), np.array([_KEY], np.uint64)
    for first in range(0, RESAMPLES, at_once):
        last = min(first + at_once, RESAMPLES)
        drawn = numbers(key, np.arange(first * n, last * n, dtype=np.uint64)) * n
        means[first:last] = values[drawn.astype(np.int64).reshape(-1, n)].mean(axis=1)
    tail = (1.0 - CONFIDENCE) / 2
    low, high = np.quantile(means, (tail, 1.0 - tail))
    return Estimate(mean, float(low), float(high))


def bounded_mean(sample: ArrayLike, least: float = 0.0, most: float = 1.0) -> Estimate:
    """Estimate the mean of a bounded quantity, as `bounded_means` does.

    Args:
        sample: real numbers, shape (n,), n >= 1.
        least: the least possible value.
        most: the greatest possible value.

    Raises:
        ValueError: the sample has another shape, or is out of bounds.
    """
    return bounded_means(_column(sample), least, most).at(0)


def bounded_means(samples: ArrayLike, least: float = 0.0, most: float = 1.0) -> Band:
    """Estimate the means of several bounded quantities, which may be skewed.

    Student's statistic is transformed so that its distribution has no skewness: P. Hall, On the
    removal of skewness by transformation, Journal of the Royal Statistical Society B 54, 1992.
    The percentile bootstrap too often misses the mean of small, skewed probabilities.

    If all values of a quantity are equal, the sample does not show its variance. The interval then
    allows for other values in a share of all trials: the upper limit of Wilson's interval for 0
    of n.

    Args:
        samples: the quantities of each trial: real numbers, shape (n, k), n >= 1.
        least: the least possible value.
        most: the greatest possible value.

    Raises:
        ValueError: the samples have another shape, or are out of bounds.
    """
    values = _columns(samples)
    lowest, highest = values.min(initial=most), values.max(initial=least)
    if not (lowest >= least and highest <= most):
        raise ValueError(
            f"samples must be from {least:g} to {most:g}, got {lowest:g} to {highest:g}"
        )
    n = len(values)
    share = float(wilson(0, n).high)
    means = values[0].copy()
    low, high = (means + share * (end - means) for end in (least, most))
    mean = values.mean(axis=0)
    off = values - mean
    deviation = np.sqrt((off**2).sum(axis=0) / max(n - 1, 1))
    varies = (values != means).any(axis=0) & (deviation > 0.0)
    means[varies] = mean = mean[varies]
    deviation = deviation[varies]
    skewness = ((off[:, varies] / deviation) ** 3).mean(axis=0)
    for limits, quantile in ((low, Z), (high, -Z)):
        normal = quantile / math.sqrt(n)
        student = _student(normal, skewness, n)
        limits[varies] = np.clip(mean - deviation * student, least, most)
    return Band(means, low, high)


def _student(normal: float, skewness: Floats, n: int) -> Floats:
    """The value of Student's statistic, over the root of n, that Hall's transformation maps.

    The transformation of w is w + g w²/3 + g² w³/27 + g/(6n), with the skewness g.

    Args:
        normal: the value of the transformed statistic, over the root of n.
        skewness: the skewness of each quantity.
        n: the number of trials.
    """
    without_shift = normal - skewness / (6 * n)
    # The cubic is ((1 + g w/3)³ - 1) / g; without skewness, it is w.
    safe = np.where(np.abs(skewness) > _SYMMETRIC, skewness, 1.0)
    skewed = 3.0 / safe * (np.cbrt(1.0 + safe * without_shift) - 1.0)
    return np.where(np.abs(skewness) > _SYMMETRIC, skewed, without_shift)


def _column(sample: ArrayLike) -> Floats:
    """A validated sample of one quantity: float64, (n, 1)."""
    values = np.asarray(sample, np.float64)
    if values.ndim != 1 or not values.size:
        raise ValueError(f"sample must have the shape (n,) with n >= 1, got {values.shape}")
    return values[:, None]


def _columns(samples: ArrayLike) -> Floats:
    """Validated samples of several quantities: float64, (n, k)."""
    values = np.asarray(samples, np.float64)
    if values.ndim != 2 or not len(values):
        raise ValueError(f"samples must have the shape (n, k) with n >= 1, got {values.shape}")
    return values
