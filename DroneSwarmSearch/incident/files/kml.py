"""KML 2.2: flights, waypoints, and the map at the start of the search as pictures on the ground."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.geo.polygons import Polygon
from DroneSwarmSearch.incident.files.lines import (
    Line,
    land_of,
    mark_in_degrees,
    point_of,
    split,
    utc,
)
from DroneSwarmSearch.incident.files.xml import add, as_bytes
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import Waypoint
from DroneSwarmSearch.rendering.palette import drone_colour

MAP = (230, 0, 130)
"""The colour of the probability: visible on a dark and on a light chart, and no drone's."""

SHORE = "ff404040"
LAND = "40404040"
"""Colours of lines and of land: opacity, blue, green and red."""


class Overlay(NamedTuple):
    """A picture of the map, and its edges in degrees.

    Attributes:
        name: of its file.
        box: north, south, east and west.
        png: the content of the file.
    """

    name: str
    box: dict[str, float]
    png: bytes


def kml(plan: FlightPlan, overlays: list[Overlay]) -> bytes:
    """The content of plan.kml."""
    root = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = add(root, "Document", name="flight plan", description=plan.incident.sentence)
    for overlay in overlays:
        add(
            document,
            "GroundOverlay",
            name="probability at the start of the search",
            Icon={"href": overlay.name},
            LatLonBox=overlay.box,
        )
    land = land_of(plan)
    if land:
        _add_land(document, land)
    for mark in [*plan.incident.marks, *plan.incident.no_fly_marks]:
        line = mark_in_degrees(plan, mark)
        kind = "Point" if len(line) == 1 else "LineString"
        add(document, "Placemark", name=mark.name, **{kind: _shape(line, 0)})
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        folder = add(document, "Folder", name=plan.incident.craft[drone - 1].label)
        _add_flight(folder, drone, flight, order)
    return as_bytes(root)


def _add_land(document: ET.Element, land: list[Polygon]) -> None:
    """The polygons of land, flat on the ground."""
    style = {"LineStyle": {"color": SHORE, "width": 2}, "PolyStyle": {"color": LAND}}
    placemark = add(document, "Placemark", name="land", Style=style)
    parent = add(placemark, "MultiGeometry")
    for outlines in land:
        polygon = add(parent, "Polygon")
        for number, outline in enumerate(outlines):
            border = add(polygon, "innerBoundaryIs" if number else "outerBoundaryIs")
            add(border, "LinearRing", coordinates=_coordinates(outline.tolist(), 0))


def _add_flight(folder: ET.Element, drone: int, flight: list[Waypoint], order: str) -> None:
    """A line, and a point for each waypoint."""
    blue_green_red = bytes(drone_colour(drone - 1)[::-1]).hex()
    colour = f"ff{blue_green_red}"
    style = {
        "IconStyle": {"color": colour, "scale": 0.5},
        "LineStyle": {"color": colour, "width": 2},
    }
    parent = add(folder, "Placemark", name=order, Style=style)
    lines = split(flight)
    if len(lines) > 1:
        parent = add(parent, "MultiGeometry")
    for line in lines:
        add(parent, "LineString", **_shape(line, flight[0].altitude))
    for number, (now, after) in enumerate(pairwise([*flight, flight[-1]])):
        add(
            folder,
            "Placemark",
            name=f"{drone}-{number:02d}",
            TimeSpan={"begin": utc(now.time), "end": utc(after.time)},
            Style=style,
            Point=_shape([point_of(now)], now.altitude),
        )


def _shape(line: Line, altitude: float) -> dict[str, str]:
    """The elements of a point or line, at an altitude in metres above the sea."""
    return {"altitudeMode": "relativeToGround", "coordinates": _coordinates(line, altitude)}


def _coordinates(line: Iterable[Sequence[float]], altitude: float) -> str:
    """Positions as text."""
    return " ".join(f"{x:.7f},{y:.7f},{altitude}" for x, y in line)


def overlays_of(plan: FlightPlan) -> list[Overlay]:
    """The map at the start, in two parts at the date line.

    The edges are the parallels and meridians through the middles of the map's edges. Up to d
    from the last known position, corners are off by 1.1 d² tan(latitude) / R, where R is the radius
    of the earth: by 30 m for 10 km at 60 degrees.
    """
    matrix, (left, bottom), (right, top) = plan.density(plan.on_scene)
    middle_x = (left + right) / 2
    middle_y = (bottom + top) / 2
    ends = [(middle_x, top), (middle_x, bottom), (left, middle_y), (right, middle_y)]
    degrees = plan.incident.plane.degrees(ends)
    north, south = degrees[:2, 0].tolist()
    west, east = degrees[2:, 1].tolist()

    def overlay(name: str, first: int, last: int, west: float, east: float) -> Overlay:
        box = {"north": north, "south": south, "east": east, "west": west}
        return Overlay(name, box, _png(matrix[:, first:last], float(matrix.max())))

    size = len(matrix)
    if west <= east:
        return [overlay("overlay.png", 0, size, west, east)]
    # KML allows no longitude beyond 180 degrees.
    cut = min(max(round((180 - west) / (360 + east - west) * size), 1), size - 1)
    return [
        overlay("overlay_west.png", 0, cut, west, 180.0),
        overlay("overlay_east.png", cut, size, -180.0, east),
    ]


def _png(matrix: Floats, maximum: float) -> bytes:
    """A picture of probabilities, as opaque as they are high."""
    import pygame

    height, width = matrix.shape
    pixels = np.full((height, width, 4), (*MAP, 0), np.uint8)
    pixels[..., 3] = np.rint(255 * matrix / maximum)
    picture = pygame.image.frombuffer(pixels.tobytes(), (width, height), "RGBA")
    file = io.BytesIO()
    pygame.image.save(picture, file, ".png")
    return file.getvalue()
