"""The probability of detection (POD) of a search, from its coverage.

The coverage C of an area is the swept area, sweep width times length of track, divided by the
area. Three detection functions turn it into a POD. In experiments of the U.S. Coast Guard (report
USCG-D-41-80), crews performed between `random_search` and `inverse_cube`. Sources of the formulas:
Koopman, "Search and Screening" (1946); Soza & Company and U.S. Coast Guard, "The Theory of Search"
(1996).
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.erf import erf

__all__ = ["coverage", "definite_range", "inverse_cube", "random_search"]

Number = TypeVar("Number", float, NDArray[Any])


def random_search(coverage: Number) -> Number:
    """The POD of tracks at random: 1 - exp(-C) (Koopman, 1946).

    The coverage C is a number of at least 0, and the result a float; or both are arrays.

    Raises:
        TypeError: the coverage is not numbers.
        ValueError: it is negative or not finite.
    """
    return _plain(-np.expm1(-_amounts("coverage", coverage)))  # type: ignore[no-any-return]


def inverse_cube(coverage: Number) -> Number:
    """The POD of parallel tracks if detection falls with the cube of the range.

    It is erf(sqrt(pi) C / 2) (Koopman, 1946), the upper curve of search manuals. Errors are those
    of `random_search`.
    """
    values = _amounts("coverage", coverage) * (math.sqrt(math.pi) / 2)
    return _plain(erf(values))  # type: ignore[no-any-return]


def definite_range(coverage: Number) -> Number:
    """The POD of parallel tracks with a sensor that never misses within its range: min(C, 1)."""
    return _plain(np.minimum(_amounts("coverage", coverage), 1.0))  # type: ignore[no-any-return]


def coverage(sweep_width: Number, speed: Number, time: Number, area: Number) -> Number:
    """The coverage of an area: sweep width times speed times time, over the area.

    A search of a cell lasts one step. For a cell of 130 m that a drone crosses at 10 m/s with a
    sweep width of 100 m, the coverage is ``coverage(100, 10, 13, 130**2)``, 0.77.

    Args:
        sweep_width: effective sweep width of the sensor for the object, in metres, at least
            0: a number or an array, as are the others and the result.
        speed: of the searcher, in m/s, at least 0.
        time: spent searching, in seconds, at least 0.
        area: in m², above 0.

    Raises:
        TypeError: an argument is not numbers.
        ValueError: an argument is out of its limits.
    """
    width, rate, duration = (
        _amounts(name, value)
        for name, value in (("sweep_width", sweep_width), ("speed", speed), ("time", time))
    )
    extent = _amounts("area", area)
    if not extent.all():
        raise ValueError(f"area must be finite numbers above 0, got {area!r}")
    return _plain(width * rate * duration / extent)  # type: ignore[no-any-return]


def _amounts(name: str, value: object) -> Floats:
    """Finite numbers of at least 0."""
    what = "a finite number of at least 0, or an array of them"
    given = checks.numbers(name, value, what).astype(np.float64)
    if not (np.isfinite(given) & (given >= 0.0)).all():
        raise ValueError(f"{name} must be {what}, got {value!r}")
    return given


def _plain(values: Any) -> Any:
    """A float instead of an array without axes."""
    return values if np.ndim(values) else float(values)
