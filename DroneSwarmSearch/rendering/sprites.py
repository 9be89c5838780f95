"""The symbols, drawn from above as smooth shapes on transparent squares.

Every function returns a surface that is kept and shared: blit it, do not draw on it.
Small symbols are plain glyphs: a drone an X, a person a ring around a dot, a found
person a disc with a tick.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.palette import GREY, INK, WHITE, Colour

__all__ = ["arrow", "burst", "drone", "lettering", "person", "search_mark"]

PLAIN_DRONE_BELOW = 18
PLAIN_PERSON_BELOW = 24
"""Sizes in pixels below which symbols are plain glyphs."""

RIM_FROM = 13
DETAILED_FROM = 40
"""Sizes in pixels from which a plain drone has a light rim, and a person more than a
head."""

ROTOR_AT = 0.60
ROTOR_RADIUS = 0.40
BODY_RADIUS = 0.44
ARM_WIDTH = 0.14
"""Of a drone, in half sizes."""

STOUT_BELOW = 60
STOUT_BODY_RADIUS = 0.58
"""Smaller drones have a larger body, in front of the rotors: room for colour and number."""

WATER: Colour = (28, 98, 176)
BUOY: Colour = (255, 112, 32)
SKIN: Colour = (255, 214, 178)
SAFE: Colour = (22, 74, 150)

_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
_SMALL_SUPERSAMPLING = 8
_LARGE_SUPERSAMPLING = 4
_LARGE_FROM = 64
LETTER_SUPERSAMPLING = 4


class _Pen:
    """Draws enlarged, so that scaling down smooths the edges.

    Coordinates and lengths are in half sizes: (-1, -1) is the upper left corner of the
    symbol, (0, 0) its middle.
    """

    def __init__(self, size: int, edge: Colour) -> None:
        """A blank square of `size` pixels; `edge` is the outermost colour to be drawn."""
        self._size = size
        factor = _LARGE_SUPERSAMPLING if size >= _LARGE_FROM else _SMALL_SUPERSAMPLING
        self._half = size * factor / 2
        self._surface = pygame.Surface((size * factor,) * 2, pygame.SRCALPHA, 32)
        # Scaling averages colours without regard to opacity: transparent black would
        # leave a dark fringe.
        self._surface.fill((*edge, 0))

    @property
    def pixel(self) -> float:
        """The length of a pixel of the finished symbol."""
        return 2 / self._size

    def _place(self, point: tuple[float, float]) -> tuple[float, float]:
        return (1 + point[0]) * self._half, (1 + point[1]) * self._half

    def disc(
        self, centre: tuple[float, float], radius: float, colour: Colour, alpha: int = 255
    ) -> None:
        """A filled circle."""
        pygame.draw.circle(
            self._surface, (*colour, alpha), self._place(centre), radius * self._half
        )

    def shape(self, points: Sequence[tuple[float, float]], colour: Colour) -> None:
        """A filled polygon."""
        pygame.draw.polygon(self._surface, colour, [self._place(point) for point in points])

    def stroke(self, points: Sequence[tuple[float, float]], width: float, colour: Colour) -> None:
        """A line through points, with round ends and corners."""
        for (x0, y0), (x1, y1) in pairwise(points):
            length = math.hypot(x1 - x0, y1 - y0)
            dx, dy = (x1 - x0) / length * width / 2, (y1 - y0) / length * width / 2
            self.shape(
                [(x0 - dy, y0 + dx), (x0 + dy, y0 - dx), (x1 + dy, y1 - dx), (x1 - dy, y1 + dx)],
                colour,
            )
        for point in points:
            self.disc(point, width / 2, colour)

    def finish(self) -> pygame.Surface:
        """The symbol in its own size."""
        return pygame.transform.smoothscale(self._surface, (self._size, self._size))


@lru_cache(maxsize=2048)
def lettering(text: str, size: int, colour: Colour) -> pygame.Surface:
    """A line of text in the font that ships with pygame; `size` as its fonts count it."""
    # Kept are the drawn lines, not the font: pygame.font.quit(), which any other user of
    # pygame may call, makes fonts unusable but leaves surfaces alone.
    if not pygame.font.get_init():
        pygame.font.init()
    # Drawn enlarged and scaled down, letters keep their shapes and distances; drawn
    # small, they are bent to whole pixels.
    large = pygame.font.Font(None, size * LETTER_SUPERSAMPLING).render(text, True, colour)
    width, height = (round(side / LETTER_SUPERSAMPLING) for side in large.get_size())
    return pygame.transform.smoothscale(large, (width, height))


@lru_cache(maxsize=512)
def drone(size: int, colour: Colour) -> pygame.Surface:
    """A quadcopter: four rotors on crossed arms around a round body."""
    if size < PLAIN_DRONE_BELOW:
        return _plain_drone(size, colour)
    pen = _Pen(size, WHITE)
    rotors = [(ROTOR_AT * x, ROTOR_AT * y) for x, y in _CORNERS]
    rim, line = 1.2 * pen.pixel, max(1.1 * pen.pixel, 0.035)
    body = STOUT_BODY_RADIUS if size < STOUT_BELOW else BODY_RADIUS
    # Outside in: a light rim for dark ground, a dark outline for light ground, the drone.
    for inset, paint in ((0.0, WHITE), (rim, INK)):
        for rotor in rotors:
            pen.disc(rotor, ROTOR_RADIUS - inset, paint)
            pen.stroke([(0, 0), rotor], ARM_WIDTH - 2 * inset + 2 * rim, paint)
        pen.disc((0, 0), body - inset, paint)
    for rotor in rotors:
        _rotor(pen, rotor, ROTOR_RADIUS - rim - line, colour, size >= STOUT_BELOW)
    pen.disc((0, 0), body - rim, INK)
    pen.disc((0, 0), body - rim - line, colour)
    return pen.finish()


def _rotor(
    pen: _Pen, at: tuple[float, float], radius: float, colour: Colour, detailed: bool
) -> None:
    """A rotor disc, with its blades if it is large enough for them."""
    pen.disc(at, radius, colour)
    if not detailed:
        return
    r, g, b = ((2 * channel + 3 * 255) // 5 for channel in colour)
    pen.disc(at, radius * 0.84, (r, g, b))
    dx, dy = 0.72 * radius * math.cos(0.6), 0.72 * radius * math.sin(0.6)
    pen.stroke([(at[0] - dx, at[1] + dy), (at[0] + dx, at[1] - dy)], 0.2 * radius, INK)
    pen.disc(at, 0.2 * radius, INK)


def _plain_drone(size: int, colour: Colour) -> pygame.Surface:
    """An X with a dark outline, and a light rim where there is room for one."""
    rimmed = size >= RIM_FROM
    pen = _Pen(size, WHITE if rimmed else INK)
    rim = pen.pixel if rimmed else 0.0
    width, reach = 0.84, 0.56
    for inset, paint in ((0.0, WHITE), (rim, INK), (rim + 0.8 * pen.pixel, colour)):
        for x, y in _CORNERS[:2]:
            ends = [(reach * x, reach * y), (-reach * x, -reach * y)]
            pen.stroke(ends, width - 2 * inset, paint)
    return pen.finish()


@lru_cache(maxsize=64)
def person(size: int, found: bool) -> pygame.Surface:
    """Somebody in the water: in a life ring while missing, ticked off once found."""
    if size < PLAIN_PERSON_BELOW:
        return _plain_person(size, found)
    pen = _Pen(size, WHITE)
    line = max(1.2 * pen.pixel, 0.04)
    pen.disc((0, 0), 1.0, WHITE)
    pen.disc((0, 0), 1.0 - 1.2 * pen.pixel, INK)
    outer, inner = 1.0 - 1.2 * pen.pixel - line, 0.60
    if found:
        pen.disc((0, 0), outer, WHITE)
        pen.disc((0, 0), 0.74, SAFE)
        pen.stroke(_TICK, 0.20, WHITE)
        return pen.finish()
    pen.disc((0, 0), outer, WHITE)
    for quarter in range(4):
        _segment(pen, outer, math.pi / 4 + quarter * math.pi / 2)
    pen.disc((0, 0), inner + line * 0.8, INK)
    pen.disc((0, 0), inner, WATER)
    if size >= DETAILED_FROM:
        for side in (-1, 1):
            pen.stroke([(0.2 * side, 0.2), (0.36 * side, -0.26)], 0.13, SKIN)
        pen.stroke([(-0.17, 0.26), (0.17, 0.26)], 0.3, BUOY)
        pen.disc((0, -0.08), 0.24, INK)
        pen.disc((0, -0.08), 0.2, SKIN)
    else:
        pen.disc((0, 0), 0.34, SKIN)
    return pen.finish()


_TICK = ((-0.36, 0.04), (-0.09, 0.30), (0.38, -0.28))


def _segment(pen: _Pen, radius: float, middle: float) -> None:
    """One of the four coloured parts of a life ring, around the angle `middle`."""
    angles = [middle + math.radians(turn) for turn in range(-24, 25, 4)]
    arc = [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]
    pen.shape([(0, 0), *arc], BUOY)


def _plain_person(size: int, found: bool) -> pygame.Surface:
    """A white ring around an orange dot; a white disc with a tick once found."""
    pen = _Pen(size, INK)
    pen.disc((0, 0), 1.0, INK)
    pen.disc((0, 0), 1.0 - 1.1 * pen.pixel, WHITE)
    if found:
        pen.stroke([(1.15 * x, 1.15 * y) for x, y in _TICK], 0.30, SAFE)
    else:
        pen.disc((0, 0), 0.56, INK)
        pen.disc((0, 0), 0.46, BUOY)
    return pen.finish()


@lru_cache(maxsize=64)
def search_mark(size: int) -> pygame.Surface:
    """The circle of light around a drone that searches."""
    pen = _Pen(size, INK)
    line = 1.1 * pen.pixel
    ring = max(2.0 * pen.pixel, 0.05)
    pen.disc((0, 0), 1.0, INK)
    pen.disc((0, 0), 1.0 - line, WHITE)
    pen.disc((0, 0), 1.0 - line - ring, INK)
    pen.disc((0, 0), 1.0 - 2 * line - ring, (226, 244, 255), 150)
    return pen.finish()


@lru_cache(maxsize=64)
def burst(size: int) -> pygame.Surface:
    """The star behind drones that have collided."""
    pen = _Pen(size, INK)
    for reach, paint in ((1.0, INK), (1.0 - 2.2 * pen.pixel, (255, 236, 140))):
        points = []
        for spike in range(24):
            radius = reach if spike % 2 == 0 else 0.72 * reach
            angle = math.pi * spike / 12
            points.append((radius * math.cos(angle), radius * math.sin(angle)))
        pen.shape(points, paint)
    return pen.finish()


@lru_cache(maxsize=64)
def arrow(size: int, vector: tuple[float, float]) -> pygame.Surface:
    """A compass with the drift as an arrow: longer for faster, up to a cell per step."""
    pen = _Pen(size, GREY)
    pen.disc((0, 0), 1.0, GREY)
    pen.disc((0, 0), 1.0 - 1.2 * pen.pixel, WHITE)
    for east, south in ((0, -1), (1, 0), (0, 1), (-1, 0)):
        pen.stroke(
            [(0.84 * east, 0.84 * south), (0.92 * east, 0.92 * south)], 1.4 * pen.pixel, GREY
        )
    speed = math.hypot(*vector)
    if speed == 0.0:
        pen.disc((0, 0), 0.1, INK)
        return pen.finish()
    angle = math.atan2(vector[1], vector[0])
    x, y = math.cos(angle), math.sin(angle)
    reach = 0.34 + 0.40 * min(1.0, speed)
    neck = reach - 0.30
    pen.stroke([(-reach * x, -reach * y), (neck * x, neck * y)], 0.12, WATER)
    wing = 0.22
    pen.shape(
        [
            (reach * x, reach * y),
            (neck * x - wing * y, neck * y + wing * x),
            (neck * x + wing * y, neck * y - wing * x),
        ],
        WATER,
    )
    return pen.finish()
