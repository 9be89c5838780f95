"""What is known of an incident, and the search that follows from it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch import leeway
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.drift.plane import TangentPlane
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.drift.tracks import Tracks
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.incident import units
from DroneSwarmSearch.incident.flights import SearchGrid, Waypoint, in_utc, schedule
from DroneSwarmSearch.scenario import Cell, Scenario

if TYPE_CHECKING:
    from DroneSwarmSearch.incident.flight_plan import FlightPlan

Pair = tuple[float, float]

FASTEST_WIND, FASTEST_CURRENT = 60.0, 5.0
"""In m/s; beyond, a figure was probably given in another unit."""

FARTHEST = 100_000.0
"""The largest distance of the take-off position in metres; the plane is accurate up to there."""

MOST_STATES = 40_000
"""The most cells times hypotheses: planning for more takes minutes and gigabytes."""

LEAST_SIZE = 12
"""Cells along each side of the smallest grid."""

STARTS_HOLD = 0.9
"""The drones begin in cells of the smallest area that holds this share of the probability."""

LEAST_STEPS = 20
"""Of a search; with less time, drones cannot fly it."""

_COURSE_PARTS = 32


class Layout(NamedTuple):
    """How an incident becomes a search.

    Attributes:
        grid: the grid.
        person: the person on it.
        starts: the cells in which the drones begin to search.
        first: when that is, step 0.
        limit: the steps for which they may search.
    """

    grid: SearchGrid
    person: Person
    starts: tuple[Cell, ...]
    first: datetime
    limit: int


@dataclass(frozen=True, kw_only=True)
class Incident:
    """What a rescue centre knows: who drifts, where they were last seen, and which drones can fly.

    Positions are (latitude, longitude) in degrees, or text such as ("54-10.8N", "007-51.0E");
    lengths are in metres, durations in seconds and
    speeds in m/s. Times are datetimes with a time zone, or text such as "2026-03-01T05:30Z".

    Attributes:
        position: the last known position.
        time: when the person was there.
        position_sd: its standard deviation along each axis; 926 m, half a nautical mile, is usual
            for a position reported by an aircraft, and tens of metres for GPS.
        object_class: a key of `leeway.CLASSES`, such as "PIW-1", a person in the water.
        wind: (east, north), where it blows to, see `leeway.wind_from`; or a mapping of seconds
            after `time` to winds.
        current: (east, north), where it flows to, see `leeway.current_towards`; or a mapping.
        tracks: a file of a drift simulation, see `Tracks.read`, in place of class, wind and
            current. Position and time are by default the mean of its first positions, and when.
        start: when the first drone takes off; by default an hour after `time`.
        drones: how many.
        speed: of the drones over the ground, also while they search.
        swath: the width of the strip that a drone sees.
        probability_of_detection: that a drone which flies over the person, within the strip, finds
            the person; from 0 to 1.
        endurance: of a drone, from take-off to landing.
        base: where the drones take off and land; by default the last known position.
        altitude: of the flight above the sea.
        flown: earlier flights, see `after`.

    Raises:
        ImportError: `tracks` needs netCDF4.
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    position: Any = None
    time: Any = None
    position_sd: float = 926.0
    object_class: str | None = None
    wind: Any = None
    current: Any = (0.0, 0.0)
    tracks: Any = None
    start: Any = None
    drones: int = 3
    speed: float = 20.0
    swath: float = 200.0
    probability_of_detection: float = 0.8
    endurance: float = 2700.0
    base: Any = None
    altitude: float = 100.0
    flown: Any = ()

    def __post_init__(self) -> None:
        position, time, tracks = self.position, self.time, self.tracks
        if tracks is not None:
            from DroneSwarmSearch.drift.track_files import first_known

            for name in ("object_class", "wind"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name} cannot be given together with tracks")
            if not Path(tracks).is_file():
                raise ValueError(f"tracks must name a file, but there is no {str(tracks)!r}")
            known, began = first_known(Path(tracks))
            tracks, position, time = os.fspath(tracks), position or known, time or began
        elif self.wind is None or self.object_class is None:
            raise ValueError(
                "object_class and wind must be given, or tracks in their place, got "
                f"object_class={self.object_class!r}, wind={self.wind!r}"
            )
        place, when = _position("position", position), in_utc("time", time)
        base = place if self.base is None else _position("base", self.base)
        away = float(np.hypot(*TangentPlane(*place).metres(*base)))
        if not away <= FARTHEST:
            raise ValueError(
                f"base must be within {FARTHEST / 1000:g} km of position, got {base}, far from "
                f"{place}; is the latitude first in both?"
            )
        start = when + timedelta(hours=1) if self.start is None else in_utc("start", self.start)
        if start < when:
            raise ValueError(f"start must not be before time, {when}, got {start}")
        values = {
            "position": place,
            "time": when,
            "position_sd": checks.real("position_sd", self.position_sd, 0),
            "tracks": tracks,
            "start": start,
            "drones": checks.integer("drones", self.drones, 1, 50),
            "speed": checks.positive("speed", self.speed),
            "swath": checks.positive("swath", self.swath),
            "probability_of_detection": checks.real(
                "probability_of_detection", self.probability_of_detection, 0, 1
            ),
            "endurance": checks.positive("endurance", self.endurance),
            "base": base,
            "altitude": checks.real("altitude", self.altitude, 0),
            "flown": tuple(
                tuple(
                    Waypoint(drone, in_utc("flown", when), *rest) for drone, when, *rest in flight
                )
                for flight in self.flown
            ),
        }
        if tracks is None:
            values["wind"] = _flow("wind", self.wind, FASTEST_WIND)
            values["current"] = _flow("current", self.current, FASTEST_CURRENT)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if tracks is None:
            leeway.class_of(self.object_class)

    # The search.

    def scenario(self) -> Scenario:
        """The search as a `Scenario`, on a grid that holds more than 99% of the map at all times.

        Cells are as wide as the strip that a drone sees, or several times as wide if the area is
        large, and a drone crosses one in two steps.
        """
        return self.search().scenario

    def search(self) -> NamedSearch:
        """The search with its start cells and its `Scale`; its `reason` is the incident."""
        layout = self.layout
        scenario = Scenario(
            layout.grid.size,
            self.drones,
            persons=(layout.person,),
            timestep_limit=layout.limit,
            bayesian_update=True,
        )
        return NamedSearch("incident", self.sentence, scenario, layout.starts, layout.grid.scale)

    @property
    def sentence(self) -> str:
        """The incident in a sentence."""
        who = f"Tracks of {self.tracks}" if self.tracks else f"{self.object_class}"
        text = f"{who} at {units.radioed(self.position)}, {self.time:%Y-%m-%d %H:%M} UTC"
        for name, flow in (("wind", self.wind), ("current", self.current)):
            if isinstance(flow, Mapping):
                text += f", {name} as forecast"
            elif flow is not None and any(flow) and not self.tracks:
                turned = 180.0 if name == "wind" else 0.0
                degrees = round(math.degrees(math.atan2(*flow)) + turned) % 360
                towards = "from" if name == "wind" else "to"
                text += f", {name} {towards} {degrees:03}° {math.hypot(*flow) / leeway.KNOT:.2g} kn"
        return text + f"; {self.drones} drone{'s' * (self.drones > 1)} from {self.start:%H:%M}."

    def locate(self, cell: ArrayLike) -> Floats:
        """The (latitude, longitude) in degrees of cells (x, y), real numbers: (..., 2)."""
        grid = self.layout.grid
        return grid.plane.degrees(grid.metres(cell))

    def cell_of(self, latitude: ArrayLike, longitude: ArrayLike) -> Floats:
        """The cells (x, y), real numbers, (..., 2), of positions in degrees; also off the grid."""
        grid = self.layout.grid
        return grid.cells(grid.plane.metres(latitude, longitude))

    # Plans.

    def plan(self, policy: str = "planner") -> FlightPlan:
        """Plan the flights of all drones, out, over the area and back.

        Args:
            policy: "planner", which takes a minute or two, or "greedy-posterior", which takes a
                second and finds about as much.

        Raises:
            ValueError: there is no such policy, or the drones cannot reach the area and return.
        """
        from DroneSwarmSearch.incident.flight_plan import FlightPlan

        return FlightPlan.of(self, policy)

    def after(
        self,
        flown: FlightPlan | str | os.PathLike[str],
        at: datetime | str | None = None,
    ) -> Incident:
        """The incident after flights that found nobody: its map is the posterior.

        Args:
            flown: a plan that was flown, or a CSV file of what was really flown, such as the
                `plan.csv` of a plan; the columns are drone, time_utc, latitude_deg, longitude_deg
                and optionally searching.
            at: when the first drone takes off again; by default half an hour after the last one
                has landed.

        Raises:
            OSError, TypeError, ValueError: the file or the time is unsuitable.
        """
        if isinstance(flown, (str, os.PathLike)):
            from DroneSwarmSearch.incident import files

            flights = files.read_csv(Path(flown))
        else:
            flights = flown.flights
        landed = max(flight[-1].time for flight in flights)
        start = landed + timedelta(minutes=30) if at is None else in_utc("at", at)
        if start < landed:
            raise ValueError(f"at must not be before the last landing, {landed}, got {start}")
        return replace(self, start=start, flown=(*self.flown, *map(tuple, flights)))

    # Files.

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the incident as JSON: an object with its values, `tracks` as seen from the file."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        if self.tracks is not None:
            values["tracks"] = os.path.relpath(self.tracks, Path(path).parent)
        write_text(Path(path), json.dumps(values, indent=1, default=datetime.isoformat) + "\n")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Incident:
        """Read a JSON file; a path of `tracks` in it counts from the file's folder."""
        data = json.loads(Path(path).read_text("utf-8"))
        if not isinstance(data, dict):
            raise ValueError(f"{path} must hold an incident, a JSON object, got {data!r:.100}")
        if data.get("tracks"):
            data["tracks"] = str(Path(path).parent / data["tracks"])
        return cls(**data)

    # The layout.

    @cached_property
    def layout(self) -> Layout:
        """The grid, the person on it, and when and where the search begins."""
        plane, zero = TangentPlane(*self.position), np.zeros(2)
        scale = Scale(self.swath, self.swath / (2 * self.speed))
        steps = scale.whole_steps(self.endurance)
        # The extent of the map in cells of a swath, with (0, 0) at the last known position.
        person = self._person(zero, SearchGrid(plane, zero, scale, 0), self.start, steps)
        low, high = person.extent(steps)
        centre, widest = (low + high) / 2, float((high - low).max()) + 1
        wide = math.ceil(widest / math.sqrt(MOST_STATES / len(person.weights)))
        scale = Scale(wide * scale.metres_per_cell, wide * scale.seconds_per_step)
        size = max(math.ceil(widest / wide) + 1, LEAST_SIZE)
        # The plane touches the middle of the map, since far away north is another direction.
        plane = TangentPlane(*_sailed(self.position, centre * (1, -1) * self.swath))
        position = np.rint((size - 1) / 2 - centre / wide)
        grid = SearchGrid(plane, position + centre / wide, scale, size)
        return self._timed(grid, position)

    def _timed(self, grid: SearchGrid, position: Floats) -> Layout:
        """The layout on a grid, given the cell of the last known position."""
        base = grid.plane.metres(*self.base)
        gap = grid.gap(self.speed)
        way = float(np.hypot(*base)) / self.speed + (self.drones - 1) * gap
        guess = self._person(position, grid, self.start + _seconds(way), 1)
        matrix = guess.model(grid.size).exact(0).reshape(-1)
        likeliest = np.argsort(-matrix, kind="stable")
        count = int(np.searchsorted(matrix[likeliest].cumsum(), STARTS_HOLD)) + 1
        likeliest = likeliest[: max(count, self.drones)]
        cells = np.stack([likeliest % grid.size, likeliest // grid.size], axis=1)
        distances = np.hypot(*(grid.metres(cells) - base).T)
        nearest = np.argsort(distances, kind="stable")[: self.drones]
        there = float(schedule(distances[nearest], self.speed, gap).max())
        limit = grid.scale.whole_steps(self.endurance - there - way) // 2 * 2
        if limit < LEAST_STEPS:
            raise ValueError(
                f"endurance must leave time to search, got {self.endurance / 60:.0f} minutes, of "
                f"which the way to the area and back takes {(there + way) / 60:.0f}: take off "
                "nearer, or use drones that fly longer or faster"
            )
        first = self.start + _seconds(there)
        person = self._person(position, grid, first, limit)
        starts = tuple((x, y) for x, y in cells[nearest].tolist())
        return Layout(grid, person, starts, first, limit)

    def _person(self, position: Floats, grid: SearchGrid, first: datetime, steps: int) -> Person:
        """The person of a search that begins at a time, for a number of steps.

        `position` is the cell of the last known position.
        """
        scale = grid.scale
        detected = self.probability_of_detection * self.swath / scale.metres_per_cell
        cells = grid.searched(self.flown, first)
        searched = [cells.get(step, []) for step in range(min([0, *cells]), 0)]
        begin = first - _seconds(scale.seconds(len(searched)))
        if self.tracks is not None:
            tracks = Tracks.read(
                self.tracks,
                scale=scale,
                origin=grid.plane.origin,
                cell=tuple(grid.middle.tolist()),
                start=begin,
                steps=len(searched) + steps,
            )
            return Person((), detected, tracks=tracks, searched=searched)
        assert self.object_class is not None
        person = leeway.person(
            self.object_class,
            start=tuple(position.tolist()),
            position_sd=self.position_sd,
            wind=self.wind,
            current=self.current,
            adrift=(begin - self.time).total_seconds(),
            search=scale.seconds(steps),
            scale=scale,
            probability_of_detection=detected,
        )
        return replace(person, searched=searched)


def _seconds(seconds: float) -> timedelta:
    return timedelta(seconds=seconds)


def _sailed(position: Pair, away: Floats) -> Pair:
    """Where a constant course leads, given metres (east, north)."""
    for _ in range(_COURSE_PARTS):
        latitude, longitude = TangentPlane(*position).degrees(away / _COURSE_PARTS).tolist()
        position = latitude, longitude
    return position


def _position(name: str, value: object) -> Pair:
    try:
        if isinstance(value, str):
            value = units.position(value)
        elif isinstance(value, (tuple, list)):
            value = tuple(
                units.degrees(each, letters) if isinstance(each, str) else each
                for each, letters in zip(value, ("NS", "EW"), strict=True)
            )
    except ValueError as error:
        raise ValueError(f"{name} must be (latitude, longitude): {error}") from None
    latitude, longitude = checks.pair(name, value, "(latitude, longitude) in degrees")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f"{name} must be (latitude, longitude) in degrees, the latitude first and from -89 to "
            f"89, the longitude from -180 to 180, got {value!r}"
        )
    return latitude, longitude


def _flow(name: str, value: Any, fastest: float) -> Any:
    """A wind or current: one vector, or a mapping of seconds to vectors."""
    if isinstance(value, Mapping):
        return {
            float(time): _flow(f"{name}[{time}]", each, fastest) for time, each in value.items()
        }
    flow = checks.pair(name, value, "(east, north) in m/s, or a mapping of seconds to them")
    if math.hypot(*flow) > fastest:
        raise ValueError(
            f"{name} must be at most {fastest:g} m/s fast, got {math.hypot(*flow):.4g} m/s; "
            "1 kn is 0.514 m/s"
        )
    return flow
