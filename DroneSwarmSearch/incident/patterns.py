"""Search patterns of the IAMSAR Manual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints

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
        number = np.arange(count - 1)  # of the leg
        right = self.side * np.pi / 2  # a turn by a right angle
        headings = self.heading + 0.0 * number
        lengths = self.length + 0.0 * number
        if self.kind == PARALLEL:
            lap, leg = self._laps(number)
            crosses = ~self.is_along(number)
            headings += np.where(crosses, right, np.pi * (leg // 2 + lap))
            headings += np.where(crosses & (lap % 2 == 1), np.pi, 0.0)
            lengths[crosses] = self.spacing
        elif self.kind == SQUARE:
            headings += right * number
            lengths = self.spacing * (number // 2 + 1.0)
        else:  # triangles, each begun straight on through the datum; 30 degrees on after three
            triangle, leg = np.divmod(number, 3)
            headings += right / 3 * (8 * triangle + triangle // 3 + 4 * leg)
        moves = lengths * [np.sin(headings), np.cos(headings)]
        points = np.vstack([self.start, self.start + moves.T.cumsum(axis=0)])
        is_turn = np.abs(np.sin(np.diff(headings) / 2)) > 1e-9
        turning: Floats = points[np.concatenate([[True], is_turn, [True]])]
        return turning

    def is_along(self, number: Ints) -> Flags:
        """Whether legs of a parallel track, counted from 0, lie along it; the others cross over."""
        along: Flags = self._laps(number)[1] % 2 == 0
        return along

    def _laps(self, number: Ints) -> tuple[Ints, Ints]:
        """How often the pattern was flown before each leg, and which leg of the pattern it is."""
        whole = 2 * self.legs - 1
        lap, leg = np.divmod(number, whole)
        return lap, np.where(lap % 2, whole - 1 - leg, leg)
