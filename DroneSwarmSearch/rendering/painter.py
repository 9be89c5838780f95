"""The picture of a frame: a headline, one map or two, and the panel beside them or below."""

from __future__ import annotations

import textwrap
from dataclasses import replace

import numpy as np
import pygame
from numpy.typing import NDArray

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.rendering import panel
from DroneSwarmSearch.rendering.labels import percent
from DroneSwarmSearch.rendering.palette import GREY, INK, PAPER, WHITE, Look
from DroneSwarmSearch.rendering.search_map import (
    BOTTOM,
    ENDING_BORDER,
    LEFT,
    RIGHT,
    TOP,
    SearchMap,
    outcome_colour,
)
from DroneSwarmSearch.rendering.sprites import fitted_line, write

# The views, with about the side of a map in pixels: what drones observe; prior and posterior; and
# a small one for pages and papers, with what drones observe, but without coordinates.
SIDES = {"matrix": 720, "both": 660, "film": 460}
GAP = 6  # between the map's margin and the panel, in pixels
HEAD = 52  # the height of the headline
FILM_MARGIN = 10
TITLE_FONT = 32
CAPTION_FONT = 24
OUTCOME_FONT = 38
# its height, and about the width of a letter
REASON_LINE = 26
REASON_LETTER = 9
CAPTIONS = "prior: the drift alone", "posterior: given the searches"


class Painter:
    """Draws frames in a view of `SIDES` above a `reason`, without a display; `size` is even."""

    def __init__(
        self, grid_size: int, look: Look | None = None, *, view: str = "matrix", reason: str = ""
    ) -> None:
        self._look = look or Look()
        self._map = SearchMap(grid_size, self._look, side=SIDES[view])
        self._is_film = view == "film"
        if self._is_film:
            self._place_for_pages()
        else:
            self._place_for_windows(maps=2 if view == "both" else 1)
        letters = (self._right - self._left) // REASON_LETTER
        self._reason = textwrap.wrap(reason, letters)
        width = self._right + self._margin
        height = self._reason_top + REASON_LINE * len(self._reason)
        self.size = width + width % 2, height + height % 2

    def _place_for_windows(self, maps: int) -> None:
        """Place maps with their coordinates from left to right, and the panel right of them."""
        width, height = self._map.size
        self._shown = pygame.Rect(0, 0, width, height)  # the part of each map's surface
        self._map_areas = [
            pygame.Rect(width * number, HEAD, width, height) for number in range(maps)
        ]
        beside = self._map_areas[-1].right + GAP
        self._panel_area = pygame.Rect(beside, HEAD + TOP, panel.WIDTH, panel.HEIGHT)
        self._left = LEFT
        self._right = self._panel_area.right
        self._head_right = self._map_areas[-1].right - RIGHT
        self._margin = RIGHT
        self._reason_top = max(self._panel_area.bottom + BOTTOM, HEAD + height)

    def _place_for_pages(self) -> None:
        """Place a map without coordinates, and what changes of the panel below it."""
        side = self._map.side + 2 * ENDING_BORDER
        self._shown = pygame.Rect(LEFT - ENDING_BORDER, TOP - ENDING_BORDER, side, side)
        width = max(side, panel.FILM_WIDTH)
        self._left = FILM_MARGIN
        self._right = self._head_right = self._left + width
        self._margin = FILM_MARGIN
        self._map_areas = [pygame.Rect(self._left + (width - side) // 2, HEAD, side, side)]
        self._panel_area = pygame.Rect(
            self._left + (width - panel.FILM_WIDTH) // 2,
            HEAD + side + FILM_MARGIN,
            panel.FILM_WIDTH,
            panel.FILM_HEIGHT,
        )
        self._reason_top = self._panel_area.bottom + FILM_MARGIN

    def paint(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> pygame.Surface:
        """A new picture of a frame, or of the way `towards` the next one at `progress`, 0 to 1."""
        canvas = pygame.Surface(self.size, 0, 32)
        canvas.fill(PAPER)
        self._draw_head(canvas, frame)
        frames = [frame]
        if len(self._map_areas) == 2:
            prior = frame.matrix if frame.prior is None else frame.prior
            frames.insert(0, replace(frame, matrix=prior))
        for area, seen in zip(self._map_areas, frames, strict=True):
            drawn = pygame.Surface(self._map.size, 0, 32)
            drawn.fill(PAPER)
            self._map.draw(drawn, seen, towards or frame, progress)
            canvas.blit(drawn, area, self._shown)
        if len(frames) == 2:
            self._draw_captions(canvas, frames)
        below = canvas.subsurface(self._panel_area)
        if self._is_film:
            panel.draw_film_panel(below, frame)
        else:
            panel.draw_panel(below, frame, self._look)
        for number, text in enumerate(self._reason):
            top = self._reason_top + REASON_LINE * number
            write(canvas, text, CAPTION_FONT, INK, topleft=(self._left, top))
        return canvas

    def pixels(
        self, frame: Frame, *, towards: Frame | None = None, progress: float = 0.0
    ) -> NDArray[np.uint8]:
        """The same picture as a new array, uint8, shape (height, width, 3)."""
        picture = self.paint(frame, towards=towards, progress=progress)
        return np.ascontiguousarray(pygame.surfarray.array3d(picture).swapaxes(0, 1))

    def _draw_captions(self, canvas: pygame.Surface, frames: list[Frame]) -> None:
        """What each of two maps shows, and its highest probability."""
        for area, caption, seen in zip(self._map_areas, CAPTIONS, frames, strict=True):
            top = area.top + CAPTION_FONT // 4
            likeliest = f"likeliest cell {percent(float(seen.matrix.max()))}"
            write(canvas, caption, CAPTION_FONT, INK, topleft=(area.left + LEFT, top))
            write(canvas, likeliest, CAPTION_FONT, GREY, topright=(area.right - RIGHT, top))

    def _draw_head(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The policy's name, and the outcome or, before the end, what a single map shows."""
        left = self._left
        right = self._head_right
        if frame.policy:
            line = fitted_line(frame.policy, TITLE_FONT, (right - left) * 0.55, INK)
            left = canvas.blit(line, line.get_rect(midleft=(left, HEAD // 2))).right + 20
        if frame.ending is not None:
            _draw_outcome(canvas, frame, pygame.Rect(left, 10, right - left, HEAD - 18))
        elif len(self._map_areas) == 1:
            caption = CAPTIONS[frame.prior is not None]
            if frame.viewer is not None:
                caption = f"what drone {frame.viewer} knows"
            elif frame.links is not None:
                caption = "what all drones together know"
            line = fitted_line(caption, CAPTION_FONT, right - left, GREY)
            anchor = {"midright": (right, HEAD // 2)}
            if not frame.policy:
                anchor = {"midleft": (left, HEAD // 2)}
            canvas.blit(line, line.get_rect(**anchor))


def _draw_outcome(canvas: pygame.Surface, frame: Frame, box: pygame.Rect) -> None:
    """Draw a box with how the episode ended."""
    assert frame.ending is not None
    pygame.draw.rect(canvas, outcome_colour(frame), box, border_radius=6)
    text = frame.outcome
    if frame.ending is not Ending.FOUND:
        text += f": {frame.ending.description}"
    line = fitted_line(text, OUTCOME_FONT, box.width - 32, WHITE)
    canvas.blit(line, line.get_rect(center=box.center))
