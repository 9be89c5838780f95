"""Winds and currents: as they are typed, as series in time, and in words."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Pair
from DroneSwarmSearch._internal.files import csv_rows
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.times import DAY, is_clock, near
from DroneSwarmSearch.geo.units import current_towards, wind_from

FASTEST = {"wind": 60.0, "current": 5.0}
"""In m/s; beyond, a figure was probably given in another unit."""

FILES = ".csv", ".nc", ".nc4", ".cdf"  # by which winds and currents in files are recognised

CHANGE = 1.0  # seconds in which a flow turns into another one, because series are interpolated


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


def changed_at(seconds: float, earlier: Any, later: Any) -> Any:
    """A flow that is `earlier` at first, then `later`.

    It changes at the first time of `later`, or at `seconds` if that is a vector.
    """
    after = later if isinstance(later, Mapping) else {seconds: later}
    begin = min(after)
    before = earlier if isinstance(earlier, Mapping) else {begin: earlier}
    joined = {time: vector for time, vector in before.items() if time < begin}
    east, north = series(before)(np.array([begin]))[:, 0].tolist()
    joined[begin] = (east, north)
    joined[begin + CHANGE] = after[begin]
    joined.update({time: vector for time, vector in after.items() if time > begin + CHANGE})
    return joined


def shifted(flow: Any, seconds: float) -> Any:
    """The same flow, whose times in seconds count from so many seconds later."""
    if isinstance(flow, Mapping):
        return {time - seconds: vector for time, vector in flow.items()}
    return flow


def named(name: str, read: Callable[..., Any], *given: object) -> Any:
    """What a text means; an error begins with the name of the value."""
    try:
        return read(*given)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def read_flow(kind: str, value: Any, since: datetime) -> Any:
    """The "wind" or "current" of an incident: a vector, a series of them, or the name of a file.

    A series is a mapping of seconds after `since`, in their order, to vectors.
    """
    if isinstance(value, (str, os.PathLike)) and _names_file(os.fspath(value)):
        path = _checked_file(kind, Path(value))
        if path.suffix.lower() != ".csv":
            return str(path)
        value = _rows(kind, path)
    if isinstance(value, str):
        value = [value]
    if isinstance(value, (list, tuple)) and any(isinstance(part, str) for part in value):
        return _from_texts(kind, value, since)
    if isinstance(value, Mapping):
        return _from_mapping(kind, value)
    return _vector(kind, kind, value)


def check_times(kind: str, flow: Any, since: datetime, until: datetime) -> None:
    """Raise a ValueError if a series has times more than a day before or after the incident.

    The incident is from `since` to `until`.
    """
    if not isinstance(flow, Mapping):
        return
    length = (until - since).total_seconds()
    for seconds in flow:
        if not -DAY.total_seconds() <= seconds <= length + DAY.total_seconds():
            raise ValueError(
                f"{kind} must be given for times within a day of the incident, which lasts from "
                f"{since:%Y-%m-%d %H:%M} to {until:%Y-%m-%d %H:%M} UTC, got one for "
                f"{_time(since, seconds)}"
            )


def _time(since: datetime, seconds: float) -> str:
    """A time of a series in words."""
    try:
        return f"{since + timedelta(seconds=seconds):%Y-%m-%d %H:%M}"
    except OverflowError:
        return f"{seconds:g} s after that"


def _names_file(text: str) -> bool:
    """Whether a text is the name of a file, and no wind or current as people type it."""
    words = text.replace(",", " ").split()
    is_typed = len(words) > 1 and re.fullmatch(r"[\d.]+[°T]?|[NESW]{1,3}", words[0].upper())
    return not is_typed and bool(re.search(r"\.[A-Za-z]\w*$", text.strip()))


def _checked_file(kind: str, path: Path) -> Path:
    """The file of a flow, if its name is one that is read."""
    if path.suffix.lower() not in FILES:
        raise ValueError(
            f"{kind} must be text such as 300 25kn, or a file whose name ends in "
            f"{', '.join(FILES)}, got {str(path)!r}"
        )
    if not path.is_file():
        raise ValueError(f"{kind} must name a file, but there is no {str(path)!r}")
    return path


def _from_texts(kind: str, texts: Sequence[Any], since: datetime) -> Any:
    """A vector from one text without a time, else a series."""
    vectors: dict[float, Pair] = {}
    latest = -math.inf
    for text in texts:
        if not isinstance(text, str):
            raise TypeError(f"{kind} must be a list of texts such as 300 25kn@08:00Z, got {text!r}")
        flow, has_time, when = text.partition("@")
        if len(texts) == 1 and not has_time:
            return _typed(kind, kind, flow)
        seconds = 0.0
        if has_time:
            seconds = (near(kind, when, since) - since).total_seconds()
        if seconds in vectors:
            raise ValueError(
                f"{kind} must be given once for each time, got {text!r} after another for "
                f"{_time(since, seconds)}; others need times, such as 320 30kn@08:00Z"
            )
        day = (since + timedelta(seconds=seconds)).date()
        if is_clock(when) and seconds < latest and day != since.date():
            raise ValueError(
                f"{kind} must have dates where it lasts longer than half a day: "
                f"{when.strip()} would be {_time(since, seconds)}, nearest to the incident, but "
                "comes after a later time"
            )
        latest = max(latest, seconds)
        vectors[seconds] = _typed(kind, kind, flow)
    return {seconds: vectors[seconds] for seconds in sorted(vectors)}


def _from_mapping(kind: str, flow: Mapping[Any, Any]) -> dict[float, Pair]:
    """A series from a mapping of seconds to vectors or texts."""
    if not flow:
        raise ValueError(f"{kind} must hold at least one time, got {flow!r}")
    vectors: dict[float, Pair] = {}
    for time, value in flow.items():
        read = _typed if isinstance(value, str) else _vector
        vectors[checks.real(f"a time of {kind}", time)] = read(kind, f"{kind}[{time}]", value)
    return {time: vectors[time] for time in sorted(vectors)}


def _typed(kind: str, name: str, text: str) -> Pair:
    """A vector from a text such as "300 25kn"."""
    direction, _, speed = text.replace(",", " ").strip().partition(" ")
    usual = f"{name}, such as 300 25kn"
    degrees = named(usual, units.direction, direction)
    metres_per_second = named(usual, units.quantity, speed, units.SPEED)
    toward = wind_from if kind == "wind" else current_towards
    return _vector(kind, name, toward(degrees, metres_per_second))


def _vector(kind: str, name: str, value: Any) -> Pair:
    """A vector (east, north) in m/s, not faster than winds and currents are."""
    what = '(east, north) in m/s, text such as "300 25kn", or a series of these'
    flow = checks.pair(name, value, what)
    if math.hypot(*flow) > FASTEST[kind]:
        raise ValueError(
            f"{name} must be at most {FASTEST[kind]:g} m/s fast, got {math.hypot(*flow):.4g} m/s; "
            "1 kn is 0.514 m/s"
        )
    return flow


def _rows(name: str, path: Path) -> list[str]:
    """The rows of a CSV file with the columns time, direction and speed, as texts."""
    what = f"{name} must be a CSV file with the columns time, direction and speed"
    try:
        texts = [f"{row['direction']} {row['speed']}@{row['time']}" for _, row in csv_rows(path)]
    except KeyError as error:
        raise ValueError(f"{what}, got {path}: no column {error}") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{what}, got {path}: {error}") from None
    if not texts:
        raise ValueError(f"{what}, got {path}: no rows")
    return texts
