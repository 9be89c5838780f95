"""Observations as windows around the drone, fine and coarse."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.layouts.crops import CropsLayout

__all__ = ["CropsObservation"]


class CropsObservation(LayoutObservation):
    """Shows each drone the matrix and the other drones in windows around itself.

    float32, shape (202,), whatever the size of the grid and the number of drones, see
    `layouts.crops`. The policy "ppo" sees this.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, CropsLayout)
