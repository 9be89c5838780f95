"""Winds and currents as people give them: texts, vectors, mappings, and files."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch._internal.files import csv_rows
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.fields import Field
from DroneSwarmSearch.geo.flows import Constant, Flow, Origin, Series, time_in_words
from DroneSwarmSearch.geo.forecast_files import GRIB, NETCDF
from DroneSwarmSearch.geo.times import is_clock, near

FASTEST = {"wind": 60.0, "current": 5.0}
"""In m/s; beyond, a figure was probably given in another unit."""

FILES = (".csv", *NETCDF, *GRIB)  # by which winds and currents in files are recognised


def read_flow(kind: str, value: object, origin: Origin) -> Flow:
    """The "wind" or "current" that a value means.

    Args:
        kind: what it is.
        value: a `Flow`; a vector (east, north) in m/s; a text such as "300 25kn", or a list of such
            texts with times; a mapping of seconds after the origin to vectors or texts; or the name
            of a CSV file with the columns time, direction and speed, or of a model's file.
        origin: where its metres and when its seconds begin.

    Raises:
        ImportError: a package that reads a model's file is missing.
        TypeError, ValueError: the value is of no such form, too fast, or the file is unsuitable.
    """
    if isinstance(value, Flow):
        return value.moved(origin)
    if isinstance(value, (str, os.PathLike)) and _names_file(os.fspath(value)):
        path = _checked_file(kind, Path(value))
        if path.suffix.lower() != ".csv":
            return Field.read(path, kind, origin)
        return _from_texts(kind, _rows(kind, path), origin)
    if isinstance(value, str):
        return _from_texts(kind, [value], origin)
    if isinstance(value, (list, tuple)) and any(isinstance(part, str) for part in value):
        return _from_texts(kind, value, origin)
    if isinstance(value, Mapping):
        return _from_mapping(kind, value, origin)
    return Constant(kind, origin, vector=_vector(kind, kind, value))


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


def _from_texts(kind: str, texts: Sequence[Any], origin: Origin) -> Flow:
    """A constant flow from one text without a time, else a series."""
    vectors: dict[float, Pair] = {}
    latest = -math.inf
    for text in texts:
        if not isinstance(text, str):
            raise TypeError(f"{kind} must be a list of texts such as 300 25kn@08:00Z, got {text!r}")
        flow, has_time, when = text.partition("@")
        if len(texts) == 1 and not has_time:
            return Constant(kind, origin, vector=_typed(kind, kind, flow))
        seconds = 0.0
        if has_time:
            seconds = origin.seconds(near(kind, when, origin.time))
        if seconds in vectors:
            raise ValueError(
                f"{kind} must be given once for each time, got {text!r} after another for "
                f"{time_in_words(origin, seconds)}; others need times, such as 320 30kn@08:00Z"
            )
        if has_time and seconds < latest:
            _check_date(kind, when, origin, seconds)
        latest = max(latest, seconds)
        vectors[seconds] = _typed(kind, kind, flow)
    in_order = {seconds: vectors[seconds] for seconds in sorted(vectors)}
    return Series(kind, origin, vectors=in_order)


def _check_date(kind: str, when: str, origin: Origin, seconds: float) -> None:
    """Raise a ValueError if a time of the clock that comes late in a list is on another day."""
    day: datetime = origin.at(seconds)
    if is_clock(when) and day.date() != origin.time.date():
        raise ValueError(
            f"{kind} must have dates where it lasts longer than half a day: {when.strip()} would "
            f"be {time_in_words(origin, seconds)}, nearest to the incident, but comes after a "
            "later time"
        )


def _from_mapping(kind: str, flow: Mapping[Any, Any], origin: Origin) -> Series:
    """A series from a mapping of seconds to vectors or texts."""
    if not flow:
        raise ValueError(f"{kind} must hold at least one time, got {flow!r}")
    vectors: dict[float, Pair] = {}
    for time, value in flow.items():
        read = _typed if isinstance(value, str) else _vector
        seconds = checks.real(f"a time of {kind}", _number(time))
        vectors[seconds] = read(kind, f"{kind}[{time}]", value)
    in_order = {seconds: vectors[seconds] for seconds in sorted(vectors)}
    return Series(kind, origin, vectors=in_order)


def _number(time: Any) -> Any:
    """A number of seconds, which is a text in JSON files; anything else as it is."""
    try:
        return float(time) if isinstance(time, str) else time
    except ValueError:
        return time


def _typed(kind: str, name: str, text: str) -> Pair:
    """A vector from a text such as "300 25kn"."""
    direction, _, speed = text.replace(",", " ").strip().partition(" ")
    usual = f"{name}, such as 300 25kn"
    degrees = units.named(usual, units.direction, direction)
    metres_per_second = units.named(usual, units.quantity, speed, units.SPEED)
    toward = units.wind_from if kind == "wind" else units.current_towards
    return _vector(kind, name, toward(degrees, metres_per_second))


def _vector(kind: str, name: str, value: Any) -> Pair:
    """A vector (east, north) in m/s, not faster than winds and currents are."""
    what = '(east, north) in m/s, text such as "300 25kn", or a series of these'
    flow = checks.pair(name, value, what)
    speed = math.hypot(*flow)
    if speed > FASTEST[kind]:
        raise ValueError(
            f"{name} must be at most {FASTEST[kind]:g} m/s fast, got {speed:.4g} m/s; "
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
