"""Checks of what users hand in: each returns the value in its plain form or raises.

Every error names the parameter, says what is allowed and shows what came.
"""

from __future__ import annotations

import math
import operator
import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

__all__ = [
    "array",
    "boolean",
    "cell",
    "choice",
    "finite",
    "fits",
    "integer",
    "is_number",
    "items",
    "pair",
    "positive",
    "real",
    "receiver",
    "seeds",
]


def boolean(name: str, value: object) -> bool:
    """True or False; TypeError otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {value!r}")
    return bool(value)


def choice(name: str, value: object, allowed: Sequence[str | None]) -> str | None:
    """One of some strings, or None where that is among them."""
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{name} must be one of {_listed(allowed)}, got {value!r}")
    if value not in allowed:
        raise ValueError(f"{name} must be one of {_listed(allowed)}, got {value!r}")
    return value


def known_options(options: object, known: Sequence[str], stacklevel: int) -> dict[str, Any]:
    """The options of a `reset` as a dict; a warning for those that are not known.

    Args:
        options: a mapping; TypeError otherwise.
        known: the names that are known.
        stacklevel: of the warning, as seen from the caller.
    """
    if not isinstance(options, Mapping):
        raise TypeError(f"options must be a mapping, got {options!r}")
    unknown = [key for key in options if key not in known]
    if unknown:
        warnings.warn(
            f"options may hold {', '.join(known)}; ignored: {', '.join(map(repr, unknown))}",
            stacklevel=stacklevel + 1,
        )
    return dict(options)


def integer(name: str, value: object, low: int, high: int | None = None) -> int:
    """An integer, a bool not counting as one, within low <= value <= high."""
    limits = f"of at least {low}" if high is None else f"from {low} to {high}"
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be an integer {limits}, got {value!r}") from None
    if number < low or (high is not None and number > high):
        raise ValueError(f"{name} must be an integer {limits}, got {value!r}")
    return number


def is_number(value: object) -> bool:
    """Whether something is a real number; a bool is not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def real(name: str, value: object, low: float | None = None, high: float | None = None) -> float:
    """A finite real number within low <= value <= high."""
    number = finite(value)
    if number is not None and (low is None or number >= low) and (high is None or number <= high):
        return number
    bounds = [
        f"{word} {limit}" for word, limit in (("least", low), ("most", high)) if limit is not None
    ]
    limits = f" of at {' and at '.join(bounds)}" if bounds else ""
    error = ValueError if is_number(value) else TypeError
    raise error(f"{name} must be a finite number{limits}, got {value!r}")


def positive(name: str, value: object) -> float:
    """A finite real number above 0."""
    number = finite(value)
    if number is not None and number > 0.0:
        return number
    error = ValueError if is_number(value) else TypeError
    raise error(f"{name} must be a finite number above 0, got {value!r}")


def finite(value: object) -> float | None:
    """A real number as a finite float, if it is one."""
    try:
        number = float(value) if is_number(value) else math.nan  # type: ignore[arg-type]
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def items(name: str, value: object, what: str) -> list[object]:
    """The items of a list, a tuple, another sequence or a NumPy array."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, (str, bytes)):
        raise TypeError(f"{name} must be {what}, got {value!r}")
    return list(value)


def seeds(name: str, value: object) -> list[int | None]:
    """Seeds in a list, a tuple, another sequence or a NumPy array; None among them stays."""
    entries = items(name, value, "a list or an array of integers of at least 0")
    return [
        None if entry is None else integer(f"{name}[{place}]", entry, 0)
        for place, entry in enumerate(entries)
    ]


def pair(name: str, value: object) -> tuple[float, float]:
    """Two finite numbers, (x, y)."""
    what = "two finite numbers (x, y)"
    numbers = items(name, value, what)
    if len(numbers) != 2:
        raise ValueError(f"{name} must be {what}, got {value!r}")
    x, y = (real(f"{name}[{axis}]", number) for axis, number in enumerate(numbers))
    return x, y


def cell(name: str, value: object, grid_size: int) -> tuple[int, int]:
    """A cell of the grid, (x, y); 3.0 is taken for 3, but 3.5 lies on no cell."""
    what = f"a cell (x, y) with whole numbers from 0 to {grid_size - 1}"
    numbers = items(name, value, what)
    if not all(is_number(number) for number in numbers):
        raise TypeError(f"{name} must be {what}, got {value!r}")
    if len(numbers) != 2 or not all(number in range(grid_size) for number in numbers):
        raise ValueError(f"{name} must be {what}, got {value!r}")
    x, y = (int(number) for number in numbers)  # type: ignore[call-overload]
    return x, y


def fits(what: str, size: int, **parameters: object) -> None:
    """Refuse parameters with which something is larger than the machine's memory.

    Args:
        what: the thing, in words.
        size: the least that it takes, in bytes.
        parameters: what its size follows from, by name.

    Raises:
        ValueError: it is larger.
    """
    memory = _memory()
    if size <= memory:
        return
    given = ", ".join(f"{name}={value!r}" for name, value in parameters.items())
    raise ValueError(
        f"{' or '.join(parameters)} must be smaller: with {given}, {what} would take at "
        f"least {-(-size // 2**30):,} GiB, and this machine has {memory // 2**30:,}"
    )


def _memory() -> int:
    """The machine's memory in bytes; where it does not say, what can be addressed."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # Windows, for one
        return sys.maxsize


def array(name: str, value: object, what: str) -> NDArray[Any]:
    """Something as an array; ValueError where its rows are of different lengths."""
    try:
        return np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} must be {what}, got {value!r}") from None


def receiver(name: str, value: object, shape: tuple[int, ...], dtype: DTypeLike) -> None:
    """An array that may be written into as one run of memory, of some shape and dtype."""
    if not isinstance(value, np.ndarray):
        came = repr(value)
    elif value.shape != shape or value.dtype != dtype:
        came = f"{value.dtype} of shape {value.shape}"
    elif not value.flags.c_contiguous:
        came = "one with gaps or in another order"
    elif not value.flags.writeable:
        came = "a read-only one"
    else:
        return
    error = ValueError if isinstance(value, np.ndarray) else TypeError
    what = f"a writeable C-contiguous {np.dtype(dtype)} array of shape {shape}"
    raise error(f"{name} must be {what}, got {came}")


def _listed(allowed: Sequence[str | None]) -> str:
    return ", ".join(repr(value) for value in allowed)
