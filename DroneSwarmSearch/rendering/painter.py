"""The picture of a frame: a headline, one map or two, and the panel right of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.labels import percent
from DroneSwarmSearch.rendering.palette import CLASSIC, GREY, INK, PAPER, WHITE, Look
from DroneSwarmSearch.rendering.panel import Panel
from DroneSwarmSearch.rendering.search_map import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    SearchMap,
    outcome_colour,
)
from DroneSwarmSearch.rendering.sprites import fitted_line, write
from DroneSwarmSearch.rules import Ending

__all__ = ["Painter", "to_array"]

SIDES = {"matrix": 720, "both": 660}
"""The views with the approximate side of a map in pixels: "matrix" is one map, of what the drones
observe; "both" has the prior left of the posterior."""

GAP = 6
"""Pixels between the map's margin and the panel."""

HEAD = 52
"""The height of the headline."""

TITLE_FONT, CAPTION_FONT, OUTCOME_FONT = 32, 24, 38
TITLE_SHARE, TITLE_GAP = 0.55, 20
OUTCOME_PADDING = 16

PRIOR, POSTERIOR = "prior: the drift alone", "posterior: given the searches"


class Painter:
    """Draws frames of one grid size; needs no display and starts none.

    Args:
        grid_size: cells along each side.
        look: how the cells are drawn.
        view: a key of `SIDES`.
    """

    def __init__(self, grid_size: int, look: Look = CLASSIC, *, view: str = "matrix") -> None:
        self._view = view
        self._map = SearchMap(grid_size, look, side=SIDES[view])
        self._panel = Panel(look, symbol=self._map.symbol, least_height=self._map.side)
        width, height = self._map.size
        lefts = [0] if view == "matrix" else [0, width]
        self._map_areas = [pygame.Rect(left, HEAD, width, height) for left in lefts]
        right = self._map_areas[-1].right
        self._panel_area = pygame.Rect((right + GAP, HEAD + TOP), self._panel.size)
        height = max(self._panel_area.bottom + BOTTOM, HEAD + height)
        width = self._panel_area.right + RIGHT
        self._size = width + width % 2, height + height % 2

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures in pixels; both even, as video codecs require."""
        return self._size

    def paint(
        self, frame: Frame, *, previous: Frame | None = None, progress: float = 1.0
    ) -> pygame.Surface:
        """A new surface of `size` with the picture of a frame, or of a moment before it.

        Args:
            frame: the frame.
            previous: the frame one step earlier.
            progress: how much of the step from `previous` has passed, 0 to 1. Below 1, drones
                and persons are on their way, and everything else is as in `previous`.

        Raises:
            ValueError: a frame is of another grid size.
        """
        moving = previous if previous is not None and progress < 1.0 else None
        scene = frame if moving is None else moving
        canvas = pygame.Surface(self.size, 0, 32)
        canvas.fill(PAPER)
        self._draw_head(canvas, scene)
        for area, shown in zip(self._map_areas, self._maps(scene), strict=True):
            target = frame if moving is not None else None
            self._map.draw(canvas.subsurface(area), shown, towards=target, progress=progress)
        self._panel.draw(canvas.subsurface(self._panel_area), scene)
        return canvas

    def pixels(
        self, frame: Frame, *, previous: Frame | None = None, progress: float = 1.0
    ) -> NDArray[np.uint8]:
        """`paint` as a new uint8 array of shape (height, width, 3)."""
        return to_array(self.paint(frame, previous=previous, progress=progress))

    def _maps(self, frame: Frame) -> list[Frame]:
        """What each map shows."""
        if self._view == "matrix":
            return [frame]
        prior = frame.matrix if frame.prior is None else frame.prior
        return [replace(frame, matrix=prior), frame]

    def _draw_head(self, canvas: pygame.Surface, frame: Frame) -> None:
        """The outcome, or before the end the policy's name; and what the maps show."""
        captions = [PRIOR, POSTERIOR]
        if self._view == "both":
            maps = self._maps(frame)
            for area, caption, shown in zip(self._map_areas, captions, maps, strict=True):
                top = area.top + CAPTION_FONT // 4
                write(canvas, caption, CAPTION_FONT, INK, topleft=(area.left + LEFT, top))
                likeliest = f"likeliest cell {percent(float(shown.matrix.max()))}"
                write(canvas, likeliest, CAPTION_FONT, GREY, topright=(area.right - RIGHT, top))
        left, right = LEFT, self._map_areas[-1].right - RIGHT
        if frame.policy:
            line = fitted_line(frame.policy, TITLE_FONT, (right - left) * TITLE_SHARE, INK)
            left = canvas.blit(line, line.get_rect(midleft=(left, HEAD // 2))).right + TITLE_GAP
        if frame.ending is not None:
            self._draw_outcome(canvas, frame, pygame.Rect(left, 10, right - left, HEAD - 12))
        elif self._view == "matrix":
            caption = captions[frame.prior is not None]
            anchor = {"midright": (right, HEAD // 2)}
            if not frame.policy:
                anchor = {"midleft": (left, HEAD // 2)}
            write(canvas, caption, CAPTION_FONT, GREY, **anchor)

    def _draw_outcome(self, canvas: pygame.Surface, frame: Frame, box: pygame.Rect) -> None:
        """The outcome in white on its colour."""
        text, ending = frame.outcome, frame.ending
        if ending is not None and (ending is not Ending.FOUND or len(frame.persons) > 1):
            text += f": {ending.description}"
        pygame.draw.rect(canvas, outcome_colour(frame), box, border_radius=6)
        line = fitted_line(text, OUTCOME_FONT, box.width - 2 * OUTCOME_PADDING, WHITE)
        canvas.blit(line, line.get_rect(center=box.center))


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """A surface as a new uint8 array of shape (height, width, 3)."""
    width, height = surface.get_size()
    data = pygame.image.tobytes(surface, "RGB")
    return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3).copy()
