"""The array form of `ProbabilityMatrix.start`, for persons with different forecasts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix, moves

__all__ = ["Starts", "moves"]


class Starts:
    """The array form of `ProbabilityMatrix.start`, for persons with different forecasts.

    Args:
        forecasts: the forecasts, which are numbered in this order.
    """

    def __init__(self, forecasts: Sequence[ProbabilityMatrix]) -> None:
        cumulative = [forecast.start_cumulative for forecast in forecasts]
        # Each forecast's entries are a square array, so that two short counts find an entry.
        self._width = math.isqrt(max(map(len, cumulative)) - 1) + 1
        entries = np.full((len(cumulative), self._width**2), 2.0)
        for place, values in zip(entries, cumulative, strict=True):
            place[: len(values)] = values
        self._blocks = entries.reshape(-1, self._width)
        self._ends = self._blocks[:, -1].reshape(-1, self._width).copy()

    def __call__(self, numbers: NDArray[Any], draws: NDArray[Any]) -> NDArray[np.int64]:
        """Return the hypothesis times grid_size², plus the cell, of each person at step 0.

        Args:
            numbers: the number of each person's forecast.
            draws: a uniform draw from [0, 1) for each, of the same shape.
        """
        above = draws[..., None]
        block = np.less_equal(self._ends.take(numbers, 0), above).sum(-1)
        block += numbers * self._width
        entry = np.less_equal(self._blocks.take(block, 0), above).sum(-1)
        found: NDArray[np.int64] = (block - numbers * self._width) * self._width + entry
        return found
