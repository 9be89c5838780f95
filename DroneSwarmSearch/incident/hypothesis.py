"""Hypotheses: what may have happened, as plain data. Every person that is simulated has one."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch._internal.text import enumerated, printable
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.polygons import read_polygons, shapely_package
from DroneSwarmSearch.geo.times import in_utc, near
from DroneSwarmSearch.geo.units import ANGLE, LENGTH, Quantity
from DroneSwarmSearch.incident.places import Area, Line, Place, Point, Sighting
from DroneSwarmSearch.persons import leeway

ERROR = Quantity(LENGTH, 0, 100_000, "from 0 to 100 km", error="across")
DISTANCE = Quantity(LENGTH, 0, 100_000, "above 0 and at most 100 km", is_above_zero=True)
DISTANCE_ERROR = Quantity(LENGTH, 0, 100_000, "from 0 to 100 km", error="along")
BEARING_ERROR = Quantity(ANGLE, 0, 90, "from 0 to 90 degrees", error="along")

USUAL_ERROR = 926.0  # metres, half a nautical mile
USUAL_BEARING_ERROR = 2.0  # degrees
USUAL_DISTANCE_ERROR = 0.1  # of the distance

MEAN = " (mean values)"
"""How descriptions of some object classes end."""

PLACES = ("position", "line", "area")
SEEN = ("bearing", "distance", "bearing_error", "distance_error")

Outline = str | tuple[Pair, ...]
"""A GeoJSON file, or the corners of a polygon."""

Weights = tuple[tuple[str, float], ...]
"""Names with weights, which sum to 1."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """What may have happened: where and when something was, and what it was.

    Whatever was typed, the attributes are positions in degrees, lengths in metres, and datetimes in
    UTC; see `Incident` for the texts.

    Attributes:
        position: where it was, (latitude, longitude); or where an observer was, with `bearing` and
            `distance`.
        line: in place of a position, two or more positions of a passage, in their order, or the
            text "A; B". The accident may have been anywhere on it.
        area: in place of a position, three or more corners of a polygon, or a GeoJSON file with
            polygons. The accident may have been anywhere in it.
        time: when it was; or two times, between which it was. On a line, when the passage began,
            and when it would have ended.
        position_error: the standard deviation of the position along each axis, or of the distance
            from the line or the outline. By default 926 m, half a nautical mile; of an area, 0. A
            text may state the error in which half of all positions lie, "3 NM probable", or 95%
            of them, "3 NM 95%".
        bearing: in which the observer saw it, in degrees or as "NNE".
        distance: at which the observer saw it.
        bearing_error: the standard deviation of the bearing in degrees, by default 2.
        distance_error: the standard deviation of the distance, by default a tenth of it.
        object_class: a key of `leeway.CLASSES`; or several with their weights, such as
            {"PIW-1": 0.3, "LIFE-RAFT-SB-6": 0.7}.
        weight: how likely it is, compared with the other hypotheses.
        name: by which a plan calls it; by default its number.

    Raises:
        ImportError: an area needs shapely.
        TypeError: a value is of the wrong type.
        ValueError: a value is out of its limits, or there is not exactly one place.
    """

    position: Pair | None = None
    line: tuple[Pair, ...] | None = None
    area: Outline | None = None
    time: tuple[datetime, datetime] = None  # type: ignore[assignment]  # must be given
    position_error: float = None  # type: ignore[assignment]  # known below
    bearing: float | None = None
    distance: float | None = None
    bearing_error: float | None = None
    distance_error: float | None = None
    object_class: Weights = ()
    weight: float = 1.0
    name: str = ""
    typed: Mapping[str, Any] = field(init=False, repr=False, compare=False)

    if TYPE_CHECKING:

        def __init__(self, **values: Any) -> None: ...  # in all the forms above

    def __post_init__(self) -> None:
        given = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        for name, value in _checked(given).items():
            object.__setattr__(self, name, value)
        typed = {name: value for name, value in given.items() if value not in (None, (), "")}
        object.__setattr__(self, "typed", typed)

    def named(self, name: str, weight: float) -> Hypothesis:
        """The same with a name and a weight."""
        return Hypothesis(**{**self.typed, "name": name, "weight": weight})

    @cached_property
    def place(self) -> Place:
        """Where the accident may have been."""
        error = self.position_error
        if self.line is not None:
            return Line(self.line, error)
        if self.area is not None:
            return Area(polygons_in("area", self.area), error)
        assert self.position is not None
        if self.bearing is None:
            return Point(self.position, error)
        assert self.distance is not None
        assert self.bearing_error is not None
        assert self.distance_error is not None
        return Sighting(
            observer=self.position,
            error=error,
            bearing=self.bearing,
            bearing_error=self.bearing_error,
            distance=self.distance,
            distance_error=self.distance_error,
        )

    @property
    def target(self) -> str:
        """What it was, in words."""
        kinds = []
        for name, weight in self.object_class:
            kind = leeway.class_of(name)
            words = f"{kind.description.removesuffix(MEAN)} ({kind.name})"
            kinds.append(words if len(self.object_class) == 1 else f"{words} {weight:.0%}")
        return " or ".join(kinds)

    @property
    def when(self) -> str:
        """When it was, in words."""
        first, last = self.time
        if first == last:
            return f"{first:%Y-%m-%d %H:%M} UTC"
        date = "" if last.date() == first.date() else f"{last:%Y-%m-%d} "
        return f"{first:%Y-%m-%d %H:%M} to {date}{last:%H:%M} UTC"

    @property
    def sentence(self) -> str:
        """What happened, in words."""
        return f"{self.target} {self.place.words}, {self.when}"

    def plain(self, folder: Path) -> dict[str, Any]:
        """The values that were given, for a file in a folder from which its paths count."""
        values = dict(self.typed)
        if isinstance(self.area, str):
            values["area"] = os.path.relpath(self.area, folder)
        return values


FIELDS = tuple(each.name for each in fields(Hypothesis) if each.init)
"""The names of its values."""


def _checked(given: dict[str, Any]) -> dict[str, Any]:
    """The values in their plain forms."""
    places = [name for name in PLACES if given[name] is not None]
    if len(places) != 1:
        got = enumerated(places) if places else "none of them"
        raise ValueError(f"position, line or area must be given, one of them, got {got}")
    (place,) = places
    values: dict[str, Any] = {
        place: READ[place](given[place]),
        "time": read_times(given["time"]),
        "object_class": _classes(given["object_class"]),
        "weight": checks.positive("weight", given["weight"]),
        "name": printable(given["name"]),
    }
    error = given["position_error"]
    if error is None:
        error = 0.0 if place == "area" else USUAL_ERROR
    values["position_error"] = ERROR.read("position_error", error)
    return values | _sighting(given)


def _sighting(given: dict[str, Any]) -> dict[str, Any]:
    """A bearing and a distance, and their errors."""
    named = [name for name in SEEN if given[name] is not None]
    if not named:
        return {}
    if given["position"] is None:
        raise ValueError(f"{named[0]} needs position, that of the observer, but it is not given")
    for name in ("bearing", "distance"):
        if given[name] is None:
            raise ValueError(f"{name} must be given together with {named[0]}")
    bearing = given["bearing"]
    if isinstance(bearing, str):
        bearing = units.named("bearing", units.direction, bearing)
    distance = DISTANCE.read("distance", given["distance"])
    usual = {
        "bearing_error": USUAL_BEARING_ERROR,
        "distance_error": USUAL_DISTANCE_ERROR * distance,
    }
    known = {name: usual[name] if given[name] is None else given[name] for name in usual}
    return {
        "bearing": checks.real("bearing", bearing, 0, 360),
        "distance": distance,
        "bearing_error": BEARING_ERROR.read("bearing_error", known["bearing_error"]),
        "distance_error": DISTANCE_ERROR.read("distance_error", known["distance_error"]),
    }


def read_position(name: str, value: object) -> Pair:
    """(latitude, longitude) from a pair of numbers or texts, or from a text."""
    if isinstance(value, str):
        value = units.named(name, units.position, value)
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        value = tuple(
            units.named(name, units.degrees, number, letters) if isinstance(number, str) else number
            for number, letters in zip(value, ("NS", "EW"), strict=True)
        )
    latitude, longitude = checks.pair(name, value, "(latitude, longitude) in degrees")
    if not (abs(latitude) <= 89.0 and abs(longitude) <= 180.0):
        raise ValueError(
            f"{name} must be (latitude, longitude) in degrees, the latitude first and from -89 to "
            f"89, the longitude from -180 to 180, got {value!r}"
        )
    return latitude, longitude


def _positions(name: str, value: object, fewest: int, what: str) -> tuple[Pair, ...]:
    """Positions from a list, or from a text with semicolons between them."""
    if isinstance(value, str):
        value = [part for part in value.split(";") if part.strip()]
    given = checks.items(name, value, what)
    found = tuple(read_position(f"{name}[{row}]", each) for row, each in enumerate(given))
    if len(found) < fewest:
        raise ValueError(f"{name} must be {what}, got {len(found)}")
    return found


def _line(value: object) -> tuple[Pair, ...]:
    what = 'two or more positions, such as "54-10N 007-40E; 54-05N 008-00E"'
    positions = _positions("line", value, 2, what)
    if len(set(positions)) == 1:
        raise ValueError(f"line must be {what}, got the same position {len(positions)} times")
    return positions


def _area(value: object) -> Outline:
    return read_outline("area", value)


def read_outline(name: str, value: object) -> Outline:
    """The path of a GeoJSON file, or the corners of a polygon."""
    what = "a GeoJSON file with polygons, or three or more positions"
    is_text = isinstance(value, str) and ";" in value
    if isinstance(value, (str, os.PathLike)) and not is_text:
        outline: Outline = os.fspath(value)
        if not Path(value).is_file():
            raise ValueError(f"{name} must be {what}, but there is no file {os.fspath(value)!r}")
    else:
        outline = _positions(name, value, 3, what)
    if not polygons_in(name, outline).area > 0.0:
        raise ValueError(f"{name} must be {what}, got one without a surface: {value!r:.100}")
    return outline


def polygons_in(name: str, outline: Outline) -> Any:
    """The polygons of an outline in degrees, a geometry of shapely."""
    if isinstance(outline, str):
        return read_polygons(f"{name} must be a GeoJSON file with polygons", Path(outline))
    latitudes, longitudes = np.array(outline).T
    # From corner to corner the shorter way, also over the date line.
    unwrapped = np.unwrap(longitudes, period=360)
    shapely = shapely_package()
    return shapely.make_valid(shapely.Polygon(np.stack([unwrapped, latitudes], axis=-1)))


READ: dict[str, Callable[[object], Any]] = {
    "position": partial(read_position, "position"),
    "line": _line,
    "area": _area,
}
"""How to read each kind of place."""


def read_times(value: object) -> tuple[datetime, datetime]:
    """The first and the last time of a window, from a time or two."""
    if isinstance(value, (tuple, list)):
        if len(value) not in (1, 2):
            raise ValueError(f"time must be a time, or two, the earlier one first, got {value!r}")
        first = in_utc("time", value[0])
        last = near("time", value[-1], first)
    else:
        first = last = in_utc("time", value)
    if last < first:
        raise ValueError(
            f"time must be a time, or two, the earlier one first, got {first:%Y-%m-%d %H:%M} and "
            f"{last:%Y-%m-%d %H:%M}"
        )
    return first, last


def _classes(value: object) -> Weights:
    """Object classes with weights that sum to 1."""
    if value in (None, ()):
        raise ValueError(
            "object_class must be given, such as PIW-1, a person in the water, or tracks in its "
            "place"
        )
    if isinstance(value, str):
        value = {value: 1.0}
    pairs = list(value.items()) if isinstance(value, Mapping) else value
    what = 'a key of leeway.CLASSES, or several with weights, such as {"PIW-1": 0.3, ...}'
    weights: dict[str, float] = {}
    for pair in checks.items("object_class", pairs, what):
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise TypeError(f"object_class must be {what}, got {value!r:.100}")
        name, weight = pair
        if not isinstance(name, str):
            raise TypeError(f"object_class must be {what}, got {name!r:.100}")
        kind = leeway.class_of(name)
        if kind.name in weights:
            raise ValueError(f"object_class must name each class once, got {kind.name} twice")
        weights[kind.name] = checks.positive(f"object_class, the weight of {kind.name}", weight)
    total = math.fsum(weights.values())
    return tuple((name, weight / total) for name, weight in weights.items())
