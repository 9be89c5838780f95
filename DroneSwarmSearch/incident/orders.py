"""What drones are ordered, in the terms of the IAMSAR Manual."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.units import KNOT, radioed
from DroneSwarmSearch.incident.flights import (
    Flight,
    Waypoint,
    course,
    down_to_the_minute,
    track,
    up_to_the_minute,
)
from DroneSwarmSearch.incident.patterns import PARALLEL, SECTOR, Pattern

CUT = 0.95  # a last leg that is shorter than this share of the first one is mentioned


def order_of(drone: int, pattern: Pattern, flight: Flight) -> dict[str, str]:
    """What a drone, numbered from 1, is ordered; "" for what does not apply.

    Lengths are those that are flown, headings are courses over the ground, and times are
    rounded inwards: nobody is there earlier, or lands later.
    """
    first, scene, after_scene = flight[:3]
    legs = Legs.of(pattern, flight)
    is_sector = pattern.kind == SECTOR
    speed = math.hypot(*pattern.drift) / KNOT
    moving = ""
    if speed:
        moving = f"{_degrees(math.degrees(math.atan2(*pattern.drift)))} {speed:.1f} kn"
    return {
        "drone": f"{drone}",
        "pattern": pattern.kind,
        "commence search point": radioed((scene.latitude, scene.longitude)),
        "first heading": _degrees(course(scene, after_scene)),
        "radius" if is_sector else "leg length": _length(legs.length),
        "track spacing": "" if is_sector else f"{pattern.spacing:.0f} m",
        "first turn": "starboard" if pattern.side > 0 else "port",
        "legs": f"{legs.number}",
        "last leg": "" if legs.last is None else f"{legs.last / 1000:.1f} km",
        "moving": moving,
        "height": f"{first.altitude:.0f} m",
        "take-off": f"{up_to_the_minute(first.time):%H:%M}",
        "on scene": f"{up_to_the_minute(scene.time):%H:%M}",
        "landing": f"{down_to_the_minute(flight[-1].time):%H:%M}",
    }


def order_line(drone: int, pattern: Pattern, flight: Flight) -> str:
    """The order in a line that can be read over a radio."""
    order = order_of(drone, pattern, flight)
    parts = []
    for name, text in order.items():
        if name == "pattern":
            parts.append(text)
        elif name == "legs":
            parts.append(Legs.of(pattern, flight).words)
        elif text and name != "drone":
            parts.append(f"{name} {text}")
    return f"Drone {drone}: {', '.join(parts)} UTC."


class Legs(NamedTuple):
    """The search legs of a flight, without those across to the next track.

    Attributes:
        number: how many are flown.
        tracks: the number of parallel tracks along which they lie; 0 for other patterns.
        length: the length of one in metres, over the water if the pattern moves.
        first: that of the first one, if it is shorter, because it begins on land; else None.
        last: that of the last one, if it is cut short; else None.
    """

    number: int
    tracks: int
    length: float
    first: float | None
    last: float | None

    @classmethod
    def of(cls, pattern: Pattern, flight: Sequence[Waypoint]) -> Legs:
        """The legs of a flight along a pattern."""
        plane = TangentPlane(flight[1].latitude, flight[1].longitude)
        seconds = np.array([(point.time - flight[0].time).total_seconds() for point in flight])
        over_water = track(flight, plane) - pattern.drift * seconds[:, None]
        lengths = np.hypot(*np.diff(over_water[1:-1], axis=0).T)
        if pattern.kind != PARALLEL or not lengths.size:
            length = float(lengths[0]) if lengths.size else 0.0
            return cls(number=len(lengths), tracks=0, length=length, first=None, last=None)
        is_along = pattern.is_along(np.arange(len(lengths)))
        along = lengths[is_along]
        length = float(along.max())
        first = None
        if is_along[0] and along[0] < CUT * length:
            first = float(along[0])
        last = None
        if len(along) > 1 and is_along[-1] and along[-1] < CUT * length:
            last = float(along[-1])
        return cls(
            number=len(along),
            tracks=min(pattern.legs, len(along)),
            length=length,
            first=first,
            last=last,
        )

    @property
    def words(self) -> str:
        """How many legs there are."""
        text = plural(self.number, "leg")
        if 0 < self.tracks < self.number:
            text += f" on {plural(self.tracks, 'track')}"
        if self.first is not None:
            text += f", first leg {self.first / 1000:.1f} km"
        return text


def _degrees(angle: float) -> str:
    """A direction in three digits."""
    return f"{round(angle) % 360:03d}°"


def _length(metres: float) -> str:
    """A length in kilometres and nautical miles."""
    return f"{metres / 1000:.1f} km ({metres / 1852:.1f} NM)"
