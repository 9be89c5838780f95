"""The datum of a search pattern, and the area to search around it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix
from DroneSwarmSearch.policies.tracks import Rectangle

__all__ = ["REACH", "Datum"]

REACH = 2.0
"""Standard deviations from the datum to each side: 91% of a normal distribution is inside."""


class Datum(NamedTuple):
    """The person's expected position, and the search effort available there.

    Attributes:
        mean: (x, y), in cells.
        deviation: standard deviations along x and y, in cells.
        effort: the number of cells that all drones together have time to search, at least 1.
    """

    mean: tuple[float, float]
    deviation: tuple[float, float]
    effort: float

    @classmethod
    def of_forecast(cls, forecast: ProbabilityMatrix, step: int, effort: float) -> Datum:
        """The datum of a person's forecast at a step."""
        moments = [_moments(chances) for chances in forecast.marginals(step)]
        (x, deviation_x), (y, deviation_y) = moments
        return cls((x, y), (deviation_x, deviation_y), max(effort, 1.0))

    def area(self, grid_size: int) -> Rectangle:
        """The area to search: a rectangle around the datum, within the grid and the effort.

        It extends ``REACH`` standard deviations to each side, reduced in tenths of a deviation
        until the effort suffices.
        """
        for tenths in range(round(10 * REACH), 0, -1):
            area = self._within(tenths / 10, grid_size)
            if area.area <= self.effort:
                return area
        return self._within(0.0, grid_size)

    def _within(self, reach: float, grid_size: int) -> Rectangle:
        """All cells within a number of standard deviations along each axis."""
        ranges = []
        for mean, deviation in zip(self.mean, self.deviation, strict=True):
            first = max(math.floor(mean - reach * deviation + 0.5), 0)
            last = min(math.floor(mean + reach * deviation + 0.5), grid_size - 1)
            ranges.append((first, last - first + 1))
        (x, width), (y, height) = ranges
        return Rectangle(x, y, width, height)


def _moments(chances: NDArray[np.float64]) -> tuple[float, float]:
    """Mean and standard deviation of the column or row."""
    numbers = np.arange(len(chances))
    mean = float(chances @ numbers)
    variance = float(chances @ (numbers - mean) ** 2)
    return mean, math.sqrt(variance)
