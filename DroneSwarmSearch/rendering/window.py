"""Windows: the screen that shows pictures, and the window of an environment."""

from __future__ import annotations

import os
import sys
import warnings
import weakref

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.palette import PALETTES, PAPER

__all__ = ["KEYS_KEPT", "Screen", "Window", "fitted"]

KEYS_KEPT = 64
"""Key events that wait in the queue; older ones are dropped."""

DESKTOP_SHARE = 0.92
"""A window too large for the desktop takes this share of it; the rest is for title bars."""

ICON = 32

HIDDEN_DRIVERS = ("dummy", "offscreen")
DRIVER_VARIABLES = ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")


class Screen:
    """A window for pictures, which the user can resize.

    pygame has one display per process, so screens share it: the last one to open owns the
    display, with its size and title, and closing another one leaves it open. A display that the
    program itself has initialised stays initialised.

    Args:
        size: width and height in pixels when the window opens; less if the desktop is smaller.
        title: the window's title.
    """

    _owner: weakref.ref[Screen] | None = None
    """The screen that owns the display."""

    _initialised_display = False
    """Whether a screen has initialised `pygame.display`."""

    def __init__(self, size: tuple[int, int], *, title: str) -> None:
        self._size = size
        self._title = title

    @property
    def is_open(self) -> bool:
        """Whether this screen owns the display."""
        return (
            Screen._owner is not None
            and Screen._owner() is self
            and pygame.display.get_init()
            and pygame.display.get_surface() is not None
        )

    @property
    def surface(self) -> pygame.Surface:
        """The surface of the open window; resizing the window replaces it."""
        surface = pygame.display.get_surface()
        assert surface is not None
        return surface

    @property
    def is_hidden(self) -> bool:
        """Whether the window is open, but nobody can see it."""
        return self.is_open and pygame.display.get_driver() in HIDDEN_DRIVERS

    def open(self) -> None:
        """Open the window; do nothing if it is open.

        Raises:
            RuntimeError: no window can be opened.
        """
        if self.is_open:
            return
        try:
            if not pygame.display.get_init():
                _check_for_screen()
                pygame.display.init()
                Screen._initialised_display = True
                _check_driver()
            surface = pygame.display.get_surface()
            size = self._fitted_size()
            if surface is None or surface.get_size() != size:
                pygame.display.set_mode(size, pygame.RESIZABLE)
        except pygame.error as error:
            if Screen._initialised_display:
                pygame.display.quit()
                Screen._initialised_display = False
            raise RuntimeError(
                f'no window can be opened ({error}): use render_mode="rgb_array" for'
                ' pictures or "ansi" for text, or set the environment variable'
                " SDL_VIDEODRIVER=dummy to run without a screen"
            ) from error
        pygame.display.set_caption(self._title)
        pygame.display.set_icon(sprites.drone(ICON, PALETTES["classic"].drone(0)))
        Screen._owner = weakref.ref(self)

    def close(self) -> None:
        """Close the window if it is open; may be called any number of times."""
        if not self.is_open:
            return
        pygame.display.quit()
        if not Screen._initialised_display:
            pygame.display.init()
        Screen._owner = None
        Screen._initialised_display = False

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size of the open window, at most to that of the desktop, and centre it."""
        self._size = size
        os.environ.setdefault("SDL_VIDEO_CENTERED", "1")  # pygame's own way to keep it on screen
        pygame.display.set_mode(self._fitted_size(), pygame.RESIZABLE)

    def _fitted_size(self) -> tuple[int, int]:
        """The size, scaled down if the desktop is smaller."""
        width, height = self._size
        desktop_width, desktop_height = pygame.display.get_desktop_sizes()[0]
        if width <= desktop_width and height <= desktop_height:
            return width, height
        share = DESKTOP_SHARE * min(desktop_width / width, desktop_height / height)
        return round(width * share), round(height * share)


class Window(Screen):
    """Shows frames in a window, at most at a given rate.

    Key events stay in pygame's queue for the program; `show` removes all other events.

    Args:
        painter: draws the frames.
        title: the window's title.
        fps: frames per second at most.
    """

    def __init__(self, painter: Painter, *, title: str, fps: float) -> None:
        super().__init__(painter.size, title=title)
        self._painter = painter
        self._fps = fps
        self._clock: pygame.time.Clock | None = None
        self._dismissed = False

    def show(self, frame: Frame) -> None:
        """Show a frame, opening the window if needed, and wait for at most one frame period.

        After the user has closed the window, the first call warns; all calls do nothing
        until `open`.

        Raises:
            RuntimeError: no window can be opened, or it failed.
        """
        if self._dismissed:
            return
        self.open()
        try:
            if self._user_quits():
                self.dismiss()
                warnings.warn(
                    "the window was closed: the episode continues without being shown;"
                    " the next reset opens the window again",
                    stacklevel=2,
                )
                return
            picture = self._painter.paint(frame)
            self.surface.fill(PAPER)
            self.surface.blit(*fitted(picture, self.surface.get_rect()))
            pygame.display.flip()
        except pygame.error as error:
            raise RuntimeError(f"the window failed ({error})") from error
        if self._clock is None:
            self._clock = pygame.time.Clock()
        self._clock.tick(self._fps)

    def open(self) -> None:
        """Open the window, even if the user has closed it before; do nothing if it is open.

        Raises:
            RuntimeError: no window can be opened.
        """
        self._dismissed = False
        super().open()

    def dismiss(self) -> None:
        """Close the window; `show` does nothing until `open`."""
        self.close()
        self._dismissed = True

    def __getstate__(self) -> dict[str, object]:
        """Copies have the same settings, but no open window."""
        return {**self.__dict__, "_clock": None}

    def _user_quits(self) -> bool:
        """Remove the waiting events except key events; True if one of them closes the window."""
        keys = (pygame.KEYDOWN, pygame.KEYUP)
        events = pygame.event.get(exclude=keys)
        pressed = pygame.event.get(keys, pump=False)
        # A full queue would lose the event that closes the window.
        for event in pressed[-KEYS_KEPT:]:
            pygame.event.post(event)
        return any(event.type == pygame.QUIT for event in events)


def fitted(picture: pygame.Surface, area: pygame.Rect) -> tuple[pygame.Surface, pygame.Rect]:
    """A picture scaled to fit an area, in its own proportions, and its place in the middle."""
    place = picture.get_rect().fit(area)
    if abs(place.width - picture.get_width()) > 1 or not area.contains(picture.get_rect()):
        picture = pygame.transform.smoothscale(picture, place.size)
    return picture, picture.get_rect(center=area.center)


def _check_for_screen() -> None:
    """Raise an error where SDL would print its own to stderr and still find no screen."""
    variables = ("DISPLAY", "WAYLAND_DISPLAY", *DRIVER_VARIABLES)
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in variables):
        raise pygame.error("there is no screen")


def _check_driver() -> None:
    """Raise an error if SDL has fallen back to a hidden driver that was not requested."""
    driver = pygame.display.get_driver()
    if driver in HIDDEN_DRIVERS and not any(os.environ.get(name) for name in DRIVER_VARIABLES):
        raise pygame.error("there is no screen")
