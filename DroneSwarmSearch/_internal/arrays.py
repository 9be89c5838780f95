"""Names for the types of arrays, and of pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]
Integers = NDArray[np.integer]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]
Words = NDArray[np.uint64]

Pair = tuple[float, float]
