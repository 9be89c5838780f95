"""The error function, which NumPy has not: for arrays, in double precision.

A table holds erf and its derivative at evenly spaced points; a Taylor polynomial leads
from the nearest point to the argument. Only additions, multiplications and look-ups are
involved, so a value depends on its argument alone, to the last bit, whatever the shape of
the array it stands in: one environment and a batch of thousands get the same forecasts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["erf"]

Floats = NDArray[np.float64]

_LARGEST = 6.0
"""Here erf has rounded to 1."""

_PER_UNIT = 1024
"""Points per unit, a power of two so that points are exact. Half a spacing to the fifth
power, where the polynomial is cut off, is below the precision of a double."""

_POINTS = [k / _PER_UNIT for k in range(int(_LARGEST * _PER_UNIT) + 1)]
_VALUES = np.array([math.erf(z) for z in _POINTS])
_SLOPES = np.array([2 / math.sqrt(math.pi) * math.exp(-z * z) for z in _POINTS])


def erf(z: Floats) -> Floats:
    """The error function, to within 3e-16.

    Args:
        z: float64, of any shape; finite.
    """
    size = np.minimum(np.abs(z), _LARGEST)
    nearest = np.rint(size * _PER_UNIT)
    point = nearest * (1 / _PER_UNIT)
    step = size - point
    index = nearest.astype(np.intp)
    # Successive derivatives of erf are its first times Hermite polynomials.
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
