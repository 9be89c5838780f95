"""Exact values, and estimates with a confidence interval of 95%."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["ROUNDING", "Estimate", "ExactValue", "bounded_mean", "difference", "mean_of"]

Z = 1.959963984540054
"""The quantile of the normal distribution for a confidence of 95%."""

ROUNDING = 1e-9
"""Exact values that differ by less are equal: they are sums of rounded numbers."""

_SYMMETRIC = 1e-6
"""Skewness below this counts as none, since its effect is lost in rounding."""


class Estimate(NamedTuple):
    """A value with its 95% confidence interval; of an exact value, the interval has width zero."""

    value: float
    low: float
    high: float

    @property
    def is_exact(self) -> bool:
        """Whether the value has no sampling error."""
        return isinstance(self, ExactValue)

    def scaled(self, factor: float) -> Estimate:
        """The estimate times a factor of at least 0."""
        return type(self)(*(each * factor for each in self))


class ExactValue(Estimate):
    """A value without sampling error; `ExactValue.of` makes one."""

    @classmethod
    def of(cls, value: float) -> ExactValue:
        """The value, with an interval of width zero."""
        return cls(value, value, value)


def mean_of(estimates: Iterable[Estimate]) -> Estimate:
    """Estimate the mean of independent quantities from the estimate of each, at least one.

    The distances from the values to their limits are added in squares (MOVER): G. Y. Zou and
    A. Donner, Construction of confidence limits about effect measures: a general approach,
    Statistics in Medicine 27:1693-1702, 2008.
    """
    every = list(estimates)
    n = len(every)
    value = math.fsum(each.value for each in every) / n
    if all(each.is_exact for each in every):
        return ExactValue.of(value)
    below = math.hypot(*(each.value - each.low for each in every)) / n
    above = math.hypot(*(each.high - each.value for each in every)) / n
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


def bounded_mean(sample: ArrayLike, least: float = 0.0, most: float = 1.0) -> Estimate:
    """Estimate the mean of a bounded quantity, which may be skewed.

    Student's statistic is transformed so that its distribution has no skewness: P. Hall, On the
    removal of skewness by transformation, Journal of the Royal Statistical Society B 54, 1992.
    Other intervals too often miss the mean of small, skewed probabilities.

    If all values are equal, the sample does not show its variance. The interval then allows for
    other values in a share of all trials: the upper limit of Wilson's interval for 0 of n (E. B.
    Wilson, Journal of the American Statistical Association 22, 1927).

    Args:
        sample: real numbers from `least` to `most`, shape (n,), n >= 1.
        least: the least possible value.
        most: the greatest possible value.
    """
    values = np.asarray(sample, np.float64)
    n, mean = len(values), float(values.mean())
    deviation = float(values.std(ddof=1)) if n > 1 else 0.0
    if (values == values[0]).all() or not deviation:
        mean, share = float(values[0]), Z**2 / (n + Z**2)
        return Estimate(mean, mean + share * (least - mean), mean + share * (most - mean))
    skewness = float((((values - mean) / deviation) ** 3).mean())
    limits = (mean - deviation * _student(z / math.sqrt(n), skewness, n) for z in (Z, -Z))
    return Estimate(mean, *(min(max(limit, least), most) for limit in limits))


def _student(normal: float, skewness: float, n: int) -> float:
    """The value of Student's statistic, over the root of n, that Hall's transformation maps.

    The transformation of w is w + g w²/3 + g² w³/27 + g/(6n), with the skewness g. The cubic is
    ((1 + g w/3)³ - 1) / g; without skewness, it is w.

    Args:
        normal: the value of the transformed statistic, over the root of n.
        skewness: the skewness of the quantity.
        n: the number of trials.
    """
    if abs(skewness) <= _SYMMETRIC:
        return normal
    shifted = normal - skewness / (6 * n)
    return float(3.0 / skewness * (np.cbrt(1.0 + skewness * shifted) - 1.0))
