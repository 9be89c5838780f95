"""The error function for arrays in double precision, which NumPy lacks.

A table holds erf and its derivative at evenly spaced points; a Taylor polynomial extends from
the nearest point to the argument. The computation uses only additions, multiplications and
look-ups, so each value depends only on its argument, bit for bit, and not on the shape of the
array. A single environment and a batch therefore get the same forecasts.
"""

from __future__ import annotations

import math

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats

_LARGEST = 6.0  # erf rounds to 1 from here on

_PER_UNIT = 1024
"""Points per unit, a power of two so that points are exact. The omitted terms of the polynomial
are of order (half the spacing)⁵, which is below double precision."""

_POINTS = [k / _PER_UNIT for k in range(int(_LARGEST * _PER_UNIT) + 1)]
_VALUES = np.array([math.erf(z) for z in _POINTS])
_SLOPES = np.array([2 / math.sqrt(math.pi) * math.exp(-z * z) for z in _POINTS])


def erf(z: Floats) -> Floats:
    """The error function of finite numbers in an array of any shape, to within 3e-16."""
    size = np.minimum(np.abs(z), _LARGEST)
    nearest = np.rint(size * _PER_UNIT)
    point = nearest * (1 / _PER_UNIT)
    step = size - point
    index = nearest.astype(np.intp)
    # The higher derivatives of erf are the first one times Hermite polynomials.
    square = point * point
    factor = point * (3.0 - 2.0 * square) * (1 / 6)
    factor *= step
    factor += (2.0 * square - 1.0) * (1 / 3)
    factor *= step
    factor -= point
    factor *= step
    factor += 1.0
    factor *= step
    factor *= _SLOPES.take(index)
    factor += _VALUES.take(index)
    signed: Floats = np.copysign(factor, z)
    return signed
