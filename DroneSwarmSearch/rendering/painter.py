"""The picture of a frame: a headline, one map or two, and the panel right of them."""

from __future__ import annotations

import textwrap
from dataclasses import replace

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.rendering.labels import percent
from DroneSwarmSearch.rendering.palette import GREY, INK, PAPER, WHITE, Look
from DroneSwarmSearch.rendering.panel import HEIGHT, WIDTH, draw_panel
from DroneSwarmSearch.rendering.search_map import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    SearchMap,
    outcome_colour,
)
from DroneSwarmSearch.rendering.sprites import fitted_line, write

# The views, with about the side of a map in pixels: what drones observe; prior and posterior.
SIDES = {"matrix": 720, "both": 660}
GAP = 6  # between the map's margin and the panel, in pixels
HEAD = 52  # the height of the headline
TITLE_FONT, CAPTION_FONT, OUTCOME_FONT = 32, 24, 38
REASON_LINE, REASON_LETTER = 26, 9  # its height, and about the width of a letter
CAPTIONS = "prior: the drift alone", "posterior: given the searches"


class Painter:
    """Draws frames in a view of `SIDES` above a `reason`, without a display; `size` is even."""

    def __init__(
        self, grid_size: int, look: Look | None = None, *, view: str = "matrix", reason: str = ""
    ) -> None:
        self._look = look or Look()
        self._map = SearchMap(grid_size, self._look, side=SIDES[view])
        width, height = self._map.size
        lefts = [0] if view == "matrix" else [0, width]
        self._map_areas = [pygame.Rect(left, HEAD, width, height) for left in lefts]
        right = self._map_areas[-1].right
        self._panel_area = pygame.Rect(right + GAP, HEAD + TOP, WIDTH, HEIGHT)
        self._reason_top = max(self._panel_area.bottom + BOTTOM, HEAD + height)
        width = self._panel_area.right + RIGHT
        self._reason = textwrap.wrap(reason, (width - LEFT - RIGHT) // REASON_LETTER)
        height = self._reason_top + REASON_LINE * len(self._reason)
        self.size = width + width % 2, height + height % 2

    def paint(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> pygame.Surface:
        """A new picture of a frame, or of the way `towards` the next one at `progress`, 0 to 1."""
        canvas = pygame.Surface(self.size, 0, 32)
        canvas.fill(PAPER)
        frames = [frame]
        if len(self._map_areas) == 2:
            prior = frame.matrix if frame.prior is None else frame.prior
            frames.insert(0, replace(frame, matrix=prior))
            for area, caption, seen in zip(self._map_areas, CAPTIONS, frames, strict=True):
                top, likeliest = area.top + CAPTION_FONT // 4, percent(float(seen.matrix.max()))
                write(canvas, caption, CAPTION_FONT, INK, topleft=(area.left + LEFT, top))
                corner = area.right - RIGHT, top
                write(canvas, f"likeliest cell {likeliest}", CAPTION_FONT, GREY, topright=corner)
        self._draw_head(canvas, frame)
        for area, seen in zip(self._map_areas, frames, strict=True):
            self._map.draw(canvas.subsurface(area), seen, towards or frame, progress)
        panel = canvas.subsurface(self._panel_area)
        draw_panel(panel, frame, self._look)
        for number, text in enumerate(self._reason):
            top = self._reason_top + REASON_LINE * number
            write(canvas, text, CAPTION_FONT, INK, topleft=(LEFT, top))
        return canvas

    def pixels(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> NDArray[np.uint8]:
        return to_array(self.paint(frame, towards=towards, progress=progress))

    def _draw_head(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The policy's name, and the outcome or, before the end, what a single map shows."""
        left, right = LEFT, self._map_areas[-1].right - RIGHT
        if frame.policy:
            line = fitted_line(frame.policy, TITLE_FONT, (right - left) * 0.55, INK)
            left = canvas.blit(line, line.get_rect(midleft=(left, HEAD // 2))).right + 20
        if frame.ending is not None:
            draw_outcome(canvas, frame, pygame.Rect(left, 10, right - left, HEAD - 12))
        elif len(self._map_areas) == 1:
            middle = HEAD // 2
            anchor = {"midright": (right, middle)} if frame.policy else {"midleft": (left, middle)}
            write(canvas, CAPTIONS[frame.prior is not None], CAPTION_FONT, GREY, **anchor)


def draw_outcome(canvas: pygame.Surface, frame: Frame, box: pygame.Rect) -> None:
    """Draw a box with how the episode ended."""
    assert frame.ending is not None
    pygame.draw.rect(canvas, outcome_colour(frame), box, border_radius=6)
    text = frame.outcome
    if frame.ending is not Ending.FOUND or len(frame.persons) > 1:
        text += f": {frame.ending.description}"
    line = fitted_line(text, OUTCOME_FONT, box.width - 32, WHITE)
    canvas.blit(line, line.get_rect(center=box.center))


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """A surface as a new uint8 array of shape (height, width, 3)."""
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).swapaxes(0, 1))
