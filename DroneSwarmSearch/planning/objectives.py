"""Concave upper bounds on the probability of success (POS), as functions of search effort."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.planning.frank_wolfe import line_search
from DroneSwarmSearch.planning.memory import RememberingDrones
from DroneSwarmSearch.planning.paths import Path

Mixture = Sequence[tuple[float, Sequence[Path]]]
"""Sets of paths, one for each drone, with their shares in a mixture."""

SMOOTHING = 0.5, 0.02
"""Half the width over which corners are rounded off, in searches: first and least."""

SMOOTHING_HALF_LIFE = 10.0
"""After this many iterations, the corners are rounded off half as far as at first."""


class TrajectoryObjective:
    """E[min(Z, g(N))] over trajectories, for a mixture of drones' paths.

    Z and N are the mixture's mean credits and searches along a trajectory (see `memory`), and g
    joins 1 - (1 - q)^N at whole N by straight lines. Z is at most q N, so g matters only beyond
    its first piece, and the second one is extended to N = 0. For q = 1, g is then 1.

    At the function's corners the Frank-Wolfe method would stall. Tangents and step sizes therefore
    come from one with rounded corners; each tangent is then raised above the function itself.
    """

    def __init__(self, drones: RememberingDrones, mixture: Mixture = ()) -> None:
        self.drones, self._probabilities = drones, drones.probabilities
        self._q = drones.detection
        self.mixture = list(mixture)
        self._collected = drones.collected(
            [path for _, paths in mixture for path in paths],
            np.array([share for share, paths in mixture for _ in paths]),
        )
        most = 1 if self._q >= 1.0 else 0  # searches beyond which g is constant
        if 0.0 < self._q < 1.0:
            most = math.ceil(-36.0 / math.log1p(-self._q))
        self._corners = np.arange(most + 2.0)
        self._missed = (1.0 - self._q) ** self._corners
        self._slopes = self._q * self._missed

    @property
    def _smoothing(self) -> float:
        widest, narrowest = SMOOTHING
        return max(widest / (1.0 + len(self.mixture) / SMOOTHING_HALF_LIFE), narrowest)

    def value(self) -> float:
        credits, searches = self._collected
        return self._mean(np.minimum(credits, self._success(searches)))

    def tangent(self) -> tuple[float, Floats]:
        credits, searches = self._collected
        corner, turned = self._nearest_corner(searches)
        # The slope of the smooth minimum with respect to the credits.
        width = max(2 * self._q * self._smoothing, 1e-9)
        success = self._smooth_success(searches)
        by_credits = np.clip((success - credits) / width + 0.5, 0.0, 1.0)
        slope = (1.0 - turned) * self._slopes[corner - 1] + turned * self._slopes[corner]
        above = 1.0 - self._missed[corner] - slope * corner
        intercept = self._mean((1.0 - by_credits) * above)
        return intercept, self._probabilities * [by_credits, (1.0 - by_credits) * slope]

    def move_towards(self, target: Sequence[Path]) -> None:
        change = self.drones.collected(target) - self._collected

        def value(size: float) -> float:
            credits, searches = self._collected + size * change
            success, half = self._smooth_success(searches), max(self._q * self._smoothing, 1e-9)
            within = np.maximum(half - abs(success - credits), 0.0)  # of the rounded-off corner
            return self._mean(np.minimum(credits, success) - within**2 / (4 * half))

        step_size = line_search(value)
        self._collected += step_size * change
        self.mixture = [(share * (1.0 - step_size), paths) for share, paths in self.mixture]
        self.mixture.append((step_size, target))

    def _mean(self, values: Floats) -> float:
        """The expectation. Not a dot product: BLAS may use threads, which changes the sum."""
        return float((self._probabilities * values).sum())

    def _success(self, searches: Floats) -> Floats:
        """The function g, with its second piece extended to 0."""
        success: Floats = np.interp(searches, self._corners, 1.0 - self._missed)
        first = searches < 1.0
        success[first] = self._q + (searches[first] - 1.0) * self._slopes[1]
        return success

    def _smooth_success(self, searches: Floats) -> Floats:
        """The function g with its corners rounded off."""
        corner, turned = self._nearest_corner(searches)
        left, right = self._slopes[corner - 1], self._slopes[corner]
        # The integral of the turning slope is below g by this much.
        shortfall = self._smoothing * (left - right) * np.minimum(turned, 1.0 - turned) ** 2
        success: Floats = self._success(searches) - shortfall
        return success

    def _nearest_corner(self, searches: Floats) -> tuple[Ints, Floats]:
        """The nearest corner of g, and how far the slope has turned from its left to its right."""
        corner = np.clip(np.rint(searches), 1, self._corners[-1]).astype(np.int64)
        turned = np.clip((searches - corner) / (2 * self._smoothing) + 0.5, 0.0, 1.0)
        turned[corner == 1] = 1.0
        return corner, turned


class MarkovChainObjective:
    """E[1 - exp(-rate * effort along the trajectory)], exactly, for changing effort (T, N, N)."""

    def __init__(self, chain: DriftModel, rate: float, effort: Floats) -> None:
        self._chain, self._prior = chain, chain.joint(0)
        self._rate, self._effort = rate, effort

    def value(self) -> float:
        return float(1.0 - self._missing(self._effort)[-1].sum())

    def tangent(self) -> tuple[float, Floats]:
        missing, missed = self._missing(self._effort), np.exp(-self._rate * self._effort)
        gains = np.empty_like(self._effort)
        later = np.ones_like(self._prior)  # the probability of staying unfound from here on
        for step in range(len(missed) - 1, -1, -1):
            later = later * self._chain.lift(missed[step])
            gains[step] = self._rate * self._chain.map(missing[step] * later)
            if step:
                later = self._chain.backward(later, step - 1)
        found = 1.0 - missing[-1].sum()
        return float(found - np.vdot(gains, self._effort)), gains

    def move_towards(self, target: Floats) -> None:
        change = target - self._effort
        self._effort += change * line_search(
            lambda size: -float(self._missing(self._effort + size * change)[-1].sum())
        )

    def _missing(self, effort: Floats) -> list[Floats]:
        """Where the unfound person is, before each step and after the last search."""
        missing = [self._prior]
        for step, missed in enumerate(np.exp(-self._rate * effort)):
            mass = missing[-1] * self._chain.lift(missed)
            last = step + 1 == len(effort)
            missing.append(mass if last else self._chain.forward(mass, step))
        return missing
