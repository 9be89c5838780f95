"""Observations as one vector."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.layouts.flat import FlatLayout

__all__ = ["FlatObservation"]


class FlatObservation(LayoutObservation):
    """Shows each drone a vector: float32 in [0, 1], length 2 n_drones + 1 + N².

    Its own x and y, then those of the other drones in the order of their names, with the
    grid scaled to 1; the share of the steps left, 1 at the beginning; the matrix row by
    row, with its maximum scaled to 1.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, FlatLayout)
