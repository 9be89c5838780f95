"""Search patterns of the IAMSAR Manual over the sea, in metres; see `geo.pattern_legs`."""

from __future__ import annotations

from dataclasses import dataclass, replace

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


LEGS_LEFT_OUT = 50  # at most, at the beginning


def distances_along(points: Floats) -> Floats:
    """The distance of each point from the first one along the lines between them: (n,)."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.append(0.0, lengths.cumsum())


def point_along(points: Floats, distances: Floats) -> Floats:
    """The points at some distances along the lines between points, (n, 2): (m, 2)."""
    along = distances_along(points)
    return np.stack([np.interp(distances, along, axis) for axis in points.T], axis=-1)


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
        begin: how much of the track is left out at its beginning, because it is over land.
    """

    kind: str
    start: Floats
    heading: float
    length: float
    spacing: float
    legs: int
    side: int
    drift: Floats
    begin: float = 0.0

    def points(self, count: int) -> Floats:
        """The first points, where they are at take-off: float64, (n, 2), n at most `count`."""
        legs = self._legs(np.arange(count - 1))
        headings = self.heading + np.radians(self.side * legs.turns)
        points = turning_points(self.start, headings, legs.lengths)
        is_turn = np.abs(np.sin(np.diff(headings) / 2)) > 1e-9
        turning: Floats = points[np.concatenate([[True], is_turn, [True]])]
        if self.begin:
            first = point_along(turning, np.array([self.begin]))
            turning = np.vstack([first, turning[1 + self.legs_left_out :]])
        return turning

    @property
    def legs_left_out(self) -> int:
        """The number of whole legs that are left out."""
        if not self.begin:
            return 0
        ends = distances_along(replace(self, begin=0.0).points(LEGS_LEFT_OUT + 2))
        return int(ends[1:].searchsorted(self.begin, side="right"))

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
        along: Flags = self._laps(numbers + self.legs_left_out)[1] % 2 == 0
        return along

    def _laps(self, numbers: Ints) -> tuple[Ints, Ints]:
        """How often the pattern was flown before each leg, and which leg of the pattern it is."""
        whole = 2 * self.legs - 1
        lap, leg = np.divmod(numbers, whole)
        return lap, np.where(lap % 2, whole - 1 - leg, leg)
