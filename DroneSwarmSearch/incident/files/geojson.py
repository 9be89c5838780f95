"""GeoJSON: what is known of the persons, land, and a line and the waypoints of each drone."""

from __future__ import annotations

import json
from typing import Any

from DroneSwarmSearch.incident.files.lines import (
    land_of,
    lengths,
    mark_in_degrees,
    point_of,
    split,
    utc,
)
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.incident import Mark


def geojson(plan: FlightPlan) -> str:
    """The content of plan.geojson."""
    features = [_mark(plan, mark) for mark in [*plan.incident.marks, *plan.incident.no_fly_marks]]
    land = land_of(plan)
    if land:
        polygons = [[outline.tolist() for outline in polygon] for polygon in land]
        features.append(_feature("MultiPolygon", polygons, name="land"))
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        lines = split(flight)
        is_whole = len(lines) == 1
        line = _feature(
            "LineString" if is_whole else "MultiLineString",
            lines[0] if is_whole else lines,
            drone=drone,
            take_off_utc=utc(flight[0].time),
            landing_utc=utc(flight[-1].time),
            order=order,
            distance_m=round(lengths(plan, flight).sum()),
        )
        features.append(line)
        for number, waypoint in enumerate(flight):
            point = _feature(
                "Point",
                point_of(waypoint),
                drone=drone,
                waypoint=number,
                time_utc=utc(waypoint.time),
                altitude_m=waypoint.altitude,
                searching=waypoint.searching,
            )
            features.append(point)
    return json.dumps({"type": "FeatureCollection", "features": features}) + "\n"


def _mark(plan: FlightPlan, mark: Mark) -> dict[str, Any]:
    """What is known of where persons were: a point, a line or an outline."""
    line = mark_in_degrees(plan, mark)
    if mark.is_closed:
        return _feature("Polygon", [line], name=mark.name)
    if len(line) == 1:
        return _feature("Point", line[0], name=mark.name)
    return _feature("LineString", line, name=mark.name)


def _feature(kind: str, coordinates: object, **properties: object) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}
