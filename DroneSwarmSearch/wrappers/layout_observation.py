"""The base class of the wrappers that replace observations by a layout."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.layout import Layout, remaining_time_fraction
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper, Step

__all__ = ["LayoutObservation"]


class LayoutObservation(SearchWrapper):
    """Replaces each drone's observation by a layout of the current state.

    Every observation is a new array. `DroneVectorEnv` returns the same arrays, bit for bit,
    with the layout of the same name. Changes that inner wrappers made to the observations
    are lost.

    Args:
        env: the environment.
        layout: the class of the layout.
        options: its arguments besides the grid size and the number of drones.

    Raises:
        TypeError: `env` is not such an environment, or an option is of the wrong type.
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
        search = self._search
        self.layout = layout(search.grid_size, search.n_drones, **options)
        checks.fits(
            "the drones' observations",
            14 * spaces.flatdim(self.layout.space) * search.n_drones,  # with their spaces
            grid_size=search.grid_size,
            n_drones=search.n_drones,
        )
        self._spaces = {agent: deepcopy(self.layout.space) for agent in self._names}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space = self._spaces.get(agent)
        return self._search.observation_space(agent) if space is None else space

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        _, infos = self.env.reset(seed=seed, options=options, **arguments)
        return self._observe(), infos

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        _, rewards, terminations, truncations, infos = self.env.step(actions)
        return self._observe(), rewards, terminations, truncations, infos

    def _observe(self) -> Observations:
        """Every drone's observation of the current state; new arrays."""
        cells, world = self._search._cells_and_world()
        y, x = np.divmod(np.array(cells, np.int32), np.int32(self._search.grid_size))
        left = remaining_time_fraction([world.step], self._search.timestep_limit)
        arrays: Any = create_empty_array(self.layout.space, len(cells), fn=np.empty)
        if isinstance(arrays, dict):
            out: Any = {key: array[None] for key, array in arrays.items()}
            by_drone = [{key: array[k] for key, array in arrays.items()} for k in range(len(cells))]
        else:
            out, by_drone = arrays[None], list(arrays)
        positions = np.stack([x, y], axis=-1)[None]
        self.layout.write(positions, world.matrix()[None], left, out)
        return dict(zip(self._names, by_drone, strict=True))
