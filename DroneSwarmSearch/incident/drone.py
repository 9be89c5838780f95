"""Drones in the wind: how they climb, fly along a pattern, and come back in time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch.geo.flows import Flow
from DroneSwarmSearch.geo.polygons import shapely_package
from DroneSwarmSearch.geo.sun import seconds_of_light
from DroneSwarmSearch.incident.fleet import Drone, base_at
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.patterns import Pattern

WIND_EXPONENT = 0.11
"""Winds over the open sea grow with height z as (z / 10 m)^0.11: S. Hsu, E. Meindl, D. Gilhousen,
J. Appl. Meteor. 33:757 (1994)."""

SLOWEST = 0.1  # of the airspeed; drones that are slower over the ground make no headway in gusts
SETTLED = 0.05  # seconds: so exact are times that depend on a wind that depends on them
POINTS_PER_HOUR = 50  # the most points of a pattern
FEWEST_POINTS = 42
NO_DRIFT = np.zeros((2, 1))
PARTS = 256  # of a leg, at the end of one of which the way home may begin


@dataclass(frozen=True, eq=False)
class DroneInWind:
    """A drone in the wind of an incident, or a boat in its current.

    Times are seconds after take-off.

    Attributes:
        craft: what it can do.
        airspeed: in m/s; of a boat, through the water.
        turn: seconds for a turn by a right angle.
        endurance: seconds from take-off to landing, less the reserve.
        base: where it takes off, (east, north) in metres.
        base_velocity: with which its base moves, (east, north) in m/s.
        height: at which it flies above the sea, in metres.
        climb: with which it climbs there and sinks to land, in m/s.
        fastest: over the ground, in m/s.
        flow: the wind at 10 m, or the current.
        take_off: in the seconds of the flow.
        light: seconds after take-off until which it can search: by day, unless it is one for the
            night.
        forbidden: areas that it does not enter, a geometry of shapely; or None.
    """

    craft: Drone
    airspeed: float
    turn: float
    endurance: float
    base: Floats
    base_velocity: Floats
    height: float
    climb: float
    fastest: float
    flow: Flow
    take_off: float
    light: float
    forbidden: Any

    def base_at(self, times: Floats) -> Floats:
        """Where its base is at some times, (east, north) in metres: (2, n)."""
        bases: Floats = self.base[:, None] + self.base_velocity[:, None] * times
        return bases

    @property
    def climbing(self) -> float:
        """Seconds from the ground to its height, and from there to the ground."""
        return self.height / self.climb

    @property
    def wind_factor(self) -> float:
        """The wind at its height, divided by that at 10 m; 1 for a boat in a current."""
        if self.craft.is_boat:
            return 1.0
        return float((max(self.height, 1.0) / 10.0) ** WIND_EXPONENT)

    def wind(self, times: Floats, points: Floats) -> Floats:
        """The wind at its height, (east, north) in m/s, at points in metres, (2, n).

        Beyond the edge of a field it is that at the edge, because drones try flights that leave it;
        where nothing is known, there is none.
        """
        velocity = self.flow.velocity(self.take_off + times, points)
        return np.where(np.isnan(velocity), 0.0, velocity) * self.wind_factor

    def ground_speed(self, wind: Floats, unit: Floats, drift: Floats = NO_DRIFT) -> Floats:
        """The speed over the ground along tracks, or NaN where the drone makes no headway.

        With the wind w, the airspeed v and the direction e, it is w.e + sqrt(v² - (w x e)²), or the
        most that the aircraft flies over the ground.

        Args:
            wind: (east, north) in m/s, (2, ...).
            unit: the direction, (2, ...).
            drift: of a frame in which wind, direction and speed are given, over the ground.
        """
        across = wind[0] * unit[1] - wind[1] * unit[0]
        root = np.sqrt(np.maximum(self.airspeed**2 - across**2, 0.0))
        speed = (wind * unit).sum(axis=0) + root
        if np.isfinite(self.fastest):
            drift_across = drift[0] * unit[1] - drift[1] * unit[0]
            most = np.sqrt(self.fastest**2 - drift_across**2) - (drift * unit).sum(axis=0)
            speed = np.minimum(speed, most)
        return np.where((root > 0.0) & (speed >= SLOWEST * self.airspeed), speed, np.nan)

    def turning(self, unit: Floats, after: Floats) -> Floats:
        """Seconds to turn from one direction into another one, (2, n)."""
        angle = np.arccos(np.clip((unit * after).sum(axis=0), -1.0, 1.0))
        seconds: Floats = angle / (np.pi / 2) * self.turn
        return seconds

    def ways(self, point: Floats) -> tuple[float, float]:
        """Seconds from the base to a point and back, in the wind there; NaN without headway."""
        way = (point - self.base)[:, None]
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        wind = self.wind(np.zeros(1), point[:, None])
        there = length / self.ground_speed(wind, unit)
        back = length / self.ground_speed(wind, -unit)
        return float(there[0]), float(back[0])

    def time_around(self, point: Floats) -> float:
        """The seconds that are left around a point, without the climb and the ways; at least 0."""
        ways = sum(self.ways(point))
        if np.isnan(ways):
            return 0.0
        return max(self.endurance - 2 * self.climbing - ways, 0.0)

    def ground_speeds(self, flight: Floats) -> Floats:
        """The speed on each leg of what `fly` returns, in m/s: (n - 1,)."""
        seconds, *points = flight.T
        way = np.diff(points, axis=1)
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        waits = np.append(self.climbing, self.turning(unit[:, :-1], unit[:, 1:]))
        waits[-1] += self.climbing
        speeds: Floats = length / np.maximum(np.diff(seconds) - waits, 1e-3)
        return speeds

    def home(self, times: Floats, points: Floats, unit: Floats) -> Floats:
        """Seconds to be home at times from points, (2, n), after flying along `unit`, and land.

        They are infinite where the drone makes no headway.
        """
        seconds = np.full(points.shape[1], self.climbing)
        for _ in range(8):  # the wind half-way, and where the base is then
            before = seconds
            way = self.base_at(times + before) - points
            length = np.hypot(*way)
            back = np.where(length > 0, way / np.maximum(length, 1e-9), unit)
            waits = self.turning(unit, back) + self.climbing
            wind = self.wind(times + before / 2, points + way / 2)
            seconds = np.fmin(waits + length / self.ground_speed(wind, back), 2 * self.endurance)
            settled = np.abs(seconds - before) < SETTLED
            if settled.all():
                break
        return np.where(settled & (seconds < 2 * self.endurance), seconds, np.inf)

    def fly(self, pattern: Pattern) -> Floats | None:
        """Fly a pattern until the way home must begin.

        Returns:
            Seconds after take-off, east and north of each waypoint, from take-off to landing:
            float64, (n, 3). At a waypoint, the drone first turns; at the first one it climbs, and
            at the last one it sinks. None if it cannot get to the commence search point and back,
            or enters a forbidden area.
        """
        whole = self._whole(pattern)
        with np.errstate(invalid="ignore"):
            back = self.home(whole.times[1:], whole.points[:, 1:], whole.courses)
        is_late = ~(whole.times[1:] + back <= self.endurance) | (whole.times[1:] > self.light)
        last = int(is_late.argmax()) if is_late.any() else len(is_late)
        if last == 0:
            return None
        times = whole.times[: last + 1]
        points = whole.points[:, : last + 1]
        home = back[last - 1]
        if last < len(is_late) and whole.times[last + 1] < 2 * self.endurance:
            part = self._part_of_leg(whole, last)
            if part is not None:
                times = np.append(times, part.time)
                points = np.column_stack([points, part.point])
                home = part.home
        times = np.append(times, times[-1] + home)
        points = np.column_stack([points, self.base_at(times[-1:])])
        if self.forbidden is not None and self.forbidden.intersects(_line(points)):
            return None
        return np.vstack([times, points]).T

    def searches(self, flight: Floats) -> Flags:
        """On which legs of what `fly` returns it searches: (n - 1,); after sunset on none."""
        is_searching = np.ones(len(flight) - 1, np.bool_)
        is_searching[0] = False
        is_searching[-1] &= bool(flight[-1, 0] <= self.light)
        return is_searching

    def _whole(self, pattern: Pattern) -> _Whole:
        """The flight along all points of a pattern, which may take longer than the drone can fly.

        In the frame that moves with the pattern, legs are straight. The wind depends on the times,
        and they on the wind, so both are computed again until they settle.
        """
        count = max(FEWEST_POINTS, round(self.endurance / 3600 * POINTS_PER_HOUR))
        drift = pattern.drift[:, None]
        points = np.vstack([self.base, pattern.points(count)])
        way = np.diff(points.T, axis=1)
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        times = np.zeros(len(points))
        waits = np.zeros(len(length))
        waits[0] = self.climbing
        for _ in range(2 * len(points)):
            before = times
            middle = (times[:-1] + times[1:]) / 2
            half_way = (points[:-1] + points[1:]).T / 2 + drift * middle
            wind = self.wind(middle, half_way) - drift
            courses = unit * self.ground_speed(wind, unit, drift) + drift
            courses /= np.maximum(np.hypot(*courses), 1e-9)
            waits[1:] = self.turning(courses[:, :-1], courses[:, 1:])
            # While the drone climbs or turns, the next point moves on.
            flown = way + drift * waits
            length = np.hypot(*flown)
            unit = flown / np.maximum(length, 1e-9)
            legs = waits + length / self.ground_speed(wind, unit, drift)
            times = np.append(0.0, np.nan_to_num(legs, nan=np.inf).cumsum())
            times = np.minimum(times, 2 * self.endurance)
            settled = np.abs(times - before) < SETTLED
            if settled.all():
                break
        times[~settled] = 2 * self.endurance  # legs that can only be flown at other times
        with np.errstate(invalid="ignore"):
            return _Whole(times, points.T + drift * times, courses, waits)

    def _part_of_leg(self, whole: _Whole, last: int) -> _Part | None:
        """The longest part of the leg after waypoint `last` after which the drone comes home."""
        share = np.linspace(0.0, 1.0, PARTS + 1)[1:-1]
        begin = whole.times[last] + whole.waits[last]
        times = begin + share * (whole.times[last + 1] - begin)
        start = whole.points[:, last]
        points = start[:, None] + share * (whole.points[:, last + 1] - start)[:, None]
        with np.errstate(invalid="ignore"):
            homes = self.home(times, points, whole.courses[:, last : last + 1])
        is_possible = (times + homes <= self.endurance) & (times <= self.light)
        if not is_possible[0]:
            return None
        end = len(share) - 1 if is_possible.all() else int(is_possible.argmin()) - 1
        return _Part(times[end], points[:, end], homes[end])


@dataclass(frozen=True, eq=False)
class _Whole:
    """A flight: times and points of n waypoints, and for each leg its course and what comes before.

    Times are (n,), points (2, n), courses (2, n - 1) and waits, the seconds in which the drone
    climbs or turns before a leg, (n - 1,).
    """

    times: Floats
    points: Floats
    courses: Floats
    waits: Floats


@dataclass(frozen=True, eq=False)
class _Part:
    """When and where part of a leg ends, and the seconds for the way home from there."""

    time: float
    point: Floats
    home: float


def _line(points: Floats) -> Any:
    """The line through points, (2, n), a geometry of shapely."""
    return shapely_package().LineString(points.T)


def drone_in_wind(incident: Incident, number: int) -> DroneInWind:
    """A drone of an incident, counted from 0."""
    craft = incident.craft[number]
    base = incident.plane.metres(*base_at(craft, craft.take_off))
    light = math.inf
    if not craft.night:
        light = seconds_of_light(incident.origin.position, craft.take_off, craft.airborne)
    later = incident.plane.metres(*base_at(craft, craft.take_off + timedelta(hours=1)))
    return DroneInWind(
        craft=craft,
        airspeed=craft.speed,
        turn=craft.turn,
        endurance=craft.airborne,
        base=base,
        base_velocity=(later - base) / 3600,
        height=craft.altitude,
        climb=craft.climb,
        fastest=craft.fastest_over_ground,
        flow=incident.current if craft.is_boat else incident.wind,
        take_off=incident.seconds(craft.take_off),
        light=light,
        forbidden=None if craft.is_boat else incident.forbidden,
    )
