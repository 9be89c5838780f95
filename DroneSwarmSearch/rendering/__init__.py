"""Rendering of a search: a `Frame` as text, image, window or video.

Importing this package does not import pygame.
"""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
