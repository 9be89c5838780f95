"""Search patterns, and the flights of drones along them in the wind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints

PARALLEL, SQUARE, SECTOR = KINDS = "parallel track", "expanding square", "sector search"
"""Of the IAMSAR Manual, volume II, chapter 5."""

SLOWEST = 0.1  # of the airspeed; drones that are slower over the ground make no headway in gusts
SETTLED = 0.05  # seconds: so exact are times that depend on a wind that depends on them
POINTS_PER_HOUR, FEWEST_POINTS = 50, 42  # the most points of a pattern


@dataclass(frozen=True)
class Pattern:
    """A search pattern; lengths are in metres.

    Attributes:
        kind: "parallel track", "expanding square" or "sector search".
        start: the commence search point, (east, north).
        heading: of the first leg, clockwise from north, in radians.
        length: of the legs of a parallel track, or of the radius of a sector search.
        spacing: between parallel legs; an expanding square grows by it with every second leg.
        legs: of a parallel track, which is then flown backwards.
        side: 1 if the drone turns to starboard, -1 if to port.
        drift: the velocity of all points from take-off on, (east, north) in m/s.
    """

    kind: str
    start: Floats
    heading: float
    length: float
    spacing: float
    legs: int
    side: int
    drift: Floats

    def points(self, count: int) -> Floats:
        """The first points, where they are at take-off: float64, (n, 2), n at most `count`."""
        number, right = np.arange(count - 1), self.side * np.pi / 2
        headings, lengths = self.heading + 0.0 * number, self.length + 0.0 * number
        if self.kind == PARALLEL:
            lap, place = self._laps(number)
            across = ~self.is_along(number)
            headings += np.where(across, right, np.pi * (place // 2 + lap))
            headings += np.where(across & (lap % 2 == 1), np.pi, 0.0)
            lengths[across] = self.spacing
        elif self.kind == SQUARE:
            headings += right * number
            lengths = self.spacing * (number // 2 + 1.0)
        else:  # triangles, each begun straight on through the datum; 30 degrees on after three
            triangle, leg = np.divmod(number, 3)
            headings += right / 3 * (8 * triangle + triangle // 3 + 4 * leg)
        moves = lengths * [np.sin(headings), np.cos(headings)]
        points = np.vstack([self.start, self.start + moves.T.cumsum(axis=0)])
        is_turn = np.append(True, np.abs(np.sin(np.diff(headings) / 2)) > 1e-9)
        turning: Floats = points[np.concatenate([is_turn, [True]])]
        return turning

    def is_along(self, number: Ints) -> Flags:
        """Whether legs of a parallel track, counted from 0, lie along it; the others cross over."""
        along: Flags = self._laps(number)[1] % 2 == 0
        return along

    def _laps(self, number: Ints) -> tuple[Ints, Ints]:
        """How often the pattern was flown before each leg, and which leg of the pattern it is."""
        whole = 2 * self.legs - 1
        lap, place = np.divmod(number, whole)
        return lap, np.where(lap % 2, whole - 1 - place, place)


def ground_speed(airspeed: float, wind: Floats, unit: Floats) -> Floats:
    """The speed over the ground along a track, or NaN where the drone makes no headway.

    With the wind w and the direction e, it is w.e + sqrt(v² - (w x e)²).

    Args:
        airspeed: v, in m/s.
        wind: (east, north) in m/s, (2, ...).
        unit: the direction, (2, ...).
    """
    across = wind[0] * unit[1] - wind[1] * unit[0]
    root = np.sqrt(np.maximum(airspeed**2 - across**2, 0.0))
    speed = (wind * unit).sum(axis=0) + root
    return np.where((root > 0.0) & (speed >= SLOWEST * airspeed), speed, np.nan)


class Drone(NamedTuple):
    """What a drone can do; see `Incident`.

    Attributes:
        airspeed: in m/s.
        turn: seconds for a turn by a right angle.
        endurance: seconds from take-off to landing, less the reserve.
        base: where it takes off and lands, (east, north) in metres.
        wind: at the height of the flight, (east, north) in m/s, (2, n), at times in seconds after
            take-off, (n,), and points in metres, (2, n).
    """

    airspeed: float
    turn: float
    endurance: float
    base: Floats
    wind: Callable[[Floats, Floats], Floats]

    def home(self, times: Floats, points: Floats, unit: Floats) -> Floats:
        """Seconds for the way home at times from points, (2, n), after flying along `unit`.

        They are infinite where the drone makes no headway.
        """
        way = self.base[:, None] - points
        length = np.hypot(*way)
        back = np.where(length > 0, way / np.maximum(length, 1e-9), unit)
        seconds = turning = self.turning(unit, back)
        for _ in range(8):  # the wind half-way
            before = seconds
            wind = self.wind(times + before / 2, points + way / 2)
            speed = ground_speed(self.airspeed, wind, back)
            seconds = np.fmin(turning + length / speed, 2 * self.endurance)
            if (settled := np.abs(seconds - before) < SETTLED).all():
                break
        return np.where(settled & (seconds < 2 * self.endurance), seconds, np.inf)

    def turning(self, unit: Floats, after: Floats) -> Floats:
        """Seconds to turn from one direction into another one, (2, n)."""
        angle = np.arccos(np.clip((unit * after).sum(axis=0), -1.0, 1.0))
        seconds: Floats = angle / (np.pi / 2) * self.turn
        return seconds

    def fly(self, pattern: Pattern) -> Floats | None:
        """Fly a pattern until the way home must begin.

        Returns:
            Seconds after take-off, east and north of each waypoint, from take-off to landing:
            float64, (n, 3). At a waypoint, the drone first turns. None if it cannot get to the
            commence search point and back.
        """
        count = max(FEWEST_POINTS, round(self.endurance / 3600 * POINTS_PER_HOUR))
        drift, points = pattern.drift[:, None], np.vstack([self.base, pattern.points(count)])
        way = np.diff(points.T, axis=1)
        length = np.hypot(*way)
        unit = way / np.maximum(length, 1e-9)
        times = np.zeros(len(points))
        turns = np.zeros(len(length))
        for _ in range(2 * len(points)):  # the wind depends on the times, and they on the wind
            before = times
            middle = (times[:-1] + times[1:]) / 2
            wind = self.wind(middle, (points[:-1] + points[1:]).T / 2 + drift * middle) - drift
            speed = ground_speed(self.airspeed, wind, unit)
            course = unit * speed + drift
            course /= np.maximum(np.hypot(*course), 1e-9)
            turns[1:] = self.turning(course[:, :-1], course[:, 1:])
            # While the drone turns, the next point moves on.
            flown = way + drift * turns
            length = np.hypot(*flown)
            unit = flown / np.maximum(length, 1e-9)
            legs = turns + length / ground_speed(self.airspeed, wind, unit)
            times = np.append(0.0, np.nan_to_num(legs, nan=np.inf).cumsum())
            times = np.minimum(times, 2 * self.endurance)
            if (settled := np.abs(times - before) < SETTLED).all():
                break
        times[~settled] = 2 * self.endurance  # legs that can only be flown at other times
        with np.errstate(invalid="ignore"):
            return self._cut(times, points.T + drift * times, course, turns)

    def _cut(self, times: Floats, points: Floats, course: Floats, turns: Floats) -> Floats | None:
        """The waypoints until the way home must begin, and from there."""
        back = self.home(times[1:], points[:, 1:], course)
        late = ~(times[1:] + back <= self.endurance)
        last = int(late.argmax()) if late.any() else len(late)
        if last == 0:
            return None
        flown, here, home = times[: last + 1], points[:, : last + 1], back[last - 1]
        if last < len(late) and times[last + 1] < 2 * self.endurance:  # part of the next leg
            part = np.linspace(0.0, 1.0, 257)[1:-1]
            begin = times[last] + turns[last]
            then = begin + part * (times[last + 1] - begin)
            there = here[:, -1:] + part * (points[:, last + 1] - here[:, -1])[:, None]
            homes = self.home(then, there, course[:, last : last + 1])
            if (can := then + homes <= self.endurance)[0]:
                end = int(can.argmin()) - 1 if not can.all() else len(part) - 1
                flown, home = np.append(flown, then[end]), homes[end]
                here = np.append(here, there[:, end : end + 1], axis=1)
        flown, here = np.append(flown, flown[-1] + home), np.column_stack([here, self.base])
        return np.vstack([flown, here]).T
