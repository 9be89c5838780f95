"""Files that autopilots load: a mission for each drone, for QGroundControl and as plain text.

QGroundControl's developer guide, "Plan file format"; MAVLink's developer guide, "File formats".
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.incident.planned_flights import PlannedFlights

TAKE_OFF, CHANGE_SPEED, WAYPOINT, RETURN = 22, 178, 16, 20
"""Commands of MAVLink; the last one returns to the launch."""

RELATIVE_ALTITUDE, MISSION = 3, 2
"""The frames of commands with a position, and of those without one."""


class Item(NamedTuple):
    """A command of a mission: its number, its frame and its seven parameters."""

    command: int
    frame: int
    params: list[Any]


def save(plan: PlannedFlights, folder: Path) -> None:
    """Write drone1.plan and drone1.waypoints, and the same for all other drones."""
    airspeed = plan.incident.speed
    for number, flight in enumerate(plan.flights, 1):
        params = [[0, 0, 0, 0, round(w[1], 7), round(w[2], 7), w[3]] for w in flight]
        items = [
            Item(TAKE_OFF, RELATIVE_ALTITUDE, params[0]),
            Item(CHANGE_SPEED, MISSION, [0, airspeed, -1, 0, 0, 0, 0]),
            *(Item(WAYPOINT, RELATIVE_ALTITUDE, own) for own in params[1:-1]),
            Item(RETURN, MISSION, [0] * 7),
        ]
        base = [*params[0][4:6], 0]
        plain = ["QGC WPL 110"]
        for line, item in enumerate([Item(WAYPOINT, 0, [0, 0, 0, 0, *base]), *items]):
            values = [line, int(line == 0), item.frame, item.command, *item.params, 1]
            plain.append("\t".join(map(str, values)))
        write_text(folder / f"drone{number}.waypoints", "\n".join(plain) + "\n")
        mission = {
            "version": 2,
            "firmwareType": 3,  # ArduPilot
            "vehicleType": 1,  # fixed wing
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": airspeed,
            "hoverSpeed": airspeed,
            "plannedHomePosition": base,
            "items": [_simple_item(line, item) for line, item in enumerate(items, 1)],
        }
        whole = {
            "fileType": "Plan",
            "version": 1,
            "groundStation": "QGroundControl",
            "mission": mission,
            "geoFence": {"version": 2, "circles": [], "polygons": []},
            "rallyPoints": {"version": 2, "points": []},
        }
        write_text(folder / f"drone{number}.plan", json.dumps(whole, indent=1) + "\n")


def _simple_item(number: int, item: Item) -> dict[str, Any]:
    """A command as QGroundControl has it."""
    data = {"type": "SimpleItem", "autoContinue": True, "doJumpId": number, **item._asdict()}
    if item.frame == RELATIVE_ALTITUDE:
        data["params"] = [*item.params[:3], None, *item.params[4:]]  # any yaw
        data |= {"Altitude": item.params[6], "AltitudeMode": 1, "AMSLAltAboveTerrain": None}
    return data
