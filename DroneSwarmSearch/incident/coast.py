"""The coast of an incident: what is on land, and whether all that is known is."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.coast import Land
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.places import Point

ON_A_LAKE = "on a lake, give a coast that knows it, or coast 'none'"


class Coast:
    """The coast of an incident, which is read as far as persons drift.

    Args:
        incident: what is known.

    Raises:
        ImportError: a package is missing, see `geo.coast`.
        ValueError: a position is on land, farther from the sea than its error; or the file of the
            coast cannot be read.
    """

    def __init__(self, incident: Incident) -> None:
        self._incident = incident
        self._land = land = incident.land_within(incident.farthest_start)
        for each in incident.cases:
            if land is not None and isinstance(each.place, Point):
                self._check_position(each.place, land)

    def _check_position(self, known: Point, land: Land) -> None:
        inland = land.distance_to_sea(self._incident.plane.metres(*known.position))
        if inland > known.error:
            distance = f"{inland:.0f} m" if inland < 1000 else f"{inland / 1000:.0f} km"
            raise ValueError(
                "position must be at sea, or nearer to it than its error, "
                f"{known.error:g} m, got {units.radioed(known.position)}, which is "
                f"{distance} inland; {ON_A_LAKE}"
            )

    def is_sea_as_read(self, points: Floats) -> Flags:
        """Whether points, (n, 2), are at sea, and so are the nearest tenths of minutes: (n,)."""
        plane = self._incident.plane
        tenths = np.round(600 * plane.degrees(points)) / 600
        as_read = plane.metres(*tenths.T)
        is_sea: Flags = ~(self.is_land(points.T) | self.is_land(as_read.T))
        return is_sea

    @property
    def is_known(self) -> bool:
        """Whether there is a coast, and land near it."""
        return self._land is not None and not self._land.is_empty

    def is_land(self, points: Floats) -> Flags:
        """Whether points, (east, north) in metres, (2, n), are on land: bool, (n,)."""
        land = self._land
        if land is None:
            return np.zeros(points.shape[1], np.bool_)
        farthest = float(np.abs(points).max(initial=0.0))
        if farthest > land.reach:
            land = self._incident.land_within(farthest)
            assert land is not None
            self._land = land
        return land.contains(points)
