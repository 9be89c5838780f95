"""Rendering of a search: a `Frame` as text, image, window or video.

`text` needs NumPy alone; `painter` and `window` draw with pygame; `video` writes files with the
packages of the extra "video". Importing this package does not import pygame.
"""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
