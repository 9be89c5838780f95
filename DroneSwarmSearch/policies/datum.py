"""The datums of a search pattern, and the area to search around each."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.policies.pattern_tracks import Rectangle

REACH = 2.0
"""Standard deviations from the datum to each side: 91% of a normal distribution is inside."""


class Datum(NamedTuple):
    """A person's expected position, and the search effort available there.

    Attributes:
        mean: (x, y), in cells.
        deviation: standard deviations along x and y, in cells.
        effort: the number of cells that all drones together have time to search, at least 1.
        weight: the probability of the hypotheses that the datum is for.
    """

    mean: tuple[float, float]
    deviation: tuple[float, float]
    effort: float = 1.0
    weight: float = 1.0

    def area(self, grid_size: int) -> Rectangle:
        """The area to search: a rectangle around the datum, within the grid and the effort.

        ``REACH`` standard deviations to each side, reduced in tenths until the effort suffices.
        """
        areas = (
            self._within(tenths / 10, grid_size) for tenths in range(round(10 * REACH), -1, -1)
        )
        return next(area for area in areas if area.area <= self.effort)

    def _within(self, reach: float, grid_size: int) -> Rectangle:
        """All cells within a number of standard deviations along each axis; at 0, one cell."""
        ranges = []
        for mean, deviation in zip(self.mean, self.deviation, strict=True):
            first = max(math.floor(mean - reach * deviation + 0.5), 0)
            last = min(math.floor(mean + reach * deviation + 0.5), grid_size - 1)
            ranges.append((first, last - first + 1))
        (x, width), (y, height) = ranges
        return Rectangle(x, y, width, height)

    def is_apart_from(self, other: Datum) -> bool:
        """Whether the areas of two datums, of ``REACH`` standard deviations, do not meet."""
        apart = abs(np.subtract(self.mean, other.mean))
        return bool((apart > REACH * np.add(self.deviation, other.deviation) + 1.0).any())


def datums_of(forecast: DriftModel, step: int) -> list[Datum]:
    """The datums of a person's forecast at a step, the likeliest first.

    Hypotheses whose areas meet share a datum, and so do those that others connect; usually all.
    """
    maps = forecast.by_hypothesis(forecast.joint(step))
    parts = zip(maps, forecast.weights.tolist(), strict=True)
    likely = [part for part in parts if part[0].any()]  # a weight may be too small for a float
    singles = [_datum(*part) for part in likely]
    groups: list[list[int]] = []
    for number, single in enumerate(singles):
        apart = []
        merged = [number]
        for group in groups:
            if all(single.is_apart_from(singles[other]) for other in group):
                apart.append(group)
            else:
                merged += group
        groups = [*apart, merged]
    if len(groups) < len(singles):
        joint = np.array([mass for mass, _ in likely])
        weights = [weight for _, weight in likely]
        singles = [
            _datum(joint[group].sum(axis=0), sum(weights[number] for number in group))
            for group in groups
        ]
    return sorted(singles, key=lambda datum: -datum.weight)


def _datum(matrix: Floats, weight: float) -> Datum:
    """The datum of a part of a forecast, float64, shape (N, N)."""
    moments = []
    for axis in (0, 1):
        chances = matrix.sum(axis=axis) / matrix.sum()
        cells = np.arange(len(chances))
        mean = float(chances @ cells)
        moments.append((mean, math.sqrt(float(chances @ (cells - mean) ** 2))))
    (x, deviation_x), (y, deviation_y) = moments
    return Datum((x, y), (deviation_x, deviation_y), weight=weight)
