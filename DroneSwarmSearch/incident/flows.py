"""Winds and currents: as they are typed, as series in time, and in words."""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.leeway import current_towards, wind_from
from DroneSwarmSearch.incident import units
from DroneSwarmSearch.incident.flights import in_utc

FASTEST = {"wind": 60.0, "current": 5.0}
"""In m/s; beyond, a figure was probably given in another unit."""

FILES = ".csv", ".nc", ".nc4", ".cdf"  # by which winds and currents in files are recognised


def series(flow: Any) -> Callable[[Any], Floats]:
    """A wind or current of an incident as a function of times in seconds, (n,): (2, n)."""
    points = flow if isinstance(flow, Mapping) else {0.0: flow}
    times, vectors = [*points], np.array([*points.values()])
    return lambda at: np.stack([np.interp(at, times, column) for column in vectors.T])


def stronger(flow: Any, by: float) -> Any:
    """A wind or current of an incident that is so many m/s stronger at all times."""
    if isinstance(flow, Mapping):
        return {time: stronger(at_time, by) for time, at_time in flow.items()}
    return tuple(component * (1.0 + by / max(math.hypot(*flow), 1e-9)) for component in flow)


def named(name: str, read: Callable[..., Any], *given: object) -> Any:
    """What a text means; an error begins with the name of the value."""
    try:
        return read(*given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def read_flow(kind: str, value: Any, since: datetime, name: str = "") -> Any:
    """The "wind" or "current" of an incident: a vector, a series of them, or the name of a file.

    A series is a mapping of seconds after `since`, in their order, to vectors.
    """
    name = name or kind
    if isinstance(value, (str, os.PathLike)) and (path := Path(value)).suffix in FILES:
        if not path.is_file():
            raise ValueError(f"{name} must name a file, but there is no {str(path)!r}")
        if path.suffix != ".csv":
            return str(path)
        value = _rows(name, path)
    if isinstance(value, str):
        value = [value]
    if isinstance(value, (list, tuple)) and any(isinstance(part, str) for part in value):
        value = dict(_timed(name, part, since) for part in value)
        if [*value] == [None]:
            value = value[None]
    if isinstance(value, Mapping):
        vectors = {
            0.0 if time is None else checks.real(f"a time of {name}", time): read_flow(
                kind, part, since, f"{name}[{time}]"
            )
            for time, part in value.items()
        }
        return {time: vectors[time] for time in sorted(vectors)}
    if isinstance(value, str):
        direction, _, speed = value.replace(",", " ").strip().partition(" ")
        usual = f"{name}, such as 300 25kn"
        degrees = named(usual, units.direction, direction)
        metres_per_second = named(usual, units.quantity, speed, units.SPEED)
        value = (wind_from if kind == "wind" else current_towards)(degrees, metres_per_second)
    what = '(east, north) in m/s, text such as "300 25kn", or a series of these'
    flow = checks.pair(name, value, what)
    if math.hypot(*flow) > FASTEST[kind]:
        raise ValueError(
            f"{name} must be at most {FASTEST[kind]:g} m/s fast, got {math.hypot(*flow):.4g} m/s; "
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


def _rows(name: str, path: Path) -> list[str]:
    """The rows of a CSV file with the columns time, direction and speed, as texts."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [*csv.DictReader(file, skipinitialspace=True)]
        return [f"{row['direction']} {row['speed']}@{row['time']}" for row in rows]
    except (OSError, KeyError) as error:
        raise ValueError(
            f"{name} must be a CSV file with the columns time, direction and speed, got {path}: "
            f"{'no column ' if isinstance(error, KeyError) else ''}{error}"
        ) from None
