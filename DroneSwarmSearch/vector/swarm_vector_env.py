"""Many searches in which each sub-environment is a swarm."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch.vector.vector_env import SearchVectorEnv

__all__ = ["SwarmVectorEnv"]


@shows_keywords_of(SearchVectorEnv)
class SwarmVectorEnv(SearchVectorEnv):
    """Many searches; each sub-environment is a swarm with a joint action and a team reward.

    Given the same seed and actions, each swarm reproduces `DroneSwarmSearch` bit for bit.

    Actions: `MultiDiscrete([6] * n_drones)` for each swarm, see `rules.Action`.

    Observations of each swarm:

    - "dict": `positions`, every drone's (x, y), int32, shape (n_drones, 2), and
      `probability_matrix`, float32, (N, N), indexed [y, x]. With write_matrices=False,
      `matrix_index` replaces the matrix.
    - "flat": every drone's x and y, scaled to the grid; the remaining share of the steps, 1 at
      the start; the matrix row by row, scaled to a maximum of 1: float32,
      (2 n_drones + 1 + N²,).
    - "planes": the matrix, scaled to a maximum of 1; for each drone a plane with 1 at its
      cell; the remaining share of the steps in every cell: float32, (2 + n_drones, N, N).
    - "top-cells", "crops": the observations of the drones in `DroneVectorEnv`,
      (n_drones, ...).

    Rewards: the sum over the drones.

    Infos, each with a mask of the same name after an underscore:

    - `rewards`: each drone's reward, (num_envs, n_drones).
    - `Found`: whether any person has been found.
    - `is_success`: whether the last step ended the episode with success: all persons have been
      found, or the coverage mission is complete.
    - `persons_found`: which persons have been found, (num_envs, persons).
    - `ending`: why the last step ended the episode, the integer value of an `Ending`; 0 while
      the episode continues.
    - `step`: completed steps.
    - `probability_of_success`: the cumulative probability of success (POS) of all searches so
      far, the mean over persons. Only with `bayesian_update`, `RewardScheme.expected()` or the
      coverage mission.
    - `action_mask`: int8, (num_envs, n_drones, 6), indexed by `rules.Action`. Only with
      action_mask="info".

    Args:
        num_envs: the number of swarms.
        observation: the layout: "dict", or "flat", "planes", "top-cells" or "crops", which
            are single float32 arrays.
        top_cells: the number of cells in the layout "top-cells"; from 1 to grid_size².
        write_matrices: False observes, in place of each matrix, its index in the table
            `matrices` that all swarms share. Only for one person, without `bayesian_update`,
            without a `sampler`, and with observation="dict".
        action_mask: where the masks of valid actions are, see `wrappers.action_masks`. With
            "observation", every observation is {"observation": the layout's, "action_mask":
            int8, (n_drones, 6)}. With "info", they are an info. With None, only the method
            `action_masks` returns them.
        right_of_way: whether the masks prevent all collisions.
        autoreset_mode: when an ended episode is followed by the next one: in the next step,
            in the same step (the final observation is in the infos, "final_obs"), or only
            in `reset` ("Disabled").
        separate_flags: False sets both termination and truncation at the end of an episode,
            as `DroneSwarmSearch` does. True sets only truncation at the time limit and only
            termination otherwise, for value bootstrapping.
        reward_scale: a factor above 0 for the rewards; a power of two is exact.
            `batch.rewards` are not scaled.
        copy: return new observations from every step; False overwrites the same ones.
        render_mode: None, "ansi" or "rgb_array": whether `render` returns text or pictures.
        scenario: the parameters of the searches; or pass them as keywords instead: `grid_size`,
            `n_drones`, `vector`, `person_initial_position`, `disperse_constant`,
            `timestep_limit`, `probability_of_detection`, `bayesian_update`, `reward_scheme`,
            `persons` and `mission`, see `Scenario`.
        situations: a catalogue in place of `persons`: a sequence of situations, each a
            sequence of `Person`, the same number in each. Every episode draws one of them with
            equal chances.
        situation: the number of a situation, from 0, for every episode, in place of the draw;
            or one for each swarm.
        drones_positions: the drones' cells at the start of every episode, shape (n_drones, 2)
            or (num_envs, n_drones, 2).
        sampler: draws the searches, see `Sampler`.

    Attributes:
        num_envs: the number of sub-environments.
        batch: the `SearchBatch`, which knows the whole state of all searches.

    Raises:
        TypeError: an argument is of the wrong type, or there are unknown keywords.
        ValueError: an argument is out of its limits, or given together with a scenario.
    """

    _count_name = "num_envs"
    _joint = True

    def __init__(self, num_envs: int = 1, **keywords: Any) -> None:
        super().__init__(num_envs, **keywords)

    def _rewards(self) -> NDArray[np.float64]:
        # Along the first axis NumPy adds in order, as `sum` does in the single environment.
        by_drone = np.ascontiguousarray(self._scaled_rewards().T)
        total: NDArray[np.float64] = np.add.reduce(by_drone, axis=0)
        return total

    def _infos(self) -> dict[str, Any]:
        return {"rewards": self._scaled_rewards().copy(), **super()._infos()}
