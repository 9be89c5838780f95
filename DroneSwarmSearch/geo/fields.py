"""Fields of current and wind, from the NetCDF files of ocean and weather models."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Pair, Singles
from DroneSwarmSearch._internal.text import printable
from DroneSwarmSearch.geo.flows import Clock, Flow, Origin
from DroneSwarmSearch.geo.netcdf import check_size, opened, since_1970

NAMES = {
    "current": (
        ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
        ("x_sea_water_velocity", "y_sea_water_velocity"),
        ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
        ("surface_sea_water_x_velocity", "surface_sea_water_y_velocity"),
    ),
    "wind": (("eastward_wind", "northward_wind"), ("x_wind", "y_wind")),
}
"""CF standard names of components to the east and to the north."""

AXES = {
    "time": ("time", "t"),
    "latitude": ("latitude", "lat", "degrees_north", "degree_north", "y"),
    "longitude": ("longitude", "lon", "degrees_east", "degree_east", "x"),
}
"""Standard names, names, units or axes by which coordinates are recognised, in lower case."""

LEVEL = {"current": 0.0, "wind": 10.0}
"""The depth or height in metres that is read, or the nearest one."""

METRES_PER_SECOND = "m s-1", "m/s", "m s^-1", "m.s-1", "ms-1", "m s**-1", "meter second-1", "1"

WITHIN = 3.0  # degrees of latitude around the position that are read
MOST_OUTSIDE = 0.01  # the largest share of points off the field; they get the values at its edge


class Axis(NamedTuple):
    """An axis of a file: which dimension it is, its values, and those that are read.

    Attributes:
        dimension: the number of the dimension.
        values: those that are read, increasing: float64, (n,).
        order: the indices of these values along the dimension.
    """

    dimension: int
    values: Floats
    order: Ints


class Located(NamedTuple):
    """Where points lie on an axis: the index before each, and the share of the way to the next."""

    before: Ints
    share: Floats


@dataclass(frozen=True, eq=False)
class Field(Flow):
    """A velocity at times and points, linear in between.

    Attributes:
        path: the file.
        model: its title, or else its name.
        times: in seconds since 1970, increasing: float64, (T,).
        latitudes: in degrees, increasing: float64, (Y,).
        longitudes: in degrees, increasing, on both sides of the position: float64, (X,).
        values: to the east and to the north in m/s, and 1; all 0 where nothing is known, on land:
            float32, (T, Y * X, 3).
    """

    path: Path
    model: str
    times: Floats
    latitudes: Floats
    longitudes: Floats
    values: Singles

    @classmethod
    def read(cls, path: Path, kind: str, origin: Origin) -> Field:
        """Read the part of a file around the origin; `kind` is "current" or "wind".

        Raises:
            ImportError: netCDF4 is missing.
            ValueError: the file has no such field, not on regular axes, or none at the origin.
        """
        with opened(path) as data:
            components = []
            for variable in _components(path, data, kind):
                unit = getattr(variable, "units", "m/s")
                if unit.lower() not in METRES_PER_SECOND:
                    raise ValueError(f"{kind} must be in m/s, got {variable.name} in {unit}")
                axes, values = _around(path, data, variable, kind, origin.position)
                components.append(values)
            title = getattr(data, "title", "") or getattr(data, "source", "") or path.name
        is_known = np.all(np.isfinite(components), axis=0)
        east, north = np.where(is_known, components, 0.0)
        stacked = np.stack([east, north, is_known], axis=-1).astype(np.float32)
        time, latitude, longitude = axes
        field = cls(
            kind,
            origin,
            path=path,
            model=printable(title),
            times=time.values,
            latitudes=latitude.values,
            longitudes=longitude.values,
            values=stacked.reshape(len(stacked), -1, 3),
        )
        if np.isnan(field.velocity(0.0, np.zeros((2, 1)))).any():
            raise ValueError(
                f"position must be at sea, but {path} has no {kind} at {origin.position}"
            )
        return field

    def _key(self) -> tuple[object, ...]:
        return self.kind, self.origin, self.source

    @property
    def source(self) -> str:
        return os.path.realpath(self.path)

    @property
    def varies(self) -> bool:
        return True

    @property
    def hours(self) -> str:
        """The first and the last time."""
        first, last = (datetime.fromtimestamp(time, timezone.utc) for time in self.times[[0, -1]])
        return f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"

    def moved(self, origin: Origin) -> Field:
        if origin.position == self.origin.position:
            return replace(self, origin=origin)
        return Field.read(self.path, self.kind, origin)

    def as_typed(self, folder: str) -> str:
        return os.path.relpath(self.path, folder)

    def described(self, clock: Clock) -> str:
        return f"{self.kind} of {self.model}, {self.hours}"

    def check_within(self, times: float | Floats, points: Floats) -> None:
        time, latitude, longitude = self._coordinates(times, points)
        outside = (
            _is_beyond(time, self.times)
            | _is_beyond(latitude, self.latitudes)
            | _is_beyond(longitude, self.longitudes)
        )
        if np.mean(outside) > MOST_OUTSIDE:
            south, north = self.latitudes[[0, -1]]
            west, east = self.longitudes[[0, -1]]
            raise ValueError(
                f"{self.path} must cover the drift, but covers only {self.hours}, latitudes "
                f"{south:.2f} to {north:.2f} and longitudes {west:.2f} to {east:.2f}"
            )

    def _coordinates(self, times: float | Floats, points: Floats) -> tuple[Any, Floats, Floats]:
        """Times in seconds since 1970, latitudes, and longitudes near those of the field."""
        latitude, longitude = self.origin.plane.degrees(points.T).T
        middle = self.longitudes.mean()
        nearest = (longitude - middle + 180) % 360 - 180 + middle
        return np.asarray(self.origin.time.timestamp() + times), latitude, nearest

    def _towards(self, times: float | Floats, points: Floats) -> Floats:
        """The velocity to the east and to the north; off the field, that at its edge."""
        given_times, latitudes, longitudes = self._coordinates(times, points)
        time = _located(given_times, self.times)
        row = _located(latitudes, self.latitudes)
        column = _located(longitudes, self.longitudes)

        layers: list[tuple[Any, Any, Any]]  # values, the first index, the share
        if time.before.ndim == 0:  # for many points, it pays to interpolate the whole field in time
            now = self.values[time.before] * (1 - time.share)
            now = now + self.values[time.before + 1] * time.share
            layers = [(now, 0, 1.0)]
        else:
            flat = self.values.reshape(-1, 3)
            size = self.values.shape[1]
            layers = [
                (flat, time.before * size, 1 - time.share),
                (flat, (time.before + 1) * size, time.share),
            ]
        total = np.zeros((1, 3), np.float32)
        width = len(self.longitudes)
        for values, first, share in layers:
            for down, in_row in ((0, 1 - row.share), (1, row.share)):
                for right, in_column in ((0, 1 - column.share), (1, column.share)):
                    index = first + (row.before + down) * width + column.before + right
                    weight = (share * in_row * in_column)[:, None].astype(np.float32)
                    total = total + weight * values.take(index, axis=0)
        east, north, known = np.asarray(total, np.float64).T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(known >= 0.5, [east, north] / known, np.nan)


def _is_beyond(values: Any, axis: Floats) -> Any:
    """Whether values lie beyond an axis."""
    return (values < axis[0] - 1e-6) | (values > axis[-1] + 1e-6)


def _located(values: Any, axis: Floats) -> Located:
    index = np.interp(values, axis, np.arange(len(axis)))
    before = np.minimum(index.astype(np.int64), len(axis) - 2)
    return Located(before, index - before)


def _components(path: Path, data: Any, kind: str) -> list[Any]:
    """The variables of a file to the east and to the north, by their standard names."""
    named: dict[str, list[Any]] = {}
    for variable in data.variables.values():
        name = getattr(variable, "standard_name", variable.name)
        named.setdefault(name, []).append(variable)
    pairs = [pair for pair in NAMES[kind] if all(name in named for name in pair)]
    if len(pairs) != 1 or any(len(named[name]) > 1 for name in pairs[0]):
        got = [f"{v.name} ({name})" for name, found in named.items() for v in found]
        raise ValueError(
            f"{kind} must be a file with one variable of the standard name "
            f"{' and one of '.join(NAMES[kind][0])}, got {path} with {', '.join(got)}"
        )
    return [named[name][0] for name in pairs[0]]


def _around(
    path: Path, data: Any, variable: Any, kind: str, position: Pair
) -> tuple[list[Axis], Floats]:
    """The axes of time, latitude and longitude around a position, and a variable's values there."""
    for name in variable.dimensions:
        check_size(path, name, len(data.dimensions[name]))
    numbers, index = _dimensions(data, variable, kind)
    axes = _axes(data, variable, numbers, kind, position)
    for axis in axes:
        index[axis.dimension] = slice(int(axis.order.min()), int(axis.order.max()) + 1)
    size = math.prod(part.stop - part.start for part in index)
    check_size(path, variable.name, size)
    read = np.ma.filled(variable[tuple(index)].astype(np.float64), np.nan)
    read = np.moveaxis(read, [axis.dimension for axis in axes], range(3))
    read = read.reshape([int(np.ptp(axis.order)) + 1 for axis in axes])
    return axes, read[np.ix_(*(axis.order - axis.order.min() for axis in axes))]


def _dimensions(data: Any, variable: Any, kind: str) -> tuple[dict[str, int], list[slice]]:
    """The dimension of each role in `AXES`, and an index with the level of all others."""
    numbers: dict[str, int] = {}
    index = [slice(0, 1)] * variable.ndim
    for number, name in enumerate(variable.dimensions):
        if name not in data.variables:
            continue
        axis = data.variables[name]
        role = _role(name, axis)
        if role is not None:
            numbers[role] = number
        elif len(axis) > 1:  # the level nearest to the usual one
            level = int(np.abs(np.abs(np.ma.filled(axis[:])) - LEVEL[kind]).argmin())
            index[number] = slice(level, level + 1)
    if len(numbers) < len(AXES):
        raise ValueError(
            f"{kind} must be on axes of time, latitude and longitude, got {variable.name} on "
            f"{', '.join(variable.dimensions)}"
        )
    return numbers, index


def _role(name: str, axis: Any) -> str | None:
    """What a coordinate stands for, one of `AXES`; None for anything else."""
    given = (name, getattr(axis, "standard_name", ""), getattr(axis, "units", ""))
    marks = {str(text).lower() for text in given}
    for role, known in AXES.items():
        if marks.intersection(known):
            return role
    return None


def _axes(
    data: Any, variable: Any, numbers: dict[str, int], kind: str, position: Pair
) -> list[Axis]:
    """The axes of time, latitude and longitude, as far as they are read."""
    by_role = {
        role: data.variables[variable.dimensions[number]] for role, number in numbers.items()
    }
    time = by_role["time"]
    axes = [Axis(numbers["time"], since_1970(time[:], time), np.arange(len(time)))]
    latitude, longitude = position
    wider = WITHIN / np.cos(np.radians(latitude))
    for role, middle, within in (("latitude", latitude, WITHIN), ("longitude", longitude, wider)):
        axis = by_role[role]
        degrees = np.ma.filled(axis[:].astype(np.float64))
        if role == "longitude":  # those next to that of the position
            degrees = (degrees - middle + 180.0) % 360.0 - 180.0 + middle
        ordered, near = np.unique(degrees, return_index=True)
        near = near[np.abs(ordered - middle) <= within]
        if len(near) < 2 or not degrees[near[0]] <= middle <= degrees[near[-1]]:
            raise ValueError(
                f"{kind} must cover the position, {position}, but {axis.name} of the file goes "
                f"from {degrees.min():.2f} to {degrees.max():.2f}"
            )
        axes.append(Axis(numbers[role], degrees[near], near))
    return axes
