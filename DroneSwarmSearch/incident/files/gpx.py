"""GPX 1.1, with a route for each drone."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from DroneSwarmSearch.incident.files.lines import utc
from DroneSwarmSearch.incident.files.xml import add, as_bytes
from DroneSwarmSearch.incident.flight_plan import FlightPlan


def gpx(plan: FlightPlan) -> bytes:
    """The content of plan.gpx."""
    namespace = {"xmlns": "http://www.topografix.com/GPX/1/1", "version": "1.1"}
    root = ET.Element("gpx", namespace, creator="DroneSwarmSearch")
    for drone, (flight, order) in enumerate(zip(plan.flights, plan.orders, strict=True), 1):
        route = add(root, "rte", name=f"drone {drone}", desc=order)
        for number, waypoint in enumerate(flight):
            point = add(
                route,
                "rtept",
                ele=waypoint.altitude,
                time=utc(waypoint.time),
                name=f"{drone}-{number:02d}",
            )
            point.attrib = {"lat": f"{waypoint.latitude:.7f}", "lon": f"{waypoint.longitude:.7f}"}
    return as_bytes(root)
