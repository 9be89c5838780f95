"""What the wrappers share that show each drone a layout in place of its observation."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.layout import Layout, remaining_time_fraction
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper

__all__ = ["LayoutObservation"]


class LayoutObservation(SearchWrapper):
    """Shows each drone what a layout shows of the environment's state.

    What wrappers inside it have made of the observations is replaced. Every observation is
    a new array, and the same, to the last bit, as `DroneVectorEnv` shows in that layout.

    Args:
        env: the environment.
        layout: the layout's class.
        options: its arguments beside the size of the search.

    Raises:
        TypeError: `env` is no such environment, or an option is of the wrong type.
        ValueError: an option is out of its limits, or `env` has masks in its observations.
    """

    def __init__(
        self, env: ParallelEnv[str, Any, int], layout: type[Layout], **options: Any
    ) -> None:
        super().__init__(env)
        inner = env.observation_space(self.possible_agents[0])
        if isinstance(inner, spaces.Dict) and "action_mask" in inner.spaces:
            raise ValueError(
                f"env must not have masks in its observations, which {type(self).__name__} "
                f"would replace; put ActionMask(in_observation=True) around it, got {env}"
            )
        self.layout = layout(self.unwrapped.grid_size, self.unwrapped.n_drones, **options)
        checks.fits(
            "the drones' observations",
            14 * spaces.flatdim(self.layout.space) * self.unwrapped.n_drones,  # and their spaces
            grid_size=self.unwrapped.grid_size,
            n_drones=self.unwrapped.n_drones,
        )
        self._spaces = {agent: deepcopy(self.layout.space) for agent in self.possible_agents}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space = self._spaces.get(agent)
        return self.unwrapped.observation_space(agent) if space is None else space

    def _shown(self, observations: Observations, infos: Infos) -> tuple[Observations, Infos]:
        frame, drones = self.unwrapped.frame(), len(self.possible_agents)
        positions = np.array([frame.drones], np.int32)
        left = remaining_time_fraction([frame.step], frame.timestep_limit)
        shown: Any = create_empty_array(self.layout.space, drones, fn=np.empty)
        if isinstance(shown, dict):
            out: Any = {key: array[None] for key, array in shown.items()}
            by_drone = [{key: array[k] for key, array in shown.items()} for k in range(drones)]
        else:
            out, by_drone = shown[None], list(shown)
        self.layout.write(positions, frame.matrix[None].copy(), left, out)
        return dict(zip(self.possible_agents, by_drone, strict=True)), infos
