"""Two boards side by side: the same moment of a search, over the prior and the posterior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief, signed
from DroneSwarmSearch.rendering.layout import BOTTOM, LEFT, RIGHT, TOP, Layout
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.palette import (
    FOUND,
    GREY,
    INK,
    NOT_FOUND,
    PAPER,
    SEARCH_SCALE,
    WHITE,
    Colour,
    drone_colour,
)
from DroneSwarmSearch.rendering.sprites import lettering
from DroneSwarmSearch.rendering.symbols import symbol_side
from DroneSwarmSearch.rules import Ending

__all__ = ["SideBySide"]

HEAD, CAPTION, FOOT = 74, 30, 84
"""Heights above the boards, of the boards' captions and below the boards, in pixels."""

TITLE_FONT, CAPTION_FONT, KEY_FONT = 46, 36, 32
"""Font sizes, as pygame counts them; a GIF shows them at two thirds."""

MARGIN, GAP = 46, 40
ICON_LEAST, ICON = 17, 34
PILL = (18, 8)
"""Around the outcome, across and down."""

SCALE_SIZE = (180, 20)


class SideBySide:
    """Draws pictures of two boards, with captions, a title and a key.

    Args:
        grid_size: cells along each side.
        title: who searches what; smaller if there is not room enough.
    """

    def __init__(self, grid_size: int, title: str) -> None:
        self._title = title
        self._painter = Painter(grid_size, render_grid=True, render_gradient=True)
        layout = Layout(grid_size)
        side = layout.board
        # Small symbols are plain: the key shows what they look like on the board.
        self._icon = min(max(symbol_side(layout.pitch), ICON_LEAST), ICON)
        self._board = (LEFT + side + RIGHT, TOP + side + BOTTOM)
        width, height = 2 * self._board[0], HEAD + CAPTION + self._board[1] + FOOT
        self._size = (width, height + height % 2)

    def pixels(self, prior: Frame, posterior: Frame) -> NDArray[np.uint8]:
        """The picture of a step: a new uint8 array of shape (height, width, 3), both even.

        Args:
            prior: the frame with the prior as its matrix.
            posterior: the same with the posterior.
        """
        canvas = pygame.Surface(self._size, 0, 32)
        canvas.fill(PAPER)
        self._head(canvas, posterior)
        across = self._board[0]
        for left, frame, caption in (
            (0, prior, "prior: the drift alone"),
            (across, posterior, "posterior: given the searches made"),
        ):
            self._draw_board(canvas, frame, left)
            self._caption(canvas, caption, frame, left)
        self._key(canvas, posterior.vector)
        width, height = self._size
        data = pygame.image.tobytes(canvas, "RGB")
        return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3).copy()

    def _head(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The title on the left; the clock, or how it ended, on the right."""
        right = self._size[0] - RIGHT
        if frame.ending is None:
            told = [f"step {frame.step} of {frame.timestep_limit}"]
        else:
            told = []
            found = frame.ending is Ending.FOUND
            right = _pill(canvas, outcome_in_brief(frame), right, found) - GAP
        if len(frame.persons) > 1 and frame.ending is not Ending.FOUND:
            told.insert(0, f"{sum(frame.found)} of {len(frame.persons)} found")
        right = _write(canvas, "   ".join(told), right, HEAD // 2, TITLE_FONT, INK, right=True)
        room = right - GAP - MARGIN
        wanted = lettering(self._title, TITLE_FONT, INK).get_width()
        font = min(TITLE_FONT, TITLE_FONT * room // wanted)
        _write(canvas, self._title, MARGIN, HEAD // 2, font, INK)

    def _draw_board(self, canvas: pygame.Surface, frame: Frame, left: int) -> None:
        """The board with its coordinates, without the painter's panel and banner."""
        painted = self._painter.paint(replace(frame, ending=None))
        canvas.blit(painted, (left, HEAD + CAPTION), (0, 0, *self._board))

    def _caption(self, canvas: pygame.Surface, text: str, frame: Frame, left: int) -> None:
        middle = HEAD + CAPTION // 2
        _write(canvas, text, left + MARGIN, middle, CAPTION_FONT, INK)
        top = f"likeliest cell {100 * float(frame.matrix.max()):.2f}%"
        edge = left + self._board[0] - RIGHT
        _write(canvas, top, edge, middle, CAPTION_FONT, GREY, right=True)

    def _key(self, canvas: pygame.Surface, vector: tuple[float, float]) -> None:
        """What the symbols, the arrow and the colours stand for."""
        middle = self._size[1] - FOOT // 2 - 6
        side, colour = self._icon, drone_colour(0)
        x = MARGIN
        for icons, meaning in (
            ([sprites.drone(side, colour)], "drone"),
            ([sprites.search_mark(side + 9), sprites.drone(side - 4, colour)], "searching"),
            ([sprites.person(side, False)], "person"),
            ([sprites.person(side, True)], "found"),
            ([sprites.arrow(ICON + 14, vector)], _drift(vector)),
        ):
            half = max(icon.get_width() for icon in icons) // 2
            for icon in icons:
                corner = (x + half - icon.get_width() // 2, middle - icon.get_height() // 2)
                canvas.blit(icon, corner)
            x = _write(canvas, meaning, x + 2 * half + 10, middle, KEY_FONT, INK) + GAP
        right = self._size[0] - RIGHT
        x = _write(canvas, "likeliest cell", right, middle, KEY_FONT, INK, right=True)
        bar = pygame.image.frombuffer(SEARCH_SCALE.tobytes(), (len(SEARCH_SCALE), 1), "RGB")
        corner = (x - SCALE_SIZE[0] - 10, middle - SCALE_SIZE[1] // 2)
        canvas.blit(pygame.transform.scale(bar, SCALE_SIZE), corner)
        pygame.draw.rect(canvas, INK, (*corner, *SCALE_SIZE), width=1)
        _write(canvas, "0", corner[0] - 10, middle, KEY_FONT, INK, right=True)


def _write(
    canvas: pygame.Surface,
    text: str,
    x: int,
    middle: int,
    size: int,
    colour: Colour,
    *,
    right: bool = False,
) -> int:
    """A line of text that begins at x, or ends there; returns its other end."""
    line = lettering(text, size, colour)
    width, height = line.get_size()
    canvas.blit(line, (x - width if right else x, middle - height // 2))
    return x - width if right else x + width


def _pill(canvas: pygame.Surface, text: str, right: int, found: bool) -> int:
    """The outcome on its colour, ending at `right`; returns where it begins."""
    width, height = lettering(text, TITLE_FONT, WHITE).get_size()
    across, down = PILL
    box = pygame.Rect(0, 0, width + 2 * across, height + 2 * down)
    box.midright = (right, HEAD // 2)
    pygame.draw.rect(canvas, FOUND if found else NOT_FOUND, box, border_radius=down)
    _write(canvas, text, right - across, HEAD // 2, TITLE_FONT, WHITE, right=True)
    return int(box.left)


def _drift(vector: tuple[float, float]) -> str:
    if not any(vector):
        return "no drift"
    x, y = (signed(value).replace("-", "\N{MINUS SIGN}") for value in vector)
    return f"drift {x}, {y} cells per step"
