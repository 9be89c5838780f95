"""The files of a flight plan: GPX, KML, GeoJSON and CSV; flights from a CSV file."""

from __future__ import annotations

import csv
import io
import json
import math
import xml.etree.ElementTree as ET
from datetime import datetime
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.files import csv_cell, csv_rows, write_bytes, write_text
from DroneSwarmSearch.geo.times import in_utc
from DroneSwarmSearch.incident.flights import Flight, Waypoint, track
from DroneSwarmSearch.incident.planned_flights import PlannedFlights
from DroneSwarmSearch.rendering.palette import drone_colour

MAP = 230, 0, 130
"""The colour of the probability: visible on a dark and on a light chart, and no drone's."""

Line = list[tuple[float, float]]


def save(plan: PlannedFlights, folder: Path) -> None:
    """Write plan.gpx, plan.kml with its map overlay.png, plan.geojson and plan.csv."""
    overlays = _write_overlays(plan, folder)
    for name, root in (("plan.gpx", _gpx(plan)), ("plan.kml", _kml(plan, overlays))):
        ET.indent(root)
        write_bytes(folder / name, ET.tostring(root, "utf-8", xml_declaration=True))
    collection = {"type": "FeatureCollection", "features": _features(plan)}
    write_text(folder / "plan.geojson", json.dumps(collection) + "\n")
    write_text(folder / "plan.csv", _csv(plan))


def read_csv(path: Path) -> list[tuple[list[str], list[Waypoint]]]:
    """The waypoints of each drone, planned or really flown, from a file such as plan.csv.

    It needs the columns drone, time_utc, latitude_deg and longitude_deg. Without the column
    searching, drones search on all legs; without altitude_m, they are at 0 m.

    Returns:
        For each drone, the lines of its waypoints in words, and the waypoints.

    Raises:
        OSError: the file cannot be read.
        ValueError: a column is missing, a value is wrong, the times of a drone do not increase, or
            there is no waypoint.
    """
    flights: dict[int, tuple[list[str], list[Waypoint]]] = {}
    for number, row in csv_rows(path):
        line = f"{path}, line {number}"
        drone, waypoint = _read_row(line, row)
        lines, flight = flights.setdefault(drone, ([], []))
        if flight and waypoint.time <= flight[-1].time:
            raise ValueError(f"{line}: time_utc must increase, got {row['time_utc']!r}")
        lines.append(line)
        flight.append(waypoint)
    if not flights:
        raise ValueError(f"{path} must hold waypoints, one per line, got none")
    return [flights[drone] for drone in sorted(flights)]


def _read_row(line: str, row: dict[str, Any]) -> tuple[int, Waypoint]:
    """The drone and the waypoint of a row."""
    row = {"altitude_m": "0", "searching": "true", **row}
    values = []
    for name, (parse, what) in PARSERS.items():
        given = row.get(name, "no such column")
        try:
            values.append(parse(given))
        except ValueError:
            raise ValueError(f"{line}: {name} must be {what}, got {given!r:.100}") from None
    drone, *rest = values
    return drone, Waypoint(*rest)


PARSERS: dict[str, Any] = {
    "drone": (lambda text: checks.integer("", int(text), 0), "a whole number of at least 0"),
    "time_utc": (partial(in_utc, "time_utc"), "a time with its zone, such as 2026-03-01T05:30:00Z"),
    "latitude_deg": (lambda text: checks.real("", float(text), -90, 90), "from -90 to 90"),
    "longitude_deg": (lambda text: checks.real("", float(text), -180, 180), "from -180 to 180"),
    "altitude_m": (lambda text: checks.real("", float(text)), "a number"),
    "searching": (lambda text: bool(("false", "true").index(text.lower())), "true or false"),
}
"""How to read the columns that become a `Waypoint`, and what they must be."""


def _gpx(plan: PlannedFlights) -> ET.Element:
    """GPX 1.1, with a route for each drone."""
    space = {"xmlns": "http://www.topografix.com/GPX/1/1", "version": "1.1"}
    root = ET.Element("gpx", space, creator="DroneSwarmSearch")
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        route = _add(root, "rte", name=f"drone {drone}", desc=order)
        for number, waypoint in enumerate(flight):
            name, time = f"{drone}-{number:02d}", _utc(waypoint.time)
            point = _add(route, "rtept", ele=waypoint.altitude, time=time, name=name)
            point.attrib = {"lat": f"{waypoint.latitude:.7f}", "lon": f"{waypoint.longitude:.7f}"}
    return root


def _kml(plan: PlannedFlights, overlays: dict[str, dict[str, float]]) -> ET.Element:
    """KML 2.2, with flights, waypoints, and the map at the start of the search."""
    root = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = _add(root, "Document", name="flight plan", description=plan.incident.sentence)
    for name, box in overlays.items():
        what = "probability at the start of the search"
        _add(document, "GroundOverlay", name=what, Icon={"href": name}, LatLonBox=box)
    known = _shape([plan.incident.position[::-1]], 0)
    _add(document, "Placemark", name="last known position", Point=known)
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        colour = "ff" + bytes(drone_colour(drone - 1)[::-1]).hex()
        icon, line = {"color": colour, "scale": 0.5}, {"color": colour, "width": 2}
        style = {"IconStyle": icon, "LineStyle": line}
        folder = _add(document, "Folder", name=f"drone {drone}")
        parent = _add(folder, "Placemark", name=order, Style=style)
        lines = _split(flight)
        if len(lines) > 1:
            parent = _add(parent, "MultiGeometry")
        for strip in lines:
            _add(parent, "LineString", **_shape(strip, flight[0].altitude))
        for number, (now, after) in enumerate(pairwise([*flight, flight[-1]])):
            span = {"begin": _utc(now.time), "end": _utc(after.time)}
            name, point = f"{drone}-{number:02d}", _shape(_points([now]), now.altitude)
            _add(folder, "Placemark", name=name, TimeSpan=span, Style=style, Point=point)
    return root


def _write_overlays(plan: PlannedFlights, folder: Path) -> dict[str, dict[str, float]]:
    """Write the map at the start as PNG, in two parts at the date line; its edges, by file.

    The edges are the parallels and meridians through the middles of the map's edges. Up to d
    from the last known position, corners are off by 1.1 d² tan(latitude) / R, where R is the radius
    of the earth: by 30 m for 10 km at 60 degrees.
    """
    import pygame

    matrix, (west, south), (east, north) = plan.density(plan.on_scene)
    size, middle = len(matrix), ((west + east) / 2, (south + north) / 2)
    ends = [(middle[0], north), (middle[0], south), (west, middle[1]), (east, middle[1])]
    (north, _), (south, _), (_, west), (_, east) = plan.incident.plane.degrees(ends).tolist()
    parts = [("overlay.png", 0, size, west, east)]
    if east < west:  # KML allows no longitude beyond 180 degrees
        cut = min(max(round((180 - west) / (360 + east - west) * size), 1), size - 1)
        parts = [("overlay_west.png", 0, cut, west, 180.0)]
        parts.append(("overlay_east.png", cut, size, -180.0, east))
    edges = {}
    for name, first, last, west, east in parts:
        pixels = np.full((size, last - first, 4), (*MAP, 0), np.uint8)
        pixels[..., 3] = np.rint(255 * matrix[:, first:last] / matrix.max())
        picture = pygame.image.frombuffer(pixels.tobytes(), (last - first, size), "RGBA")
        pygame.image.save(picture, file := io.BytesIO(), ".png")
        write_bytes(folder / name, file.getvalue())
        edges[name] = {"north": north, "south": south, "east": east, "west": west}
    return edges


def _features(plan: PlannedFlights) -> list[dict[str, Any]]:
    """GeoJSON features: the last known position, and a line and the waypoints of each drone."""
    features = [_feature("Point", plan.incident.position[::-1], name="last known position")]
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        whole = {
            "drone": drone,
            "take_off_utc": _utc(flight[0].time),
            "landing_utc": _utc(flight[-1].time),
            "order": order,
            "distance_m": round(_legs(plan, flight).sum()),
        }
        first, *others = _split(flight)
        kind = "MultiLineString" if others else "LineString"
        features.append(_feature(kind, [first, *others] if others else first, **whole))
        for number, (waypoint, point) in enumerate(zip(flight, _points(flight), strict=True)):
            row = {"drone": drone, "waypoint": number, "time_utc": _utc(waypoint.time)}
            more = {"altitude_m": waypoint.altitude, "searching": waypoint.searching}
            features.append(_feature("Point", point, **row, **more))
    return features


def _csv(plan: PlannedFlights) -> str:
    """A row for each waypoint; speed and searching are those of the leg that begins there."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    name = "drone,waypoint,time_utc,latitude_deg,longitude_deg,altitude_m,speed_m_s,searching,order"
    rows.writerow(name.split(","))
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        seconds = np.diff([waypoint.time.timestamp() for waypoint in flight])
        speeds = [*(_legs(plan, flight) / seconds), 0.0]
        for number, (point, speed) in enumerate(zip(flight, speeds, strict=True)):
            row = [
                drone,
                number,
                _utc(point.time),
                f"{point.latitude:.7f}",
                f"{point.longitude:.7f}",
                point.altitude,
                f"{speed:.2f}",
                point.searching,
                csv_cell(order) if number == 0 else "",
            ]
            rows.writerow(row)
    return text.getvalue()


def _utc(time: datetime) -> str:
    return time.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _legs(plan: PlannedFlights, flight: Flight) -> Floats:
    """The lengths of the legs in metres."""
    points = track(flight, plan.incident.plane)
    lengths: Floats = np.hypot(*np.diff(points, axis=0).T)
    return lengths


def _points(flight: Flight) -> Line:
    """(longitude, latitude), the order of GeoJSON and KML."""
    return [(round(waypoint.longitude, 7), round(waypoint.latitude, 7)) for waypoint in flight]


def _split(flight: Flight) -> list[Line]:
    """Lines that end where they reach the date line, see RFC 7946, section 3.1.9."""
    points = _points(flight)
    lines = [points[:1]]
    for (x, y), (next_x, next_y) in pairwise(points):
        if abs(next_x - x) > 180:
            edge = math.copysign(180, x)
            gap = next_x + 2 * edge - x
            crossing = y + (edge - x) / gap * (next_y - y) if gap else y
            lines[-1].append((edge, crossing))
            lines.append([(-edge, crossing)])
        lines[-1].append((next_x, next_y))
    return [line for line in lines if len(set(line)) > 1]


def _feature(kind: str, coordinates: object, **properties: object) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _shape(line: Line, altitude: float) -> dict[str, str]:
    """The elements of a KML point or line, at an altitude in metres above the sea."""
    coordinates = " ".join(f"{x:.7f},{y:.7f},{altitude}" for x, y in line)
    return {"altitudeMode": "relativeToGround", "coordinates": coordinates}


def _add(parent: ET.Element, tag: str, **children: Any) -> ET.Element:
    """Add an element with its children: texts, or elements as dicts."""
    element = ET.SubElement(parent, tag)
    for name, child in children.items():
        if isinstance(child, dict):
            _add(element, name, **child)
        else:
            ET.SubElement(element, name).text = str(child)
    return element
