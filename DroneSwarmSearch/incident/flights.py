"""Flights: waypoints in degrees and UTC."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.plane import TangentPlane


class Waypoint(NamedTuple):
    """Where a drone is at a time; there it turns, and flies straight on to its next waypoint.

    Attributes:
        time: in UTC.
        latitude: in degrees, WGS 84.
        longitude: in degrees, from -180 to 180.
        altitude: above the sea, in metres.
        searching: whether it searches until the next waypoint.
    """

    time: datetime
    latitude: float
    longitude: float
    altitude: float
    searching: bool


Flight = Sequence[Waypoint]  # the waypoints of one drone, in the order of their times


def in_utc(name: str, value: object) -> datetime:
    """A time in UTC, from a datetime or a text with a zone; else a TypeError or ValueError."""
    what = f'{name} must be a time with a zone, such as "2026-03-01T05:30Z"'
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip().replace("Z", "+00:00"))
        except ValueError:
            raise ValueError(f"{what}, got {value!r}") from None
    if not isinstance(value, datetime):
        raise TypeError(f"{what}, got {value!r}")
    if value.tzinfo is None:
        raise ValueError(f"{what}, got {value.isoformat()} without one")
    return value.astimezone(timezone.utc)


def track(flight: Flight, plane: TangentPlane) -> Floats:
    """The positions of a flight's waypoints on a plane, in metres (east, north): (n, 2)."""
    return plane.metres([point.latitude for point in flight], [point.longitude for point in flight])


def legs_of(flight: Flight, plane: TangentPlane, since: datetime) -> Floats:
    """The legs on which a drone searches: seconds, east and north of both ends, (n, 2, 3)."""
    seconds = [(point.time - since).total_seconds() for point in flight]
    points = np.column_stack([seconds, track(flight, plane)])
    searching = np.array([point.searching for point in flight[:-1]], np.bool_)
    return np.stack([points[:-1], points[1:]], axis=1)[searching]
