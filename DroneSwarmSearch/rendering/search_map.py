"""The map: cells with coordinates, searches so far, trails, drones and persons.

Of a large grid, the part where the search takes place, and a small overview.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch.drift.scale import Scale
from DroneSwarmSearch.frame import HISTORY_STEPS, TRAIL_STEPS, Frame
from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.labels import tick_stride
from DroneSwarmSearch.rendering.palette import (
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

# Lengths are in pixels, unless stated otherwise. A share is one of a cell's side.
LEFT, TOP, RIGHT, BOTTOM = 46, 42, 22, 24  # margins; the first two hold the coordinates
WHOLE_MOST = 48  # of grids with more cells along a side than this, only a part may be shown
# In cells: a part's smallest side, the multiple that its place and side are of, and the margin
# around what it must show: all cells with at least a share of the maximum of the matrix.
PART_LEAST, PART_STEP, PART_MARGIN, PART_FROM = 40, 10, 3, 0.02
OVERVIEW_SHARE, OVERVIEW_INSET = 0.2, 10  # its side as a share of the map's; from the corner
TICK_ROOM, KILOMETRE_ROOM, TICK_FONT = 26, 44, 18
NORTH = 14  # the side of the arrow to the north
LINES_APART = 12  # of closer lines, only every second, fifth, ... is drawn
OPAQUE_FROM, GRID_OPACITY = 16, 0.45  # closer lines are fainter than this opacity
SYMBOL_SHARE, SEARCHING_SHARE = 0.92, 0.76  # of its room: a symbol, a drone inside a search ring
PAIR_SHARE = 0.58  # the room of each of two symbols in a cell
SMALL_SHARE, SMALL_MOST = 1.15, 16  # symbols up to this side are larger than their small room
# Limits of sizes and distances, which hold even if symbols then leave their cell.
DRONE_LEAST, PERSON_LEAST, SYMBOL_MOST, LEAST_APART = 13, 14, 160, 8
RING_MARGIN = 9  # how much larger than its drone a search ring is
COLLISION_MARGIN = 1.5  # the same of the star of a collision, as a share of the drone
NUMBER_FROM = 24  # drones of at least this side show their number
NUMBER_SHARES = (1.1, 1.0, 0.75)  # fonts of one, two, three digits as shares of a drone's body
TRAIL_SHARE, TRAIL_LEAST, TRAIL_OPACITY = 0.13, 3, 230  # width, least width, that of the last move
SEARCHED_SHARE, SEARCHED_LEAST, SEARCHED_MOST = 0.3, 5, 14  # of the mark of a search
FADES = 6  # the opacities of marks that fade
Point = tuple[float, float]
Places = Sequence[Sequence[float]]
Sprite = tuple[pygame.Surface, Point]  # an image and the place of its middle


class SearchMap:
    """Draws the map of one grid size on surfaces of its `size`, margins included.

    `side` is that of all shown cells together, about the argument, so that cells have whole pixels
    if the whole grid is shown; `symbol` the side of a drone alone in its cell at the largest scale.
    """

    def __init__(self, grid_size: int, look: Look, *, side: int = 720) -> None:
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
        self._left: float  # the shown part of the grid, in cells
        self._top: float
        self._cells: float
        self._pitch: float  # the side of a cell in pixels

    def draw(self, canvas: pygame.Surface, frame: Frame, end: Frame, progress: float) -> None:
        """Draw the moment at `progress`, 0 to 1, from a frame to `end`, the next one or itself."""
        self._canvas = canvas
        (part,) = _on_the_way([self._part(frame)], [self._part(end)], progress)
        self._left, self._top, self._cells = part
        self._pitch = self.side / self._cells
        self._draw_coordinates(frame.scale)
        canvas.set_clip((LEFT, TOP, self.side, self.side))
        self._draw_cells(frame.matrix)
        if self._look.grid:
            self._draw_lines()
        drones = _on_the_way(frame.drones, end.drones, progress)
        persons = _on_the_way(frame.persons, end.persons, progress)
        self._draw_trails(frame, drones)
        self._draw_searched(frame)
        canvas.set_clip((LEFT - 2, TOP - 2, self.side + 4, self.side + 4))
        self._draw_symbols(frame, end, drones, persons)
        if self._cells < self._grid_size:
            self._draw_overview(frame)
        canvas.set_clip(None)
        if frame.ending is not None:
            self._draw_border(outcome_colour(frame), 5)

    def _part(self, frame: Frame) -> tuple[float, float, float]:
        """The left, top and side of the part of the grid that a frame shows, in cells."""
        size = self._grid_size
        if size <= WHOLE_MOST:
            return 0, 0, size
        maps = [each for each in (frame.matrix, frame.prior) if each is not None]
        likely = np.logical_or.reduce([each >= PART_FROM * each.max() for each in maps])
        cells = [*_symbol_cells(frame), *((x, y) for x, y, _ in frame.searched)]
        extents = []
        for axis in (0, 1):
            along = [*likely.any(axis=axis).nonzero()[0].tolist(), *(cell[axis] for cell in cells)]
            extents.append((min(along), max(along) + 1))
        need = max(high - low for low, high in extents) + 2 * PART_MARGIN
        count = min(max(math.ceil(need / PART_STEP) * PART_STEP, PART_LEAST), size)
        corner: list[int] = []
        for low, high in extents:
            middle = (low + high - count) / 2
            left = round(middle / PART_STEP) * PART_STEP
            if left > low or left + count < high:  # rounding has cut something off
                left = round(middle)
            corner.append(min(max(left, 0), size - count))
        return corner[0], corner[1], count

    def _at(self, x: float, y: float) -> Point:
        """The pixel of a point of the grid, in cells from its upper left corner."""
        return LEFT + (x - self._left) * self._pitch, TOP + (y - self._top) * self._pitch

    def _centre(self, x: float, y: float) -> Point:
        return self._at(x + 0.5, y + 0.5)

    # Cells.

    def _draw_border(self, colour: Colour, width: int) -> None:
        outer = self.side + 2 * width
        place = (LEFT - width, TOP - width, outer, outer)
        pygame.draw.rect(self._canvas, colour, place, width=width)

    def _draw_coordinates(self, scale: Scale | None) -> None:
        """The numbers of cells; with a scale, kilometres from the grid's corner, and north."""
        canvas, right = self._canvas, LEFT + self.side
        self._draw_border(INK, 1)
        # Labels count cells from the middle of the first one, or metres from its edge.
        per_cell, origin, room, thousand = 1.0, 0.5, TICK_ROOM, 1
        if scale is None:
            write(canvas, "x", TICK_FONT, INK, topleft=(right + 8, TOP - 20))
            write(canvas, "y", TICK_FONT, INK, topleft=(LEFT - 16, TOP + self.side + 5))
        else:
            per_cell, origin, room, thousand = scale.metres_per_cell, 0.0, KILOMETRE_ROOM, 1000
            write(canvas, "km", TICK_FONT, INK, bottomright=(LEFT - 20, TOP - 7))
            canvas.blit(sprites.north(NORTH), (right + 7, TOP))
            write(canvas, "N", TICK_FONT, INK, midtop=(right + 7 + NORTH // 2, TOP + NORTH + 2))
        stride = tick_stride(room, self._pitch / per_cell)
        for axis, low in enumerate((self._left, self._top)):
            first = math.ceil(low * per_cell / stride) * stride
            end = math.ceil((low + self._cells - origin) * per_cell)
            for number in range(first, end, stride):
                place = origin + number / per_cell
                across, down = map(round, self._at(place, place))
                at = {"midright": (LEFT - 8, down)} if axis else {"midbottom": (across, TOP - 7)}
                write(canvas, f"{number / thousand:g}", TICK_FONT, GREY, **at)

    def _colours(self, matrix: NDArray[np.float32]) -> pygame.Surface:
        colours = self._look.colours(matrix)
        return pygame.image.frombuffer(colours.tobytes(), matrix.shape[::-1], "RGB")

    def _draw_cells(self, matrix: NDArray[np.float32]) -> None:
        first_x, first_y = math.floor(self._left), math.floor(self._top)
        last_x, last_y = math.ceil(self._left + self._cells), math.ceil(self._top + self._cells)
        size = last_x - first_x, last_y - first_y
        cells = self._colours(matrix).subsurface((first_x, first_y), size)
        x, y = map(round, self._at(first_x, first_y))
        right, bottom = map(round, self._at(last_x, last_y))
        scale = pygame.transform.scale if self._pitch >= 1.0 else pygame.transform.smoothscale
        self._canvas.blit(scale(cells, (right - x, bottom - y)), (x, y))

    def _draw_lines(self) -> None:
        side, stride = self.side, tick_stride(LINES_APART, self._pitch)
        opacity = GRID_OPACITY * min(1.0, stride * self._pitch / OPAQUE_FROM)
        lines = pygame.Surface((side, side), pygame.SRCALPHA, 32)
        for axis, low in enumerate((self._left, self._top)):
            first = math.floor(low / stride + 1) * stride
            for cell in range(first, math.ceil(low + self._cells), stride):
                at = round((cell - low) * self._pitch)
                line = (0, at, side, 1) if axis else (at, 0, 1, side)
                lines.fill((*GREY, round(255 * opacity)), line)
        self._canvas.blit(lines, (LEFT, TOP))

    def _draw_overview(self, frame: Frame) -> None:
        """The whole grid, in the corner or at the side where it hides the fewest symbols."""
        side = round(OVERVIEW_SHARE * self.side)
        near, far = OVERVIEW_INSET, self.side - side - OVERVIEW_INSET
        middle = (near + far) // 2
        corners = [(near, far), (far, far), (near, near), (far, near)]
        sides = [(middle, far), (near, middle), (far, middle), (middle, near)]
        places = [pygame.Rect(LEFT + x, TOP + y, side, side) for x, y in corners + sides]
        middles = [self._centre(x, y) for x, y in _symbol_cells(frame)]

        def hidden(place: pygame.Rect) -> int:
            room = place.inflate(self.symbol, self.symbol)
            return sum(room.collidepoint(middle) for middle in middles)

        place = min(places, key=hidden)
        whole = self._colours(frame.matrix)
        self._canvas.blit(pygame.transform.smoothscale(whole, place.size), place)
        pygame.draw.rect(self._canvas, WHITE, place.inflate(2, 2), width=1)
        pygame.draw.rect(self._canvas, INK, place.inflate(4, 4), width=1)
        scale = side / self._grid_size
        left, top, count = self._left * scale, self._top * scale, self._cells * scale
        shown = pygame.Rect(place.left + left, place.top + top, count + 1, count + 1)
        pygame.draw.rect(self._canvas, WHITE, shown, width=2)
        pygame.draw.rect(self._canvas, INK, shown.inflate(2, 2), width=1)

    # Searches and trails.

    def _draw_searched(self, frame: Frame) -> None:
        """Marks of the last searches, fading; the latest search of a cell counts."""
        size = min(max(round(SEARCHED_SHARE * self._pitch), SEARCHED_LEAST), SEARCHED_MOST)
        ages = {(x, y): age for x, y, age in frame.searched}
        marks = [
            (sprites.searched(size, opacity), self._centre(*cell))
            for cell, age in ages.items()
            if (opacity := _faded(age / HISTORY_STEPS))
        ]
        _blit_all(self._canvas, marks)

    def _draw_trails(self, frame: Frame, drones: Places) -> None:
        """The drones' last moves, fading and with a rim, up to where the drones are."""
        width = max(TRAIL_LEAST, round(TRAIL_SHARE * self._pitch))
        layer = pygame.Surface((self.side, self.side), pygame.SRCALPHA, 32)
        for rim in (1, 0):
            for number, (trail, at) in enumerate(zip(frame.trails, drones, strict=False)):
                colour = WHITE if rim else self._look.drone(number)
                moves = list(pairwise([*trail, at]))
                for index, (start, end) in enumerate(moves):
                    if tuple(start) == tuple(end):
                        continue
                    age = (len(moves) - 1 - index) / (TRAIL_STEPS + 1)
                    (x0, y0), (x1, y1) = self._centre(*start), self._centre(*end)
                    move = pygame.Rect(round(x0) - LEFT, round(y0) - TOP, 0, 0)
                    move.union_ip((round(x1) - LEFT, round(y1) - TOP, 0, 0))
                    move.inflate_ip(width + 2 * rim, width + 2 * rim)
                    layer.fill((*colour, _faded(age) * TRAIL_OPACITY // 255), move)
        self._canvas.blit(layer, (LEFT, TOP))

    # Drones and persons.

    def _draw_symbols(
        self, frame: Frame, end: Frame, drones_at: Places, persons_at: Places
    ) -> None:
        """Drones and persons; those at one place share its room, unless they only pass there."""
        cells: dict[tuple[Sequence[float], Point], tuple[list[int], list[int]]] = {}
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
                share = SEARCHING_SHARE if end.searching[drone] else SYMBOL_SHARE
                side = _symbol_side(share, room, DRONE_LEAST)
                if end.searching[drone]:
                    ring = max(round(side / SEARCHING_SHARE), side + RING_MARGIN)
                    marks.append((sprites.search_ring(ring), place))
                colour = self._look.drone(drone)
                symbols.append((sprites.drone(side, colour), place))
                if side >= NUMBER_FROM:
                    digits = min(len(str(drone)), len(NUMBER_SHARES))
                    font = round(side * sprites.body_share(side) * NUMBER_SHARES[digits - 1])
                    symbols.append((text_line(f"{drone}", font, readable_on(colour)), place))
            side = _symbol_side(SYMBOL_SHARE, room, PERSON_LEAST)
            for person, place in zip(persons, places[len(drones) :], strict=True):
                finder = frame.found_by[person]
                image = sprites.person(side)
                if finder is not None:
                    image = sprites.found(side, self._look.drone(finder))
                symbols.append((image, place))
        # Marks lie below all symbols: in small cells they reach into the neighbours.
        _blit_all(self._canvas, marks + symbols)

    def _places(self, cell: Sequence[float], count: int) -> tuple[list[Point], float]:
        """Middles of symbols in one cell, and the side of the room of each: 1, diagonal, square."""
        centre = self._centre(*cell)
        if count == 1:
            return [centre], self._pitch
        along = math.ceil(math.sqrt(count))
        room = self._pitch * (PAIR_SHARE if count == 2 else 1 / along)
        apart = max((self._pitch - room) / (along - 1), LEAST_APART)
        left, top = (middle - apart * (along - 1) / 2 for middle in centre)
        squares = [(0, 0), (1, 1)] if count == 2 else [divmod(n, along) for n in range(count)]
        return [(left + apart * column, top + apart * row) for row, column in squares], room


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
    (left, top), (right, bottom) = np.min(places, axis=0), np.max(places, axis=0)
    drone = _symbol_side(SYMBOL_SHARE, room, DRONE_LEAST)
    side = max(right - left, bottom - top) + COLLISION_MARGIN * drone
    return sprites.collision(round(side)), ((left + right) / 2, (top + bottom) / 2)


def _blit_all(canvas: pygame.Surface, drawn: Iterable[Sprite]) -> None:
    for image, (x, y) in drawn:
        width, height = image.get_size()
        canvas.blit(image, (round(x - width / 2), round(y - height / 2)))


def _shown_persons(frame: Frame) -> list[int]:
    found_by = enumerate(frame.found_by)
    return [person for person, drone in found_by if drone is not None or not frame.hide_persons]


def _symbol_cells(frame: Frame) -> list[tuple[int, int]]:
    return [*frame.drones, *(frame.persons[person] for person in _shown_persons(frame))]


def _on_the_way(starts: Places, ends: Places, progress: float) -> list[tuple[float, ...]]:
    return [
        tuple(a + (b - a) * progress for a, b in zip(start, end, strict=True))
        for start, end in zip(starts, ends, strict=True)
    ]


def _faded(age: float) -> int:
    """The opacity of a mark, 0 to 255, from 0 (new) to 1 (old) in `FADES` steps."""
    return 255 * max(0, FADES - math.floor(age * FADES)) // FADES
