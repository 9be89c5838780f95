"""A window for pictures, which the user can resize."""

from __future__ import annotations

import os

import pygame

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering.palette import PAPER

DESKTOP_SHARE = 0.92  # taken by a window too large for the desktop; the rest is for title bars
HIDDEN_DRIVERS = ("dummy", "offscreen")


class Window:
    """A window for pictures, which the user can resize; smaller than `size` on a small desktop.

    pygame has one display per process, so all windows are the same one.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._clock = pygame.time.Clock()

    @property
    def is_open(self) -> bool:
        return pygame.display.get_init() and bool(pygame.display.get_surface())

    @property
    def surface(self) -> pygame.Surface:
        """The surface of the open window; resizing the window replaces it."""
        surface = pygame.display.get_surface()
        assert surface is not None
        return surface

    @property
    def is_hidden(self) -> bool:
        """Whether nobody can see the open window."""
        return pygame.display.get_driver() in HIDDEN_DRIVERS

    def open(self) -> None:
        """Open the window if it is not; raises RuntimeError if that is impossible."""
        if self.is_open:
            return
        try:
            pygame.display.init()
            asked = map(os.environ.get, ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER"))
            if self.is_hidden and not any(asked):
                raise pygame.error("there is no screen")
            self.resize(self._size)
        except pygame.error as error:
            pygame.display.quit()
            raise RuntimeError(
                f'no window can be opened ({error}): use render_mode="rgb_array" for'
                ' pictures or "ansi" for text, or set the environment variable'
                " SDL_VIDEODRIVER=dummy to run without a screen"
            ) from error
        pygame.display.set_caption("Drone swarm search")
        pygame.display.set_icon(sprites.person(32))

    def draw(self, picture: pygame.Surface) -> None:
        """Show a picture in the open window, scaled to fit it."""
        area = self.surface.get_rect()
        picture = pygame.transform.smoothscale(picture, picture.get_rect().fit(area).size)
        self.surface.fill(PAPER)
        self.surface.blit(picture, picture.get_rect(center=area.center))
        pygame.display.flip()

    def wait(self, fps: float) -> float:
        """Wait until a frame period has passed since the last call; returns the seconds passed."""
        return self._clock.tick(fps) / 1000

    def close(self) -> None:
        if self.is_open:
            pygame.display.quit()

    def resize(self, size: tuple[int, int]) -> None:
        """Open the window with a size, at most that of the desktop, or change its size."""
        width, height = size
        self._size = size
        desktop_width, desktop_height = pygame.display.get_desktop_sizes()[0]
        if width > desktop_width or height > desktop_height:
            share = DESKTOP_SHARE * min(desktop_width / width, desktop_height / height)
            size = round(width * share), round(height * share)
        os.environ.setdefault("SDL_VIDEO_CENTERED", "1")  # pygame's own way to keep it on screen
        pygame.display.set_mode(size, pygame.RESIZABLE)
