"""From an incident to a plan that drones can fly."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.geo.sun import next_sunrise
from DroneSwarmSearch.geo.units import KNOT
from DroneSwarmSearch.incident.choice import (
    CannotFlyError,
    Deadline,
    Effort,
    better_boxes,
    first_boxes,
    free_patterns,
    refusal,
)
from DroneSwarmSearch.incident.coast import Coast
from DroneSwarmSearch.incident.drone import DroneInWind, Flown, drone_in_wind
from DroneSwarmSearch.incident.families import Area, Boxes, FreePatterns, Shape
from DroneSwarmSearch.incident.flight_plan import Alternative, Delay, FlightPlan
from DroneSwarmSearch.incident.flights import Flight, Waypoint, least_distance
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.manual import Worksheet, worksheet
from DroneSwarmSearch.incident.particles import Particles, simulate
from DroneSwarmSearch.incident.patterns import LEGS_LEFT_OUT, Pattern, point_along

FEW = 2_000  # particles for the first choice of patterns
MANY = 5_000  # particles to improve them
FIGURES = 25_000  # particles of all figures, whose standard errors are then at most 0.3%

QUICK = 5  # generations of an alternative
BEST = "best"
MANUAL = "manual"
METHODS = (BEST, MANUAL)

LAPS = 2  # in which all free patterns are improved

POINTS_MORE = 2.0
"""By how many percentage points free patterns must find more than adjacent boxes to be ordered."""

DELAYS = [timedelta(minutes=minutes) for minutes in range(0, 31, 5)]
"""By which the take-off may be late."""

CLEAR = 100.0
"""Metres between two drones at the same height, at all times from take-off to landing."""

LATEST = 20
"""Minutes by which a drone takes off later than others at its height, to keep clear of them."""

TRIED_EVERY = 10.0  # metres along a track, to find where it comes to the sea
TRIED = 10_000
MOST_BEGINNINGS = 10


def plan(
    incident: Incident,
    *,
    method: str = BEST,
    seconds: float | None = None,
    with_alternatives: bool = False,
) -> FlightPlan:
    """Plan the flights of all drones: out, a search pattern, and back.

    First, one rectangle is divided into adjacent boxes, one for each drone, as a coordinator would
    order it. Free patterns take their place only if they find 2 percentage points more.

    Args:
        incident: what is known.
        method: "best"; or "manual", the plan of the IAMSAR Manual's worksheets, as a baseline: the
            rectangle that they find, divided into adjacent boxes, see `incident.manual`.
        seconds: the CPU time after which patterns are no longer improved; the first ones take
            about a second a drone, whatever it is. By default, the work is fixed, so that equal
            incidents give equal plans.
        with_alternatives: also compute what other values would change, see `alternatives`.

    Raises:
        ImportError: the package cmaes, of the extra "plan", is missing.
        ValueError: the drones cannot fly in that wind, or not reach the area and return.
    """
    checks.choice("method", method, METHODS)
    if seconds is not None:
        seconds = checks.positive("seconds", seconds)
        if method == MANUAL:
            raise ValueError(
                "seconds cannot be given together with method 'manual', which improves nothing"
            )
    for number in range(len(incident.craft)):
        _check_light(incident, number)
    figures = simulate(incident, FIGURES, 0)
    if method == MANUAL:
        area = Area(incident, figures)
        sheet = worksheet(incident)
        if sheet.effort <= 0.0:
            raise CannotFlyError(refusal(area))
        made = _flown(area, sheet, figures)
    else:
        made = _best(incident, figures, Deadline(seconds))
    made = replace(made, delays=_delays(made))
    if with_alternatives:
        made = replace(made, alternatives=tuple(alternatives(made)))
    return made


def _check_light(incident: Incident, number: int) -> None:
    """Raise a ValueError for a drone that takes off by night, unless it is one for the night."""
    drone = drone_in_wind(incident, number)
    if drone.light > 0.0:
        return
    where = incident.origin.position
    take_off = drone.craft.take_off
    rises = next_sunrise(where, take_off)
    day = "does not rise that day" if rises is None else f"rises at {rises:%H:%M}"
    raise ValueError(
        f"start must be by day, unless drones are for the night (night), got {take_off:%H:%M} UTC "
        f"for {drone.craft.label}, when the sun is down; it {day}"
    )


def _best(incident: Incident, figures: Particles, deadline: Deadline) -> FlightPlan:
    """The best adjacent boxes, or free patterns if they find clearly more."""
    many = Area(incident, simulate(incident, MANY, 1))
    with progress("planning", 1.0) as on_progress:
        shapes = _chosen(many.first(FEW), many, deadline, on_progress)
    plans = [_flown(many, shape, figures) for shape in shapes]
    made = plans[0]
    for other in plans[1:]:
        more = 100 * (other.probability_of_success - made.probability_of_success)
        if more >= POINTS_MORE:
            made = replace(other, points_more=more)
    return made


def _chosen(
    few: Area, many: Area, deadline: Deadline, on_progress: Callable[[float], object]
) -> list[Boxes | FreePatterns]:
    """The best adjacent boxes and the best free patterns, improved until the deadline.

    Both begin on few particles and are improved on many. There are no free patterns if the time is
    up before each of several equal drones has one.
    """

    def report(done: float) -> None:
        on_progress(min(max(done, deadline.elapsed), 1.0) if deadline.is_set else done)

    effort = Effort(deadline)
    drawn = None
    if not few.is_uniform:  # one rectangle suits them badly: each first has a pattern of its own
        effort = Effort(deadline, starts=1)
        with contextlib.suppress(CannotFlyError):
            drawn = free_patterns(few, [], Effort(Deadline(None), starts=1))
    try:
        boxes = first_boxes(few, effort)
    except CannotFlyError:  # perhaps because of land: patterns of their own may do
        free = free_patterns(few, [], Effort(Deadline(None)))
        return [] if free is None else [free_patterns(many, free, effort) or free]
    report(0.3)
    boxes = better_boxes(many, boxes, effort)
    report(0.5)
    drawn = drawn or free_patterns(few, [], effort)
    report(0.8)
    if drawn is None:
        return [boxes]
    free = min(few.as_free(boxes), drawn, key=few.left)
    seed = 1
    for _ in range(LAPS):
        free = free_patterns(many, free, effort, seed) or free
        seed += 1
        report(0.9)
    while deadline.is_set and not deadline.is_over:
        boxes = better_boxes(many, boxes, effort, seed)
        free = free_patterns(many, free, effort, seed) or free
        seed += 1
        report(0.9)
    on_progress(1.0)
    return [boxes, free]


def alternatives(made: FlightPlan) -> Iterator[Alternative]:
    """What one more drone, half an hour more and a stronger wind would change, one after another.

    Each comes from a quick plan, which begins with the patterns of this one.
    """
    incident = made.incident
    # With the same random numbers as the alternatives.
    same = replace(made, particles=simulate(incident, MANY, 2))
    if not incident.fleet:
        yield _alternative("One more drone", same, drones=incident.drones + 1)
        yield _alternative("Half an hour more", same, endurance=incident.endurance + 1800)
    stronger = incident.wind.stronger(5 * KNOT)
    # Another wind would also have moved those whom earlier flights looked for.
    if stronger is not None and incident.tracks is None and not incident.flown:
        yield _alternative("A wind 5 kn stronger", same, wind=stronger)


def _alternative(name: str, made: FlightPlan, **values: Any) -> Alternative:
    try:
        incident = made.incident.changed(**values)
        area = Area(incident, simulate(incident, FEW, 1))
        shape = _quickly_improved(area, made.shape)
        other = _flown(area, shape, simulate(incident, MANY, 2))
    except CannotFlyError:
        return Alternative(name, points=None, reason="drones cannot fly there and back")
    except ValueError:
        return Alternative(name, points=None, reason="unknown, beyond the limits of what is given")
    more = other.probability_of_success - made.probability_of_success
    return Alternative(name, points=100 * more)


def _quickly_improved(area: Area, shape: Shape) -> Shape:
    """The shape for another area, with little work; drones without a pattern get one."""
    effort = Effort(Deadline(None), QUICK)
    if isinstance(shape, Worksheet):
        return worksheet(area.incident)
    if isinstance(shape, Boxes):
        return better_boxes(area, shape, effort)
    return free_patterns(area, shape, effort) or shape


def _flown(area: Area, shape: Shape, figures: Particles) -> FlightPlan:
    """The plan in which drones fly the patterns of a shape, as far as they are at sea."""
    incident = area.incident
    wanted = area.patterns(shape)
    can_fly = [drone.fly(each) is not None for drone, each in zip(area.drones, wanted, strict=True)]
    if not all(can_fly):
        raise CannotFlyError(refusal(area))
    patterns: list[Pattern] = []
    flights: list[list[Waypoint]] = []
    searches: list[slice] = []
    flying = [each.waypoints for each in incident.flown if each.landing > incident.start]
    for drone, whole in zip(area.drones, wanted, strict=True):
        pattern = begun_at_sea(whole, drone, area.coast)
        pattern, flight, search = _kept_apart(incident, drone, pattern, [*flying, *flights])
        patterns.append(pattern)
        flights.append(flight)
        searches.append(search)
    return FlightPlan(
        incident=incident,
        patterns=tuple(patterns),
        flights=tuple(flights),
        searches=tuple(searches),
        particles=figures,
        shape=shape,
    )


def _delays(made: FlightPlan) -> tuple[Delay, ...]:
    """What the same flights would find if all drones took off later, as far as that is known."""
    incident = made.incident
    delays = [*DELAYS]
    while delays:
        try:
            later = simulate(incident, MANY, 2, longer=delays[-1].total_seconds())
            break
        except ValueError:  # tracks or forecasts end earlier
            delays.pop()
    found = []
    for delay in delays:
        left = later.weights
        for drone, legs in zip(incident.craft, made.legs, strict=True):
            left = left * later.missed(legs + [delay.total_seconds(), 0.0, 0.0], drone)
        found.append(1.0 - float(left.sum()))
    return tuple(
        Delay(minutes=round(delay.total_seconds() / 60), points=100 * (success - found[0]))
        for delay, success in zip(delays, found, strict=True)
    )


def begun_at_sea(pattern: Pattern, drone: DroneInWind, coast: Coast) -> Pattern:
    """The pattern without its beginning, as far as that is over land when the drone comes there.

    The commence search point is then at sea, also as it is read over the radio, in tenths of a
    minute. A pattern that is nowhere over the sea stays as it is.

    Args:
        pattern: the pattern.
        drone: that flies it.
        coast: what is on land.
    """
    begun = pattern
    for _ in range(MOST_BEGINNINGS):
        flown = drone.fly(begun)
        if flown is None:
            break
        arrival = flown.points[flown.search.start, 0]
        distances = begun.begin + TRIED_EVERY * np.arange(TRIED, dtype=np.float64)
        track = pattern.points(LEGS_LEFT_OUT) + pattern.drift * arrival
        is_sea = coast.is_sea_as_read(point_along(track, distances))
        if not is_sea.any():
            break
        first = float(distances[is_sea.argmax()])
        if first == begun.begin:
            return begun
        begun = replace(pattern, begin=first)
    return pattern


def _kept_apart(
    incident: Incident, drone: DroneInWind, pattern: Pattern, others: Sequence[Flight]
) -> tuple[Pattern, list[Waypoint], slice]:
    """The flight of a drone, delayed by minutes if another one at its height comes too near.

    The pattern is where it is at the delayed take-off. If no delay suffices, the one that keeps
    the drones farthest apart.

    Returns:
        The pattern, the waypoints, and the rows of the search among these.
    """
    same_height = [flight for flight in others if flight[0].altitude == drone.height]
    farthest = -1.0
    for minutes in range(LATEST + 1):
        seconds = 60.0 * minutes
        later = replace(drone, take_off=drone.take_off + seconds)
        moved = replace(pattern, start=pattern.start + pattern.drift * seconds)
        flown = later.fly(moved)
        if flown is None:  # the wind has changed
            continue
        flight = _waypoints(incident, later, flown)
        apart = min((least_distance(flight, other) for other in same_height), default=math.inf)
        if apart > farthest:
            farthest = apart
            chosen = (moved, flight, flown.search)
        if apart >= CLEAR:
            break
    return chosen


def _waypoints(incident: Incident, drone: DroneInWind, flown: Flown) -> list[Waypoint]:
    """The waypoints of a flight."""
    points: Floats = incident.plane.degrees(flown.points[:, 1:])
    searching = [*drone.searches(flown).tolist(), False]
    return [
        Waypoint(
            time=incident.origin.at(drone.take_off + seconds),
            latitude=latitude,
            longitude=longitude,
            altitude=drone.height,
            searching=searching[row],
        )
        for row, (seconds, (latitude, longitude)) in enumerate(
            zip(flown.points[:, 0].tolist(), points.tolist(), strict=True)
        )
    ]
