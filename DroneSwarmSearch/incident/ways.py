"""Ways around areas that a drone does not enter, and around land for boats: the shortest ones.

A shortest way around polygons has its corners at theirs: T. Lozano-Pérez, M. A. Wesley, An
algorithm for planning collision-free paths among polyhedral obstacles, Communications of the ACM
22:560 (1979).
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Pair
from DroneSwarmSearch.geo.coast import Land
from DroneSwarmSearch.geo.polygons import shapely_package

CLEARANCE = 25.0
"""Metres between an area and the corners of ways around it."""

MOST_CORNERS = 60
"""With more corners, the outlines are made coarser."""

OFF_LAND = 100.0  # metres, at least, between boats and the coast

FARTHEST_HARBOUR = 5000.0
"""Metres from the sea, within which a base on land is a harbour, with a channel to the sea."""

CHANNEL = 10.0  # the width of that channel in metres

STRAIGHT = np.zeros((0, 2))  # the corners of a straight way


class Ways:
    """Ways around areas.

    Args:
        areas: a geometry of shapely, (east, north) in metres.
        gates: points through which ways may also lead, (n, 2).
    """

    def __init__(self, areas: Any, gates: Floats = STRAIGHT) -> None:
        self.areas = areas
        self._gates = gates
        # All ways begin or end at the base.
        self._distances_from = lru_cache(maxsize=16)(self._measured_from)
        shapely_package().prepare(areas)

    def _are_clear(self, begin: Floats, ends: Floats) -> Flags:
        """Whether the straight ways from a point, (2,), to others, (n, 2), enter no area: (n,)."""
        shapely = shapely_package()
        lines = shapely.linestrings(np.stack([np.broadcast_to(begin, ends.shape), ends], axis=1))
        clear: Flags = ~shapely.intersects(self.areas, lines)
        return clear

    def is_clear(self, points: Floats) -> bool:
        """Whether a way along points, (n, 2), enters no area."""
        shapely = shapely_package()
        return not shapely.intersects(self.areas, shapely.linestrings(points))

    def around(self, begin: Floats, end: Floats) -> Floats | None:
        """The corners of the shortest way between two points: (n, 2), none if it is straight.

        None if there is no way.
        """
        if self.is_clear(np.stack([begin, end])):
            return STRAIGHT
        corners = self._corners
        from_begin = self._distances_from(tuple(begin.tolist()))
        to_end = self._distances_from(tuple(end.tolist()))
        if not corners.size:
            return None
        distances, following = self._shortest
        whole = from_begin[:, None] + distances + to_end
        first, last = np.unravel_index(whole.argmin(), whole.shape)
        if not np.isfinite(whole[first, last]):
            return None
        way = [int(first)]
        while way[-1] != last:
            way.append(int(following[way[-1], last]))
        return corners[way]

    def _measured_from(self, point: Pair) -> Floats:
        """The distance to each corner; infinite if the straight way there is not clear."""
        corners = self._corners
        distances = np.hypot(*(corners - point).T)
        return np.where(self._are_clear(np.array(point), corners), distances, np.inf)

    @cached_property
    def _corners(self) -> Floats:
        """The corners of all areas, a little outside of them: (n, 2)."""
        shapely = shapely_package()
        coarse = CLEARANCE / 5
        while True:
            wide = self.areas.buffer(CLEARANCE + coarse, join_style="mitre").simplify(coarse)
            corners: Floats = np.unique(shapely.get_coordinates(wide), axis=0)
            corners = corners[~shapely.intersects_xy(self.areas, *corners.T)]
            if len(corners) <= MOST_CORNERS:
                return np.vstack([corners, self._gates])
            coarse *= 2

    @cached_property
    def _shortest(self) -> tuple[Floats, Ints]:
        """The lengths of the shortest ways between corners, and the corner that follows on each.

        R. W. Floyd, Algorithm 97: shortest path, Communications of the ACM 5:345 (1962).
        """
        corners = self._corners
        distances = np.array([self._measured_from(corner) for corner in corners])
        following = np.broadcast_to(np.arange(len(corners)), distances.shape).copy()
        np.fill_diagonal(distances, 0.0)
        for middle in range(len(corners)):
            through = distances[:, [middle]] + distances[middle]
            is_shorter = through < distances
            distances = np.where(is_shorter, through, distances)
            following = np.where(is_shorter, following[:, [middle]], following)
        return distances, following


@lru_cache(maxsize=8)
def ways_at_sea(land: Land, base: Pair) -> Ways:
    """Ways of boats around the land, which are kept for the next plan.

    A base on land, or close to it, has a channel to the nearest sea.

    Args:
        land: there must be some.
        base: of the boat, (east, north) in metres.

    Raises:
        ValueError: the base is far from the sea.
    """
    shapely = shapely_package()
    shore = land.shape.buffer(1.5 * OFF_LAND, quad_segs=2).simplify(OFF_LAND / 2)
    harbour = shapely.Point(base)
    if not shore.intersects(harbour):
        return Ways(shore)
    to_sea = shapely.shortest_line(harbour, shapely.boundary(shore))
    if to_sea.length > FARTHEST_HARBOUR:
        raise ValueError(
            f"base of a boat must be at most {FARTHEST_HARBOUR / 1000:g} km from the sea, got one "
            f"that is {to_sea.length / 1000:.0f} km inland"
        )
    begin, end = shapely.get_coordinates(to_sea)
    outwards = (end - begin) / max(to_sea.length, 1e-9)
    gate = end + CHANNEL * outwards
    channel = shapely.linestrings([begin, gate]).buffer(CHANNEL / 2)
    return Ways(shore.difference(channel), gate[None])
