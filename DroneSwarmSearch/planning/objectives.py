"""Concave upper bounds on the probability of success (POS), as functions of search effort.

`TrajectoryObjective` takes the expectation over a list of trajectories; `MarkovChainObjective`
bounds it from above by a product along the trajectory, whose expectation is exact.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.belief import over_hypotheses
from DroneSwarmSearch.drift.markov_chain import MarkovChain
from DroneSwarmSearch.planning.frank_wolfe import Effort, line_search
from DroneSwarmSearch.planning.trajectories import Trajectories

__all__ = ["MarkovChainObjective", "TrajectoryObjective"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMOOTHING = 0.5, 0.02
"""Half the width over which the corners of g are rounded off, in searches: first and least."""

SMOOTHING_HALF_LIFE = 10.0
"""After this many iterations, the corners are rounded off half as far as at first."""


class TrajectoryObjective:
    """E[g(s)] over trajectories, where g joins 1 - (1 - q)^s at whole s by straight lines.

    At the corners of g the Frank-Wolfe method would stall. Tangents and step sizes therefore
    come from g with its corners rounded off, less and less; each tangent is then raised until
    it lies above g itself.

    Args:
        trajectories: the person's trajectories.
        grid_size: cells along each side, N.
        detection: the probability of detection, q.
    """

    def __init__(self, trajectories: Trajectories, grid_size: int, detection: float) -> None:
        self._cells, self._probabilities = trajectories
        self._size, self._q = grid_size, detection
        self._effort = np.zeros(len(self._cells) * grid_size**2)
        self._sums = np.zeros(len(self._probabilities))
        self._corners = np.arange(self._most_searches() + 2.0)
        self._missed = (1.0 - detection) ** self._corners
        self._slopes = detection * self._missed
        self._iterations = 0

    @property
    def _smoothing(self) -> float:
        widest, narrowest = SMOOTHING
        return max(widest / (1.0 + self._iterations / SMOOTHING_HALF_LIFE), narrowest)

    def _most_searches(self) -> int:
        """The number of searches beyond which g is constant in double precision."""
        if self._q >= 1.0:
            return 1
        if self._q <= 0.0:
            return 0
        return min(math.ceil(-36.0 / math.log1p(-self._q)), len(self._cells))

    def value(self) -> float:
        return self._mean(self._success(self._sums))

    def tangent(self) -> tuple[float, Floats]:
        corner, turned = self._nearest_corner(self._sums)
        slope = (1.0 - turned) * self._slopes[corner - 1] + turned * self._slopes[corner]
        intercept = self._mean(1.0 - self._missed[corner] - slope * corner)
        weights, cells_in_grid = self._probabilities * slope, self._size**2
        gains = np.empty((len(self._cells), cells_in_grid))
        for row, cells in zip(gains, self._cells, strict=True):
            row[:] = np.bincount(cells, weights, cells_in_grid)
        return intercept, gains.reshape(-1, self._size, self._size)

    def move_towards(self, target: Effort) -> None:
        there = np.zeros(len(self._effort))
        np.add.at(there, target.indices, target.amounts)
        change = self._sums_along(there) - self._sums
        step_size = line_search(
            lambda size: self._mean(self._smooth_success(self._sums + size * change))
        )
        self._sums += step_size * change
        self._effort += step_size * (there - self._effort)
        self._iterations += 1

    def _sums_along(self, effort: Floats) -> Floats:
        """The total effort along each trajectory."""
        sums, here = np.zeros(len(self._probabilities)), np.empty(len(self._probabilities))
        per_step = effort.reshape(len(self._cells), -1)
        for cells, amounts in zip(self._cells, per_step, strict=True):
            if amounts.any():
                # mode="clip" lets NumPy write into `here` without a buffer.
                amounts.take(cells, out=here, mode="clip")
                sums += here
        return sums

    def _mean(self, values: Floats) -> float:
        """The expectation. Not a dot product: BLAS may use threads, which changes the sum."""
        return float((self._probabilities * values).sum())

    def _success(self, sums: Floats) -> Floats:
        """The function g."""
        success: Floats = np.interp(sums, self._corners, 1.0 - self._missed)
        return success

    def _smooth_success(self, sums: Floats) -> Floats:
        """The function g with its corners rounded off."""
        corner, turned = self._nearest_corner(sums)
        left, right = self._slopes[corner - 1], self._slopes[corner]
        # The integral of the turning slope is below g by this much.
        shortfall = self._smoothing * (left - right) * np.minimum(turned, 1.0 - turned) ** 2
        success: Floats = self._success(sums) - shortfall
        return success

    def _nearest_corner(self, sums: Floats) -> tuple[Ints, Floats]:
        """The nearest corner of g, and how far the slope has turned from its left to its right."""
        corner = np.minimum(np.rint(sums), self._corners[-1]).astype(np.int64)
        turned = np.clip((sums - corner) / (2 * self._smoothing) + 0.5, 0.0, 1.0)
        turned[corner == 0] = 1.0
        return corner, turned


class MarkovChainObjective:
    """E[1 - exp(-rate * effort along the trajectory)], exactly, by a forward and a backward pass.

    Args:
        chain: the person's Markov chain, from step 0.
        prior: the person's distribution at step 0: float64, shape (M, N, N).
        rate: detections per unit of effort: a number or float64, shape (N, N).
        effort: the current point: float64, shape (T * N * N,); changed in place.
    """

    def __init__(
        self, chain: MarkovChain, prior: Floats, rate: float | Floats, effort: Floats
    ) -> None:
        size = prior.shape[-1]
        self._chain, self._prior, self._rate = chain, prior, rate
        self._effort = effort.reshape(-1, size, size)

    def value(self) -> float:
        return float(1.0 - self._missing(self._effort)[-1].sum())

    def tangent(self) -> tuple[float, Floats]:
        missing, missed = self._missing(self._effort), self._missed(self._effort)
        gains = np.empty_like(self._effort)
        later = np.ones_like(self._prior)  # the probability of staying unfound from here on
        for step in range(len(missed) - 1, -1, -1):
            later = later * missed[step]
            gains[step] = self._rate * over_hypotheses(missing[step] * later)
            if step:
                later = self._chain.backward(later, step - 1)
        found = 1.0 - missing[-1].sum()
        return float(found - np.vdot(gains, self._effort)), gains

    def move_towards(self, target: Effort) -> None:
        there = np.zeros(self._effort.size)
        np.add.at(there, target.indices, target.amounts)
        change = there.reshape(self._effort.shape) - self._effort
        self._effort += change * line_search(
            lambda size: -float(self._missing(self._effort + size * change)[-1].sum())
        )

    def _missed(self, effort: Floats) -> Floats:
        """The probability that the effort in each cell misses a person there."""
        missed: Floats = np.exp(-self._rate * effort)
        return missed

    def _missing(self, effort: Floats) -> list[Floats]:
        """Where the unfound person is, before each step and after the last search."""
        mass, missed = self._prior, self._missed(effort)
        missing = [mass]
        for step, fraction in enumerate(missed):
            mass = mass * fraction
            if step + 1 < len(missed):
                mass = self._chain.forward(mass, step)
            missing.append(mass)
        return missing
