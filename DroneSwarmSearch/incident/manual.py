"""The plan of the IAMSAR Manual's worksheets: the baseline that a plan of ours must beat.

International Aeronautical and Maritime Search and Rescue Manual, IMO and ICAO, volume II, chapter
4, and its Datum, Total Probable Error and Effort Allocation Worksheets. There are two datums, for
objects that diverge to the right and to the left of the wind; a total probable error E around each;
and the rectangle that is best for the effort at hand, searched evenly.

A probable error is the radius of the circle that holds half of a circular normal distribution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.geo.units import KNOT, PROBABLE
from DroneSwarmSearch.incident.drone import drone_in_wind
from DroneSwarmSearch.incident.flights import track
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.particles import Searcher
from DroneSwarmSearch.incident.places import Point
from DroneSwarmSearch.persons import leeway

LEEWAY_ERROR = 0.3 * KNOT
"""The probable error of a leeway, where nobody knows a better one."""

DRONE_ERROR = 0.1 * 1852
"""The probable error of a drone's position: the manual's, for satellite navigation."""

ON_SEARCH = 0.85
"""The share of the time on scene that is search; the rest is turns."""

STEP = 60.0  # seconds of a drift

MOST_SEARCH_FACTOR = 10.0


@dataclass(frozen=True, eq=False)
class Worksheet:
    """What the worksheets compute; lengths are in metres, positions (east, north).

    Attributes:
        datums: of objects that diverge to the right, and to the left: float64, (2, 2).
        error: E, the total probable error of each.
        effort: Z, the area that all drones can sweep.
        before: the area that earlier flights have swept.
        sweep_width: W, of a drone; the mean of all.
    """

    datums: Floats
    error: float
    effort: float
    before: float
    sweep_width: float

    @property
    def divergence(self) -> float:
        """DD, the distance between the datums."""
        return float(np.hypot(*(self.datums[0] - self.datums[1])))

    @property
    def middle(self) -> Floats:
        """The position half-way between the datums."""
        middle: Floats = self.datums.mean(axis=0)
        return middle

    @property
    def heading(self) -> float:
        """The direction from one datum to the other, in radians clockwise from north."""
        return math.atan2(*(self.datums[0] - self.datums[1]))

    @property
    def relative_effort(self) -> float:
        """The swept area, cumulative, in units of E²."""
        return (self.before + self.effort) / self.error**2

    @property
    def radius(self) -> float:
        """The optimal search radius: the optimal search factor times E."""
        return optimal_search_factor(self.relative_effort) * self.error

    @property
    def sides(self) -> tuple[float, float]:
        """The length of the optimal area, along both datums, and its width."""
        return self.divergence + 2 * self.radius, 2 * self.radius

    @property
    def coverage(self) -> float:
        """The coverage factor: the effort over the area."""
        length, width = self.sides
        return self.effort / (length * width)

    @property
    def spacing(self) -> float:
        """The track spacing: the sweep width over the coverage factor."""
        return self.sweep_width / self.coverage


def worksheet(incident: Incident) -> Worksheet:
    """The worksheets of an incident, for the middle of the time on scene.

    The sweep width is the swath times the probability of detection.

    Raises:
        ValueError: the worksheets know nothing of what the incident has: tracks, several hypotheses
            or object classes, or another place than a position.
    """
    known = _one_point(incident)
    drones = [drone_in_wind(incident, number) for number in range(len(incident.craft))]
    half_way = incident.seconds(incident.start) + incident.airborne / 2
    both = datums(incident, half_way)
    widths = [sweep_width(drone.craft) for drone in drones]
    middle = both.mean(axis=0)
    swept = [
        width * drone.airspeed * drone.time_around(middle)
        for width, drone in zip(widths, drones, strict=True)
    ]
    return Worksheet(
        datums=both,
        error=total_probable_error(
            PROBABLE * known.error, DRONE_ERROR, drift_errors(incident), half_way
        ),
        effort=sum(swept) * ON_SEARCH,
        before=sum(_swept(incident)),
        sweep_width=float(np.mean(widths)),
    )


def sweep_width(searcher: Searcher) -> float:
    """The swath times the probability of detection, of the first object class."""
    values = (searcher.swath, searcher.probability_of_detection)
    swath, detection = (value if isinstance(value, float) else value[0][1] for value in values)
    return swath * detection


def _one_point(incident: Incident) -> Point:
    """The position of an incident with one object class, and nothing else."""
    cases = incident.cases
    if len(cases) != 1 or len(incident.object_classes) != 1:
        raise ValueError(
            "method 'manual' needs one hypothesis with one object class, got "
            f"{'tracks' if incident.tracks else incident.case}"
        )
    place = cases[0].place
    if not isinstance(place, Point):
        raise ValueError(f"method 'manual' needs a position, got {place.words}")
    return place


def datums(incident: Incident, seconds: float) -> Floats:
    """Where objects that go to the right and to the left of the wind are at a time: (2, 2)."""
    kind = leeway.class_of(incident.object_classes[0])
    position = np.zeros((2, 2))  # (east, north), (right, left)
    parts = max(math.ceil(seconds / STEP), 1)
    step = seconds / parts
    for part in range(parts):
        time = (part + 0.5) * step
        wind = np.nan_to_num(incident.wind.velocity(time, position))
        current = np.nan_to_num(incident.current.velocity(time, position))
        drift = np.empty((2, 2))
        for side in range(2):
            strength = float(np.hypot(*wind[:, side]))
            speeds = kind.speeds(strength)
            downwind = wind[:, side] / max(strength, 1e-9)
            to_the_right = downwind[::-1] * [1, -1]
            crosswind = speeds.left if side else speeds.right
            drift[:, side] = speeds.downwind * downwind + crosswind * to_the_right
        position += step * (drift + current)
    return position.T


def drift_errors(incident: Incident) -> list[float]:
    """The probable errors of the drift by wind, of the current and of the leeway, in m/s."""
    slope = leeway.class_of(incident.object_classes[0]).downwind.slope / 100
    by_wind = slope * PROBABLE * incident.wind_error
    return [by_wind, PROBABLE * incident.current_error, LEEWAY_ERROR]


def total_probable_error(
    position: float, searcher: float, drift: Sequence[float], seconds: float
) -> float:
    """E, from the probable errors of two positions and of the components of the drift.

    Its square is the sum of their squares, those of the drift times the time adrift.
    """
    adrift = [error * seconds for error in drift]
    return math.hypot(position, searcher, *adrift)


def optimal_search_factor(relative_effort: float) -> float:
    """The half side of the best square around a datum, in units of E.

    The square, searched evenly in normal conditions, finds the most of a circular normal
    distribution: it contains erf(f r)² of it, with r² = ln 2, and detects 1 - exp(-C) of that, with
    the coverage C = Z / (4 f²), where Z is the relative effort.
    """
    factors = np.linspace(0.05, MOST_SEARCH_FACTOR, 4_000)
    contained = np.array([math.erf(math.sqrt(math.log(2)) * factor) for factor in factors]) ** 2
    detected = 1.0 - np.exp(-relative_effort / (4 * factors**2))
    return float(factors[(contained * detected).argmax()])


def _swept(incident: Incident) -> list[float]:
    """The area that each earlier flight has swept."""
    areas = []
    for flight in incident.flown:
        way = np.diff(track(flight.waypoints, incident.plane), axis=0)
        searching = [point.searching for point in flight.waypoints[:-1]]
        length = float(np.hypot(*way[searching].T).sum())
        areas.append(length * sweep_width(flight))
    return areas
