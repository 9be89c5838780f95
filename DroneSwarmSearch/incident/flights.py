"""Flights: waypoints in degrees and UTC, planned or flown, and reading them from files."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.files import csv_rows
from DroneSwarmSearch._internal.text import printable
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.times import in_utc
from DroneSwarmSearch.incident.by_class import ByClass, read_by_class


class Waypoint(NamedTuple):
    """Where a drone is at a time; there it turns, and flies straight on to its next waypoint.

    Attributes:
        time: in UTC.
        latitude: in degrees, WGS 84.
        longitude: in degrees, from -180 to 180.
        altitude: above the sea, in metres.
        searching: whether it searches until the next waypoint.
    """

    time: datetime
    latitude: float
    longitude: float
    altitude: float
    searching: bool


Flight = Sequence[Waypoint]  # the waypoints of one drone, in the order of their times


@dataclass(frozen=True)
class FlownFlight:
    """A flight that found nobody, with what its drone saw; later plans never change it.

    Attributes:
        waypoints: at least two, in the order of their times.
        swath: the width of the strip that the drone saw, in metres; perhaps by object class.
        probability_of_detection: that it found a person in the strip when it flew past; perhaps by
            object class.
        name: of the drone.
    """

    waypoints: tuple[Waypoint, ...]
    swath: ByClass
    probability_of_detection: ByClass
    name: str = ""

    def __post_init__(self) -> None:
        waypoints = tuple(
            checked_waypoint(f"waypoints[{row}]", waypoint)
            for row, waypoint in enumerate(checks.items("waypoints", self.waypoints, "waypoints"))
        )
        check_order([f"waypoints[{row}]" for row in range(len(waypoints))], waypoints)
        name = "probability_of_detection"
        values = {
            "waypoints": waypoints,
            "swath": read_by_class("swath", self.swath, checks.positive),
            name: read_by_class(name, self.probability_of_detection, _probability),
            "name": printable(self.name),
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)

    @property
    def take_off(self) -> datetime:
        """When it began."""
        return self.waypoints[0].time

    def until(self, time: datetime) -> FlownFlight:
        """The part that was flown until a drone broke off.

        Raises:
            ValueError: the time is not between take-off and landing.
        """
        if not self.take_off < time < self.landing:
            raise ValueError(
                f"must be between its take-off, {self.take_off:%H:%M}, and its landing, "
                f"{self.landing:%H:%M}, got {time:%H:%M}"
            )
        flown = [point for point in self.waypoints if point.time < time]
        before = flown[-1]
        following = self.waypoints[len(flown)]
        plane = TangentPlane(before.latitude, before.longitude)
        share = (time - before.time) / (following.time - before.time)
        way = plane.metres(following.latitude, following.longitude)
        latitude, longitude = plane.degrees(share * way).tolist()
        here = Waypoint(time, latitude, longitude, before.altitude, searching=False)
        return replace(self, waypoints=(*flown, here))

    @property
    def landing(self) -> datetime:
        """When it ended."""
        return self.waypoints[-1].time


def _probability(name: str, value: object) -> float:
    return checks.real(name, value, 0, 1)


def read_flown(name: str, value: object, swath: ByClass, detection: ByClass) -> FlownFlight:
    """A flown flight from the forms that an incident takes.

    Args:
        name: of the flight, for messages.
        value: a `FlownFlight`, a mapping of its attributes, or its waypoints alone.
        swath: of waypoints alone.
        detection: of waypoints alone.
    """
    if isinstance(value, FlownFlight):
        return value
    values: dict[str, Any] = {
        "waypoints": value,
        "swath": swath,
        "probability_of_detection": detection,
    }
    if isinstance(value, Mapping):
        keys = list(values)
        values = checks.known_keys(name, value, [*keys, "name"])
        for key in keys:
            if key not in values:
                raise ValueError(f"{name} must hold {', '.join(keys)}, got no {key}")
    try:
        return FlownFlight(**values)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{name}: {error}") from None


def checked_waypoint(name: str, value: object) -> Waypoint:
    """A waypoint from its five values."""
    what = f"a waypoint, {', '.join(Waypoint._fields)}"
    values = checks.items(name, value, what)
    if len(values) != len(Waypoint._fields):
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    when, latitude, longitude, altitude, searching = values
    return Waypoint(
        time=in_utc(f"{name}, time", when),
        latitude=checks.real(f"{name}, latitude", latitude, -90, 90),
        longitude=checks.real(f"{name}, longitude", longitude, -180, 180),
        altitude=checks.real(f"{name}, altitude", altitude),
        searching=checks.boolean(f"{name}, searching", searching),
    )


class NamedFlight(NamedTuple):
    """A flight, what messages call each of its waypoints, and the number of its drone."""

    names: list[str]
    waypoints: list[Waypoint]
    drone: int


def read_flights(path: str | os.PathLike[str]) -> list[NamedFlight]:
    """The flights of all drones, planned or really flown, from a file such as plan.csv.

    It needs the columns drone, time_utc, latitude_deg and longitude_deg. Without the column
    searching, drones search on all legs; without altitude_m, they are at 0 m.

    Returns:
        A flight for each drone, by its number in the file; the names are the lines of the file.

    Raises:
        OSError: the file cannot be read.
        ValueError: a column is missing, a value is wrong, the times of a drone do not increase, or
            there is no waypoint.
    """
    flights: dict[int, NamedFlight] = {}
    for number, row in csv_rows(Path(path)):
        line = f"{path}, line {number}"
        drone, waypoint = _read_row(line, row)
        flight = flights.setdefault(drone, NamedFlight([], [], drone))
        if flight.waypoints and waypoint.time <= flight.waypoints[-1].time:
            raise ValueError(f"{line}: time_utc must increase, got {row['time_utc']!r}")
        flight.names.append(line)
        flight.waypoints.append(waypoint)
    if not flights:
        raise ValueError(f"{path} must hold waypoints, one per line, got none")
    return [flights[drone] for drone in sorted(flights)]


def _read_row(line: str, row: dict[str, Any]) -> tuple[int, Waypoint]:
    """The drone and the waypoint of a row."""
    complete = {"altitude_m": "0", "searching": "true", **row}
    values = []
    for name, (parse, what) in COLUMNS.items():
        given = complete.get(name, "no such column")
        try:
            values.append(parse(given))
        except ValueError:
            raise ValueError(f"{line}: {name} must be {what}, got {given!r:.100}") from None
    drone, *rest = values
    return drone, Waypoint(*rest)


COLUMNS: dict[str, Any] = {
    "drone": (lambda text: checks.integer("", int(text), 0), "a whole number of at least 0"),
    "time_utc": (partial(in_utc, "time_utc"), "a time with its zone, such as 2026-03-01T05:30:00Z"),
    "latitude_deg": (lambda text: checks.real("", float(text), -90, 90), "from -90 to 90"),
    "longitude_deg": (lambda text: checks.real("", float(text), -180, 180), "from -180 to 180"),
    "altitude_m": (lambda text: checks.real("", float(text)), "a number"),
    "searching": (lambda text: bool(("false", "true").index(text.lower())), "true or false"),
}
"""How to read the columns that become a `Waypoint`, and what they must be."""


def check_order(names: Sequence[str], flight: Flight) -> None:
    """Raise a ValueError unless a flight has two waypoints or more, and its times increase."""
    if len(flight) < 2:
        where = f"{names[0]}: " if names else ""
        raise ValueError(f"{where}a flight must have at least two waypoints, got {len(flight)}")
    for row in range(1, len(flight)):
        if flight[row].time <= flight[row - 1].time:
            raise ValueError(
                f"{names[row]}: times must increase, got {flight[row].time:%Y-%m-%d %H:%M:%S} "
                f"after {flight[row - 1].time:%H:%M:%S}"
            )


def track(flight: Flight, plane: TangentPlane) -> Floats:
    """The positions of a flight's waypoints on a plane, in metres (east, north): (n, 2)."""
    return plane.metres([point.latitude for point in flight], [point.longitude for point in flight])


def least_distance(flight: Flight, other: Flight) -> float:
    """The least distance in metres between two drones while both are in the air; or infinity.

    In steps of five seconds.
    """
    first = max(flight[0].time, other[0].time)
    last = min(flight[-1].time, other[-1].time)
    if first > last:
        return math.inf
    times = np.arange(0.0, (last - first).total_seconds() + 1e-6, 5.0)
    plane = TangentPlane(flight[0].latitude, flight[0].longitude)
    positions = []
    for each in (flight, other):
        seconds = [(point.time - first).total_seconds() for point in each]
        points = track(each, plane)
        positions.append(np.array([np.interp(times, seconds, axis) for axis in points.T]))
    return float(np.hypot(*(positions[0] - positions[1])).min())


def legs_of(flight: Flight, plane: TangentPlane, since: datetime) -> Floats:
    """The legs on which a drone searches: seconds, east and north of both ends, (n, 2, 3).

    Times are seconds after `since`; what was flown before is left out.
    """
    seconds = [(point.time - since).total_seconds() for point in flight]
    points = np.column_stack([seconds, track(flight, plane)])
    searching = np.array([point.searching for point in flight[:-1]], np.bool_)
    legs = np.stack([points[:-1], points[1:]], axis=1)[searching]
    legs = legs[legs[:, 1, 0] > 0.0]
    begun = legs[:, 0, 0] < 0.0  # these are under way at time 0
    begin = legs[begun, 0]
    end = legs[begun, 1]
    share = -begin[:, :1] / (end[:, :1] - begin[:, :1])
    legs[begun, 0] = begin + share * (end - begin)
    return legs


def up_to_the_minute(time: datetime) -> datetime:
    """The next whole minute, for times of take-off: nobody is there before."""
    return down_to_the_minute(time + timedelta(minutes=1) - timedelta(microseconds=1))


def down_to_the_minute(time: datetime) -> datetime:
    """The last whole minute, for times of landing: nobody is there after."""
    return time.replace(second=0, microsecond=0)


def course(begin: Waypoint, end: Waypoint) -> float:
    """The course over the ground between waypoints, in degrees clockwise from north.

    The direction on a chart of Mercator's, which is constant along a leg of a few kilometres.
    """
    north = end.latitude - begin.latitude
    east = (end.longitude - begin.longitude + 180) % 360 - 180
    middle = math.radians((begin.latitude + end.latitude) / 2)
    return math.degrees(math.atan2(east * math.cos(middle), north)) % 360
