"""The Frank-Wolfe (conditional gradient) method for concave functions of search effort.

It maximises a function over the mixtures of what an oracle can return (M. Frank and P. Wolfe,
Naval Research Logistics Quarterly 3:95, 1956), moving towards the oracle's best response to the
gradient. The maximum of a tangent is an upper bound on the function; the duality gap is this bound
less the value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats

AVERAGING = 10.0
"""Tangent k has weight AVERAGING / (k + AVERAGING) in the mean, which forgets the early ones."""


class Objective(Protocol):
    """A concave function, together with the current point."""

    def value(self) -> float:
        """The function's value at the current point."""

    def tangent(self) -> tuple[float, Floats]:
        """A linear upper bound: its value without effort, and its gains, at least 0."""

    def move_towards(self, target: Any) -> None:
        """Move the current point towards one of the oracle's, by about the best step size."""


class Optimum(NamedTuple):
    """The value at the best point found, and an upper bound on the objective's maximum."""

    value: float
    upper_bound: float

    @property
    def gap(self) -> float:
        """The duality gap."""
        return self.upper_bound - self.value


def frank_wolfe(
    objective: Objective,
    oracle: Callable[[Floats], tuple[float, Any]],
    *,
    gap: float,
    iterations: int,
    upper_bound: float = math.inf,
) -> Optimum:
    """Maximise a concave function over the mixtures of what an oracle can return.

    Args:
        objective: the function; its current point moves.
        oracle: takes gains; returns the largest total gain, and the point that attains it.
        gap: stop at this duality gap, as a fraction of the upper bound.
        iterations: the largest number of iterations.
        upper_bound: a bound that is already known.
    """
    value = -math.inf
    mean_intercept = 0.0
    mean_gains = np.zeros(())
    for iteration in range(iterations + 1):
        value = max(value, objective.value())
        intercept, gains = objective.tangent()
        # A mean of tangents is an upper bound too, and oscillates less than the latest one.
        weight = AVERAGING / (iteration + AVERAGING)
        mean_intercept += weight * (intercept - mean_intercept)
        mean_gains = mean_gains + weight * (gains - mean_gains)
        gained, target = oracle(mean_gains)
        upper_bound = min(upper_bound, mean_intercept + gained)
        if upper_bound - value <= gap * upper_bound or iteration == iterations:
            break
        objective.move_towards(target)
    return Optimum(value, upper_bound)


def line_search(value: Callable[[float], float]) -> float:
    """The best step size in [0, 1] for a concave function: a golden-section search in its log."""
    golden = (math.sqrt(5) - 1) / 2
    low = math.log(1e-4)
    high = 0.0
    a = high - golden * (high - low)
    b = low + golden * (high - low)
    at_a = value(math.exp(a))
    at_b = value(math.exp(b))
    for _ in range(9):
        if at_a > at_b:
            high = b
            b = a
            at_b = at_a
            a = high - golden * (high - low)
            at_a = value(math.exp(a))
        else:
            low = a
            a = b
            at_a = at_b
            b = low + golden * (high - low)
            at_b = value(math.exp(b))
    return math.exp((low + high) / 2)
