"""The keys of a window: actions for a drone, and quitting."""

from __future__ import annotations

import time

from DroneSwarmSearch.rendering._pygame import pygame
from DroneSwarmSearch.rendering.window import Window
from DroneSwarmSearch.rules import Action

__all__ = ["QuitError", "handle_events", "hold", "wait_for_action"]

ACTIONS = {
    pygame.K_LEFT: Action.LEFT,
    pygame.K_RIGHT: Action.RIGHT,
    pygame.K_UP: Action.UP,
    pygame.K_DOWN: Action.DOWN,
    pygame.K_SPACE: Action.SEARCH,
    pygame.K_i: Action.IDLE,
    pygame.K_PERIOD: Action.IDLE,
}
QUIT = (pygame.K_ESCAPE, pygame.K_q)

POLL = 50
"""Milliseconds between checks for Ctrl-C while waiting for an event."""


class QuitError(Exception):
    """The user quits; the message says how."""


def wait_for_action(window: Window) -> Action:
    """The action of the next key that has one.

    Raises:
        QuitError: the user quits.
    """
    while True:
        event = _next_event(window, POLL)
        if event.type == pygame.KEYDOWN and event.key in ACTIONS:
            return ACTIONS[event.key]


def handle_events(window: Window) -> None:
    """Handle the events that are waiting.

    Raises:
        QuitError: the user quits.
    """
    while _next_event(window, 0).type != pygame.NOEVENT:
        pass


def hold(window: Window, seconds: float) -> None:
    """Leave the window unchanged for a time, or until the user quits."""
    until = time.monotonic() + seconds
    try:
        while time.monotonic() < until:
            _next_event(window, POLL)
    except QuitError:
        return


def _next_event(window: Window, timeout: int) -> pygame.event.Event:
    """The next event; NOEVENT if there is none within the given milliseconds."""
    if not window.is_open:
        raise QuitError("the window was closed")
    event = pygame.event.wait(timeout) if timeout else pygame.event.poll()
    if event.type == pygame.QUIT:
        raise QuitError("the window was closed")
    if event.type == pygame.KEYDOWN and event.key in QUIT:
        raise QuitError("you quit")
    if event.type == pygame.VIDEOEXPOSE:
        pygame.display.flip()
    return event
