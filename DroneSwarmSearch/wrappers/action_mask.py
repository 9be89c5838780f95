"""Masks of the actions that are sensible, for learners that can use them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.rules import Action
from DroneSwarmSearch.wrappers.masks import action_masks
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper

__all__ = ["ActionMask"]


class ActionMask(SearchWrapper):
    """Tells every drone which actions it should not take; it may take them all the same.

    `infos[drone]["action_mask"]` is int8, shape (6,), indexed by `rules.Action`: 1 where an
    action is allowed, 0 for moves that leave the grid or lead into another drone's cell.
    Which two drones may still collide, and what right of way changes, see
    `masks.action_masks`.

    Args:
        env: the environment.
        in_observation: make observations {"observation": what they were, "action_mask":
            the mask}, too. TorchRL wants the mask in one place alone: leave it out there.
        right_of_way: mask moves to where a drone named earlier may be next, too: drones
            that keep to the mask then never collide.

    Raises:
        TypeError: `env` is no such environment, or a flag is neither True nor False.
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
        self._spaces: dict[str, spaces.Dict] = {}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        inner: spaces.Space[Any] = self.env.observation_space(agent)
        if not self.in_observation:
            return inner
        if agent not in self._spaces:
            mask = spaces.Box(0, 1, (len(Action),), np.int8)
            self._spaces[agent] = spaces.Dict({"observation": inner, "action_mask": mask})
        return self._spaces[agent]

    def action_masks(self) -> dict[str, NDArray[np.int8]]:
        """Every drone's mask in the present state: int8, shape (6,); new arrays.

        Raises:
            ResetNeeded: before the first `reset`.
        """
        size = self.unwrapped.grid_size
        cells = [y * size + x for x, y in self.unwrapped.frame().drones]
        masks = action_masks(cells, size, self.right_of_way).astype(np.int8)
        return dict(zip(self.possible_agents, masks, strict=True))

    def _shown(self, observations: Observations, infos: Infos) -> tuple[Observations, Infos]:
        masks = self.action_masks()
        for agent, mask in masks.items():
            infos[agent]["action_mask"] = mask
        if not self.in_observation:
            return observations, infos
        with_masks = {
            agent: {"observation": observation, "action_mask": masks[agent].copy()}
            for agent, observation in observations.items()
        }
        return with_masks, infos
