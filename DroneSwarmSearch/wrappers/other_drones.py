"""The positions of the other drones, which the environment's observations do not contain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal.mappings import Infos
from DroneSwarmSearch.wrappers.layout import own_first
from DroneSwarmSearch.wrappers.wrapper import Observations, SearchWrapper, Step

__all__ = ["OtherDrones"]

_NAME = "other_drones"


class OtherDrones(SearchWrapper):
    """Adds the positions of the other drones to each drone's observation.

    `observation["other_drones"]` is int32, shape (n_drones - 1, 2): the (x, y) of every
    other drone, in the order of their names.

    Args:
        env: the environment, with its own observations or those of `DictObservation`.

    Raises:
        TypeError: `env` is not such an environment.
        ValueError: its observations are of another form.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        n, size = self._search.n_drones, self._search.grid_size
        self._others = own_first(n)[:, 1:]
        self._spaces: dict[str, spaces.Dict] = {}
        for agent in self.possible_agents:
            inner = env.observation_space(agent)
            if not isinstance(inner, spaces.Dict) or _NAME in inner.spaces:
                raise ValueError(
                    "env must not show the other drones already, as all layouts but "
                    f"DictObservation do, got observations in {inner}"
                )
            if "action_mask" in inner.spaces:
                raise ValueError(
                    "env must not have masks in its observations; put "
                    f"ActionMask(in_observation=True) around OtherDrones, got {env}"
                )
            others = spaces.Box(0, size - 1, (n - 1, 2), np.int32)
            self._spaces[agent] = spaces.Dict({**inner.spaces, _NAME: others})

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space = self._spaces.get(agent)
        return self.env.observation_space(agent) if space is None else space

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        observations, infos = self.env.reset(seed=seed, options=options, **arguments)
        return self._add_others(observations), infos

    def step(self, actions: Mapping[str, int]) -> Step:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        return self._add_others(observations), rewards, terminations, truncations, infos

    def _add_others(self, observations: Observations) -> Observations:
        cells, _ = self._search._cells_and_world()
        y, x = np.divmod(np.array(cells, np.int32), np.int32(self._search.grid_size))
        others = np.stack([x, y], axis=-1)[self._others]
        return {
            agent: {**observation, _NAME: positions}
            for (agent, observation), positions in zip(observations.items(), others, strict=True)
        }
