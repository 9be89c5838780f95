"""Flights: waypoints in degrees and UTC, planned or flown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.times import in_utc

FASTER = 1.5  # a flown leg may be so many times as fast as the airspeed plus the wind


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
        swath: the width of the strip that the drone saw, in metres.
        probability_of_detection: that it found a person in the strip when it flew past.
    """

    waypoints: tuple[Waypoint, ...]
    swath: float
    probability_of_detection: float

    def __post_init__(self) -> None:
        waypoints = tuple(
            checked_waypoint(f"waypoints[{row}]", waypoint)
            for row, waypoint in enumerate(checks.items("waypoints", self.waypoints, "waypoints"))
        )
        check_order([f"waypoints[{row}]" for row in range(len(waypoints))], waypoints)
        name = "probability_of_detection"
        values = {
            "waypoints": waypoints,
            "swath": checks.positive("swath", self.swath),
            name: checks.real(name, self.probability_of_detection, 0, 1),
        }
        for field, value in values.items():
            object.__setattr__(self, field, value)

    @property
    def landing(self) -> datetime:
        """When it ended."""
        return self.waypoints[-1].time


def read_flown(name: str, value: object, swath: float, detection: float) -> FlownFlight:
    """A flown flight from the forms that an incident takes.

    Args:
        name: of the flight, for messages.
        value: a `FlownFlight`, a mapping of its attributes, or its waypoints alone.
        swath: of waypoints alone.
        detection: of waypoints alone.
    """
    if isinstance(value, FlownFlight):
        return value
    keys = ("waypoints", "swath", "probability_of_detection")
    values: dict[str, Any] = dict(zip(keys, (value, swath, detection), strict=True))
    if isinstance(value, Mapping):
        values = checks.known_keys(name, value, keys)
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


def check_flyable(
    names: Sequence[str],
    flight: Flight,
    plane: TangentPlane,
    *,
    within: tuple[datetime, datetime],
    base: TangentPlane,
    reach: float,
    airspeed: float,
    wind: Callable[[datetime, Floats], float],
) -> None:
    """Raise a ValueError unless a drone can have flown so; it names the waypoint.

    Args:
        names: of the waypoints, for messages.
        flight: in the order of its times.
        plane: of all metres.
        within: the first and the last time at which it can have flown.
        base: a plane that touches the earth where drones take off.
        reach: the largest distance from there in metres.
        airspeed: in m/s.
        wind: its speed in m/s at a time and points, (2, 1).
    """
    points = track(flight, plane)
    for row, (name, waypoint) in enumerate(zip(names, flight, strict=True)):
        if not within[0] <= waypoint.time <= within[1]:
            raise ValueError(
                f"{name}: times must be from {within[0]:%Y-%m-%d %H:%M} to "
                f"{within[1]:%Y-%m-%d %H:%M} UTC, the report and what drifts after it, got "
                f"{waypoint.time:%Y-%m-%d %H:%M}"
            )
        away = base.distance(waypoint.latitude, waypoint.longitude)
        if not away <= reach:
            raise ValueError(
                f"{name}: drones can be at most {reach / 1000:.0f} km from their base, but "
                f"({waypoint.latitude:g}, {waypoint.longitude:g}) is {away / 1000:,.0f} km away"
            )
        if row == 0:
            continue
        seconds = (waypoint.time - flight[row - 1].time).total_seconds()
        speed = float(np.hypot(*(points[row] - points[row - 1]))) / seconds
        fastest = FASTER * (airspeed + wind(waypoint.time, points[row][:, None]))
        if not speed <= fastest:
            raise ValueError(
                f"{name}: drones can make at most {fastest:.0f} m/s, {FASTER:g} times the "
                f"airspeed plus the wind, but it is reached with {speed:,.0f} m/s"
            )


def track(flight: Flight, plane: TangentPlane) -> Floats:
    """The positions of a flight's waypoints on a plane, in metres (east, north): (n, 2)."""
    return plane.metres([point.latitude for point in flight], [point.longitude for point in flight])


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
    begin, end = legs[begun, 0], legs[begun, 1]
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
