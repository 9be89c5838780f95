"""Positions in cells from NetCDF files of the CF conventions, such as those of OpenDrift."""

from __future__ import annotations

import warnings
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints, Pair
from DroneSwarmSearch.geo.netcdf import TooLargeError, check_size, opened, since_1970
from DroneSwarmSearch.geo.plane import TangentPlane
from DroneSwarmSearch.geo.scale import Scale

USUAL = {"lon": "longitude", "lat": "latitude"}  # names of variables without a standard name
FASTEST = 15.0  # m/s, along each axis; nothing drifts so fast
FAR = 1.0  # degrees from (0, 0), at which other tracks make one there a mistake

SECONDS_IN = {"second": 1.0, "minute": 60.0, "min": 60.0, "hour": 3600.0, "day": 86400.0}
"""Units of time by their names without a final s; others are shorter."""

MOST_LOST = 0.1  # the largest share of lost tracks: nobody knows what became of them


def positions(
    path: Path,
    scale: Scale,
    *,
    origin: Pair,
    cell: Pair,
    start: str | None,
    steps: int | None,
    diffusivity: float,
    seed: int,
) -> tuple[Floats, int, int, datetime | None]:
    """The positions at the search's steps, (steps + 1, P, 2); how many strand; how many are lost.

    The last value is when all elements are adrift for the first time; None: from the beginning.

    Between the file's times they are interpolated. See `Tracks.read` for arguments and errors.
    """
    degrees, seconds, stranded = _read(path, scale.seconds_per_step)
    known = np.isfinite(degrees[0])
    released = seconds[known[:, known.any(axis=0)].argmax(axis=0).max(initial=0)]
    begin = released if start is None else datetime.fromisoformat(start).timestamp()
    covered = int((seconds[-1] - begin) / scale.seconds_per_step + 1e-9)
    if not seconds[0] <= begin or covered < (steps or 1):
        raise ValueError(
            f"start and steps must lie within the times of {path}, {_utc(seconds[0])} to "
            f"{_utc(seconds[-1])} (all elements are adrift from {_utc(released)}), got "
            f"start={start} and steps={steps} of {scale.seconds_per_step:g} s"
        )
    times: Any = begin + scale.seconds_per_step * np.arange((steps or covered) + 1)
    longitude, latitude = degrees
    metres = TangentPlane(*origin).metres(latitude, longitude)
    cells = metres * (1, -1) / scale.metres_per_cell + cell
    tracks, adrift, lost = _tracked(cells, seconds, times, stranded)
    is_later = released > seconds[0]
    elements = lost + tracks.shape[1]
    if lost > MOST_LOST * elements:
        later = f"start at {_utc(released)}, when all are adrift" if is_later else "start later"
        raise ValueError(
            f"{path} must lose at most {MOST_LOST:.0%} of its elements before the last step but "
            f"for stranding, got {lost:,} of {elements:,}: simulate a larger area, {later} or take "
            "fewer steps"
        )
    if diffusivity:
        deviation = np.sqrt(scale.diffusion(diffusivity))
        shape = tracks[1:].shape
        moves = np.random.default_rng(seed).normal(0.0, deviation, shape) * adrift[:-1, :, None]
        tracks[1:] += moves.cumsum(axis=0)
    return tracks, int(np.sum(~adrift[-1])), lost, _utc(released) if is_later else None


def first_known(path: Path) -> tuple[Pair, datetime]:
    """The mean (latitude, longitude) of the first positions of a file, and their time."""
    degrees, seconds, _ = _read(path)
    _check_speeds(path, degrees, seconds)
    known = int(np.flatnonzero(np.isfinite(degrees[0]).any(axis=1))[0])
    longitude, latitude = np.radians(degrees[:, known])
    middle = np.nanmean(np.exp(1j * longitude))  # also at the date line
    position = np.degrees([np.nanmean(latitude), np.angle(middle)]).tolist()
    return (position[0], position[1]), _utc(seconds[known])


def _utc(seconds: float) -> datetime:
    return datetime.fromtimestamp(seconds, timezone.utc)


def _read(path: Path, step: float = np.inf) -> tuple[Floats, Floats, Flags]:
    """Longitudes and latitudes (2, times, P), the times in seconds since 1970, and who strands.

    Warns if the file keeps times less precisely than a step, in seconds.
    """
    with opened(path) as data:
        try:
            seconds, degrees, stranded = _variables(path, data, step)
        except TooLargeError:
            raise
        except (AttributeError, KeyError, OverflowError, RuntimeError, TypeError, ValueError):
            raise ValueError(_refusal(path, data)) from None
    back = np.flatnonzero(np.diff(seconds) <= 0)
    if len(back):
        before, after = (_utc(second) for second in seconds[back[0] :][:2])
        hint = ""
        if len(back) == len(seconds) - 1:
            hint = ": a simulation backward in time"
        raise ValueError(
            f"{path} must have times that increase, because tracks run forward, got {after} after "
            f"{before}{hint}"
        )
    _check_degrees(path, degrees, seconds)
    return degrees, seconds, stranded


def _named(data: Any) -> dict[str, Any]:
    """The variables of a file by standard name, or by usual name."""
    return {
        variable.attrs.get("standard_name", USUAL.get(key, key)): variable
        for key, variable in data.variables.items()
    }


def _variables(path: Path, data: Any, step: float) -> tuple[Floats, Floats, Flags]:
    """The times, longitudes and latitudes, and who strands; any error if they are not there."""
    named = _named(data)
    longitude = named["longitude"]
    latitude = named["latitude"]
    time = named["time"]
    for name, variable in data.variables.items():
        check_size(path, name, variable.size)
    (when,) = time.dims
    across = longitude.dims.index(when)
    if time.dtype.kind == "f":
        _check_precision(path, time, step)
    both = [values.values.astype(np.float64) for values in (longitude, latitude)]
    degrees: Floats = np.stack(both).transpose(0, across + 1, 2 - across)
    stranded = np.zeros(degrees.shape[2], np.bool_)
    status: Any = data.variables.get("status")
    meanings = [] if status is None else status.attrs.get("flag_meanings", "").split()
    if "stranded" in meanings and status.dims == longitude.dims:
        code = np.atleast_1d(status.attrs["flag_values"])[meanings.index("stranded")]
        stranded = np.any(status.values == code, axis=across)
    return since_1970(time), degrees, stranded


def _check_precision(path: Path, time: Any, step: float) -> None:
    """Warn if floats keep times less precisely than a step, in seconds."""
    last = np.abs(time.values).max()
    unit = time.attrs["units"].split()[0]
    precision = float(np.spacing(last)) * SECONDS_IN.get(unit.rstrip("s"), 1.0)
    if precision > step:
        warnings.warn(
            f"{path} keeps times as {time.dtype}, to {precision:.0f} s only, and a "
            f"step takes {step:g} s: save them as float64 or as integers",
            stacklevel=6,
        )


def _refusal(path: Path, data: Any) -> str:
    """What a file must have, and what it has."""
    got = ", ".join(f"{k}({', '.join(v.dims)})" for k, v in data.variables.items())
    time = _named(data).get("time")
    units = "no units" if time is None else time.attrs.get("units", "no units")
    return (
        f"{path} must have variables with the standard names longitude, latitude and time, for "
        "many elements at common times of the usual calendar (time along one dimension, the "
        "others along it and one for the elements; ragged arrays, with all elements along one, "
        f"must be converted), got {got or 'none'}, times in {units}"
    )


def _check_degrees(path: Path, degrees: Floats, seconds: Floats) -> None:
    """Raise a ValueError, with the file and the element, for what no track of a drift can be."""
    longitude, latitude = degrees
    known = np.isfinite(longitude) & np.isfinite(latitude)
    if not known.any():
        raise ValueError(f"{path} must hold tracks, got no known position")

    refuse = partial(_refuse, path, degrees, seconds)
    with np.errstate(invalid="ignore"):
        wrong = (np.abs(latitude) > 90.0) | (np.abs(longitude) > 360.0)
    refuse(wrong, "degrees", "a fill value must be declared")

    nowhere = (latitude == 0.0) & (longitude == 0.0)
    elsewhere = known & ~nowhere
    if elsewhere.any():
        median = [np.median(np.abs(values[elsewhere])) for values in (latitude, longitude)]
        if max(median) > FAR:
            refuse(nowhere, "tracks near each other", "missing values must be declared")

    seen = np.logical_or.accumulate(known, axis=0)
    goes_on = np.logical_or.accumulate(known[::-1], axis=0)[::-1]
    refuse(seen & goes_on & ~known, "tracks without gaps", "elements that end do not come back")


def _check_speeds(path: Path, degrees: Floats, seconds: Floats) -> None:
    """Raise a ValueError, with the file and the element, if a track jumps."""
    longitude, latitude = degrees
    known = np.isfinite(longitude) & np.isfinite(latitude)
    plane = TangentPlane(float(latitude[known][0]), float(longitude[known][0]))
    moves = np.abs(np.diff(plane.metres(latitude, longitude), axis=0)).max(axis=2)
    fast = np.zeros_like(known)
    with np.errstate(invalid="ignore"):
        fast[1:] = moves > FASTEST * np.diff(seconds)[:, None]
    what = f"tracks of at most {FASTEST:g} m/s along each axis"
    _refuse(path, degrees, seconds, fast, what, "nothing drifts so fast")


def _refuse(
    path: Path, degrees: Floats, seconds: Floats, wrong: Flags, what: str, hint: str
) -> None:
    """Raise a ValueError about the first wrong position, (times, P), if there is any."""
    if not wrong.any():
        return
    time, element = np.argwhere(wrong)[0]
    longitude, latitude = degrees[:, time, element]
    raise ValueError(
        f"{path} must hold {what}, got ({latitude:g}, {longitude:g}) in element {element} at "
        f"{_utc(seconds[time])}, and {np.count_nonzero(wrong) - 1:,} others: {hint}"
    )


def _tracked(
    cells: Floats, seconds: Floats, times: Floats, stranded: Flags
) -> tuple[Floats, Flags, int]:
    """The positions at some times, whether each is adrift then, and the number of those lost."""
    active: Flags = np.all(np.isfinite(cells), axis=2)
    ends = len(active) - 1 - active[::-1].argmax(axis=0)  # the last known position
    here = np.clip(seconds.searchsorted(times, side="right") - 1, 0, len(seconds) - 2)
    part = (times - seconds[here]) / (seconds[here + 1] - seconds[here])
    last = here[-1] + int(part[-1] > 0.0)
    is_known: Flags = active[: here[0] + 1].any(axis=0) & (stranded | (ends >= last))
    which: Ints = is_known.nonzero()[0]
    end = ends[which]
    tracks = np.empty((len(times), len(which), 2))
    held = cells[np.minimum(np.arange(len(cells))[:, None], end), which]
    for step, (before, share) in enumerate(zip(here.tolist(), part.tolist(), strict=True)):
        a, b = held[before : before + 2]
        tracks[step] = a + share * (b - a)
    adrift = ~stranded[which] | (times[:, None] < seconds[end])
    return tracks, adrift, len(is_known) - len(which)
