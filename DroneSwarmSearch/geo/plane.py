"""A plane that touches the earth: positions in degrees as metres east and north, and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Floats

EQUATOR = 6378137.0
ECCENTRICITY2 = 0.00669437999014
"""Of the WGS 84 ellipsoid: the radius in metres, and the square of the eccentricity."""


class TangentPlane:
    """The plane that touches the WGS 84 ellipsoid at a position; points are projected upright.

    Up to 50 km from the position, distances are at most 0.6 m too short, and up to 100 km, 4.2 m.

    Args:
        latitude: of the position, in degrees.
        longitude: in degrees.

    Attributes:
        origin: the position (latitude, longitude).
    """

    def __init__(self, latitude: float, longitude: float) -> None:
        self.origin = float(latitude), float(longitude)
        phi, lam = np.radians(self.origin)
        self._origin = _geocentric(latitude, longitude)
        east = -np.sin(lam), np.cos(lam), 0.0
        north = -np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)
        self._axes = np.array([east, north, np.cross(east, north)])

    def metres(self, latitude: ArrayLike, longitude: ArrayLike) -> Floats:
        """Positions in degrees, (...), as metres (east, north): float64, (..., 2)."""
        away: Floats = (_geocentric(latitude, longitude) - self._origin) @ self._axes[:2].T
        return away

    def distance(self, latitude: float, longitude: float) -> float:
        """The distance of a position in metres; through the earth, but right also when far away."""
        return float(np.linalg.norm(_geocentric(latitude, longitude) - self._origin))

    def degrees(self, metres: ArrayLike) -> Floats:
        """Metres (east, north), (..., 2), as (latitude, longitude) in degrees, of that shape."""
        # The height over the plane at which the ellipsoid is, by a quadratic equation.
        squash = np.array([1.0, 1.0, 1.0 / (1.0 - ECCENTRICITY2)])
        below = self._origin + np.asarray(metres) @ self._axes[:2]
        up = self._axes[2]
        a = squash @ up**2
        b = (below * squash) @ up
        c = below**2 @ squash - EQUATOR**2
        point = below + ((np.sqrt(b**2 - a * c) - b) / a)[..., None] * up
        across = np.hypot(point[..., 0], point[..., 1])
        latitude = np.arctan2(point[..., 2], (1.0 - ECCENTRICITY2) * across)
        longitude = np.arctan2(point[..., 1], point[..., 0])
        degrees: Floats = np.degrees(np.stack([latitude, longitude], axis=-1))
        return degrees


def _geocentric(latitude: ArrayLike, longitude: ArrayLike) -> Floats:
    """Positions on the ellipsoid in metres from the centre of the earth: float64, (..., 3)."""
    phi = np.radians(latitude)
    lam = np.radians(longitude)
    across = EQUATOR / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(phi) ** 2)
    x, y = np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam)
    point = np.stack(np.broadcast_arrays(x, y, (1.0 - ECCENTRICITY2) * np.sin(phi)), axis=-1)
    geocentric: Floats = across[..., None] * point
    return geocentric
