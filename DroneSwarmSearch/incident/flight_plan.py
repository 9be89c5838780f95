"""A plan that drones can fly, as plain data, with what it is expected to find."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.text import capitalised, enumerated, plural
from DroneSwarmSearch.geo.coast import NONE, Land
from DroneSwarmSearch.geo.units import KNOT, radioed
from DroneSwarmSearch.incident.by_class import ByClass, in_words
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.families import Boxes, Shape
from DroneSwarmSearch.incident.fleet import Drone
from DroneSwarmSearch.incident.flights import (
    Waypoint,
    down_to_the_minute,
    least_distance,
    legs_of,
    track,
    up_to_the_minute,
)
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.manual import Worksheet
from DroneSwarmSearch.incident.orders import Order, read_aloud
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import Pattern

MARGIN = 0.1  # around everything that files show, as a share of its size
WIDER = 2.5  # what lies far away is not shown if files became so many times as wide
MENTIONED = 0.005  # the least share of persons who strand that is mentioned
HOLDS = 2.0  # percentage points that a plan may lose by a late take-off and still holds


@dataclass(frozen=True)
class Alternative:
    """What another value of an incident would change.

    Attributes:
        name: the change in words, such as "One more drone".
        points: by how many percentage points the probability of success would change; None if that
            cannot be planned.
        reason: why not; "" if it can.
    """

    name: str
    points: float | None
    reason: str = ""

    @property
    def sentence(self) -> str:
        """The change and what it brings."""
        if self.points is None:
            return f"{self.name}: {self.reason}."
        points = round(self.points)
        if points == 0:
            return f"{self.name}: no change."
        noun = "point" if abs(points) == 1 else "points"
        return f"{self.name}: {points:+d} {noun}."


class Part(NamedTuple):
    """A part of all persons: those of a hypothesis, or of an object class.

    Attributes:
        name: of the hypothesis or the class.
        weight: how likely it is.
        probability_of_success: that the person is found, if it is so.
    """

    name: str
    weight: float
    probability_of_success: float


class LogEntry(NamedTuple):
    """A flight of any sortie.

    Attributes:
        drone: its name.
        take_off: when it began.
        landing: when it ended, or when the drone broke off.
        swath: the strip that the drone saw, in metres.
        probability_of_detection: of persons in the strip.
        worth: the share of all persons that it finds, and no flight before it.
        is_planned: whether it is one of this plan.
    """

    drone: str
    take_off: datetime
    landing: datetime
    swath: ByClass
    probability_of_detection: ByClass
    worth: float
    is_planned: bool


class Delay(NamedTuple):
    """What the flights of a plan would find if all drones took off later.

    Attributes:
        minutes: by how much.
        points: by how many percentage points the probability of success would change.
    """

    minutes: int
    points: float


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """The flights of all drones, from take-off to landing.

    Each drone flies a search pattern until it must return. It searches from the commence search
    point to the landing, also on its way back. Drones fly at heights of their own.

    Attributes:
        incident: the incident.
        patterns: one for each drone.
        flights: the waypoints of each drone, in the order of their times.
        searches: the rows of each drone's waypoints from its commence search point to where it
            leaves; others between take-off and landing are corners of ways around no-fly areas.
        particles: the possible persons of all figures; the choice of the patterns has not seen
            them.
        points_more: by how many percentage points free patterns find more than adjacent boxes; None
            if the plan is adjacent boxes.
        shape: the patterns relative to the area, with which a similar plan can begin: adjacent
            boxes, free patterns, or the manual's worksheets.
        delays: what a later take-off would change, in the order of the minutes.
        alternatives: what other values of the incident would change, see `alternatives`.
    """

    incident: Incident
    patterns: tuple[Pattern, ...] = field(repr=False)
    flights: tuple[list[Waypoint], ...] = field(repr=False)
    searches: tuple[slice, ...] = field(repr=False)
    particles: Particles = field(repr=False)
    shape: Shape = field(repr=False)
    points_more: float | None = None
    delays: tuple[Delay, ...] = field(default=(), repr=False)
    alternatives: tuple[Alternative, ...] = field(default=(), repr=False)

    # What it finds.

    @property
    def legs(self) -> list[Floats]:
        """The legs on which each drone searches, see `flights.legs_of`."""
        plane = self.incident.plane
        since = self.incident.began
        return [legs_of(flight, plane, since) for flight in self.flights]

    @cached_property
    def sweeps(self) -> list[tuple[Ints, Floats]]:
        """For each drone, which particle it sweeps over, and when, in seconds: (m,) each."""
        pairs = zip(self.incident.craft, self.legs, strict=True)
        return [self.particles.sweeps(legs, drone.swath) for drone, legs in pairs]

    def missed(self, by: datetime | None = None) -> Floats:
        """The probability that all drones miss each particle up to a time: float64, (n,)."""
        missed = np.ones_like(self.particles.weights)
        for drone, (swept, when) in zip(self.incident.craft, self.sweeps, strict=True):
            if by is not None:
                swept = swept[when <= self.incident.seconds(by)]
            missed *= self.particles.missed_after(swept, drone.probability_of_detection)
        return missed

    def success(self, by: datetime | None = None) -> float:
        """The probability that the person is found by a time, by default the last landing."""
        return float(self.particles.weights @ (1.0 - self.missed(by)))

    @property
    def probability_of_success(self) -> float:
        """The probability that the flights find the person."""
        return self.success()

    @property
    def parts(self) -> list[Part]:
        """What is found of each hypothesis, and of each object class, if there are several.

        How likely each one is accounts for earlier flights.
        """
        incident = self.incident
        found = 1.0 - self.missed()
        names = [each.name for each in incident.cases]
        groups = (
            (names, self.particles.hypotheses),
            (incident.object_classes, self.particles.kinds),
        )
        parts = []
        for called, numbers in groups:
            if len(called) == 1:
                continue
            for number, name in enumerate(called):
                weights = self.particles.weights * (numbers == number)
                weight = float(weights.sum())
                success = float(weights @ found) / weight if weight else 0.0
                parts.append(Part(name, weight, success))
        return parts

    def ground_speeds(self, number: int) -> list[float]:
        """The speed of a drone over the ground on each leg, in m/s."""
        flight = self.flights[number]
        seconds = [(point.time - flight[0].time).total_seconds() for point in flight]
        flown = np.column_stack([seconds, track(flight, self.incident.plane)])
        speeds: list[float] = drone_in_wind(self.incident, number).ground_speeds(flown).tolist()
        return speeds

    def density(self, time: datetime, size: int = 80) -> tuple[Floats, Floats, Floats]:
        """Where the person may be at a time if nobody searches: a smoothed histogram of particles.

        Returns:
            Probabilities, float64, (size, size), [row, column], the northern row first; and the
            corners in metres, (west, south) and (east, north).
        """
        positions = self.particles.at(self.incident.seconds(time))
        low, high = np.percentile(positions, (0.1, 99.9), axis=0)
        middle = (low + high) / 2
        widest = max(self.particles.mean_of(drone.swath) for drone in self.incident.craft)
        half = max(0.6 * (high - low).max(), widest)
        edges = [np.linspace(centre - half, centre + half, size + 1) for centre in middle]
        east, north = positions.T
        counts: Floats
        counts, *_ = np.histogram2d(east, north, edges, weights=self.particles.weights)
        for _ in range(4):
            for _ in range(2):
                counts = (np.roll(counts, 1, axis=0) + 2 * counts + np.roll(counts, -1, axis=0)) / 4
                counts = counts.T
        return counts.T[::-1], middle - half, middle + half

    @cached_property
    def extent(self) -> tuple[Floats, Floats]:
        """The corners, (east, north) in metres, of an area with all searches and most persons.

        Bases, and what is known of where persons were, are in it unless they are far away.
        """
        incident = self.incident
        tracks = [track(flight, incident.plane) for flight in self.flights]
        seen = [points[rows] for points, rows in zip(tracks, self.searches, strict=True)]
        for time in (self.on_scene, self.landed):
            positions = self.particles.at(incident.seconds(time))
            seen.append(np.percentile(positions, (0.1, 99.9), axis=0))
        points = np.vstack(seen)
        low = points.min(axis=0)
        high = points.max(axis=0)
        for others in (*tracks, *(mark.points for mark in incident.marks)):
            wider_low = np.minimum(low, others.min(axis=0))
            wider_high = np.maximum(high, others.max(axis=0))
            if (wider_high - wider_low).max() <= WIDER * (high - low).max():
                low = wider_low
                high = wider_high
        margin = MARGIN * (high - low).max()
        return low - margin, high + margin

    def land(self, low: Floats, high: Floats) -> Land | None:
        """The land between two corners and beyond; None if no coast is known."""
        return self.incident.land_within(float(np.abs([low, high]).max()))

    @property
    def on_scene(self) -> datetime:
        """When the first drone is at its commence search point."""
        pairs = zip(self.flights, self.searches, strict=True)
        beginnings: list[Waypoint] = [flight[rows.start] for flight, rows in pairs]
        return min(waypoint.time for waypoint in beginnings)

    @property
    def landed(self) -> datetime:
        """When the last drone lands."""
        return max(flight[-1].time for flight in self.flights)

    # In words.

    def order(self, number: int) -> dict[str, str]:
        """What a drone is ordered, see `orders`; drones count from 0 here, and from 1 in words."""
        return self._order_texts[number]

    @cached_property
    def _order_texts(self) -> list[dict[str, str]]:
        incident = self.incident
        orders = [
            Order(
                incident=incident,
                number=number,
                pattern=self.patterns[number],
                flight=self.flights[number],
                search=self.searches[number],
                particles=self.particles,
            )
            for number in range(len(self.flights))
        ]
        corners_out = max(len(order.way_out) for order in orders)
        corners_home = max(len(order.way_home) for order in orders)
        texts = []
        for order, legs in zip(orders, self.legs, strict=True):
            contained, detected = order.found(self.particles.missed(legs, order.craft))
            texts.append(order.values(contained, detected, corners_out, corners_home))
        return texts

    @property
    def success_by_part(self) -> str:
        """What is found of each hypothesis and each object class, in a sentence; "" if only one."""
        shares = [
            f"{part.probability_of_success:.0%} of {part.name} ({part.weight:.0%} likely)"
            for part in self.parts
        ]
        return f"It finds {', '.join(shares)}." if shares else ""

    @property
    def orders(self) -> list[str]:
        """For each drone, a line that can be read over a radio; drones are numbered from 1."""
        pairs = zip(self.incident.craft, self._order_texts, strict=True)
        return [f"{capitalised(drone.label)}: {read_aloud(order)}" for drone, order in pairs]

    @property
    def briefing(self) -> list[str]:
        """What all drones must know, in sentences: the datum, the patterns, and how late is late.

        The datum is the mean position of the persons when the search begins.
        """
        mean = self.particles.mean(self.incident.seconds(self.on_scene))
        datum = radioed(tuple(self.incident.plane.degrees(mean[None])[0].tolist()))
        scene = up_to_the_minute(self.on_scene)
        sentences = [f"Datum {datum} at {scene:%H:%M} UTC.", self._family]
        if self.delays:
            sentences.append(self._takeoff)
        return [*sentences, *self._shared_heights]

    @property
    def _shared_heights(self) -> list[str]:
        """Which drones share a height, and how far apart they stay."""
        sentences = []
        flights = self.flights
        flying = [n for n, drone in enumerate(self.incident.craft) if not drone.is_boat]
        for height in sorted({flights[number][0].altitude for number in flying}):
            sharing = [number for number in flying if flights[number][0].altitude == height]
            if len(sharing) > 1:
                pairs = combinations(sharing, 2)
                apart = min(least_distance(flights[a], flights[b]) for a, b in pairs)
                far = "are never in the air together"
                if math.isfinite(apart):
                    far = f"come within {apart:.0f} m of each other"
                names = enumerated([self.incident.craft[number].name for number in sharing])
                sentences.append(f"Drones {names} share the height of {height:.0f} m and {far}.")
        return sentences

    @property
    def _family(self) -> str:
        """How the patterns divide the area."""
        if isinstance(self.shape, Worksheet):
            return (
                f"The manual's rectangle: total probable error {_miles(self.shape.error)}, datums "
                f"{_miles(self.shape.divergence)} apart, search radius {_miles(self.shape.radius)}."
            )
        if self.points_more is not None:
            return (
                f"Free patterns, which find {self.points_more:.0f} points more than adjacent boxes."
            )
        if not isinstance(self.shape, Boxes):
            return "Free patterns: no adjacent boxes can be flown there."
        if len(self.flights) == 1:
            return "One box."
        return f"{len(self.flights)} adjacent boxes of one rectangle."

    @property
    def _takeoff(self) -> str:
        """For which take-off times the plan holds, and what ten minutes cost."""
        minutes = np.array([delay.minutes for delay in self.delays], np.float64)
        lost = -np.array([delay.points for delay in self.delays])
        holding = np.arange(minutes[-1] + 1)
        is_lost = np.interp(holding, minutes, lost) > HOLDS
        last = int(is_lost.argmax()) - 1 if is_lost.any() else len(holding) - 1
        first = up_to_the_minute(self.incident.start)
        latest = down_to_the_minute(self.incident.start + timedelta(minutes=last))
        times = f"{first:%H:%M} to {latest:%H:%M}" if latest > first else f"{first:%H:%M}"
        ten = round(float(np.interp(10.0, minutes, lost)))
        cost = "costs nothing" if ten <= 0 else f"costs {plural(ten, 'point')}"
        return f"Holds for take-offs at {times} UTC; a delay of ten minutes {cost}."

    @property
    def cumulative(self) -> float:
        """The probability that these or earlier flights find the person."""
        missed_before = 1.0 - self.particles.found
        return 1.0 - missed_before * (1.0 - self.probability_of_success)

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
            if flight.landing <= incident.began:
                before.append(str(number))
            elif flight.waypoints[0].time < incident.began:
                during.append(str(number))
        report = f"the report of {incident.began:%H:%M}"
        if before:
            sentences.append(f"Not counted, because flown before {report}: {', '.join(before)}.")
        if during:
            sentences.append(f"Counted only from {report} on: {', '.join(during)}.")
        flying = [
            f"{flight.name or number} until {flight.landing:%H:%M}"
            for number, flight in enumerate(incident.flown, 1)
            if flight.landing > incident.start
        ]
        if flying:
            sentences.append(f"Still flying, and counted as planned: {', '.join(flying)}.")
        return sentences

    @property
    def log(self) -> list[LogEntry]:
        """All flights of all sorties, in the order of their take-offs, and what each was worth."""
        particles = self.particles
        entries = [
            LogEntry(
                flight.name or f"{number}",
                flight.take_off,
                flight.landing,
                flight.swath,
                flight.probability_of_detection,
                worth,
                is_planned=False,
            )
            for number, (flight, worth) in enumerate(
                zip(self.incident.flown, particles.worth, strict=True), 1
            )
        ]
        left = particles.weights * (1.0 - particles.found)
        for drone, flight, (swept, _) in zip(
            self.incident.craft, self.flights, self.sweeps, strict=True
        ):
            missed = left * particles.missed_after(swept, drone.probability_of_detection)
            entries.append(
                LogEntry(
                    drone.name,
                    flight[0].time,
                    flight[-1].time,
                    drone.swath,
                    drone.probability_of_detection,
                    float((left - missed).sum()),
                    is_planned=True,
                )
            )
            left = missed
        return entries

    @property
    def assumptions(self) -> list[str]:
        """What the probability of success assumes, in sentences."""
        incident = self.incident
        drift = "The person drifts as the tracks do."
        if incident.tracks is None:
            errors = dict.fromkeys(each.place.error_words for each in incident.cases)
            drift = (
                f"{'. '.join(errors)}, the wind to {_speed(incident.wind_error)} and the current "
                f"to {_speed(incident.current_error)} (standard deviations along each axis)."
            )
        if self.particles.ashore >= MENTIONED:
            drift += f" {self.particles.ashore:.0%} of the persons strand by {self.landed:%H:%M}."
        if incident.coast == NONE:
            drift += " No coast is known, so nobody strands."
        return [drift, *self._abilities]

    @property
    def _abilities(self) -> list[str]:
        """What the drones can do, in sentences; those that can do the same share one."""
        alike: dict[Drone, list[int]] = {}
        for number, drone in enumerate(self.incident.craft):
            able = replace(
                drone, name="", altitude=0.0, base=(0.0, 0.0), take_off=self.incident.start
            )
            alike.setdefault(able, []).append(number)
        if len(alike) == 1:
            return self._ability_of_all
        sentences = []
        for numbers in alike.values():
            labels = [self.incident.craft[number].label for number in numbers]
            sentences.append(f"{capitalised(' and '.join(labels))}: {self._ability(numbers[0])}.")
        return [*sentences, "Strips account for sea, light and visibility."]

    @property
    def _ability_of_all(self) -> list[str]:
        """What drones that are alike can do."""
        drone = self.incident.craft[0]
        limit = ""
        if drone.speed > drone.fastest_over_ground:
            limit = f", at most {_speed(drone.fastest_over_ground)} over the ground"
        how = f"fly {_speed(drone.speed)} in still air{limit}, the wind at their height is"
        if drone.is_boat:
            how = f"sail {_speed(drone.speed)} through the water, the current is"
        found, strip = self._seen(drone)
        return [
            f"{capitalised(drone.kind)}s {how} {_speed(self._blows(0))}, and a right-angle turn "
            f"takes {drone.turn:g} s.",
            f"They land after at most {drone.airborne / 60:.0f} min.",
            f"They find {found} of those in a strip of {strip}, which already accounts for sea, "
            "light and visibility.",
        ]

    def _ability(self, number: int) -> str:
        """What one drone can do, in few words."""
        drone = self.incident.craft[number]
        found, strip = self._seen(drone)
        flow = "current" if drone.is_boat else "wind at its height"
        return (
            f"{_speed(drone.speed)}, {flow} {_speed(self._blows(number))}, at most "
            f"{drone.airborne / 60:.0f} min, finds {found} in a strip of {strip}"
        )

    def _blows(self, number: int) -> float:
        """The wind at the height of a drone, or the current of a boat, in m/s."""
        flying = drone_in_wind(self.incident, number)
        return float(np.hypot(*flying.wind(np.zeros(1), np.zeros((2, 1))))[0])

    def _seen(self, drone: Drone) -> tuple[str, str]:
        """The probability of detection and the width of the strip, in words."""
        found = in_words(drone.probability_of_detection, "{:.0%}".format)
        return found, in_words(drone.swath, "{:.0f} m".format)


def _miles(metres: float) -> str:
    """A length in nautical miles."""
    return f"{metres / 1852:.2f} NM"


def _speed(speed: float) -> str:
    """A speed in m/s and knots."""
    return f"{speed:.2g} m/s ({speed / KNOT:.2g} kn)"
