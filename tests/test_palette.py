"""Colours that differ, to colour-blind eyes too."""

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch.rendering import PALETTES, Look, drone_colour
from DroneSwarmSearch.rendering.palette import DRONES, INK, WHITE

Floats = NDArray[np.float64]

LEAST = 10.0
"""The least difference between two colours, in CIEDE2000."""

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
    """CIEDE2000 between colours in CIELAB, by the formulas of Sharma, Wu and Dalal, 2005."""
    l1, a1, b1 = np.asarray(one).T
    l2, a2, b2 = np.asarray(other).T
    chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    more = 1.5 - np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) / 2
    c1 = np.hypot(more * a1, b1)
    c2 = np.hypot(more * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, more * a)) for a, b in ((a1, b1), (a2, b2)))
    turn = np.where(c1 * c2 == 0, 0.0, (h2 - h1 + 180) % 360 - 180)
    hue = np.where(c1 * c2 == 0, h1 + h2, h1 + turn / 2)
    light = (l1 + l2) / 2
    chroma = (c1 + c2) / 2
    waves = ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.20, 4, -63))
    t = 1 + sum(size * np.cos(np.radians(n * hue + phase)) for size, n, phase in waves)
    by_light = (l2 - l1) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2))
    by_chroma = (c2 - c1) / (1 + 0.045 * chroma)
    by_hue = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * t)
    blue = np.radians(60 * np.exp(-((((hue % 360) - 275) / 25) ** 2)))
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(blue)
    return np.sqrt(by_light**2 + by_chroma**2 + by_hue**2 + rotation * by_chroma * by_hue)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [  # from the test data that Sharma, Wu and Dalal publish
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425), ((50, -1, 2), (50, 0, 0), 2.3669),
        ((50, 2.49, -0.001), (50, -2.49, 0.0011), 7.2195), ((50, 2.5, 0), (73, 25, -18), 27.1492),
        ((50, 2.5, 0), (58, 24, 15), 19.4535),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((22.7233, 20.0904, -46.6940), (23.0331, 14.9730, -42.5619), 2.0373),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)  # fmt: skip
def test_the_difference_is_that_of_the_published_pairs(one, other, expected):
    assert difference(one, other) == pytest.approx(expected, abs=1e-4)
    assert difference(other, one) == pytest.approx(expected, abs=1e-4)


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
