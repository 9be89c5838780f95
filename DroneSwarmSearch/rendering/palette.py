"""Colours, as sRGB triples from 0 to 255. No pygame in here."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "FOUND_SCALE",
    "LEVELS",
    "LOST_SCALE",
    "SEARCH_SCALE",
    "Colour",
    "drone_colour",
    "levels",
    "readable_on",
    "scaled",
]

Colour = tuple[int, int, int]
Scale = NDArray[np.uint8]
"""Shape (LEVELS, 3): the colours from no probability to the matrix maximum."""

PAPER: Colour = (250, 250, 248)
INK: Colour = (24, 32, 44)
GREY: Colour = (112, 120, 132)
FAINT: Colour = (218, 221, 226)
WHITE: Colour = (255, 255, 255)

RED: Colour = (206, 62, 54)
YELLOW: Colour = (250, 212, 92)
GREEN: Colour = (38, 158, 84)

FOUND: Colour = (8, 66, 40)
NOT_FOUND: Colour = (98, 12, 18)

LEVELS = 257
"""Shades of a scale; odd, so that there is one in the middle."""

YELLOW_FROM = 0.25
GREEN_FROM = 0.75
"""Limits of the three colours without a gradient, as shares of the matrix maximum."""

DISTINCT_COLOURS = 48
"""Drones beyond this many share the colours of the first ones."""


def _scale(*stops: Colour) -> Scale:
    """A scale through evenly spaced colours."""
    at = np.linspace(0.0, 1.0, LEVELS)
    places = np.linspace(0.0, 1.0, len(stops))
    channels = [np.interp(at, places, channel) for channel in zip(*stops, strict=True)]
    scale: Scale = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    return scale


SEARCH_SCALE = _scale(RED, YELLOW, GREEN)
FOUND_SCALE = _scale((20, 104, 60), (74, 172, 106), (166, 230, 174))
LOST_SCALE = _scale((142, 24, 30), (210, 76, 70), (247, 164, 148))


def scaled(matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    """A matrix as shares of its maximum; of its shape, all zeros if the maximum is 0."""
    top = matrix.max()
    return matrix / top if top > 0.0 else np.zeros_like(matrix)


def levels(matrix: NDArray[np.float32], gradient: bool) -> NDArray[np.intp]:
    """Where on a scale each cell lies, as an index into the scale.

    Args:
        matrix: probabilities of any shape.
        gradient: every shade of the scale; else its two ends and its middle alone.
    """
    shares = scaled(matrix)
    if gradient:
        return np.rint(shares * (LEVELS - 1)).astype(np.intp)
    step = (shares >= YELLOW_FROM).astype(np.intp) + (shares >= GREEN_FROM)
    return step * (LEVELS // 2)


def readable_on(background: Colour) -> Colour:
    """White or ink, whichever stands out more from a background."""
    r, g, b = background
    return INK if 0.299 * r + 0.587 * g + 0.114 * b > 140 else WHITE


def drone_colour(number: int) -> Colour:
    """The colour of a drone; the first `DISTINCT_COLOURS` all differ clearly."""
    return _drone_colours()[number % DISTINCT_COLOURS]


@lru_cache(maxsize=1)
def _drone_colours() -> tuple[Colour, ...]:
    """Each colour is the one farthest, in OKLab, from the sea's and from those before it."""
    steps = np.linspace(0, 255, 12)
    lattice = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    lab = _oklab(lattice)
    chroma = np.hypot(lab[:, 1], lab[:, 2])
    vivid = (lab[:, 0] > 0.42) & (lab[:, 0] < 0.92) & (chroma > 0.08)
    lattice, lab = lattice[vivid], lab[vivid]
    sea = _oklab(SEARCH_SCALE[::16].astype(np.float64))
    nearest = np.linalg.norm(lab[:, None] - sea, axis=-1).min(axis=1)
    chosen: list[Colour] = []
    for _ in range(DISTINCT_COLOURS):
        best = int(nearest.argmax())
        r, g, b = np.rint(lattice[best]).astype(int).tolist()
        chosen.append((r, g, b))
        nearest = np.minimum(nearest, np.linalg.norm(lab - lab[best], axis=-1))
    return tuple(chosen)


def _oklab(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours in OKLab, where distance is difference to the eye (Ottosson, 2020); (n, 3) each."""
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
