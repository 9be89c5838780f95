"""Search patterns relative to an area, so that they can be tried in another incident.

There are two families. `Boxes` is what a coordinator draws: one rectangle, divided into adjacent
boxes, one for each drone. `FreePatterns` gives each drone a pattern of its own, wherever it is.
Both are described by a few real numbers, of which small steps change the patterns a little.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.incident.coast import Coast
from DroneSwarmSearch.incident.drone import DroneInWind, drone_in_wind
from DroneSwarmSearch.incident.incident import Incident
from DroneSwarmSearch.incident.manual import Worksheet
from DroneSwarmSearch.incident.particles import Particles
from DroneSwarmSearch.incident.patterns import (
    PARALLEL,
    Pattern,
    distances_along,
    point_along,
)

SEARCHED_TWICE = 1.4  # the usual side of a searched square, squared, in strips that a drone can fly

LONGEST_TRACK = 40  # legs, and
POINTS_TRIED = 40  # along them, of which one must be at sea

LEAST_SHARE = 0.1  # of an equal share of the rectangle, for drones that have little time there


class FreePattern(NamedTuple):
    """A pattern of one drone relative to the area.

    Attributes:
        kind: of the pattern, one of `KINDS`.
        moving: whether its points move with the mean drift.
        side: 1 if the drone turns to starboard, -1 if to port.
        parameters: the centre (x, y), the heading, and the logarithms of the legs' length, of the
            width and of the spacing, relative to what is usual: float64, (6,).
    """

    kind: str
    moving: bool
    side: int
    parameters: Floats


FreePatterns = tuple[FreePattern, ...]
"""A pattern for each drone."""


class Boxes(NamedTuple):
    """One rectangle, divided into adjacent boxes with parallel legs, one for each drone.

    Attributes:
        abreast: whether boxes lie beside each other, with legs along their common sides; else
            they lie end to end.
        moving: whether they move with the mean drift.
        side: 1 if all drones turn to starboard first, -1 if to port.
        parameters: the centre (x, y) of the rectangle, the heading of the first legs, and the
            logarithms of the rectangle's length, along the legs, of its width, and of the spacing,
            relative to what is usual: float64, (6,).
        order: of the drones in the boxes; empty for that of their numbers.
    """

    abreast: bool
    moving: bool
    side: int
    parameters: Floats
    order: tuple[int, ...] = ()


Shape = Boxes | FreePatterns | Worksheet
"""The patterns of all drones, relative to an area."""


@dataclass(frozen=True, eq=False)
class Rectangle:
    """Where a pattern, or the boxes of all drones, lie; in metres.

    Attributes:
        centre: at take-off, (east, north).
        heading: of the first leg, in radians clockwise from north.
        side: 1 if drones creep to starboard of the first leg, -1 if to port.
        length: along the legs.
        width: across them.
        spacings: between those of each drone: float64, (n,).
        drift: of all points, (east, north) in m/s.
    """

    centre: Floats
    heading: float
    side: int
    length: float
    width: float
    spacings: Floats
    drift: Floats

    @property
    def along(self) -> Floats:
        """The unit vector along the first leg."""
        return np.array([np.sin(self.heading), np.cos(self.heading)])

    @property
    def aside(self) -> Floats:
        """The unit vector to the side to which drones creep."""
        right = np.array([np.cos(self.heading), -np.sin(self.heading)])
        return right * self.side


class _Box(NamedTuple):
    """The part of a rectangle that one drone searches, with legs along it."""

    start: Floats
    length: float
    legs: int


def _beside_each_other(rectangle: Rectangle, shares: Floats, spacings: Floats) -> list[_Box]:
    """Boxes across the legs, of whole tracks, at least one in each."""
    usual = spacings.mean()
    width = max(round(rectangle.width / usual), len(shares)) * usual
    edges = np.append(0.0, shares.cumsum()) * width
    last = np.rint(edges[1:] / spacings)
    legs = np.maximum(last - np.rint(edges[:-1] / spacings), 1).astype(np.int64)
    begins = np.append(0.0, (legs * spacings).cumsum())
    corner = rectangle.centre - rectangle.along * rectangle.length / 2
    corner = corner - rectangle.aside * begins[-1] / 2
    firsts = begins[:-1] + spacings / 2
    return [
        _Box(corner + rectangle.aside * first, rectangle.length, count)
        for first, count in zip(firsts.tolist(), legs.tolist(), strict=True)
    ]


def _end_to_end(rectangle: Rectangle, shares: Floats, spacings: Floats) -> list[_Box]:
    """Boxes along the legs, which end half a spacing inside of them."""
    edges = np.append(0.0, shares.cumsum()) * rectangle.length
    side = rectangle.centre - rectangle.along * rectangle.length / 2
    boxes = []
    for (begin, end), spacing in zip(pairwise(edges.tolist()), spacings.tolist(), strict=True):
        tracks = max(round(rectangle.width / spacing), 1)
        corner = side - rectangle.aside * (tracks - 1) * spacing / 2
        start = corner + rectangle.along * (begin + spacing / 2)
        length = max(end - begin - spacing, spacing)
        boxes.append(_Box(start, length, tracks))
    return boxes


class Area:
    """Where persons may be during the flights, and what patterns there would find.

    Args:
        incident: the incident.
        particles: possible persons in it.
    """

    def __init__(self, incident: Incident, particles: Particles) -> None:
        self.incident = incident
        self.particles = particles
        self.drones = [drone_in_wind(incident, number) for number in range(len(incident.craft))]
        self.coast = Coast(incident)
        self._start = incident.seconds(incident.start)
        half = incident.airborne / 2
        weights = particles.weights
        self._away = particles.mean(self._start + 2 * half) - particles.mean(self._start)
        positions = particles.at(self._start + half)
        self.middle = weights @ positions
        off = positions - self.middle
        self._root = np.linalg.cholesky((weights * off.T) @ off + np.eye(2))
        self.swaths = np.array([particles.usual_of(drone.craft.swath) for drone in self.drones])
        speeds = np.array([drone.airspeed for drone in self.drones])
        airborne = np.array([drone.endurance for drone in self.drones])
        self._sizes = np.sqrt(self.swaths * speeds * SEARCHED_TWICE * airborne / 2)
        self._sweeping = self.swaths * speeds

    def first(self, count: int) -> Area:
        """The same with the first particles only; shapes mean the same in it."""
        few = copy.copy(self)
        few.particles = self.particles.first(count)
        return few

    # Patterns.

    def _rectangle(self, shape: FreePattern | Boxes, size: float, swaths: Floats) -> Rectangle:
        """What the parameters of a shape mean.

        Args:
            shape: of one drone, or of all.
            size: the usual side of its rectangle.
            swaths: of the drones that search it.
        """
        x, y, heading, length, width, spacing = shape.parameters
        heading = heading * np.pi / 2 % (2 * np.pi)
        return Rectangle(
            centre=self.middle + self._root @ [x, y] - self._away / 2 * shape.moving,
            heading=float(heading),
            side=shape.side,
            length=max(float(size * np.exp(np.clip(length / 2, -3.0, 2.0))), swaths.mean()),
            width=float(size * np.exp(np.clip(width / 2, -3.0, 2.0))),
            spacings=swaths * np.exp(np.clip(0.2 * spacing, -1.0, 1.0)),
            drift=self._away / self.incident.airborne * shape.moving,
        )

    def pattern(self, number: int, free: FreePattern) -> Pattern:
        """The pattern of one drone."""
        frame = self._rectangle(free, self._sizes[number], self.swaths[[number]])
        (spacing,) = frame.spacings.tolist()
        legs = 1
        start = frame.centre
        if free.kind == PARALLEL:
            legs = max(round(frame.width / spacing), 1)
            begin = frame.centre - frame.along * frame.length / 2
            start = begin - frame.aside * (legs - 1) * spacing / 2
        pattern = Pattern(
            kind=free.kind,
            start=start,
            heading=frame.heading,
            length=frame.length,
            spacing=spacing,
            legs=legs,
            side=free.side,
            drift=frame.drift,
        )
        return self._at_take_off(number, pattern)

    def _at_take_off(self, number: int, pattern: Pattern, *, reverse: bool = False) -> Pattern:
        """A pattern of the first take-off where it is at that of a drone; or the reverse."""
        later = self.drones[number].take_off - self._start
        if reverse:
            later = -later
        return replace(pattern, start=pattern.start + pattern.drift * later)

    def boxes(self, boxes: Boxes) -> list[Pattern]:
        """The pattern of each drone in its box."""
        size = float(np.sqrt((self._sizes**2).sum()))
        rectangle = self._rectangle(boxes, size, self.swaths)
        return self.divided(rectangle, boxes.abreast, boxes.order)

    def divided(
        self, rectangle: Rectangle, abreast: bool, order: Sequence[int] = ()
    ) -> list[Pattern]:
        """The pattern of each drone in its box of a rectangle.

        Boxes are as large as what their drones can sweep there. Legs end half a spacing inside of
        them, so that the strips of neighbours adjoin.

        Args:
            rectangle: to divide.
            abreast: see `Boxes`.
            order: of the drones, see `Boxes`.
        """
        layout = _beside_each_other if abreast else _end_to_end
        numbers = np.array(order or range(len(self.drones)))
        spacings = rectangle.spacings[numbers]
        shares = self._shares_of(rectangle, abreast, numbers)
        patterns = {}
        for number, spacing, box in zip(
            numbers.tolist(), spacings.tolist(), layout(rectangle, shares, spacings), strict=True
        ):
            pattern = Pattern(
                kind=PARALLEL,
                start=box.start,
                heading=rectangle.heading,
                length=box.length,
                spacing=spacing,
                legs=box.legs,
                side=rectangle.side,
                drift=rectangle.drift,
            )
            patterns[number] = self._at_take_off(number, pattern)
        return [patterns[number] for number in range(len(self.drones))]

    def _shares_of(self, rectangle: Rectangle, abreast: bool, order: Ints) -> Floats:
        """The shares of drones in a rectangle, by what each can sweep in an equal part of it."""
        n = len(order)
        across = rectangle.aside * rectangle.width
        way = across if abreast else rectangle.along * rectangle.length
        parts = (np.arange(n)[:, None] + 0.5) / n - 0.5
        middles = rectangle.centre + parts * way
        times = [
            self.drones[number].time_around(middle)
            for number, middle in zip(order, middles, strict=True)
        ]
        least = LEAST_SHARE * max(max(times), 1.0)
        swept = np.maximum(times, least) * self._sweeping[order] / self._sweeping.mean()
        shares: Floats = swept / swept.sum()
        return shares

    def patterns(self, shape: Shape) -> list[Pattern]:
        """The pattern of each drone."""
        if isinstance(shape, Boxes):
            return self.boxes(shape)
        if isinstance(shape, Worksheet):
            return self.manual(shape)
        return [self.pattern(number, free) for number, free in enumerate(shape)]

    def manual(self, sheet: Worksheet) -> list[Pattern]:
        """The rectangle of the manual's worksheets, divided into boxes.

        Boxes lie beside each other along the longer side. The first corner is the nearest to the
        base.
        """
        length, width = sheet.sides
        choices = []
        for turn in (0.0, np.pi):
            for side in (-1, 1):
                rectangle = Rectangle(
                    centre=sheet.middle,
                    heading=(sheet.heading + turn) % (2 * np.pi),
                    side=side,
                    length=length,
                    width=width,
                    spacings=sheet.spacing * self.swaths / self.swaths.mean(),
                    drift=np.zeros(2),
                )
                choices.append(self.divided(rectangle, abreast=True))
        base = self.drones[0].base
        return min(choices, key=lambda patterns: np.hypot(*(patterns[0].start - base)))

    def as_free(self, boxes: Boxes) -> FreePatterns:
        """The same patterns, each on its own."""
        free = []
        for number, pattern in enumerate(self.boxes(boxes)):
            pattern = self._at_take_off(number, pattern, reverse=True)
            width = pattern.legs * pattern.spacing
            along = np.array([np.sin(pattern.heading), np.cos(pattern.heading)])
            aside = along[::-1] * [1, -1] * pattern.side
            to_centre = along * pattern.length + aside * (width - pattern.spacing)
            centre = pattern.start + to_centre / 2
            x, y = np.linalg.solve(self._root, centre - self.middle + self._away / 2 * boxes.moving)
            heading = pattern.heading / (np.pi / 2)
            length = 2 * np.log(pattern.length / self._sizes[number])
            across = 2 * np.log(width / self._sizes[number])
            parameters = np.array([x, y, heading, length, across, boxes.parameters[5]])
            free.append(FreePattern(PARALLEL, boxes.moving, boxes.side, parameters))
        return tuple(free)

    # What they find.

    def missed(self, drone: DroneInWind, pattern: Pattern) -> Floats | None:
        """The probability that a drone misses each particle.

        None if it cannot fly the pattern, or if all of that is over land.
        """
        if not self._is_at_sea(pattern):
            return None
        flown = drone.fly(pattern)
        if flown is None:
            return None
        points = flown.points + [drone.take_off, 0.0, 0.0]
        legs = np.stack([points[:-1], points[1:]], axis=1)[drone.searches(flown)]
        return self.particles.missed(legs, drone.craft)

    def missed_by(self, number: int, free: FreePattern) -> Floats | None:
        """`missed` of a drone by its number, with a free pattern."""
        return self.missed(self.drones[number], self.pattern(number, free))

    @property
    def is_uniform(self) -> bool:
        """Whether all drones can do the same, so that their order does not matter."""
        able = {replace(drone.craft, name="", altitude=0.0) for drone in self.drones}
        return len(able) == 1

    def _is_at_sea(self, pattern: Pattern) -> bool:
        """Whether a part of the pattern's first lap is at sea: the search can begin there."""
        if not self.coast.is_known:
            return True
        legs = 2 * pattern.legs if pattern.kind == PARALLEL else LONGEST_TRACK
        track = pattern.points(min(legs, LONGEST_TRACK) + 1)
        length = distances_along(track)[-1]
        points = point_along(track, np.linspace(0.0, length, POINTS_TRIED))
        return bool(self.coast.is_sea_as_read(points).any())

    def left(self, shape: Shape) -> float:
        """The probability that all drones miss the person; 1 if one cannot fly its pattern."""
        left = self.particles.weights
        for drone, pattern in zip(self.drones, self.patterns(shape), strict=True):
            missed = self.missed(drone, pattern)
            if missed is None:
                return 1.0
            left = left * missed
        return float(left.sum())
