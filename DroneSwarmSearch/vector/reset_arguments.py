"""The arguments of a vector environment's `reset`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.vector.arrays import Flags, Ints
from DroneSwarmSearch.vector.parameters import ROW_PARAMETERS

__all__ = ["parse_options", "parse_seeds"]


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
