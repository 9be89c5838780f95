"""Search patterns of the IAMSAR Manual over the sea, in metres; see `geo.pattern_legs`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.geo.pattern_legs import (
    Legs,
    parallel_legs,
    sector_legs,
    square_legs,
    turning_points,
)

PARALLEL = "parallel track"
"""Parallel legs, and back along them."""

SQUARE = "expanding square"
"""A square spiral from its middle."""

SECTOR = "sector search"
"""Triangles that meet in the middle."""

KINDS = (PARALLEL, SQUARE, SECTOR)
"""Of the IAMSAR Manual, volume II, chapter 5."""


@dataclass(frozen=True)
class Pattern:
    """A search pattern; lengths are in metres.

    Attributes:
        kind: "parallel track", "expanding square" or "sector search".
        start: the commence search point, (east, north).
        heading: of the first leg, clockwise from north, in radians.
        length: of the legs of a parallel track, or of the radius of a sector search.
        spacing: between parallel legs; an expanding square grows by it with every second leg.
        legs: of a parallel track, which is then flown backwards.
        side: 1 if the drone turns to starboard, -1 if to port.
        drift: the velocity of all points from take-off on, (east, north) in m/s.
    """

    kind: str
    start: Floats
    heading: float
    length: float
    spacing: float
    legs: int
    side: int
    drift: Floats

    def points(self, count: int) -> Floats:
        """The first points, where they are at take-off: float64, (n, 2), n at most `count`."""
        legs = self._legs(np.arange(count - 1))
        headings = self.heading + np.radians(self.side * legs.turns)
        points = turning_points(self.start, headings, legs.lengths)
        is_turn = np.abs(np.sin(np.diff(headings) / 2)) > 1e-9
        turning: Floats = points[np.concatenate([[True], is_turn, [True]])]
        return turning

    def _legs(self, numbers: Ints) -> Legs:
        """The legs with these numbers, counted from 0."""
        if self.kind == SQUARE:
            return square_legs(numbers, self.spacing)
        if self.kind == SECTOR:
            return sector_legs(numbers, self.length)
        laps, legs = self._laps(numbers)
        turns, lengths = parallel_legs(legs, self.length, self.spacing)
        return Legs(turns + 180.0 * (laps % 2), lengths)

    def is_along(self, numbers: Ints) -> Flags:
        """Whether legs of a parallel track, counted from 0, lie along it; the others cross over."""
        along: Flags = self._laps(numbers)[1] % 2 == 0
        return along

    def _laps(self, numbers: Ints) -> tuple[Ints, Ints]:
        """How often the pattern was flown before each leg, and which leg of the pattern it is."""
        whole = 2 * self.legs - 1
        lap, leg = np.divmod(numbers, whole)
        return lap, np.where(lap % 2, whole - 1 - leg, leg)
