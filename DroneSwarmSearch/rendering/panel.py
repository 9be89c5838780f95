"""The panel right of the map: step, persons found, drift, colour scale and legend."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import signed
from DroneSwarmSearch.rendering.palette import (
    FAINT,
    GREY,
    HIGH_FROM,
    INK,
    MIDDLE_FROM,
    N_SHADES,
    PALETTES,
    PROGRESS,
    Colour,
    shades,
)
from DroneSwarmSearch.rendering.sprites import text_line, write

__all__ = ["Panel", "symbol_images", "vector_component"]

WIDTH, LEAST_HEIGHT = 232, 690

HEADING, SMALL, BODY, LARGE = 18, 19, 22, 42
"""Font sizes."""

PROGRESS_TOP, PROGRESS_HEIGHT = 54, 7
FOUND_TOP = 92
DRIFT_TOP = 160
SCALE_TOP = 288
SYMBOLS_TOP = 376
DRONES_TOP = 520
"""Distances from the upper edge in pixels."""

RULE_ABOVE = 16
COMPASS = 78
SCALE_HEIGHT = 16
LABEL_GAP = 6
SYMBOL_ROW = 30
SYMBOL_LEAST, SYMBOL_MOST = 15, 24

FINDERS_NAMED = 4
"""Drones named as finders; of more, only the first ones."""

DRONE_COLUMNS = 5
DRONE_ROW = 27
DRONE_SYMBOL = 20


class Panel:
    """Draws the panel on surfaces of its `size`.

    Args:
        symbol: side of a drone on the map in pixels; the legend shows it at this size.
        gradient: whether cells are coloured smoothly.
        palette: a name in `PALETTES`.
        least_height: in pixels.

    Attributes:
        size: width and height in pixels.
    """

    def __init__(self, *, symbol: int, gradient: bool, palette: str, least_height: int) -> None:
        self.size = WIDTH, max(least_height, LEAST_HEIGHT)
        self._symbol = min(max(symbol, SYMBOL_LEAST), SYMBOL_MOST)
        self._gradient = gradient
        self._palette = PALETTES[palette]

    def draw(self, canvas: pygame.Surface, frame: Frame) -> None:
        """Draw the values of a frame on a surface with the fixed parts."""
        self._draw_step(canvas, frame)
        self._draw_found(canvas, frame)
        self._draw_drift(canvas, frame.vector)
        self._draw_limits(canvas, float(frame.matrix.max()))
        self._draw_drones(canvas, len(frame.drones))

    def draw_fixed(self, canvas: pygame.Surface) -> None:
        """Draw headings, colour scale and symbols, which are the same for every frame."""
        write(canvas, "STEP", HEADING, GREY, topleft=(0, 0))
        for heading, top in (
            ("PERSONS FOUND", FOUND_TOP),
            ("DRIFT, CELLS PER STEP", DRIFT_TOP),
            ("PROBABILITY OF A CELL, %", SCALE_TOP),
            ("SYMBOLS", SYMBOLS_TOP),
            ("DRONES", DRONES_TOP),
        ):
            pygame.draw.line(canvas, FAINT, (0, top - RULE_ABOVE), (WIDTH - 1, top - RULE_ABOVE))
            write(canvas, heading, HEADING, GREY, topleft=(0, top))
        shares = np.linspace(0.0, 1.0, N_SHADES, dtype=np.float32)
        colours = self._palette.ramp[shades(shares, self._gradient)]
        bar = pygame.image.frombuffer(colours.tobytes(), (N_SHADES, 1), "RGB")
        place = pygame.Rect(0, SCALE_TOP + 22, WIDTH, SCALE_HEIGHT)
        canvas.blit(pygame.transform.scale(bar, place.size), place)
        pygame.draw.rect(canvas, INK, place, width=1)
        self._draw_symbols(canvas)

    def _draw_symbols(self, canvas: pygame.Surface) -> None:
        images = symbol_images(self._symbol, SYMBOL_MOST + 4, self._palette.drone(0))
        half = WIDTH // 2
        for left, row, name, meaning in (
            (0, 0, "drone", "drone"),
            (half, 0, "searching", "searching"),
            (0, 1, "person", "person"),
            (half, 1, "collision", "collision"),
            (0, 2, "found", "found, in the drone's colour"),
        ):
            middle = SYMBOLS_TOP + 36 + row * SYMBOL_ROW
            for image in images[name]:
                canvas.blit(image, image.get_rect(center=(left + SYMBOL_MOST // 2 + 2, middle)))
            write(canvas, meaning, SMALL, INK, midleft=(left + SYMBOL_MOST + 14, middle))

    def _draw_step(self, canvas: pygame.Surface, frame: Frame) -> None:
        _write_ratio(canvas, frame.step, frame.timestep_limit, 18, LARGE)
        bar = pygame.Rect(0, PROGRESS_TOP, WIDTH, PROGRESS_HEIGHT)
        pygame.draw.rect(canvas, FAINT, bar, border_radius=PROGRESS_HEIGHT // 2)
        bar.width = round(WIDTH * min(1.0, frame.step / frame.timestep_limit))
        if bar.width:
            pygame.draw.rect(canvas, PROGRESS, bar, border_radius=PROGRESS_HEIGHT // 2)

    def _draw_found(self, canvas: pygame.Surface, frame: Frame) -> None:
        _write_ratio(canvas, sum(frame.found), len(frame.persons), FOUND_TOP + 18, LARGE - 8)
        finders = sorted({drone for drone in frame.found_by if drone is not None})
        if finders:
            names = ", ".join(map(str, finders[:FINDERS_NAMED]))
            more = ", ..." if len(finders) > FINDERS_NAMED else ""
            noun = "drones" if len(finders) > 1 else "drone"
            text = f"by {noun} {names}{more}"
            write(canvas, text, SMALL, INK, topright=(WIDTH, FOUND_TOP + 25))

    def _draw_drift(self, canvas: pygame.Surface, vector: tuple[float, float]) -> None:
        top = DRIFT_TOP + 22
        canvas.blit(sprites.compass(COMPASS, vector), (0, top))
        left = COMPASS + 22
        for name, value, middle in (
            ("x", vector[0], top + COMPASS // 2 - 14),
            ("y", vector[1], top + COMPASS // 2 + 14),
        ):
            write(canvas, name, BODY, GREY, midleft=(left, middle))
            write(canvas, vector_component(value), BODY + 4, INK, midleft=(left + 22, middle))

    def _draw_limits(self, canvas: pygame.Surface, maximum: float) -> None:
        """The probabilities at the limits of the colour scale."""
        limits = (0.0, 0.5, 1.0) if self._gradient else (0.0, MIDDLE_FROM, HIGH_FROM, 1.0)
        foot = SCALE_TOP + 22 + SCALE_HEIGHT
        room = WIDTH
        for share in reversed(limits):
            at = min(round(share * WIDTH), WIDTH - 1)
            pygame.draw.line(canvas, INK, (at, foot), (at, foot + 3))
            label = text_line(_percentage(share * maximum), SMALL, INK)
            width = label.get_width()
            left = max(0, min(at - width // 2, room - width))
            canvas.blit(label, (left, foot + 7))
            room = left - LABEL_GAP

    def _draw_drones(self, canvas: pygame.Surface, drones: int) -> None:
        """The drones' colours and numbers, as many as fit."""
        write(canvas, f"{drones}", HEADING, GREY, topright=(WIDTH, DRONES_TOP))
        rows = (self.size[1] - DRONES_TOP - 22) // DRONE_ROW
        shown = drones if drones <= rows * DRONE_COLUMNS else (rows - 1) * DRONE_COLUMNS
        for number in range(shown):
            row, column = divmod(number, DRONE_COLUMNS)
            middle = DRONES_TOP + 34 + row * DRONE_ROW
            left = column * WIDTH // DRONE_COLUMNS
            image = sprites.drone(min(self._symbol, DRONE_SYMBOL), self._palette.drone(number))
            canvas.blit(image, image.get_rect(center=(left + DRONE_SYMBOL // 2, middle)))
            write(canvas, f"{number}", SMALL, INK, midleft=(left + DRONE_SYMBOL + 4, middle))
        if shown < drones:
            middle = DRONES_TOP + 34 + (rows - 1) * DRONE_ROW
            write(canvas, f"and {drones - shown} more", SMALL, GREY, midleft=(0, middle))


def symbol_images(side: int, ring: int, colour: Colour) -> dict[str, tuple[pygame.Surface, ...]]:
    """The images of each symbol for a legend, the lowest first.

    Args:
        side: side of a symbol in pixels.
        ring: side of the marks around drones.
        colour: the drone's colour.
    """
    drone, small = sprites.drone(side, colour), sprites.drone(side - 4, colour)
    return {
        "drone": (drone,),
        "searching": (sprites.search_ring(ring), small),
        "collision": (sprites.collision(ring + 2), small),
        "person": (sprites.person(side),),
        "found": (sprites.found(side, colour),),
    }


def vector_component(value: float) -> str:
    """A component of the drift with a typographic minus sign."""
    return signed(value).replace("-", "\N{MINUS SIGN}")


def _percentage(probability: float) -> str:
    """A probability in percent, in at most six characters."""
    value = 100 * probability
    if value == 0.0 or value >= 0.01:
        return f"{value:.3g}"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def _write_ratio(canvas: pygame.Surface, part: int, whole: int, top: int, size: int) -> None:
    """A large number, and on the same base line a small "of" with the total."""
    figure = write(canvas, f"{part}", size, INK, topleft=(0, top))
    # The base line of this font is at 0.8 of the line's height.
    base = top + 0.8 * figure.height
    rest = text_line(f"of {whole}", BODY, GREY)
    canvas.blit(rest, (figure.right + 7, round(base - 0.8 * rest.get_height())))
