"""Planned flights: what they are expected to find, and what drones are ordered."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.leeway import KNOT
from DroneSwarmSearch.incident import units
from DroneSwarmSearch.incident.choice import Guess
from DroneSwarmSearch.incident.flights import Waypoint, legs_of
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import PARALLEL, SECTOR, SQUARE, Pattern
from DroneSwarmSearch.incident.report import Report

FIGURES = 40_000  # the number of particles of all figures


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
        """For each drone, a line that can be read over a radio."""
        lines = []
        for number in range(len(self.flights)):
            drone, kind, place, *rest = self.order(number).items()
            flown = ", ".join(
                f"{text} {name}" if name == "legs" else f"{name} {text}"
                for name, text in rest
                if text
            )
            lines.append(f"Drone {drone[1]}: {kind[1]}, {place[0]} {place[1]}, {flown} UTC.")
        return lines

    def order(self, number: int) -> dict[str, str]:
        """What a drone is ordered, by the terms of the IAMSAR Manual."""
        flight, pattern = self.flights[number], self.patterns[number]
        first, scene, *_, last = flight
        flown = max(len(flight) - 3, 1)
        spacing, legs = f"{pattern.spacing:.0f} m", f"{flown}"
        length = f"{pattern.length / 1000:.1f} km ({pattern.length / 1852:.1f} NM)"
        if pattern.kind == PARALLEL:
            count = (flown + 1) // 2
            legs = " + ".join(
                f"{legs}" for legs in (min(count, pattern.legs), count - pattern.legs) if legs > 0
            )
        speed, toward = math.hypot(*pattern.drift) / KNOT, math.atan2(*pattern.drift)
        return {
            "drone": f"{number}",
            "pattern": pattern.kind,
            "commence search point": units.radioed((scene.latitude, scene.longitude)),
            "first heading": f"{math.degrees(pattern.heading) % 360:03.0f}°",
            "radius" if pattern.kind == SECTOR else "leg length": length
            if pattern.kind != SQUARE
            else spacing,
            "track spacing": "" if pattern.kind == SECTOR else spacing,
            "first turn": "starboard" if pattern.side > 0 else "port",
            "legs": legs,
            "moving": f"{math.degrees(toward) % 360:03.0f}° {speed:.1f} kn" if speed else "",
            "height": f"{first.altitude:.0f} m",
            "take-off": f"{first.time:%H:%M}",
            "on scene": f"{scene.time:%H:%M}",
            "landing": f"{last.time:%H:%M}",
        }

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


def _speed(speed: float) -> str:
    """A speed in m/s and knots."""
    return f"{speed:.2g} m/s ({speed / KNOT:.2g} kn)"
