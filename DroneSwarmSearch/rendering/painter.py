"""The picture of a frame: the map, and the panel right of it. Window and film show it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.palette import PAPER
from DroneSwarmSearch.rendering.panel import Layout, Panel
from DroneSwarmSearch.rendering.search_map import BOTTOM, RIGHT, TOP, SearchMap

__all__ = ["Painter", "to_array"]

GAP = 6
"""Pixels between the map's margin and the panel."""


class Painter:
    """Draws frames of one grid size; needs no display and starts none.

    Args:
        grid_size: cells along each side.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly; otherwise in three colours.
        palette: the colours of the cells, a name in `palette.PALETTES`.
    """

    def __init__(
        self,
        grid_size: int,
        *,
        render_grid: bool = False,
        render_gradient: bool = True,
        palette: str = "classic",
    ) -> None:
        self._map = SearchMap(
            grid_size, render_grid=render_grid, render_gradient=render_gradient, palette=palette
        )
        self._panel = Panel(
            symbol=self._map.symbol,
            gradient=render_gradient,
            palette=palette,
            least_height=self._map.side,
        )
        self._panel_area = pygame.Rect((self._map.size[0] + GAP, TOP), self._panel.size)
        width, height = self._panel_area.right + RIGHT, self._panel_area.bottom + BOTTOM
        self._size = width + width % 2, height + height % 2
        self._layout: Layout | None = None
        self._backdrop: pygame.Surface | None = None

    def __getstate__(self) -> dict[str, object]:
        """Everything but the prepared surface, which cannot be copied."""
        return {**self.__dict__, "_backdrop": None}

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures in pixels; both even, as video codecs require."""
        return self._size

    def paint(self, frame: Frame) -> pygame.Surface:
        """A new surface of `size` with the picture of a frame.

        Raises:
            ValueError: the frame is of another grid size.
        """
        layout = self._panel.layout(frame)
        if self._backdrop is None or layout != self._layout:
            self._layout = layout
            self._backdrop = pygame.Surface(self.size, 0, 32)
            self._backdrop.fill(PAPER)
            self._map.draw_fixed(self._backdrop)
            self._panel.draw_fixed(self._backdrop.subsurface(self._panel_area), layout)
        canvas = self._backdrop.copy()
        self._map.draw(canvas, frame)
        self._panel.draw(canvas.subsurface(self._panel_area), frame)
        return canvas

    def pixels(self, frame: Frame) -> NDArray[np.uint8]:
        """The picture of a frame as a new uint8 array of shape (height, width, 3)."""
        return to_array(self.paint(frame))


def to_array(surface: pygame.Surface) -> NDArray[np.uint8]:
    """A surface as a new uint8 array of shape (height, width, 3)."""
    width, height = surface.get_size()
    data = pygame.image.tobytes(surface, "RGB")
    return np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3).copy()
