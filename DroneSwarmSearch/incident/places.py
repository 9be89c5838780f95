"""Where an accident may have been: around a point, on a line, or in an area."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.polygons import Polygon, on_plane, polygons_of, shapely_package

SDS = 4.0  # standard deviations, beyond which nobody is

FEWEST_DRAWN = 1000


class Starts(NamedTuple):
    """Where and when persons begin to drift.

    Attributes:
        points: (east, north) in metres, (2, n).
        shares: of the window of time that has passed, from 0 to 1: (n,); None if any moment is as
            likely, wherever they are.
    """

    points: Floats
    shares: Floats | None = None


class Place(ABC):
    """Where an accident may have been; all metres are on the plane of the incident.

    Attributes:
        label: what it is called on maps.
    """

    label: ClassVar[str]

    @property
    @abstractmethod
    def middle(self) -> Pair:
        """A position in the middle, in degrees."""

    @abstractmethod
    def reach(self, plane: TangentPlane) -> float:
        """The distance in metres from the origin of a plane, within which everybody starts."""

    @abstractmethod
    def draw(self, plane: TangentPlane, rng: np.random.Generator, n: int) -> Starts:
        """Draw n starts."""

    @abstractmethod
    def outlines(self, plane: TangentPlane) -> list[Floats]:
        """A point, lines or closed outlines, (east, north) in metres: (n, 2) each."""

    @property
    @abstractmethod
    def words(self) -> str:
        """Where it is, such as "at 54°10.8'N 007°51.0'E"."""

    @property
    @abstractmethod
    def error_words(self) -> str:
        """How well it is known, such as "The position is known to 926 m"."""


@dataclass(frozen=True)
class Point(Place):
    """A position with a normal error.

    Attributes:
        position: (latitude, longitude) in degrees.
        error: the standard deviation along each axis, in metres.
    """

    position: Pair
    error: float
    label = "last known position"

    @property
    def middle(self) -> Pair:
        return self.position

    def reach(self, plane: TangentPlane) -> float:
        return plane.distance(*self.position) + SDS * self.error

    def draw(self, plane: TangentPlane, rng: np.random.Generator, n: int) -> Starts:
        middle = plane.metres(*self.position)[:, None]
        return Starts(middle + rng.normal(0.0, self.error, (2, n)))

    def outlines(self, plane: TangentPlane) -> list[Floats]:
        return [plane.metres(*self.position)[None]]

    @property
    def words(self) -> str:
        return f"at {units.radioed(self.position)}"

    @property
    def error_words(self) -> str:
        return f"The position is known to {self.error:.0f} m"


@dataclass(frozen=True)
class Sighting(Place):
    """What an observer saw in a bearing and at a distance, such as a flare.

    Attributes:
        observer: (latitude, longitude) in degrees.
        error: the standard deviation of the observer's position along each axis, in metres.
        bearing: in degrees clockwise from north.
        bearing_error: its standard deviation.
        distance: in metres.
        distance_error: its standard deviation.
    """

    observer: Pair
    error: float
    bearing: float
    bearing_error: float
    distance: float
    distance_error: float
    label = "sighting"

    def _seen(self, bearings: Floats, distances: Floats) -> Floats:
        """Positions in bearings and at distances from the observer, in degrees: (n, 2)."""
        angles = np.radians(bearings)
        away = distances * np.stack([np.sin(angles), np.cos(angles)])
        return TangentPlane(*self.observer).degrees(away.T)

    @property
    def middle(self) -> Pair:
        seen = self._seen(np.array([self.bearing]), np.array([self.distance]))
        latitude, longitude = seen[0].tolist()
        return latitude, longitude

    def reach(self, plane: TangentPlane) -> float:
        far = self.distance + SDS * (self.distance_error + self.error)
        return plane.distance(*self.observer) + far

    def draw(self, plane: TangentPlane, rng: np.random.Generator, n: int) -> Starts:
        bearings = rng.normal(self.bearing, self.bearing_error, n)
        distances = np.abs(rng.normal(self.distance, self.distance_error, n))
        off = rng.normal(0.0, self.error, (2, n))
        seen = plane.metres(*self._seen(bearings, distances).T).T
        return Starts(seen + off)

    def outlines(self, plane: TangentPlane) -> list[Floats]:
        ends = self._seen(np.full(2, self.bearing), np.array([0.0, self.distance]))
        return [plane.metres(*ends.T)]

    @property
    def words(self) -> str:
        away = self.distance / 1852
        return f"seen {self.bearing:03.0f}° {away:.1f} NM from {units.radioed(self.observer)}"

    @property
    def error_words(self) -> str:
        return (
            f"The bearing is known to {self.bearing_error:g}°, the distance to "
            f"{self.distance_error:.0f} m and the observer's position to {self.error:.0f} m"
        )


@dataclass(frozen=True)
class Line(Place):
    """A passage along a line, which is as likely to have ended at any of its points.

    Attributes:
        positions: two or more, (latitude, longitude) in degrees; the first one at the beginning of
            the window of time, and the last one at its end.
        error: the standard deviation of the distance from the line along each axis, in metres.
    """

    positions: tuple[Pair, ...]
    error: float
    label = "passage"

    @property
    def middle(self) -> Pair:
        plane = TangentPlane(*self.positions[0])
        half_way = self._along(plane, np.array([0.5]))
        latitude, longitude = plane.degrees(half_way.T)[0].tolist()
        return latitude, longitude

    def _along(self, plane: TangentPlane, shares: Floats) -> Floats:
        """Positions after shares of the way: (2, n)."""
        corners = self.outlines(plane)[0]
        lengths = np.hypot(*np.diff(corners, axis=0).T)
        ends = np.append(0.0, lengths.cumsum()) / lengths.sum()
        return np.stack([np.interp(shares, ends, axis) for axis in corners.T])

    def reach(self, plane: TangentPlane) -> float:
        farthest = max(plane.distance(*position) for position in self.positions)
        return farthest + SDS * self.error

    def draw(self, plane: TangentPlane, rng: np.random.Generator, n: int) -> Starts:
        shares = rng.random(n)
        off = rng.normal(0.0, self.error, (2, n))
        return Starts(self._along(plane, shares) + off, shares)

    def outlines(self, plane: TangentPlane) -> list[Floats]:
        return [plane.metres(*np.array(self.positions).T)]

    @property
    def words(self) -> str:
        return f"between {' and '.join(map(units.radioed, self.positions))}"

    @property
    def error_words(self) -> str:
        return f"The line is known to {self.error:.0f} m"


@dataclass(frozen=True)
class Area(Place):
    """An area, in which every place is as likely.

    Attributes:
        polygons: in degrees, a geometry of shapely.
        error: the standard deviation along each axis with which its outline is known, in metres.
    """

    polygons: Any
    error: float
    label = "area"

    @cached_property
    def middle(self) -> Pair:
        longitude, latitude = shapely_package().get_coordinates(self.polygons)[0].tolist()
        plane = TangentPlane(latitude, longitude)  # on it, there is no date line
        middle = self._on(plane).centroid
        latitude, longitude = plane.degrees((middle.x, middle.y)).tolist()
        return latitude, longitude

    def _on(self, plane: TangentPlane) -> Any:
        """The polygons on a plane."""
        return on_plane(self.polygons, plane)

    def outlines(self, plane: TangentPlane) -> list[Floats]:
        polygons: list[Polygon] = polygons_of(self._on(plane))
        return [outline for polygon in polygons for outline in polygon]

    def reach(self, plane: TangentPlane) -> float:
        corners = np.vstack(self.outlines(plane))
        return float(np.hypot(*corners.T).max()) + SDS * self.error

    def draw(self, plane: TangentPlane, rng: np.random.Generator, n: int) -> Starts:
        shape = self._on(plane)
        west, south, east, north = shape.bounds
        contains_xy = shapely_package().contains_xy
        found = np.empty((2, 0))
        while found.shape[1] < n:
            count = max(2 * n, FEWEST_DRAWN)
            points = rng.uniform([[west], [south]], [[east], [north]], (2, count))
            found = np.hstack([found, points[:, contains_xy(shape, *points)]])
        off = rng.normal(0.0, self.error, (2, n))
        return Starts(found[:, :n] + off)

    @property
    def words(self) -> str:
        plane = TangentPlane(*self.middle)
        square_miles = self._on(plane).area / 1852**2
        return f"in an area of {square_miles:.1f} NM² around {units.radioed(self.middle)}"

    @property
    def error_words(self) -> str:
        if not self.error:
            return "Every place in the area is as likely"
        return f"Every place in the area is as likely, and its outline known to {self.error:.0f} m"
