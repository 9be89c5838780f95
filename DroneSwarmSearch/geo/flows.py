"""Winds and currents: a `Flow` has a velocity at every time and point, however it was given.

`read_flow` makes one from what people type: a `Constant`, a `Series` in time, or the `Field` of a
model's file (`fields`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Pair
from DroneSwarmSearch.geo import units
from DroneSwarmSearch.geo.plane import EQUATOR, TangentPlane
from DroneSwarmSearch.geo.times import DAY
from DroneSwarmSearch.geo.units import KNOT

CHANGE = 1.0  # seconds in which a flow turns into another one, because series are interpolated

Clock = Callable[[datetime], str]  # a time in words

Typed = str | list[str] | list[float] | dict[str, list[float]]
"""A text, texts with times, a vector, or vectors by the seconds after the origin."""


@dataclass(frozen=True)
class Origin:
    """Where all metres and when all seconds begin.

    Attributes:
        position: (latitude, longitude) in degrees.
        time: in UTC.
    """

    position: Pair
    time: datetime

    @cached_property
    def plane(self) -> TangentPlane:
        """The plane of all metres, which touches the earth at the position."""
        return TangentPlane(*self.position)

    def seconds(self, time: datetime) -> float:
        """Seconds from the origin to a time."""
        return (time - self.time).total_seconds()

    def at(self, seconds: float) -> datetime:
        """The time some seconds after the origin."""
        return self.time + timedelta(seconds=seconds)


@dataclass(frozen=True, eq=False)
class Flow(ABC):
    """A wind or a current.

    Attributes:
        kind: "wind" at a height of 10 m, or "current" of the water.
        origin: where its metres and when its seconds begin.
    """

    kind: str
    origin: Origin

    @property
    def source(self) -> str | None:
        """The file of a field; else None."""
        return None

    @property
    def varies(self) -> bool:
        """Whether it differs between positions."""
        return False

    @property
    def members(self) -> int:
        """The number of members of an ensemble; 1 for anything else."""
        return 1

    def velocity(
        self, times: float | Floats, points: Floats, members: Ints | None = None
    ) -> Floats:
        """The velocity along the axes of the plane, in m/s.

        Args:
            times: in seconds, one for all points or one for each.
            points: (east, north) in metres on the plane: (2, n).
            members: of an ensemble, from 0, for each point; by default their mean.

        Returns:
            (east, north), (2, n), or (2, 1) if all are equal; NaN on land.
        """
        east, north = self._towards(times, points, members)
        # North is towards the pole, which is another direction elsewhere on the plane.
        turned = self._turning * points[0]
        return np.array([east - turned * north, north + turned * east])

    def check_within(self, times: float | Floats, points: Floats) -> None:
        """Raise a ValueError if it is not known at some times and points; see `velocity`."""
        return

    def check_times(self, until: datetime) -> None:
        """Raise a ValueError if times are given that are far from the origin's and `until`."""
        return

    @cached_property
    def _turning(self) -> float:
        """By how much north turns for each metre to the east, in radians."""
        return float(np.tan(np.radians(self.origin.position[0])) / EQUATOR)

    @abstractmethod
    def _key(self) -> tuple[object, ...]:
        """Equal for equal flows of a class."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Flow):
            return NotImplemented
        return type(self) is type(other) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    @abstractmethod
    def _towards(self, times: float | Floats, points: Floats, members: Ints | None) -> Floats:
        """The velocity to the east and to the north, (2, n) or (2, 1), as in `velocity`."""

    # Other flows.

    @abstractmethod
    def moved(self, origin: Origin) -> Flow:
        """The same flow, whose metres and seconds count from another origin."""

    def stronger(self, by: float) -> Flow | None:
        """The flow with its speed increased by some m/s; None for a field."""
        return None

    def vectors_from(self, seconds: float) -> dict[float, Pair]:
        """Its vectors by time in seconds, if it begins then; none for a field."""
        return {}

    def changed_to(self, later: Flow, seconds: float) -> Flow:
        """The flow that is this one at first, then `later`, at the times of that or at `seconds`.

        Raises:
            ValueError: they come from different files, or only one from a file.
        """
        after = later.vectors_from(seconds)
        begin = min(after, default=seconds)
        before = self.vectors_from(begin)
        if not before or not after:
            if self.source is not None and self.source == later.source:
                return self
            raise ValueError(
                f"{self.kind} cannot change after flights if it is that of a file, because a wind "
                "and a file cannot be joined; give a newer position and time, from which the new "
                "one counts"
            )
        joined = {time: vector for time, vector in before.items() if time < begin}
        joined[begin] = _interpolated(before, begin)
        joined[begin + CHANGE] = after[begin]
        joined |= {time: vector for time, vector in after.items() if time > begin + CHANGE}
        return Series(self.kind, self.origin, vectors=joined)

    # In words.

    @abstractmethod
    def as_typed(self, folder: str) -> Typed:
        """What `read_flow` reads again, exactly; a file counts from a folder."""

    @abstractmethod
    def described(self, clock: Clock) -> str:
        """The flow in words; "" if there is none."""

    def course(self, vector: Pair) -> Pair:
        """Where a vector comes from (a wind) or goes to, in degrees; and its speed in m/s."""
        turned = 180.0 if self.kind == "wind" else 0.0
        degrees = round((math.degrees(math.atan2(*vector)) + turned) % 360, 6) % 360
        return degrees, math.hypot(*vector)

    def _spoken(self, vector: Pair) -> str:
        degrees, speed = self.course(vector)
        return f"{degrees:03.0f}° {speed / KNOT:.2g} kn ({speed:.2g} m/s)"

    def _typed(self, vector: Pair) -> str | None:
        """A vector as people type it; None if that is another vector, because it is rounded."""
        degrees, speed = self.course(vector)
        direction = f"{degrees:g}°"
        knots = f"{speed / KNOT:.6g} kn"
        towards = units.wind_from if self.kind == "wind" else units.current_towards
        read = towards(units.direction(direction), units.quantity(knots, units.SPEED))
        return f"{direction} {knots}" if read == vector else None

    @property
    def _preposition(self) -> str:
        return "from" if self.kind == "wind" else "to"


@dataclass(frozen=True, eq=False)
class Constant(Flow):
    """A flow that is the same everywhere and at all times.

    Attributes:
        vector: (east, north) in m/s, where it goes to.
    """

    vector: Pair

    def _key(self) -> tuple[object, ...]:
        return self.kind, self.origin, self.vector

    def _towards(self, times: float | Floats, points: Floats, members: Ints | None) -> Floats:
        return np.array(self.vector)[:, None]

    def moved(self, origin: Origin) -> Constant:
        return replace(self, origin=origin)

    def stronger(self, by: float) -> Constant:
        return replace(self, vector=_longer(self.vector, by))

    def vectors_from(self, seconds: float) -> dict[float, Pair]:
        return {seconds: self.vector}

    def as_typed(self, folder: str) -> Typed:
        return self._typed(self.vector) or list(self.vector)

    def described(self, clock: Clock) -> str:
        if not any(self.vector):
            return ""
        return f"{self.kind} {self._preposition} {self._spoken(self.vector)}"


@dataclass(frozen=True, eq=False)
class Series(Flow):
    """A flow that is the same everywhere, and linear in time between some vectors.

    Before the first and after the last time, it stays as it is then.

    Attributes:
        vectors: (east, north) in m/s by time in seconds, in their order.
    """

    vectors: Mapping[float, Pair]

    def _key(self) -> tuple[object, ...]:
        return self.kind, self.origin, tuple(self.vectors.items())

    @cached_property
    def _columns(self) -> tuple[list[float], Floats]:
        """The times, and the components at these: (2, times)."""
        return list(self.vectors), np.array(list(self.vectors.values())).T

    def _towards(self, times: float | Floats, points: Floats, members: Ints | None) -> Floats:
        known, components = self._columns
        wanted = np.atleast_1d(times)
        return np.stack([np.interp(wanted, known, component) for component in components])

    def check_times(self, until: datetime) -> None:
        day = DAY.total_seconds()
        last = self.origin.seconds(until) + day
        for seconds in self.vectors:
            if not -day <= seconds <= last:
                raise ValueError(
                    f"{self.kind} must be given for times within a day of the incident, which "
                    f"lasts from {self.origin.time:%Y-%m-%d %H:%M} to {until:%Y-%m-%d %H:%M} UTC, "
                    f"got one for {time_in_words(self.origin, seconds)}"
                )

    def moved(self, origin: Origin) -> Series:
        later = self.origin.seconds(origin.time)
        vectors = {seconds - later: vector for seconds, vector in self.vectors.items()}
        return replace(self, origin=origin, vectors=vectors)

    def stronger(self, by: float) -> Series:
        faster = {seconds: _longer(vector, by) for seconds, vector in self.vectors.items()}
        return replace(self, vectors=faster)

    def vectors_from(self, seconds: float) -> dict[float, Pair]:
        return dict(self.vectors)

    def as_typed(self, folder: str) -> Typed:
        texts = []
        for seconds, vector in self.vectors.items():
            text = self._typed(vector)
            if text is None:
                return {repr(seconds): list(vector) for seconds, vector in self.vectors.items()}
            when = self.origin.at(seconds)
            exact = "auto" if when.second or when.microsecond else "minutes"
            stamp = when.isoformat(timespec=exact).replace("+00:00", "Z")
            texts.append(f"{text}@{stamp}")
        return texts

    def described(self, clock: Clock) -> str:
        spoken = [
            f"{self._spoken(vector)} at {clock(self.origin.at(seconds))}"
            for seconds, vector in self.vectors.items()
        ]
        return f"{self.kind} {self._preposition} {', '.join(spoken)}"


def time_in_words(origin: Origin, seconds: float) -> str:
    """The time of a series."""
    try:
        return f"{origin.at(seconds):%Y-%m-%d %H:%M}"
    except OverflowError:
        return f"{seconds:g} s after {origin.time:%Y-%m-%d %H:%M}"


def _interpolated(vectors: Mapping[float, Pair], seconds: float) -> Pair:
    """The vector of a series at a time."""
    columns: Any = np.array(list(vectors.values())).T
    east, north = (float(np.interp(seconds, list(vectors), column)) for column in columns)
    return east, north


def _longer(vector: Pair, by: float) -> Pair:
    """A vector in the same direction that is longer by some m/s."""
    east, north = vector
    factor = 1.0 + by / max(math.hypot(east, north), 1e-9)
    return east * factor, north * factor
