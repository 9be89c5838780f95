"""Arrays that a vector environment writes into, and their validation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Buffers"]

Arrays = Any  # an array, or for observations a dict of arrays


@dataclass(eq=False)
class Buffers:
    """Arrays for `use_buffers`, overwritten in every step.

    Attributes:
        observations: in the form of the batched observation space.
        rewards: floats, shape (num_envs,).
        terminations: bool, shape (num_envs,).
        truncations: bool, shape (num_envs,).
    """

    observations: Arrays
    rewards: Arrays
    terminations: Arrays
    truncations: Arrays


def check_buffers(buffers: Buffers, wanted: Buffers, largest_reward: float) -> None:
    """Raise unless the buffers can hold what the wanted ones can.

    Args:
        buffers: the caller's.
        wanted: buffers of the right shapes and dtypes.
        largest_reward: the largest absolute value of a reward.

    Raises:
        TypeError: something is not an array, or the observations have another form.
        ValueError: an array has another shape or dtype, or is read-only.
    """
    if not isinstance(buffers, Buffers):
        raise TypeError(f"buffers must be Buffers, got {buffers!r}")
    for name in ("rewards", "terminations", "truncations"):
        _check(name, getattr(buffers, name), getattr(wanted, name), exact=False)
    if isinstance(wanted.observations, dict):
        keys = list(wanted.observations)
        if not isinstance(buffers.observations, Mapping) or {*buffers.observations} != {*keys}:
            raise TypeError(
                f"buffers.observations must be a mapping with the keys {keys}, "
                f"got {buffers.observations!r}"
            )
        for key, array in wanted.observations.items():
            _check(f"observations[{key!r}]", buffers.observations[key], array)
    else:
        _check("observations", buffers.observations, wanted.observations)
    dtype = buffers.rewards.dtype
    if dtype.kind != "f" or (dtype.itemsize < 8 and largest_reward > float(np.finfo(dtype).max)):
        raise ValueError(
            f"buffers.rewards must hold real numbers up to {largest_reward:g} "
            f"(see reward_scale), got {dtype}"
        )


def _check(name: str, given: Any, wanted: Arrays, exact: bool = True) -> None:
    if not isinstance(given, np.ndarray):
        raise TypeError(f"buffers.{name} must be a NumPy array, got {given!r}")
    fits = np.can_cast(wanted.dtype, given.dtype, "same_kind")
    if given.shape != wanted.shape or not fits or (exact and given.dtype != wanted.dtype):
        raise ValueError(
            f"buffers.{name} must be of shape {wanted.shape} and dtype {wanted.dtype}, "
            f"got {given.shape} and {given.dtype}"
        )
    if not given.flags.writeable:
        raise ValueError(f"buffers.{name} must be writeable, got a read-only array")
