"""The map: cells with coordinates, searches so far, trails, drones and persons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Pair
from DroneSwarmSearch.core.frame import HISTORY_STEPS, TRAIL_STEPS, Frame
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.rules import Ending, is_success
from DroneSwarmSearch.geo.scale import Scale
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.labels import tick_stride
from DroneSwarmSearch.rendering.palette import (
    FOUND,
    GREY,
    INK,
    LAND,
    LINK,
    NOT_FOUND,
    PROGRESS,
    WHITE,
    Colour,
    Look,
    drone_colour,
)
from DroneSwarmSearch.rendering.sprites import write

# Lengths are in pixels, unless stated otherwise. A share is one of a cell's side.
# margins; the first two hold the coordinates
LEFT = 46
TOP = 42
RIGHT = 22
BOTTOM = 24
TICK_ROOM = 26
KILOMETRE_ROOM = 44
TICK_FONT = 18
NORTH = 14  # the side of the arrow to the north
ENDING_BORDER = 5  # the width of the line around the map at the end of an episode
# closer lines are fainter than this opacity
OPAQUE_FROM = 16
GRID_OPACITY = 0.45
SYMBOL_SHARE = 0.84  # of a symbol
SYMBOL_LEAST = 26  # for a legible number, even if symbols then leave their cell
# In a cell with several symbols: their size in relation to one that is alone, the least size, and
# the distance from the middle of the cell.
SHARED_SIZE = 0.54
SHARED_LEAST = 20
APART_SHARE = 0.27
APART_LEAST = 9
# of a search ring: in relation to its drone, and at least larger
RING_SIZE = 1.2
RING_MARGIN = 8
HALO_SIZE = 1.85  # of the disc behind the drone that you fly, in relation to it
COLLISION_SIZE = 2.5  # of the star of a collision, in relation to a drone
# width; least width; last move
LINK_SHARE = 0.06
TRAIL_SHARE = 0.13
TRAIL_LEAST = 4
TRAIL_OPACITY = 230
# of the mark of a search
SEARCHED_SHARE = 0.25
SEARCHED_LEAST = 6
LAND_OPACITY = 190
FADES = 6  # the opacities of marks that fade
Positions = Sequence[Sequence[float]]
Sprite = tuple[pygame.Surface, Pair]  # an image and its middle


class SearchMap:
    """Draws the map of one grid size on surfaces of its `size`, margins included.

    `side` is the width of all cells together, near the argument, so that cells have whole pixels.
    """

    def __init__(self, grid_size: int, look: Look, *, side: int = 720) -> None:
        self.grid_size = grid_size
        self._look = look
        self.side = grid_size * round(side / grid_size) if grid_size < side else side
        self.size = LEFT + self.side + RIGHT, TOP + self.side + BOTTOM
        self._pitch = self.side / grid_size  # the side of a cell
        self._symbol = max(round(SYMBOL_SHARE * self._pitch), SYMBOL_LEAST)

    def draw(self, canvas: pygame.Surface, frame: Frame, end: Frame, progress: float) -> None:
        """Draw the moment at `progress`, 0 to 1, from a frame to `end`, the next one or itself."""
        drones = _on_the_way(frame.drones, end.drones, progress)
        persons = _on_the_way(frame.persons, end.persons, progress)
        self._draw_border(canvas, INK, 1)
        self._draw_coordinates(canvas, frame.scale)
        self._draw_cells(canvas, frame.matrix)
        self._draw_land(canvas, frame.land)
        if self._look.grid:
            self._draw_lines(canvas)
        self._draw_trails(canvas, frame, drones)
        self._draw_links(canvas, frame, drones)
        self._draw_searched(canvas, frame)
        self._draw_symbols(canvas, frame, end, drones, persons)
        if frame.ending is not None:
            self._draw_border(canvas, outcome_colour(frame), ENDING_BORDER)

    def _centre(self, x: float, y: float) -> Pair:
        """The pixel in the middle of a cell."""
        return LEFT + (x + 0.5) * self._pitch, TOP + (y + 0.5) * self._pitch

    # Cells.

    def _draw_border(self, canvas: pygame.Surface, colour: Colour, width: int) -> None:
        outer = self.side + 2 * width
        area = (LEFT - width, TOP - width, outer, outer)
        pygame.draw.rect(canvas, colour, area, width=width)

    def _draw_coordinates(self, canvas: pygame.Surface, scale: Scale | None) -> None:
        """The numbers of cells; with a scale, kilometres from the grid's corner, and north."""
        right = LEFT + self.side
        # Labels count cells from the middle of the first one, or metres from its edge.
        per_cell = 1.0
        origin = 0.5
        room = TICK_ROOM
        thousand = 1
        if scale is None:
            write(canvas, "x", TICK_FONT, INK, topleft=(right + 8, TOP - 20))
            write(canvas, "y", TICK_FONT, INK, topleft=(LEFT - 16, TOP + self.side + 5))
        else:
            per_cell = scale.metres_per_cell
            origin = 0.0
            room = KILOMETRE_ROOM
            thousand = 1000
            write(canvas, "km", TICK_FONT, INK, bottomright=(LEFT - 20, TOP - 7))
            canvas.blit(sprites.north(NORTH), (right + 7, TOP))
            write(canvas, "N", TICK_FONT, INK, midtop=(right + 7 + NORTH // 2, TOP + NORTH + 2))
        stride = tick_stride(room, self._pitch / per_cell)
        for number in range(0, math.ceil((self.grid_size - origin) * per_cell), stride):
            at = round((origin + number / per_cell) * self._pitch)
            text = f"{number / thousand:g}"
            write(canvas, text, TICK_FONT, GREY, midbottom=(LEFT + at, TOP - 7))
            write(canvas, text, TICK_FONT, GREY, midright=(LEFT - 8, TOP + at))

    def _draw_cells(self, canvas: pygame.Surface, matrix: NDArray[np.float32]) -> None:
        colours = self._look.colours(matrix)
        cells = pygame.image.frombuffer(colours.tobytes(), matrix.shape, "RGB")
        canvas.blit(pygame.transform.scale(cells, (self.side, self.side)), (LEFT, TOP))

    def _draw_land(self, canvas: pygame.Surface, land: Sequence[Cell]) -> None:
        """Cover cells on land, so that the probability of those who have stranded shows through."""
        if not land:
            return
        cover = pygame.Surface((self.grid_size, self.grid_size), pygame.SRCALPHA, 32)
        for cell in land:
            if min(cell) >= 0 and max(cell) < self.grid_size:  # in the part that a film shows
                cover.set_at(cell, (*LAND, LAND_OPACITY))
        canvas.blit(pygame.transform.scale(cover, (self.side, self.side)), (LEFT, TOP))

    def _draw_lines(self, canvas: pygame.Surface) -> None:
        opacity = round(255 * GRID_OPACITY * min(1.0, self._pitch / OPAQUE_FROM))
        lines = pygame.Surface((self.side, self.side), pygame.SRCALPHA, 32)
        for cell in range(1, self.grid_size):
            at = round(cell * self._pitch)
            lines.fill((*GREY, opacity), (at, 0, 1, self.side))
            lines.fill((*GREY, opacity), (0, at, self.side, 1))
        canvas.blit(lines, (LEFT, TOP))

    # Searches and trails.

    def _draw_searched(self, canvas: pygame.Surface, frame: Frame) -> None:
        """Marks of the last searches, fading."""
        size = max(round(SEARCHED_SHARE * self._pitch), SEARCHED_LEAST)
        marks = [
            (sprites.searched(size, _faded(age / HISTORY_STEPS)), self._centre(x, y))
            for x, y, age in frame.searched
        ]
        _blit_all(canvas, marks)

    def _draw_trails(self, canvas: pygame.Surface, frame: Frame, drones: Positions) -> None:
        """The drones' last moves, fading and with a rim, up to where the drones are."""
        width = max(TRAIL_LEAST, round(TRAIL_SHARE * self._pitch))
        overlay = pygame.Surface((self.side, self.side), pygame.SRCALPHA, 32)
        for rim in (1, 0):
            for number, (trail, at) in enumerate(zip(frame.trails, drones, strict=False)):
                colour = WHITE if rim else drone_colour(number)
                moves = list(pairwise([*trail, at]))
                for index, (start, end) in enumerate(moves):
                    if tuple(start) == tuple(end):
                        continue
                    age = (len(moves) - 1 - index) / (TRAIL_STEPS + 1)
                    x0, y0 = self._centre(*start)
                    x1, y1 = self._centre(*end)
                    move = pygame.Rect(round(x0) - LEFT, round(y0) - TOP, 0, 0)
                    move.union_ip((round(x1) - LEFT, round(y1) - TOP, 0, 0))
                    move.inflate_ip(width + 2 * rim, width + 2 * rim)
                    overlay.fill((*colour, _faded(age) * TRAIL_OPACITY // 255), move)
        canvas.blit(overlay, (LEFT, TOP))

    def _draw_links(self, canvas: pygame.Surface, frame: Frame, drones: Positions) -> None:
        """Lines between drones in radio range; with one drone's map, only from this drone."""
        width = max(2, round(LINK_SHARE * self._pitch))
        for pair in frame.links or ():
            if frame.viewer is None or frame.viewer in pair:
                start, end = (self._centre(*drones[drone]) for drone in pair)
                pygame.draw.line(canvas, WHITE, start, end, width + 2)
                pygame.draw.line(canvas, LINK, start, end, width)

    # Drones and persons.

    def _draw_symbols(
        self,
        canvas: pygame.Surface,
        frame: Frame,
        end: Frame,
        drones_at: Positions,
        persons_at: Positions,
    ) -> None:
        """Drones and persons; those in one cell share its room, unless they only fly over it."""
        cells: dict[tuple[Sequence[float], Pair], tuple[list[int], list[int]]] = {}
        for number, way in enumerate(zip(drones_at, end.drones, strict=True)):
            cells.setdefault(way, ([], []))[0].append(number)
        for number, finder in enumerate(frame.found_by):
            if finder is not None or not frame.hide_persons:
                way = persons_at[number], end.persons[number]
                cells.setdefault(way, ([], []))[1].append(number)
        marks: list[Sprite] = []
        symbols: list[Sprite] = []
        for (cell, _), (drones, persons) in cells.items():
            middle = self._centre(*cell)
            middles, size = self._middles(middle, len(drones) + len(persons))
            if len(drones) > 1:
                marks.append((sprites.collision(round(COLLISION_SIZE * size)), middle))
            for drone, own_middle in zip(drones, middles, strict=False):
                if drone == frame.flown:
                    marks.append((sprites.halo(round(HALO_SIZE * size)), own_middle))
                if end.searching[drone]:
                    ring = max(round(RING_SIZE * size), size + RING_MARGIN)
                    marks.append((sprites.search_ring(ring), own_middle))
                symbols.append((sprites.drone(size, drone), own_middle))
            for person, own_middle in zip(persons, middles[len(drones) :], strict=True):
                finder = frame.found_by[person]
                image = sprites.person(size)
                if finder is not None:
                    image = sprites.found(size, finder)
                symbols.append((image, own_middle))
        # Marks lie below all symbols: in small cells they reach into the neighbours.
        _blit_all(canvas, marks + symbols)

    def _middles(self, middle: Pair, count: int) -> tuple[list[Pair], int]:
        """The middles of symbols in one cell, on a circle if there are several; and their side."""
        if count == 1:
            return [middle], self._symbol
        x, y = middle
        apart = max(APART_SHARE * self._pitch, APART_LEAST)
        angles = [math.tau * (number / count + 5 / 8) for number in range(count)]
        middles = [(x + apart * math.cos(at), y + apart * math.sin(at)) for at in angles]
        return middles, max(round(SHARED_SIZE * self._symbol), SHARED_LEAST)


def outcome_colour(frame: Frame) -> Colour:
    """The colour of an ending: green for success, red for failure, blue for neither."""
    if is_success(frame.ending):
        return FOUND
    # The coverage mission has no person to miss.
    return PROGRESS if frame.ending is Ending.TIME_LIMIT and not frame.persons else NOT_FOUND


def _blit_all(canvas: pygame.Surface, drawn: Iterable[Sprite]) -> None:
    for image, (x, y) in drawn:
        width, height = image.get_size()
        canvas.blit(image, (round(x - width / 2), round(y - height / 2)))


def _on_the_way(starts: Positions, ends: Positions, progress: float) -> list[tuple[float, ...]]:
    return [
        tuple(a + (b - a) * progress for a, b in zip(start, end, strict=True))
        for start, end in zip(starts, ends, strict=True)
    ]


def _faded(age: float) -> int:
    """The opacity of a mark, 0 to 255, from 0 (new) to 1 (old) in `FADES` steps."""
    return 255 * max(0, FADES - math.floor(age * FADES)) // FADES
