"""Flights as lines and land as polygons in degrees, and times as text, for the files of a plan."""

from __future__ import annotations

import math
from datetime import datetime
from itertools import pairwise

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.geo.polygons import Polygon
from DroneSwarmSearch.incident.flight_plan import FlightPlan
from DroneSwarmSearch.incident.flights import Flight, Waypoint, track
from DroneSwarmSearch.incident.incident import Mark

Line = list[tuple[float, float]]  # (longitude, latitude), the order of GeoJSON and KML


STEPS = np.array([0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800])
"""Round numbers, for scales and lines."""


def round_minutes(first: float, last: float) -> Floats:
    """About six round minutes of latitude or longitude between two ends, and not near them."""
    span = last - first
    step = STEPS[STEPS.searchsorted(span / 6)]
    lowest = np.ceil((first + span / 20) / step)
    minutes: Floats = np.arange(lowest, (last - span / 20) / step) * step
    return minutes


def utc(time: datetime) -> str:
    """A time as text."""
    return time.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def lengths(plan: FlightPlan, flight: Flight) -> Floats:
    """The lengths of the legs in metres."""
    points = track(flight, plan.incident.plane)
    lengths: Floats = np.hypot(*np.diff(points, axis=0).T)
    return lengths


def point_of(waypoint: Waypoint) -> tuple[float, float]:
    """A waypoint's longitude and latitude."""
    return round(waypoint.longitude, 7), round(waypoint.latitude, 7)


def mark_in_degrees(plan: FlightPlan, mark: Mark) -> Line:
    """The longitudes and latitudes of a mark."""
    degrees = plan.incident.plane.degrees(mark.points)
    return [(round(longitude, 7), round(latitude, 7)) for latitude, longitude in degrees.tolist()]


def land_of(plan: FlightPlan) -> list[Polygon]:
    """The land around all flights: polygons of (longitude, latitude)."""
    low, high = plan.extent
    land = plan.land(low, high)
    return [] if land is None else land.polygons_in_degrees(low, high)


def split(flight: Flight) -> list[Line]:
    """Lines that end where they reach the date line, see RFC 7946, section 3.1.9."""
    points = [point_of(waypoint) for waypoint in flight]
    lines = [points[:1]]
    for (x, y), (next_x, next_y) in pairwise(points):
        if abs(next_x - x) > 180:
            edge = math.copysign(180, x)
            gap = next_x + 2 * edge - x
            crossing = y + (edge - x) / gap * (next_y - y) if gap else y
            lines[-1].append((edge, crossing))
            lines.append([(-edge, crossing)])
        lines[-1].append((next_x, next_y))
    return [line for line in lines if len(set(line)) > 1]
