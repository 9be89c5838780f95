"""Colours that differ, to colour-blind eyes too."""

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch.rendering.palette import DRONES, INK, PALETTES, WHITE, Look, drone_colour

Floats = NDArray[np.float64]

LEAST = 15.0
"""The least distance between two colours in CIELAB, CIE 1976; about 2.3 is just noticeable."""

FIRST = range(6)
"""Drones whose colours are compared; the number tells others apart."""

SIGHTS = {
    "normal": np.eye(3),
    # Machado, Oliveira and Fernandes, "A physiologically-based model for simulation of color
    # vision deficiency", 2009, at severity 1.0; for linear RGB.
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "tritanopia": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.303900],
        ]
    ),
}

TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
"""From linear sRGB."""


def lab(colours: ArrayLike, sight: str) -> Floats:
    """CIELAB of sRGB colours, 0 to 255, as somebody sees them; shape (..., 3)."""
    share = np.asarray(colours) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ SIGHTS[sight].T, 0, 1)
    xyz = seen @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)]).T


def difference(one: ArrayLike, other: ArrayLike) -> Floats:
    """The distance between colours in CIELAB."""
    return np.linalg.norm(np.subtract(one, other), axis=-1)


@pytest.mark.parametrize("sight", SIGHTS)
class TestDrones:
    def test_any_two_colours_differ(self, sight):
        for one, other in combinations(DRONES, 2):
            assert difference(lab(one, sight), lab(other, sight)) >= LEAST

    @pytest.mark.parametrize("gradient", [True, False])
    def test_the_first_differ_from_the_sea(self, sight, gradient):
        look = Look(gradient=gradient)
        shades = look.colours(np.linspace(0, 1, 129, dtype=np.float32))
        for number in FIRST:
            assert difference(lab(drone_colour(number), sight), lab(shades, sight)).min() >= LEAST

    @pytest.mark.parametrize("palette", PALETTES)
    def test_the_outline_differs_from_every_map(self, sight, palette):
        ramp = lab(Look(palette=palette).ramp, sight)
        edges = [difference(lab(edge, sight), ramp) for edge in (WHITE, INK)]
        assert np.max(edges, axis=0).min() >= LEAST


def test_colours_repeat():
    assert drone_colour(len(DRONES)) == drone_colour(0)
    assert len(set(DRONES)) == len(DRONES)
