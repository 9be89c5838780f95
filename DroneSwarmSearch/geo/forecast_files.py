"""Files of ocean and weather models, as their providers ship them, read with xarray and cf-xarray.

Every dimension of a variable is a time, a member of an ensemble, a level, or one of the two
horizontal ones; a file with any other is refused. NetCDF needs the extra "tracks", GRIB "grib".
"""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, cast

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Pair, Singles
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch._internal.text import printable
from DroneSwarmSearch.geo.netcdf import REASON, check_size, opened, seconds_of

NETCDF = (".nc", ".nc4", ".cdf", ".netcdf")
GRIB = (".grib", ".grb", ".grib2", ".grb2")

Names = tuple[str, str]

STANDARD: dict[str, tuple[Names, ...]] = {
    "current": (
        ("eastward_sea_water_velocity", "northward_sea_water_velocity"),
        ("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
        ("sea_water_x_velocity", "sea_water_y_velocity"),
        ("x_sea_water_velocity", "y_sea_water_velocity"),
        ("surface_sea_water_x_velocity", "surface_sea_water_y_velocity"),
    ),
    "wind": (("eastward_wind", "northward_wind"), ("x_wind", "y_wind")),
}
"""CF standard names of components, those to the east and to the north first."""

USUAL: dict[str, tuple[Names, ...]] = {
    "current": (
        ("uo", "vo"),
        ("u_eastward", "v_northward"),
        ("water_u", "water_v"),
        ("u", "v"),
    ),
    "wind": (
        ("u10", "v10"),
        ("10u", "10v"),
        ("UGRD_10maboveground", "VGRD_10maboveground"),
        ("u-component_of_wind_height_above_ground", "v-component_of_wind_height_above_ground"),
        ("x_wind_10m", "y_wind_10m"),
        ("eastward_wind", "northward_wind"),
    ),
}
"""Names of variables without a standard name, or of one that several have."""

ALONG_GRID = (
    "x_wind",
    "sea_water_x_velocity",
    "x_sea_water_velocity",
    "surface_sea_water_x_velocity",
)
"""Standard names of components along the grid, which are turned to the east."""

DEGREES = (("latitude", "lat"), ("longitude", "lon"))
"""Roles and short names of coordinates."""

MEMBERS = ("number", "realization", "ensemble_member", "member", "ensemble", "ens")
SECONDS_IN = {
    "nanoseconds": 1e-9,
    "microseconds": 1e-6,
    "milliseconds": 1e-3,
    "s": 1.0,
    "seconds": 1.0,
    "minutes": 60.0,
    "h": 3600.0,
    "hr": 3600.0,
    "hour": 3600.0,
    "hours": 3600.0,
    "days": 86400.0,
}
"""Units of the steps of a forecast."""

STEPS = ("step", "forecast_period", "leadtime", "lead_time")
REFERENCES = ("time", "forecast_reference_time")
LEVEL = {"current": "depth", "wind": "height"}
WIND_HEIGHT = 10.0
DEEPEST = 30.0  # of the level nearest to the surface
METRES_PER_SECOND = "m s-1", "m/s", "m s^-1", "m.s-1", "ms-1", "m s**-1", "meter second-1", "1"

FASTEST = {"wind": 75.0, "current": 5.0}
"""In m/s; beyond, missing values are not declared, or the unit is another."""

WITHIN = 3.0  # degrees of latitude around the position that are read
BEFORE = 12 * 3600.0  # seconds before the position's time that are read
AFTER = 100 * 3600.0  # and after it: the longest drift and flight
LONGER = 1.5  # a gap in time is so many times as long as the usual interval


@dataclass(frozen=True, eq=False)
class Forecast:
    """A field of velocities around a position.

    Attributes:
        title: of the file, or its name.
        times: in seconds since 1970, increasing: float64, (T,).
        latitudes: of the grid, in degrees: (Y,) and increasing, or (Y, X).
        longitudes: (X,) and increasing, or (Y, X).
        along_grid: whether components are along the rows and columns of the grid, otherwise to the
            east and to the north.
        values: the two components in m/s: float32, (2, members, T, Y, X); NaN on land.
        first, last: the first and the last time of the file, in seconds since 1970.
    """

    title: str
    times: Floats
    latitudes: Floats
    longitudes: Floats
    along_grid: bool
    values: Singles
    first: float
    last: float


def read_forecast(path: Path, kind: str, position: Pair, time: datetime) -> Forecast:
    """Read the "wind" or "current" around a position and from a time on.

    Raises:
        ImportError: a package is missing, see above.
        ValueError: the file has no such field, or one that is not understood.
    """
    datasets = _opened(path)
    try:
        return _Reader(path, kind, datasets).around(position, time)
    finally:
        for each in datasets:
            each.close()


def _opened(path: Path) -> list[Any]:
    """The datasets of a file: one of NetCDF, or one for each kind of level of GRIB."""
    needed("cf_xarray", f"{REASON} cf-xarray", "tracks")
    if path.suffix.lower() not in GRIB:
        return [opened(path, decode_times=True, decode_timedelta=False)]
    cfgrib = needed("cfgrib", "GRIB files need the package cfgrib", "grib")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of changes in xarray that cfgrib has not followed
            return list(cfgrib.open_datasets(str(path), backend_kwargs={"indexpath": ""}))
    except Exception as error:  # errors of many kinds
        raise ValueError(f"{path} must be a GRIB file, got another: {error!r:.200}") from None


@dataclass(frozen=True, eq=False)
class _Part:
    """One component of a `Forecast`; values are (members, T, Y, X)."""

    times: Floats
    latitudes: Floats
    longitudes: Floats
    values: Singles
    first: float
    last: float


class _Reader:
    """Reads one field; what is refused names file, variable, dimension and remedy."""

    def __init__(self, path: Path, kind: str, datasets: Sequence[Any]) -> None:
        self._path = path
        self._kind = kind
        self._datasets = datasets
        self._name = ""  # of the variable that is read

    def around(self, position: Pair, time: datetime) -> Forecast:
        components = self._components()
        self._check_units(*components)
        parts = [self._part(variable, position, time) for variable in components]
        first, second = parts
        if first.times.shape != second.times.shape or (first.times != second.times).any():
            raise self._refused("given at the same times in both components", "save them again")
        values = np.stack([part.values for part in parts])
        self._name = " and ".join(str(variable.name) for variable in components)
        self._check_values(values, first.times)
        attributes = self._dataset.attrs
        centre = components[0].attrs.get("GRIB_centreDescription")
        title = attributes.get("title") or attributes.get("source") or centre or self._path.name
        return Forecast(
            title=printable(str(title)),
            times=first.times,
            latitudes=first.latitudes,
            longitudes=first.longitudes,
            along_grid=self._is_along_grid(components[0]),
            values=values,
            first=first.first,
            last=first.last,
        )

    def _part(self, variable: Any, position: Pair, time: datetime) -> _Part:
        """The values of a component around a position and from a time on."""
        self._name = str(variable.name)
        array = self._without_expver(variable)
        array = self._at_level(array)
        array = self._at_valid_times(array)
        latitude, longitude = self._horizontal(array)
        member = self._member_dimension(array)
        self._check_other_dimensions(array, latitude, longitude, member)
        array = self._cropped(array, latitude, longitude, position)
        times = seconds_of(array["time"])
        array = self._between(array, times, time)
        self._check_gaps(seconds_of(array["time"]))
        rows, columns = _grid_dimensions(latitude, longitude)
        check_size(self._path, self._name, array.size)
        in_order = [name for name in (member, "time", rows, columns) if name is not None]
        values = np.asarray(array.transpose(*in_order).values, np.float32)
        return _Part(
            times=seconds_of(array["time"]),
            latitudes=np.asarray(array[latitude.name].values, np.float64),
            longitudes=np.asarray(array[longitude.name].values, np.float64),
            values=values if member is not None else values[None],
            first=float(times[0]),
            last=float(times[-1]),
        )

    def _refused(self, what: str, remedy: str) -> ValueError:
        return ValueError(f"{self._kind} must be {what} in {self._path}: {remedy}")

    # The variables.

    def _components(self) -> tuple[Any, Any]:
        """The two components, of the standard or usual names."""
        for dataset in self._datasets:
            for names in STANDARD[self._kind]:
                pair = self._by_standard_name(dataset, names)
                if pair is not None:
                    self._dataset = dataset
                    return pair
        for dataset in self._datasets:
            for x, y in USUAL[self._kind]:
                if x in dataset and y in dataset:
                    self._dataset = dataset
                    self._check_one_grid(dataset[x], dataset[y])
                    return dataset[x], dataset[y]
        found = [
            f"{name} ({variable.attrs.get('standard_name', 'no standard name')})"
            for dataset in self._datasets
            for name, variable in dataset.data_vars.items()
        ]
        wanted = " and ".join(STANDARD[self._kind][0])
        usual = ", ".join(" and ".join(pair) for pair in USUAL[self._kind])
        raise ValueError(
            f"{self._kind} must be a file with one variable of the standard name {wanted}, or "
            f"variables called {usual}, got {self._path} with {', '.join(found) or 'none'}: rename "
            "them, or give them standard names"
        )

    def _by_standard_name(self, dataset: Any, names: Names) -> tuple[Any, Any] | None:
        """The variables of two standard names; of several, those with usual names."""
        found: list[list[Any]] = []
        for name in names:
            found.append(
                [
                    variable
                    for variable in dataset.data_vars.values()
                    if variable.attrs.get("standard_name") == name
                ]
            )
        if not all(found):
            return None
        usual = {name for pair in USUAL[self._kind] for name in pair}
        chosen = [
            some if len(some) == 1 else [each for each in some if each.name in usual]
            for some in found
        ]
        if any(len(some) != 1 for some in chosen):
            several = ", ".join(str(each.name) for some in found for each in some)
            raise self._refused(
                f"one variable of the standard name {' and one of '.join(names)}, got {several}",
                "save only the two that count",
            )
        self._check_one_grid(chosen[0][0], chosen[1][0])
        return chosen[0][0], chosen[1][0]

    def _check_one_grid(self, first: Any, second: Any) -> None:
        if first.dims != second.dims:
            raise self._refused(
                f"on one grid, got {first.name} on {', '.join(map(str, first.dims))} and "
                f"{second.name} on {', '.join(map(str, second.dims))}",
                "components on a staggered grid must be interpolated to its centres, and be turned "
                "to the east and to the north, such as u_eastward and v_northward",
            )

    def _check_units(self, *components: Any) -> None:
        for variable in components:
            unit = str(variable.attrs.get("units", "m/s"))
            if unit.lower() not in METRES_PER_SECOND:
                raise self._refused(f"in m/s, got {variable.name} in {unit}", "convert it")

    def _is_along_grid(self, variable: Any) -> bool:
        if "GRIB_uvRelativeToGrid" in variable.attrs:
            return bool(int(variable.attrs["GRIB_uvRelativeToGrid"]))
        name = variable.attrs.get("standard_name", "")
        return name in ALONG_GRID or (name in ("", "unknown") and variable.name == "x_wind_10m")

    # Their dimensions.

    def _without_expver(self, array: Any) -> Any:
        """Join final and preliminary values of ERA5, which a file may hold side by side."""
        if "expver" not in array.dims:
            return array
        check_size(self._path, self._name, array.size)
        joined = array.isel(expver=0, drop=True)
        for index in range(1, array.sizes["expver"]):
            joined = joined.fillna(array.isel(expver=index, drop=True))
        return joined

    def _at_level(self, array: Any) -> Any:
        """The values at the sea's surface, or at 10 m."""
        for name in list(array.dims):
            if not _is_vertical(array, name):
                continue
            array = array.isel({name: self._level(array[name])}, drop=True)
        for name in ("heightAboveGround", "height"):
            if name in array.coords and array[name].size == 1 and self._kind == "wind":
                self._check_height(str(name), [float(array[name])])
        return array

    def _level(self, axis: Any) -> int:
        """The index of the level that counts."""
        units = str(axis.attrs.get("units", ""))
        values = np.asarray(axis.values, np.float64)
        is_metres = units.lower() in ("m", "metre", "meter", "metres", "meters")
        if not is_metres:
            raise self._refused(
                f"at a {LEVEL[self._kind]} in metres, got {self._name} on {axis.name}, "
                f"{axis.size} levels in {units or 'no unit'}",
                "save the level at 10 m above the ground"
                if self._kind == "wind"
                else "save the level at the surface, without that dimension",
            )
        if self._kind == "wind":
            self._check_height(str(axis.name), values.tolist())
            return int(np.abs(values - WIND_HEIGHT).argmin())
        index = int(np.abs(values).argmin())
        if abs(values[index]) > DEEPEST:
            raise self._refused(
                f"at most {DEEPEST:g} m below the surface, got {axis.name} from "
                f"{abs(values[index]):g} m on",
                "save the level at the surface",
            )
        return index

    def _check_height(self, name: str, heights: list[float]) -> None:
        if min(abs(height - WIND_HEIGHT) for height in heights) > 0.5:
            got = ", ".join(f"{height:g}" for height in heights)
            raise self._refused(f"at 10 m, got {self._name} with {name} {got}", "save that at 10 m")

    def _at_valid_times(self, array: Any) -> Any:
        """The values by the time at which they are valid, a dimension called "time"."""
        steps = [
            name
            for name in array.dims
            if name in STEPS or _standard(array, name) == "forecast_period"
        ]
        times = [name for name in array.dims if name not in steps and _is_time(array, name)]
        if len(steps) == 1:
            array = self._of_runs(array, steps[0], times)
        elif len(times) == 1:
            array = array.rename({times[0]: "time"}) if times[0] != "time" else array
        else:
            raise self._refused(
                f"on one axis of time, got {self._name} on {self._dimensions(array)}",
                "save one with times of the usual calendar",
            )
        if not np.issubdtype(array["time"].dtype, np.datetime64):
            raise self._refused(
                f"on times of the usual calendar, got {self._name} with {array['time'].dtype}",
                "convert them",
            )
        array = array.sortby("time")
        seconds = seconds_of(array["time"])
        if (np.diff(seconds) <= 0).any():
            twice = _utc(seconds[:-1][np.diff(seconds) <= 0][0])
            raise self._refused(
                f"given once for each time, got {self._name} for {twice} from several runs",
                "runs overlap: save the newest one for each time",
            )
        if len(seconds) < 2:
            raise self._refused(f"given for at least two times, got {len(seconds)}", "save more")
        return array

    def _of_runs(self, array: Any, step: Hashable, times: list[Any]) -> Any:
        """Forecasts by run and step, by their valid time."""
        if times and array.sizes[times[0]] > 1:
            raise self._refused(
                f"one run, got {self._name} on {self._dimensions(array)}",
                f"save one run, without the dimension {times[0]}",
            )
        if times:
            array = array.isel({times[0]: 0})
        if "valid_time" in array.coords:
            valid = array["valid_time"].values
        else:
            names = [name for name in REFERENCES if name in array.coords]
            if not names or array[names[0]].size != 1:
                raise self._refused(
                    f"on times, got {self._name} on {self._dimensions(array)}",
                    "save the time at which values are valid",
                )
            valid = array[names[0]].values + self._durations(array[step])
        array = array.drop_vars([n for n in ("time", "valid_time") if n in array.coords])
        return array.assign_coords({step: valid}).rename({step: "time"})

    def _durations(self, steps: Any) -> Any:
        """The steps of a forecast as durations of NumPy, however they are stored."""
        if np.issubdtype(steps.dtype, np.timedelta64):
            return steps.values
        unit = str(steps.attrs.get("units", ""))
        if unit not in SECONDS_IN:
            raise self._refused(
                f"on steps in {', '.join(SECONDS_IN)}, got {steps.name} in {unit or 'no units'}",
                "save the time at which values are valid",
            )
        nanoseconds = steps.values.astype(np.float64) * (1e9 * SECONDS_IN[unit])
        return np.rint(nanoseconds).astype("timedelta64[ns]")

    def _member_dimension(self, array: Any) -> Hashable | None:
        """The dimension of the members of an ensemble; None if there is none."""
        for name in array.dims:
            if str(name).lower() in MEMBERS or _standard(array, name) == "realization":
                return cast("Hashable", name)
        return None

    def _horizontal(self, array: Any) -> tuple[Any, Any]:
        """The coordinates of latitude and longitude, in degrees."""
        found = [self._coordinate(array, role, short) for role, short in DEGREES]
        latitude, longitude = found
        if latitude is None or longitude is None or latitude.ndim != longitude.ndim:
            return self._from_projection(array)
        if latitude.ndim == 2:
            longitude = longitude.transpose(*latitude.dims)
        return latitude, longitude

    def _coordinate(self, array: Any, role: str, short: str) -> Any:
        """The latitude or the longitude along dimensions of an array; None if there is none."""
        names = [*array.cf.coordinates.get(role, ()), role, short]
        for name in names:
            for holder in (array.coords, self._dataset.variables):
                if name not in holder:
                    continue
                axis = holder[name]
                is_rotated = str(axis.attrs.get("standard_name", "")).startswith("grid_")
                if axis.ndim in (1, 2) and {*axis.dims} <= {*array.dims} and not is_rotated:
                    return _data_array(axis, name)
        return None

    def _from_projection(self, array: Any) -> tuple[Any, Any]:
        """Latitude and longitude from the axes of a projection, whose parameters the file holds."""
        axes = array.cf.axes
        mapping = array.encoding.get("grid_mapping") or array.attrs.get("grid_mapping")
        mapping = mapping if mapping in self._dataset.variables else None
        if mapping is None or len(axes.get("X", ())) != 1 or len(axes.get("Y", ())) != 1:
            raise self._refused(
                f"on axes of time, latitude and longitude, got {self._name} on "
                f"{self._dimensions(array)}",
                "save it with latitudes and longitudes",
            )
        pyproj = needed("pyproj", "a projection needs the package pyproj", "tracks")
        crs = pyproj.CRS.from_cf(self._dataset[mapping].attrs)
        x = array[axes["X"][0]]
        y = array[axes["Y"][0]]
        unproject = pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
        longitude, latitude = unproject.transform(*np.meshgrid(x.values, y.values))
        dims = (y.name, x.name)
        xarray = needed("xarray", f"{REASON} xarray", "tracks")
        return (
            xarray.DataArray(latitude, dims=dims, name="latitude_of_cells"),
            xarray.DataArray(longitude, dims=dims, name="longitude_of_cells"),
        )

    def _cropped(self, array: Any, latitude: Any, longitude: Any, position: Pair) -> Any:
        """The part around the position."""
        array = array.assign_coords({latitude.name: latitude, longitude.name: longitude})
        middle_latitude, middle_longitude = position
        wider = WITHIN / np.cos(np.radians(middle_latitude))
        away_north = np.asarray(latitude.values, np.float64) - middle_latitude
        degrees = np.asarray(longitude.values, np.float64)
        away_east = (degrees - middle_longitude + 180.0) % 360.0 - 180.0
        if latitude.ndim == 1:
            array = array.assign_coords(
                {longitude.name: (longitude.dims, middle_longitude + away_east)}
            )
            for name, away, within in (
                (latitude.name, away_north, WITHIN),
                (longitude.name, away_east, wider),
            ):
                ordered, near = np.unique(away, return_index=True)
                near = near[np.abs(ordered) <= within]
                if len(near) < 2 or not away[near[0]] <= 0 <= away[near[-1]]:
                    self._raise_outside(position, latitude, longitude)
                array = array.isel({array[name].dims[0]: near})
            return array
        is_near = (np.abs(away_north) <= WITHIN) & (np.abs(away_east) <= wider)
        if not is_near.any():
            self._raise_outside(position, latitude, longitude)
        for axis, name in enumerate(latitude.dims):
            (near,) = is_near.any(axis=1 - axis).nonzero()
            first = max(int(near[0]) - 1, 0)
            array = array.isel({name: slice(first, int(near[-1]) + 2)})
        return array

    def _raise_outside(self, position: Pair, latitude: Any, longitude: Any) -> None:
        ranges = [
            f"{axis.name} from {float(axis.min()):.2f} to {float(axis.max()):.2f}"
            for axis in (latitude, longitude)
        ]
        raise ValueError(
            f"{self._kind} must cover the position, {position}, but {self._path} has "
            f"{' and '.join(ranges)}"
        )

    def _check_other_dimensions(
        self, array: Any, latitude: Any, longitude: Any, member: Hashable | None
    ) -> None:
        """Refuse a dimension that is none of those that are understood."""
        known = {"time", member, *latitude.dims, *longitude.dims}
        for name in array.dims:
            if name not in known:
                raise self._refused(
                    f"on time, latitude, longitude, a level and members, got {self._name} with the "
                    f"dimension {name} of {array.sizes[name]}",
                    "save one of them, without that dimension",
                )

    def _dimensions(self, array: Any) -> str:
        names = [f"{name} ({size})" for name, size in array.sizes.items()]
        return ", ".join(names)

    # Times and values.

    def _between(self, array: Any, times: Floats, time: datetime) -> Any:
        """The times that an incident may need, and the next one on each side."""
        begin = time.timestamp() - BEFORE
        end = time.timestamp() + AFTER
        first = max(int(times.searchsorted(begin, side="right")) - 1, 0)
        last = min(int(times.searchsorted(end)) + 1, len(times))
        if last - first < 2:
            first = max(min(first, len(times) - 2), 0)
            last = first + 2
        return array.isel(time=slice(first, last))

    def _check_gaps(self, times: Floats) -> None:
        intervals = np.diff(times)
        usual = float(np.median(intervals))
        is_long = intervals > LONGER * usual
        # A forecast may go on in longer intervals, but does not return to shorter ones.
        later_short = np.logical_or.accumulate(~is_long[::-1])[::-1]
        gaps = (is_long & later_short).nonzero()[0]
        if gaps.size:
            before, after = times[gaps[0] : gaps[0] + 2]
            raise self._refused(
                f"given every {usual / 3600:g} h, got {self._name} for {_utc(before)} and then for "
                f"{_utc(after)}",
                "save the times that are missing",
            )

    def _check_values(self, values: Singles, times: Floats) -> None:
        """Refuse speeds that no sea or air has, and hours without values."""
        with np.errstate(invalid="ignore", over="ignore"):
            fast = np.hypot(*values.astype(np.float64))
        fastest = FASTEST[self._kind]
        if np.any(fast > fastest):
            raise self._refused(
                f"at most {fastest:g} m/s fast, got {self._name} with {np.nanmax(fast):g} m/s",
                "declare the value that stands for missing ones as _FillValue, or correct the unit",
            )
        is_known: Flags = np.all(np.isfinite(values), axis=0)  # (members, T, Y, X)
        empty = ~is_known.any(axis=(2, 3)).all(axis=0)
        if empty.any() and not empty.all():
            when = _utc(times[empty.argmax()])
            raise self._refused(
                f"known at every time, got {self._name} without any value for {when}",
                "save that time again",
            )


def _data_array(axis: Any, name: str) -> Any:
    """A coordinate as an array with a name."""
    xarray = needed("xarray", f"{REASON} xarray", "tracks")
    return xarray.DataArray(axis.values, dims=axis.dims, name=name, attrs=axis.attrs)


def _standard(array: Any, name: Hashable) -> str:
    """The standard name of a coordinate; "" if there is none."""
    if name not in array.coords:
        return ""
    return str(array[name].attrs.get("standard_name", ""))


def _is_step(array: Any, name: Hashable) -> bool:
    """Whether a dimension is the time since the beginning of a forecast."""
    return name in STEPS or _standard(array, name) == "forecast_period"


def _is_time(array: Any, name: Hashable) -> bool:
    """Whether a dimension is a time."""
    if name not in array.coords:
        return str(name).lower() in ("time", "valid_time")
    axis = array[name]
    is_date = np.issubdtype(axis.dtype, np.datetime64) or axis.dtype == object
    return bool(is_date or _standard(array, name) == "time")


VERTICAL = (
    "depth",
    "height",
    "lev",
    "level",
    "s_rho",
    "sigma",
    "plev",
    "isobaric",
    "isobaricinhpa",
    "pressure",
    "pressure_level",
    "hybrid",
    "model_level",
    "altitude",
    "z",
)
"""How names of levels begin, in lower case."""


def _is_vertical(array: Any, name: Hashable) -> bool:
    """Whether a dimension is a level."""
    text = str(name).lower()
    if name in array.coords:
        attributes = array[name].attrs
        if "positive" in attributes or attributes.get("axis") == "Z":
            return True
        if _standard(array, name) in ("depth", "height", "altitude", "air_pressure"):
            return True
    return text.startswith(VERTICAL)


def _grid_dimensions(latitude: Any, longitude: Any) -> tuple[Hashable, Hashable]:
    """The dimensions of rows and of columns."""
    if latitude.ndim == 1:
        return latitude.dims[0], longitude.dims[0]
    rows, columns = latitude.dims
    return rows, columns


def _utc(seconds: float) -> str:
    return f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%d %H:%M} UTC"
