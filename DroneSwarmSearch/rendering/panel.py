"""The panel right of the board: clock, score, drift, colour scale and the key."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import signed
from DroneSwarmSearch.rendering.layout import PANEL_WIDTH
from DroneSwarmSearch.rendering.palette import (
    FAINT,
    GREEN_FROM,
    GREY,
    INK,
    LEVELS,
    YELLOW_FROM,
    Colour,
    drone_colour,
    levels,
)
from DroneSwarmSearch.rendering.sprites import lettering

__all__ = ["Panel"]

HEADING, SMALL, BODY, LARGE = 18, 19, 22, 42
"""Font sizes, as pygame counts them."""

BAR: Colour = (52, 92, 148)

BAR_TOP, BAR_HEIGHT = 54, 7
FOUND_TOP = 92
DRIFT_TOP = 160
SCALE_TOP = 288
SYMBOLS_TOP = 376
DRONES_TOP = 520
"""Distances from the upper edge of the panel, in pixels."""

RULE_ABOVE = 16
COMPASS = 78
SCALE_HEIGHT = 16
LABEL_GAP = 6
SYMBOL_ROW = 30
SYMBOL_LEAST, SYMBOL_MOST = 15, 24
SMALLEST_PLAIN = 0.01
"""Percentages below this are written as 9.4e-3."""

KEY_COLUMNS = 5
KEY_ROW = 27
KEY_SYMBOL = 20


class Panel:
    """Draws the panel of one picture.

    Args:
        left: left edge in the picture, in pixels.
        top: upper edge in the picture, in pixels.
        height: in pixels.
        symbol: side of a drone on the board, in pixels: the key shows what it looks like.
        gradient: whether cells are coloured smoothly.
    """

    def __init__(self, *, left: int, top: int, height: int, symbol: int, gradient: bool) -> None:
        self._left = left
        self._top = top
        self._height = height
        self._symbol = min(max(symbol, SYMBOL_LEAST), SYMBOL_MOST)
        self._gradient = gradient

    def draw_fixed(self, canvas: pygame.Surface) -> None:
        """What is the same in every frame."""
        self._write(canvas, "STEP", 0, HEADING, GREY)
        for title, top in (
            ("PERSONS FOUND", FOUND_TOP),
            ("DRIFT, CELLS PER STEP", DRIFT_TOP),
            ("PROBABILITY OF A CELL, %", SCALE_TOP),
            ("SYMBOLS", SYMBOLS_TOP),
            ("DRONES", DRONES_TOP),
        ):
            self._rule(canvas, top - RULE_ABOVE)
            self._write(canvas, title, top, HEADING, GREY)
        self._meanings(canvas)

    def _meanings(self, canvas: pygame.Surface) -> None:
        """What the symbols stand for."""
        side, colour = self._symbol, drone_colour(0)
        drone, small = sprites.drone(side, colour), sprites.drone(side - 4, colour)
        searching = [sprites.search_mark(SYMBOL_MOST + 4), small]
        colliding = [sprites.burst(SYMBOL_MOST + 6), small]
        half = PANEL_WIDTH // 2
        for left, row, icons, meaning in (
            (0, 0, [drone], "drone"),
            (half, 0, searching, "searching"),
            (0, 1, [sprites.person(side, False)], "person"),
            (half, 1, [sprites.person(side, True)], "found"),
            (0, 2, colliding, "drones in the same cell"),
        ):
            middle = SYMBOLS_TOP + 36 + row * SYMBOL_ROW
            for icon in icons:
                self._centred(canvas, icon, left + SYMBOL_MOST // 2 + 2, middle)
            self._write_middle(canvas, meaning, left + SYMBOL_MOST + 14, middle, SMALL, INK)

    def draw(self, canvas: pygame.Surface, frame: Frame, scale: NDArray[np.uint8]) -> None:
        """What changes from frame to frame; `scale` is the one the board is drawn in."""
        self._clock(canvas, frame)
        found = f"{sum(frame.found)}"
        self._fraction(canvas, found, f"of {len(frame.persons)}", FOUND_TOP + 18, LARGE - 8)
        self._drift(canvas, frame.vector)
        self._scale(canvas, float(frame.matrix.max()), scale)
        self._key(canvas, len(frame.drones))

    def _clock(self, canvas: pygame.Surface, frame: Frame) -> None:
        self._fraction(canvas, f"{frame.step}", f"of {frame.timestep_limit}", 18, LARGE)
        bar = pygame.Rect(self._left, self._top + BAR_TOP, PANEL_WIDTH, BAR_HEIGHT)
        pygame.draw.rect(canvas, FAINT, bar, border_radius=BAR_HEIGHT // 2)
        bar.width = round(PANEL_WIDTH * min(1.0, frame.step / frame.timestep_limit))
        if bar.width:
            pygame.draw.rect(canvas, BAR, bar, border_radius=BAR_HEIGHT // 2)

    def _fraction(self, canvas: pygame.Surface, part: str, whole: str, top: int, size: int) -> None:
        """A large figure, and small and on the same base line what it is of."""
        figure = lettering(part, size, INK)
        rest = lettering(whole, BODY, GREY)
        self._blit(canvas, figure, 0, top)
        # A line of this font reaches as far below its base line as 0.2 of its height.
        base = top + 0.8 * figure.get_height()
        self._blit(canvas, rest, figure.get_width() + 7, round(base - 0.8 * rest.get_height()))

    def _drift(self, canvas: pygame.Surface, vector: tuple[float, float]) -> None:
        top = DRIFT_TOP + 22
        self._blit(canvas, sprites.arrow(COMPASS, vector), 0, top)
        left = COMPASS + 22
        for name, value, middle in (
            ("x", vector[0], top + COMPASS // 2 - 14),
            ("y", vector[1], top + COMPASS // 2 + 14),
        ):
            self._write_middle(canvas, name, left, middle, BODY, GREY)
            figure = signed(value).replace("-", "\N{MINUS SIGN}")
            self._write_middle(canvas, figure, left + 22, middle, BODY + 4, INK)

    def _scale(self, canvas: pygame.Surface, top_value: float, scale: NDArray[np.uint8]) -> None:
        """The colours from left to right, with the probabilities at their limits."""
        shares = np.linspace(0.0, 1.0, LEVELS, dtype=np.float32)
        colours = scale[levels(shares, self._gradient)]
        bar = pygame.image.frombuffer(colours.tobytes(), (LEVELS, 1), "RGB")
        top = SCALE_TOP + 22
        size = (PANEL_WIDTH, SCALE_HEIGHT)
        self._blit(canvas, pygame.transform.scale(bar, size), 0, top)
        outline = pygame.Rect(self._left, self._top + top, *size)
        pygame.draw.rect(canvas, INK, outline, width=1)
        limits = (0.0, 0.5, 1.0) if self._gradient else (0.0, YELLOW_FROM, GREEN_FROM, 1.0)
        room = PANEL_WIDTH
        for share in reversed(limits):
            at = min(round(share * PANEL_WIDTH), PANEL_WIDTH - 1)
            foot = self._top + top + SCALE_HEIGHT
            pygame.draw.line(canvas, INK, (self._left + at, foot), (self._left + at, foot + 3))
            label = lettering(_percentage(share * top_value), SMALL, INK)
            width = label.get_width()
            left = max(0, min(at - width // 2, room - width))
            self._blit(canvas, label, left, top + SCALE_HEIGHT + 7)
            room = left - LABEL_GAP

    def _key(self, canvas: pygame.Surface, drones: int) -> None:
        """The drones' colours with their numbers, as many as there is room for."""
        count = lettering(f"{drones}", HEADING, GREY)
        self._blit(canvas, count, PANEL_WIDTH - count.get_width(), DRONES_TOP)
        rows = (self._height - DRONES_TOP - 22) // KEY_ROW
        shown = drones
        if drones > rows * KEY_COLUMNS:
            shown = (rows - 1) * KEY_COLUMNS
        for number in range(shown):
            row, column = divmod(number, KEY_COLUMNS)
            middle = DRONES_TOP + 34 + row * KEY_ROW
            left = column * PANEL_WIDTH // KEY_COLUMNS
            icon = sprites.drone(min(self._symbol, KEY_SYMBOL), drone_colour(number))
            self._centred(canvas, icon, left + KEY_SYMBOL // 2, middle)
            self._write_middle(canvas, f"{number}", left + KEY_SYMBOL + 4, middle, SMALL, INK)
        if shown < drones:
            middle = DRONES_TOP + 34 + (rows - 1) * KEY_ROW
            self._write_middle(canvas, f"and {drones - shown} more", 0, middle, SMALL, GREY)

    def _rule(self, canvas: pygame.Surface, top: int) -> None:
        y = self._top + top
        pygame.draw.line(canvas, FAINT, (self._left, y), (self._left + PANEL_WIDTH - 1, y))

    def _write(
        self, canvas: pygame.Surface, text: str, top: int, size: int, colour: Colour
    ) -> None:
        self._blit(canvas, lettering(text, size, colour), 0, top)

    def _write_middle(
        self, canvas: pygame.Surface, text: str, left: int, middle: int, size: int, colour: Colour
    ) -> None:
        line = lettering(text, size, colour)
        self._blit(canvas, line, left, middle - line.get_height() // 2)

    def _centred(self, canvas: pygame.Surface, icon: pygame.Surface, x: int, y: int) -> None:
        self._blit(canvas, icon, x - icon.get_width() // 2, y - icon.get_height() // 2)

    def _blit(self, canvas: pygame.Surface, image: pygame.Surface, left: int, top: int) -> None:
        canvas.blit(image, (self._left + left, self._top + top))


def _percentage(probability: float) -> str:
    """A probability in percent, in six characters at most."""
    value = 100 * probability
    if value == 0.0 or value >= SMALLEST_PLAIN:
        return f"{value:.3g}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}e{int(exponent)}"
