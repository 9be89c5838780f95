"""What drones are ordered, in the terms of the IAMSAR Manual, to be read over a radio."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.geo.units import KNOT, radioed
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.fleet import Drone
from DroneSwarmSearch.incident.flights import (
    Flight,
    course,
    down_to_the_minute,
    track,
    up_to_the_minute,
)
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import PARALLEL, SECTOR, Pattern

SHORT = 50.0  # metres; legs that are shorter are not worth a word
NOSE = 3.0  # degrees from the track, above which the nose's heading is mentioned


@dataclass(frozen=True, eq=False)
class Order:
    """The order of one drone: its pattern as it is flown, and its box.

    The box moves with the pattern. It is a rectangle around the tracks, or the circle of a sector
    search; half a track spacing around the tracks belongs to it.

    Attributes:
        incident: the incident.
        number: of the drone, from 0.
        pattern: what it flies.
        flight: its waypoints.
        search: the rows of those from the commence search point to where it leaves.
        particles: possible persons.
    """

    incident: Incident
    number: int
    pattern: Pattern
    flight: Flight
    search: slice
    particles: Particles

    @property
    def craft(self) -> Drone:
        """What the drone can do."""
        return self.incident.craft[self.number]

    # The flight.

    @cached_property
    def _seconds(self) -> Floats:
        """The times of the waypoints, in seconds after the take-off: (n,)."""
        first = self.flight[0].time
        return np.array([(point.time - first).total_seconds() for point in self.flight])

    @cached_property
    def _tracks(self) -> Floats:
        """The turning points of the search, where they are at take-off if the pattern moves.

        (along the first heading, to its right), in metres: (n, 2).
        """
        points = track(self.flight, self.incident.plane)
        over_water = points - self.pattern.drift * self._seconds[:, None]
        return self._beside(over_water[self.search])

    @property
    def _on_scene(self) -> Flight:
        """The waypoints from the commence search point on."""
        return self.flight[self.search.start :]

    @property
    def _searching(self) -> Floats:
        """The times from the commence search point to where it leaves, see `_seconds`."""
        return self._seconds[self.search]

    def _beside(self, points: Floats) -> Floats:
        """Points, (east, north), along and to the right of the first heading, and the reverse."""
        sin = math.sin(self.pattern.heading)
        cos = math.cos(self.pattern.heading)
        beside: Floats = points @ np.array([[sin, cos], [cos, -sin]])
        return beside

    @cached_property
    def _lengths(self) -> Floats:
        """The lengths of the search legs over the water."""
        lengths: Floats = np.hypot(*np.diff(self._tracks, axis=0).T)
        return lengths

    @property
    def way_out(self) -> Flight:
        """The corners of the way to the commence search point."""
        return self.flight[1 : self.search.start]

    @property
    def way_home(self) -> Flight:
        """The corners of the way home."""
        return self.flight[self.search.stop : -1]

    @property
    def reserve(self) -> float:
        """The seconds of the endurance that are left at the landing."""
        return self.craft.endurance - float(self._seconds[-1])

    # The box.

    @property
    def _edges(self) -> tuple[Floats, Floats]:
        """The least and the largest distances of the tracks along and to the right."""
        return self._tracks.min(axis=0), self._tracks.max(axis=0)

    @property
    def corners(self) -> list[str]:
        """The corners of the rectangle that the tracks span when the drone arrives, as read.

        They follow each other around the rectangle, beginning at the commence search point, which
        is left out. None for a sector search.
        """
        if self.pattern.kind == SECTOR:
            return []
        low, high = self._edges
        start = self._tracks[0]
        near = np.where(start - low <= high - start, low, high)
        far = low + high - near
        corners = np.array([start, near, (far[0], near[1]), far, (near[0], far[1])])
        metres = self._beside(corners) + self.pattern.drift * self._searching[0]
        texts = [radioed(tuple(corner)) for corner in self.incident.plane.degrees(metres)]
        others = dict.fromkeys(texts[1:])  # in their order, each once
        others.pop(texts[0], None)
        return [*others]

    @property
    def coverage(self) -> float:
        """The coverage factor: the area of the strips over that of the box."""
        low, high = self._edges
        area = float(np.prod(high - low + self.pattern.spacing))
        if self.pattern.kind == SECTOR:
            area = math.pi * self.pattern.length**2
        swath = self.particles.mean_of(self.craft.swath)
        return swath * float(self._lengths.sum()) / area

    def contains(self, points: Floats, seconds: float) -> Flags:
        """Which points, (east, north), (n, 2), are in the box at some seconds after take-off."""
        beside = self._beside(points - self.pattern.drift * seconds)
        if self.pattern.kind == SECTOR:
            inside: Flags = np.hypot(*(beside - self._tracks[0]).T) <= self.pattern.length
            return inside
        low, high = self._edges
        half = self.pattern.spacing / 2
        is_within: Flags = (beside >= low - half) & (beside <= high + half)
        return is_within[:, 0] & is_within[:, 1]

    def found(self, missed: Floats) -> tuple[float, float]:
        """The probability of containment, POC, and of detection in the box, POD.

        Args:
            missed: the probability that this drone misses each of the possible persons.

        Returns:
            The share of persons in the box half-way through its search, and the share of those
            that the drone finds.
        """
        particles = self.particles
        half_way = float(self._searching[0] + self._searching[-1]) / 2
        since = (self.flight[0].time - self.incident.began).total_seconds()
        inside = self.contains(particles.at(since + half_way), half_way)
        weights = particles.weights * inside
        contained = float(weights.sum())
        found = float(weights @ (1.0 - missed))
        return contained, found / contained if contained else 0.0

    # In words.

    def values(
        self, contained: float, detected: float, corners_out: int, corners_home: int
    ) -> dict[str, str]:
        """The order as names and texts; "" for what does not apply.

        Lengths are those that are flown, and times are rounded inwards: nobody is there earlier, or
        lands later. `contained` and `detected` are POC and POD. The numbers of corners are the most
        that any drone has on its way.
        """
        first = self.flight[0]
        scene, after_scene = self._on_scene[:2]
        leaving = self.flight[self.search.stop - 1].time
        landing = self.flight[-1].time
        is_sector = self.pattern.kind == SECTOR
        corners = dict(enumerate(self.corners))
        return {
            "drone": self.craft.name,
            "pattern": self.pattern.kind,
            **_corners("out", self.way_out, corners_out),
            "commence search point": radioed((scene.latitude, scene.longitude)),
            "corner": corners.get(0, ""),
            "next corner": corners.get(1, ""),
            "third corner": corners.get(2, ""),
            "fourth corner": corners.get(3, ""),
            "first heading": f"{_degrees(course(scene, after_scene))} over the ground",
            "nose": self._nose,
            "radius": _length(self.leg_length) if is_sector else "",
            "leg length": "" if is_sector else _length(self.leg_length),
            "track spacing": "" if is_sector else f"{self.pattern.spacing:.0f} m",
            "legs": self.legs,
            "creep": self._creep,
            "first turn": "starboard" if self.pattern.side > 0 else "port",
            "moving": self._moving,
            "height": "" if self.craft.is_boat else f"{first.altitude:.0f} m",
            "take-off": f"{up_to_the_minute(first.time):%H:%M}",
            "on scene": f"{up_to_the_minute(scene.time):%H:%M}",
            "leave": f"{down_to_the_minute(leaving):%H:%M}",
            **_corners("home", self.way_home, corners_home),
            "landing": f"{down_to_the_minute(landing):%H:%M}",
            "reserve at landing": f"{self.reserve // 60:.0f} min",
            "coverage": f"{self.coverage:.1f}",
            "POC": f"{contained:.0%}",
            "POD": f"{detected:.0%}",
        }

    @property
    def leg_length(self) -> float:
        """The length of a leg in metres: of the first one, or of the longest parallel one."""
        if not self._lengths.size:
            return 0.0
        if self.pattern.kind != PARALLEL:
            return float(self._lengths[0])
        return float(self._along.max())

    @property
    def _along(self) -> Floats:
        """The lengths of a parallel track's legs, without those across to the next one."""
        along = self._lengths[self.pattern.is_along(np.arange(len(self._lengths)))]
        return along[:-1] if len(along) > 1 and along[-1] < SHORT else along

    @property
    def legs(self) -> str:
        """How many legs are flown, and which are shorter."""
        if self.pattern.kind != PARALLEL or not self._lengths.size:
            return plural(len(self._lengths), "leg")
        along = self._along
        text = plural(len(along), "leg")
        if self.pattern.legs < len(along):
            text += f" on {plural(self.pattern.legs, 'track')}"
        usual = _kilometres(along.max())
        first = _kilometres(along[0])
        last = _kilometres(along[-1])
        if first != usual:
            text += f", the first {first}"
        if len(along) > 1 and last != usual:
            text += f", the last {last}"
        return text

    @property
    def _nose(self) -> str:
        """Where the nose points on the first leg, if the wind makes that differ from the track."""
        scene, after_scene = self._on_scene[:2]
        drone = drone_in_wind(self.incident, self.number)
        begin, end = track([scene, after_scene], self.incident.plane)
        seconds = (after_scene.time - scene.time).total_seconds()
        wind = drone.wind(self._searching[:1] + seconds / 2, (begin + end)[:, None] / 2)
        unit = (end - begin) / max(math.hypot(*(end - begin)), 1e-9)
        speed = drone.ground_speed(wind, unit[:, None])
        through_air = (unit[:, None] * speed - wind)[:, 0]
        heading = math.degrees(math.atan2(*through_air))
        over_ground = course(scene, after_scene)
        off = (heading - over_ground + 180) % 360 - 180
        return _degrees(heading) if abs(off) > NOSE else ""

    @property
    def _creep(self) -> str:
        """The direction from one parallel track to the next."""
        if self.pattern.kind != PARALLEL or self.pattern.legs == 1 or len(self._along) == 1:
            return ""
        return _degrees(math.degrees(self.pattern.heading) + 90 * self.pattern.side)

    @property
    def _moving(self) -> str:
        """Where the pattern moves, and how fast."""
        speed = math.hypot(*self.pattern.drift) / KNOT
        if not speed:
            return ""
        return f"{_degrees(math.degrees(math.atan2(*self.pattern.drift)))} {speed:.1f} kn"


def read_aloud(order: dict[str, str]) -> str:
    """An order in a line that can be read over a radio."""
    parts = []
    for name, text in order.items():
        if name in ("pattern", "legs"):
            parts.append(text)
        elif text and name != "drone":
            parts.append(f"{name} {text}")
    return f"{', '.join(parts)}."


def _corners(way: str, corners: Flight, most: int) -> dict[str, str]:
    """The corners of a way as names and texts."""
    texts = [radioed((corner.latitude, corner.longitude)) for corner in corners]
    texts += [""] * (most - len(corners))
    return {f"way {way}, corner {number}": text for number, text in enumerate(texts, 1)}


def _degrees(angle: float) -> str:
    """A direction in three digits."""
    return f"{round(angle) % 360:03d}°"


def _length(metres: float) -> str:
    """A length in kilometres and nautical miles."""
    return f"{_kilometres(metres)} ({metres / 1852:.1f} NM)"


def _kilometres(metres: float) -> str:
    return f"{metres / 1000:.1f} km"
