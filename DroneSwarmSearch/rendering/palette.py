"""Every colour of the pictures, as sRGB triples from 0 to 255. Does not import pygame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["PALETTES", "Colour", "Palette", "readable_on", "shades"]

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

N_SHADES = 129
"""Shades of a ramp; odd, so that one is in the middle."""

MIDDLE_FROM, HIGH_FROM = 0.25, 0.75
"""Without a gradient, the fractions of the maximum at which the middle and last shades start."""

DISTINCT_DRONES = 48
"""Drones beyond this number reuse the colours of the first ones."""


@dataclass(frozen=True)
class Palette:
    """The colours of a map.

    Attributes:
        stops: evenly spaced colours of the ramp, from the least to the most likely cell.
            The luminance of the ramp rises or falls strictly, so that it reads in greyscale.
    """

    stops: tuple[Colour, ...]

    @cached_property
    def ramp(self) -> NDArray[np.uint8]:
        """The colours from probability 0 to the maximum of the matrix; shape (N_SHADES, 3)."""
        at = np.linspace(0.0, 1.0, N_SHADES)
        places = np.linspace(0.0, 1.0, len(self.stops))
        channels = [np.interp(at, places, channel) for channel in zip(*self.stops, strict=True)]
        ramp: NDArray[np.uint8] = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
        return ramp

    def drone(self, number: int) -> Colour:
        """The colour of a drone; the first `DISTINCT_DRONES` all differ clearly."""
        return self._drones[number % DISTINCT_DRONES]

    @cached_property
    def _drones(self) -> tuple[Colour, ...]:
        """Each colour is the farthest, in OKLab, from the ramp and from the drones before it."""
        steps = np.linspace(0, 255, 12)
        lattice = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        lab = _oklab(lattice)
        chroma = np.hypot(lab[:, 1], lab[:, 2])
        vivid = (lab[:, 0] > 0.42) & (lab[:, 0] < 0.92) & (chroma > 0.08)
        lattice, lab = lattice[vivid], lab[vivid]
        ramp = _oklab(self.ramp[::8].astype(np.float64))
        nearest = np.linalg.norm(lab[:, None] - ramp, axis=-1).min(axis=1)
        chosen: list[Colour] = []
        for _ in range(DISTINCT_DRONES):
            best = int(nearest.argmax())
            r, g, b = np.rint(lattice[best]).astype(int).tolist()
            chosen.append((r, g, b))
            nearest = np.minimum(nearest, np.linalg.norm(lab - lab[best], axis=-1))
        return tuple(chosen)


PALETTES = {
    # Red, yellow, green: the hues of the 2023 package.
    "classic": Palette(
        ((88, 20, 30), (176, 58, 34), (230, 172, 56), (196, 222, 88), (150, 254, 152))
    ),
    "sea": Palette(((240, 246, 250), (168, 205, 230), (66, 134, 190), (8, 44, 104))),
}


def shares_of_maximum(matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    """A matrix divided by its maximum; all zeros if the maximum is 0."""
    top = matrix.max()
    return matrix / top if top > 0.0 else np.zeros_like(matrix)


def shades(matrix: NDArray[np.float32], gradient: bool) -> NDArray[np.intp]:
    """The shade of each cell, as an index into a ramp.

    Args:
        matrix: probabilities, of any shape.
        gradient: use every shade; otherwise only the first, the middle and the last.
    """
    shares = shares_of_maximum(matrix)
    if gradient:
        return np.rint(shares * (N_SHADES - 1)).astype(np.intp)
    third = (shares >= MIDDLE_FROM).astype(np.intp) + (shares >= HIGH_FROM)
    return third * (N_SHADES // 2)


def readable_on(background: Colour) -> Colour:
    """White or ink, whichever has more contrast with a background."""
    r, g, b = background
    return INK if 0.299 * r + 0.587 * g + 0.114 * b > 140 else WHITE


def _oklab(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours in OKLab, where distance approximates perceived difference; (n, 3) each.

    Source: B. Ottosson, "A perceptual color space for image processing", 2020.
    """
    part = srgb / 255.0
    light = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    cones = light @ np.array(
        [
            [0.4122214708, 0.2119034982, 0.0883024619],
            [0.5363325363, 0.6806995451, 0.2817188376],
            [0.0514459929, 0.1073969566, 0.6299787005],
        ]
    )
    lab: NDArray[np.float64] = np.cbrt(cones) @ np.array(
        [
            [0.2104542553, 1.9779984951, 0.0259040371],
            [0.7936177850, -2.4285922050, 0.7827717662],
            [-0.0040720468, 0.4505937099, -0.8086757660],
        ]
    )
    return lab
