"""Concave upper bounds on the probability of success (POS), as functions of search effort."""

from __future__ import annotations

import math

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.bound.frank_wolfe import line_search
from DroneSwarmSearch.drift.model import DriftModel


class TrajectoryObjective:
    """min(Z, g(N)) along a trajectory, for its mean credits Z and searches N (see `memory`).

    The function g joins 1 - (1 - q)^N at whole N by straight lines. Z is at most q N, so g matters
    only beyond its first piece, and the second one is extended to N = 0. For q = 1, g is then 1.
    """

    def __init__(self, detection: float) -> None:
        self._q = detection
        most = 1 if detection >= 1.0 else 0  # searches beyond which g is constant
        if 0.0 < detection < 1.0:
            most = math.ceil(-36.0 / math.log1p(-detection))
        self._corners = np.arange(most + 2.0)
        self._missed = (1.0 - detection) ** self._corners
        self._slopes = detection * self._missed

    def value(self, collected: Floats) -> Floats:
        """The function at credits and searches (2, m): shape (m,)."""
        credits, searches = collected
        least: Floats = np.minimum(credits, self._success(searches))
        return least

    def tangent(self, collected: Floats, width: float) -> tuple[Floats, Floats]:
        """Linear upper bounds near credits and searches (2, m).

        The function's corners are first rounded off by half a width, in searches; the tangents have
        the slopes, (2, m), of the rounded function. Their values without effort, (m,), raise them
        above the function itself.
        """
        credits, searches = collected
        corner, turned = self._nearest_corner(searches, width)
        left = self._slopes[corner - 1]
        right = self._slopes[corner]
        # The integral of the turning slope is below g by this much.
        shortfall = width * (left - right) * np.minimum(turned, 1.0 - turned) ** 2
        success = self._success(searches) - shortfall
        # The slope of the smooth minimum with respect to the credits.
        ramp = max(2 * self._q * width, 1e-9)
        by_credits = np.clip((success - credits) / ramp + 0.5, 0.0, 1.0)
        slope = (1.0 - turned) * left + turned * right
        above = 1.0 - self._missed[corner] - slope * corner
        by_searches = 1.0 - by_credits
        return by_searches * above, np.array([by_credits, by_searches * slope])

    def _success(self, searches: Floats) -> Floats:
        """The function g, with its second piece extended to 0."""
        success: Floats = np.interp(searches, self._corners, 1.0 - self._missed)
        first = searches < 1.0
        success[first] = self._q + (searches[first] - 1.0) * self._slopes[1]
        return success

    def _nearest_corner(self, searches: Floats, width: float) -> tuple[Ints, Floats]:
        """The nearest corner of g, and how far the slope has turned from its left to its right."""
        corner = np.clip(np.rint(searches), 1, self._corners[-1]).astype(np.int64)
        turned = np.clip((searches - corner) / (2 * width) + 0.5, 0.0, 1.0)
        turned[corner == 1] = 1.0
        return corner, turned


class MarkovChainObjective:
    """E[1 - exp(-rate * effort along the trajectory)], exactly, for changing effort (T, N, N)."""

    def __init__(self, model: DriftModel, rate: float, effort: Floats) -> None:
        self._model = model
        self._prior = model.joint(0)
        self._rate = rate
        self._effort = effort

    def value(self) -> float:
        return float(1.0 - self._missing(self._effort)[-1].sum())

    def tangent(self) -> tuple[float, Floats]:
        missing = self._missing(self._effort)
        missed = np.exp(-self._rate * self._effort)
        gains = np.empty_like(self._effort)
        later = np.ones_like(self._prior)  # the probability of staying unfound from here on
        for step in range(len(missed) - 1, -1, -1):
            later = later * self._model.lift(missed[step])
            gains[step] = self._rate * self._model.map(missing[step] * later)
            if step:
                later = self._model.backward(later, step - 1)
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
            mass = missing[-1] * self._model.lift(missed)
            last = step + 1 == len(effort)
            missing.append(mass if last else self._model.forward(mass, step))
        return missing
