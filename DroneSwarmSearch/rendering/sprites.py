"""The symbols of the map, as smooth vector shapes seen from above, and lines of text.

Every function returns a cached surface that callers share: blit it, do not draw on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import pygame

from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch.rendering.palette import (
    COLLISION,
    GREY,
    INK,
    LIFE_RING,
    SPOTLIGHT,
    WATER,
    WHITE,
    Colour,
    drone_colour,
    readable_on,
)

TEXT_SUPERSAMPLING = 4


class _Pen:
    """Draws a square symbol enlarged; scaling it down smooths the edges.

    Coordinates and lengths are in half sizes: the upper left corner is (-1, -1), the middle (0, 0).
    """

    def __init__(self, size: int, edge: Colour) -> None:
        self.pixel = 2 / size  # of the finished symbol
        self._size = size
        factor = 4 if size >= 64 else 8
        self._half = size * factor / 2
        self._surface = pygame.Surface((size * factor,) * 2, pygame.SRCALPHA, 32)
        # Scaling averages colours regardless of opacity: transparent black would leave a
        # dark fringe.
        self._surface.fill((*edge, 0))

    def disc(self, centre: Pair, radius: float, colour: Colour, alpha: int = 255) -> None:
        pixel = self._pixel(centre)
        pygame.draw.circle(self._surface, (*colour, alpha), pixel, radius * self._half)

    def discs(self, *radii: tuple[float, Colour]) -> None:
        for radius, colour in radii:
            self.disc((0, 0), radius, colour)

    def polygon(self, points: Sequence[Pair], colour: Colour) -> None:
        pygame.draw.polygon(self._surface, colour, [self._pixel(point) for point in points])

    def stroke(self, points: Sequence[Pair], width: float, colour: Colour) -> None:
        pixels = [self._pixel(point) for point in points]
        thickness = round(width * self._half)
        pygame.draw.lines(self._surface, colour, False, pixels, thickness)
        for point in points:
            self.disc(point, width / 2, colour)

    def finish(self) -> pygame.Surface:
        return pygame.transform.smoothscale(self._surface, (self._size, self._size))

    def _pixel(self, point: Pair) -> Pair:
        return (1 + point[0]) * self._half, (1 + point[1]) * self._half


@lru_cache(maxsize=2048)
def text_line(text: str, size: int, colour: Colour) -> pygame.Surface:
    """A line of text in pygame's default font; `size` is pygame's font size."""
    # The cache holds surfaces, not the font: pygame.font.quit() makes fonts unusable.
    if not pygame.font.get_init():
        pygame.font.init()
    # Small glyphs are hinted to whole pixels; glyphs drawn enlarged keep their shapes.
    large = pygame.font.Font(None, size * TEXT_SUPERSAMPLING).render(text, True, colour)
    width, height = (round(side / TEXT_SUPERSAMPLING) for side in large.get_size())
    return pygame.transform.smoothscale(large, (width, height))


def fitted_line(text: str, size: int, width: float, colour: Colour) -> pygame.Surface:
    """A line of text in the given font size, or in a smaller one that fits the width."""
    line = text_line(text, size, colour)
    if line.get_width() > width:
        line = text_line(text, max(1, int(size * width / line.get_width())), colour)
    return line


def write(
    canvas: pygame.Surface, text: str, size: int, colour: Colour, **anchor: tuple[int, int]
) -> pygame.Rect:
    """Write a line of text where an attribute of `pygame.Rect` says, as `midleft=(x, y)`."""
    line = text_line(text, size, colour)
    return canvas.blit(line, line.get_rect(**anchor))


@lru_cache(maxsize=512)
def drone(size: int, number: int) -> pygame.Surface:
    """A drone: a disc in its colour, with its number, a dark outline and a light rim."""
    pen = _Pen(size, WHITE)
    colour = drone_colour(number)
    line = max(1.2 * pen.pixel, 0.05)
    pen.discs((1.0, WHITE), (1.0 - line, INK), (1.0 - 2 * line, colour))
    disc = pen.finish()
    text = fitted_line(f"{number}", round(0.84 * size), 0.76 * size, readable_on(colour))
    disc.blit(text, text.get_rect(center=(size // 2, size // 2)))
    return disc


@lru_cache(maxsize=64)
def person(size: int) -> pygame.Surface:
    """A missing person: a life ring."""
    pen = _Pen(size, INK)
    line = max(pen.pixel, 0.05)
    pen.discs((1.0, INK), (1.0 - line, WHITE))
    for middle in (45, 135, 225, 315):
        arc = [math.radians(angle) for angle in range(middle - 27, middle + 28, 6)]
        edge = [((1 - line) * math.cos(angle), (1 - line) * math.sin(angle)) for angle in arc]
        pen.polygon([(0, 0), *edge], LIFE_RING)
    pen.discs((0.44 + line, INK), (0.44, WATER))
    return pen.finish()


@lru_cache(maxsize=512)
def found(size: int, number: int) -> pygame.Surface:
    """A found person: a tick on a disc in the colour of the drone that made the find."""
    pen = _Pen(size, INK)
    colour = drone_colour(number)
    pen.discs((1.0, INK), (1.0 - pen.pixel, WHITE), (1.0 - 2 * pen.pixel, colour))
    tick = ((-0.396, 0.044), (-0.099, 0.33), (0.418, -0.308))
    pen.stroke(tick, 0.26, readable_on(colour))
    return pen.finish()


@lru_cache(maxsize=64)
def search_ring(size: int) -> pygame.Surface:
    """The bright ring around a drone that searches."""
    pen = _Pen(size, INK)
    line = 1.1 * pen.pixel
    ring = max(2.0 * pen.pixel, 0.05)
    pen.discs((1.0, INK), (1.0 - line, WHITE), (1.0 - line - ring, INK))
    pen.disc((0, 0), 1.0 - 2 * line - ring, SPOTLIGHT, alpha=150)
    return pen.finish()


@lru_cache(maxsize=64)
def halo(size: int) -> pygame.Surface:
    """The disc behind the drone that you fly."""
    pen = _Pen(size, INK)
    pen.discs((1.0, INK), (1.0 - 2.2 * pen.pixel, COLLISION))
    return pen.finish()


@lru_cache(maxsize=512)
def searched(size: int, opacity: int) -> pygame.Surface:
    """The mark of a cell that was searched; `opacity` is from 0 to 255."""
    pen = _Pen(size, INK)
    pen.discs((1.0, INK), (0.66, WHITE))
    mark = pen.finish()
    mark.set_alpha(opacity)
    return mark


@lru_cache(maxsize=64)
def collision(size: int) -> pygame.Surface:
    """The star behind drones that collided."""
    pen = _Pen(size, INK)
    for reach, paint in ((1.0, INK), (1.0 - 2.2 * pen.pixel, COLLISION)):
        radii = [reach, 0.72 * reach] * 12
        angles = [math.pi * spike / 12 for spike in range(24)]
        star = zip(radii, angles, strict=True)
        pen.polygon([(r * math.cos(angle), r * math.sin(angle)) for r, angle in star], paint)
    return pen.finish()


@lru_cache(maxsize=1)
def north(size: int) -> pygame.Surface:
    """The arrow that points to the north, which is up."""
    pen = _Pen(size, INK)
    pen.polygon([(0, -1), (0.75, 1), (0, 0.5), (-0.75, 1)], INK)
    return pen.finish()


@lru_cache(maxsize=64)
def compass(size: int, vector: tuple[float, float]) -> pygame.Surface:
    """The drift as an arrow in a circle: longer for faster, up to a cell per step."""
    pen = _Pen(size, GREY)
    pen.discs((1.0, GREY), (1.0 - 1.2 * pen.pixel, WHITE))
    speed = math.hypot(*vector)
    if speed == 0.0:
        pen.disc((0, 0), 0.1, INK)
        return pen.finish()
    angle = math.atan2(vector[1], vector[0])
    x, y = math.cos(angle), math.sin(angle)
    tip = 0.34 + 0.40 * min(1.0, speed)
    neck = tip - 0.30
    wing = 0.22
    pen.stroke([(-tip * x, -tip * y), (neck * x, neck * y)], 0.12, WATER)
    left = (neck * x - wing * y, neck * y + wing * x)
    right = (neck * x + wing * y, neck * y - wing * x)
    pen.polygon([(tip * x, tip * y), left, right], WATER)
    return pen.finish()
