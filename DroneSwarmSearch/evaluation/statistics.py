"""Exact values, and estimates with a confidence interval of 95%."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

Z = 1.959963984540054  # the quantile of the normal distribution for a confidence of 95%
ROUNDING = 1e-9  # values that differ by less are equal: they are sums of rounded numbers
_SYMMETRIC = 1e-6  # skewness below this counts as none, since its effect is lost in rounding


class Estimate(NamedTuple):
    """A value with its 95% confidence interval; of an exact value, the interval has width zero."""

    value: float
    low: float
    high: float

    @classmethod
    def exact(cls, value: float) -> Estimate:
        """A value without sampling error."""
        return cls(value, value, value)

    def __str__(self) -> str:
        """Three decimals, with the interval unless the value is exact."""
        value, low, high = (f"{number:.3f}" for number in self)
        return value if self.is_exact else f"{value} ({low} to {high})"

    @property
    def is_exact(self) -> bool:
        """Whether the value has no sampling error."""
        return self.low == self.high

    def scaled(self, factor: float) -> Estimate:
        """The estimate times a factor above 0."""
        return Estimate(*(value * factor for value in self))


def mean_of(estimates: Iterable[Estimate]) -> Estimate:
    """Estimate the mean of independent quantities from the estimate of each, at least one.

    The distances to their limits are added in squares (MOVER): G. Y. Zou and A. Donner,
    Construction of confidence limits about effect measures: a general approach, Statistics in
    Medicine 27, 2008.
    """
    every = list(estimates)
    n = len(every)
    value = math.fsum(estimate.value for estimate in every) / n
    below = math.hypot(*(estimate.value - estimate.low for estimate in every)) / n
    above = math.hypot(*(estimate.high - estimate.value for estimate in every)) / n
    return Estimate(value, value - below, value + above)


def difference(first: Estimate, second: Estimate) -> Estimate:
    """Estimate first minus second as `mean_of`; exact values within `ROUNDING` are equal."""
    value = first.value - second.value
    below = math.hypot(first.value - first.low, second.high - second.value)
    above = math.hypot(first.high - first.value, second.value - second.low)
    if below == above == 0.0 and abs(value) < ROUNDING:
        value = 0.0
    return Estimate(value, value - below, value + above)


def bounded_mean(sample: ArrayLike, least: float = 0.0, most: float = 1.0) -> Estimate:
    """Estimate the mean of values, shape (n,), of a bounded quantity, which may be skewed.

    Student's statistic is transformed so that its distribution has no skewness: P. Hall, On the
    removal of skewness by transformation, Journal of the Royal Statistical Society B 54, 1992.
    Other intervals too often miss the mean of small, skewed probabilities.

    Equal values do not show their variance: the interval then allows for others in a share of all
    trials, the upper limit of Wilson's interval for 0 of n (E. B. Wilson, Journal of the American
    Statistical Association 22, 1927).
    """
    values = np.asarray(sample, np.float64)
    n = len(values)
    mean = float(values.mean())
    if np.ptp(values) < ROUNDING:
        mean = float(values[0])
        share = Z**2 / (n + Z**2)
        return Estimate(mean, mean + share * (least - mean), mean + share * (most - mean))
    deviation = float(values.std(ddof=1))
    skewness = float((((values - mean) / deviation) ** 3).mean())
    limits = (mean - deviation * _student(z / math.sqrt(n), skewness, n) for z in (Z, -Z))
    return Estimate(mean, *(min(max(limit, least), most) for limit in limits))


def stratified_mean(sample: ArrayLike, strata: int) -> Estimate:
    """Estimate the mean over fixed strata, of which each gave equally many values in turn.

    Value i is of stratum i % strata. Only the spread within the strata is an error, since the
    strata are given and not drawn: W. G. Cochran, Sampling Techniques, 3rd edition, 1977,
    section 5.4. At least two values of each are needed.
    """
    values = np.asarray(sample, np.float64).reshape(-1, strata)
    rounds = len(values)
    variance = float(values.var(axis=0, ddof=1).mean()) / (rounds * strata)
    mean = float(values.mean())
    error = Z * math.sqrt(variance)
    return Estimate(mean, mean - error, mean + error)


def _student(normal: float, skewness: float, n: int) -> float:
    """The value of Student's statistic, over the root of n, that Hall's transformation maps.

    The transformation of w is w + g w²/3 + g² w³/27 + g/(6n), with the skewness g. The cubic is
    ((1 + g w/3)³ - 1) / g; without skewness, it is w.
    """
    if abs(skewness) <= _SYMMETRIC:
        return normal
    shifted = normal - skewness / (6 * n)
    return float(3.0 / skewness * (np.cbrt(1.0 + skewness * shifted) - 1.0))
