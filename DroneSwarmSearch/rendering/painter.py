"""The picture of a frame, drawn off screen."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import tick_stride
from DroneSwarmSearch.rendering.layout import LEFT, TOP, Layout
from DroneSwarmSearch.rendering.palette import (
    FOUND,
    FOUND_SCALE,
    GREY,
    INK,
    LOST_SCALE,
    NOT_FOUND,
    PAPER,
    SEARCH_SCALE,
    WHITE,
    levels,
)
from DroneSwarmSearch.rendering.panel import Panel
from DroneSwarmSearch.rendering.sprites import lettering
from DroneSwarmSearch.rendering.symbols import draw_symbols, symbol_side
from DroneSwarmSearch.rules import Ending

__all__ = ["Painter"]

TICK_ROOM = 26
TICK_FONT = 18
"""Least distance between coordinates in pixels, and their font size."""

GRID_FINEST = 4
GRID_COARSE = 10
"""Cells of fewer pixels than the first get lines around every tenth only."""

GRID_OPACITY = 0.45
GRID_FULL_FROM = 16
"""Opacity of the lines, reached where they stand this many pixels apart."""

SENTENCE_FONT = 60
REASON_FONT = 30
BANNER_TEXT_SHARE = 0.9
BANNER_PADDING = 20
LINE_GAP = 10
BANNER_STEP = 12
"""The banner: font sizes, most width of its text as a share of the board;
lengths in pixels, of which the last is between the places that it may take."""


class Painter:
    """Draws frames of one grid size; needs no display and starts none.

    Args:
        grid_size: cells along each side.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly from red through yellow to green,
            else in these three colours alone.
    """

    def __init__(self, grid_size: int, *, render_grid: bool, render_gradient: bool) -> None:
        self._layout = Layout(grid_size)
        self._render_grid = render_grid
        self._render_gradient = render_gradient
        self._panel = Panel(
            left=self._layout.panel_left,
            top=TOP,
            height=self._layout.panel_height,
            symbol=symbol_side(self._layout.pitch),
            gradient=render_gradient,
        )
        self._backdrop: pygame.Surface | None = None
        self._lines: pygame.Surface | None = None

    def __getstate__(self) -> dict[str, object]:
        """Everything but the prepared surfaces, which cannot be copied and are made anew."""
        return {**self.__dict__, "_backdrop": None, "_lines": None}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures in pixels, both even."""
        return self._layout.size

    def paint(self, frame: Frame) -> pygame.Surface:
        """A new surface of `size` with the picture of a frame.

        Raises:
            ValueError: the frame is of another grid size.
        """
        if frame.grid_size != self._layout.grid_size:
            raise ValueError(
                f"this painter draws grids of size {self._layout.grid_size},"
                f" got a frame of size {frame.grid_size}"
            )
        if self._backdrop is None:
            self._backdrop = self._draw_backdrop()
        canvas = self._backdrop.copy()
        scale = _scale_of(frame.ending)
        self._draw_cells(canvas, frame.matrix, scale)
        if self._render_grid:
            self._draw_lines(canvas)
        draw_symbols(canvas, frame, self._layout)
        self._panel.draw(canvas, frame, scale)
        if frame.ending is not None:
            self._draw_banner(canvas, frame, frame.ending)
        return canvas

    def pixels(self, frame: Frame) -> NDArray[np.uint8]:
        """The picture of a frame as a new uint8 array of shape (height, width, 3)."""
        width, height = self.size
        data = pygame.image.tobytes(self.paint(frame), "RGB")
        return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3).copy()

    def _draw_backdrop(self) -> pygame.Surface:
        """Paper, coordinates and the fixed part of the panel."""
        canvas = pygame.Surface(self.size, 0, 32)
        canvas.fill(PAPER)
        side = self._layout.board
        pygame.draw.rect(canvas, INK, (LEFT - 1, TOP - 1, side + 2, side + 2), width=1)
        stride = tick_stride(TICK_ROOM, self._layout.pitch)
        for cell in range(0, self._layout.grid_size, stride):
            across, _ = self._layout.centre(cell, 0)
            _, down = self._layout.centre(0, cell)
            label = lettering(f"{cell}", TICK_FONT, GREY)
            width, height = label.get_size()
            canvas.blit(label, (round(across - width / 2), TOP - 7 - height))
            canvas.blit(label, (LEFT - 8 - width, round(down - height / 2)))
        for name, place in (("x", (LEFT + side + 8, TOP - 20)), ("y", (LEFT - 16, TOP + side + 5))):
            canvas.blit(lettering(name, TICK_FONT, INK), place)
        self._panel.draw_fixed(canvas)
        return canvas

    def _draw_cells(
        self, canvas: pygame.Surface, matrix: NDArray[np.float32], scale: NDArray[np.uint8]
    ) -> None:
        """The coloured board."""
        count, side = self._layout.grid_size, self._layout.board
        colours = scale[levels(matrix, self._render_gradient)]
        cells = pygame.image.frombuffer(colours.tobytes(), (count, count), "RGB")
        if side >= count:
            board = pygame.transform.scale(cells, (side, side))
        else:
            board = pygame.transform.smoothscale(cells, (side, side))
        canvas.blit(board, (LEFT, TOP))

    def _draw_lines(self, canvas: pygame.Surface) -> None:
        """Lines between cells, the fainter the smaller the cells are."""
        if self._lines is None:
            side, pitch = self._layout.board, self._layout.pitch
            self._lines = pygame.Surface((side, side), pygame.SRCALPHA, 32)
            stride = 1 if pitch >= GRID_FINEST else GRID_COARSE
            opacity = GRID_OPACITY * min(1.0, stride * pitch / GRID_FULL_FROM)
            colour = (*INK, round(255 * opacity))
            for cell in range(stride, self._layout.grid_size, stride):
                at = round(cell * pitch)
                self._lines.fill(colour, (at, 0, 1, side))
                self._lines.fill(colour, (0, at, side, 1))
        canvas.blit(self._lines, (LEFT, TOP))

    def _draw_banner(self, canvas: pygame.Surface, frame: Frame, ending: Ending) -> None:
        """The outcome in large type across the board."""
        side = self._layout.board
        lines = [_fitting(frame.outcome, SENTENCE_FONT, BANNER_TEXT_SHARE * side)]
        if ending is not Ending.FOUND or len(frame.persons) > 1:
            lines.append(_fitting(ending.description, REASON_FONT, BANNER_TEXT_SHARE * side))
        text_height = sum(line.get_height() for line in lines) + LINE_GAP * (len(lines) - 1)
        height = text_height + 2 * BANNER_PADDING
        top = TOP + self._banner_top(frame, height)
        ground = FOUND if ending is Ending.FOUND else NOT_FOUND
        canvas.fill(ground, (LEFT, top, side, height))
        for edge in (top + 4, top + height - 5):
            canvas.fill(WHITE, (LEFT, edge, side, 1))
        y = top + BANNER_PADDING
        for line in lines:
            canvas.blit(line, (LEFT + (side - line.get_width()) // 2, y))
            y += line.get_height() + LINE_GAP

    def _banner_top(self, frame: Frame, height: int) -> int:
        """Upper edge of the banner on the board, where it hides least of the symbols.

        Of such places it is the one nearest to the middle.
        """
        side, half = self._layout.board, symbol_side(self._layout.pitch) / 2
        crowds = Counter(y for _, y in (*frame.drones, *frame.persons))
        middles = {self._layout.centre(0, y)[1] - TOP: n for y, n in crowds.items()}
        central = (side - height) // 2

        def cost(top: int) -> tuple[float, int]:
            hidden = 0.0
            for middle, count in middles.items():
                shared = min(top + height, middle + half) - max(top, middle - half)
                hidden += count * max(0.0, shared)
            return hidden, abs(top - central)

        highest = central % BANNER_STEP + BANNER_STEP
        return min(range(highest, side - height - BANNER_STEP + 1, BANNER_STEP), key=cost)


def _scale_of(ending: Ending | None) -> NDArray[np.uint8]:
    """The board's colours: while searching, and after either outcome."""
    if ending is None:
        return SEARCH_SCALE
    return FOUND_SCALE if ending is Ending.FOUND else LOST_SCALE


def _fitting(text: str, font: int, width: float) -> pygame.Surface:
    """A white line of text in the given font size, or as much smaller as it must be."""
    line = lettering(text, font, WHITE)
    if line.get_width() > width:
        line = lettering(text, int(font * width / line.get_width()), WHITE)
    return line
