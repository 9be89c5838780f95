"""Drones and persons on the board, so placed that all of them can be seen."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.layout import LEFT, TOP, Layout
from DroneSwarmSearch.rendering.palette import Colour, drone_colour, readable_on
from DroneSwarmSearch.rendering.sprites import STOUT_BELOW, lettering

__all__ = ["draw_symbols", "symbol_side"]

SYMBOL_SHARE = 0.92
SEARCHING_SHARE = 0.76
"""Side of a symbol, as shares of its room; of a drone with the circle of searching."""

SMALL_SHARE, SMALL_MOST = 1.15, 16
"""In small cells symbols are larger than their room, up to so many pixels."""

PAIR_SHARE = 0.58
"""Side of the room of either symbol where two share a cell, as a share of the cell's."""

DRONE_LEAST, PERSON_LEAST, SYMBOL_MOST = 9, 11, 160
LEAST_APART = 8
"""In pixels; symbols are never smaller or nearer, even if they then overlap their cell."""

MARK_MARGIN = 9
"""How much larger than a drone its circle of searching is, in pixels."""

BURST_MARGIN = 1.5
"""What the star has around the drones, in their sides."""

NUMBER_FROM = 24
"""A drone of at least this many pixels carries its number."""

STOUT_NUMBER = (0.68, 0.62, 0.46)
SLIM_NUMBER = (0.48, 0.44, 0.34)
"""Font size of a drone's number of one, two or three digits, as shares of its side."""

Point = tuple[float, float]


@dataclass
class _Crowd:
    """What stands in a cell.

    Attributes:
        drones: number of each, and whether it searches.
        persons: whether each has been found.
        places: where they stand in the picture, drones first.
        room: side of the square that each of them has, in pixels.
    """

    drones: list[tuple[int, bool]] = field(default_factory=list)
    persons: list[bool] = field(default_factory=list)
    places: list[Point] = field(default_factory=list)
    room: float = 0.0


def draw_symbols(canvas: pygame.Surface, frame: Frame, layout: Layout) -> None:
    """Draws the drones and persons of a frame; those in one cell share its room."""
    crowds = _crowds(frame, layout)
    canvas.set_clip((LEFT - 2, TOP - 2, layout.board + 4, layout.board + 4))
    # Marks lie below all symbols: in small cells they reach into the next ones.
    for crowd in crowds:
        _draw_marks(canvas, crowd)
    for crowd in crowds:
        _draw_drones(canvas, crowd)
    for crowd in crowds:
        _draw_persons(canvas, crowd)
    canvas.set_clip(None)


def symbol_side(pitch: float) -> int:
    """Side of a drone alone in a cell, both in pixels."""
    return _side(SYMBOL_SHARE, pitch, DRONE_LEAST)


def _crowds(frame: Frame, layout: Layout) -> list[_Crowd]:
    """What stands in each cell that is not empty, with its places."""
    crowds: dict[tuple[int, int], _Crowd] = {}
    drones = zip(frame.drones, frame.searching, strict=True)
    for number, (cell, searches) in enumerate(drones):
        crowds.setdefault(cell, _Crowd()).drones.append((number, searches))
    for cell, found in zip(frame.persons, frame.found, strict=True):
        crowds.setdefault(cell, _Crowd()).persons.append(found)
    for cell, crowd in crowds.items():
        count = len(crowd.drones) + len(crowd.persons)
        crowd.places, crowd.room = _share(layout.centre(*cell), layout.pitch, count)
    return list(crowds.values())


def _share(centre: Point, pitch: float, count: int) -> tuple[list[Point], float]:
    """Places for symbols in one cell, and the side of the room of each, in pixels.

    One stands in the middle, two on the diagonal, more in a square.
    """
    if count == 1:
        return [centre], pitch
    along = math.ceil(math.sqrt(count))
    room = pitch * (PAIR_SHARE if count == 2 else 1 / along)
    apart = max((pitch - room) / (along - 1), LEAST_APART)
    slots = [(0, 0), (1, 1)] if count == 2 else [divmod(n, along)[::-1] for n in range(count)]
    left, top = (middle - apart * (along - 1) / 2 for middle in centre)
    return [(left + apart * column, top + apart * row) for column, row in slots], room


def _draw_marks(canvas: pygame.Surface, crowd: _Crowd) -> None:
    """The star behind drones in the same cell, the circle around one that searches."""
    colliding = crowd.places[: len(crowd.drones)]
    if len(colliding) > 1:
        lefts, tops = zip(*colliding, strict=True)
        middle = ((min(lefts) + max(lefts)) / 2, (min(tops) + max(tops)) / 2)
        spread = max(max(lefts) - min(lefts), max(tops) - min(tops))
        side = spread + BURST_MARGIN * _side(SYMBOL_SHARE, crowd.room, DRONE_LEAST)
        _blit_centred(canvas, sprites.burst(round(side)), middle)
    for (_, searches), place in zip(crowd.drones, crowd.places, strict=False):
        if searches:
            drone = _side(SEARCHING_SHARE, crowd.room, DRONE_LEAST)
            side = max(drone / SEARCHING_SHARE, drone + MARK_MARGIN)
            _blit_centred(canvas, sprites.search_mark(round(side)), place)


def _draw_drones(canvas: pygame.Surface, crowd: _Crowd) -> None:
    for (number, searches), place in zip(crowd.drones, crowd.places, strict=False):
        colour = drone_colour(number)
        share = SEARCHING_SHARE if searches else SYMBOL_SHARE
        side = _side(share, crowd.room, DRONE_LEAST)
        _blit_centred(canvas, sprites.drone(side, colour), place)
        if side >= NUMBER_FROM:
            _blit_centred(canvas, _number(number, side, colour), place)


def _draw_persons(canvas: pygame.Surface, crowd: _Crowd) -> None:
    side = _side(SYMBOL_SHARE, crowd.room, PERSON_LEAST)
    places = crowd.places[len(crowd.drones) :]
    for found, place in zip(crowd.persons, places, strict=True):
        _blit_centred(canvas, sprites.person(side, found), place)


def _number(number: int, side: int, colour: Colour) -> pygame.Surface:
    """The number of a drone, as large as its body allows."""
    shares = STOUT_NUMBER if side < STOUT_BELOW else SLIM_NUMBER
    font = round(side * shares[min(len(str(number)), len(shares)) - 1])
    return lettering(f"{number}", font, readable_on(colour))


def _side(share: float, room: float, least: int) -> int:
    """The side of a symbol in whole pixels: a share of its room, within the limits."""
    small = min(round(SMALL_SHARE * room), SMALL_MOST)
    return min(max(round(share * room), small, least), SYMBOL_MOST)


def _blit_centred(canvas: pygame.Surface, image: pygame.Surface, centre: Point) -> None:
    width, height = image.get_size()
    canvas.blit(image, (round(centre[0] - width / 2), round(centre[1] - height / 2)))
