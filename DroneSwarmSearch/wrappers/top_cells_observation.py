"""Observations as the likeliest cells and where they lie."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.layouts.top_cells import TopCellsLayout

__all__ = ["TopCellsObservation"]


class TopCellsObservation(LayoutObservation):
    """Shows each drone the likeliest cells: float32 in [-1, 1], length 3 k + 2 n_drones + 1.

    For each of the k likeliest cells, the likeliest first (of equals the first row by row),
    how far it lies to the right and how far down, and its probability, with the maximum
    scaled to 1; the drone's own x and y; for each of the other drones, the nearest first
    (in steps; of equals the first named), how far it is to the right and down; the share of
    the steps left. Distances and positions have the grid scaled to 1.

    Args:
        env: the environment.
        k: how many cells; from 1 to grid_size².

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one, or k no integer.
        ValueError: k is out of its limits, or `env` has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], k: int = 8) -> None:
        super().__init__(env, TopCellsLayout, k=k)
