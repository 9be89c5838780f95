"""Where things stand in the picture, in pixels from its upper left corner."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

__all__ = ["Layout"]

BOARD_GOAL = 720
"""Side of the board, as near as whole pixels per cell allow."""

BOARD_MOST = 1000
"""Side of the board where there are more cells than this along a side."""

LEFT, TOP, RIGHT, BOTTOM = 46, 42, 22, 24
"""Margins; the first two hold the coordinates."""

GAP = 28
PANEL_WIDTH = 232
PANEL_LEAST_HEIGHT = 690


@dataclass(frozen=True)
class Layout:
    """The picture of a square grid: the board, and right of it the panel.

    Attributes:
        grid_size: cells along each side.
    """

    grid_size: int

    @cached_property
    def board(self) -> int:
        """Side of the board."""
        if self.grid_size > BOARD_MOST:
            return BOARD_MOST
        return self.grid_size * max(1, round(BOARD_GOAL / self.grid_size))

    @cached_property
    def pitch(self) -> float:
        """Side of a cell: whole, unless there are more than `BOARD_MOST` cells."""
        return self.board / self.grid_size

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture; even, as video codecs want them."""
        width = LEFT + self.board + GAP + PANEL_WIDTH + RIGHT
        height = TOP + self.panel_height + BOTTOM
        return width + width % 2, height + height % 2

    @property
    def panel_left(self) -> int:
        """Left edge of the panel; its upper edge is the board's."""
        return LEFT + self.board + GAP

    @property
    def panel_height(self) -> int:
        """Height of the panel: the board's, or what the panel needs at least."""
        return max(self.board, PANEL_LEAST_HEIGHT)

    def centre(self, x: float, y: float) -> tuple[float, float]:
        """The middle of a cell."""
        return LEFT + (x + 0.5) * self.pitch, TOP + (y + 0.5) * self.pitch
