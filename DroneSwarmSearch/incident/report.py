"""What is known of an incident: validated values, possible persons, and what drones can do."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch._internal.files import parsed_json, write_text
from DroneSwarmSearch._internal.text import plural, printable
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.fields import Field
from DroneSwarmSearch.geo.flows import (
    FASTEST,
    FILES,
    changed_at,
    check_times,
    named,
    read_flow,
    series,
    shifted,
)
from DroneSwarmSearch.geo.plane import EQUATOR, TangentPlane
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.geo.times import in_utc, near
from DroneSwarmSearch.incident import particles
from DroneSwarmSearch.incident.flights import (
    FASTER,
    Flight,
    FlownFlight,
    check_flyable,
    check_order,
    legs_of,
    read_flown,
)
from DroneSwarmSearch.incident.particles import Flow, Particles
from DroneSwarmSearch.incident.patterns import Drone
from DroneSwarmSearch.persons import leeway
from DroneSwarmSearch.persons.track_files import first_known, positions

Self = TypeVar("Self", bound="Report")

FARTHEST = 100_000.0
"""The largest distance of the take-off position in metres; the plane is accurate up to there."""

WIND_EXPONENT = 0.11
"""Winds over the open sea grow with height z as (z / 10 m)^0.11: S. Hsu, E. Meindl, D. Gilhousen,
J. Appl. Meteor. 33:757 (1994)."""

APART = 20.0  # metres of height between drones

SHORTEST_STEP, MOST_STEPS = 15.0, 400
"""Of the particles during flights, in seconds; and how many there are."""

QUANTITIES = {
    **dict.fromkeys(("position_sd", "swath", "altitude"), units.LENGTH),
    **dict.fromkeys(("wind_error", "current_error", "speed"), units.SPEED),
    **dict.fromkeys(("endurance", "reserve", "turn"), units.TIME),
}
"""The units of quantities."""

LIMITS = {
    "position_sd": (0, 100_000),
    "swath": (1, 10_000),
    "altitude": (0, 10_000),
    "wind_error": (0, 60),
    "current_error": (0, 5),
    "speed": (0, 200),
    "endurance": (0, 12 * 3600),
    "reserve": (0, 12 * 3600),
    "turn": (0, 600),
}
"""The least and the most of quantities, in metres, seconds and m/s."""

ABOVE_ZERO = "speed", "endurance"

LONGEST_DRIFT = timedelta(hours=72)
"""From the last known position to the take-off; errors of leeway and current grow without end."""

FEWEST_TRACKS = 20

SORTIES_APART = timedelta(minutes=30)  # from the last landing to the next take-off


@dataclass(frozen=True, kw_only=True)
class Report:
    """The values of an `Incident`, see there, with its possible persons and its drones."""

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
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        typed = {name: values[name] for name in ("position", "base") if values[name] is not None}
        self._check_object(values)
        self._check_drones(values)
        self._check_places_and_times(values)
        landed = values["start"] + timedelta(seconds=values["endurance"])
        for name in FASTEST:
            values[name] = read_flow(name, values[name], values["time"])
            check_times(name, values[name], values["time"], landed)
        if values["tracks"] is not None:
            self._check_tracks_alone(values)
        values["flown"] = self._flown(values)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_typed", typed)

    def _check_object(self, values: dict[str, Any]) -> None:
        """Check what drifts; tracks complete the values."""
        if self.tracks is None:
            if self.object_class is None:
                raise ValueError(
                    "object_class must be given, such as PIW-1, a person in the water, or tracks "
                    "in its place"
                )
            leeway.class_of(self.object_class)
            if self.wind is None:
                raise ValueError("wind must be given, such as 300 25kn, or tracks in its place")
            return
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

    def _check_tracks_alone(self, values: dict[str, Any]) -> None:
        """Refuse values that tracks have already: given, they would have no effect."""
        for name in ("current", "position_sd", "wind_error", "current_error"):
            if values[name] != getattr(Report, name):
                raise ValueError(
                    f"{name} cannot be given together with tracks, which have it already, got "
                    f"{getattr(self, name)!r}"
                )

    def _check_places_and_times(self, values: dict[str, Any]) -> None:
        place = _position("position", values["position"])
        when = in_utc("time", values["time"])
        base = place if self.base is None else _position("base", self.base)
        if not TangentPlane(*place).distance(*base) <= FARTHEST:
            raise ValueError(
                f"base must be within {FARTHEST / 1000:g} km of position, got {base}, far from "
                f"{place}; is the latitude first in both?"
            )
        start = when + timedelta(hours=1)
        if self.start is not None:
            start = near("start", self.start, when)
        if start < when:
            raise ValueError(f"start must not be before time, {when}, got {start}")
        if start > when + LONGEST_DRIFT:
            hours = LONGEST_DRIFT.total_seconds() / 3600
            raise ValueError(
                f"start must be at most {hours:g} hours after time, {when}, got {start}; later, "
                "take a newer position"
            )
        values.update(position=place, time=when, base=base, start=start)

    def _check_drones(self, values: dict[str, Any]) -> None:
        for name, kind in QUANTITIES.items():
            given = values[name]
            number = named(name, units.quantity, given, kind) if isinstance(given, str) else given
            if name in ABOVE_ZERO:
                checks.positive(name, number)
            values[name] = checks.real(name, number, *LIMITS[name])
        values["drones"] = checks.integer("drones", self.drones, 1, 50)
        name = "probability_of_detection"
        values[name] = checks.real(name, self.probability_of_detection, 0, 1)
        if values["reserve"] >= values["endurance"]:
            raise ValueError(
                f"reserve must be less than the endurance, {values['endurance']:g} s, got "
                f"{values['reserve']:g} s"
            )

    def _flown(self, values: dict[str, Any]) -> tuple[FlownFlight, ...]:
        """The earlier flights; waypoints alone were flown by drones such as these."""
        swath = values["swath"]
        detection = values["probability_of_detection"]
        flights = []
        for number, given in enumerate(checks.items("flown", self.flown, "a list of flights")):
            name = f"flown[{number}]"
            flight = read_flown(name, given, swath, detection)
            if flight.landing > values["start"]:
                raise ValueError(
                    f"start must not be before the landing of {name}, "
                    f"{flight.landing:%Y-%m-%d %H:%M}, got {values['start']:%Y-%m-%d %H:%M}"
                )
            flights.append(flight)
        return tuple(flights)

    def _after(
        self: Self, flights: Sequence[tuple[list[str], Flight]], at: Any, changes: Any
    ) -> Self:
        """The incident after flights, given with the names of their waypoints; see `after`."""
        self._check_flown(flights)
        flown = [
            FlownFlight(tuple(flight), self.swath, self.probability_of_detection)
            for _, flight in flights
        ]
        landed = max(flight.landing for flight in (*self.flown, *flown))
        values = {**changes, "flown": (*self.flown, *flown)}
        time = self.time
        if values.get("time") is not None:
            time = in_utc("time", values["time"])
        start = max(landed + SORTIES_APART, time)
        if at is not None:
            start = near("start", at, time)
        if start < landed:
            raise ValueError(f"start must not be before the last landing, {landed}, got {start}")
        for name in FASTEST:
            values[name] = self._changed_flow(name, values.get(name), landed, time)
        return replace(self, start=start, **values)

    def _check_flown(self, flights: Sequence[tuple[list[str], Flight]]) -> None:
        """Raise a ValueError if the drones of this incident cannot have flown so."""
        wind = self.flow("wind", checked=False)
        higher = self._wind_factor(self._height(self.drones - 1))

        def blows(time: datetime, point: Floats) -> float:
            velocity = np.nan_to_num(wind(np.array([self.seconds(time)]), point))
            return float(higher * np.hypot(*velocity[:, 0]) + self.wind_error)

        strongest = max(blows(self.start, np.zeros((2, 1))), blows(self.time, np.zeros((2, 1))))
        reach = FASTER * (self.speed + strongest) * self.endurance
        for names, flight in flights:
            check_order(names, flight)
            check_flyable(
                names,
                flight,
                self.plane,
                within=(self.time, self.start + LONGEST_DRIFT),
                base=TangentPlane(*self.base),
                reach=min(reach, FARTHEST),
                airspeed=self.speed,
                wind=blows,
            )

    def _changed_flow(self, name: str, later: Any, landed: datetime, time: datetime) -> Any:
        """The wind or current of the next flights, which leaves that of flown ones as it was.

        Times in seconds count from `time`, that of the next report.
        """
        earlier = getattr(self, name)
        if later is None:
            return shifted(earlier, (time - self.time).total_seconds())
        if landed <= time:  # the new particles never meet the old flow
            return later
        later = read_flow(name, later, time)
        if isinstance(earlier, str) or isinstance(later, str):
            both = isinstance(earlier, str) and isinstance(later, str)
            if both and os.path.samefile(earlier, later):
                return earlier
            raise ValueError(
                f"{name} cannot change after flights if it is that of a file, because a wind and "
                "a file cannot be joined; give a newer position and time, from which the new one "
                "counts"
            )
        earlier = shifted(earlier, (time - self.time).total_seconds())
        seconds = (landed - time).total_seconds()
        if isinstance(later, Mapping) and min(later) < seconds:
            raise ValueError(
                f"{name} must be given for times from the last landing on, "
                f"{landed:%Y-%m-%d %H:%M}: what was flown does not change"
            )
        return changed_at(seconds, earlier, later)

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
                spoken = []
                for seconds, degrees, speed in self.courses(name):
                    at_time = f"{degrees:03.0f}° {speed / units.KNOT:.2g} kn ({speed:.2g} m/s)"
                    if isinstance(flow, Mapping):
                        at_time += f" at {self._clock(self.time + timedelta(seconds=seconds))}"
                    spoken.append(at_time)
                text += f", {name} {toward} {', '.join(spoken)}"
        return f"{text}; {plural(self.drones, 'drone')} from {self._clock(self.start)}."

    def _clock(self, time: datetime) -> str:
        """A time in words, with its date unless that is the incident's."""
        if time.date() == self.time.date():
            return f"{time:%H:%M}"
        return f"{time:%Y-%m-%d %H:%M}"

    @property
    def target(self) -> str:
        """What is searched for, in words."""
        if self.tracks is not None:
            return f"Tracks of {printable(Path(self.tracks).name)}"
        kind = leeway.class_of(self.object_class)
        return f"{kind.description.removesuffix(' (mean values)')} ({kind.name})"

    def courses(self, name: str) -> list[tuple[float, float, float]]:
        """The times in seconds, directions in degrees and speeds in m/s of a wind or current."""
        flow, turned = getattr(self, name), 180.0 if name == "wind" else 0.0
        return [
            (
                time,
                round((math.degrees(math.atan2(*vector)) + turned) % 360, 6) % 360,
                math.hypot(*vector),
            )
            for time, vector in (flow if isinstance(flow, Mapping) else {0.0: flow}).items()
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
        first = min([self.start, *(flight.waypoints[0].time for flight in self.flown)])
        begin = max(self.seconds(first), 0.0)  # before the report, there are no particles
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
            if cells.shape[1] < FEWEST_TRACKS:
                raise ValueError(
                    f"tracks must be at least {FEWEST_TRACKS}, half of which choose the patterns, "
                    f"got {cells.shape[1]} in {self.tracks}"
                )
            some = (cells[:, seed % 2 :: 2] * (1, -1))[:, :n].astype(np.float32)
            weights = np.full(some.shape[1], 1.0 / some.shape[1])
            cloud = Particles(begin, step, np.ascontiguousarray(some.transpose(2, 0, 1)), weights)
        missed = np.ones_like(cloud.weights)
        for flight in self.flown:
            legs = legs_of(flight.waypoints, self.plane, self.time)
            missed *= cloud.missed(legs, flight.swath, flight.probability_of_detection)
        weights = cloud.weights * missed
        found = float(cloud.weights @ (1.0 - missed))
        return replace(cloud, weights=weights / weights.sum(), found=found)

    @cached_property
    def _fields(self) -> dict[str, Field]:
        """The fields of wind and current that are files."""
        found = {}
        for name in FASTEST:
            if isinstance(path := getattr(self, name), str):
                found[name] = field = Field.read(Path(path), name, self.position)
                here = field.at(self.time.timestamp(), *np.array(self.position)[:, None])
                if np.isnan(here).any():
                    raise ValueError(
                        f"position must be at sea, but {path} has no {name} at {self.position}"
                    )
        return found

    def flow(self, name: str, *, checked: bool = True) -> Flow:
        """The "wind" at 10 m or the "current", at times in seconds and points on the plane."""
        field, since = self._fields.get(name), self.time.timestamp()
        known = None if field else series(getattr(self, name))
        # North is towards the pole, which is another direction elsewhere on the plane.
        turning = np.tan(np.radians(self.position[0])) / EQUATOR

        def velocity(times: Any, points: Floats) -> Floats:
            if field is not None:
                degrees = self.plane.degrees(points.T).T
                east, north = field.at(since + times, *degrees, checked=checked)
            else:
                assert known is not None
                east, north = known(np.atleast_1d(times))
            turned = turning * points[0]
            return np.array([east - turned * north, north + turned * east])

        return velocity

    def drone(self, number: int) -> Drone:
        """A drone in the wind at its height; its times are in seconds after take-off."""
        factor = self._wind_factor(self._height(number))
        # Drones try flights that leave the field, but only fly near the particles.
        wind, start = self.flow("wind", checked=False), self.seconds(self.start)
        return Drone(
            self.speed,
            self.turn,
            self.endurance - self.reserve,
            self.plane.metres(*self.base),
            lambda times, points: np.nan_to_num(wind(start + times, points)) * factor,
        )

    def _height(self, number: int) -> float:
        """At which a drone flies above the sea, in metres."""
        return float(self.altitude + APART * number)

    @staticmethod
    def _wind_factor(height: float) -> float:
        """The wind at a height in metres, divided by that at 10 m."""
        return float((max(height, 1.0) / 10.0) ** WIND_EXPONENT)

    # Files.

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the incident as JSON, to edit and to `read`; paths count from its folder."""
        write_text(Path(path), self.as_json(Path(path).parent))

    def as_json(self, folder: Path) -> str:
        """The text of a file that will lie in a folder, from which its paths count."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values |= self._typed  # type: ignore[attr-defined]
        if self.base == self.position:
            values["base"] = None
        for name in FASTEST:
            if isinstance(values[name], str):
                continue
            texts = []
            for seconds, degrees, speed in self.courses(name):
                when = self.time + timedelta(seconds=seconds)
                exact = "auto" if when.second or when.microsecond else "minutes"
                stamp = when.isoformat(timespec=exact).replace("+00:00", "Z")
                texts.append(f"{degrees:g}° {speed / units.KNOT:.6g} kn@{stamp}")
            values[name] = texts if isinstance(values[name], Mapping) else texts[0].split("@")[0]
        for name in ("tracks", "wind", "current"):
            if isinstance(file := getattr(self, name), str):
                values[name] = os.path.relpath(file, folder)
        return json.dumps(values, indent=1, default=_plain, ensure_ascii=False) + "\n"

    @classmethod
    def read(cls: type[Self], path: str | os.PathLike[str], **changes: Any) -> Self:
        """Read a JSON file, in which paths count from its folder; `changes` replace its values."""
        data = parsed_json(Path(path).read_bytes())
        names = [field.name for field in fields(cls)]
        data = checks.known_keys("an incident", data, names, ValueError)
        for name in ("tracks", "wind", "current"):
            file = data.get(name)
            if isinstance(file, str) and (name == "tracks" or Path(file).suffix.lower() in FILES):
                data[name] = os.path.normpath(Path(path).parent / file)
        return cls(**{**data, **changes})


def _plain(value: object) -> object:
    """What JSON holds in place of a time or a flown flight."""
    if isinstance(value, FlownFlight):
        return vars(value)
    assert isinstance(value, datetime)
    return value.isoformat()


def _position(name: str, value: object) -> Pair:
    if isinstance(value, str):
        value = named(name, units.position, value)
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        value = tuple(
            named(name, units.degrees, number, letters) if isinstance(number, str) else number
            for number, letters in zip(value, ("NS", "EW"), strict=True)
        )
    latitude, longitude = checks.pair(name, value, "(latitude, longitude) in degrees")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f"{name} must be (latitude, longitude) in degrees, the latitude first and from -89 to "
            f"89, the longitude from -180 to 180, got {value!r}"
        )
    return latitude, longitude
