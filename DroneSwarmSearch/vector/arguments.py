"""What the vector environments accept: their keywords, `reset`'s arguments, and buffers."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Ints
from DroneSwarmSearch.vector.parameters import ROW_PARAMETERS

__all__ = [
    "MASKS_IN",
    "Buffers",
    "check_buffers",
    "parse_options",
    "parse_seeds",
    "shows_keywords_of",
]

MASKS_IN = (None, "observation", "info")
"""Where action masks may be."""

Arrays = Any  # an array, or for observations a dict of arrays
Class = TypeVar("Class", bound=type)


def shows_keywords_of(source: type, *without: str) -> Callable[[Class], Class]:
    """Decorate a class whose constructor passes **keywords on: list them in its signature.

    The signature shows names and defaults, without types.

    Args:
        source: the class whose constructor receives the keywords.
        without: parameters that are not listed.
    """

    def decorate(made: Class) -> Class:
        _, *own = inspect.signature(made.__init__).parameters.values()  # type: ignore[misc]
        shown = [each for each in own if each.kind is not each.VAR_KEYWORD]
        names = {each.name for each in shown}.union(without)
        for each in inspect.signature(source).parameters.values():
            by_name = each.kind in (each.KEYWORD_ONLY, each.POSITIONAL_OR_KEYWORD)
            if by_name and each.name not in names:
                shown.append(each.replace(kind=each.KEYWORD_ONLY))
        plain = [each.replace(annotation=each.empty) for each in shown]
        made.__signature__ = inspect.Signature(plain)  # type: ignore[attr-defined]
        return made

    return decorate


def parse_options(
    options: Mapping[str, Any] | None, num_envs: int, per_swarm: int
) -> tuple[Ints, dict[str, Any]]:
    """The swarms to reset, and the parameters given for them.

    Args:
        options: the options.
        num_envs: the number of sub-environments.
        per_swarm: the sub-environments in each swarm.
    """
    all_rows = np.arange(num_envs // per_swarm)
    if options is None:
        return all_rows, {}
    options = checks.known_options(options, ("reset_mask", *ROW_PARAMETERS), stacklevel=3)
    given = {key: options[key] for key in ROW_PARAMETERS if options.get(key) is not None}
    mask = options.get("reset_mask")
    if mask is None:
        return all_rows, given
    what = f"options['reset_mask'] must be a bool array of shape ({num_envs},)"
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
        raise TypeError(f"{what}, got {mask!r}")
    if mask.shape != (num_envs,):
        raise ValueError(f"{what}, got shape {mask.shape}")
    by_swarm = mask.reshape(-1, per_swarm)
    wanted: Flags = np.logical_or.reduce(by_swarm, axis=1)
    if not wanted.any():
        raise ValueError(f"{what} with at least one True, got none")
    if (by_swarm != wanted[:, None]).any():
        raise ValueError(f"{what}, equal for all drones of a swarm, got {mask!r}")
    return wanted.nonzero()[0], given


def parse_seeds(
    seed: int | Sequence[int | None] | None, num_envs: int, per_swarm: int
) -> list[int | None]:
    """A seed for each swarm, or an empty list without seeds; arguments as in `parse_options`."""
    swarms = num_envs // per_swarm
    if seed is None:
        return []
    several = isinstance(seed, Sequence) and not isinstance(seed, str)
    if not several and not (isinstance(seed, np.ndarray) and seed.ndim):
        first = checks.integer("seed", seed, 0)
        return list(range(first, first + swarms))
    seeds = checks.seeds("seed", seed)
    if len(seeds) == num_envs:
        return seeds[::per_swarm]
    if len(seeds) != swarms:
        each = f", or {num_envs}, one per drone" if per_swarm > 1 else ""
        raise ValueError(
            f"seed must be an integer, or {swarms} of them, one per swarm{each}; got {len(seeds)}"
        )
    return seeds


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
    _check_observations("observations", buffers.observations, wanted.observations)
    dtype = buffers.rewards.dtype
    if dtype.kind != "f" or (dtype.itemsize < 8 and largest_reward > float(np.finfo(dtype).max)):
        raise ValueError(
            f"buffers.rewards must hold real numbers up to {largest_reward:g} "
            f"(see reward_scale), got {dtype}"
        )


def _check_observations(name: str, given: Any, wanted: Arrays) -> None:
    """Check an array, or a mapping of them, which may be nested."""
    if not isinstance(wanted, dict):
        _check(name, given, wanted)
        return
    if not isinstance(given, Mapping) or {*given} != {*wanted}:
        raise TypeError(
            f"buffers.{name} must be a mapping with the keys {[*wanted]}, got {given!r}"
        )
    for key, array in wanted.items():
        _check_observations(f"{name}[{key!r}]", given[key], array)


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
