"""Rendering of a search: a `Frame` as text, image, window or video.

Importing this package does not import pygame.
"""

import os

from DroneSwarmSearch.rendering.palette import PALETTES, Look, drone_colour
from DroneSwarmSearch.rendering.text import render_text

__all__ = ["PALETTES", "Look", "drone_colour", "render_text"]

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
