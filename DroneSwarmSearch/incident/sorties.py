"""The next sortie: an incident after flights that found nobody."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.geo.flows import Flow, Origin, Series
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.times import near
from DroneSwarmSearch.geo.typed_flows import read_flow
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.fleet import Drone
from DroneSwarmSearch.incident.flights import (
    Flight,
    FlownFlight,
    NamedFlight,
    check_order,
    read_flights,
    track,
)
from DroneSwarmSearch.incident.incident import FARTHEST, FLOWS, LONGEST_DRIFT, Incident

SORTIES_APART = timedelta(minutes=30)  # from the last landing to the next take-off

FASTER = 1.5  # a flown leg may be so many times as fast as the airspeed plus the wind


class Flown(Protocol):
    """A plan that was flown, or anything else with flights."""

    @property
    def flights(self) -> Sequence[Flight]: ...


def after(
    incident: Incident,
    flown: Flown | str | os.PathLike[str],
    at: datetime | str | None = None,
    *,
    broke_off: Mapping[object, datetime | str] = MappingProxyType({}),
    **changes: Any,
) -> Incident:
    """The incident after flights that found nobody: its map is the posterior.

    What was flown never changes: each flight keeps the swath and the probability of detection
    with which it was flown, and was flown in the wind of this incident. With a later report,
    a new `time`, persons drift from there, and flights count from that time on.

    If some drones are still flying when the next ones take off, their planned flights count as
    flown, and those who have landed are free.

    Args:
        incident: the incident in which the flights were flown.
        flown: a plan that was flown, or a CSV file of what was really flown, such as the
            `plan.csv` of a plan; the columns are drone, time_utc, latitude_deg, longitude_deg
            and optionally searching.
        at: when the first drone takes off again, `start`; by default half an hour after the
            last one has landed, or at a later `time`.
        broke_off: drones that broke off their search, by name or by their number from 1, and when:
            what they have flown until then counts.
        changes: other values of the incident for the next flights. A wind or a current without
            a time holds from the last landing on.

    Raises:
        OSError: there is no such file.
        TypeError, ValueError: the file or a value is unsuitable, or drones cannot have flown
            so: farther than they can be, faster than 1.5 times their airspeed plus the wind,
            before the last report or days after it. Names the row.
    """
    known = [each.name for each in fields(Incident) if each.init]
    known = [name for name in known if name not in ("start", "flown")]
    checks.known_keys("changes", changes, known)
    flights = _named_flights(flown)
    numbers = _drones(incident, flights)
    _check_flyable(incident, flights, numbers)
    drones = [incident.craft[number] for number in numbers]
    new = [
        FlownFlight(
            tuple(flight.waypoints), drone.swath, drone.probability_of_detection, drone.name
        )
        for flight, drone in zip(flights, drones, strict=True)
    ]
    new = _broken_off(incident, new, broke_off)
    values = {**changes, "flown": (*incident.flown, *new)}
    landed = max(flight.landing for flight in values["flown"])
    time, latest = incident.times_with(changes)
    start = max(landed + SORTIES_APART, latest)
    if at is not None:
        start = near("start", at, latest)
    if "fleet" not in changes and "drones" not in changes:
        values |= _free(incident, values["flown"], start)
    since = min(landed, start)
    for name in FLOWS:
        values[name] = _next_flow(name, getattr(incident, name), values.get(name), since, time)
    return incident.changed(start=start, **values)


def _named_flights(flown: Flown | str | os.PathLike[str]) -> list[NamedFlight]:
    """Flights from a file, or from a plan, whose drones count from 1."""
    if isinstance(flown, (str, os.PathLike)):
        return read_flights(flown)
    return [
        NamedFlight(
            [f"drone {drone}, waypoint {row}" for row in range(len(flight))], list(flight), drone
        )
        for drone, flight in enumerate(flown.flights, 1)
    ]


def _broken_off(
    incident: Incident, flights: list[FlownFlight], times: Mapping[object, datetime | str]
) -> list[FlownFlight]:
    """The flights as far as they were flown."""
    names = [flight.name for flight in flights]
    found = [*flights]
    for key, given in times.items():
        name = str(key)
        if name not in names:
            raise ValueError(
                f"broke_off must name drones that have flown, {', '.join(names)}, got {name!r:.100}"
            )
        number = names.index(name)
        time = near(f"broke_off of {name}", given, incident.start)
        try:
            found[number] = flights[number].until(time)
        except ValueError as error:
            raise ValueError(f"broke_off of {name} {error}") from None
    return found


def _free(incident: Incident, flown: Sequence[FlownFlight], start: datetime) -> dict[str, Any]:
    """The drones that can take off at a time: those which have landed."""
    flying = {flight.name for flight in flown if flight.landing > start}
    free = [drone for drone in incident.craft if drone.name not in flying]
    if not free:
        landing = min(flight.landing for flight in flown if flight.name in flying)
        raise ValueError(
            f"start must not be before a drone has landed, at {landing:%H:%M} the first one, got "
            f"{start:%H:%M}"
        )
    if incident.fleet:
        given = dict(zip((drone.name for drone in incident.craft), incident.fleet, strict=True))
        return {"fleet": tuple(given[drone.name].landed(drone.name) for drone in free)}
    if len(free) == len(incident.craft):
        return {}
    return {"fleet": tuple(Drone(name=drone.name) for drone in free)}


def _drones(incident: Incident, flights: Sequence[NamedFlight]) -> list[int]:
    """Which drone of an incident made each flight, counted from 0; files count from 0 or 1."""
    first = min(flight.drone for flight in flights)
    numbers = [flight.drone - min(first, 1) for flight in flights]
    count = len(incident.craft)
    if max(numbers) >= count and len(set(incident.craft)) > 1:
        raise ValueError(
            f"{flights[-1].names[0]}: the fleet has {plural(count, 'drone')}, got drone "
            f"{flights[-1].drone}"
        )
    return [min(number, count - 1) for number in numbers]


def _next_flow(name: str, earlier: Flow, later: Any, landed: datetime, time: datetime) -> Flow:
    """The wind or current of the next flights, which leaves that of flown ones as it was.

    Times in seconds count from `time`, that of the next report.
    """
    origin = Origin(earlier.origin.position, time)
    earlier = earlier.moved(origin)
    if later is None:
        return earlier
    flow = read_flow(name, later, origin)
    if landed <= time:  # the new particles never meet the old flow
        return flow
    seconds = origin.seconds(landed)
    if isinstance(flow, Series) and min(flow.vectors) < seconds:
        raise ValueError(
            f"{name} must be given for times from the last landing on, {landed:%Y-%m-%d %H:%M}: "
            "what was flown does not change"
        )
    return earlier.changed_to(flow, seconds)


# Flights that can be.


@dataclass(frozen=True)
class _Limits:
    """What the drones of an incident can have flown.

    Attributes:
        incident: its wind counts.
        drone: which flew.
        base: a plane that touches the earth where drones take off.
        strength: the wind at the height of the drone, divided by that at 10 m.
        reach: the largest distance from the base in metres.
    """

    incident: Incident
    drone: Drone
    base: TangentPlane
    strength: float
    reach: float

    @classmethod
    def of(cls, incident: Incident, number: int) -> _Limits:
        flying = drone_in_wind(incident, number)
        drone = flying.craft
        base = TangentPlane(*drone.base)
        here = cls(incident, drone, base, flying.wind_factor, reach=0.0)
        middle = np.zeros((2, 1))
        strongest = max(
            here.wind(incident.start, middle),
            here.wind(incident.began, middle),
        )
        reach = FASTER * (drone.speed + drone.base_speed + strongest) * drone.endurance
        return replace(here, reach=min(reach, FARTHEST))

    def wind(self, time: datetime, point: Floats) -> float:
        """The most that the wind may have been at a time and a point, (2, 1), in m/s."""
        seconds = np.array([self.incident.seconds(time)])
        velocity = np.nan_to_num(self.incident.wind.velocity(seconds, point))
        return float(self.strength * np.hypot(*velocity[:, 0]) + self.incident.wind_error)

    def check(self, flight: NamedFlight) -> None:
        """Raise a ValueError unless a drone can have flown so; it names the waypoint."""
        first = self.incident.began
        last = self.incident.start + LONGEST_DRIFT
        points = track(flight.waypoints, self.incident.plane)
        for row, (name, waypoint) in enumerate(zip(flight.names, flight.waypoints, strict=True)):
            if not first <= waypoint.time <= last:
                raise ValueError(
                    f"{name}: times must be from {first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} "
                    "UTC, the report and what drifts after it, got "
                    f"{waypoint.time:%Y-%m-%d %H:%M}"
                )
            away = self.base.distance(waypoint.latitude, waypoint.longitude)
            if not away <= self.reach:
                raise ValueError(
                    f"{name}: drones can be at most {self.reach / 1000:.0f} km from their base, "
                    f"but ({waypoint.latitude:g}, {waypoint.longitude:g}) is {away / 1000:,.0f} km "
                    "away"
                )
            if row == 0:
                continue
            seconds = (waypoint.time - flight.waypoints[row - 1].time).total_seconds()
            speed = float(np.hypot(*(points[row] - points[row - 1]))) / seconds
            blows = self.wind(waypoint.time, points[row][:, None])
            fastest = FASTER * (self.drone.speed + blows)
            if not speed <= fastest:
                raise ValueError(
                    f"{name}: drones can make at most {fastest:.0f} m/s, {FASTER:g} times the "
                    f"airspeed plus the wind, but it is reached with {speed:,.0f} m/s"
                )


def _check_flyable(
    incident: Incident, flights: Sequence[NamedFlight], numbers: Sequence[int]
) -> None:
    """Raise a ValueError if the drones of an incident cannot have flown so."""
    for number, flight in zip(numbers, flights, strict=True):
        check_order(flight.names, flight.waypoints)
        _Limits.of(incident, number).check(flight)
