"""Rendering for one environment: text, pictures or a window, as its render mode asks."""

from __future__ import annotations

import io
import warnings
from functools import cached_property
from typing import TYPE_CHECKING, Any

from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.rendering.palette import Look
from DroneSwarmSearch.rendering.text import render_text

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter
    from DroneSwarmSearch.rendering.window import Window


class Display:
    """Renders frames of one grid size, in the window at most `fps` per second.

    The painter and the window are created on first use. Copies and pickles have no window.
    """

    def __init__(self, grid_size: int, look: Look | None = None, *, fps: float) -> None:
        self._grid_size = grid_size
        self._look = look or Look()
        self._fps = fps
        self._is_dismissed = False

    @cached_property
    def _painter(self) -> Painter:
        from DroneSwarmSearch.rendering.painter import Painter

        return Painter(self._grid_size, self._look)

    @cached_property
    def _window(self) -> Window:
        from DroneSwarmSearch.rendering.window import Window

        return Window(self._painter.size)

    def __getstate__(self) -> dict[str, Any]:
        not_copied = ("_painter", "_window")
        return {name: value for name, value in vars(self).items() if name not in not_copied}

    def render(self, frame: Frame, mode: str) -> Any:
        """Text for "ansi", uint8 of shape (H, W, 3) for "rgb_array", None for "human".

        Raises RuntimeError if no window can be opened.
        """
        if mode == "ansi":
            return render_text(frame)
        if mode == "rgb_array":
            return self._painter.pixels(frame)
        self._show(frame)
        return None

    def png(self, frame: Frame) -> bytes:
        import pygame

        file = io.BytesIO()
        pygame.image.save(self._painter.paint(frame), file, ".png")
        return file.getvalue()

    def open(self) -> None:
        """Let `show` open the window again, even if the user has closed it before."""
        self._is_dismissed = False

    def show(self, frame: Frame) -> None:
        """Show a frame in the window; warn if that fails, since the episode continues."""
        try:
            self._show(frame)
        except RuntimeError as problem:
            self._dismiss(f"{problem}; the episode continues without a window, and")

    def close(self) -> None:
        """Close the window, if there is one; may be called repeatedly."""
        if "_window" in vars(self):
            self._window.close()

    def _show(self, frame: Frame) -> None:
        """Show a frame and wait for at most one frame period; open the window if needed.

        Key events stay in pygame's queue for the program; others are removed.
        """
        import pygame

        if self._is_dismissed:
            return
        self._window.open()
        events = pygame.event.get(exclude=(pygame.KEYDOWN, pygame.KEYUP))
        if any(event.type == pygame.QUIT for event in events):
            self._dismiss("the window was closed: the episode continues without being shown;")
            return
        self._window.draw(self._painter.paint(frame))
        self._window.wait(self._fps)

    def _dismiss(self, reason: str) -> None:
        """Close the window and show nothing until `open`."""
        self.close()
        self._is_dismissed = True
        warnings.warn(f"{reason} the next reset opens it again", stacklevel=4)
