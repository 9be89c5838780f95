"""Every colour of the pictures, as sRGB triples from 0 to 255. Does not import pygame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

# The page.
PAPER: Colour = (250, 250, 248)
INK: Colour = (24, 32, 44)
GREY: Colour = (112, 120, 132)
LINK: Colour = (214, 140, 32)  # between drones in radio range
FAINT: Colour = (218, 221, 226)
WHITE: Colour = (255, 255, 255)
PROGRESS: Colour = (52, 92, 148)
PROGRESS_LIGHT: Colour = (150, 180, 218)

LAND: Colour = (198, 180, 138)

# The outcome of an episode.
FOUND: Colour = (14, 112, 62)
NOT_FOUND: Colour = (176, 22, 38)

# Sprites.
WATER: Colour = (28, 98, 176)
LIFE_RING: Colour = (222, 40, 46)
SPOTLIGHT: Colour = (226, 244, 255)
COLLISION: Colour = (255, 236, 140)

N_SHADES = 129  # shades of a ramp; odd, so that one is in the middle
# shares of the maximum from which two of three colours hold
MIDDLE_FROM = 0.25
HIGH_FROM = 0.75


# The ramps, from the least to the most likely cell, as evenly spaced colours. Their luminance is
# strictly monotonic, to read in greyscale.
PALETTES: dict[str, tuple[Colour, ...]] = {
    "sea": ((238, 246, 250), (173, 209, 236), (107, 137, 218), (6, 44, 105)),
    # Red, yellow, green: the hues of the 2023 package.
    "classic": ((88, 20, 30), (176, 58, 34), (230, 172, 56), (196, 222, 88), (150, 254, 152)),
}

# The colours of Okabe and Ito, https://jfly.uni-koeln.de/color/, which differ to colour-blind eyes:
# orange, green, yellow, vermilion, purple and black in their order from orange, then the two blues,
# which are also those of the sea.
DRONES: tuple[Colour, ...] = (
    (230, 159, 0),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 0, 0),
    (86, 180, 233),
    (0, 114, 178),
)


def style_sheet(name: str) -> str:
    """The name of a style sheet of Matplotlib: "plots", or the colours "light" or "dark"."""
    return f"DroneSwarmSearch.rendering.{name}"


def shares_of_maximum(matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    """A matrix divided by its maximum; all zeros if the maximum is 0."""
    return matrix / (matrix.max() or np.float32(1.0))


@dataclass(frozen=True)
class Look:
    """How cells are drawn: with lines between them, in smooth or three colours, from a palette."""

    grid: bool = False
    gradient: bool = True
    palette: str = "sea"

    @cached_property
    def ramp(self) -> NDArray[np.uint8]:
        """The colours from probability 0 to the maximum of the matrix; shape (N_SHADES, 3)."""
        stops = np.array(PALETTES[self.palette])
        at = np.linspace(0.0, len(stops) - 1, N_SHADES)
        indices = range(len(stops))
        channels = [np.interp(at, indices, channel) for channel in stops.T]
        ramp: NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
        return ramp

    def colours(self, matrix: NDArray[np.float32]) -> NDArray[np.uint8]:
        """The colours of probabilities; shape (*matrix.shape, 3)."""
        shares = shares_of_maximum(matrix)
        if not self.gradient:
            shares = np.float32(0.5) * np.digitize(shares, (MIDDLE_FROM, HIGH_FROM))
        return self.ramp[np.rint(shares * (N_SHADES - 1)).astype(np.intp)]


def drone_colour(number: int) -> Colour:
    """The colour of a drone; those beyond the table reuse the first ones, and differ in number."""
    return DRONES[number % len(DRONES)]


def readable_on(background: Colour) -> Colour:
    """White or ink, whichever has more contrast with a background."""
    r, g, b = background
    return INK if 0.299 * r + 0.587 * g + 0.114 * b > 140 else WHITE
