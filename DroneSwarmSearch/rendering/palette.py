"""Every colour of the pictures, as sRGB triples from 0 to 255. Does not import pygame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

# The page.
PAPER: Colour = (250, 250, 248)
INK: Colour = (24, 32, 44)
GREY: Colour = (112, 120, 132)
FAINT: Colour = (218, 221, 226)
WHITE: Colour = (255, 255, 255)
PROGRESS: Colour = (52, 92, 148)
PROGRESS_LIGHT: Colour = (150, 180, 218)

# The outcome of an episode.
FOUND: Colour = (14, 112, 62)
NOT_FOUND: Colour = (176, 22, 38)

# Sprites.
WATER: Colour = (28, 98, 176)
LIFE_RING: Colour = (255, 112, 32)
SKIN: Colour = (255, 214, 178)
SPOTLIGHT: Colour = (226, 244, 255)
COLLISION: Colour = (255, 236, 140)

N_SHADES = 129  # shades of a ramp; odd, so that one is in the middle
MIDDLE_FROM, HIGH_FROM = 0.25, 0.75  # shares of the maximum from which two of three colours hold


class Palette(NamedTuple):
    """The colours of a map.

    `stops` are evenly spaced colours of the ramp, from the least to the most likely cell; its
    luminance is strictly monotonic, to read in greyscale. `drones` are hexadecimal, each chosen as
    the farthest, in OKLab, from the ramp and from those before it.
    """

    stops: tuple[Colour, ...]
    drones: str


PALETTES = {
    # Red, yellow, green: the hues of the 2023 package.
    "classic": Palette(
        ((88, 20, 30), (176, 58, 34), (230, 172, 56), (196, 222, 88), (150, 254, 152)),
        "0000ff ff00ff 46a2ff 007400 8b00b9 ffb9ff 2e5d8b 00b900 b974b9 ff0074 00e8ff 745dff "
        "46a28b ff8ba2 b90074 b900ff 462eb9 00ff00 2ed1a2 745d00 8b8b00 742e74 b9a2ff ff74e8 "
        "8b5d8b 1774d1 d12eb9 005d46 ff2e00 ffb9a2 5d17ff 5db9d1 d15dff 8bb946 5d8bb9 17e874 "
        "a2d1ff d15d74 008b5d e8e8a2 a246d1 ff7446 74ffe8 005dff ff5da2 177474 a2d1a2 d10046",
    ),
    "sea": Palette(
        ((240, 246, 250), (168, 205, 230), (66, 134, 190), (8, 44, 104)),
        "ff0000 e800ff 00ff00 00a200 a20074 ffa200 7400ff 8b5d00 ff8be8 e8e800 74d174 0000e8 "
        "a274ff b9748b 175d2e ff2ea2 a20000 00ffe8 b98b2e 175dff 8b46b9 e8a2a2 008b74 ffd18b "
        "744674 ff7446 00b9a2 d1175d 5d17b9 8bff8b d100b9 d15d17 748b2e b9a2ff ffb9e8 00d100 "
        "d174d1 a200e8 467400 ff5dff 008bff b9b974 ff74a2 a2465d 8b74b9 745dff a2e8b9 00d1ff",
    ),
}


def shares_of_maximum(matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    """A matrix divided by its maximum; all zeros if the maximum is 0."""
    return matrix / (matrix.max() or np.float32(1.0))


@dataclass(frozen=True)
class Look:
    """How cells are drawn: with lines between them, in smooth or three colours, from a palette."""

    grid: bool = False
    gradient: bool = True
    palette: str = "classic"

    @cached_property
    def ramp(self) -> NDArray[np.uint8]:
        """The colours from probability 0 to the maximum of the matrix; shape (N_SHADES, 3)."""
        stops = np.array(PALETTES[self.palette].stops)
        at, places = np.linspace(0.0, len(stops) - 1, N_SHADES), range(len(stops))
        channels = [np.interp(at, places, channel) for channel in stops.T]
        ramp: NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
        return ramp

    def colours(self, matrix: NDArray[np.float32]) -> NDArray[np.uint8]:
        """The colours of probabilities; shape (*matrix.shape, 3)."""
        shares = shares_of_maximum(matrix)
        if not self.gradient:
            shares = np.float32(0.5) * np.digitize(shares, (MIDDLE_FROM, HIGH_FROM))
        return self.ramp[np.rint(shares * (N_SHADES - 1)).astype(np.intp)]

    def drone(self, number: int) -> Colour:
        """The colour of a drone; those beyond the palette's table reuse the first ones."""
        table = PALETTES[self.palette].drones.split()
        r, g, b = bytes.fromhex(table[number % len(table)])
        return r, g, b


def readable_on(background: Colour) -> Colour:
    """White or ink, whichever has more contrast with a background."""
    r, g, b = background
    return INK if 0.299 * r + 0.587 * g + 0.114 * b > 140 else WHITE
