"""Observations as planes, as of a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation
from DroneSwarmSearch.wrappers.layouts.planes import PlanesLayout
from DroneSwarmSearch.wrappers.wrapper import Observations

__all__ = ["PlanesObservation"]


class PlanesObservation(LayoutObservation):
    """Shows each drone four planes: float32 in [0, 1], shape (4, N, N), indexed [plane, y, x].

    The matrix, with its maximum scaled to 1; the drone itself, 1 at its cell; the other
    drones, 1 at their cells; the share of the steps left, in every cell.

    Args:
        env: the environment.
        channels_last: shape (N, N, 4), indexed [y, x, plane], as RLlib wants pictures;
            PyTorch, and what is built on its layers, wants them first.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one, or `channels_last`
            no bool.
        ValueError: `env` has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], channels_last: bool = False) -> None:
        super().__init__(env, PlanesLayout)
        self.channels_last = checks.boolean("channels_last", channels_last)
        if self.channels_last:
            size = self.unwrapped.grid_size
            self._spaces = {
                agent: spaces.Box(0.0, 1.0, (size, size, 4), np.float32)
                for agent in self.possible_agents
            }

    def _shown(self, observations: Observations, infos: Infos) -> tuple[Observations, Infos]:
        shown, infos = super()._shown(observations, infos)
        if self.channels_last:
            shown = {
                agent: np.ascontiguousarray(planes.transpose(1, 2, 0))
                for agent, planes in shown.items()
            }
        return shown, infos
