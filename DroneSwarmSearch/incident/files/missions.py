"""Files that autopilots load: a mission for each drone, for QGroundControl and as plain text.

QGroundControl's developer guide, "Plan file format"; MAVLink's developer guide, "File formats".
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import Flight

# Commands of MAVLink.
WAYPOINT = 16
RETURN = 20  # to the launch
TAKE_OFF = 22
CHANGE_SPEED = 178

# Frames of commands.
MISSION = 2  # of those without a position
RELATIVE_ALTITUDE = 3


class Item(NamedTuple):
    """A command of a mission: its number, its frame and its seven parameters."""

    command: int
    frame: int
    params: list[Any]


def write(plan: FlightPlan, folder: Path) -> None:
    """Write drone1.plan and drone1.waypoints, and the same for all other drones."""
    airspeed = plan.incident.speed
    for drone, flight in enumerate(plan.flights, 1):
        items = _items(flight, airspeed)
        base = [round(flight[0].latitude, 7), round(flight[0].longitude, 7), 0]
        write_text(folder / f"drone{drone}.waypoints", _plain_text(items, base))
        write_text(folder / f"drone{drone}.plan", _qgroundcontrol(items, base, airspeed))


def _items(flight: Flight, airspeed: float) -> list[Item]:
    """The commands of a mission."""
    positions = [
        [0, 0, 0, 0, round(point.latitude, 7), round(point.longitude, 7), point.altitude]
        for point in flight
    ]
    return [
        Item(TAKE_OFF, RELATIVE_ALTITUDE, positions[0]),
        Item(CHANGE_SPEED, MISSION, [0, airspeed, -1, 0, 0, 0, 0]),
        *(Item(WAYPOINT, RELATIVE_ALTITUDE, position) for position in positions[1:-1]),
        Item(RETURN, MISSION, [0] * 7),
    ]


def _plain_text(items: list[Item], base: list[float]) -> str:
    """The mission as plain text; its first line is the base."""
    lines = ["QGC WPL 110"]
    home = Item(WAYPOINT, 0, [0, 0, 0, 0, *base])
    for number, item in enumerate([home, *items]):
        is_current = int(number == 0)
        values = [number, is_current, item.frame, item.command, *item.params, 1]
        lines.append("\t".join(map(str, values)))
    return "\n".join(lines) + "\n"


def _qgroundcontrol(items: list[Item], base: list[float], airspeed: float) -> str:
    """The mission for QGroundControl."""
    mission = {
        "version": 2,
        "firmwareType": 3,  # ArduPilot
        "vehicleType": 1,  # fixed wing
        "globalPlanAltitudeMode": 1,
        "cruiseSpeed": airspeed,
        "hoverSpeed": airspeed,
        "plannedHomePosition": base,
        "items": [_simple_item(number, item) for number, item in enumerate(items, 1)],
    }
    whole = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": mission,
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(whole, indent=1) + "\n"


def _simple_item(number: int, item: Item) -> dict[str, Any]:
    """A command as QGroundControl has it."""
    data = {"type": "SimpleItem", "autoContinue": True, "doJumpId": number, **item._asdict()}
    if item.frame == RELATIVE_ALTITUDE:
        data["params"] = [*item.params[:3], None, *item.params[4:]]  # any yaw
        data |= {"Altitude": item.params[6], "AltitudeMode": 1, "AMSLAltAboveTerrain": None}
    return data
