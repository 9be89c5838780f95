"""Coasts: which positions are on land, and how far it is to the sea.

The coastline is GSHHG in full resolution (P. Wessel, W. H. F. Smith, A global, self-consistent,
hierarchical, high-resolution shoreline database, Journal of Geophysical Research 101:8741, 1996),
from the package roaring-landmask: it knows islands of some ten metres, but no lakes. Or it is a
GeoJSON file with polygons of land. Needs shapely and platformdirs (the extra "plan").
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Flags, Pair
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.files import StorageError, write_bytes
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.polygons import (
    Polygon,
    on_plane,
    polygons_of,
    read_polygons,
    shapely_package,
)

GSHHG = "gshhg"
"""The name of the packaged coastline."""

NONE = "none"
"""The name of the sea without land."""

NO_PACKAGE = (
    "the coast needs the package roaring-landmask; without it, give coast as a GeoJSON file with "
    "polygons of land, or as 'none'"
)

SQUARES = 200
"""Squares along each side of an area that are known to be at sea, on land, or on the coast."""

KM_PER_DEGREE = 111.0  # of latitude
LONGEST_EDGE = 0.2  # of a polygon, in degrees

DECIMALS = 6  # of degrees, a tenth of a metre

Box = tuple[float, float, float, float]
"""West, south, east and north, in degrees."""


@dataclass(frozen=True, eq=False)
class Land:
    """The land around a position, as polygons on its plane.

    Attributes:
        shape: the polygons, a geometry of shapely; (east, north) in metres.
        plane: the plane.
        reach: how far it is known, to each side of the position, in metres.
    """

    shape: Any
    plane: TangentPlane
    reach: float

    def contains(self, points: ArrayLike) -> Flags:
        """Whether points, (east, north) in metres, (2, n), are on land: bool, (n,)."""
        shapely = shapely_package()
        x, y = np.asarray(points, np.float64)
        side = 2 * self.reach / SQUARES
        column = np.clip(np.floor((x + self.reach) / side), 0, SQUARES - 1).astype(np.int64)
        row = np.clip(np.floor((y + self.reach) / side), 0, SQUARES - 1).astype(np.int64)
        on_land, on_coast = self._squares
        inside: Flags = on_land[row, column]
        unsure = on_coast[row, column].nonzero()[0]
        if unsure.size:
            inside[unsure] = shapely.contains_xy(self.shape, x[unsure], y[unsure])
        return inside

    @cached_property
    def _squares(self) -> tuple[Flags, Flags]:
        """Which squares are on land, and which on the coast: bool, [row, column] from south-west.

        Most points are in neither, and need no test against the polygons.
        """
        shapely = shapely_package()
        shapely.prepare(self.shape)
        edges = np.linspace(-self.reach, self.reach, SQUARES + 1)
        west, south = np.meshgrid(edges[:-1], edges[:-1])
        east, north = np.meshgrid(edges[1:], edges[1:])
        squares = shapely.box(west, south, east, north)
        touched = shapely.intersects(self.shape, squares)
        on_land = np.zeros_like(touched)
        on_land[touched] = shapely.contains_properly(self.shape, squares[touched])
        return on_land, touched & ~on_land

    def distance_to_sea(self, point: ArrayLike) -> float:
        """The distance of a point, (east, north) in metres, to the sea; 0 at sea.

        At most `reach`, beyond which nothing is known.
        """
        shapely = shapely_package()
        x, y = np.asarray(point, np.float64)
        if not self.contains([[x], [y]])[0]:
            return 0.0
        return min(float(shapely.boundary(self.shape).distance(shapely.Point(x, y))), self.reach)

    @property
    def is_empty(self) -> bool:
        """Whether there is no land."""
        return bool(self.shape.is_empty)

    def polygons(self, low: ArrayLike, high: ArrayLike) -> list[Polygon]:
        """The polygons of land between two corners, (east, north) in metres."""
        shapely = shapely_package()
        west, south = np.asarray(low)
        east, north = np.asarray(high)
        return polygons_of(shapely.clip_by_rect(self.shape, west, south, east, north))

    def polygons_in_degrees(self, low: ArrayLike, high: ArrayLike) -> list[Polygon]:
        """The same as (longitude, latitude), cut at the date line (RFC 7946, section 3.1.9)."""
        shapely = shapely_package()
        middle = self.plane.origin[1]
        parts = []
        for outlines in self.polygons(low, high):
            rings = []
            for outline in outlines:
                latitude, longitude = self.plane.degrees(outline).T
                longitude = middle + (longitude - middle + 180) % 360 - 180
                rings.append(np.stack([longitude, latitude], axis=-1).round(DECIMALS))
            polygon = shapely.make_valid(shapely.Polygon(rings[0], rings[1:]))
            for turn in (-360, 0, 360):
                part = shapely.clip_by_rect(polygon, turn - 180, -90, turn + 180, 90)
                parts += [
                    [outline - (turn, 0) for outline in outlines] for outlines in polygons_of(part)
                ]
        return parts


def land_around(coast: str, position: Pair, reach: float) -> Land | None:
    """The land around a position.

    Args:
        coast: "gshhg"; a GeoJSON file with polygons of land; or "none".
        position: (latitude, longitude) in degrees.
        reach: how far to each side, in metres.

    Returns:
        The land; None if `coast` is "none".

    Raises:
        ImportError: a package is missing.
        ValueError: the file cannot be read, or holds no polygons in degrees.
    """
    if coast == NONE:
        return None
    shapely = shapely_package()
    boxes = _boxes(position, reach)
    if coast == GSHHG:
        parts = _gshhg(boxes)
    else:
        what = "coast must be 'gshhg', 'none' or a GeoJSON file with polygons of land"
        polygons = read_polygons(what, Path(coast))
        parts = [shapely.clip_by_rect(polygons, *box) for box in boxes]
    plane = TangentPlane(*position)
    # Long edges along the boxes are bent on the plane.
    bent = [shapely.segmentize(part, LONGEST_EDGE) for part in parts]
    projected = [shapely.make_valid(on_plane(part, plane)) for part in bent]
    return Land(shapely.union_all(projected), plane, reach)


def _boxes(position: Pair, reach: float) -> list[Box]:
    """The area in whole degrees; two parts at the date line."""
    latitude, longitude = position
    degrees = 1.05 * reach / 1000 / KM_PER_DEGREE
    south = max(math.floor(latitude - degrees), -90)
    north = min(math.ceil(latitude + degrees), 90)
    farthest = max(abs(south), abs(north))  # from the equator, where a degree is shortest
    across = 180.0
    if farthest < 89:
        across = degrees / math.cos(math.radians(farthest))
    if across >= 180:
        return [(-180, south, 180, north)]
    west = math.floor(longitude - across)
    east = math.ceil(longitude + across)
    if west < -180:
        return [(-180, south, east, north), (west + 360, south, 180, north)]
    if east > 180:
        return [(west, south, 180, north), (-180, south, east - 360, north)]
    return [(west, south, east, north)]


def _gshhg(boxes: list[Box]) -> list[Any]:
    """The packaged land in some boxes; kept in the cache, since reading all takes seconds."""
    shapely = shapely_package()
    package = needed("roaring_landmask", NO_PACKAGE, "plan")
    platformdirs = needed("platformdirs", "the coast needs the package platformdirs", "plan")
    folder = Path(platformdirs.user_cache_dir("DroneSwarmSearch", appauthor=False))
    name = f"{GSHHG}-{version('roaring-landmask')}"
    paths = [folder / f"{name}_{'_'.join(f'{edge:g}' for edge in box)}.wkb" for box in boxes]
    with contextlib.suppress(OSError, shapely.errors.ShapelyError):
        return [shapely.from_wkb(path.read_bytes()) for path in paths]
    everything = shapely.from_wkb(bytes(package.Shapes.wkb(package.LandmaskProvider.Gshhg)))
    parts = [shapely.clip_by_rect(everything, *box) for box in boxes]
    with contextlib.suppress(StorageError):  # it only takes longer the next time
        for path, part in zip(paths, parts, strict=True):
            write_bytes(path, shapely.to_wkb(part))
    return parts
