"""Many searches in which each sub-environment is a drone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv

__all__ = ["DroneVectorEnv", "make_drones"]


@shows_keywords_of(SearchVectorEnv)
class DroneVectorEnv(SearchVectorEnv):
    """Many searches; each sub-environment is a drone, for parameter sharing.

    The drones of a swarm are adjacent: sub-environment i * n_drones + k is drone k of swarm i,
    and num_envs = num_swarms * n_drones.

    Actions: `Discrete(6)` for each drone, see `rules.Action`.

    Observations of each drone:

    - "dict": `position`, its (x, y), int32, shape (2,), and `probability_matrix`, float32,
      (N, N), indexed [y, x]. With write_matrices=False, `matrix_index` replaces the matrix.
    - "flat": its x and y, then those of the other drones, scaled to the grid; the remaining
      share of the steps, 1 at the start; the matrix row by row, scaled to a maximum of 1:
      float32, (2 n_drones + 1 + N²,).
    - "planes": the matrix, scaled to a maximum of 1; the drone itself; the other drones (1 at
      their cells); the remaining share of the steps in every cell: float32, (4, N, N).
    - "top-cells": the likeliest cells and the other drones, relative to the drone: float32,
      (3 top_cells + 2 n_drones + 1,), see `layouts.top_cells`.
    - "crops": the matrix and the other drones in windows around the drone, fine and coarse:
      float32, (202,) for every search, see `layouts.crops`.

    Rewards: the drone's own, or with `shared_reward` the mean over its swarm.

    Infos, equal for all drones of a swarm, each with a mask of the same name after an
    underscore: `Found`, `is_success`, `persons_found`, `ending`, `step` and
    `probability_of_success`, as in `SwarmVectorEnv`. With action_mask="info", also
    `action_mask`, the drone's own: int8, (num_envs, 6).

    With action_mask="observation", every observation is {"observation": one of the above,
    "action_mask": int8, (6,)}.

    The keywords `observation`, `top_cells`, `write_matrices`, `action_mask`, `right_of_way`,
    `autoreset_mode`, `separate_flags`, `reward_scale`, `copy`, `render_mode`, `grid_size`,
    `n_drones`, `vector`, `person_initial_position`, `disperse_constant`, `timestep_limit`,
    `probability_of_detection`, `bayesian_update`, `reward_scheme`, `persons`, `mission`,
    `scenario`, `situations`, `situation`, `drones_positions` and `sampler` are those of
    `SwarmVectorEnv`.

    Args:
        num_swarms: the number of swarms.
        shared_reward: reward every drone with the mean over its swarm, in place of its own reward,
            so that drones cooperate.

    Attributes:
        num_envs: the number of sub-environments.
        batch: the `SearchBatch`, which knows the whole state of all searches.

    Raises:
        TypeError: an argument is of the wrong type, or there are unknown keywords.
        ValueError: an argument is out of its limits, or given together with a scenario.
    """

    _count_name = "num_swarms"
    _joint = False

    def __init__(
        self, num_swarms: int = 1, *, shared_reward: bool = False, **keywords: Any
    ) -> None:
        self._shares_reward = checks.boolean("shared_reward", shared_reward)
        super().__init__(num_swarms, **keywords)

    def _rewards(self) -> NDArray[np.float64]:
        rewards = self._scaled_rewards()
        if self._shares_reward:
            rewards = np.repeat(rewards.mean(axis=1), self._drones)
        return rewards.reshape(-1).copy()


def make_drones(
    num_envs: int = 1,
    *,
    observation: str = "flat",
    action_mask: str | None = "info",
    separate_flags: bool = True,
    **keywords: Any,
) -> DroneVectorEnv:
    """The batch that ``gymnasium.make_vec("DroneSwarmSearch-v0")`` makes.

    It has the defaults of `SingleDroneEnv`.

    Args:
        num_envs: the number of sub-environments, which are drones; a multiple of `n_drones`.
        observation: as for `DroneVectorEnv`.
        action_mask: as for `DroneVectorEnv`.
        separate_flags: as for `DroneVectorEnv`.
        keywords: the other arguments of `DroneVectorEnv`.

    Raises:
        TypeError: an argument is of the wrong type, or there are unknown keywords.
        ValueError: an argument is out of its limits.
    """
    scenario = keywords.get("scenario")
    drones = keywords.get("n_drones", Scenario.n_drones)
    if isinstance(scenario, Scenario):
        drones = scenario.n_drones
    drones = checks.integer("n_drones", drones, 1)
    if checks.integer("num_envs", num_envs, 1) % drones:
        raise ValueError(
            f"num_envs must be a multiple of n_drones, {drones}, because each sub-environment is "
            f"a drone, got {num_envs}"
        )
    swarms = num_envs // drones
    try:
        return DroneVectorEnv(
            swarms,
            observation=observation,
            action_mask=action_mask,
            separate_flags=separate_flags,
            **keywords,
        )
    except ValueError as error:  # name the argument that the caller passed
        message = str(error).replace(f"num_swarms={swarms}", f"num_envs={num_envs}")
        raise ValueError(message.replace("num_swarms", "num_envs")) from None
