"""Rendering for one environment: text, pictures or a window, as its render mode asks."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

from DroneSwarmSearch.rendering.frame import Frame

if TYPE_CHECKING:
    from DroneSwarmSearch.rendering.painter import Painter
    from DroneSwarmSearch.rendering.window import Window

__all__ = ["Display"]


class Display:
    """Renders frames. The painter and the window are created on first use.

    Copies and pickles have no window.

    Args:
        grid_size: cells along each side of the grid.
        render_grid: draw lines between the cells.
        render_gradient: colour the cells smoothly; otherwise in three colours.
        palette: the colours of the cells, a name in `palette.PALETTES`.
        fps: frames per second at most in the window.
    """

    def __init__(
        self,
        grid_size: int,
        *,
        render_grid: bool,
        render_gradient: bool,
        palette: str,
        fps: float,
    ) -> None:
        self._grid_size = grid_size
        self._render_grid = render_grid
        self._render_gradient = render_gradient
        self._palette = palette
        self._fps = fps
        self._painter: Painter | None = None
        self._window: Window | None = None

    def render(self, frame: Frame, mode: str) -> Any:
        """Render a frame.

        Returns:
            "ansi": text. "rgb_array": uint8, shape (H, W, 3). "human": None; the window
            shows the frame.

        Raises:
            RuntimeError: "human", and no window can be opened.
        """
        if mode == "ansi":
            from DroneSwarmSearch.rendering.text import render_text

            return render_text(frame)
        if mode == "rgb_array":
            return self._get_painter().pixels(frame)
        self._get_window().show(frame)
        return None

    def png(self, frame: Frame) -> bytes:
        """A frame as the content of a PNG file."""
        from DroneSwarmSearch.rendering._pygame import pygame

        file = io.BytesIO()
        pygame.image.save(self._get_painter().paint(frame), file, ".png")
        return file.getvalue()

    def open(self) -> None:
        """Open the window if it is not open.

        Raises:
            RuntimeError: no window can be opened.
        """
        self._get_window().open()

    def show(self, frame: Frame) -> None:
        """Show a frame in the window; warn if that fails, since the episode continues."""
        try:
            self._get_window().show(frame)
        except RuntimeError as problem:
            self._get_window().dismiss()
            warnings.warn(
                f"{problem}; the episode continues without a window, and the next reset tries "
                "to open it again",
                stacklevel=3,
            )

    def close(self) -> None:
        """Close the window, if there is one; may be called repeatedly."""
        if self._window is not None:
            self._window.close()

    def _get_painter(self) -> Painter:
        if self._painter is None:
            from DroneSwarmSearch.rendering.painter import Painter

            self._painter = Painter(
                self._grid_size,
                render_grid=self._render_grid,
                render_gradient=self._render_gradient,
                palette=self._palette,
            )
        return self._painter

    def _get_window(self) -> Window:
        if self._window is None:
            from DroneSwarmSearch.rendering.window import Window

            painter = self._get_painter()
            self._window = Window(painter, title="Drone swarm search", fps=self._fps)
        return self._window

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_window": None, "_painter": None}
