"""Masks of the sensible actions, for learners that support them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.grid import grid_of
from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.masks import mask_space, swarm_masks
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper, Step

__all__ = ["ActionMask"]


class ActionMask(SearchWrapper):
    """Adds to each drone's info a mask of sensible actions; all actions remain possible.

    `infos[drone]["action_mask"]` is int8, shape (6,), indexed by `rules.Action`: 0 for moves
    that leave the grid or lead into another drone's cell, else 1. `action_masks` explains
    which collisions remain possible, and how right of way prevents them.

    Args:
        env: the environment.
        in_observation: return observations {"observation": the wrapped environment's,
            "action_mask": the mask}, too. TorchRL needs the mask in one place only: False.
        right_of_way: also mask moves to where a drone with a lower number may be after the
            step; drones that follow their masks then never collide.

    Raises:
        TypeError: `env` is not such an environment, or a flag is not a bool.
    """

    def __init__(
        self,
        env: ParallelEnv[str, Any, int],
        in_observation: bool = False,
        right_of_way: bool = False,
    ) -> None:
        super().__init__(env)
        self.in_observation = checks.boolean("in_observation", in_observation)
        self.right_of_way = checks.boolean("right_of_way", right_of_way)
        self._neighbours, _ = grid_of(self._search.grid_size)
        self._spaces: dict[str, spaces.Dict] = {}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        inner: spaces.Space[Any] = self.env.observation_space(agent)
        if not self.in_observation:
            return inner
        if agent not in self._spaces:
            self._spaces[agent] = spaces.Dict({"observation": inner, "action_mask": mask_space()})
        return self._spaces[agent]

    def action_masks(self) -> dict[str, NDArray[np.int8]]:
        """Every drone's mask in the current state: int8, shape (6,); new arrays.

        Raises:
            ResetNeeded: before the first `reset`.
        """
        cells, _ = self._search._cells_and_world()
        masks = swarm_masks(cells, self._neighbours, self.right_of_way)
        return dict(zip(self._names, masks, strict=True))

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        observations, infos = self.env.reset(seed=seed, options=options, **arguments)
        return self._add_masks(observations, infos), infos

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        observations = self._add_masks(observations, infos)
        return observations, rewards, terminations, truncations, infos

    def _add_masks(self, observations: Observations, infos: Infos) -> Observations:
        cells, _ = self._search._cells_and_world()
        masks = swarm_masks(cells, self._neighbours, self.right_of_way)
        for info, mask in zip(infos.values(), masks, strict=True):
            info["action_mask"] = mask
        if not self.in_observation:
            return observations
        return {
            agent: {"observation": observation, "action_mask": mask.copy()}
            for (agent, observation), mask in zip(observations.items(), masks, strict=True)
        }
