"""GPX 1.1, with a route for each drone."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from DroneSwarmSearch.incident.files.lines import utc
from DroneSwarmSearch.incident.files.xml import add, as_bytes
from DroneSwarmSearch.incident.flight_plan import FlightPlan


def gpx(plan: FlightPlan, drones: Iterable[int] | None = None) -> bytes:
    """The content of plan.gpx; of some drones only if they are given, counted from 0."""
    namespace = {"xmlns": "http://www.topografix.com/GPX/1/1", "version": "1.1"}
    root = ET.Element("gpx", namespace, creator="DroneSwarmSearch")
    if drones is None:
        drones = range(len(plan.flights))
    for drone in drones:
        label = plan.incident.craft[drone].label
        route = add(root, "rte", name=label, desc=plan.orders[drone])
        for number, waypoint in enumerate(plan.flights[drone]):
            point = add(
                route,
                "rtept",
                ele=waypoint.altitude,
                time=utc(waypoint.time),
                name=f"{drone + 1}-{number:02d}",
            )
            point.attrib = {"lat": f"{waypoint.latitude:.7f}", "lon": f"{waypoint.longitude:.7f}"}
    return as_bytes(root)
