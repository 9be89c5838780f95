"""Gymnasium's vector API around a `SearchBatch`, with its names, autoreset and infos (1.x)."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, iterate
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch.core.collision_avoidance import action_masks
from DroneSwarmSearch.core.frame import Frame
from DroneSwarmSearch.core.rules import Action, Ending, successes
from DroneSwarmSearch.layouts.layout import Observations
from DroneSwarmSearch.layouts.view import TOP_CELLS, View
from DroneSwarmSearch.rendering.display import Display
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations

Values = Any  # an array with a first axis for the sub-environments
Infos = dict[str, Any]

MASKS_IN = (None, "observation", "info")  # where action masks may be

_OPTIONS = ("situations", "situation", "drones_positions")
"""The options of `reset` that `SearchBatch.reset` takes."""


@shows_keywords_of(SearchBatch, "num_rows", "finds_last")
class SearchVectorEnv(VectorEnv[Observations, ArrayLike, Any]):
    """What both vector environments share; `SwarmVectorEnv` describes it."""

    metadata: dict[str, Any] = {  # noqa: RUF012 (as in the base class)
        "name": "drone_swarm_search_v0",
        "render_modes": ["ansi", "rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    _count_name: str
    """The constructor's name for the number of swarms."""

    _joint: bool
    """Whether a sub-environment is a whole swarm."""

    def __init__(
        self,
        num_swarms: int,
        /,
        *,
        observation: str = "dict",
        top_cells: int = TOP_CELLS,
        action_mask: str | None = None,
        right_of_way: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        separate_flags: bool = False,
        reward_scale: float = 1.0,
        copy: bool = True,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        self._check_names(parameters)
        swarms = checks.integer(self._count_name, num_swarms, 1)
        copies = checks.boolean("copy", copy)
        self._mask = checks.choice("action_mask", action_mask, MASKS_IN)
        self.right_of_way = checks.boolean("right_of_way", right_of_way)
        view = View(
            form="swarm" if self._joint else "drone",
            observation=observation,
            action_mask=self._mask == "observation",
            right_of_way=self.right_of_way and self._mask == "observation",
            top_cells=top_cells,
        )
        self.autoreset_mode = self._mode = AutoresetMode(autoreset_mode)  # TorchRL reads it
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        self._separate = checks.boolean("separate_flags", separate_flags)
        self._scale = checks.positive("reward_scale", reward_scale)
        self.render_mode = checks.choice("render_mode", render_mode, (None, "ansi", "rgb_array"))

        self.batch = SearchBatch(swarms, **parameters)
        scenario = self.batch.scenario_of(0)
        self._size = scenario.grid_size
        self._radio_range = scenario.radio_range
        self._display = Display(self._size, fps=self.metadata["render_fps"])
        self._each = 1 if self._joint else scenario.n_drones  # sub-environments in a swarm
        self.num_envs = swarms * self._each
        self._observations = BatchObservations(self.batch, view)
        self._make_spaces(scenario.n_drones)
        self._reused = None if copies else self._observations.empty(swarms)
        # Once a large block has been freed, glibc keeps what steps free, instead of returning it
        # to the system: with 64 searches and crops, a step takes a third less time.
        np.empty(2**24, np.uint8)

    def _make_spaces(self, n_drones: int) -> None:
        """Make the spaces of a sub-environment and of all together."""
        self.single_observation_space = self._observations.space
        self.single_action_space = spaces.Discrete(len(Action))
        if self._joint:
            self.single_action_space = spaces.MultiDiscrete([len(Action)] * n_drones)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    @classmethod
    def _check_names(cls, parameters: Mapping[str, Any]) -> None:
        """Raise a TypeError for a keyword that no constructor on the way knows."""
        known = [*inspect.signature(cls).parameters]
        for name in parameters:
            if name not in known:
                raise TypeError(
                    f"{cls.__name__} got an unexpected keyword argument {name!r}"
                    f"{did_you_mean(name, known)}"
                )

    @abstractmethod
    def _rewards(self) -> Floats:
        """The rewards of the last step: (num_envs,), a new array."""

    def _infos(self) -> Infos:
        """The infos of all sub-environments, without Gymnasium's masks such as "_Found"."""
        batch = self.batch
        each = self._each
        infos: Infos = {
            "Found": batch.found,
            "is_success": successes(batch.endings),
            "persons_found": ~batch.missing,
            "ending": batch.endings.copy(),
            "step": batch.steps,
        }
        success = batch.probability_of_success
        if success is not None:
            infos["probability_of_success"] = success
        if not self._joint:
            infos = {name: values.repeat(each, axis=0) for name, values in infos.items()}
        if self._mask == "info":
            masks = self.action_masks().astype(np.int8)
            infos["action_mask"] = (
                masks.reshape(*self.batch.cells.shape, -1) if self._joint else masks
            )
        return infos

    # Gymnasium's API.

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Begin episodes.

        Args:
            seed: an integer s >= 0, which seeds swarm i with s + i; or a sequence with a
                seed for each swarm or for each sub-environment (a swarm takes its first
                drone's). Swarms with None continue their sequence of episodes, and so do
                all swarms without a seed. The first swarm's seed also seeds `np_random`.
            options: may hold "reset_mask", bool, shape (num_envs,), the sub-environments to
                reset (all or none of a swarm); "situations", a new catalogue, also for later
                episodes; and "situation" and "drones_positions" for this episode only, with
                one value for all swarms, or one for each.

        Returns:
            The observations of all sub-environments, and the infos of those that were reset.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        known: dict[str, Any] = {}
        if options is not None:
            known = checks.known_options(options, ("reset_mask", *_OPTIONS), stacklevel=2)
        rows = self._rows_of(known.get("reset_mask"))
        seeds = self._seeds_of(seed)
        chosen = [seeds[row] for row in rows.tolist()]
        self.batch.reset(chosen, rows, **{name: known.get(name) for name in _OPTIONS})
        if seeds[0] is not None:
            super().reset(seed=seeds[0])  # seeds `np_random`
        return self._observed(), self._masked_infos(rows)

    def step(self, actions: ArrayLike) -> tuple[Observations, Values, Values, Values, Infos]:
        """Let every drone act once.

        Args:
            actions: an element of the batched action space.

        Returns:
            Observations, rewards, terminations, truncations and infos of all
            sub-environments. With autoreset in the next step, a sub-environment whose
            episode has ended ignores its action, gets the first observation of its next
            episode, and the reward 0.

        Raises:
            ResetNeeded: before the first `reset`; with autoreset disabled, if episodes have
                ended.
            TypeError: the actions are not integers.
            ValueError: they are out of range or have another shape.
            Exception: any error of a sampler. With autoreset in the same step, the step is
                complete then, and a reset is needed.
        """
        batch = self.batch
        given = np.asarray(actions)
        if given.shape != self.action_space.shape:
            raise ValueError(
                f"actions must have the shape {self.action_space.shape}, got {given.shape}"
            )
        in_next_step = self._mode is AutoresetMode.NEXT_STEP
        batch.step(given.reshape(batch.cells.shape), autoreset=in_next_step)
        final: Infos = {}
        ended = batch.ended.nonzero()[0]
        if self._mode is AutoresetMode.SAME_STEP and ended.size:
            final = self._final_infos(ended)
            of_step = batch.rewards, batch.endings
            batch.reset(rows=ended)
            batch.rewards, batch.endings = of_step
        rewards = self._rewards()
        terminated, truncated = self._flags()
        infos = {**self._masked_infos(), **final}
        return self._observed(), rewards, terminated, truncated, infos

    def render(self) -> tuple[Any, ...] | None:
        """Render every sub-environment as text or as a picture, uint8 (H, W, 3); see `render_mode`.

        All drones of a swarm share the picture of their swarm.
        """
        if self.render_mode is None:
            return None
        shown: list[Any] = []
        for swarm in range(self.batch.num_rows):
            picture = self._display.render(self.frame(swarm), self.render_mode)
            shown += [picture] * self._each
        return tuple(shown)

    # Beyond Gymnasium's API.

    def frame(self, swarm: int) -> Frame:
        """Everything that a picture of one swarm shows, including the persons."""
        return self.batch.frame(swarm)

    def action_masks(self, right_of_way: bool | None = None) -> Flags:
        """The valid actions of every sub-environment, see `wrappers.action_masks`.

        By default, `right_of_way` is as in the constructor.

        Returns:
            bool, True where allowed, shape (num_envs, 6) in a `DroneVectorEnv`, indexed by
            `rules.Action`; (num_envs, n_drones * 6) in a `SwarmVectorEnv`, drone by drone.
        """
        if right_of_way is None:
            right_of_way = self.right_of_way
        batch = self.batch
        heard = None if self._radio_range is None else batch.heard
        masks = action_masks(batch.cells, self._size, right_of_way, crash=batch.crash, heard=heard)
        return masks.reshape(self.num_envs, -1)

    # Input.

    def _rows_of(self, mask: ArrayLike | None) -> Ints:
        """The swarms to reset, given the option "reset_mask"."""
        if mask is None:
            return np.arange(self.batch.num_rows)
        given = np.asarray(mask)
        if given.dtype != np.bool_ or given.shape != (self.num_envs,):
            raise ValueError(
                f"options['reset_mask'] must be a bool array of shape ({self.num_envs},), "
                f"got {mask!r}"
            )
        by_swarm = given.reshape(-1, self._each)
        if (by_swarm != by_swarm[:, :1]).any():
            raise ValueError(
                f"options['reset_mask'] must be equal for all drones of a swarm, got {mask!r}"
            )
        return by_swarm[:, 0].nonzero()[0]

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for each swarm."""
        swarms = self.batch.num_rows
        if seed is None:
            return [None] * swarms
        if isinstance(seed, str) or np.ndim(seed) == 0:  # type: ignore[arg-type]
            first = checks.integer("seed", seed, 0)
            return list(range(first, first + swarms))
        seeds = checks.seeds("seed", seed)
        if len(seeds) == self.num_envs:
            return seeds[:: self._each]
        if len(seeds) != swarms:
            raise ValueError(f"seed must hold {swarms} integers, one per swarm, got {len(seeds)}")
        return seeds

    # Output.

    def _observed(self) -> Observations:
        """The observations of all sub-environments."""
        out = self._reused
        if out is None:
            out = self._observations.empty(self.batch.num_rows)
        self._observations.write(out)
        return out

    def _flags(self) -> tuple[Flags, Flags]:
        """Terminations and truncations of all sub-environments."""
        terminated = truncated = self.batch.endings != 0
        if self._separate:
            truncated = self.batch.endings == Ending.TIME_LIMIT
            terminated = terminated & ~truncated
        return terminated.repeat(self._each), truncated.repeat(self._each)

    def _masked_infos(self, rows: Ints | None = None) -> Infos:
        """The infos, each with a mask of the sub-environments of some swarms, or of all."""
        mask = np.full(self.num_envs, rows is None)
        if rows is not None:
            mask.reshape(-1, self._each)[rows] = True
        infos = self._infos()
        return {**infos, **{f"_{key}": mask.copy() for key in infos}}

    def _final_infos(self, rows: Ints) -> Infos:
        """The final observations and infos of swarms whose episodes have ended."""
        infos = self._masked_infos(rows)
        final = np.full(self.num_envs, None, object)
        mask = infos["_step"].copy()
        observed = iterate(self.observation_space, self._observations.of_rows(rows))
        for env, observation in zip(mask.nonzero()[0].tolist(), observed, strict=True):
            final[env] = observation
        return {
            "final_obs": final,
            "_final_obs": mask,
            "final_info": infos,
            "_final_info": mask.copy(),
        }


@shows_keywords_of(SearchVectorEnv)
class SwarmVectorEnv(SearchVectorEnv):
    """Many searches; each sub-environment is a swarm with a joint action and a team reward.

    Given the same seed and actions, each swarm reproduces `DroneSwarmSearch` bit for bit.

    Actions: `MultiDiscrete([6] * n_drones)` for each swarm, see `rules.Action`.

    Observations of each swarm:

    - "dict": `positions`, every drone's (x, y), int32, shape (n_drones, 2), and
      `probability_matrix`, float32, (N, N), indexed [y, x]; with `radio_range` that of each
      drone, (n_drones, N, N), as in "flat" and "planes".
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
        scenario, situations, situation, drones_positions, sampler: as for `SearchBatch`.
        grid_size, n_drones, vector, person_initial_position, disperse_constant: as for a
            `Scenario`, in place of `scenario`.
        timestep_limit, probability_of_detection, bayesian_update: as for a `Scenario`.
        reward_scheme, persons, mission, shared_drift, crash: as for a `Scenario`.
        radio_range, search_in_flight: as for a `Scenario`.

    Attributes:
        num_envs: the number of sub-environments.
        batch: the `SearchBatch`, which knows the whole state of all searches.
        right_of_way: whether the masks have right of way.

    Raises:
        TypeError: an argument is of the wrong type, or there are unknown keywords.
        ValueError: an argument is out of its limits, or given together with a scenario.
    """

    _count_name = "num_envs"
    _joint = True

    def __init__(self, num_envs: int = 1, **keywords: Any) -> None:
        super().__init__(num_envs, **keywords)

    def _rewards(self) -> Floats:
        # Along the first axis NumPy adds in order, as `sum` does in the single environment.
        total: Floats = np.add.reduce((self.batch.rewards * self._scale).T.copy(), axis=0)
        return total

    def _infos(self) -> Infos:
        return {"rewards": self.batch.rewards * self._scale, **super()._infos()}


@shows_keywords_of(SearchVectorEnv)
class DroneVectorEnv(SearchVectorEnv):
    """Many searches; each sub-environment is a drone, for parameter sharing.

    The drones of a swarm are adjacent: sub-environment i * n_drones + k is drone k of swarm i,
    and num_envs = num_swarms * n_drones.

    Actions: `Discrete(6)` for each drone, see `rules.Action`.

    Observations of each drone:

    - "dict": `position`, its (x, y), int32, shape (2,), and `probability_matrix`, as
      in `SwarmVectorEnv`.
    - "flat": its x and y, then those of the other drones, and the rest as in `SwarmVectorEnv`.
    - "planes": the matrix, scaled to a maximum of 1; the drone itself; the other drones (1 at
      their cells); the remaining share of the steps in every cell: float32, (4, N, N).
    - "top-cells": the likeliest cells and the other drones, relative to the drone: float32,
      (3 top_cells + 2 n_drones + 1,), see `layouts.top_cells`.
    - "crops": the matrix and the other drones in windows around the drone, fine and coarse:
      float32, (202,) for every search, see `layouts.crops`.

    With `radio_range`, a drone observes its own matrix, and of the others where it last heard
    them, and how long ago, as a fraction of the time limit: n_drones - 1 numbers more in "flat"
    and "top-cells", after the positions of the others; in "planes" and "crops", another drone
    counts as 1 less this fraction.

    Rewards: the drone's own, or with `shared_reward` the mean over its swarm.

    Infos: those of `SwarmVectorEnv` but `rewards`, equal for all drones of a swarm, except for
    the drone's own `action_mask`, int8, (num_envs, 6).

    Args:
        num_swarms: the number of swarms.
        shared_reward: reward every drone with the mean over its swarm, in place of its own reward,
            so that drones cooperate.
        keywords: the other arguments of `SwarmVectorEnv`.
    """

    _count_name = "num_swarms"
    _joint = False

    def __init__(
        self, num_swarms: int = 1, *, shared_reward: bool = False, **keywords: Any
    ) -> None:
        self._shares_reward = checks.boolean("shared_reward", shared_reward)
        super().__init__(num_swarms, **keywords)

    def _rewards(self) -> Floats:
        rewards = self.batch.rewards * self._scale
        if self._shares_reward:
            rewards = np.repeat(rewards.mean(axis=1), self._each)
        return rewards.reshape(-1)
