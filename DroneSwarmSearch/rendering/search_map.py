"""The map: coloured cells with coordinates, the drones and persons on it, and the outcome."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import tick_stride
from DroneSwarmSearch.rendering.palette import (
    FOUND,
    GREY,
    INK,
    NOT_FOUND,
    PALETTES,
    PROGRESS,
    WHITE,
    Colour,
    readable_on,
    shades,
)
from DroneSwarmSearch.rendering.sprites import text_line, write
from DroneSwarmSearch.rules import Ending, is_success

__all__ = ["BOTTOM", "LEFT", "RIGHT", "TOP", "SearchMap", "outcome_colour"]

# Lengths are in pixels, unless stated otherwise.

LEFT, TOP, RIGHT, BOTTOM = 46, 42, 22, 24
"""Margins around the cells; the first two hold the coordinates."""

SIDE_GOAL = 720
"""The side of all cells together, rounded so that a cell has whole pixels."""

SIDE_MOST = 1000
"""The side of grids with more cells along a side than this."""

TICK_ROOM = 26
TICK_FONT = 18

GRID_FINEST = 4
"""With cells smaller than this, only every tenth line is drawn."""

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

DRONE_LEAST, PERSON_LEAST, SYMBOL_MOST = 9, 11, 160
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

SENTENCE_FONT, REASON_FONT = 60, 30
BANNER_TEXT_SHARE = 0.9
BANNER_PADDING = 20
BANNER_STEP = 12
LINE_GAP = 10
FRAME_WIDTH = 5
"""The outcome is a banner, placed in steps, and a frame around the cells."""

Point = tuple[float, float]
Sprite = tuple[pygame.Surface, Point]
"""An image and the place of its middle."""


class SearchMap:
    """Draws the map of one grid size on surfaces of its `size`.

    Args:
        grid_size: cells along each side.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly; otherwise in three colours.
        palette: a name in `PALETTES`.

    Attributes:
        side: side of all cells together, in pixels.
        pitch: side of a cell in pixels; an integer up to `SIDE_MOST` cells.
        size: width and height in pixels, margins included.
        symbol: side of a drone alone in its cell, in pixels.
    """

    def __init__(
        self,
        grid_size: int,
        *,
        render_grid: bool = False,
        render_gradient: bool = True,
        palette: str = "classic",
    ) -> None:
        self._grid_size = grid_size
        self._render_grid = render_grid
        self._render_gradient = render_gradient
        self._palette = PALETTES[palette]
        if grid_size > SIDE_MOST:
            self.side = SIDE_MOST
        else:
            self.side = grid_size * max(1, round(SIDE_GOAL / grid_size))
        self.pitch = self.side / grid_size
        self.size = LEFT + self.side + RIGHT, TOP + self.side + BOTTOM
        self.symbol = _symbol_side(SYMBOL_SHARE, self.pitch, DRONE_LEAST)
        self._lines: pygame.Surface | None = None

    def __getstate__(self) -> dict[str, object]:
        """Everything but the prepared surface, which cannot be copied."""
        return {**self.__dict__, "_lines": None}

    def draw_fixed(self, canvas: pygame.Surface) -> None:
        """Draw the coordinates, which are the same for every frame."""
        self._draw_frame(canvas, INK, 1)
        for cell in range(0, self._grid_size, tick_stride(TICK_ROOM, self.pitch)):
            across, down = self.centre(cell, cell)
            write(canvas, f"{cell}", TICK_FONT, GREY, midbottom=(round(across), TOP - 7))
            write(canvas, f"{cell}", TICK_FONT, GREY, midright=(LEFT - 8, round(down)))
        write(canvas, "x", TICK_FONT, INK, topleft=(LEFT + self.side + 8, TOP - 20))
        write(canvas, "y", TICK_FONT, INK, topleft=(LEFT - 16, TOP + self.side + 5))

    def draw(self, canvas: pygame.Surface, frame: Frame, *, banner: bool = True) -> None:
        """Draw the cells of a frame and everything on them.

        Args:
            canvas: a surface with the coordinates.
            frame: a frame of this grid size.
            banner: at the end of an episode, write the outcome across the map.

        Raises:
            ValueError: the frame is of another grid size.
        """
        if frame.grid_size != self._grid_size:
            raise ValueError(
                f"this painter draws grids of size {self._grid_size},"
                f" got a frame of size {frame.grid_size}"
            )
        self._draw_cells(canvas, frame.matrix)
        if self._render_grid:
            self._draw_lines(canvas)
        self._draw_symbols(canvas, frame)
        if frame.ending is not None:
            colour = outcome_colour(frame)
            self._draw_frame(canvas, colour, FRAME_WIDTH)
            if banner:
                self._draw_banner(canvas, frame, frame.ending, colour)

    def centre(self, x: float, y: float) -> Point:
        """The middle of a cell in pixels."""
        return LEFT + (x + 0.5) * self.pitch, TOP + (y + 0.5) * self.pitch

    # Cells.

    def _draw_frame(self, canvas: pygame.Surface, colour: Colour, width: int) -> None:
        """A frame around the cells."""
        outer = self.side + 2 * width
        pygame.draw.rect(canvas, colour, (LEFT - width, TOP - width, outer, outer), width=width)

    def _draw_cells(self, canvas: pygame.Surface, matrix: NDArray[np.float32]) -> None:
        count, side = self._grid_size, self.side
        colours = self._palette.ramp[shades(matrix, self._render_gradient)]
        cells = pygame.image.frombuffer(colours.tobytes(), (count, count), "RGB")
        scale = pygame.transform.scale if side >= count else pygame.transform.smoothscale
        canvas.blit(scale(cells, (side, side)), (LEFT, TOP))

    def _draw_lines(self, canvas: pygame.Surface) -> None:
        if self._lines is None:
            self._lines = pygame.Surface((self.side, self.side), pygame.SRCALPHA, 32)
            stride = 1 if self.pitch >= GRID_FINEST else 10
            opacity = GRID_OPACITY * min(1.0, stride * self.pitch / GRID_FULL_FROM)
            colour = (*GREY, round(255 * opacity))
            for cell in range(stride, self._grid_size, stride):
                at = round(cell * self.pitch)
                self._lines.fill(colour, (at, 0, 1, self.side))
                self._lines.fill(colour, (0, at, self.side, 1))
        canvas.blit(self._lines, (LEFT, TOP))

    # Drones and persons.

    def _draw_symbols(self, canvas: pygame.Surface, frame: Frame) -> None:
        """Drones and persons; those in one cell share its room."""
        cells: dict[tuple[int, int], tuple[list[int], list[int]]] = {}
        for kind, positions in enumerate((frame.drones, frame.persons)):
            for number, cell in enumerate(positions):
                cells.setdefault(cell, ([], []))[kind].append(number)
        marks: list[Sprite] = []
        symbols: list[Sprite] = []
        for cell, (drones, persons) in cells.items():
            places, room = self._places(cell, len(drones) + len(persons))
            if len(drones) > 1:
                marks.append(_collision(places[: len(drones)], room))
            for drone, place in zip(drones, places, strict=False):
                searching = frame.searching[drone]
                side = _symbol_side(
                    SEARCHING_SHARE if searching else SYMBOL_SHARE, room, DRONE_LEAST
                )
                if searching:
                    ring = max(round(side / SEARCHING_SHARE), side + RING_MARGIN)
                    marks.append((sprites.search_ring(ring), place))
                symbols += self._drone(drone, side, place)
            side = _symbol_side(SYMBOL_SHARE, room, PERSON_LEAST)
            for person, place in zip(persons, places[len(drones) :], strict=True):
                symbols.append((self._person(frame.found_by[person], side), place))
        canvas.set_clip((LEFT - 2, TOP - 2, self.side + 4, self.side + 4))
        # Marks lie below all symbols: in small cells they reach into the neighbours.
        _blit_all(canvas, marks)
        _blit_all(canvas, symbols)
        canvas.set_clip(None)

    def _places(self, cell: tuple[int, int], count: int) -> tuple[list[Point], float]:
        """Middles of the symbols in one cell, and the side of the room of each, in pixels.

        One symbol is in the middle, two are on the diagonal, more form a square.
        """
        centre = self.centre(*cell)
        if count == 1:
            return [centre], self.pitch
        along = math.ceil(math.sqrt(count))
        room = self.pitch * (PAIR_SHARE if count == 2 else 1 / along)
        apart = max((self.pitch - room) / (along - 1), LEAST_APART)
        left, top = (middle - apart * (along - 1) / 2 for middle in centre)
        squares = [(0, 0), (1, 1)] if count == 2 else [divmod(n, along) for n in range(count)]
        return [(left + apart * column, top + apart * row) for row, column in squares], room

    def _drone(self, number: int, side: int, place: Point) -> list[Sprite]:
        """A drone, with its number if it is large enough."""
        colour = self._palette.drone(number)
        drawn = [(sprites.drone(side, colour), place)]
        if side >= NUMBER_FROM:
            digits = min(len(str(number)), len(NUMBER_SHARES))
            font = round(side * sprites.body_share(side) * NUMBER_SHARES[digits - 1])
            drawn.append((text_line(f"{number}", font, readable_on(colour)), place))
        return drawn

    def _person(self, found_by: int | None, side: int) -> pygame.Surface:
        if found_by is None:
            return sprites.person(side)
        return sprites.found(side, self._palette.drone(found_by))

    # The outcome.

    def _draw_banner(
        self, canvas: pygame.Surface, frame: Frame, ending: Ending, colour: Colour
    ) -> None:
        """The outcome in large type across the map."""
        lines = [_fitted(frame.outcome, SENTENCE_FONT, BANNER_TEXT_SHARE * self.side)]
        if ending is not Ending.FOUND or len(frame.persons) > 1:
            lines.append(_fitted(ending.description, REASON_FONT, BANNER_TEXT_SHARE * self.side))
        height = sum(line.get_height() + LINE_GAP for line in lines) - LINE_GAP + 2 * BANNER_PADDING
        top = TOP + self._banner_top(frame, height)
        canvas.fill(colour, (LEFT, top, self.side, height))
        for edge in (top, top + height - 2):
            canvas.fill(WHITE, (LEFT, edge, self.side, 2))
        y = top + BANNER_PADDING
        for line in lines:
            canvas.blit(line, line.get_rect(midtop=(LEFT + self.side // 2, y)))
            y += line.get_height() + LINE_GAP

    def _banner_top(self, frame: Frame, height: int) -> int:
        """The place of the banner that hides least of the symbols, nearest to the middle."""
        half = self.symbol / 2
        rows = Counter(y for _, y in (*frame.drones, *frame.persons))
        middles = {self.centre(0, y)[1] - TOP: count for y, count in rows.items()}
        central = (self.side - height) // 2

        def cost(top: int) -> tuple[float, int]:
            hidden = 0.0
            for middle, count in middles.items():
                shared = min(top + height, middle + half) - max(top, middle - half)
                hidden += count * max(0.0, shared)
            return hidden, abs(top - central)

        highest = central % BANNER_STEP + BANNER_STEP
        return min(range(highest, self.side - height - BANNER_STEP + 1, BANNER_STEP), key=cost)


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


def _fitted(text: str, font: int, width: float) -> pygame.Surface:
    """A white line of text in the given font size, or in a smaller one that fits the width."""
    line = text_line(text, font, WHITE)
    if line.get_width() > width:
        line = text_line(text, int(font * width / line.get_width()), WHITE)
    return line
