"""PettingZoo wrappers that adapt the environment to RL libraries; they compose.

A typical stack:

    env = DroneSwarmSearch.example(bayesian_update=True)
    env = FlatObservation(ScaledRewards(SeparateFlags(env)))
    env = ActionMask(env, in_observation=True)

The environments in `DroneSwarmSearch.vector` offer the same through their arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array
from numpy.typing import NDArray
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.core.collision_avoidance import action_masks, swarm_masks
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.mappings import Infos, Rewards
from DroneSwarmSearch.core.radio import LastHeard
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.layouts import Layout, mask_space, remaining_time_fraction
from DroneSwarmSearch.layouts.layout import Heard, Sight, own_first
from DroneSwarmSearch.layouts.top_cells import TopCellsLayout
from DroneSwarmSearch.layouts.view import View

__all__ = [
    "ActionMask",
    "CropsObservation",
    "DictObservation",
    "FlatObservation",
    "OtherDrones",
    "PlanesObservation",
    "ScaledRewards",
    "SeparateFlags",
    "TopCellsObservation",
    "action_masks",
]

Observations = dict[str, Any]
Ends = dict[str, bool]
StepResult = tuple[Observations, Rewards, Ends, Ends, Infos]
"""What `step` returns: observations, rewards, terminations, truncations, infos."""


class SearchWrapper(BaseParallelWrapper[str, Any, int]):
    """A wrapper of `DroneSwarmSearch`, or of a wrapper of it; TypeError if `env` is something else.

    Attributes that the wrapper lacks are those of the wrapped environment: `scenario`,
    `frame`, `state_space` and so on.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        if not isinstance(env, ParallelEnv) or not isinstance(env.unwrapped, DroneSwarmSearch):
            raise TypeError(
                f"env must be a DroneSwarmSearch, or a parallel wrapper of one, got {env!r}"
            )
        super().__init__(env)
        self._search: DroneSwarmSearch = env.unwrapped
        self._grid = Grid.of(self._search.grid_size)
        self._names = tuple(env.possible_agents)
        self._spaces: dict[str, spaces.Space[Any]] = {}  # those that differ from the inner ones

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of a drone's observations; the same object at every call."""
        space = self._spaces.get(agent)
        return self.env.observation_space(agent) if space is None else space

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None, **arguments: Any
    ) -> tuple[Observations, Infos]:
        """Begin an episode; takes the arguments of the wrapped environment's `reset`."""
        observations, infos = self.env.reset(seed=seed, options=options, **arguments)
        return self._observed(observations, infos), infos

    def step(self, actions: Mapping[str, int]) -> StepResult:
        """Let every drone act once."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        shown = self._observed(observations, infos)
        return shown, rewards, terminations, truncations, infos

    def _observed(self, observations: Observations, infos: Infos) -> Observations:
        """The wrapper's observations of the current state; it may add to the infos."""
        return observations

    @property
    def agents(self) -> list[str]:  # faster than __getattr__
        """The drones of the running episode; empty between episodes."""
        agents: list[str] = self.env.agents
        return agents

    @property
    def observation_spaces(self) -> dict[str, spaces.Space[Any]]:
        """`observation_space` of every drone."""
        return {agent: self.observation_space(agent) for agent in self._names}


class LayoutObservation(SearchWrapper):
    """Replaces each drone's observation by a layout of what it knows.

    Every observation is a new array, equal to that of `DroneVectorEnv` bit for bit. Changes that
    inner wrappers made to the observations are lost, so put `ActionMask` around this wrapper.
    """

    def __init__(
        self, env: ParallelEnv[str, Any, int], layout: Callable[[Scenario], Layout]
    ) -> None:
        super().__init__(env)
        self.layout = layout(self._search.scenario)
        limit = self._search.timestep_limit
        self._left = remaining_time_fraction(np.arange(limit + 1), limit)
        self._spaces = {agent: deepcopy(self.layout.space) for agent in self._names}

    def _observed(self, observations: Observations, infos: Infos) -> Observations:
        now = self._search.snapshot()
        left = self._left[now.step : now.step + 1]
        positions = self._grid.coordinates.take(now.cells, axis=0)[None]
        space = self.layout.space
        different = now.matrices if self.layout.radio else now.matrices[:1]
        matrices = np.array(different)[None]
        heard = None
        if now.last_heard is not None:
            last = LastHeard(now.last_heard.cells[None], now.last_heard.ages[None])
            heard = Heard.of(last, self._search.grid_size, self._search.timestep_limit)
        sight = Sight(positions, matrices, left, heard)
        n = len(self._names)
        if isinstance(space, spaces.Box):
            shown: Any = np.empty((n, *space.shape), space.dtype)
            self.layout.write(sight, shown[None])
            return dict(zip(self._names, shown, strict=True))
        shown = create_empty_array(space, n, fn=np.empty)
        out = {name: array[None] for name, array in shown.items()}
        self.layout.write(sight, out)
        return {
            agent: {name: array[k] for name, array in shown.items()}
            for k, agent in enumerate(self._names)
        }


class DictObservation(LayoutObservation):
    """Each drone observes {"position": (x, y), "probability_matrix": matrix}.

    The position is int32, shape (2,). The matrix is float32, shape (N, N), indexed [y, x],
    and sums to 1.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, View("drone").layout)


class FlatObservation(LayoutObservation):
    """Each drone observes a vector: float32 in [0, 1], length 2 n_drones + 1 + N².

    Its own x and y, then those of the other drones in the order of their names, with the
    grid scaled to 1; the remaining time fraction, 1 at the start; the matrix row by row,
    with its maximum scaled to 1. With `radio_range`, the others are where they were last heard, and
    after them come the steps since then, as fractions of the time limit: n_drones - 1 numbers.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, View("drone", "flat").layout)


class PlanesObservation(LayoutObservation):
    """Each drone observes four planes: float32 in [0, 1], (4, N, N), indexed [plane, y, x].

    The matrix, with its maximum scaled to 1; 1 in the drone's own cell; 1 in the other
    drones' cells; the remaining time fraction in every cell. With `channels_last`, the shape is
    (N, N, 4), as RLlib expects images; PyTorch expects channels first. With `radio_range`, the
    others are where they were last heard, with 1 less the fraction of the time limit since then.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], channels_last: bool = False) -> None:
        super().__init__(env, View("drone", "planes").layout)
        self.channels_last = checks.boolean("channels_last", channels_last)
        if self.channels_last:
            shape = (*self.layout.space.shape[1:], 4)  # type: ignore[index]
            self._spaces = {agent: spaces.Box(0.0, 1.0, shape) for agent in self._names}

    def _observed(self, observations: Observations, infos: Infos) -> Observations:
        shown = super()._observed(observations, infos)
        if not self.channels_last:
            return shown
        return {agent: planes.transpose(1, 2, 0).copy() for agent, planes in shown.items()}


class TopCellsObservation(LayoutObservation):
    """Each drone observes the likeliest cells: float32 in [-1, 1], length 3 k + 2 n_drones + 1.

    For each of the k likeliest cells in descending order (ties row by row; k from 1 to N²), its
    offset to the right and down and its probability, with the maximum scaled to 1; the drone's own
    x and y; for each of the other drones, the nearest in steps first (ties by name), its offset to
    the right and down; the remaining time fraction. The grid is scaled to 1. With `radio_range`,
    the others are where they were last heard, and the steps since then come after them, as
    fractions of the time limit: n_drones - 1 numbers.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], k: int = 8) -> None:
        def layout(scenario: Scenario) -> Layout:
            radio = scenario.radio_range is not None
            return TopCellsLayout(scenario.grid_size, scenario.n_drones, k, radio=radio)

        super().__init__(env, layout)


class CropsObservation(LayoutObservation):
    """Each drone observes the matrix and the other drones in windows around itself.

    float32, shape (202,), for every grid size and number of drones, also with `radio_range`; see
    `CropsLayout`.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, View("drone", "crops").layout)


class OtherDrones(SearchWrapper):
    """Adds the positions of the other drones to each drone's observation.

    `observation["other_drones"]` is int32, shape (n_drones - 1, 2): the (x, y) of every
    other drone, in the order of their names. The observations of `env` must be dicts: its own, or
    those of `DictObservation`.

    With `radio_range`, these are the cells where the drone last heard the others, and
    `observation["other_drones_age"]`, int32, shape (n_drones - 1,), are the steps since then.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env)
        n = self._search.n_drones
        size = self._search.grid_size
        self._others = own_first(n)[:, 1:]
        for agent in self._names:
            inner: Any = env.observation_space(agent)
            others = {"other_drones": spaces.Box(0, size - 1, (n - 1, 2), np.int32)}
            if self._search.scenario.radio_range is not None:
                limit = self._search.timestep_limit
                others["other_drones_age"] = spaces.Box(0, limit, (n - 1,), np.int32)
            self._spaces[agent] = spaces.Dict({**inner.spaces, **others})

    def _observed(self, observations: Observations, infos: Infos) -> Observations:
        now = self._search.snapshot()
        others = np.array(now.cells)[self._others]
        if now.last_heard is not None:
            listeners = np.arange(len(self._names))[:, None]
            others = now.last_heard.cells[listeners, self._others]
            ages = now.last_heard.ages[listeners, self._others].astype(np.int32)
        shown = {}
        for drone, (agent, observation) in enumerate(observations.items()):
            positions = self._grid.coordinates.take(others[drone], axis=0)
            shown[agent] = {**observation, "other_drones": positions}
            if now.last_heard is not None:
                shown[agent]["other_drones_age"] = ages[drone]
        return shown


class ScaledRewards(SearchWrapper):
    """Multiplies all rewards by a constant above 0.

    The default is a power of two, 2**-17 = 1/131072, which is exact in floating point:
    `rewards / scale` is the reward of the table in `rules`, bit for bit. Then -100000 becomes
    -0.763, and 20000 becomes 0.153. The scale does not change which policies are better.
    """

    def __init__(self, env: ParallelEnv[str, Any, int], scale: float = 2**-17) -> None:
        super().__init__(env)
        self.scale = checks.positive("scale", scale)

    def step(self, actions: Mapping[str, int]) -> StepResult:
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        scale = self.scale
        scaled = Rewards({agent: reward * scale for agent, reward in rewards.items()})
        return observations, scaled, terminations, truncations, infos


class SeparateFlags(SearchWrapper):
    """Truncates episodes at the time limit, and terminates them at all other endings.

    `DroneSwarmSearch` sets both flags at every ending. With this wrapper, an episode is
    terminated if all persons are found, drones collide or a drone leaves the grid, even in
    the last step, and truncated if only the time limit ends it. Learners need this if they
    bootstrap values.
    """

    def step(self, actions: Mapping[str, int]) -> StepResult:
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        if any(terminations.values()) or any(truncations.values()):
            is_truncated = self._search.snapshot().ending is Ending.TIME_LIMIT
            terminations = dict.fromkeys(terminations, not is_truncated)
            truncations = dict.fromkeys(truncations, is_truncated)
        return observations, rewards, terminations, truncations, infos


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
        if self.in_observation:
            for agent in self._names:
                parts = {"observation": env.observation_space(agent), "action_mask": mask_space()}
                self._spaces[agent] = spaces.Dict(parts)

    def action_masks(self) -> dict[str, NDArray[np.int8]]:
        """Every drone's mask in the current state: int8, (6,); new arrays."""
        return dict(zip(self._names, self._masks(), strict=True))

    def _masks(self) -> list[NDArray[np.int8]]:
        now = self._search.snapshot()
        crash = self._search.scenario.crash
        if now.heard is None:
            return swarm_masks(now.cells, self._grid.neighbours, self.right_of_way, crash)
        size = self._search.grid_size
        masks = action_masks(now.cells, size, self.right_of_way, crash=crash, heard=now.heard)
        return [*masks.astype(np.int8)]

    def _observed(self, observations: Observations, infos: Infos) -> Observations:
        masks = self._masks()
        for info, mask in zip(infos.values(), masks, strict=True):
            info["action_mask"] = mask
        if not self.in_observation:
            return observations
        return {
            agent: {"observation": observation, "action_mask": mask.copy()}
            for (agent, observation), mask in zip(observations.items(), masks, strict=True)
        }
