"""Drones in the wind: how they climb, fly along a pattern, and come back in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch.geo.flows import Flow
from DroneSwarmSearch.geo.sun import seconds_of_light
from DroneSwarmSearch.incident.fleet import Drone, base_at
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.patterns import Pattern
from DroneSwarmSearch.incident.ways import STRAIGHT, Ways, ways_at_sea

WIND_EXPONENT = 0.11
"""Winds over the open sea grow with height z as (z / 10 m)^0.11: S. Hsu, E. Meindl, D. Gilhousen,
J. Appl. Meteor. 33:757 (1994)."""

SLOWEST = 0.1  # of the airspeed; drones that are slower over the ground make no headway in gusts
SETTLED = 0.05  # seconds: so exact are times that depend on a wind that depends on them
POINTS_PER_HOUR = 50  # the most points of a pattern
FEWEST_POINTS = 42
NO_DRIFT = np.zeros((2, 1))
PARTS = 256  # of a leg, at the end of one of which the way home may begin
KNOWN_LAND = 1.5  # how far boats know the land, relative to where they or persons may be
DETOURS = 4  # ways home that are tried, because each leaves at another point


class Flown(NamedTuple):
    """A flight: out, along a pattern, and back.

    Attributes:
        points: seconds after take-off, east and north of each waypoint, from take-off to landing:
            float64, (n, 3). At a waypoint, the drone first turns; at the first one it climbs, and
            at the last one it sinks.
        search: the rows from the commence search point to where the drone leaves. Others between
            take-off and landing are corners of ways around forbidden areas.
    """

    points: Floats
    search: slice


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
        around: ways around the areas that it does not enter; None if there are none.
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
    around: Ways | None

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
        """Seconds from the base to a point and back, in the wind there.

        NaN if there is no way, or the drone makes no headway.
        """
        corners = self._corners(self.base, point)
        if corners is None:
            return math.nan, math.nan
        legs = np.diff(np.vstack([self.base, corners, point]).T, axis=1)
        lengths = np.hypot(*legs)
        unit = legs / np.maximum(lengths, 1e-9)
        wind = self.wind(np.zeros(1), point[:, None])
        there = lengths / self.ground_speed(wind, unit)
        back = lengths / self.ground_speed(wind, -unit)
        return float(there.sum()), float(back.sum())

    def _corners(self, begin: Floats, end: Floats) -> Floats | None:
        """The corners of the way between two points: (n, 2); None if there is no way."""
        return STRAIGHT if self.around is None else self.around.around(begin, end)

    def time_around(self, point: Floats) -> float:
        """The seconds that are left around a point, without the climb and the ways; at least 0."""
        ways = sum(self.ways(point))
        if np.isnan(ways):
            return 0.0
        return max(self.endurance - 2 * self.climbing - ways, 0.0)

    def ground_speeds(self, flight: Floats) -> Floats:
        """The speed on each leg of a flight, see `Flown.points`, in m/s: (n - 1,)."""
        seconds, *points = flight.T
        way = np.diff(points, axis=1)
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        waits = np.append(self.climbing, self.turning(unit[:, :-1], unit[:, 1:]))
        waits[-1] += self.climbing
        speeds: Floats = length / np.maximum(np.diff(seconds) - waits, 1e-3)
        return speeds

    def home(
        self, times: Floats, points: Floats, unit: Floats, corners: Floats = STRAIGHT
    ) -> Floats:
        """Seconds to be home, with the landing; infinite where the drone makes no headway.

        Args:
            times: when it leaves, (n,).
            points: where, (2, n).
            unit: the direction in which it was flying, (2, n).
            corners: of the way home, (m, 2).
        """
        landing, _ = self._stations(times, points, unit, corners)[-1]
        return landing - times

    def _stations(
        self, times: Floats, points: Floats, unit: Floats, corners: Floats
    ) -> list[tuple[Floats, Floats]]:
        """When and where drones are at each corner of the way home, and at the landing.

        See `home`; each is (n,) and (2, n).
        """
        stations = []
        for corner in corners:
            times, points, unit = self._leg(times, points, unit, _fixed(corner))
            stations.append((times, points))
        landing, base, _ = self._leg(times, points, unit, self.base_at, self.climbing)
        return [*stations, (landing, base)]

    def _leg(
        self,
        times: Floats,
        points: Floats,
        unit: Floats,
        target: Callable[[Floats], Floats],
        sinking: float = 0.0,
    ) -> tuple[Floats, Floats, Floats]:
        """Fly straight to a target that may move, after a turn.

        Args:
            times: when it begins, (n,).
            points: where, (2, n).
            unit: the direction before, (2, n) or (2, 1).
            target: where the target is at some times.
            sinking: seconds to sink there.

        Returns:
            When it ends, where, and the direction. Times are infinite without headway.
        """
        seconds = np.full(points.shape[1], sinking)
        for _ in range(8):  # the wind half-way, and where the target is then
            before = seconds
            way = target(times + before) - points
            length = np.hypot(*way)
            ahead = np.where(length > 0, way / np.maximum(length, 1e-9), unit)
            waits = self.turning(unit, ahead) + sinking
            wind = self.wind(times + before / 2, points + way / 2)
            seconds = np.fmin(waits + length / self.ground_speed(wind, ahead), 2 * self.endurance)
            settled = np.abs(seconds - before) < SETTLED
            if settled.all():
                break
        is_possible = settled & (seconds < 2 * self.endurance)
        ends = times + np.where(is_possible, seconds, np.inf)
        return ends, target(times + seconds), ahead

    def fly(self, pattern: Pattern) -> Flown | None:
        """Fly a pattern until the way home must begin.

        None if the drone cannot get to the commence search point and back, or if the pattern enters
        a forbidden area. Ways out and home go around these.
        """
        out: list[Floats] = []
        whole = self._whole(pattern, out)
        corners = self._corners(self.base, whole.points[:, 1])
        if corners is None:
            return None
        if len(corners):
            out = self._way_out(corners)
            whole = self._whole(pattern, out)
        if self.around is None:
            return self._flown(whole, out, STRAIGHT)
        return self._home_around(whole, out, corners[::-1], self.around)

    def _home_around(
        self, whole: _Whole, out: list[Floats], corners: Floats, around: Ways
    ) -> Flown | None:
        """A flight with the shortest way home around areas.

        Which way is the shortest depends on where it leaves, and that on how long the way takes;
        the first guess are the corners of the way out. None if the flight would enter an area.
        """
        flown = self._flown(whole, out, corners)
        for tried in range(DETOURS):
            if flown is None:
                return None
            leave = flown.points[flown.search][-1]
            shortest = around.around(leave[1:], flown.points[-1, 1:])
            if shortest is None:
                return None
            is_straight_at_last = tried > 0 and not len(shortest)
            if is_straight_at_last or np.array_equal(shortest, corners):
                break
            corners = shortest
            flown = self._flown(whole, out, corners)
        if flown is None:
            return None
        return flown if around.is_clear(flown.points[:, 1:]) else None

    def _way_out(self, corners: Floats) -> list[Floats]:
        """The take-off and each corner of the way out: seconds, east and north."""
        time = np.array([self.climbing])
        point = self.base[:, None]
        unit = corners[0][:, None] - point
        unit /= np.maximum(np.hypot(*unit), 1e-9)
        way = [np.append(0.0, self.base)]
        for corner in corners:
            time, point, unit = self._leg(time, point, unit, _fixed(corner))
            way.append(np.append(time, point))
        return way

    def _flown(self, whole: _Whole, out: list[Floats], corners: Floats) -> Flown | None:
        """A flight that leaves as late as it can, and comes home by corners.

        Args:
            whole: the flight along all points of the pattern.
            out: what comes before its first point, see `_way_out`.
            corners: of the way home, (n, 2).
        """
        with np.errstate(invalid="ignore"):
            back = self.home(whole.times[1:], whole.points[:, 1:], whole.courses, corners)
        is_late = ~(whole.times[1:] + back <= self.endurance) | (whole.times[1:] > self.light)
        last = int(is_late.argmax()) if is_late.any() else len(is_late)
        if last == 0:
            return None
        times = whole.times[: last + 1]
        points = whole.points[:, : last + 1]
        course = whole.courses[:, last - 1 : last]
        if last < len(is_late) and whole.times[last + 1] < 2 * self.endurance:
            part = self._part_of_leg(whole, last, corners)
            if part is not None:
                times = np.append(times, part.time)
                points = np.column_stack([points, part.point])
                course = whole.courses[:, last : last + 1]
        way_home = self._stations(times[-1:], points[:, -1:], course, corners)
        rows = [
            *out[:-1],
            *np.vstack([times, points]).T,
            *(np.append(time, point) for time, point in way_home),
        ]
        commence = max(len(out), 1)
        return Flown(np.array(rows), slice(commence, len(rows) - len(way_home)))

    def searches(self, flown: Flown) -> Flags:
        """On which legs of a flight it searches: (n - 1,); after sunset on none."""
        is_searching = np.ones(len(flown.points) - 1, np.bool_)
        is_searching[: flown.search.start] = False
        way_home = slice(flown.search.stop - 1, None)
        is_searching[way_home] &= flown.points[1:][way_home, 0] <= self.light
        return is_searching

    def _whole(self, pattern: Pattern, out: list[Floats]) -> _Whole:
        """The flight along all points of a pattern, which may take longer than the drone can fly.

        It begins at the last corner of the way out, see `_way_out`; without one, at the base.

        In the frame that moves with the pattern, legs are straight. The wind depends on the times,
        and they on the wind, so both are computed again until they settle.
        """
        count = max(FEWEST_POINTS, round(self.endurance / 3600 * POINTS_PER_HOUR))
        drift = pattern.drift[:, None]
        begin, *start = out[-1] if out else (0.0, *self.base)
        # Where it would begin if it moved with the pattern.
        points = np.vstack([start - pattern.drift * begin, pattern.points(count)])
        way = np.diff(points.T, axis=1)
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        times = np.full(len(points), begin)
        waits = np.zeros(len(length))
        if len(out) > 1:
            before_it = out[-1][1:] - out[-2][1:]
            arriving = before_it[:, None] / np.hypot(*before_it)
        for _ in range(2 * len(points)):
            before = times
            middle = (times[:-1] + times[1:]) / 2
            half_way = (points[:-1] + points[1:]).T / 2 + drift * middle
            wind = self.wind(middle, half_way) - drift
            courses = unit * self.ground_speed(wind, unit, drift) + drift
            courses /= np.maximum(np.hypot(*courses), 1e-9)
            waits[0] = self.turning(arriving, courses[:, :1])[0] if len(out) > 1 else self.climbing
            waits[1:] = self.turning(courses[:, :-1], courses[:, 1:])
            # While the drone climbs or turns, the next point moves on.
            flown = way + drift * waits
            length = np.hypot(*flown)
            unit = flown / np.maximum(length, 1e-9)
            legs = waits + length / self.ground_speed(wind, unit, drift)
            times = np.append(0.0, np.nan_to_num(legs, nan=np.inf).cumsum()) + begin
            times = np.minimum(times, 2 * self.endurance)
            settled = np.abs(times - before) < SETTLED
            if settled.all():
                break
        times[~settled] = 2 * self.endurance  # legs that can only be flown at other times
        with np.errstate(invalid="ignore"):
            return _Whole(times, points.T + drift * times, courses, waits)

    def _part_of_leg(self, whole: _Whole, last: int, corners: Floats) -> _Part | None:
        """The longest part of the leg after waypoint `last` after which the drone comes home.

        The way home has corners.
        """
        share = np.linspace(0.0, 1.0, PARTS + 1)[1:-1]
        begin = whole.times[last] + whole.waits[last]
        times = begin + share * (whole.times[last + 1] - begin)
        start = whole.points[:, last]
        points = start[:, None] + share * (whole.points[:, last + 1] - start)[:, None]
        with np.errstate(invalid="ignore"):
            homes = self.home(times, points, whole.courses[:, last : last + 1], corners)
        is_possible = (times + homes <= self.endurance) & (times <= self.light)
        if not is_possible[0]:
            return None
        end = len(share) - 1 if is_possible.all() else int(is_possible.argmin()) - 1
        return _Part(times[end], points[:, end])


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
    """When and where part of a leg ends."""

    time: float
    point: Floats


def _fixed(point: Floats) -> Callable[[Floats], Floats]:
    """A target that does not move."""

    def target(times: Floats) -> Floats:
        return np.broadcast_to(point[:, None], (2, len(times)))

    return target


def _ways_around(incident: Incident, craft: Drone, base: Floats) -> Ways | None:
    """Ways around what a drone or a boat does not enter; None if there is nothing."""
    if not craft.is_boat:
        return None if incident.forbidden is None else Ways(incident.forbidden)
    farthest = max(incident.farthest_start, math.hypot(*base))
    land = incident.land_within(KNOWN_LAND * farthest)
    if land is None or land.is_empty:
        return None
    east, north = base.tolist()
    return ways_at_sea(land, (east, north))


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
        around=_ways_around(incident, craft, base),
    )
