"""Pictures of the search: `text` for terminals, `painter` off screen, `window` on screen.

All of them draw a `frame.Frame` and know nothing else. Importing this package, `frame`
or `text` does not import pygame; `painter` and `window` do.
"""

from DroneSwarmSearch.rendering.frame import Frame

__all__ = ["Frame"]
