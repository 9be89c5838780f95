"""Positions in cells from NetCDF files of the CF conventions, such as those of OpenDrift."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.drift.scale import Scale

__all__ = ["positions"]

Pair = tuple[float, float]


def positions(
    path: Path,
    scale: Scale,
    *,
    origin: Pair,
    cell: Pair,
    start: datetime | None,
    steps: int | None,
    diffusivity: float,
    seed: int,
) -> tuple[Floats, int]:
    """The positions at the search's steps, in cells, (steps + 1, P, 2), and the number of lost.

    See `Tracks.read` for the arguments. Between the file's times, positions are interpolated.
    """
    try:
        import netCDF4
    except ImportError as error:
        raise ImportError(
            'reading NetCDF needs netCDF4: pip install "DroneSwarmSearchEnvironment[tracks]"'
        ) from error
    if not path.is_file():
        raise FileNotFoundError(f"path must name a file, but there is no {str(path)!r}")
    try:
        data = netCDF4.Dataset(path)
    except OSError as error:
        raise ValueError(f"{path} must be a NetCDF file, got another: {error}") from None
    with data:
        longitude, latitude = (_variable(data, path, each) for each in ("longitude", "latitude"))
        time = _variable(data, path, "time")
        if time.ndim != 1 or longitude.ndim != 2 or time.dimensions[0] not in longitude.dimensions:
            raise ValueError(
                f"{path} must have longitude and latitude for each trajectory at common times, "
                f"got the dimensions {longitude.dimensions} and times along {time.dimensions}"
            )
        by_time = longitude.dimensions.index(time.dimensions[0]) == 0
        degrees = np.stack(
            [np.ma.filled(each[:].astype(np.float64), np.nan) for each in (longitude, latitude)]
        )
        degrees = degrees if by_time else degrees.swapaxes(1, 2)  # (2, times, P)
        seconds = _seconds(netCDF4, time)
        stranded = _stranded(data, by_time, degrees.shape[1:])
    cells = _cells(degrees, scale, origin, cell)
    begin = seconds[0] if start is None else start.timestamp()
    covered = int((seconds[-1] - begin) / scale.seconds_per_step + 1e-9)
    if not seconds[0] <= begin < seconds[-1] or covered < (steps or 1):
        span = " to ".join(
            datetime.fromtimestamp(each, timezone.utc).isoformat() for each in seconds[[0, -1]]
        )
        raise ValueError(
            f"start and steps must lie within the times of {path}, {span}, got "
            f"start={start!r} and steps={steps!r} of {scale.seconds_per_step:g} s"
        )
    times: Any = begin + scale.seconds_per_step * np.arange((covered if steps is None else steps) + 1)
    cells, drifts, lost = _tracked(cells, seconds, times, stranded)
    if diffusivity:
        moves = np.random.default_rng(seed).normal(
            0.0, np.sqrt(scale.diffusion(diffusivity)), (len(cells) - 1, *cells.shape[1:])
        )
        cells[1:] += (moves * drifts[:-1, :, None]).cumsum(axis=0)
    return cells, lost


def _variable(data: Any, path: Path, name: str) -> Any:
    """The variable with a standard name, or with that name in short or in full."""
    for key, variable in data.variables.items():
        if getattr(variable, "standard_name", key) in (name, name[:3]):
            return variable
    raise ValueError(
        f"{path} must have a variable with the standard name {name!r}, got "
        f"{', '.join(data.variables) or 'none'}"
    )


def _seconds(netcdf: Any, time: Any) -> Floats:
    """Times as seconds since 1970 in UTC, which CF implies."""
    calendar = getattr(time, "calendar", "standard")
    dates = netcdf.num2date(time[:], time.units, calendar, only_use_cftime_datetimes=False)
    seconds = [each.replace(tzinfo=timezone.utc).timestamp() for each in np.ma.filled(dates)]
    return np.array(seconds)


def _stranded(data: Any, by_time: bool, shape: tuple[int, ...]) -> Flags:
    """Whether each element's last status is "stranded": (P,)."""
    if "status" not in data.variables:
        return np.zeros(shape[1], np.bool_)
    status = data["status"]
    names = getattr(status, "flag_meanings", "").split()
    values = np.atleast_1d(getattr(status, "flag_values", range(len(names))))
    codes = [value for value, name in zip(values, names, strict=False) if name == "stranded"]
    known = np.ma.masked_invalid(status[:] if by_time else status[:].T)
    ever: Flags = np.any(np.isin(known.filled(-1), codes), axis=0)
    return ever


def _cells(degrees: Floats, scale: Scale, origin: Pair, cell: Pair) -> Floats:
    """Positions in cells, (times, P, 2), on a plane that touches the Earth at the origin.

    The length of a degree is that of the WGS 84 ellipsoid at the origin's latitude.
    """
    phi, half_axis, eccentricity2 = np.radians(origin[1]), 6378137.0, 0.00669437999014
    curved = 1 - eccentricity2 * np.sin(phi) ** 2
    per_degree = np.radians(half_axis) * np.array(
        [np.cos(phi) / np.sqrt(curved), (1 - eccentricity2) / curved**1.5]
    )
    east = (degrees[0] - origin[0] + 180) % 360 - 180
    metres = np.stack([east * per_degree[0], -(degrees[1] - origin[1]) * per_degree[1]], axis=-1)
    cells: Floats = metres / scale.metres_per_cell + np.array(cell)
    return cells


def _tracked(
    cells: Floats, seconds: Floats, times: Floats, stranded: Flags
) -> tuple[Floats, Flags, int]:
    """The positions at some times, whether each is adrift then, and the number of those lost.

    Elements that strand stay at their last position; lost ones are left out.
    """
    active: Flags = np.all(np.isfinite(cells), axis=2)
    ends = len(active) - 1 - active[::-1].argmax(axis=0)  # the last known position
    here = np.clip(seconds.searchsorted(times, side="right") - 1, 0, len(seconds) - 2)
    part = (times - seconds[here]) / (seconds[here + 1] - seconds[here])
    first, last = here[0], here[-1] + int(part[-1] > 0.0)
    is_known: Flags = active[first] & (stranded | (ends >= last))
    which: Ints = is_known.nonzero()[0]
    track = np.empty((len(times), len(which), 2))
    for step, (before, share) in enumerate(zip(here.tolist(), part.tolist(), strict=True)):
        a, b = (cells[np.minimum(each, ends[which]), which] for each in (before, before + 1))
        track[step] = a if share == 0.0 else (1.0 - share) * a + share * b
    drifts = ~(stranded[which] & (times[:, None] >= seconds[ends[which]]))
    return track, drifts, len(is_known) - len(which)
