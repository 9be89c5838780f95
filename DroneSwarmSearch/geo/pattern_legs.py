"""The geometry of the search patterns of the IAMSAR Manual: how their legs turn, and how long.

A pattern is a number of straight legs. The *turn* of a leg is its direction relative to the first
leg: degrees to the right, for a pattern that begins with a turn to the right.

Source: International Aeronautical and Maritime Search and Rescue Manual, volume II, IMO and ICAO,
chapter on search techniques; sweeps at equal spacing go back to B. O. Koopman, Search and
Screening, 1946.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Floats, Ints


class Legs(NamedTuple):
    """Legs of a pattern: their turns in degrees, and their lengths; float64, (n,)."""

    turns: Floats
    lengths: Floats


def parallel_legs(numbers: Ints, length: float, spacing: float) -> Legs:
    """Parallel legs in alternating directions; every second leg crosses over to the next line.

    Along the longer side of an area, this is the parallel sweep search, PS; along the shorter
    side, the creeping line search, CS. `numbers` are those of the legs, from 0 on.
    """
    is_along = numbers % 2 == 0
    line = numbers // 2
    turns: Floats = np.where(is_along, 180.0 * (line % 2), 90.0)
    lengths: Floats = np.where(is_along, length, spacing)
    return Legs(turns, lengths)


def square_legs(numbers: Ints, spacing: float) -> Legs:
    """The expanding square search, SS: legs of S, S, 2S, 2S, 3S, 3S…, with turns of 90°."""
    turns = (90 * numbers).astype(np.float64)
    lengths = spacing * (numbers // 2 + 1).astype(np.float64)
    return Legs(turns, lengths)


def sector_legs(numbers: Ints, radius: float) -> Legs:
    """The sector search, VS: triangles through the datum, with turns of 120°.

    Over the datum the track continues straight into the next triangle. After three triangles, in
    nine legs, it begins again, turned by 30°.
    """
    triangle, leg = np.divmod(numbers, 3)
    turns = 240.0 * triangle + 120.0 * leg + 30.0 * (triangle // 3)
    return Legs(turns, np.full(len(numbers), float(radius)))


def turning_points(start: ArrayLike, headings: Floats, lengths: Floats) -> Floats:
    """The start and the end of each leg, (east, north): float64, (n + 1, 2).

    Headings are in radians, clockwise from north.
    """
    moves = (lengths * [np.sin(headings), np.cos(headings)]).T
    points: Floats = np.vstack([start, moves]).cumsum(axis=0)
    return points
