"""What is known of an incident, and the search that follows from it."""

from __future__ import annotations

import csv
import json
import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch import leeway
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.drift.persons import Person
from DroneSwarmSearch.drift.plane import EQUATOR, TangentPlane
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.drift.tracks import Tracks
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.incident import particles, units
from DroneSwarmSearch.incident.fields import Field
from DroneSwarmSearch.incident.flights import Waypoint, in_utc, legs_of
from DroneSwarmSearch.incident.particles import Flow, Particles
from DroneSwarmSearch.incident.patterns import Drone
from DroneSwarmSearch.scenario import Cell, Scenario

if TYPE_CHECKING:
    from DroneSwarmSearch.incident.flight_plan import FlightPlan

Pair = tuple[float, float]

FASTEST_WIND, FASTEST_CURRENT = 60.0, 5.0
"""In m/s; beyond, a figure was probably given in another unit."""

FARTHEST = 100_000.0
"""The largest distance of the take-off position in metres; the plane is accurate up to there."""

WIND_EXPONENT = 0.11
"""Winds over the open sea grow with height z as (z / 10 m)^0.11: S. Hsu, E. Meindl, D. Gilhousen,
J. Appl. Meteor. 33:757 (1994)."""

APART = 20.0
"""Metres of height between drones."""

SHORTEST_STEP, MOST_STEPS = 15.0, 400
"""Of the particles during flights, in seconds; and how many there are."""

GRID_PARTICLES, LEAST_CELLS, MOST_CELLS = 10_000, 12, 48
"""Of the search on a grid: its particles, and the fewest and most cells along each side."""

STARTS_HOLD = 0.9
"""The drones begin in cells of the smallest area that holds this share of the probability."""


@dataclass(frozen=True, kw_only=True)
class Incident:
    """What a rescue centre knows: who drifts, where they were last seen, and which drones can fly.

    Positions are (latitude, longitude) in degrees, or text such as ("54-10.8N", "007-51.0E");
    lengths are in metres, durations in seconds and speeds in m/s, or text with units, such as
    "20 kn", "0.5 NM" and "45 min". Times are datetimes with a time zone, or text such as
    "2026-03-01T05:30Z".

    Attributes:
        position: the last known position.
        time: when the person was there.
        position_sd: its standard deviation along each axis; 926 m, half a nautical mile, is usual
            for a position reported by an aircraft, and tens of metres for GPS.
        object_class: a key of `leeway.CLASSES`, such as "PIW-1", a person in the water.
        wind: where it comes from and its speed, at 10 m: "300 25kn", or "NW 12 m/s"; or (east,
            north), where it blows to. One that changes is a list of texts with times, such as
            ["300 25kn", "320 30kn@08:00Z"], a mapping of seconds after `time` to winds, or a CSV
            file with the columns time, direction and speed. Between times it is interpolated. Or
            the NetCDF file of a weather model, .nc, with a field by CF standard name.
        current: the same, but the direction is where it flows to. Where the file of an ocean model
            has no values, there is land, on which persons strand.
        wind_error: the standard deviation along each axis of the error of the wind, constant in an
            incident. By default 2 m/s, the target accuracy of satellite winds (EUMETSAT OSI SAF,
            wind products); forecasts are no better.
        current_error: that of the current. By default 0.13 m/s: a probable error of 0.3 kn, which
            the IAMSAR Manual (volume II, appendix K) takes where none is known, divided by 1.18.
        tracks: a file of a drift simulation, see `Tracks.read`, in place of class and current;
            `wind` is then only that on the drones, by default none. Position and time are by
            default the mean of its first positions, and when.
        start: when the drones take off; by default an hour after `time`.
        drones: how many.
        speed: their airspeed.
        swath: the width of the strip that a drone sees.
        probability_of_detection: that a drone which flies over the person, within the strip, finds
            the person; from 0 to 1.
        endurance: of a drone, from take-off to landing.
        reserve: what must be left of the endurance at the landing.
        base: where the drones take off and land; by default the last known position.
        altitude: of the first drone above the sea; each further one flies 20 m higher.
        turn: seconds in which a drone turns by a right angle.
        flown: earlier flights, see `after`.

    Raises:
        ImportError: `tracks` needs netCDF4.
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    position: Any = None
    time: Any = None
    position_sd: Any = 926.0
    object_class: str | None = None
    wind: Any = None
    current: Any = (0.0, 0.0)
    wind_error: Any = 2.0
    current_error: Any = 0.13
    tracks: Any = None
    start: Any = None
    drones: int = 3
    speed: Any = 20.0
    swath: Any = 200.0
    probability_of_detection: float = 0.8
    endurance: Any = 2700.0
    reserve: Any = 0.0
    base: Any = None
    altitude: Any = 100.0
    turn: Any = 4.0
    flown: Any = ()

    def __post_init__(self) -> None:
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        typed = {name: values[name] for name in ("position", "base") if values[name] is not None}
        if self.tracks is not None:
            self._with_tracks(values)
        elif self.wind is None or self.object_class is None:
            raise ValueError(
                "object_class and wind must be given, or tracks in their place, got "
                f"object_class={self.object_class!r}, wind={self.wind!r}"
            )
        else:
            leeway.class_of(self.object_class)
        place, when = _position("position", values["position"]), in_utc("time", values["time"])
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
        values.update(position=place, time=when, base=base, start=start)
        for name, kind in QUANTITIES.items():
            given = values[name]
            number = _read(name, units.quantity, given, kind) if isinstance(given, str) else given
            values[name] = checks.real(name, number, 0)
            if name in ABOVE_ZERO:
                checks.positive(name, number)
        values["drones"] = checks.integer("drones", self.drones, 1, 50)
        name = "probability_of_detection"
        values[name] = checks.real(name, self.probability_of_detection, 0, 1)
        if values["reserve"] >= values["endurance"]:
            raise ValueError(
                f"reserve must be less than the endurance, {values['endurance']:g} s, got "
                f"{values['reserve']:g} s"
            )
        for name, of, fastest in FLOWS:
            if values[name] is not None:
                values[name] = _flow(name, values[name], of, fastest, when)
        values["flown"] = tuple(
            tuple(Waypoint(in_utc("flown", when), *rest) for when, *rest in flight)
            for flight in self.flown
        )
        for name, value in values.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_typed", typed)

    def _with_tracks(self, values: dict[str, Any]) -> None:
        """Complete and check the values of an incident with tracks."""
        from DroneSwarmSearch.drift.track_files import first_known

        if self.object_class is not None:
            raise ValueError("object_class cannot be given together with tracks")
        if not Path(self.tracks).is_file():
            raise ValueError(f"tracks must name a file, but there is no {str(self.tracks)!r}")
        known, began = first_known(Path(self.tracks))
        values.update(
            tracks=os.fspath(self.tracks),
            position=known if self.position is None else self.position,
            time=began if self.time is None else self.time,
            wind=(0.0, 0.0) if self.wind is None else self.wind,
        )

    @property
    def sentence(self) -> str:
        """The incident in a sentence."""
        text = f"{self.target} at {units.radioed(self.position)}, {self.time:%Y-%m-%d %H:%M} UTC"
        for name, toward in (("wind", "from"), ("current", "to")):
            flow = getattr(self, name)
            if isinstance(flow, str):
                field = self._fields[name]
                text += f", {name} of {field.model}, {field.hours}"
            elif isinstance(flow, Mapping) or any(flow):
                spoken = [
                    f"{degrees:03.0f}° {speed / leeway.KNOT:.2g} kn ({speed:.2g} m/s)"
                    + f" at {self.time + timedelta(seconds=seconds):%H:%M}"
                    * isinstance(flow, Mapping)
                    for seconds, degrees, speed in self._courses(name)
                ]
                text += f", {name} {toward} {', '.join(spoken)}"
        return text + f"; {self.drones} drone{'s' * (self.drones > 1)} from {self.start:%H:%M}."

    @property
    def target(self) -> str:
        """What is searched for, in words."""
        if self.tracks is not None:
            return f"Tracks of {Path(self.tracks).name}"
        kind = leeway.class_of(self.object_class)
        return f"{kind.description.removesuffix(' (mean values)')} ({kind.name})"

    def _courses(self, name: str) -> list[tuple[float, float, float]]:
        """The times in seconds, directions in degrees and speeds in m/s of a wind or current."""
        flow, turned = getattr(self, name), 180.0 if name == "wind" else 0.0
        return [
            (
                time,
                round((math.degrees(math.atan2(*each)) + turned) % 360, 6) % 360,
                math.hypot(*each),
            )
            for time, each in (flow if isinstance(flow, Mapping) else {0.0: flow}).items()
        ]

    # The particles and the drones.

    @cached_property
    def plane(self) -> TangentPlane:
        """The plane of all metres; it touches the earth at the last known position."""
        return TangentPlane(*self.position)

    def seconds(self, time: datetime) -> float:
        """Seconds from the last known position to a time."""
        return float((time - self.time).total_seconds())

    def particles(self, n: int, seed: int) -> Particles:
        """Possible persons during all flights, weighted by what earlier ones have missed.

        Args:
            n: how many, or fewer if there are not so many tracks.
            seed: of the random numbers; 0 and 1 take different tracks.
        """
        begin = self.seconds(min([self.start, *(flight[0].time for flight in self.flown)]))
        duration = self.seconds(self.start) + self.endurance - begin
        step = max(SHORTEST_STEP, duration / MOST_STEPS)
        count = math.ceil(duration / step) + 1
        if self.tracks is None:
            cloud = particles.drift(
                leeway.class_of(self.object_class),
                self.flow("wind"),
                self.flow("current"),
                begin=begin,
                step=step,
                count=count,
                n=n,
                seed=seed,
                position_sd=self.position_sd,
                wind_error=self.wind_error,
                current_error=self.current_error,
            )
        else:
            from DroneSwarmSearch.drift.track_files import positions

            cells, *_ = positions(
                Path(self.tracks),
                Scale(1.0, step),
                origin=self.position,
                cell=(0.0, 0.0),
                start=(self.time + timedelta(seconds=begin)).isoformat(),
                steps=count - 1,
                diffusivity=0.0,
                seed=0,
            )
            some = (cells[:, seed % 2 :: 2] * (1, -1))[:, :n].astype(np.float32)
            weights = np.full(some.shape[1], 1.0 / some.shape[1])
            cloud = Particles(begin, step, np.ascontiguousarray(some.transpose(2, 0, 1)), weights)
        weights = cloud.weights
        for flight in self.flown:
            legs = legs_of(flight, self.plane, self.time)
            weights = weights * cloud.missed(legs, self.swath, self.probability_of_detection)
        return replace(cloud, weights=weights / weights.sum())

    @cached_property
    def _fields(self) -> dict[str, Field]:
        """The fields of wind and current that are files."""
        found = {}
        for name, _, _ in FLOWS:
            if isinstance(path := getattr(self, name), str):
                found[name] = field = Field.read(Path(path), name, self.position)
                here = field.at(self.time.timestamp(), *np.array(self.position)[:, None])
                if np.isnan(here).any():
                    raise ValueError(
                        f"position must be at sea, but {path} has no {name} at {self.position}"
                    )
        return found

    def flow(self, name: str, *, checked: bool = True) -> Flow:
        """The "wind" at 10 m or the "current", at times in seconds and places on the plane."""
        field, since = self._fields.get(name), self.time.timestamp()
        known = None if field else series(getattr(self, name))
        # North is towards the pole, which is another direction elsewhere on the plane.
        turning = np.tan(np.radians(self.position[0])) / EQUATOR

        def velocity(times: Any, places: Floats) -> Floats:
            if field is not None:
                degrees = self.plane.degrees(places.T).T
                east, north = field.at(since + times, *degrees, checked=checked)
            else:
                assert known is not None
                east, north = known(np.atleast_1d(times))
            turned = turning * places[0]
            return np.array([east - turned * north, north + turned * east])

        return velocity

    def drone(self, number: int) -> Drone:
        """A drone in the wind at its height; its times are in seconds after take-off."""
        height = max(self.altitude + APART * number, 1.0)
        # Drones try flights that leave the field, but only fly near the particles.
        wind, start = self.flow("wind", checked=False), self.seconds(self.start)
        return Drone(
            self.speed,
            self.turn,
            self.endurance - self.reserve,
            self.plane.metres(*self.base),
            lambda times, places: (
                np.nan_to_num(wind(start + times, places)) * (height / 10.0) ** WIND_EXPONENT
            ),
        )

    # Plans.

    def plan(self) -> FlightPlan:
        """Plan the flights of all drones: out, a search pattern, and back.

        Raises:
            ImportError: the package cmaes, of the extra "plan", is missing.
            ValueError: the drones cannot fly in that wind, or not reach the area and return.
        """
        from DroneSwarmSearch.incident.flight_plan import FlightPlan

        return FlightPlan.of(self)

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
            flights = [*flown.flights]
        landed = max(flight[-1].time for flight in flights)
        start = landed + timedelta(minutes=30) if at is None else in_utc("at", at)
        if start < landed:
            raise ValueError(f"at must not be before the last landing, {landed}, got {start}")
        return replace(self, start=start, flown=(*self.flown, *map(tuple, flights)))

    # Files.

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the incident as JSON, to edit and to `read`; `tracks` as seen from the file."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        values |= self._typed  # type: ignore[attr-defined]
        if self.base == self.position:
            values["base"] = None
        for name, _, _ in FLOWS:
            if isinstance(values[name], str):
                continue
            texts = []
            for seconds, degrees, speed in self._courses(name):
                when = f"@{self.time + timedelta(seconds=seconds):%Y-%m-%dT%H:%MZ}"
                texts.append(f"{degrees:g}° {speed / leeway.KNOT:.6g} kn{when}")
            values[name] = texts if isinstance(values[name], Mapping) else texts[0].split("@")[0]
        for name in ("tracks", "wind", "current"):
            if isinstance(file := getattr(self, name), str):
                values[name] = os.path.relpath(file, Path(path).parent)
        write_text(
            Path(path),
            json.dumps(values, indent=1, default=datetime.isoformat, ensure_ascii=False) + "\n",
        )

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Incident:
        """Read a JSON file; a path of `tracks` in it counts from the file's folder."""
        data = json.loads(Path(path).read_text("utf-8"))
        if not isinstance(data, dict):
            raise ValueError(f"{path} must hold an incident, a JSON object, got {data!r:.100}")
        for name in ("tracks", "wind", "current"):
            file = data.get(name)
            if file and (
                name == "tracks" or (isinstance(file, str) and Path(file).suffix in FILES)
            ):
                data[name] = os.path.normpath(Path(path).parent / file)
        return cls(**data)

    # The search on a grid.

    def scenario(self) -> Scenario:
        """The search on a grid, to train on or to play; its person drifts as the particles do.

        A cell is as wide as the strip that a drone sees, or several times as wide if the area is
        large, and a drone moves and searches while a real one crosses it in still air.
        """
        return self.search().scenario

    def search(self) -> NamedSearch:
        """The search with its start cells and its `Scale`; its `reason` is the incident."""
        scenario, starts, scale, _ = self._on_grid
        return NamedSearch("incident", self.sentence, scenario, starts, scale)

    def locate(self, cell: ArrayLike) -> Floats:
        """The (latitude, longitude) in degrees of cells (x, y), real numbers: (..., 2)."""
        _, _, scale, middle = self._on_grid
        return self.plane.degrees((np.asarray(cell) - middle) * (1, -1) * scale.metres_per_cell)

    @cached_property
    def _on_grid(self) -> tuple[Scenario, tuple[Cell, ...], Scale, Floats]:
        """The scenario, the start cells, the scale, and the cell (x, y) at the plane's origin."""
        cloud, start = self.particles(GRID_PARTICLES, 0), self.seconds(self.start)
        base = self.plane.metres(*self.base)
        first = start + float(np.hypot(*(cloud.mean(start) - base))) / self.speed
        last = max(2 * start + self.endurance - first, first + self.endurance / 10)
        ends = np.percentile(
            cloud.positions[:, cloud.rows(np.array([first, last]))], (0.25, 99.75), (1, 2)
        )
        wide = math.ceil((float((ends[1] - ends[0]).max()) / self.swath + 1) / MOST_CELLS)
        metres = wide * self.swath
        scale = Scale(metres, metres / (2 * self.speed))
        size = max(math.ceil(float((ends[1] - ends[0]).max()) / metres) + 1, LEAST_CELLS)
        middle = (size - 1) / 2 - ends.mean(axis=0) * (1, -1) / metres
        limit = scale.whole_steps(last - first)
        times = (first + scale.seconds_per_step * np.arange(limit + 1) - cloud.begin) / cloud.step
        row = np.minimum(times.astype(np.int64), cloud.positions.shape[1] - 2)
        part = (times - row).clip(0, 1)[:, None].astype(np.float32)
        here, ahead = cloud.positions[:, row], cloud.positions[:, row + 1]
        cells = np.stack(here + part * (ahead - here), axis=-1) * (1, -1) / metres + middle
        tracks = Tracks(cells.clip(0, size - 1), cloud.weights)
        detection = self.probability_of_detection / wide
        # The drones begin in likely cells, those nearest to the base.
        x, y = np.rint(tracks.positions[0].T).astype(np.int64)
        mass = np.bincount(y * size + x, tracks.weights, size**2)
        likely = np.argsort(-mass, kind="stable")
        likely = likely[
            : max(int(np.searchsorted(mass[likely].cumsum(), STARTS_HOLD)) + 1, self.drones)
        ]
        places = np.stack([likely % size, likely // size], axis=1)
        away = np.hypot(*((places - middle) * (1, -1) * metres - base).T)
        nearest = places[np.argsort(away, kind="stable")[: self.drones]].tolist()
        scenario = Scenario(
            size,
            self.drones,
            persons=(Person((), detection, tracks=tracks, fine=1),),
            timestep_limit=limit,
            bayesian_update=True,
        )
        return scenario, tuple((x, y) for x, y in nearest), scale, middle


QUANTITIES = {
    **dict.fromkeys(("position_sd", "swath", "altitude"), units.LENGTH),
    **dict.fromkeys(("wind_error", "current_error", "speed"), units.SPEED),
    **dict.fromkeys(("endurance", "reserve", "turn"), units.TIME),
}
"""The units of quantities."""

ABOVE_ZERO = "speed", "swath", "endurance"

FILES = ".csv", ".nc", ".nc4", ".cdf"
"""By which winds and currents in files are recognised."""

FLOWS = (
    ("wind", leeway.wind_from, FASTEST_WIND),
    ("current", leeway.current_towards, FASTEST_CURRENT),
)


def series(flow: Any) -> Callable[[Any], Floats]:
    """A wind or current of an incident as a function of times in seconds, (n,): (2, n)."""
    points = flow if isinstance(flow, Mapping) else {0.0: flow}
    times, vectors = [*points], np.array([*points.values()])
    return lambda at: np.stack([np.interp(at, times, column) for column in vectors.T])


def stronger(flow: Any, by: float) -> Any:
    """A wind or current of an incident that is so many m/s stronger at all times."""
    if isinstance(flow, Mapping):
        return {time: stronger(each, by) for time, each in flow.items()}
    return tuple(each * (1.0 + by / max(math.hypot(*flow), 1e-9)) for each in flow)


def _read(name: str, read: Callable[..., Any], *given: object) -> Any:
    """What text means; an error names the value."""
    try:
        return read(*given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _position(name: str, value: object) -> Pair:
    if isinstance(value, str):
        value = _read(name, units.position, value)
    elif isinstance(value, (tuple, list)):
        value = tuple(
            _read(name, units.degrees, each, letters) if isinstance(each, str) else each
            for each, letters in zip(value, ("NS", "EW"), strict=False)
        )
    latitude, longitude = checks.pair(name, value, "(latitude, longitude) in degrees")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f"{name} must be (latitude, longitude) in degrees, the latitude first and from -89 to "
            f"89, the longitude from -180 to 180, got {value!r}"
        )
    return latitude, longitude


def _flow(
    name: str, value: Any, of: Callable[[float, float], Pair], fastest: float, since: datetime
) -> Any:
    """A wind or current: one vector, or a mapping of seconds, in their order, to vectors."""
    if isinstance(value, (str, os.PathLike)) and (path := Path(value)).suffix in FILES:
        if not path.is_file():
            raise ValueError(f"{name} must name a file, but there is no {str(path)!r}")
        if path.suffix != ".csv":
            return str(path)
        value = _read_flow(name, path)
    if isinstance(value, str):
        value = [value]
    if isinstance(value, (list, tuple)) and any(isinstance(each, str) for each in value):
        value = dict(_timed(name, each, since) for each in value)
        if [*value] == [None]:
            value = value[None]
    if isinstance(value, Mapping):
        named = {
            0.0 if time is None else checks.real(f"a time of {name}", time): _flow(
                f"{name}[{time}]", each, of, fastest, since
            )
            for time, each in value.items()
        }
        return {time: named[time] for time in sorted(named)}
    if isinstance(value, str):
        direction, _, speed = value.replace(",", " ").strip().partition(" ")
        degrees = _read(f"{name}, such as 300 25kn", units.direction, direction)
        value = of(degrees, _read(f"{name}, such as 300 25kn", units.quantity, speed, units.SPEED))
    what = '(east, north) in m/s, text such as "300 25kn", or a series of these'
    flow = checks.pair(name, value, what)
    if math.hypot(*flow) > fastest:
        raise ValueError(
            f"{name} must be at most {fastest:g} m/s fast, got {math.hypot(*flow):.4g} m/s; "
            "1 kn is 0.514 m/s"
        )
    return flow


def _timed(name: str, text: str, since: datetime) -> tuple[float | None, str]:
    """The seconds and the rest of a text such as "320 30kn@08:00Z"; None without a time."""
    flow, has_time, time = text.partition("@")
    if not has_time:
        return None, flow
    if clock := re.fullmatch(r"(\d\d?):?(\d\d)Z?", time.strip(), re.IGNORECASE):
        hour, minute = map(int, clock.groups())
        seconds = (hour - since.hour) * 3600 + (minute - since.minute) * 60 - since.second
        return float(seconds % 86400), flow
    return (in_utc(name, time) - since).total_seconds(), flow


def _read_flow(name: str, path: Path) -> list[str]:
    """The rows of a CSV file with the columns time, direction and speed, as texts."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [*csv.DictReader(file, skipinitialspace=True)]
        return [f"{each['direction']} {each['speed']}@{each['time']}" for each in rows]
    except (OSError, KeyError) as error:
        raise ValueError(
            f"{name} must be a CSV file with the columns time, direction and speed, got {path}: "
            f"{'no column ' if isinstance(error, KeyError) else ''}{error}"
        ) from None
