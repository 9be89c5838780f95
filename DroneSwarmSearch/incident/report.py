"""What is known of an incident: validated values, possible persons, and what drones can do."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.drift import leeway
from DroneSwarmSearch.drift.plane import EQUATOR, TangentPlane
from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.drift.track_files import first_known, positions
from DroneSwarmSearch.incident import particles, units
from DroneSwarmSearch.incident.fields import Field
from DroneSwarmSearch.incident.flights import Waypoint, in_utc, legs_of
from DroneSwarmSearch.incident.flows import FASTEST, FILES, named, read_flow, series
from DroneSwarmSearch.incident.particles import Flow, Particles
from DroneSwarmSearch.incident.patterns import Drone

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

ABOVE_ZERO = "speed", "swath", "endurance"


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
        self._check_places_and_times(values)
        self._check_drones(values)
        for name in FASTEST:
            values[name] = read_flow(name, values[name], values["time"])
        values["flown"] = tuple(
            tuple(Waypoint(in_utc("flown", when), *rest) for when, *rest in flight)
            for flight in self.flown
        )
        for name, value in values.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_typed", typed)

    def _check_object(self, values: dict[str, Any]) -> None:
        """Check what drifts; tracks complete the values."""
        if self.tracks is None and (self.wind is None or self.object_class is None):
            raise ValueError(
                "object_class and wind must be given, or tracks in their place, got "
                f"object_class={self.object_class!r}, wind={self.wind!r}"
            )
        if self.tracks is None:
            leeway.class_of(self.object_class)
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

    def _check_places_and_times(self, values: dict[str, Any]) -> None:
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

    def _check_drones(self, values: dict[str, Any]) -> None:
        for name, kind in QUANTITIES.items():
            given = values[name]
            number = named(name, units.quantity, given, kind) if isinstance(given, str) else given
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
                    for seconds, degrees, speed in self.courses(name)
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
        height = max(self.altitude + APART * number, 1.0)
        # Drones try flights that leave the field, but only fly near the particles.
        wind, start = self.flow("wind", checked=False), self.seconds(self.start)
        return Drone(
            self.speed,
            self.turn,
            self.endurance - self.reserve,
            self.plane.metres(*self.base),
            lambda times, points: (
                np.nan_to_num(wind(start + times, points)) * (height / 10.0) ** WIND_EXPONENT
            ),
        )

    # Files.

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the incident as JSON, to edit and to `read`; paths count from its folder."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values |= self._typed  # type: ignore[attr-defined]
        if self.base == self.position:
            values["base"] = None
        for name in FASTEST:
            if isinstance(values[name], str):
                continue
            texts = []
            for seconds, degrees, speed in self.courses(name):
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
    def read(cls: type[Self], path: str | os.PathLike[str], **changes: Any) -> Self:
        """Read a JSON file, in which paths count from its folder; `changes` replace its values."""
        data = json.loads(Path(path).read_text("utf-8"))
        if not isinstance(data, dict):
            raise ValueError(f"{path} must hold an incident, a JSON object, got {data!r:.100}")
        for name in ("tracks", "wind", "current"):
            file = data.get(name)
            if isinstance(file, str) and (name == "tracks" or Path(file).suffix in FILES):
                data[name] = os.path.normpath(Path(path).parent / file)
        return cls(**{**data, **changes})


def _position(name: str, value: object) -> Pair:
    if isinstance(value, str):
        value = named(name, units.position, value)
    elif isinstance(value, (tuple, list)):
        value = tuple(
            named(name, units.degrees, number, letters) if isinstance(number, str) else number
            for number, letters in zip(value, ("NS", "EW"), strict=False)
        )
    latitude, longitude = checks.pair(name, value, "(latitude, longitude) in degrees")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f"{name} must be (latitude, longitude) in degrees, the latitude first and from -89 to "
            f"89, the longitude from -180 to 180, got {value!r}"
        )
    return latitude, longitude
