"""The fleet of an incident, as plain data: drones, and boats and helicopters beside them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch._internal.files import csv_rows
from DroneSwarmSearch._internal.text import printable
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.times import near
from DroneSwarmSearch.geo.units import LENGTH, SPEED, TIME, Quantity
from DroneSwarmSearch.incident.by_class import ByClass, read_by_class
from DroneSwarmSearch.incident.hypothesis import read_position
from DroneSwarmSearch.incident.sweep_widths import DETECTION

COPTER = "copter"
PLANE = "plane"
DJI = "dji"
HELICOPTER = "helicopter"
BOAT = "boat"

DRONES = (COPTER, PLANE, DJI)
AIRCRAFT = (*DRONES, HELICOPTER, BOAT)

FASTEST_OVER_GROUND = {DJI: 15.0}
"""In m/s, of missions for aircraft that limit it: DJI's WPML, "autoFlightSpeed"."""

QUANTITIES = {
    "altitude": Quantity(LENGTH, 0, 10_000, "from 0 to 10 km"),
    "speed": Quantity(SPEED, 0, 200, "above 0 and at most 200 m/s", is_above_zero=True),
    "endurance": Quantity(TIME, 0, 12 * 3600, "above 0 and at most 12 h", is_above_zero=True),
    "reserve": Quantity(TIME, 0, 12 * 3600, "from 0 to 12 h"),
    "turn": Quantity(TIME, 0, 600, "from 0 to 10 min"),
    "climb": Quantity(SPEED, 0, 50, "above 0 and at most 50 m/s", is_above_zero=True),
    "base_speed": Quantity(SPEED, 0, 40, "from 0 to 40 m/s"),
}
"""What lengths, speeds and durations may be."""

SWATH = Quantity(LENGTH, 1, 60_000, "from 1 m to 60 km")

USUAL_RESERVE = 0.2
"""Of the endurance."""

HEIGHTS_APART = 20.0
"""Metres between the heights of two drones."""

LOWEST = 20.0
"""The least height in metres of drones that fly below the given altitude for lack of room above."""

USUAL: dict[str, dict[str, Any]] = {
    HELICOPTER: {
        "speed": "90kn",
        "endurance": "2h",
        "turn": 15.0,
        "climb": 5.0,
        "altitude": "500ft",
    },
    BOAT: {"speed": "20kn", "endurance": "4h", "turn": 20.0, "climb": 1.0, "altitude": 0.0},
}
"""What boats and helicopters can do, unless it is given; the values of an incident are for drones
only."""


@dataclass(frozen=True, kw_only=True)
class Drone:
    """What a drone can do, or a boat or a helicopter that searches beside them.

    Values that are not given come from the `Incident`. Boats and helicopters have usual values of
    their own.

    Attributes:
        name: by which orders call it; by default its number.
        aircraft: "copter", "plane" or "dji", for which a mission is written; "helicopter" or
            "boat", which get a route.
        base: where it takes off and lands, (latitude, longitude).
        base_course: where the ship goes that is its base, in degrees or as "NNE".
        base_speed: how fast the ship is.
        base_time: when the ship is at `base`.
        take_off: when it takes off.
        speed: its speed in still air; of a boat, through the water.
        endurance: from take-off to landing.
        reserve: what must be left of the endurance at the landing.
        turn: seconds in which it turns by a right angle.
        climb: the speed with which it climbs and sinks.
        altitude: at which it flies.
        swath: the width of the strip that it sees; or of each object class, {"PIW-1": 100, ...}.
        probability_of_detection: that it finds a person in the strip; or of each object class.
        night: whether it can search after sunset.

    Raises:
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    name: str = ""
    aircraft: str | None = None
    base: Pair = None  # type: ignore[assignment]  # of the incident
    base_course: float | None = None
    base_speed: float = None  # type: ignore[assignment]
    base_time: datetime | None = None
    take_off: datetime = None  # type: ignore[assignment]
    speed: float = None  # type: ignore[assignment]
    endurance: float = None  # type: ignore[assignment]
    reserve: float = None  # type: ignore[assignment]
    turn: float = None  # type: ignore[assignment]
    climb: float = None  # type: ignore[assignment]
    altitude: float = None  # type: ignore[assignment]
    swath: ByClass = None  # type: ignore[assignment]
    probability_of_detection: ByClass = None  # type: ignore[assignment]
    night: bool = None  # type: ignore[assignment]

    if TYPE_CHECKING:

        def __init__(self, **values: Any) -> None: ...  # in all the forms above

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if value is not None:
                object.__setattr__(self, each.name, _read(each.name, value))

    @property
    def label(self) -> str:
        """What orders, files and maps call it: its name, or such as "drone 1"."""
        return f"{self.kind} {self.name}" if self.name.isdecimal() else self.name

    @property
    def kind(self) -> str:
        """Whether it is a drone, a helicopter or a boat."""
        return self.aircraft if self.aircraft in (HELICOPTER, BOAT) else "drone"

    @property
    def is_boat(self) -> bool:
        """Whether it swims."""
        return self.aircraft == BOAT

    @property
    def fastest_over_ground(self) -> float:
        """The most that it can fly over the ground, in m/s, or infinity."""
        return FASTEST_OVER_GROUND.get(self.aircraft or COPTER, np.inf)

    @property
    def airborne(self) -> float:
        """Seconds from its take-off to its landing, at most."""
        return self.endurance - self.reserve

    @property
    def latest_landing(self) -> datetime:
        """When it has landed at the latest."""
        return self.take_off + timedelta(seconds=self.airborne)

    def landed(self, name: str) -> Drone:
        """The same with a name, which takes off again when the incident says."""
        return Drone(**{**self.given(), "name": name, "take_off": None})

    def given(self) -> dict[str, Any]:
        """The values that it has."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: value for name, value in values.items() if value not in (None, "")}


FIELDS = tuple(each.name for each in fields(Drone))
"""The names of its values."""

SHARED = tuple(name for name in FIELDS if name not in ("name", "take_off") and "base_" not in name)
"""Those that are the incident's unless a drone states its own."""


def _read(name: str, value: Any) -> Any:
    """A value in its plain form."""
    if name in QUANTITIES:
        return QUANTITIES[name].read(name, value)
    if name == "swath":
        return read_by_class(name, value, SWATH.read)
    if name == "probability_of_detection":
        return read_by_class(name, value, _read_probability)
    if name == "base":
        return read_position(name, value)
    if name == "base_course" and isinstance(value, str):
        return units.named(name, units.direction, value)
    if name == "base_course":
        return checks.real(name, value, 0, 360)
    if name == "aircraft":
        return checks.choice(name, value, AIRCRAFT)
    if name == "name":
        return printable(value)
    if name == "night":
        return _read_flag(name, value)
    return value  # times, which the incident reads


def _read_flag(name: str, value: object) -> bool:
    """Whether something is so, from a boolean or a text."""
    if isinstance(value, str):
        flags = {"yes": True, "true": True, "no": False, "false": False}
        if value.lower() not in flags:
            raise ValueError(f"{name} must be yes or no, got {value!r}")
        return flags[value.lower()]
    return checks.boolean(name, value)


def _read_probability(name: str, value: object) -> float:
    """A probability, from a number or a text."""
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            raise ValueError(f"{name} must be a number from 0 to 1, got {value!r}") from None
    return checks.real(name, value, 0, 1)


def read_fleet(value: object) -> list[Drone]:
    """Drones from a list of drones or mappings, or from a CSV file with a row for each.

    Raises:
        TypeError, ValueError: the list, the file or one of its values is unsuitable.
    """
    if isinstance(value, (str, os.PathLike)):
        return _from_file(Path(value))
    found = []
    for row, each in enumerate(checks.items("fleet", value, "a list of drones, or a CSV file")):
        if isinstance(each, Drone):
            found.append(each)
            continue
        found.append(_drone(f"fleet[{row}]", checks.known_keys(f"fleet[{row}]", each, FIELDS)))
    return found


def _from_file(path: Path) -> list[Drone]:
    """Drones from a CSV file, whose columns have the names of their values."""
    if not path.is_file():
        raise ValueError(
            f"fleet must be a list of drones or a CSV file, but there is no {str(path)!r}"
        )
    found = []
    for number, row in csv_rows(path):
        given = {
            name.strip(): text.strip()
            for name, text in row.items()
            if name and isinstance(text, str) and text.strip()
        }
        found.append(_drone(f"{path}, line {number}", given))
    if not found:
        raise ValueError(f"{path} must hold drones, one per line, got none")
    return found


def _drone(where: str, given: Mapping[str, Any]) -> Drone:
    """A drone from its values; errors name where they are."""
    try:
        return Drone(**checks.known_keys(where, given, FIELDS, ValueError))
    except (TypeError, ValueError) as error:
        text = str(error)
        raise type(error)(text if text.startswith(where) else f"{where}: {text}") from None


def completed(
    drones: Sequence[Drone],
    shared: Mapping[str, Any],
    start: datetime,
    swaths: Callable[[str, float], ByClass],
) -> list[Drone]:
    """The drones with all their values.

    Args:
        drones: as they were given.
        shared: the incident's values, for those that they do not state.
        start: when they take off by default.
        swaths: of boats and helicopters that do not state theirs, by kind and speed.
    """
    found = []
    for number, drone in enumerate(drones, 1):
        own = drone.given()
        kind = own.get("aircraft", shared["aircraft"])
        values = {**shared, **own}
        if kind in USUAL:
            values = {
                "base": shared["base"],
                "night": shared["night"],
                **USUAL[kind],
                "reserve": None,
                **own,
            }
            if "swath" not in own:
                speed = QUANTITIES["speed"].read("speed", values["speed"])
                values["swath"] = swaths(kind, speed)
            values.setdefault("probability_of_detection", DETECTION)
        name = f"{own.get('name') or number}"
        whole = Drone(**{**values, "name": name, "base_speed": own.get("base_speed", 0.0)})
        if whole.reserve is None:
            whole = replace(whole, reserve=USUAL_RESERVE * whole.endurance)
        _check(name, whole)
        found.append(_timed(name, whole, start))
    return found


def _check(name: str, drone: Drone) -> None:
    """Raise a ValueError for values that do not fit each other."""
    if drone.reserve >= drone.endurance:
        raise ValueError(
            f"reserve must be less than the endurance, {drone.endurance / 60:g} min, got "
            f"{drone.reserve / 60:g} min for {name}"
        )
    if drone.base_speed and drone.base_course is None:
        raise ValueError(f"base_course must be given with base_speed, for {name}")
    if drone.base_speed and drone.base_time is None:
        raise ValueError(f"base_time, when the ship is at base, must be given for {name}")


def _timed(name: str, drone: Drone, start: datetime) -> Drone:
    """A drone with the times of its take-off and of the position of its ship."""
    times: dict[str, Any] = {"take_off": start}
    for key in ("take_off", "base_time"):
        given = getattr(drone, key)
        if given is not None:
            times[key] = near(f"{key} of {name}", given, start)
    return replace(drone, **times)


def at_heights(
    drones: Sequence[Drone], altitude: float, ceiling: float, floor: float
) -> list[Drone]:
    """Drones with their altitudes, 20 m apart; too many of them share heights.

    Args:
        drones: those without an altitude get one.
        altitude: of the first of them.
        ceiling: above which none of them flies.
        floor: below which none of them flies.
    """
    taken = [drone.altitude for drone in drones if drone.altitude is not None]
    free = levels(altitude, ceiling, floor)
    apart = [
        height for height in free if all(abs(height - other) >= HEIGHTS_APART for other in taken)
    ]
    heights = apart or free
    found = []
    count = 0
    for drone in drones:
        if drone.altitude is None:
            drone = replace(drone, altitude=heights[count % len(heights)])
            count += 1
        found.append(drone)
    return found


def levels(altitude: float, ceiling: float, floor: float) -> list[float]:
    """The heights at which drones can fly, 20 m apart: up from the altitude, then down from it."""
    above = np.arange(altitude, ceiling + 1e-6, HEIGHTS_APART)
    below = np.arange(altitude - HEIGHTS_APART, floor - 1e-6, -HEIGHTS_APART)
    return [*above.tolist(), *below.tolist()]


def base_at(drone: Drone, time: datetime) -> Pair:
    """Where the base of a drone is at a time, in degrees."""
    if not drone.base_speed or drone.base_time is None or drone.base_course is None:
        return drone.base
    sailed = drone.base_speed * (time - drone.base_time).total_seconds()
    angle = np.radians(drone.base_course)
    plane = TangentPlane(*drone.base)
    latitude, longitude = plane.degrees((sailed * np.sin(angle), sailed * np.cos(angle))).tolist()
    return latitude, longitude
