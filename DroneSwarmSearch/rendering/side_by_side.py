"""Two maps side by side: one moment of a search, over the prior and over the posterior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief
from DroneSwarmSearch.rendering.painter import to_array
from DroneSwarmSearch.rendering.palette import (
    GREY,
    INK,
    N_SHADES,
    PALETTES,
    PAPER,
    WHITE,
)
from DroneSwarmSearch.rendering.panel import draw_weights, symbol_images, vector_component
from DroneSwarmSearch.rendering.search_map import RIGHT, SearchMap, outcome_colour
from DroneSwarmSearch.rendering.sprites import text_line, write
from DroneSwarmSearch.rules import Ending

__all__ = ["SideBySide"]

HEAD, CAPTION, FOOT, HYPOTHESES = 74, 30, 84, 48
"""Heights of the title, the captions, the legend and the hypotheses, in pixels."""

TITLE_FONT, CAPTION_FONT, LEGEND_FONT = 46, 36, 32
"""Font sizes; a GIF shows them at two thirds."""

MARGIN, GAP = 46, 40
SYMBOL_LEAST, SYMBOL_MOST = 17, 34
OUTCOME_PADDING = (18, 8)
SCALE_SIZE = (180, 20)
WEIGHTS_FONT, WEIGHTS_HEIGHT = 28, 28
PERSONS_SHOWN = 3


class SideBySide:
    """Draws pictures of two maps with a title, captions and a legend.

    Args:
        grid_size: cells along each side.
        title: written smaller if it does not fit.
        palette: the colours of the cells, a name in `palette.PALETTES`.
    """

    def __init__(self, grid_size: int, title: str, palette: str = "classic") -> None:
        self._title = title
        self._palette = PALETTES[palette]
        self._map = SearchMap(grid_size, render_grid=True, palette=palette)
        self._symbol = min(max(self._map.symbol, SYMBOL_LEAST), SYMBOL_MOST)
        width, height = self._map.size
        height += HEAD + CAPTION + FOOT
        self._size = 2 * width, height + height % 2

    def pixels(self, prior: Frame, posterior: Frame) -> NDArray[np.uint8]:
        """The picture of a step: a new uint8 array of shape (height, width, 3), both even.

        It is higher if there are several hypotheses about a person.

        Args:
            prior: the frame with the prior as its matrix.
            posterior: the same frame with the posterior.
        """
        width, height = self._size
        if posterior.uncertain_persons:
            height += HYPOTHESES
        canvas = pygame.Surface((width, height), 0, 32)
        canvas.fill(PAPER)
        self._draw_head(canvas, posterior)
        for left, frame, caption in (
            (0, prior, "prior: the drift alone"),
            (self._map.size[0], posterior, "posterior: given the searches made"),
        ):
            area = canvas.subsurface((left, HEAD + CAPTION), self._map.size)
            self._map.draw_fixed(area)
            self._map.draw(area, frame, banner=False)
            middle, right = HEAD + CAPTION // 2, left + self._map.size[0] - RIGHT
            write(canvas, caption, CAPTION_FONT, INK, midleft=(left + MARGIN, middle))
            maximum = f"likeliest cell {100 * float(frame.matrix.max()):.2f}%"
            write(canvas, maximum, CAPTION_FONT, GREY, midright=(right, middle))
        self._draw_legend(canvas, posterior)
        if posterior.uncertain_persons:
            self._draw_hypotheses(canvas, posterior)
        return to_array(canvas)

    def _draw_head(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The title on the left; the step or the outcome on the right."""
        right, middle = self._size[0] - RIGHT, HEAD // 2
        status = [] if frame.ending else [f"step {frame.step} of {frame.timestep_limit}"]
        if frame.ending:
            right = _draw_outcome(canvas, frame, right, middle) - GAP
        if frame.probability_of_success is not None:
            status.insert(0, f"POS {frame.probability_of_success:.1%}")
        if len(frame.persons) > 1 and frame.ending is not Ending.FOUND:
            status.insert(0, f"{sum(frame.found)} of {len(frame.persons)} found")
        written = write(canvas, "   ".join(status), TITLE_FONT, INK, midright=(right, middle))
        room = written.left - GAP - MARGIN
        width = text_line(self._title, TITLE_FONT, INK).get_width()
        font = min(TITLE_FONT, TITLE_FONT * room // width)
        write(canvas, self._title, font, INK, midleft=(MARGIN, middle))

    def _draw_legend(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The meaning of symbols, arrow and colours."""
        middle = self._size[1] - FOOT // 2 - 6
        images = symbol_images(self._symbol, self._symbol + 9, self._palette.drone(0))
        x = MARGIN
        names = ("drone", "searching", "person", "found")
        symbols = [(images[name], name) for name in names[: 4 if frame.persons else 2]]
        compass = sprites.compass(SYMBOL_MOST + 14, frame.vector)
        for drawn, meaning in (*symbols, ((compass,), _drift(frame.vector))):
            width = max(image.get_width() for image in drawn)
            for image in drawn:
                canvas.blit(image, image.get_rect(center=(x + width // 2, middle)))
            text_left = x + width + 10
            text = write(canvas, meaning, LEGEND_FONT, INK, midleft=(text_left, middle))
            x = text.right + GAP
        right = self._size[0] - RIGHT
        text = write(canvas, "likeliest cell", LEGEND_FONT, INK, midright=(right, middle))
        bar = pygame.image.frombuffer(self._palette.ramp.tobytes(), (N_SHADES, 1), "RGB")
        place = pygame.Rect((0, 0), SCALE_SIZE)
        place.midright = (text.left - 10, middle)
        canvas.blit(pygame.transform.scale(bar, SCALE_SIZE), place)
        pygame.draw.rect(canvas, INK, place, width=1)
        write(canvas, "0", LEGEND_FONT, INK, midright=(place.left - 10, middle))

    def _draw_hypotheses(self, canvas: pygame.Surface, frame: Frame) -> None:
        """A line with the probabilities of the hypotheses about the first persons."""
        middle = self._size[1] + HYPOTHESES // 2 - 16
        left = write(canvas, "hypotheses", LEGEND_FONT, INK, midleft=(MARGIN, middle)).right + GAP
        right = self._size[0] - RIGHT
        persons = frame.shown_uncertain_persons
        if len(persons) > PERSONS_SHOWN:
            text = f"and {len(persons) - PERSONS_SHOWN} more"
            right = write(canvas, text, LEGEND_FONT, GREY, midright=(right, middle)).left - GAP
        shown = persons[:PERSONS_SHOWN]
        width = (right - left + GAP) // max(len(shown), 1)
        for place, person in enumerate(shown):
            x = left + place * width
            if len(frame.hypotheses) > 1:
                x = write(canvas, f"person {person}", LEGEND_FONT, GREY, midleft=(x, middle)).right
                x += 10
            bar = pygame.Rect(x, 0, left + (place + 1) * width - GAP - x, WEIGHTS_HEIGHT)
            bar.centery = middle
            draw_weights(canvas, frame.hypotheses[person], bar, WEIGHTS_FONT)


def _draw_outcome(canvas: pygame.Surface, frame: Frame, right: int, middle: int) -> int:
    """The outcome on its colour, ending at `right`; returns its left end."""
    across, down = OUTCOME_PADDING
    line = text_line(outcome_in_brief(frame), TITLE_FONT, WHITE)
    box = line.get_rect().inflate(2 * across, 2 * down)
    box.midright = (right, middle)
    pygame.draw.rect(canvas, outcome_colour(frame), box, border_radius=down)
    canvas.blit(line, box.move(across, down))
    return int(box.left)


def _drift(vector: tuple[float, float]) -> str:
    if not any(vector):
        return "no drift"
    x, y = map(vector_component, vector)
    return f"drift {x}, {y} cells per step"
