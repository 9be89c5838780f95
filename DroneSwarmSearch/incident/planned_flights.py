"""Planned flights: what they are expected to find, and what drones are ordered."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.choice import Guess
from DroneSwarmSearch.incident.flights import (
    Waypoint,
    course,
    down_to_the_minute,
    legs_of,
    track,
    up_to_the_minute,
)
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import PARALLEL, SECTOR, Pattern
from DroneSwarmSearch.incident.report import Report

FIGURES = 40_000  # the number of particles of all figures
CUT = 0.95  # a last leg that is shorter than this share of the first one is mentioned


@dataclass(frozen=True, eq=False)
class PlannedFlights:
    """The data of a `FlightPlan`, see there, with its figures and orders."""

    incident: Report
    patterns: tuple[Pattern, ...] = field(repr=False)
    flights: tuple[list[Waypoint], ...] = field(repr=False)
    guesses: tuple[Guess, ...] = field(repr=False)

    @cached_property
    def particles(self) -> Particles:
        """The possible persons of all figures; the choice of the patterns has not seen them."""
        return self.incident.particles(FIGURES, 0)

    @cached_property
    def _passes(self) -> tuple[Ints, Floats]:
        """Which particle a drone passes, and when, in seconds after the last known position."""
        incident = self.incident
        legs = [legs_of(flight, incident.plane, incident.time) for flight in self.flights]
        who, when = zip(*(self.particles.passes(leg, incident.swath) for leg in legs), strict=True)
        return np.concatenate(who), np.concatenate(when)

    def success(self, by: datetime | None = None) -> float:
        """The probability that the person is found by a time, by default the last landing."""
        cloud, (who, when) = self.particles, self._passes
        if by is not None:
            who = who[when <= self.incident.seconds(by)]
        missed = cloud.missed_after(who, self.incident.probability_of_detection)
        return float(cloud.weights @ (1.0 - missed))

    @property
    def probability_of_success(self) -> float:
        """The probability that the flights find the person."""
        return self.success()

    def density(self, time: datetime, size: int = 80) -> tuple[Floats, Floats, Floats]:
        """Where the person may be at a time if nobody searches: a smoothed histogram of particles.

        Returns:
            Probabilities, float64, (size, size), [row, column], the northern row first; and the
            corners in metres, (west, south) and (east, north).
        """
        positions, weights = self.particles.at(self.incident.seconds(time)), self.particles.weights
        low, high = np.percentile(positions, (0.1, 99.9), axis=0)
        middle, half = (low + high) / 2, max(0.6 * (high - low).max(), self.incident.swath)
        edges = [np.linspace(centre - half, centre + half, size + 1) for centre in middle]
        counts: Floats
        counts, *_ = np.histogram2d(positions[:, 0], positions[:, 1], edges, weights=weights)
        for _ in range(4):
            for _ in range(2):
                counts = (np.roll(counts, 1, axis=0) + 2 * counts + np.roll(counts, -1, axis=0)) / 4
                counts = counts.T
        return counts.T[::-1], middle - half, middle + half

    @property
    def on_scene(self) -> datetime:
        """When the first drone is at its commence search point."""
        return min(flight[1].time for flight in self.flights)

    @property
    def landed(self) -> datetime:
        """When the last drone lands."""
        return max(flight[-1].time for flight in self.flights)

    @cached_property
    def orders(self) -> list[str]:
        """For each drone, a line that can be read over a radio; drones are numbered from 1."""
        lines = []
        for number in range(len(self.flights)):
            order = self.order(number)
            parts = [order.pop("pattern")]
            head = f"Drone {order.pop('drone')}"
            legs = _Legs.of(self.patterns[number], self.flights[number])
            for name, text in order.items():
                if name == "legs":
                    parts.append(legs.words)
                elif text:
                    parts.append(f"{name} {text}")
            lines.append(f"{head}: {', '.join(parts)} UTC.")
        return lines

    def order(self, number: int) -> dict[str, str]:
        """What a drone is ordered, by the terms of the IAMSAR Manual; "" for what does not apply.

        Lengths are those that are flown, headings are courses over the ground, and times are
        rounded inwards: nobody is there earlier, or lands later.
        """
        flight, pattern = self.flights[number], self.patterns[number]
        first, scene, after_scene, *_ = flight
        legs = _Legs.of(pattern, flight)
        is_sector = pattern.kind == SECTOR
        speed = math.hypot(*pattern.drift) / KNOT
        moving = ""
        if speed:
            moving = f"{_degrees(math.degrees(math.atan2(*pattern.drift)))} {speed:.1f} kn"
        return {
            "drone": f"{number + 1}",
            "pattern": pattern.kind,
            "commence search point": units.radioed((scene.latitude, scene.longitude)),
            "first heading": _degrees(course(scene, after_scene)),
            "radius" if is_sector else "leg length": _length(legs.first),
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

    @property
    def earlier(self) -> list[str]:
        """What became of earlier flights, in sentences; none if there were none."""
        incident = self.incident
        if not incident.flown:
            return []
        sentences = [
            f"After {plural(len(incident.flown), 'flight')} that found nobody, and would have "
            f"found {self.particles.found:.0%} of the persons."
        ]
        before: list[str] = []
        during: list[str] = []
        for number, flight in enumerate(incident.flown, 1):
            if flight.landing <= incident.time:
                before.append(str(number))
            elif flight.waypoints[0].time < incident.time:
                during.append(str(number))
        report = f"the report of {incident.time:%H:%M}"
        if before:
            sentences.append(f"Not counted, because flown before {report}: {', '.join(before)}.")
        if during:
            sentences.append(f"Counted only from {report} on: {', '.join(during)}.")
        return sentences

    @property
    def assumptions(self) -> list[str]:
        """What the probability of success assumes, in sentences."""
        incident = self.incident
        drift = "The person drifts as the tracks do."
        if incident.tracks is None:
            drift = (
                f"The position is known to {incident.position_sd:.0f} m, the wind to "
                f"{_speed(incident.wind_error)} and the current to "
                f"{_speed(incident.current_error)} (standard deviations along each axis)."
            )
        if self.particles.ashore >= 0.005:
            drift += f" {self.particles.ashore:.0%} of the persons strand by {self.landed:%H:%M}."
        blows = float(np.hypot(*incident.drone(0).wind(np.zeros(1), np.zeros((2, 1))))[0])
        return [
            drift,
            f"Drones fly {_speed(incident.speed)} in still air, the wind at their height is "
            f"{_speed(blows)}, and a right-angle turn takes {incident.turn:g} s.",
            f"They land after at most {(incident.endurance - incident.reserve) / 60:.0f} min.",
            f"They find {incident.probability_of_detection:.0%} of those in a strip of "
            f"{incident.swath:.0f} m, which already accounts for sea, light and visibility.",
        ]


class _Legs(NamedTuple):
    """The search legs of a flight, without those across to the next track.

    Attributes:
        number: how many are flown.
        tracks: the number of parallel tracks along which they lie; 0 for other patterns.
        first: the length of the first one in metres, over the water if the pattern moves.
        last: that of the last one, if it is cut short; else None.
    """

    number: int
    tracks: int
    first: float
    last: float | None

    @classmethod
    def of(cls, pattern: Pattern, flight: Sequence[Waypoint]) -> _Legs:
        """The legs of a flight along a pattern."""
        plane = TangentPlane(flight[1].latitude, flight[1].longitude)
        points = track(flight, plane)
        seconds = np.array([(point.time - flight[0].time).total_seconds() for point in flight])
        over_water = points - pattern.drift * seconds[:, None]
        lengths = np.hypot(*np.diff(over_water[1:-1], axis=0).T)
        if pattern.kind != PARALLEL or not lengths.size:
            first = float(lengths[0]) if lengths.size else 0.0
            return cls(len(lengths), 0, first, None)
        is_along = pattern.is_along(np.arange(len(lengths)))
        along = lengths[is_along]
        last = float(along[-1]) if is_along[-1] and along[-1] < CUT * along[0] else None
        return cls(len(along), min(pattern.legs, len(along)), float(along[0]), last)

    @property
    def words(self) -> str:
        """How many legs there are."""
        text = plural(self.number, "leg")
        if 0 < self.tracks < self.number:
            text += f" on {plural(self.tracks, 'track')}"
        return text


def _degrees(angle: float) -> str:
    """A direction in three digits."""
    return f"{round(angle) % 360:03d}°"


def _length(metres: float) -> str:
    """A length in kilometres and nautical miles."""
    return f"{metres / 1000:.1f} km ({metres / 1852:.1f} NM)"


def _speed(speed: float) -> str:
    """A speed in m/s and knots."""
    return f"{speed:.2g} m/s ({speed / KNOT:.2g} kn)"
