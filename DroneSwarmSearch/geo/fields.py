"""Fields of current and wind, from the NetCDF files of ocean and weather models."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Pair, Singles
from DroneSwarmSearch._internal.text import printable
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


@dataclass(frozen=True, eq=False)
class Field:
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
    def read(cls, path: Path, kind: str, position: Pair) -> Field:
        """Read the part of a file around a position; `kind` is "current" or "wind".

        Raises:
            ImportError: netCDF4 is missing.
            ValueError: the file has no such field, or not on regular axes.
        """
        with opened(path) as data:
            named: dict[str, list[Any]] = {}
            for variable in data.variables.values():
                name = getattr(variable, "standard_name", variable.name)
                named.setdefault(name, []).append(variable)
            pairs = [pair for pair in NAMES[kind] if named.keys() >= {*pair}]
            if len(pairs) != 1 or any(len(named[name]) > 1 for name in pairs[0]):
                got = [f"{v.name} ({name})" for name, found in named.items() for v in found]
                raise ValueError(
                    f"{kind} must be a file with one variable of the standard name "
                    f"{' and one of '.join(NAMES[kind][0])}, got {path} with {', '.join(got)}"
                )
            components = []
            for name in pairs[0]:
                (variable,) = named[name]
                if (unit := getattr(variable, "units", "m/s")).lower() not in METRES_PER_SECOND:
                    raise ValueError(f"{kind} must be in m/s, got {variable.name} in {unit}")
                axes, values = _around(path, data, variable, kind, position)
                components.append(values)
            model = printable(
                getattr(data, "title", "") or getattr(data, "source", "") or path.name
            )
        is_known = np.all(np.isfinite(components), axis=0)
        stacked = [*np.where(is_known, components, 0.0), is_known]
        flat = np.stack(stacked, axis=-1).astype(np.float32).reshape(len(components[0]), -1, 3)
        times, latitudes, longitudes = axes
        return cls(path, model, times, latitudes, longitudes, flat)

    def at(self, time: Any, latitude: Floats, longitude: Floats, *, checked: bool = True) -> Floats:
        """The velocity (east, north), (2, n), at times in seconds since 1970; NaN on land.

        Args:
            time: one for all points, or one for each.
            latitude: in degrees, (n,).
            longitude: in degrees, (n,).
            checked: whether to refuse points and times off the field; if not, its edge counts.

        Raises:
            ValueError: more than 1% of the points or times are off the field.
        """
        off = (longitude - self.longitudes.mean() + 180) % 360 - 180 + self.longitudes.mean()
        given = (np.asarray(time), self.times), (latitude, self.latitudes), (off, self.longitudes)
        if checked and _share_outside(given) > MOST_OUTSIDE:
            south, north, west, east = *self.latitudes[[0, -1]], *self.longitudes[[0, -1]]
            raise ValueError(
                f"{self.path} must cover the drift, but covers only {self.hours}, latitudes "
                f"{south:.2f} to {north:.2f} and longitudes {west:.2f} to {east:.2f}"
            )
        (k, f), (j, g), (i, h) = (_between(*pair) for pair in given)
        width, corners = len(self.longitudes), np.zeros((1, 3), np.float32)
        layers: list[tuple[Any, Any]]
        if k.ndim == 0:  # for many points, it pays to interpolate the whole field in time
            layers = [(self.values[k] * (1 - f) + self.values[k + 1] * f, 1.0)]
        else:
            flat = self.values.reshape(-1, 3)
            layers = [(flat, 1 - f), (flat, f)]
        for later, (values, share) in enumerate(layers):
            first = (k + later) * self.values.shape[1] if k.ndim else 0
            for down, part in ((0, 1 - g), (1, g)):
                for right, more in ((0, 1 - h), (1, h)):
                    place = first + (j + down) * width + i + right
                    weight = (share * part * more)[:, None].astype(np.float32)
                    corners = corners + weight * values.take(place, axis=0)
        east, north, known = np.asarray(corners, np.float64).T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(known >= 0.5, [east, north] / known, np.nan)

    @property
    def hours(self) -> str:
        """The first and the last time."""
        first, last = (datetime.fromtimestamp(time, timezone.utc) for time in self.times[[0, -1]])
        return f"{first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC"


def _share_outside(given: Sequence[tuple[Any, Floats]]) -> float:
    """The share of points that lie beyond an axis."""
    outside = sum((at < axis[0] - 1e-6) | (at > axis[-1] + 1e-6) for at, axis in given) > 0
    return float(np.mean(outside))


def _between(at: Any, axis: Floats) -> tuple[Ints, Floats]:
    """The index before each value on an axis, and the fraction of the way to the next one."""
    index = np.interp(at, axis, np.arange(len(axis)))
    before = np.minimum(index.astype(np.int64), len(axis) - 2)
    return before, index - before


def _around(
    path: Path, data: Any, variable: Any, kind: str, position: Pair
) -> tuple[list[Floats], Floats]:
    """The times, latitudes and longitudes around a position, and a variable's values there."""
    for axis in variable.dimensions:
        check_size(path, axis, len(data.dimensions[axis]))
    number, index = {}, [slice(0, 1)] * variable.ndim
    for place, name in enumerate(variable.dimensions):
        if name not in data.variables:
            continue
        axis = data.variables[name]
        given = (name, *(getattr(axis, attribute, "") for attribute in ("standard_name", "units")))
        marks = {str(text).lower() for text in given}
        role = next((role for role, known in AXES.items() if marks & {*known}), None)
        if role is not None:
            number[role] = place
        elif len(axis) > 1:  # the level nearest to the usual one
            level = int(np.abs(np.abs(np.ma.filled(axis[:])) - LEVEL[kind]).argmin())
            index[place] = slice(level, level + 1)
    if len(number) < 3:
        raise ValueError(
            f"{kind} must be on axes of time, latitude and longitude, got {variable.name} on "
            f"{', '.join(variable.dimensions)}"
        )
    time, *degrees = (data.variables[variable.dimensions[number[role]]] for role in AXES)
    values, order = [since_1970(time[:], time)], [np.arange(len(time))]
    for axis, middle, turn in zip(degrees, position, (0.0, 360.0), strict=True):
        at, within = np.ma.filled(axis[:].astype(np.float64)), WITHIN
        if turn:  # the longitudes next to that of the position
            at = (at - middle + turn / 2) % turn - turn / 2 + middle
            within /= np.cos(np.radians(position[0]))
        ordered, near = np.unique(at, return_index=True)
        near = near[np.abs(ordered - middle) <= within]
        if len(near) < 2 or not at[near[0]] <= middle <= at[near[-1]]:
            raise ValueError(
                f"{kind} must cover the position, {position}, but {axis.name} of the file goes "
                f"from {at.min():.2f} to {at.max():.2f}"
            )
        values.append(at[near])
        order.append(near)
    axes = [number[role] for role in AXES]
    for axis, near in zip(axes, order, strict=True):
        index[axis] = slice(int(near.min()), int(near.max()) + 1)
    size = math.prod(part.stop - part.start for part in index)
    check_size(path, variable.name, size)
    read = np.ma.filled(variable[tuple(index)].astype(np.float64), np.nan)
    read = np.moveaxis(read, axes, range(3)).reshape([int(np.ptp(near)) + 1 for near in order])
    return values, read[np.ix_(*(near - near.min() for near in order))]
