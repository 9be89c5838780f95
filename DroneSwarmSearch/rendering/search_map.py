"""The map: coloured cells with coordinates, searches so far, trails, drones and persons.

Of a large grid, the map shows the part where the search takes place, and a small overview.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.frame import HISTORY_STEPS, TRAIL_STEPS, Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.labels import tick_stride
from DroneSwarmSearch.rendering.palette import (
    CLASSIC,
    FOUND,
    GREY,
    INK,
    NOT_FOUND,
    PROGRESS,
    WHITE,
    Colour,
    Look,
    readable_on,
)
from DroneSwarmSearch.rendering.sprites import text_line, write
from DroneSwarmSearch.rules import Ending, is_success

__all__ = ["BOTTOM", "LEFT", "RIGHT", "TOP", "SearchMap", "outcome_colour"]

# Lengths are in pixels, unless stated otherwise.

LEFT, TOP, RIGHT, BOTTOM = 46, 42, 22, 24
"""Margins around the cells; the first two hold the coordinates."""

WHOLE_MOST = 48
"""Of grids with more cells along a side than this, only a part may be shown."""

PART_LEAST, PART_STEP, PART_MARGIN = 40, 10, 3
"""In cells: the smallest side of a part, the multiple that its place and side are of, and
what is around everything that it must show."""

PART_FROM = 0.02
"""A part contains all cells with at least this share of the maximum of the matrix."""

OVERVIEW_SHARE, OVERVIEW_INSET = 0.2, 10
"""The side of the overview as a share of the map's, and its distance from the corner."""

TICK_ROOM = 26
TICK_FONT = 18

GRID_FINEST = 12
"""Lines closer than this would look like a pattern; only every fifth, tenth, ... is drawn."""

GRID_OPACITY = 0.45
GRID_FULL_FROM = 16
"""The opacity of lines at least this far apart; closer lines are fainter."""

SYMBOL_SHARE = 0.92
SEARCHING_SHARE = 0.76
"""The side of a symbol, and of a drone inside a search ring, as a share of its room."""

SMALL_SHARE, SMALL_MOST = 1.15, 16
"""In small cells, symbols up to this side are larger than their room."""

PAIR_SHARE = 0.58
"""The room of each of two symbols in a cell, as a share of the cell's side."""

DRONE_LEAST, PERSON_LEAST, SYMBOL_MOST = 13, 14, 160
LEAST_APART = 8
"""Limits of sizes and distances, which hold even if symbols then leave their cell."""

RING_MARGIN = 9
"""How much larger than its drone a search ring is."""

COLLISION_MARGIN = 1.5
"""How much larger than its drones the star of a collision is, as a share of a drone."""

NUMBER_FROM = 24
"""Drones of at least this side show their number."""

NUMBER_SHARES = (1.1, 1.0, 0.75)
"""Font sizes of numbers with one, two or three digits, as shares of the drone's body."""

TRAIL_SHARE, TRAIL_LEAST, TRAIL_RIM = 0.13, 3, 1
"""The width of a trail as a share of a cell, its least width, and the rim on both sides."""

TRAIL_OPACITY = 230
"""Of the last move; earlier ones fade."""

SEARCHED_SHARE, SEARCHED_SIZES = 0.3, (5, 14)
"""The mark of a search as a share of a cell, and its limits."""

FADES = 6
"""The opacities of marks that fade."""

FRAME_WIDTH = 5
"""The frame around the cells at the end of an episode."""

Point = tuple[float, float]
Sprite = tuple[pygame.Surface, Point]
"""An image and the place of its middle."""


class Part(NamedTuple):
    """A square part of the grid, in cells."""

    left: float
    top: float
    cells: float

    def towards(self, other: Part, progress: float) -> Part:
        """The part on the way to another one."""
        left, top, cells = (a + (b - a) * progress for a, b in zip(self, other, strict=True))
        return Part(left, top, cells)


class SearchMap:
    """Draws the map of one grid size on surfaces of its `size`.

    Args:
        grid_size: cells along each side.
        look: how the cells are drawn.
        side: the side of all shown cells together in pixels, about; if the whole grid is
            shown, it is rounded so that a cell has whole pixels.

    Attributes:
        side: side of all shown cells together, in pixels.
        size: width and height in pixels, margins included.
        symbol: side of a drone alone in its cell, in pixels, at the largest scale.
    """

    def __init__(self, grid_size: int, look: Look = CLASSIC, *, side: int = 720) -> None:
        self._grid_size = grid_size
        self._look = look
        self.side = side
        if grid_size <= WHOLE_MOST:
            self.side = grid_size * max(1, round(side / grid_size))
        self.size = LEFT + self.side + RIGHT, TOP + self.side + BOTTOM
        finest = self.side / min(grid_size, PART_LEAST)
        self.symbol = _symbol_side(SYMBOL_SHARE, finest, DRONE_LEAST)
        # Of the picture that is being drawn.
        self._canvas: pygame.Surface
        self._part: Part
        self._pitch: float  # the side of a cell in pixels

    def draw(
        self,
        canvas: pygame.Surface,
        frame: Frame,
        *,
        towards: Frame | None = None,
        progress: float = 0.0,
    ) -> None:
        """Draw the map of a frame.

        Args:
            canvas: a surface of `size`, filled with the background.
            frame: a frame of this grid size.
            towards: the next frame, to draw drones and persons on their way.
            progress: the part of the way that lies behind them, 0 to 1.
        """
        self._canvas, self._part = canvas, self._part_of(frame)
        if towards is not None:
            self._part = self._part.towards(self._part_of(towards), progress)
        self._pitch = self.side / self._part.cells
        self._draw_coordinates()
        canvas.set_clip((LEFT, TOP, self.side, self.side))
        self._draw_cells(frame.matrix)
        if self._look.grid:
            self._draw_lines()
        end = frame if towards is None or progress == 0.0 else towards
        drones = _on_the_way(frame.drones, end.drones, progress)
        persons = _on_the_way(frame.persons, end.persons, progress)
        self._draw_trails(frame, drones)
        self._draw_searched(frame)
        canvas.set_clip((LEFT - 2, TOP - 2, self.side + 4, self.side + 4))
        self._draw_symbols(frame, drones, persons, end)
        if self._part.cells < self._grid_size:
            self._draw_overview(frame)
        canvas.set_clip(None)
        if frame.ending is not None:
            self._draw_frame(outcome_colour(frame), FRAME_WIDTH)

    def _part_of(self, frame: Frame) -> Part:
        """The part of the grid that a frame shows: all of it, unless it is large."""
        size = self._grid_size
        if size <= WHOLE_MOST:
            return Part(0.0, 0.0, size)
        maps = [each for each in (frame.matrix, frame.prior) if each is not None]
        rows, columns = np.logical_or.reduce(
            [each >= PART_FROM * each.max() for each in maps]
        ).nonzero()
        persons = (frame.persons[person] for person in _shown_persons(frame))
        cells = [*frame.drones, *persons, *((x, y) for x, y, _ in frame.searched)]
        across = [*(x for x, _ in cells), int(columns.min()), int(columns.max())]
        down = [*(y for _, y in cells), int(rows.min()), int(rows.max())]
        extents = [(min(along), max(along) + 1) for along in (across, down)]
        need = max(high - low for low, high in extents) + 2 * PART_MARGIN
        count = min(max(math.ceil(need / PART_STEP) * PART_STEP, PART_LEAST), size)
        corner: list[int] = []
        for low, high in extents:
            middle = (low + high - count) / 2
            left = round(middle / PART_STEP) * PART_STEP
            if left > low or left + count < high:  # rounding has cut something off
                left = round(middle)
            corner.append(min(max(left, 0), size - count))
        left, top = corner
        return Part(left, top, count)

    def _at(self, x: float, y: float) -> Point:
        """The pixel of a point of the grid, in cells from its upper left corner."""
        part = self._part
        return LEFT + (x - part.left) * self._pitch, TOP + (y - part.top) * self._pitch

    def _centre(self, x: float, y: float) -> Point:
        """The middle of a cell in pixels."""
        return self._at(x + 0.5, y + 0.5)

    # Cells.

    def _draw_frame(self, colour: Colour, width: int) -> None:
        """A frame around the cells."""
        outer = self.side + 2 * width
        place = (LEFT - width, TOP - width, outer, outer)
        pygame.draw.rect(self._canvas, colour, place, width=width)

    def _draw_coordinates(self) -> None:
        canvas, side, part = self._canvas, self.side, self._part
        self._draw_frame(INK, 1)
        stride = tick_stride(TICK_ROOM, self._pitch)
        for low, horizontal in ((part.left, True), (part.top, False)):
            first = math.ceil(low / stride) * stride
            for cell in range(first, math.ceil(low + part.cells - 0.5), stride):
                across, down = self._centre(cell, cell)
                if horizontal:
                    place = {"midbottom": (round(across), TOP - 7)}
                else:
                    place = {"midright": (LEFT - 8, round(down))}
                write(canvas, f"{cell}", TICK_FONT, GREY, **place)
        write(canvas, "x", TICK_FONT, INK, topleft=(LEFT + side + 8, TOP - 20))
        write(canvas, "y", TICK_FONT, INK, topleft=(LEFT - 16, TOP + side + 5))

    def _colours(self, matrix: NDArray[np.float32]) -> pygame.Surface:
        """An image with a pixel per cell."""
        colours = self._look.colours(matrix)
        return pygame.image.frombuffer(colours.tobytes(), matrix.shape[::-1], "RGB")

    def _draw_cells(self, matrix: NDArray[np.float32]) -> None:
        left, top, count = self._part
        first_x, first_y = math.floor(left), math.floor(top)
        last_x, last_y = math.ceil(left + count), math.ceil(top + count)
        cells = self._colours(matrix).subsurface(
            (first_x, first_y, last_x - first_x, last_y - first_y)
        )
        x, y = self._at(first_x, first_y)
        right, bottom = self._at(last_x, last_y)
        size = round(right) - round(x), round(bottom) - round(y)
        scale = pygame.transform.scale if self._pitch >= 1.0 else pygame.transform.smoothscale
        self._canvas.blit(scale(cells, size), (round(x), round(y)))

    def _draw_lines(self) -> None:
        side, part = self.side, self._part
        stride = tick_stride(GRID_FINEST, self._pitch)
        opacity = GRID_OPACITY * min(1.0, stride * self._pitch / GRID_FULL_FROM)
        lines = pygame.Surface((side, side), pygame.SRCALPHA, 32)
        colour = (*GREY, round(255 * opacity))
        for low, horizontal in ((part.left, False), (part.top, True)):
            first = math.floor(low / stride + 1) * stride
            for cell in range(first, math.ceil(low + part.cells), stride):
                at = round((cell - low) * self._pitch)
                lines.fill(colour, (0, at, side, 1) if horizontal else (at, 0, 1, side))
        self._canvas.blit(lines, (LEFT, TOP))

    def _draw_overview(self, frame: Frame) -> None:
        """The whole grid, in the corner or at the side where it hides the fewest symbols."""
        side = round(OVERVIEW_SHARE * self.side)
        near, far = OVERVIEW_INSET, self.side - side - OVERVIEW_INSET
        middle = (near + far) // 2
        corners = [(near, far), (far, far), (near, near), (far, near)]
        sides = [(middle, far), (near, middle), (far, middle), (middle, near)]
        places = [pygame.Rect(LEFT + x, TOP + y, side, side) for x, y in corners + sides]
        cells = [*frame.drones, *(frame.persons[person] for person in _shown_persons(frame))]
        middles = [self._centre(x, y) for x, y in cells]

        def hidden(place: pygame.Rect) -> int:
            room = place.inflate(self.symbol, self.symbol)
            return sum(room.collidepoint(middle) for middle in middles)

        place = min(places, key=hidden)
        scale = pygame.transform.smoothscale
        self._canvas.blit(scale(self._colours(frame.matrix), place.size), place)
        pygame.draw.rect(self._canvas, WHITE, place.inflate(2, 2), width=1)
        pygame.draw.rect(self._canvas, INK, place.inflate(4, 4), width=1)
        left, top, count = (value * side / self._grid_size for value in self._part)
        shown = pygame.Rect(place.left + left, place.top + top, count + 1, count + 1)
        pygame.draw.rect(self._canvas, WHITE, shown, width=2)
        pygame.draw.rect(self._canvas, INK, shown.inflate(2, 2), width=1)

    # Searches and trails.

    def _draw_searched(self, frame: Frame) -> None:
        """Marks of the last searches, fading; the latest search of a cell counts."""
        least, most = SEARCHED_SIZES
        size = min(max(round(SEARCHED_SHARE * self._pitch), least), most)
        ages = {(x, y): age for x, y, age in frame.searched}
        marks = [
            (sprites.searched(size, opacity), self._centre(*cell))
            for cell, age in ages.items()
            if (opacity := _faded(age / HISTORY_STEPS))
        ]
        _blit_all(self._canvas, marks)

    def _draw_trails(self, frame: Frame, drones: list[Point]) -> None:
        """The drones' last moves, fading, up to where the drones are."""
        side = self.side
        width = max(TRAIL_LEAST, round(TRAIL_SHARE * self._pitch))
        layer = pygame.Surface((side, side), pygame.SRCALPHA, 32)
        for rim in (2 * TRAIL_RIM, 0):
            for number, (trail, at) in enumerate(zip(frame.trails, drones, strict=False)):
                colour = WHITE if rim else self._look.drone(number)
                points: list[Point] = [*trail, at]
                for index, (start, end) in enumerate(pairwise(points)):
                    if start != end:
                        age = len(points) - 2 - index
                        fade = _faded(age / (TRAIL_STEPS + 1)) * TRAIL_OPACITY // 255
                        layer.fill((*colour, fade), self._move(start, end, width).inflate(rim, rim))
        self._canvas.blit(layer, (LEFT, TOP))

    def _move(self, start: Point, end: Point, width: int) -> pygame.Rect:
        """The pixels of a straight move along one axis, relative to the map."""
        (x0, y0), (x1, y1) = self._centre(*start), self._centre(*end)
        left, top = round(min(x0, x1)) - LEFT, round(min(y0, y1)) - TOP
        right, bottom = round(max(x0, x1)) - LEFT, round(max(y0, y1)) - TOP
        half = width // 2
        return pygame.Rect(left - half, top - half, right - left + width, bottom - top + width)

    # Drones and persons.

    def _draw_symbols(
        self,
        frame: Frame,
        drones_at: list[Point],
        persons_at: list[Point],
        end: Frame,
    ) -> None:
        """Drones and persons; those at one place share its room, unless they only pass there."""
        searching = end.searching
        cells: dict[tuple[Point, Point], tuple[list[int], list[int]]] = {}
        for number, way in enumerate(zip(drones_at, end.drones, strict=True)):
            cells.setdefault(way, ([], []))[0].append(number)
        for number in _shown_persons(frame):
            way = persons_at[number], end.persons[number]
            cells.setdefault(way, ([], []))[1].append(number)
        marks: list[Sprite] = []
        symbols: list[Sprite] = []
        for (cell, _), (drones, persons) in cells.items():
            places, room = self._places(cell, len(drones) + len(persons))
            if len(drones) > 1:
                marks.append(_collision(places[: len(drones)], room))
            for drone, place in zip(drones, places, strict=False):
                share = SEARCHING_SHARE if searching[drone] else SYMBOL_SHARE
                side = _symbol_side(share, room, DRONE_LEAST)
                if searching[drone]:
                    ring = max(round(side / SEARCHING_SHARE), side + RING_MARGIN)
                    marks.append((sprites.search_ring(ring), place))
                symbols += self._drone(drone, side, place)
            side = _symbol_side(SYMBOL_SHARE, room, PERSON_LEAST)
            for person, place in zip(persons, places[len(drones) :], strict=True):
                symbols.append((self._person(frame.found_by[person], side), place))
        # Marks lie below all symbols: in small cells they reach into the neighbours.
        _blit_all(self._canvas, marks)
        _blit_all(self._canvas, symbols)

    def _places(self, cell: Point, count: int) -> tuple[list[Point], float]:
        """Middles of the symbols in one cell, and the side of the room of each, in pixels.

        One symbol is in the middle, two are on the diagonal, more form a square.
        """
        centre = self._centre(*cell)
        if count == 1:
            return [centre], self._pitch
        along = math.ceil(math.sqrt(count))
        room = self._pitch * (PAIR_SHARE if count == 2 else 1 / along)
        apart = max((self._pitch - room) / (along - 1), LEAST_APART)
        left, top = (middle - apart * (along - 1) / 2 for middle in centre)
        squares = [(0, 0), (1, 1)] if count == 2 else [divmod(n, along) for n in range(count)]
        return [(left + apart * column, top + apart * row) for row, column in squares], room

    def _drone(self, number: int, side: int, place: Point) -> list[Sprite]:
        """A drone, with its number if it is large enough."""
        colour = self._look.drone(number)
        drawn = [(sprites.drone(side, colour), place)]
        if side >= NUMBER_FROM:
            digits = min(len(str(number)), len(NUMBER_SHARES))
            font = round(side * sprites.body_share(side) * NUMBER_SHARES[digits - 1])
            drawn.append((text_line(f"{number}", font, readable_on(colour)), place))
        return drawn

    def _person(self, found_by: int | None, side: int) -> pygame.Surface:
        if found_by is None:
            return sprites.person(side)
        return sprites.found(side, self._look.drone(found_by))


def outcome_colour(frame: Frame) -> Colour:
    """The colour of an ending: green for success, red for failure, blue for neither."""
    if is_success(frame.ending):
        return FOUND
    # The coverage mission has no person to miss.
    return PROGRESS if frame.ending is Ending.TIME_LIMIT and not frame.persons else NOT_FOUND


def _symbol_side(share: float, room: float, least: int) -> int:
    """The side of a symbol in whole pixels: a share of its room, within the limits."""
    small = min(round(SMALL_SHARE * room), SMALL_MOST)
    return min(max(round(share * room), small, least), SYMBOL_MOST)


def _collision(places: list[Point], room: float) -> Sprite:
    """The star behind drones in one cell."""
    lefts, tops = zip(*places, strict=True)
    middle = ((min(lefts) + max(lefts)) / 2, (min(tops) + max(tops)) / 2)
    spread = max(max(lefts) - min(lefts), max(tops) - min(tops))
    side = spread + COLLISION_MARGIN * _symbol_side(SYMBOL_SHARE, room, DRONE_LEAST)
    return sprites.collision(round(side)), middle


def _blit_all(canvas: pygame.Surface, drawn: Iterable[Sprite]) -> None:
    for image, (x, y) in drawn:
        width, height = image.get_size()
        canvas.blit(image, (round(x - width / 2), round(y - height / 2)))


def _shown_persons(frame: Frame) -> list[int]:
    """The numbers of the persons whom a map may show."""
    return [
        person
        for person, drone in enumerate(frame.found_by)
        if drone is not None or not frame.hide_persons
    ]


def _on_the_way(
    cells: tuple[tuple[int, int], ...], ends: tuple[tuple[int, int], ...], progress: float
) -> list[Point]:
    """Places between cells and those of the next step."""
    return [
        (x0 + (x1 - x0) * progress, y0 + (y1 - y0) * progress)
        for (x0, y0), (x1, y1) in zip(cells, ends, strict=True)
    ]


def _faded(age: float) -> int:
    """The opacity of a mark, 0 to 255, from 0 (new) to 1 (old) in `FADES` steps."""
    return 255 * max(0, FADES - math.floor(age * FADES)) // FADES
