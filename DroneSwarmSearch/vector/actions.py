"""Validation of the actions of many drones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from DroneSwarmSearch.rules import Action

__all__ = ["checked_actions"]

_ACTIONS = len(Action)


def checked_actions(actions: ArrayLike, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return the actions in a new array.

    Args:
        actions: integers from 0 to 5.
        shape: the required shape, (rows, n_drones).
        dtype: an integer type for the result.

    Raises:
        TypeError: they are not integers.
        ValueError: they are out of range, or of another shape.
    """
    what = f"actions must have the shape {shape}, one for each drone of each search"
    try:
        given = np.asarray(actions)
    except ValueError:  # rows that differ in length
        raise ValueError(f"{what}, got {actions!r}") from None
    if given.dtype.kind not in "iu":
        raise TypeError(f"actions must be integers from 0 to 5, got {given.dtype}")
    if given.shape != shape:
        raise ValueError(f"{what}, got {given.shape}")
    # As unsigned integers, negative numbers are large.
    whole = np.ascontiguousarray(given, np.int64)
    unsigned = whole.reshape(-1).view(np.uint64)
    if np.maximum.reduce(unsigned) >= _ACTIONS:
        row, drone = divmod(int((unsigned >= _ACTIONS).argmax()), shape[1])
        raise ValueError(
            f"actions must be integers from 0 to 5, got {given[row, drone]} "
            f"for drone {drone} of search {row}"
        )
    return whole.astype(dtype)
