"""Daylight at a place, from the position of the sun by the package astral (the extra "plan").

astral follows J. Meeus, Astronomical Algorithms (1991), as the solar calculator of NOAA does, whose
times of sunset are right within a minute between 72 degrees north and south, and within ten beyond.
"""

from __future__ import annotations

import math
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any

from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch._internal.extras import needed

HORIZON = -0.833
"""The elevation of the sun's centre at sunrise and sunset in degrees: its radius and refraction."""

STEP = timedelta(minutes=5)
EXACT = timedelta(seconds=1)
DAY = timedelta(days=1)


def is_light(position: Pair, time: datetime) -> bool:
    """Whether the sun is above the horizon at a position in degrees."""
    sun: Any = needed("astral.sun", "daylight needs the package astral", "plan")
    astral: Any = needed("astral", "daylight needs the package astral", "plan")
    observer = astral.Observer(*position)
    return float(sun.elevation(observer, time, with_refraction=False)) > HORIZON


@lru_cache(maxsize=64)
def seconds_of_light(position: Pair, time: datetime, seconds: float) -> float:
    """How long after a time the sun sets: 0 if it is down, infinity if not within some seconds."""
    if not is_light(position, time):
        return 0.0
    change = _next_change(position, time, timedelta(seconds=seconds))
    return math.inf if change is None else (change - time).total_seconds()


def next_sunrise(position: Pair, time: datetime) -> datetime | None:
    """When the sun rises within a day after a time at which it is down; None if it does not."""
    return _next_change(position, time, DAY)


def _next_change(position: Pair, time: datetime, within: timedelta) -> datetime | None:
    """When the sun rises or sets next, up to the second."""
    light = is_light(position, time)
    before = time
    while before < time + within:
        after = before + STEP
        if is_light(position, after) != light:
            while after - before > EXACT:
                middle = before + (after - before) / 2
                if is_light(position, middle) == light:
                    before = middle
                else:
                    after = middle
            return after
        before = after
    return None
