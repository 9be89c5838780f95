"""Validation of user input: each function returns the value in its plain form, or raises.

Error messages name the parameter, state what is allowed and show the value. `integers` and
`cells` are the array forms of `integer` and `cell`: they accept the values of all rows of a batch
at once, and report a bad one with the scalar form's message.
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

from DroneSwarmSearch._internal.arrays import Ints

__all__ = [
    "LARGEST_EXACT",
    "array",
    "boolean",
    "cell",
    "cell_numbers",
    "choice",
    "finite",
    "fits",
    "integer",
    "integers",
    "is_number",
    "items",
    "known_options",
    "numbers",
    "output_array",
    "pair",
    "positive",
    "real",
    "row_numbers",
    "seeds",
]


LARGEST_EXACT = 2**53
"""The largest number up to which all integers are exact as floats."""

_TEXT = (str, bytes, bytearray)  # sequences that never count as numbers


def boolean(name: str, value: object) -> bool:
    """True or False; TypeError otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {value!r:.100}")
    return bool(value)


def choice(name: str, value: object, allowed: Sequence[str | None]) -> str | None:
    """One of the allowed strings; None if it is one of them."""
    if value is not None and not isinstance(value, str):
        raise TypeError(f"{name} must be one of {_listed(allowed)}, got {value!r:.100}")
    if value not in allowed:
        raise ValueError(f"{name} must be one of {_listed(allowed)}, got {value!r:.100}")
    return value


def known_options(options: object, known: Sequence[str], stacklevel: int) -> dict[str, Any]:
    """The options of a `reset` as a dict, with a warning about unknown ones.

    Args:
        options: a mapping; TypeError otherwise.
        known: the known names.
        stacklevel: the warning's stack level, counted from the caller.
    """
    if not isinstance(options, Mapping):
        raise TypeError(f"options must be a mapping, got {options!r:.100}")
    unknown = [key for key in options if key not in known]
    if unknown:
        warnings.warn(
            f"options may hold {', '.join(known)}; ignored: {', '.join(map(repr, unknown))}",
            stacklevel=stacklevel + 1,
        )
    return dict(options)


def integer(name: str, value: object, low: int, high: int | None = None) -> int:
    """An integer with low <= value <= high; a bool is not an integer."""
    limits = f"of at least {low}" if high is None else f"from {low} to {high}"
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be an integer {limits}, got {value!r:.100}") from None
    if number < low or (high is not None and number > high):
        raise ValueError(f"{name} must be an integer {limits}, got {value!r:.100}")
    return number


def integers(name: str, value: object, rows: int, low: int, high: int) -> Ints:
    """`integer` for the rows of a batch: one integer for all of them, or one for each.

    Returns:
        int64, shape (rows,).
    """
    what = f"an integer from {low} to {high}"
    given = array(name, value, what)
    if given.ndim == 0:
        return np.full(rows, integer(name, value, low, high))
    _check_rows(name, given, (rows,), what)
    if given.dtype.kind not in "iu":
        raise TypeError(f"{name} must be {what}, or one for each search, got {value!r:.100}")
    for row in ((given < low) | (given > high)).nonzero()[0]:
        integer(f"{name}[{row}]", given[row].item(), low, high)
    return given.astype(np.int64)


def is_number(value: object) -> bool:
    """Whether the value is a real number; a bool is not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def real(name: str, value: object, low: float | None = None, high: float | None = None) -> float:
    """A finite real number with low <= value <= high."""
    number = finite(value)
    if number is not None and (low is None or number >= low) and (high is None or number <= high):
        return number
    bounds = [
        f"{word} {limit}" for word, limit in (("least", low), ("most", high)) if limit is not None
    ]
    limits = f" of at {' and at '.join(bounds)}" if bounds else ""
    error = ValueError if is_number(value) else TypeError
    raise error(f"{name} must be a finite number{limits}, got {value!r:.100}")


def positive(name: str, value: object) -> float:
    """A finite real number above 0."""
    number = finite(value)
    if number is not None and number > 0.0:
        return number
    error = ValueError if is_number(value) else TypeError
    raise error(f"{name} must be a finite number above 0, got {value!r:.100}")


def finite(value: object) -> float | None:
    """The value as a float, or None if it is not a finite real number."""
    try:
        number = float(value) if is_number(value) else math.nan  # type: ignore[arg-type]
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def items(name: str, value: object, what: str) -> list[object]:
    """The items of a list, a tuple, another sequence or a NumPy array, as a list."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, _TEXT):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    return list(value)


def seeds(name: str, value: object) -> list[int | None]:
    """A list of seeds from any sequence or array; None entries are kept."""
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
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    x, y = (real(f"{name}[{axis}]", number) for axis, number in enumerate(numbers))
    return x, y


def cell(name: str, value: object, grid_size: int) -> tuple[int, int]:
    """A cell of the grid, (x, y); 3.0 counts as 3, but 3.5 is an error."""
    what = f"a cell (x, y) with whole numbers from 0 to {grid_size - 1}"
    numbers = items(name, value, what)
    if not all(is_number(number) for number in numbers):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    if len(numbers) != 2 or not all(number in range(grid_size) for number in numbers):
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    x, y = (int(number) for number in numbers)  # type: ignore[call-overload]
    return x, y


def numbers(name: str, value: object, what: str) -> NDArray[Any]:
    """An array of real numbers.

    Args:
        name: the parameter.
        value: numbers of any kind for which `is_number` is True, nested or in arrays.
        what: the expected value, for the message.

    Raises:
        TypeError: an entry is not a number.
        ValueError: the entries form no array.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return value
    entries = np.asarray(None if isinstance(value, _TEXT) else value, object)
    floats = np.empty(entries.shape)
    for place, entry in enumerate(entries.flat):
        if not is_number(entry):
            error = ValueError if isinstance(entry, (list, tuple, np.ndarray)) else TypeError
            raise error(f"{name} must be {what}, got {value!r:.100}")
        try:
            floats.flat[place] = float(entry)
        except OverflowError:
            floats.flat[place] = np.inf
    return floats


def _check_rows(name: str, given: NDArray[Any], shape: tuple[int, ...], what: str) -> None:
    if given.shape != shape:
        raise ValueError(
            f"{name} must be {what}, or one for each search, an array of shape {shape}; "
            f"got one of shape {given.shape}"
        )


def fits(what: str, size: int, **parameters: object) -> None:
    """Raise a ValueError if something needs more than the machine's memory.

    Args:
        what: a name for it, for the message.
        size: a lower limit of its size in bytes.
        parameters: the parameters that determine the size.
    """
    memory = _memory()
    if size <= memory:
        return
    given = ", ".join(f"{name}={value!r:.100}" for name, value in parameters.items())
    raise ValueError(
        f"{' or '.join(parameters)} must be smaller: with {given}, {what} would take at "
        f"least {-(-size // 2**30):,} GiB, and this machine has {memory // 2**30:,}"
    )


def _memory() -> int:
    """The machine's memory in bytes; the largest address where the system does not report it."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # Windows, for one
        return sys.maxsize


def array(name: str, value: object, what: str) -> NDArray[Any]:
    """The value as an array; TypeError for text, ValueError if its rows differ in length."""
    if isinstance(value, _TEXT):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    try:
        return np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} must be {what}, got {value!r:.100}") from None


def row_numbers(
    value: object, count: int, *, ascending: bool = False, repeated: bool = False
) -> Ints:
    """Numbers of the rows of a batch: int64, shape (n,).

    Args:
        value: integers from 0 to count - 1.
        count: the number of rows.
        ascending: they must be in ascending order.
        repeated: equal numbers are allowed.

    Raises:
        TypeError: they are not integers.
        ValueError: there is no such row, or they are out of order.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.int64 and value.ndim == 1:
        # A fast test for the usual case, which occurs in every step.
        in_order = np.count_nonzero(value[1:] > value[:-1]) == len(value) - 1
        if in_order and value[0] >= 0 and value[-1] < count:
            return value
    order = "in ascending order" if ascending else "without repetitions"
    what = f"rows must be a list or an array of integers from 0 to {count - 1}, {order}"
    given = array("rows", value, what.removeprefix("rows must be "))
    if given.ndim == 1 and not given.size:
        return np.empty(0, np.int64)
    if given.dtype.kind not in "iu":
        raise TypeError(f"{what}; got {given.dtype}")
    if given.ndim != 1:
        raise ValueError(f"{what}; got shape {given.shape}")
    rows = given.astype(np.int64)
    wrong = rows[(rows < 0) | (rows >= count)]
    if wrong.size:
        raise ValueError(f"{what}; got {wrong[0]}")
    steps = np.diff(rows if ascending else np.sort(rows))
    if (steps < (not repeated)).any():
        raise ValueError(f"{what}; got {value!r:.100}")
    return rows


def cell_numbers(value: object, shape: tuple[int, ...], grid_size: int) -> Ints:
    """A cell, y * grid_size + x, for each of some rows of a batch: int64, of this shape."""
    last = grid_size**2 - 1
    what = f"integers from 0 to {last}, one for each of the rows"
    given = array("cells", value, what)
    if given.dtype.kind not in "iu" and given.size:
        raise TypeError(f"cells must be {what}, got {given.dtype}")
    if given.shape != shape:
        raise ValueError(f"cells must be {what}, got shape {given.shape}")
    wrong = given[(given < 0) | (given > last)]
    if wrong.size:
        raise ValueError(f"cells must be {what}, got {wrong[0]}")
    return given.astype(np.int64)


def output_array(name: str, value: object, shape: tuple[int, ...], dtype: DTypeLike) -> None:
    """Raise unless the value is a writeable C-contiguous array of this shape and dtype."""
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
