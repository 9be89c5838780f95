"""The Gymnasium id "DroneSwarmSearch-v0": `SingleDroneEnv`, and batches of drones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch.core.mappings import Infos
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.env import DroneSwarmSearch
from DroneSwarmSearch.layouts.view import TOP_CELLS, View
from DroneSwarmSearch.vector.vector_env import MASKS_IN, DroneVectorEnv
from DroneSwarmSearch.wrappers import (
    ActionMask,
    LayoutObservation,
    ScaledRewards,
    SeparateFlags,
)

__all__ = ["SingleDroneEnv"]


@shows_keywords_of(DroneSwarmSearch)
class SingleDroneEnv(gymnasium.Env[Any, int]):
    """`DroneSwarmSearch` with one drone, as a Gymnasium environment.

    `import DroneSwarmSearch` registers it; "DroneSwarmSearch:DroneSwarmSearch-v0" also imports::

        env = gymnasium.make("DroneSwarmSearch-v0", grid_size=10, bayesian_update=True)

    ``gymnasium.make_vec("DroneSwarmSearch-v0", num_envs=1024)`` makes a `DroneVectorEnv` whose
    sub-environments return the same observations, rewards, flags and infos.

    Args:
        observation: the layout: "flat", "dict", "planes", "top-cells" or "crops"; see
            `DroneVectorEnv`.
        top_cells: the number of cells in the layout "top-cells"; from 1 to grid_size².
        action_mask: "info" puts the mask of valid actions into the infos: int8, (6,), 0 for
            moves that leave the grid. "observation" also makes every observation
            {"observation": the layout's, "action_mask": the mask}. None omits the masks.
        separate_flags: True sets only truncation at the time limit and only termination at
            other endings, as Gymnasium defines them. False sets both at every ending. Pass
            False if the rewards depend on the time limit, as by default: a learner that
            bootstraps values counts the loss at the limit repeatedly.
        reward_scale: a factor above 0 for the rewards; a power of two is exact.
        render_mode: None, "human", "ansi" or "rgb_array", as for `DroneSwarmSearch`.
        parameters: the other arguments of `DroneSwarmSearch`, such as `grid_size`, `vector`,
            `persons` or `scenario`.

    Attributes:
        search: the `DroneSwarmSearch`, which has `scenario`, `frame` and `state`.
    """

    metadata: ClassVar[dict[str, Any]] = {**DroneSwarmSearch.metadata}  # type: ignore[misc]

    def __init__(
        self,
        *,
        observation: str = "flat",
        top_cells: int = TOP_CELLS,
        action_mask: str | None = "info",
        separate_flags: bool = True,
        reward_scale: float = 1.0,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        view = View("drone", observation, top_cells=top_cells)
        checks.choice("action_mask", action_mask, MASKS_IN)
        self.search = DroneSwarmSearch(render_mode=render_mode, **parameters)
        if self.search.n_drones != 1:
            raise ValueError(
                f"n_drones must be 1 in a SingleDroneEnv, got {self.search.n_drones}; for several "
                "drones, use DroneSwarmSearch, or gymnasium.make_vec with "
                "vectorization_mode='vector_entry_point'"
            )
        self.render_mode = render_mode
        self._spec: EnvSpec | None = None
        env: Any = self.search
        if checks.boolean("separate_flags", separate_flags):
            env = SeparateFlags(env)
        if checks.positive("reward_scale", reward_scale) != 1.0:
            env = ScaledRewards(env, reward_scale)
        env = LayoutObservation(env, view.layout)
        self._masks = ActionMask(env, in_observation=action_mask == "observation")
        self._env: Any = env if action_mask is None else self._masks
        [self._drone] = self.search.possible_agents
        self.observation_space = self._env.observation_space(self._drone)
        self.action_space = self._env.action_space(self._drone)

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` sets, with the time limit of the search as `max_episode_steps`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec and replace(spec, max_episode_steps=self.search.timestep_limit)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; see `DroneSwarmSearch.reset`. The seed also seeds `np_random`."""
        observations, infos = self._env.reset(seed=seed, options=options)
        super().reset(seed=None if seed is None else int(seed))
        return observations[self._drone], self._info(infos)

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Let the drone act once, with an action from 0 to 5; see `DroneSwarmSearch.step`."""
        name = self._drone
        action = checks.integer("action", action, 0, len(Action) - 1)
        observations, rewards, terminations, truncations, infos = self._env.step({name: action})
        info = self._info(infos)
        return observations[name], rewards[name], terminations[name], truncations[name], info

    def action_masks(self) -> NDArray[np.bool_]:
        """The valid actions, as sb3-contrib expects them: bool, (6,), True where allowed."""
        return self._masks.action_masks()[self._drone].astype(np.bool_)

    def render(self) -> Any:
        """See `DroneSwarmSearch.render`."""
        return self.search.render()

    def close(self) -> None:
        """Close the window, if there is one; may be called repeatedly."""
        self.search.close()

    def _info(self, infos: Infos) -> dict[str, Any]:
        return {
            **infos[self._drone],
            "persons_found": np.array(infos["persons_found"]),
            "ending": int(infos["ending"] or 0),
            "step": infos["step"],
        }


def make_drones(num_envs: int = 1, **keywords: Any) -> DroneVectorEnv:
    """The batch that ``gymnasium.make_vec`` makes: num_envs drones, a multiple of `n_drones`."""
    scenario = keywords.get("scenario")
    drones = keywords.get("n_drones", Scenario.n_drones)
    if isinstance(scenario, Scenario):
        drones = scenario.n_drones
    drones = checks.integer("n_drones", drones, 1)
    swarms, rest = divmod(checks.integer("num_envs", num_envs, 1), drones)
    if rest:
        raise ValueError(
            f"num_envs must be a multiple of n_drones, {drones}, because each sub-environment is "
            f"a drone, got {num_envs}"
        )
    usual = {"observation": "flat", "action_mask": "info", "separate_flags": True}
    return DroneVectorEnv(swarms, **{**usual, **keywords})
