"""GeoJSON: the last known position, land, and a line and the waypoints of each drone."""

from __future__ import annotations

import json
from typing import Any

from DroneSwarmSearch.incident.files.lines import land_of, lengths, point_of, split, utc
from DroneSwarmSearch.incident.flight_plan import FlightPlan


def geojson(plan: FlightPlan) -> str:
    """The content of plan.geojson."""
    latitude, longitude = plan.incident.position
    features = [_feature("Point", (longitude, latitude), name="last known position")]
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


def _feature(kind: str, coordinates: object, **properties: object) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}
