"""Files that autopilots load: a mission for each drone, for QGroundControl and as plain text.

QGroundControl's developer guide, "Plan file format"; MAVLink's developer guide, "File formats" and
"MAVLink common message set".
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.incident.flights import Flight

if TYPE_CHECKING:
    from DroneSwarmSearch.incident.flight_plan import FlightPlan

TAKE_OFF, CHANGE_SPEED, WAYPOINT, RETURN = 22, 178, 16, 20
"""MAV_CMD_NAV_TAKEOFF, MAV_CMD_DO_CHANGE_SPEED, NAV_WAYPOINT, NAV_RETURN_TO_LAUNCH."""

RELATIVE_ALTITUDE, MISSION = 3, 2
"""MAV_FRAME_GLOBAL_RELATIVE_ALT, of commands with a position, and MAV_FRAME_MISSION, of others."""

AIRSPEED, ARDUPILOT, FIXED_WING = 0.0, 3, 1
"""The type of a speed; MAV_AUTOPILOT_ARDUPILOTMEGA; MAV_TYPE_FIXED_WING."""


class Item(NamedTuple):
    """A command of a mission.

    Attributes:
        command: its number.
        frame: of the position.
        params: seven parameters, of which the last ones are latitude, longitude and altitude.
    """

    command: int
    frame: int
    params: list[float]


def save(plan: FlightPlan, folder: Path) -> None:
    """Write drone0.plan and drone0.waypoints, and the same for all other drones."""
    speed = plan.incident.speed
    for number, flight in enumerate(plan.flights):
        items = [*_items(flight, speed)]
        write_text(
            folder / f"drone{number}.plan", json.dumps(_plan(items, flight, speed), indent=1)
        )
        write_text(folder / f"drone{number}.waypoints", _text(items, flight))


def _items(flight: Flight, speed: float) -> Iterator[Item]:
    """The commands of a flight: the drone turns and flies as its autopilot does."""
    first, *others, _ = flight
    place = [first.latitude, first.longitude, first.altitude]
    yield Item(TAKE_OFF, RELATIVE_ALTITUDE, [0.0, 0.0, 0.0, 0.0, *place])
    yield Item(CHANGE_SPEED, MISSION, [AIRSPEED, speed, -1.0, 0.0, 0.0, 0.0, 0.0])
    for each in others:
        place = [round(each.latitude, 7), round(each.longitude, 7), each.altitude]
        yield Item(WAYPOINT, RELATIVE_ALTITUDE, [0.0, 0.0, 0.0, 0.0, *place])
    yield Item(RETURN, MISSION, [0.0] * 7)


def _plan(items: list[Item], flight: Flight, speed: float) -> dict[str, Any]:
    """A plan of QGroundControl."""
    home = [flight[0].latitude, flight[0].longitude, 0.0]
    simple: list[dict[str, Any]] = [
        {
            "type": "SimpleItem",
            "autoContinue": True,
            "doJumpId": number,
            "command": item.command,
            "frame": item.frame,
            "params": [*item.params],
        }
        for number, item in enumerate(items, 1)
    ]
    for each in simple:
        if each["frame"] == RELATIVE_ALTITUDE:
            each["params"][3] = None  # no yaw
            each.update(Altitude=each["params"][6], AltitudeMode=1, AMSLAltAboveTerrain=None)
    mission = {
        "version": 2,
        "firmwareType": ARDUPILOT,
        "vehicleType": FIXED_WING,
        "globalPlanAltitudeMode": 1,
        "cruiseSpeed": speed,
        "hoverSpeed": speed,
        "plannedHomePosition": home,
        "items": simple,
    }
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": mission,
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
    }


def _text(items: list[Item], flight: Flight) -> str:
    """The plain-text format; item 0 is the home position."""
    home = Item(WAYPOINT, 0, [0.0, 0.0, 0.0, 0.0, flight[0].latitude, flight[0].longitude, 0.0])
    lines = ["QGC WPL 110"]
    for number, (command, frame, params) in enumerate([home, *items]):
        numbers = [f"{each:.8f}" for each in params]
        lines.append(
            "\t".join([str(number), str(int(number == 0)), str(frame), str(command), *numbers, "1"])
        )
    return "\n".join(lines) + "\n"
