"""Flights: waypoints in degrees and UTC, from the drones' paths on the grid and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.plane import TangentPlane
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.scenario import Cell


class Waypoint(NamedTuple):
    """Where a drone is at a time; on the way to its next waypoint it flies straight and evenly.

    Attributes:
        drone: its number, from 0.
        time: in UTC.
        latitude: in degrees, WGS 84.
        longitude: in degrees, from -180 to 180.
        searching: whether it searches until the next waypoint.
    """

    drone: int
    time: datetime
    latitude: float
    longitude: float
    searching: bool


Flight = Sequence[Waypoint]
"""The waypoints of one drone, in the order of their times."""


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
    return plane.metres([each.latitude for each in flight], [each.longitude for each in flight])


def schedule(distances: Floats, speed: float, gap: float) -> Floats:
    """When drones reach a common point, in seconds: the nearest first, at least `gap` apart.

    They fly straight, and wait where they are before they leave. Then no two are ever within
    gap * speed of each other before they arrive: one that passes the place of another one, nearer
    to the point, does so when that one has left.
    """
    arrivals = np.zeros(len(distances))
    earliest = 0.0
    for drone in np.argsort(distances, kind="stable"):
        arrivals[drone] = max(earliest, distances[drone] / speed)
        earliest = arrivals[drone] + gap
    return arrivals


def without_exchanges(cells: Ints) -> Ints:
    """The same cells, (n, drones, 2), without drones that exchange cells: both stay instead.

    From then on, each flies the path of the other one, so that the searched cells stay the same.
    """
    cells = cells.copy()
    for step in range(1, len(cells)):
        before, now = cells[step - 1].tolist(), cells[step].tolist()
        for one, cell in enumerate(now):
            if cell != before[one] and cell in before:
                other = before.index(cell)
                if other > one and now[other] == before[one]:
                    cells[step:, [one, other]] = cells[step:, [other, one]]
    return cells


def turns(points: Floats) -> Ints:
    """The indices of the points, (n, 2), at which even flight along them changes its velocity."""
    change = np.any(np.abs(np.diff(points, n=2, axis=0)) > 1e-9, axis=1)
    inner: Ints = np.flatnonzero(change) + 1
    return np.concatenate([[0], inner, [len(points) - 1]]) if len(points) > 1 else np.array([0])


class SearchGrid(NamedTuple):
    """A grid on a plane; north is up.

    Attributes:
        plane: the plane.
        middle: the cell (x, y), real numbers, at the plane's origin.
        scale: the size of cells and the duration of steps.
        size: cells along each side.
    """

    plane: TangentPlane
    middle: Floats
    scale: Scale
    size: int

    def metres(self, cells: ArrayLike) -> Floats:
        """The middle of cells (x, y), (..., 2), in metres (east, north) on the plane."""
        away: Floats = (np.asarray(cells) - self.middle) * (1, -1) * self.scale.metres_per_cell
        return away

    def gap(self, speed: float) -> float:
        """Seconds between take-offs and between landings, so that drones never share a cell."""
        return math.sqrt(2) * self.scale.metres_per_cell / speed

    def cells(self, metres: Floats) -> Floats:
        """The inverse of `metres`: real numbers."""
        cells: Floats = metres * (1, -1) / self.scale.metres_per_cell + self.middle
        return cells

    def searched(self, flights: Sequence[Flight], first: datetime) -> dict[int, list[Cell]]:
        """The cells that flights search, by step from a time on; negative before.

        Each stretch of a search as long as a cell searches one, wherever it runs.
        """
        found: dict[int, set[Cell]] = {}
        for flight in flights:
            times, points = _along(flight, self.plane, self.scale.metres_per_cell)
            steps = np.floor((times - first.timestamp()) / self.scale.seconds_per_step + 1e-3)
            cells = np.rint(self.cells(points)).astype(int).tolist()
            for step, (x, y) in zip(steps.astype(int).tolist(), cells, strict=True):
                if 0 <= x < self.size and 0 <= y < self.size:
                    found.setdefault(step, set()).add((x, y))
        return {step: sorted(found[step]) for step in sorted(found)}


def _along(flight: Flight, plane: TangentPlane, spacing: float) -> tuple[Floats, Floats]:
    """When and where a flight that searches has covered each `spacing` metres, from 0 on.

    Returns times in seconds since 1970, (n,), and metres on the plane, (n, 2).
    """
    times = np.array([each.time.timestamp() for each in flight])
    points = track(flight, plane)
    searching = np.array([each.searching for each in flight])
    lengths = np.append(np.hypot(*np.diff(points, axis=0).T), 0.0)
    every, found = np.column_stack([times, points]), [np.empty((0, 3))]
    covered = 0.0  # since the search began
    for leg in np.flatnonzero(searching[:-1]).tolist():
        if leg == 0 or not searching[leg - 1]:
            covered = 0.0
        ends = np.ceil(np.array([covered, covered + lengths[leg]]) / spacing - 1e-6)
        at = np.arange(*ends) * spacing
        share = (at - covered)[:, None] / max(lengths[leg], 1e-9)
        begin, end = every[leg : leg + 2]
        found.append(begin + share * (end - begin))
        covered += lengths[leg]
    samples = np.concatenate(found)
    return samples[:, 0], samples[:, 1:]
