"""Missions for ArduPilot and PX4: QGroundControl's plan files, and plain text.

QGroundControl's developer guide, "Plan file format"; MAVLink's developer guide, "File formats" and
"MAVLink common message set"; ArduPilot's guide for planes, "Automatic landing".
"""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.geo.polygons import polygons_of
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.fleet import PLANE
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import Waypoint, track
from DroneSwarmSearch.incident.incident import Incident

# Commands of MAVLink.
WAYPOINT = 16
RETURN = 20  # to the launch
LAND = 21
TAKE_OFF = 22
LOITER_TO_ALTITUDE = 31
CHANGE_SPEED = 178
LANDING_BEGINS = 189  # DO_LAND_START

# Frames of commands.
MISSION = 2  # of those without a position
RELATIVE_ALTITUDE = 3

# What a command of speed is about.
AIRSPEED = 0
GROUND_SPEED = 1

ARDUPILOT = 3
FIXED_WING = 1
QUADROTOR = 2

PITCH = 15.0  # degrees, of a plane that takes off

# A plane loiters down downwind of its base, and lands into the wind.
LOITER_RADIUS = 75.0  # metres
LOITER_HEIGHT = 40.0  # metres, at the end
APPROACH = 400.0  # metres from there to the base
LOITERS_APART = 200.0  # metres between the loiters of two planes, across the wind
LOITERS = 6  # side by side

TURNS = np.radians([0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180])
"""By which that may be turned from downwind, because of no-fly areas."""

FENCE_MARGIN = 200.0  # metres around all ways


class Item(NamedTuple):
    """A command of a mission: its number, its frame and its seven parameters."""

    command: int
    frame: int
    params: list[Any]


def items_of(plan: FlightPlan, drone: int) -> list[Item]:
    """The commands of a drone's mission.

    A plane flies at its airspeed. A copter holds the speed over the ground that the plan has
    computed for each leg. Each comes home at its own height, and lands.
    """
    if plan.incident.craft[drone].aircraft == PLANE:
        return _plane_items(plan, drone)
    return _copter_items(plan, drone)


def _copter_items(plan: FlightPlan, drone: int) -> list[Item]:
    flight = plan.flights[drone]
    items = [_at(TAKE_OFF, flight[0])]
    set_speed = None
    for speed, waypoint in zip(plan.ground_speeds(drone), flight[1:], strict=True):
        rounded = round(speed, 1)
        if rounded != set_speed:
            items.append(_speed(GROUND_SPEED, rounded))
            set_speed = rounded
        items.append(_at(WAYPOINT, waypoint))
    if plan.incident.craft[drone].base_speed:  # its ship is no longer where it took off
        return [*items, _at(LAND, flight[-1]._replace(altitude=0.0))]
    return [*items, Item(RETURN, MISSION, [0] * 7)]


def _plane_items(plan: FlightPlan, drone: int) -> list[Item]:
    flight = plan.flights[drone]
    latitude, longitude = _loiter(plan, drone)
    home = flight[-1]
    loiter = home._replace(latitude=latitude, longitude=longitude, altitude=LOITER_HEIGHT)
    return [
        _at(TAKE_OFF, flight[0], PITCH),
        _speed(AIRSPEED, plan.incident.craft[drone].speed),
        *(_at(WAYPOINT, waypoint) for waypoint in flight[1:]),
        Item(LANDING_BEGINS, MISSION, [0] * 7),
        _at(LOITER_TO_ALTITUDE, loiter, 1, LOITER_RADIUS, 0, 1),
        _at(LAND, home._replace(altitude=0.0)),
    ]


def _loiter(plan: FlightPlan, drone: int) -> tuple[float, float]:
    """Where a plane loiters down: downwind of its base, beside other planes; in degrees.

    If no-fly areas are there, as nearly downwind as they allow.
    """
    incident = plan.incident
    flying = drone_in_wind(incident, drone)
    flight = plan.flights[drone]
    landing = np.array([(flight[-1].time - flight[0].time).total_seconds()])
    base = flying.base_at(landing)
    wind = flying.wind(landing, base)[:, 0]
    speed = math.hypot(*wind)
    downwind = wind / speed if speed > 0 else np.array([0.0, 1.0])
    count = min(len(plan.flights), LOITERS)
    lane = drone % LOITERS - (count - 1) / 2
    beside = LOITERS_APART * lane

    def loiter(turn: float) -> Floats:
        sin = math.sin(turn)
        cos = math.cos(turn)
        away = downwind @ np.array([[cos, -sin], [sin, cos]])
        point: Floats = base[:, 0] + APPROACH * away + beside * away[::-1] * [1, -1]
        return point

    places = [loiter(turn) for turn in TURNS]
    metres = next((place for place in places if _is_clear(incident, base[:, 0], place)), places[0])
    latitude, longitude = incident.plane.degrees(metres[None])[0].tolist()
    return latitude, longitude


def _is_clear(incident: Incident, base: Floats, loiter: Floats) -> bool:
    """Whether a plane can loiter and come from there to its base without entering an area."""
    if incident.forbidden is None:
        return True
    shapely: Any = needed("shapely", "no-fly areas need the package shapely", "plan")
    way = shapely.linestrings(np.stack([base, loiter]))
    circle = shapely.Point(loiter).buffer(LOITER_RADIUS)
    return not shapely.intersects(incident.forbidden, shapely.union(way, circle))


def _at(command: int, waypoint: Waypoint, *params: float) -> Item:
    """A command at a waypoint, with its first parameters."""
    first = [*params, *[0] * (4 - len(params))]
    latitude = round(waypoint.latitude, 7)
    longitude = round(waypoint.longitude, 7)
    return Item(command, RELATIVE_ALTITUDE, [*first, latitude, longitude, waypoint.altitude])


def _speed(kind: int, speed: float) -> Item:
    return Item(CHANGE_SPEED, MISSION, [kind, speed, -1, 0, 0, 0, 0])


# Files.


def plain_text(plan: FlightPlan, drone: int, items: list[Item]) -> str:
    """The mission as plain text; its first line is the base."""
    lines = ["QGC WPL 110"]
    home = Item(WAYPOINT, 0, [0, 0, 0, 0, *_base(plan, drone)])
    for number, item in enumerate([home, *items]):
        is_current = int(number == 0)
        values = [number, is_current, item.frame, item.command, *item.params, 1]
        lines.append("\t".join(map(str, values)))
    return "\n".join(lines) + "\n"


def qgroundcontrol(plan: FlightPlan, drone: int, items: list[Item]) -> str:
    """The mission for QGroundControl, with a fence around all ways."""
    craft = plan.incident.craft[drone]
    mission = {
        "version": 2,
        "firmwareType": ARDUPILOT,
        "vehicleType": FIXED_WING if craft.aircraft == PLANE else QUADROTOR,
        "globalPlanAltitudeMode": 1,
        "cruiseSpeed": craft.speed,
        "hoverSpeed": craft.speed,
        "plannedHomePosition": _base(plan, drone),
        "items": [_simple_item(number, item) for number, item in enumerate(items, 1)],
    }
    polygons = [(True, _fence(plan, drone, items)), *((False, each) for each in _no_fly(plan))]
    fences = [
        {"version": 1, "inclusion": inclusion, "polygon": polygon}
        for inclusion, polygon in polygons
    ]
    whole = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": mission,
        "geoFence": {"version": 2, "circles": [], "polygons": fences},
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(whole, indent=1) + "\n"


def _no_fly(plan: FlightPlan) -> list[list[list[float]]]:
    """The corners of the areas that nobody enters, (latitude, longitude)."""
    areas = plan.incident.forbidden
    if areas is None:
        return []
    return [
        [
            [round(latitude, 7), round(longitude, 7)]
            for latitude, longitude in plan.incident.plane.degrees(outline[:-1]).tolist()
        ]
        for outline, *_ in polygons_of(areas)
    ]


def _base(plan: FlightPlan, drone: int) -> list[float]:
    """Latitude, longitude and altitude of the take-off."""
    first = plan.flights[drone][0]
    return [round(first.latitude, 7), round(first.longitude, 7), 0]


def _simple_item(number: int, item: Item) -> dict[str, Any]:
    """A command as QGroundControl has it."""
    data = {"type": "SimpleItem", "autoContinue": True, "doJumpId": number, **item._asdict()}
    if item.frame == RELATIVE_ALTITUDE:
        yaw = item.params[3] if item.command == LOITER_TO_ALTITUDE else None  # any
        data["params"] = [*item.params[:3], yaw, *item.params[4:]]
        data |= {"Altitude": item.params[6], "AltitudeMode": 1, "AMSLAltAboveTerrain": None}
    return data


def _fence(plan: FlightPlan, drone: int, items: list[Item]) -> list[list[float]]:
    """The corners, (latitude, longitude), of an area that holds all positions with a margin."""
    shapely: Any = needed("shapely", "the fence of a mission needs the package shapely", "plan")
    positions = [item.params[4:6] for item in items if item.frame == RELATIVE_ALTITUDE]
    plane = plan.incident.plane
    metres = [plane.metres(*position) for position in positions]
    metres += [*track(plan.flights[drone], plane)]
    hull = shapely.MultiPoint(metres).convex_hull.buffer(FENCE_MARGIN, quad_segs=2)
    corners: Floats = plane.degrees(np.array(hull.exterior.coords)[:-1])
    return [[round(latitude, 7), round(longitude, 7)] for latitude, longitude in corners.tolist()]
