"""Observations as windows around the drone, fine and coarse."""

from __future__ import annotations

from typing import Any

from pettingzoo import ParallelEnv

from DroneSwarmSearch.layouts.glimpses import GlimpsesLayout
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation

__all__ = ["GlimpsesObservation"]


class GlimpsesObservation(LayoutObservation):
    """Shows each drone the matrix and the other drones in windows around itself.

    float32, shape (202,), whatever the size of the grid and the number of drones, see
    `layouts.glimpses`. The policy "ppo" sees this.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, GlimpsesLayout)
