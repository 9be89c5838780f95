"""What is known of an incident, as plain data: checked values, and their file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime, timedelta
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch._internal.files import parsed_json, write_text
from DroneSwarmSearch._internal.text import plural, printable
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.coast import GSHHG, NONE, Land, land_around
from DroneSwarmSearch.geo.flows import Flow, Origin
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.polygons import on_plane, polygons_of, shapely_package
from DroneSwarmSearch.geo.times import near
from DroneSwarmSearch.geo.typed_flows import FILES, read_flow
from DroneSwarmSearch.geo.units import LENGTH, SPEED, Quantity
from DroneSwarmSearch.incident.by_class import BY_CLASS, ByClass, as_mapping, check_classes
from DroneSwarmSearch.incident.fleet import (
    COPTER,
    DRONES,
    HEIGHTS_APART,
    LOWEST,
    USUAL,
    USUAL_RESERVE,
    Drone,
    at_heights,
    completed,
    read_fleet,
)
from DroneSwarmSearch.incident.fleet import SHARED as SHARED_BY_DRONES
from DroneSwarmSearch.incident.flights import FlownFlight, read_flown
from DroneSwarmSearch.incident.hypothesis import (
    FIELDS,
    MEAN,
    PLACES,
    SEEN,
    Hypothesis,
    Outline,
    polygons_in,
    read_outline,
    read_position,
    read_times,
)
from DroneSwarmSearch.incident.places import Point
from DroneSwarmSearch.incident.sweep_widths import swaths
from DroneSwarmSearch.persons import leeway
from DroneSwarmSearch.persons.track_files import first_known

VISIBILITY = Quantity(LENGTH, 100, 100_000, "from 100 m to 100 km")
HEIGHT = Quantity(LENGTH, 0, 10_000, "from 0 to 10 km")

FLOW_ERRORS = {
    "wind_error": Quantity(SPEED, 0, 60, "from 0 to 60 m/s", error="across"),
    "current_error": Quantity(SPEED, 0, 5, "from 0 to 5 m/s", error="across"),
}
"""What the errors of flows may be."""

FARTHEST = 100_000.0
"""The largest distance in metres from the origin; the plane is accurate up to there."""

LONGEST_DRIFT = timedelta(hours=72)
"""From the last known position to the take-off; errors of leeway and current grow without end."""

USUAL_ALTITUDE = 100.0
USUAL_CEILING = 120.0

NEAR = 64_000.0
"""Metres from the last known position to which land is first read."""

FLOWS = ("wind", "current")
COASTS = (GSHHG, NONE)

MOST_DRONES = 50

NO_FLY_MARGIN = 100.0
"""Metres from areas that nobody enters."""

STATED = SHARED_BY_DRONES
"""What an incident states of all drones."""

ERRORS = {"wind_error": 2.0, "current_error": 0.13}
"""The usual errors of flows that are not ensembles."""

LIMITS = ("ceiling", "floor")
"""Of the heights of drones."""

DEPENDENT = (*ERRORS, "reserve", "altitude", *LIMITS)
"""Quantities whose default depends on other values."""

ONE_CASE = tuple(name for name in FIELDS if name not in ("weight", "name"))
"""The values of the only hypothesis."""

SHARED = ("time", "position_error", "object_class")
"""Those which hypotheses that are mappings need not repeat."""

WHERE = (*PLACES, *SEEN)

OUTLINES = ("area", "no_fly")

TYPED = (*ONE_CASE, "hypotheses", "base", "fleet", "no_fly")
"""Values that files hold as they were typed, if they were."""

IN_TRACKS = ("hypotheses", "line", "area", *SEEN, "position_error", "current", *ERRORS)
"""What tracks have already: given with them, it would have no effect."""


class Mark(NamedTuple):
    """A point, a line or a closed outline on maps.

    Attributes:
        name: what it is.
        when: the time.
        points: (east, north) in metres: (n, 2); those of an outline end where they begin.
    """

    name: str
    when: str
    points: Floats

    @property
    def is_closed(self) -> bool:
        """Whether it is an outline."""
        return len(self.points) > 3 and bool(np.all(self.points[0] == self.points[-1]))


@dataclass(frozen=True, kw_only=True)
class Incident:
    """What a rescue centre knows: who drifts, where they were last seen, and which drones can fly.

    Positions are (latitude, longitude) in degrees, or text such as ("54-10.8N", "007-51.0E");
    lengths are in metres, durations in seconds and speeds in m/s, or text with units, such as
    "20 kn", "0.5 NM" and "45 min". Times are datetimes with a time zone, or text such as
    "2026-03-01T05:30Z". Whatever was typed, the attributes are pairs, numbers, datetimes and flows.

    Where, when and what it was is one `Hypothesis`, whose values are also those of an incident, or
    a list of them. A text such as "3 NM probable" is the error in which half of all values lie, "3
    NM 95%" that of 95% of them; other errors are standard deviations along each axis.

    Attributes:
        position: the last known position, or that of an observer, see `bearing`.
        time: when the person was there; or two times, between which something happened.
        line, area, bearing, distance: in place of a position alone, as for `Hypothesis`.
        position_error: of the position, the line or the area; 926 m, half a nautical mile, is usual
            for a position reported by an aircraft, and tens of metres for GPS.
        bearing_error, distance_error: of what an observer saw, as for `Hypothesis`.
        object_class: a key of `leeway.CLASSES`, such as "PIW-1", a person in the water; or several
            with weights, such as {"PIW-1": 0.3, "LIFE-RAFT-SB-6": 0.7}.
        hypotheses: in place of all these, what may have happened, each a `Hypothesis` or a mapping
            of its values. Mappings need not repeat time, position_error and object_class.
        cases: all hypotheses, also if there is only one; none with tracks.
        craft: all drones, boats and helicopters with all their values, in their order.
        origin: where and when metres and seconds begin: in the middle of all hypotheses, at their
            earliest time.
        wind: where it comes from and its speed, at 10 m: "300 25kn", or "NW 12 m/s"; or (east,
            north), where it blows to. One that changes is a list of texts with times, such as
            ["300 25kn", "320 30kn@08:00Z"], a mapping of seconds after `time` to winds, or a CSV
            file with the columns time, direction and speed. Between times it is interpolated. Or
            the NetCDF file of a weather model, .nc, with a field by CF standard name.
        current: in the forms of the wind, but the direction is where it flows to. Where the file of
            an ocean model has no values, there is land, on which persons strand.
        wind_error: the standard deviation along each axis of the error of the wind, constant in an
            incident. By default 2 m/s, the target accuracy of satellite winds (EUMETSAT OSI SAF,
            wind products); forecasts are no better. 0 for a file with an ensemble, whose members
            are shared out among the persons: their spread is the error.
        current_error: the standard deviation of the error of the current. By default 0.13 m/s: a
            probable error of 0.3 kn, which the IAMSAR Manual (volume II, appendix K) takes where
            none is known, divided by 1.18. 0 for an ensemble.
        tracks: a file of a drift simulation, see `Tracks.read`, in place of class and current;
            `wind` is then only that on the drones, by default none. Position and time are by
            default the mean of its first positions, and when.
        coast: where land is: "gshhg", the coastline of the package roaring-landmask; a GeoJSON file
            with polygons of land; or "none". Persons start at sea, and strand on shores.
        start: when the drones take off, at most 72 hours after `time`; by default an hour after
            it. Of a time of the clock, such as "06:00Z", the nearest to `time` counts, here and
            where a wind or a current changes.
        drones: how many, 3 by default.
        fleet: in place of their number, each drone, boat and helicopter, a `Drone` or a mapping of
            its values; or a CSV file with a row for each, whose columns have the names of these
            values. What a drone does not state is as follows.
        visibility: at sea, 10 NM by default; what helicopters and boats see depends on it.
        speed: their airspeed, at most 200 m/s.
        swath: the width of the strip that a drone sees, from 1 m to 60 km; or that for each object
            class, {"PIW-1": 100, ...}.
        probability_of_detection: that a drone which flies over the person, within the strip, finds
            the person; from 0 to 1, or for each object class.
        endurance: of a drone, from take-off to landing; at most 12 hours.
        reserve: what must be left of the endurance at the landing, by default a fifth of it.
        base: where the drones take off and land; by default the last known position.
        altitude: of the first drone above the sea; each further one flies 20 m higher, up to the
            ceiling, and then below the first one. By default 100 m, or less if there is not room
            for all drones between it and the ceiling.
        ceiling: above which no drone flies; by default 120 m, the limit for drones in Europe and in
            the United States, or a higher altitude that is given.
        floor: below which no drone flies; by default 20 m, or a lower altitude that is given.
        turn: seconds in which a drone turns by a right angle.
        climb: the speed with which drones climb after the take-off, and sink to land.
        aircraft: for which missions are written: "copter" or "plane", with ArduPilot or PX4; or
            "dji", which fly at most 15 m/s over the ground. Helicopters and boats are in a fleet.
        night: whether drones can search after sunset; else they take off by day, and have ended
            their search when the sun sets at the origin.
        no_fly: areas that no drone and no helicopter enters, as for `area`: a GeoJSON file with
            polygons, or the corners of one.
        flown: earlier flights that found nobody, each a `FlownFlight`, see `after`; or the
            waypoints of a flight, flown with this swath and probability of detection.

    Raises:
        ImportError: `tracks` or the file of a model needs netCDF4.
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits.
    """

    position: Pair = None  # type: ignore[assignment]  # given, or known from tracks
    time: Any = None
    line: Any = None
    area: Any = None
    position_error: Any = None
    bearing: Any = None
    distance: Any = None
    bearing_error: Any = None
    distance_error: Any = None
    object_class: Any = None
    hypotheses: tuple[Hypothesis, ...] = ()
    cases: tuple[Hypothesis, ...] = field(init=False)
    craft: tuple[Drone, ...] = field(init=False)
    origin: Origin = field(init=False)
    wind: Flow = None  # type: ignore[assignment]
    current: Flow = (0.0, 0.0)  # type: ignore[assignment]  # read below
    wind_error: float = None  # type: ignore[assignment]
    current_error: float = None  # type: ignore[assignment]
    tracks: str | None = None
    coast: str = GSHHG
    start: datetime = None  # type: ignore[assignment]
    drones: int = None  # type: ignore[assignment]  # known below
    fleet: tuple[Drone, ...] = ()
    visibility: float = 18_520.0
    speed: float = 20.0
    swath: ByClass = 200.0
    probability_of_detection: ByClass = 0.8
    endurance: float = 2700.0
    reserve: float = None  # type: ignore[assignment]
    base: Pair = None  # type: ignore[assignment]
    altitude: float = None  # type: ignore[assignment]
    ceiling: float = None  # type: ignore[assignment]
    floor: float = None  # type: ignore[assignment]
    turn: float = 4.0
    climb: float = 3.0
    aircraft: str = COPTER
    night: bool = False
    no_fly: Outline | None = None
    flown: tuple[FlownFlight, ...] = ()
    _typed: dict[str, Any] = field(init=False, repr=False, compare=False)
    _left_out: tuple[str, ...] = field(init=False, repr=False, compare=False)

    if TYPE_CHECKING:

        def __init__(self, **values: Any) -> None: ...  # in all the forms above

    def __post_init__(self) -> None:
        given = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        for name, value in _checked(given).items():
            object.__setattr__(self, name, value)
        typed = {name: given[name] for name in TYPED}
        object.__setattr__(self, "_typed", typed)
        left_out = tuple(name for name in DEPENDENT if given[name] is None)
        object.__setattr__(self, "_left_out", left_out)

    def changed(self, **changes: Any) -> Incident:
        """The incident with other values; defaults that depend on values are computed anew.

        Another place, or other hypotheses, replace all that were given.
        """
        return Incident(**_replaced(self._values, changes))

    @property
    def _values(self) -> dict[str, Any]:
        """All values as given, but None for those that depend on others and have not been given."""
        values = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        return values | self._typed | dict.fromkeys(self._left_out)

    def times_with(self, changes: dict[str, Any]) -> tuple[datetime, datetime]:
        """`time` and `latest` of the incident with other values."""
        case = _case(_replaced(self._values, changes))
        time: datetime = case["origin"].time
        return time, _latest(case["cases"], time)

    # Where and when.

    @property
    def plane(self) -> TangentPlane:
        """The plane of all metres; it touches the earth at the origin."""
        return self.origin.plane

    @property
    def began(self) -> datetime:
        """When the person drifts at the earliest: when all seconds begin."""
        return self.origin.time

    def seconds(self, time: datetime) -> float:
        """Seconds from the origin to a time."""
        return self.origin.seconds(time)

    @property
    def latest(self) -> datetime:
        """When the person drifts at the latest."""
        return _latest(self.cases, self.began)

    @property
    def farthest_start(self) -> float:
        """The distance in metres from the origin, within which persons begin to drift."""
        return max((each.place.reach(self.plane) for each in self.cases), default=0.0)

    @property
    def object_classes(self) -> tuple[str, ...]:
        """The object classes of all hypotheses; none with tracks."""
        return _classes(self.cases)

    def land(self, reach: float) -> Land | None:
        """The land up to a distance from the last known position; None with coast "none".

        The distance is to each side, in metres.

        Raises:
            ImportError: a package is missing, see `geo.coast`.
            ValueError: the file of the coast cannot be read.
        """
        return _land(self.coast, self.origin.position, reach)

    @cached_property
    def forbidden(self) -> Any:
        """The areas that nobody enters, with a margin of 100 m; a geometry of shapely, or None."""
        if self.no_fly is None:
            return None
        areas = on_plane(polygons_in("no_fly", self.no_fly), self.plane)
        areas = areas.buffer(NO_FLY_MARGIN, join_style="mitre", mitre_limit=2)
        shapely_package().prepare(areas)
        return areas

    def land_within(self, farthest: float) -> Land | None:
        """`land`, at least up to a distance; few different distances are read."""
        reach = NEAR
        while reach < farthest:
            reach *= 2
        return self.land(reach)

    @property
    def heights(self) -> tuple[float, ...]:
        """The height of each drone above the sea, in metres; too many drones share heights."""
        return tuple(drone.altitude for drone in self.craft)

    @property
    def landed(self) -> datetime:
        """When all have landed at the latest."""
        return max(drone.latest_landing for drone in self.craft)

    @property
    def airborne(self) -> float:
        """Seconds from the first take-off to the last landing, at the latest."""
        return (self.landed - self.start).total_seconds()

    @property
    def fleet_in_words(self) -> str:
        """How many drones, helicopters and boats there are."""
        kinds = [each.kind for each in self.craft]
        *others, last = [plural(kinds.count(kind), kind) for kind in dict.fromkeys(kinds)]
        return f"{', '.join(others)} and {last}" if others else last

    @property
    def marks(self) -> list[Mark]:
        """What maps show of the hypotheses: a point or lines for each."""
        if not self.cases:
            return [Mark(f"{Point.label}", f"{self.began:%H:%M}", np.zeros((1, 2)))]
        marks = []
        for each in self.cases:
            first, last = each.time
            when = f"{first:%H:%M}" if first == last else f"{first:%H:%M} to {last:%H:%M}"
            name = each.place.label
            if len(self.cases) > 1:
                name = f"{each.name}: {name}"
            marks += [Mark(name, when, outline) for outline in each.place.outlines(self.plane)]
        return marks

    @property
    def no_fly_marks(self) -> list[Mark]:
        """The outlines of the areas that nobody enters, as maps show them."""
        if self.forbidden is None:
            return []
        return [Mark("no-fly area", "", outline) for outline, *_ in polygons_of(self.forbidden)]

    # In words.

    @property
    def sentence(self) -> str:
        """The incident in a sentence."""
        parts = [
            self.case,
            self.wind.described(self._clock),
            self.current.described(self._clock),
        ]
        known = ", ".join(part for part in parts if part)
        return f"{known}; {self.fleet_in_words} from {self._clock(self.start)}."

    @property
    def case(self) -> str:
        """What may have happened, in words."""
        if not self.cases:
            where = units.radioed(self.origin.position)
            return f"{self.target} at {where}, {self.began:%Y-%m-%d %H:%M} UTC"
        if len(self.cases) == 1:
            return self.cases[0].sentence
        cases = [f"{each.name} ({each.weight:.0%}): {each.sentence}" for each in self.cases]
        return "; ".join(cases)

    @property
    def target(self) -> str:
        """What is searched for, in words."""
        if self.tracks is not None:
            return f"Tracks of {printable(Path(self.tracks).name)}"
        targets = dict.fromkeys(each.target for each in self.cases)
        return " or ".join(targets)

    @property
    def headline(self) -> str:
        """What is searched for, in few words."""
        if not self.cases:
            return self.target
        kinds = [leeway.class_of(name).description for name in self.object_classes]
        if len(kinds) == 1:
            return kinds[0].removesuffix(MEAN)
        names = dict.fromkeys(kind.partition(",")[0].lower() for kind in kinds)
        return " or ".join(names).capitalize()

    def _clock(self, time: datetime) -> str:
        """A time in words, with its date unless that is the incident's."""
        if time.date() == self.began.date():
            return f"{time:%H:%M}"
        return f"{time:%Y-%m-%d %H:%M}"

    # Files.

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the incident as JSON, to edit and to `read`; paths count from its folder."""
        write_text(Path(path), self.as_json(Path(path).parent))

    def as_json(self, folder: Path) -> str:
        """The text of a file that will lie in a folder, from which its paths count."""
        values = {name: value for name, value in self._values.items() if _is_given(name, value)}
        for name in OUTLINES:
            outline = getattr(self, name)
            if isinstance(outline, str):  # a file
                values[name] = os.path.relpath(outline, folder)
        if self.hypotheses:  # they are complete
            values = {name: value for name, value in values.items() if name not in SHARED}
            values["hypotheses"] = [each.plain(folder) for each in self.hypotheses]
        if self.fleet:
            values["fleet"] = [_with_mappings(each.given()) for each in self.fleet]
            del values["drones"]
        for name in FLOWS:
            values[name] = values[name].as_typed(os.fspath(folder))
        for name, value in (("tracks", self.tracks), ("coast", self.coast)):
            if value is not None and value not in COASTS:
                values[name] = os.path.relpath(value, folder)
        values = _with_mappings(values)
        return json.dumps(values, indent=1, default=_plain, ensure_ascii=False) + "\n"

    @classmethod
    def read(cls, path: str | os.PathLike[str], **changes: Any) -> Incident:
        """Read a JSON file, in which paths count from its folder; `changes` replace its values."""
        data = parsed_json(Path(path).read_bytes())
        names = [each.name for each in fields(cls) if each.init]
        values = checks.known_keys("an incident", data, names, ValueError)
        folder = Path(path).parent
        _find_files(values, ("tracks", "coast", "area", "no_fly", *FLOWS), folder)
        for each in values.get("hypotheses") or ():
            if isinstance(each, dict):
                _find_files(each, ("area",), folder)
        return cls(**_replaced(values, changes))


def _find_files(values: dict[str, Any], names: tuple[str, ...], folder: Path) -> None:
    """Let the paths of files count from a folder."""
    for name in names:
        file = values.get(name)
        if isinstance(file, str) and _names_file(name, file):
            values[name] = os.path.normpath(folder / file)


def _replaced(values: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Values with changes; another place, other hypotheses or a fleet replace what was given.

    With another fleet, values that none of its drones takes are the usual ones again.
    """
    if any(name in changes for name in (*PLACES, "hypotheses")):
        values = {**values, **dict.fromkeys(WHERE), "hypotheses": ()}
    if "fleet" in changes:
        values = {**values, "drones": None}
        usual = {each.name: each.default for each in fields(Incident)}
        fleet = read_fleet(changes["fleet"]) if changes["fleet"] else []
        unused = _unused({**usual, **values}, fleet)
        values |= {name: usual[name] for name in unused}
    return {**values, **changes}


def _is_given(name: str, value: object) -> bool:
    """Whether a value that depends on others, or is one of several forms, has been given."""
    return value not in (None, ()) or name not in (*TYPED, *DEPENDENT)


@lru_cache(maxsize=8)
def _land(coast: str, position: Pair, reach: float) -> Land | None:
    """`land_around`, kept: plans ask for the same land again and again."""
    return land_around(coast, position, reach)


def _names_file(name: str, value: str) -> bool:
    """Whether a value names a file."""
    if name == "coast":
        return value not in COASTS
    if name in OUTLINES:
        return ";" not in value
    return name == "tracks" or Path(value).suffix.lower() in FILES


def _checked(given: dict[str, Any]) -> dict[str, Any]:
    """The values of an incident in their plain forms, from what was given."""
    values = {**given, **_case(given), "coast": _coast(given["coast"])}
    values |= {
        name: kind.read(name, given[name])
        for name, kind in FLOW_ERRORS.items()
        if given[name] is not None
    }
    values |= _base_and_start(values)
    values["visibility"] = VISIBILITY.read("visibility", given["visibility"])
    for name in FLOWS:
        values[name] = read_flow(name, values[name], values["origin"])
    values |= _fleet(values, given)
    landed = max(each.latest_landing for each in values["craft"])
    for name in FLOWS:
        flow = values[name]
        flow.check_times(landed)
        error = f"{name}_error"
        if values[error] is None:
            values[error] = ERRORS[error] if flow.members == 1 else 0.0
    if given["no_fly"] is not None:
        values["no_fly"] = read_outline("no_fly", given["no_fly"])
    if values["tracks"] is not None:
        _check_tracks_alone(values, given)
    values["flown"] = _flown(values)
    return values


def _fleet(values: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """What the incident states of all drones, and each of them."""
    stated = {name: given[name] for name in STATED if given[name] is not None}
    read = Drone(**stated).given()
    if read["aircraft"] in USUAL:
        raise ValueError(
            f"aircraft must be that of drones, {', '.join(DRONES)}, because a {read['aircraft']} "
            "is a row of a fleet"
        )
    for name in LIMITS:
        if given[name] is not None:
            read[name] = HEIGHT.read(name, given[name])
    reserve = read.get("reserve", USUAL_RESERVE * read["endurance"])
    if reserve >= read["endurance"]:
        raise ValueError(
            f"reserve must be less than the endurance, {read['endurance'] / 60:g} min, got "
            f"{given['reserve']!r}"
        )
    fleet = read_fleet(given["fleet"]) if given["fleet"] else []
    drones = given["drones"]
    if fleet and drones not in (None, len(fleet)):
        raise ValueError(f"drones cannot be given together with fleet, got {drones!r:.100}")
    _check_used(given, fleet)
    count = len(fleet) or checks.integer("drones", 3 if drones is None else drones, 1, MOST_DRONES)
    shared = {"aircraft": COPTER, "base": values["base"], "reserve": None, **read}
    for name in ("altitude", *LIMITS):
        shared.pop(name, None)
    drones = fleet or [Drone() for _ in range(count)]
    craft = completed(drones, shared, values["start"], partial(_swaths, values))
    unplaced = sum(each.altitude is None for each in craft)
    unknown = dict.fromkeys(("altitude", "ceiling", "floor"))
    heights = _heights({**unknown, **read, "drones": unplaced})
    craft = at_heights(craft, **heights)
    _check_craft(values | heights, craft)
    start = min(each.take_off for each in craft)
    read |= heights | {"reserve": reserve, "fleet": tuple(fleet), "drones": count, "start": start}
    return read | {"craft": tuple(craft)}


def _swaths(values: dict[str, Any], aircraft: str, speed: float) -> ByClass:
    """What a boat or a helicopter sees, by the tables, in the wind at the start."""
    classes = _classes(values["cases"])
    if not classes:
        raise ValueError(f"swath must be given for a {aircraft}, together with tracks")
    seconds = values["origin"].seconds(values["start"])
    blows = values["wind"].velocity(seconds, np.zeros((2, 1)))
    return swaths(
        aircraft,
        classes,
        visibility=values["visibility"],
        wind=float(np.hypot(*np.nan_to_num(blows))[0]),
        speed=speed,
    )


def _classes(cases: Sequence[Hypothesis]) -> tuple[str, ...]:
    """The object classes of all hypotheses."""
    return tuple(dict.fromkeys(name for each in cases for name, _ in each.object_class))


def _check_used(given: dict[str, Any], fleet: Sequence[Drone]) -> None:
    """Raise a ValueError for a value that no drone of a fleet takes from the incident."""
    unused = _unused(given, fleet)
    if "visibility" in unused:
        raise ValueError(
            "visibility matters only for helicopters and boats of a fleet that do not state their "
            f"swath, got {given['visibility']!r}: give the swath of drones as it is today"
        )
    if unused:
        raise ValueError(
            f"{unused[0]} cannot be given together with a fleet in which all have their own"
        )


def _unused(given: dict[str, Any], fleet: Sequence[Drone]) -> list[str]:
    """The values, other than the usual ones, that no drone of a fleet takes from the incident."""
    usual = {each.name: each.default for each in fields(Incident)}
    stated = [each.given() for each in fleet]
    drones = [own for own in stated if own.get("aircraft") not in USUAL]
    by_tables = [own for own in stated if own.get("aircraft") in USUAL and "swath" not in own]
    unused = []
    for name in (*STATED, "start"):
        own_name = "take_off" if name == "start" else name
        users = stated if name in ("base", "start") else drones
        if fleet and all(own_name in own for own in users):
            unused.append(name)
    if not by_tables:
        unused.append("visibility")
    return [name for name in unused if given[name] != usual[name]]


def _check_craft(values: dict[str, Any], craft: Sequence[Drone]) -> None:
    """Raise a ValueError for drones with equal names, far away, too early, or of other classes."""
    names = [each.name for each in craft]
    if len(set(names)) < len(names):
        raise ValueError(f"fleet must have different names, got {', '.join(names)}")
    classes = _classes(values["cases"])
    latest = _latest(values["cases"], values["origin"].time)
    for each in craft:
        for name in ("swath", "probability_of_detection"):
            check_classes(name, getattr(each, name), classes)
        if each.take_off < latest:
            raise ValueError(
                f"take_off of {each.name} must not be before time, {latest}, got {each.take_off}"
            )
        if each.kind == "drone" and not values["floor"] <= each.altitude <= values["ceiling"]:
            raise ValueError(
                f"altitude of {each.name} must be from the floor, {values['floor']:g} m, to the "
                f"ceiling, {values['ceiling']:g} m, got {each.altitude:g} m"
            )
        _check_near(f"base of {each.name}", values["origin"].position, each.base)
        _check_start(f"take_off of {each.name}", values["origin"].time, each.take_off)


def _heights(values: dict[str, Any]) -> dict[str, float]:
    """The altitude of the first drone, the ceiling and the floor, where they are not given."""
    altitude = values["altitude"]
    ceiling = values["ceiling"]
    floor = values["floor"]
    if ceiling is None:
        ceiling = max(USUAL_CEILING, altitude or 0.0, floor or 0.0)
    if floor is not None and not floor <= (ceiling if altitude is None else altitude):
        raise ValueError(
            f"floor must be at most the altitude and the ceiling, {altitude or ceiling:g} m, got "
            f"{floor:g} m"
        )
    lowest = min(LOWEST if floor is None else floor, ceiling)
    if altitude is None:
        room = HEIGHTS_APART * (values["drones"] - 1)
        altitude = min(max(USUAL_ALTITUDE, floor or 0.0), max(ceiling - room, lowest))
    if altitude > ceiling:
        raise ValueError(
            f"altitude must be at most the ceiling, {ceiling:g} m, got {altitude:g} m; raise the "
            "ceiling if drones may fly there"
        )
    return {"altitude": altitude, "ceiling": ceiling, "floor": min(lowest, altitude)}


def _coast(value: object) -> str:
    """The name of a coast, or the path of its file."""
    what = "coast must be 'gshhg', 'none' or a GeoJSON file"
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{what}, got {value!r}")
    coast = os.fspath(value)
    if coast not in COASTS and not Path(coast).is_file():
        raise ValueError(f"{what}, but there is no {coast!r}")
    return coast


def _case(given: dict[str, Any]) -> dict[str, Any]:
    """What may have happened, and where metres and seconds begin."""
    if given["tracks"] is not None:
        return _case_of_tracks(given)
    if given["hypotheses"]:
        cases = _several(given)
        values = {"hypotheses": cases, **dict.fromkeys(SHARED)}
    else:
        cases = (_only_one(given),)
        values = _flat(cases[0])
    if given["wind"] is None:
        raise ValueError("wind must be given, such as 300 25kn, or tracks in its place")
    middle = _middle(cases)
    plane = TangentPlane(*middle)
    for row, each in enumerate(cases):
        far = max(float(np.hypot(*line.T).max()) for line in each.place.outlines(plane))
        if not far <= FARTHEST:
            name = f"hypotheses[{row}]" if given["hypotheses"] else "line or area"
            raise ValueError(
                f"{name} must be within {FARTHEST / 1000:g} km of the middle of all, got "
                f"{far / 1000:,.0f} km"
            )
    origin = Origin(middle, min(each.time[0] for each in cases))
    return {**values, "cases": cases, "origin": origin}


def _latest(hypotheses: Sequence[Hypothesis], time: datetime) -> datetime:
    """When the person drifts at the latest; `time` without hypotheses."""
    return max((each.time[1] for each in hypotheses), default=time)


def _only_one(given: dict[str, Any]) -> Hypothesis:
    """The hypothesis that is given by the values of the incident."""
    return Hypothesis(**{name: given[name] for name in ONE_CASE})


def _flat(case: Hypothesis) -> dict[str, Any]:
    """The values of the only hypothesis as those of the incident."""
    values = {name: getattr(case, name) for name in ONE_CASE}
    first, last = case.time
    if first == last:
        values["time"] = first
    if len(case.object_class) == 1:
        values["object_class"] = case.object_class[0][0]
    return values


def _several(given: dict[str, Any]) -> tuple[Hypothesis, ...]:
    """Hypotheses, with weights that sum to 1; the values of the incident complete mappings."""
    for name in WHERE:
        if given[name] is not None:
            raise ValueError(f"{name} cannot be given together with hypotheses, which have theirs")
    shared = {name: given[name] for name in SHARED if given[name] is not None}
    used: set[str] = set()
    found: list[Hypothesis] = []
    for row, each in enumerate(checks.items("hypotheses", given["hypotheses"], "a list")):
        name = f"hypotheses[{row}]"
        if isinstance(each, Hypothesis):
            found.append(each)
            continue
        values = checks.known_keys(name, each, FIELDS, ValueError)
        used |= shared.keys() - values.keys()
        try:
            found.append(Hypothesis(**{**shared, **values}))
        except (TypeError, ValueError) as error:
            raise type(error)(f"{name}: {error}") from None
    for name in shared.keys() - used:
        raise ValueError(f"{name} cannot be given together with hypotheses that all have theirs")
    names = [each.name or str(number) for number, each in enumerate(found, 1)]
    if len(set(names)) < len(names):
        raise ValueError(f"hypotheses must have different names, got {', '.join(names)}")
    total = math.fsum(each.weight for each in found)
    return tuple(
        each.named(name, each.weight / total) for each, name in zip(found, names, strict=True)
    )


def _middle(hypotheses: Sequence[Hypothesis]) -> Pair:
    """The mean of the middles of hypotheses, weighted."""
    middles = [each.place.middle for each in hypotheses]
    if len(middles) == 1:
        return middles[0]
    weights = [each.weight for each in hypotheses]
    plane = TangentPlane(*middles[0])
    metres = np.average([plane.metres(*middle) for middle in middles], axis=0, weights=weights)
    latitude, longitude = plane.degrees(metres).tolist()
    return latitude, longitude


def _case_of_tracks(given: dict[str, Any]) -> dict[str, Any]:
    """What tracks say about position and time, where nothing else does."""
    if given["object_class"] is not None:
        raise ValueError("object_class cannot be given together with tracks")
    path = Path(given["tracks"])
    if not path.is_file():
        raise ValueError(f"tracks must name a file, but there is no {str(path)!r}")
    known, began = first_known(path)
    where = known if given["position"] is None else given["position"]
    position = read_position("position", where)
    first, last = read_times(began if given["time"] is None else given["time"])
    if first != last:
        raise ValueError(f"time must be one time, together with tracks, got {given['time']!r}")
    return {
        "tracks": os.fspath(given["tracks"]),
        "position": position,
        "time": first,
        "cases": (),
        "origin": Origin(position, first),
        "wind": (0.0, 0.0) if given["wind"] is None else given["wind"],
    }


def _check_tracks_alone(values: dict[str, Any], given: dict[str, Any]) -> None:
    """Refuse values that tracks have already: given, they would have no effect."""
    is_still = values["current"].vectors_from(0.0) == {0.0: (0.0, 0.0)}
    for name in IN_TRACKS:
        is_usual = given[name] in (None, (), ERRORS.get(name))
        if not (is_still if name == "current" else is_usual):
            raise ValueError(
                f"{name} cannot be given together with tracks, which have it already, got "
                f"{given[name]!r:.100}"
            )


def _base_and_start(values: dict[str, Any]) -> dict[str, Any]:
    """Where drones take off, and when."""
    known = values["origin"].position
    time = values["origin"].time
    latest = _latest(values["cases"], time)
    base = known
    if values["base"] is not None:
        base = read_position("base", values["base"])
    _check_near("base", known, base)
    start = latest + timedelta(hours=1)
    if values["start"] is not None:
        start = near("start", values["start"], latest)
    if start < latest:
        raise ValueError(f"start must not be before time, {latest}, got {start}")
    _check_start("start", time, start)
    return {"base": base, "start": start}


def _check_near(name: str, known: Pair, base: Pair) -> None:
    """Raise a ValueError for a base that is too far from the middle of all that is known."""
    if not TangentPlane(*known).distance(*base) <= FARTHEST:
        raise ValueError(
            f"{name} must be within {FARTHEST / 1000:g} km of position, got {base}, far from "
            f"{known}; is the latitude first in both?"
        )


def _check_start(name: str, time: datetime, start: datetime) -> None:
    """Raise a ValueError for a take-off that is too late."""
    if start > time + LONGEST_DRIFT:
        hours = LONGEST_DRIFT.total_seconds() / 3600
        raise ValueError(
            f"{name} must be at most {hours:g} hours after time, {time}, got {start}; later, take "
            "a newer position"
        )


def _flown(values: dict[str, Any]) -> tuple[FlownFlight, ...]:
    """The earlier flights; waypoints alone were flown by drones such as these."""
    craft = {each.name: each for each in values["craft"]}
    flights = []
    for number, given in enumerate(checks.items("flown", values["flown"], "a list of flights")):
        name = f"flown[{number}]"
        flight = read_flown(name, given, values["swath"], values["probability_of_detection"])
        take_off = craft[flight.name].take_off if flight.name in craft else values["start"]
        is_same = flight.name in craft or not flight.name
        if is_same and flight.landing > take_off:
            raise ValueError(
                f"start must not be before the landing of {name}, "
                f"{flight.landing:%Y-%m-%d %H:%M}, got {take_off:%Y-%m-%d %H:%M}"
            )
        flights.append(flight)
    return tuple(flights)


def _with_mappings(values: dict[str, Any]) -> dict[str, Any]:
    """Values, in which those by object class are mappings, as files hold them."""
    given = {name: as_mapping(values[name]) for name in BY_CLASS if name in values}
    return values | given


def _plain(value: object) -> object:
    """What JSON holds in place of a time or a flown flight."""
    if isinstance(value, FlownFlight):
        return _with_mappings(vars(value))
    assert isinstance(value, datetime)
    return value.isoformat()
