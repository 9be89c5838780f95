"""Validation of user input: each function returns the value in its plain form, or raises.

Error messages name the parameter, state what is allowed and show the value.
"""

from __future__ import annotations

import math
import operator
import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch._internal.errors import did_you_mean

LONGEST_NAME = 100  # characters
LARGEST_EXACT = 2**53  # the largest number up to which all integers are exact as floats
_TEXT = (str, bytes, bytearray)  # sequences that never count as numbers


def boolean(name: str, value: object) -> bool:
    """True or False; TypeError otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {value!r:.100}")
    return bool(value)


def choice(name: str, value: object, allowed: Sequence[str | None]) -> str | None:
    """One of the allowed strings; None if it is one of them."""
    error: type[Exception] = TypeError
    if value is None or isinstance(value, str):
        if value in allowed:
            return value
        error = ValueError
    raise error(f"{name} must be one of {', '.join(map(repr, allowed))}, got {value!r:.100}")


def suffix(name: str, path: str | os.PathLike[str], allowed: Sequence[str]) -> Path:
    """A path that ends in one of the allowed suffixes, such as ".json", in any case."""
    checked = Path(path)
    if checked.suffix.lower() not in allowed:
        raise ValueError(f"{name} must end in {' or '.join(allowed)}, got {str(path)!r:.100}")
    return checked


def known_keys(
    what: str, data: object, known: Sequence[str], error: type[Exception] = TypeError
) -> dict[str, Any]:
    """Plain data as a dict; raises `error` for an unknown key, as for an unexpected keyword.

    The message suggests a similar key. It is a TypeError if the data are no mapping.
    """
    if not isinstance(data, Mapping):
        raise TypeError(
            f"{what} must be a mapping with the parameters {', '.join(known)}, got {data!r:.100}"
        )
    for key in data:
        if key not in known:
            raise error(
                f"{what} has the parameters {', '.join(known)}, got {key!r:.100}"
                f"{did_you_mean(str(key), known)}"
            )
    return dict(data)


def name_text(name: str, value: object) -> str:
    """A name for tables and files: text of 1 to 100 printable characters."""
    what = f"text of 1 to {LONGEST_NAME} printable characters"
    if not isinstance(value, str):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    if not (0 < len(value) <= LONGEST_NAME and value.isprintable() and value.strip()):
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    return value


def known_options(options: object, known: Sequence[str], stacklevel: int) -> dict[str, Any]:
    """The known options of a `reset` but None; a warning about others, at this stack level."""
    if not isinstance(options, Mapping):
        raise TypeError(f"options must be a mapping, got {options!r:.100}")
    unknown = [key for key in options if key not in known]
    if unknown:
        ignored = [f"{key!r}{did_you_mean(str(key), known)}" for key in unknown]
        warnings.warn(
            f"options may hold {', '.join(known)}; ignored: {', '.join(ignored)}",
            stacklevel=stacklevel + 1,
        )
    return {name: options[name] for name in known if options.get(name) is not None}


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
        raise ValueError(f"{name} must be an integer {limits}, got {_shown(value)}")
    return number


def integers(name: str, value: object, rows: int, low: int, high: int) -> Ints:
    """`integer` for the rows of a batch, int64, (rows,): one integer for all, or one for each."""
    what = f"an integer from {low} to {high}, or one for each search, an array of shape {(rows,)}"
    given = array(name, value, what)
    if given.ndim == 0:
        return np.full(rows, integer(name, value, low, high))
    return integer_array(name, given, what, low, high, (rows,))


def integer_array(
    name: str, value: object, what: str, low: int, high: int, shape: tuple[int, ...] | None = None
) -> Ints:
    """Integers from low to high as an int64 array, of any shape unless one is given."""
    given = array(name, value, what)
    if given.dtype.kind not in "iu" and given.size:
        raise TypeError(f"{name} must be {what}, got {given.dtype}")
    if shape is not None and given.shape != shape:
        raise ValueError(f"{name} must be {what}, got shape {given.shape}")
    wrong = given[(given < low) | (given > high)]
    if wrong.size:
        raise ValueError(f"{name} must be {what}, got {wrong[0]}")
    return given.astype(np.int64, copy=False)


def is_number(value: object) -> bool:
    """Whether the value is a real number; a bool is not."""
    return isinstance(value, Real) and not isinstance(value, bool)


def real(name: str, value: object, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite real number with low <= value <= high."""
    limits = (("least", low), ("most", high))
    bounds = [f"at {word} {limit}" for word, limit in limits if math.isfinite(limit)]
    what = "a finite number"
    if bounds:
        what += f" of {' and '.join(bounds)}"
    return _finite(name, value, what, low, high)


def positive(name: str, value: object) -> float:
    """A finite real number above 0."""
    return _finite(name, value, "a finite number above 0", math.ulp(0.0), math.inf)


def _finite(name: str, value: Any, what: str, low: float, high: float) -> float:
    if not is_number(value):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    try:
        number = float(value)
    except OverflowError:  # integers and fractions beyond the largest float
        number = math.inf
    if not (math.isfinite(number) and low <= value <= high):
        raise ValueError(f"{name} must be {what}, got {_shown(value)}")
    return number


def _shown(value: object) -> str:
    """The start of a value's text; Python refuses to write integers of thousands of digits."""
    try:
        return f"{value!r:.100}"
    except ValueError:
        return f"a number of {int(value).bit_length():,} bits"  # type: ignore[call-overload]


def items(name: str, value: object, what: str) -> list[object]:
    """The items of a list, a tuple, another sequence or a NumPy array, as a list."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or isinstance(value, _TEXT):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    return list(value)


def seeds(name: str, value: object) -> list[int | None]:
    """A list of seeds from any sequence or array, in which None stays None."""
    given = items(name, value, "a list or an array of integers of at least 0")
    return [
        None if seed is None else integer(f"{name}[{index}]", seed, 0)
        for index, seed in enumerate(given)
    ]


def pair(name: str, value: object, what: str = "two finite numbers (x, y)") -> tuple[float, float]:
    """Two finite numbers, (x, y)."""
    given = items(name, value, what)
    if len(given) != 2:
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    x, y = (real(f"{name}[{axis}]", number) for axis, number in enumerate(given))
    return x, y


def cell(name: str, value: object, grid_size: int) -> tuple[int, int]:
    """A cell of the grid, (x, y); 3.0 counts as 3, but 3.5 is an error."""
    what = f"a cell (x, y) with whole numbers from 0 to {grid_size - 1}"
    given = items(name, value, what)
    if not all(is_number(number) for number in given):
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    if len(given) != 2 or not all(number in range(grid_size) for number in given):
        raise ValueError(f"{name} must be {what}, got {value!r:.100}")
    x, y = (int(number) for number in given)  # type: ignore[call-overload]
    return x, y


def numbers(name: str, value: object, what: str) -> NDArray[Any]:
    """An array of real numbers; TypeError for others, ValueError if they form no array."""
    given = array(name, value, what)
    if given.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be {what}, got {value!r:.100}")
    return given


def fits(what: str, size: int, **parameters: object) -> None:
    """ValueError if something of at least `size` bytes exceeds the machine's memory.

    The message names the parameters that determine the size.
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
