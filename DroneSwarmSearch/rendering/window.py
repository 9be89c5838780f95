"""The picture of a frame in a window."""

from __future__ import annotations

import os
import sys
import warnings
import weakref

from DroneSwarmSearch.rendering import sprites
from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.painter import Painter
from DroneSwarmSearch.rendering.palette import drone_colour

__all__ = ["Window"]

KEYS_KEPT = 64
"""Key presses that wait for somebody to take them; older ones are dropped."""

DESKTOP_SHARE = 0.92
"""A window that would not fit the desktop takes this share of it; the rest is for bars."""

ICON = 32

UNSEEN_DRIVERS = ("dummy", "offscreen")
DRIVER_VARIABLES = ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")


class Window:
    """Shows frames in a window, at no more than a given rate.

    pygame has one display per process. Windows therefore take turns: the last one to
    show a frame has the display, in its own size and under its own title, and closing
    one of the others leaves the display alone. A program that has started
    `pygame.display` itself keeps it started when the window closes.

    Key events stay in pygame's queue for whoever steers by hand; all other events are
    taken out of it at every `show`.

    Args:
        painter: draws the frames.
        title: of the window.
        fps: frames per second at most.
    """

    _owner: weakref.ref[Window] | None = None
    """The window that has the display."""

    _started_display = False
    """Whether `pygame.display` runs because a window needed it."""

    def __init__(self, painter: Painter, *, title: str, fps: float) -> None:
        self._painter = painter
        self._title = title
        self._fps = fps
        self._clock: pygame.time.Clock | None = None
        self._dismissed = False

    @property
    def is_open(self) -> bool:
        """Whether this window has the display."""
        return (
            Window._owner is not None
            and Window._owner() is self
            and pygame.display.get_init()
            and pygame.display.get_surface() is not None
        )

    def show(self, frame: Frame) -> None:
        """Shows a frame, opening the window if need be, and waits until the next is due.

        Waits one frame period at most. Does nothing once the user has closed the window,
        which is warned about once, until `open`.

        Raises:
            RuntimeError: no window can be opened here, or it has failed.
        """
        if self._dismissed:
            return
        self.open()
        try:
            if self._user_quits():
                self.dismiss()
                warnings.warn(
                    "the window was closed: the episode goes on without being shown;"
                    " the next reset opens the window again",
                    stacklevel=2,
                )
                return
            self._present(self._painter.paint(frame))
        except pygame.error as error:
            raise RuntimeError(f"the window has failed ({error})") from error
        if self._clock is None:
            self._clock = pygame.time.Clock()
        self._clock.tick(self._fps)

    def dismiss(self) -> None:
        """Closes the window; `show` does nothing until `open`."""
        self.close()
        self._dismissed = True

    def close(self) -> None:
        """Closes the window, if it is open; may be called any number of times."""
        if not self.is_open:
            return
        pygame.display.quit()
        if not Window._started_display:
            pygame.display.init()
        Window._owner = None
        Window._started_display = False

    def __getstate__(self) -> dict[str, object]:
        """What a copy starts from: the same settings, but no open window."""
        return {**self.__dict__, "_clock": None}

    def open(self) -> None:
        """Opens the window if it is not open, also after it was dismissed.

        Takes the display, and starts it if nobody has.

        Raises:
            RuntimeError: no window can be opened here.
        """
        self._dismissed = False
        if self.is_open:
            return
        try:
            if not pygame.display.get_init():
                _refuse_without_screen()
                pygame.display.init()
                Window._started_display = True
                _refuse_unasked_blindness()
            surface = pygame.display.get_surface()
            size = self._fitting_size()
            if surface is None or surface.get_size() != size:
                pygame.display.set_mode(size)
        except pygame.error as error:
            if Window._started_display:
                pygame.display.quit()
                Window._started_display = False
            raise RuntimeError(
                f'no window can be opened here ({error}): use render_mode="rgb_array" for'
                ' pictures or "ansi" for text, or set the environment variable'
                " SDL_VIDEODRIVER=dummy to run without a screen"
            ) from error
        pygame.display.set_caption(self._title)
        pygame.display.set_icon(sprites.drone(ICON, drone_colour(0)))
        Window._owner = weakref.ref(self)

    def _fitting_size(self) -> tuple[int, int]:
        """The painter's size, or as much less as the desktop demands."""
        width, height = self._painter.size
        desktop_width, desktop_height = pygame.display.get_desktop_sizes()[0]
        if width <= desktop_width and height <= desktop_height:
            return width, height
        share = DESKTOP_SHARE * min(desktop_width / width, desktop_height / height)
        return round(width * share), round(height * share)

    def _user_quits(self) -> bool:
        """Takes the waiting events, but for keys, and tells whether one asks to close."""
        keys = (pygame.KEYDOWN, pygame.KEYUP)
        events = pygame.event.get(exclude=keys)
        pressed = pygame.event.get(keys, pump=False)
        # A full queue would lose the event that closes the window.
        for event in pressed[-KEYS_KEPT:]:
            pygame.event.post(event)
        return any(event.type == pygame.QUIT for event in events)

    def _present(self, picture: pygame.Surface) -> None:
        screen = pygame.display.get_surface()
        assert screen is not None
        if screen.get_size() != picture.get_size():
            picture = pygame.transform.smoothscale(picture, screen.get_size())
        screen.blit(picture, (0, 0))
        pygame.display.flip()


def _refuse_without_screen() -> None:
    """Raise an error where SDL would complain on stderr and find no screen all the same."""
    told = ("DISPLAY", "WAYLAND_DISPLAY", *DRIVER_VARIABLES)
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in told):
        raise pygame.error("there is no screen")


def _refuse_unasked_blindness() -> None:
    """Raise an error if SDL has taken to a driver that shows nothing, for want of a screen.

    Nothing is wrong with that where the user has asked for it.
    """
    driver = pygame.display.get_driver()
    if driver in UNSEEN_DRIVERS and not any(os.environ.get(name) for name in DRIVER_VARIABLES):
        raise pygame.error("there is no screen")
