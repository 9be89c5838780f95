"""From an incident to a plan that drones can fly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.choice import Area, CannotFlyError, Guess, choose
from DroneSwarmSearch.incident.coast import Coast
from DroneSwarmSearch.incident.drone import Drone, drone_of
from DroneSwarmSearch.incident.flight_plan import Alternative, FlightPlan
from DroneSwarmSearch.incident.flights import Waypoint
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.particles import simulate
from DroneSwarmSearch.incident.patterns import LEGS_LEFT_OUT, Pattern, point_along

FEW = 2_000  # particles for the first choice of patterns
MANY = 8_000  # particles to improve them
FIGURES = 40_000  # particles of all figures

TRIED_EVERY = 10.0  # metres along a track, to find where it comes to the sea
TRIED = 10_000
MOST_BEGINNINGS = 10


def plan(incident: Incident, *, with_alternatives: bool = False) -> FlightPlan:
    """Plan the flights of all drones: out, a search pattern, and back.

    Args:
        incident: what is known.
        with_alternatives: also compute what other values would change, see `alternatives`.

    Raises:
        ImportError: the package cmaes, of the extra "plan", is missing.
        ValueError: the drones cannot fly in that wind, or not reach the area and return.
    """
    many = simulate(incident, MANY, 1)
    few = many.first(FEW)
    made = _planned(incident, [Area(incident, cloud) for cloud in (few, many, many)], near=())
    if with_alternatives:
        made = replace(made, alternatives=tuple(alternatives(made)))
    return made


def alternatives(made: FlightPlan) -> Iterator[Alternative]:
    """What one more drone, half an hour more and a stronger wind would change, one after another.

    Each comes from a quick plan, which begins with the patterns of this one.
    """
    incident = made.incident
    yield _alternative("One more drone", made, drones=incident.drones + 1)
    yield _alternative("Half an hour more", made, endurance=incident.endurance + 1800)
    stronger = incident.wind.stronger(5 * KNOT)
    # Another wind would also have moved those whom earlier flights looked for.
    if stronger is not None and incident.tracks is None and not incident.flown:
        yield _alternative("A wind 5 kn stronger", made, wind=stronger)


def _alternative(name: str, made: FlightPlan, **values: Any) -> Alternative:
    try:
        incident = replace(made.incident, **values)
        area = Area(incident, simulate(incident, FEW, 1))
        other = _planned(incident, [area], near=made.guesses)
    except CannotFlyError:
        return Alternative(name, points=None, reason="drones cannot fly there and back")
    except ValueError:
        return Alternative(name, points=None, reason="unknown, beyond the limits of what is given")
    more = other.probability_of_success - made.probability_of_success
    return Alternative(name, points=100 * more)


def _planned(incident: Incident, areas: Sequence[Area], near: Sequence[Guess]) -> FlightPlan:
    """A plan whose patterns are chosen on some areas, near those of another plan."""
    with progress("planning", 1.0) as on_progress:
        guesses = choose(areas, near, on_progress)
    coast = Coast(incident)
    patterns = [
        begun_at_sea(areas[-1].pattern(guess), drone_of(incident, number), incident.plane, coast)
        for number, guess in enumerate(guesses)
    ]
    flights = [
        _flight(incident, drone_of(incident, number), pattern)
        for number, pattern in enumerate(patterns)
    ]
    return FlightPlan(
        incident=incident,
        patterns=tuple(patterns),
        flights=tuple(flights),
        particles=simulate(incident, FIGURES, 0),
        guesses=tuple(guesses),
    )


def begun_at_sea(pattern: Pattern, drone: Drone, plane: TangentPlane, coast: Coast) -> Pattern:
    """The pattern without its beginning, as far as that is over land when the drone comes there.

    The commence search point is then at sea, also as it is read over the radio, in tenths of a
    minute. A pattern that is nowhere over the sea stays as it is.

    Args:
        pattern: the pattern.
        drone: that flies it.
        plane: of all metres.
        coast: what is on land.
    """
    begun = pattern
    for _ in range(MOST_BEGINNINGS):
        flown = drone.fly(begun)
        if flown is None:
            break
        arrival = flown[1, 0]
        distances = begun.begin + TRIED_EVERY * np.arange(TRIED, dtype=np.float64)
        track = pattern.points(LEGS_LEFT_OUT) + pattern.drift * arrival
        is_sea = _is_sea(point_along(track, distances), plane, coast)
        if not is_sea.any():
            break
        first = float(distances[is_sea.argmax()])
        if first == begun.begin:
            return begun
        begun = replace(pattern, begin=first)
    return pattern


def _is_sea(points: Floats, plane: TangentPlane, coast: Coast) -> Flags:
    """Whether points, (n, 2), are at sea, and so are the nearest tenths of minutes."""
    tenths = np.round(600 * plane.degrees(points)) / 600
    as_read = plane.metres(*tenths.T)
    is_sea: Flags = ~(coast.is_land(points.T) | coast.is_land(as_read.T))
    return is_sea


def _flight(incident: Incident, drone: Drone, pattern: Pattern) -> list[Waypoint]:
    """The waypoints of a drone along a pattern."""
    flown = drone.fly(pattern)
    assert flown is not None  # the choice has flown it
    take_off = incident.seconds(incident.start)
    points: Floats = incident.plane.degrees(flown[:, 1:])
    last = len(flown) - 1
    return [
        Waypoint(
            time=incident.origin.at(take_off + seconds),
            latitude=latitude,
            longitude=longitude,
            altitude=drone.height,
            searching=0 < row < last,
        )
        for row, (seconds, (latitude, longitude)) in enumerate(
            zip(flown[:, 0].tolist(), points.tolist(), strict=True)
        )
    ]
