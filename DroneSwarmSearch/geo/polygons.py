"""Polygons in degrees, from GeoJSON files (RFC 7946) and as outlines; needs shapely."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.files import parsed_json
from DroneSwarmSearch.geo.plane import TangentPlane

Polygon = list[Floats]
"""The outline of a polygon, counterclockwise, and those of its holes, clockwise: (n, 2) each."""


def shapely_package() -> Any:
    """The package shapely, of the extra "plan"."""
    return needed("shapely", "coasts and areas need the package shapely", "plan")


def on_plane(degrees: Any, plane: TangentPlane) -> Any:
    """A geometry of shapely in degrees, (longitude, latitude), in metres (east, north)."""

    def in_metres(points: Floats) -> Floats:
        return plane.metres(points[:, 1], points[:, 0])

    return shapely_package().transform(degrees, in_metres)


def polygons_of(geometry: Any) -> list[Polygon]:
    """The polygons in a geometry of shapely."""
    shapely = shapely_package()
    return [
        [shapely.get_coordinates(ring) for ring in (each.exterior, *each.interiors)]
        for each in map(shapely.geometry.polygon.orient, _only_polygons(geometry))
    ]


def _only_polygons(geometry: Any) -> list[Any]:
    """The parts of a geometry that have an area."""
    shapely = shapely_package()
    parts = shapely.get_parts(shapely.get_parts(geometry))
    return [each for each in parts if each.geom_type == "Polygon" and not each.is_empty]


def read_polygons(what: str, path: Path) -> Any:
    """The union of the polygons in a GeoJSON file, a geometry of shapely in degrees.

    Args:
        what: what the file must be, for messages.
        path: the file.

    Raises:
        ImportError: shapely is missing.
        ValueError: the file cannot be read, or holds no polygons in degrees.
    """
    shapely = shapely_package()
    what = f"{what}; {str(path)!r}"
    try:
        data = parsed_json(path.read_bytes())
    except OSError as error:
        raise ValueError(f"{what} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ValueError(f"{what} cannot be read: {error}") from None
    polygons = []
    for geometry in _geometries(data):
        try:
            shape = shapely.geometry.shape(geometry)
        except Exception as error:  # shapely raises errors of many kinds
            raise ValueError(f"{what} holds what is no geometry: {error!r:.200}") from None
        if shape.geom_type not in ("Polygon", "MultiPolygon"):
            raise ValueError(f"{what} holds a {shape.geom_type}, not only polygons")
        polygons.append(shapely.make_valid(shape))
    if not polygons:
        raise ValueError(f"{what} holds no polygons")
    union = shapely.union_all(polygons)
    west, south, east, north = union.bounds
    if not (west >= -180 and east <= 180 and south >= -90 and north <= 90):
        raise ValueError(
            f"{what} must be in degrees, longitude first, got values from ({west:g}, {south:g}) "
            f"to ({east:g}, {north:g})"
        )
    return union


def _geometries(data: Any) -> list[Any]:
    """The geometries of a GeoJSON object (RFC 7946)."""
    if not isinstance(data, dict):
        return []
    kind = data.get("type")
    if kind == "FeatureCollection":
        return [each for feature in data.get("features", ()) for each in _geometries(feature)]
    if kind == "Feature":
        return _geometries(data.get("geometry"))
    if kind == "GeometryCollection":
        return [each for part in data.get("geometries", ()) for each in _geometries(part)]
    return [data]
