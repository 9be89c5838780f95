"""The base class of both vector environments: Gymnasium's vector API around a `SearchBatch`.

Names, autoreset and infos follow Gymnasium's vector environments (1.x). The subclasses define
what a sub-environment is: `SwarmVectorEnv` a swarm, `DroneVectorEnv` a drone.
"""

from __future__ import annotations

import inspect
import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, iterate
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Flags, Ints, Singles
from DroneSwarmSearch._internal.signatures import shows_keywords_of
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.layouts.masks import action_masks
from DroneSwarmSearch.rendering.display import Display
from DroneSwarmSearch.rules import Action, Ending, successes
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.observations import BatchObservations, Observations, Values

__all__ = ["SearchVectorEnv"]

Infos = dict[str, Any]

MASKS_IN = (None, "observation", "info")
"""Where action masks may be."""

_CATALOGUE = ("situations", "situation", "drones_positions")
"""The options of `reset` that `SearchBatch.reset` takes."""

_BYTES_PER_NUMBER = 14
"""The memory of each number of an observation: itself, and its limits in the batched space."""


@shows_keywords_of(SearchBatch, "num_rows", "wants_table", "rows_name", "finds_last")
class SearchVectorEnv(VectorEnv[Observations, ArrayLike, Any]):
    """What both vector environments share; `SwarmVectorEnv` describes the arguments.

    Attributes:
        num_envs: the number of sub-environments.
        batch: the `SearchBatch`, which knows the whole state of all searches.
        observation: the layout of the observations.
        action_mask: where the action masks are: "observation", "info" or None.
        right_of_way: whether the masks have right of way.
        autoreset_mode: when ended episodes are followed by the next ones.
        reward_scale: the factor of the rewards.
        copies: whether every step returns new observations.
        largest_reward: an upper limit of the absolute value of a scaled reward.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (as in the base class)
        "name": "drone_swarm_search_v0",
        "render_modes": ["ansi", "rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_swarms: int,
        /,
        *,
        observation: str = "dict",
        top_cells: int = 8,
        write_matrices: bool = True,
        action_mask: str | None = None,
        right_of_way: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        separate_flags: bool = False,
        reward_scale: float = 1.0,
        copy: bool = True,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        known = inspect.signature(type(self)).parameters
        for name in parameters:
            if name not in known:
                raise TypeError(
                    f"{type(self).__name__} got an unexpected keyword argument {name!r}; "
                    f"it takes {', '.join(known)}"
                )
        self.observation = str(checks.choice("observation", observation, tuple(LAYOUTS)))
        if observation != "top-cells":  # that layout checks it
            checks.integer("top_cells", top_cells, 1)
        self._writes = checks.boolean("write_matrices", write_matrices)
        if not self._writes and observation != "dict":
            raise ValueError(
                f"write_matrices=False needs observation='dict', got observation={observation!r}"
            )
        self.action_mask = checks.choice("action_mask", action_mask, MASKS_IN)
        self.right_of_way = checks.boolean("right_of_way", right_of_way)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            allowed = ", ".join(str(mode) for mode in AutoresetMode)
            raise ValueError(
                f"autoreset_mode must be one of {allowed}, got {autoreset_mode!r}"
            ) from None
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self._separate = checks.boolean("separate_flags", separate_flags)
        self.reward_scale = checks.positive("reward_scale", reward_scale)
        self.copies = checks.boolean("copy", copy)
        self.render_mode = checks.choice("render_mode", render_mode, (None, "ansi", "rgb_array"))

        self.batch = SearchBatch(
            num_swarms, wants_table=not self._writes, rows_name=self._count_name, **parameters
        )
        scenario, rows = self.batch.scenario_of(0), self.batch.num_rows
        self._size, self._drones = scenario.grid_size, scenario.n_drones
        self._display = Display(self._size, fps=self.metadata["render_fps"])
        self._each = 1 if self._joint else scenario.n_drones  # sub-environments in a swarm
        self.num_envs = rows * self._each
        if not self._writes:
            if parameters.get("sampler") is not None:
                raise ValueError("write_matrices=False cannot be given together with a sampler")
            try:
                _ = self.batch.table
            except ValueError as error:
                raise ValueError(f"write_matrices=False needs a table: {error}") from None
        largest = scenario.reward_scheme.largest(scenario.timestep_limit)
        self.largest_reward = largest * (scenario.n_drones // self._each) * self.reward_scale
        if math.isinf(self.largest_reward) and math.isfinite(largest):
            raise ValueError(
                f"reward_scale must leave rewards finite, which are up to {largest:g}, "
                f"got {reward_scale!r}"
            )
        self._observations = BatchObservations(
            self.batch,
            self.observation,
            self._joint,
            top_cells,
            self._writes,
            self.right_of_way if self.action_mask == "observation" else None,
        )
        self.single_observation_space = self._observations.space
        checks.fits(
            "the observations",
            _BYTES_PER_NUMBER * spaces.flatdim(self.single_observation_space) * self.num_envs,
            **{self._count_name: rows, "grid_size": self._size, "n_drones": self._drones},
        )
        self.single_action_space = (
            spaces.MultiDiscrete([len(Action)] * self._drones)
            if self._joint
            else spaces.Discrete(len(Action))
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._all_rows = np.arange(rows)
        self._all_envs = np.ones(self.num_envs, np.bool_)
        self._reused = None if self.copies else self._observations.empty(self.num_envs)

    _count_name: str
    """The constructor's name for the number of swarms."""

    _joint: bool
    """Whether a sub-environment is a whole swarm."""

    @abstractmethod
    def _rewards(self) -> NDArray[np.float64]:
        """The rewards of the last step: (num_envs,), a new array."""

    def _infos(self) -> Infos:
        """The infos of all sub-environments, without Gymnasium's masks such as "_Found"."""
        batch, each = self.batch, self._each
        endings = batch.endings
        infos: Infos = {
            "Found": batch.found,
            "is_success": successes(endings),
            "persons_found": ~batch.missing,
            "ending": endings,
            "step": batch.steps,
        }
        if (success := batch.probability_of_success) is not None:
            infos["probability_of_success"] = success
        if not self._joint:
            infos = {name: values.repeat(each, axis=0) for name, values in infos.items()}
        if self.action_mask == "info":
            masks = self._action_masks(self.right_of_way).astype(np.int8)
            infos["action_mask"] = masks if self._joint else masks.reshape(self.num_envs, -1)
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
        known = {} if options is None else options
        if options is not None:
            known = checks.known_options(options, ("reset_mask", *_CATALOGUE), stacklevel=2)
        rows = self._rows_of(known.get("reset_mask"))
        seeds = self._seeds_of(seed)
        chosen = [seeds[row] for row in rows.tolist()] if seeds else None
        self.batch.reset(chosen, rows, **{name: known.get(name) for name in _CATALOGUE})
        if seeds and seeds[0] is not None:
            super().reset(seed=seeds[0])  # seeds `np_random`
        observations = self._output()
        matrices = self._observations.matrices_in(observations)
        if matrices is not None:
            self.batch.write_matrices(matrices)
        self._observations.write(self._all_rows, matrices, observations)
        return observations, self._masked_infos(rows)

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
        given = checks.array("actions", actions, "an array of the shape of action_space")
        if given.shape != self.action_space.shape:
            raise ValueError(
                f"actions must have the shape {self.action_space.shape}, got {given.shape}"
            )
        observations = self._output()
        matrices = self._observations.matrices_in(observations)
        by_swarm = given.reshape(batch.num_rows, self._drones)
        batch.step(by_swarm, matrices, autoreset=self.autoreset_mode is AutoresetMode.NEXT_STEP)
        final: Infos = {}
        ends_here = self.autoreset_mode is AutoresetMode.SAME_STEP
        if ends_here and (ended := batch.ended.nonzero()[0]).size:
            final = self._final_infos(ended, matrices)
            batch.restart(ended)  # keeps the step's rewards and endings
            if matrices is not None:
                matrices[ended] = batch.matrices_of(ended)
        self._observations.write(self._all_rows, matrices, observations)
        rewards, terminated, truncated = self._rewards(), *self._flags()
        return observations, rewards, terminated, truncated, {**self._masked_infos(), **final}

    def render(self) -> tuple[Any, ...] | None:
        """Render every swarm as text or as a picture, uint8 (H, W, 3); see `render_mode`."""
        if self.render_mode is None:
            return None
        frames = map(self.frame, self._all_rows.tolist())
        return tuple(self._display.render(frame, self.render_mode) for frame in frames)

    # Beyond Gymnasium's API.

    def frame(self, swarm: int) -> Frame:
        """Everything that a picture of one swarm shows, including the persons."""
        return self.batch.frame(checks.integer("swarm", swarm, 0, self.batch.num_rows - 1))

    def observe(self, rows: Ints) -> Observations:
        """The current observations of some swarms' sub-environments, in new arrays.

        Args:
            rows: the swarms' numbers, in ascending order; int64, shape (n,).
        """
        rows = checks.row_numbers(rows, self.batch.num_rows, ascending=True)
        return self._observations.of_rows(rows)

    def action_masks(self, right_of_way: bool | None = None) -> Flags:
        """The valid actions of every sub-environment, see `wrappers.action_masks`.

        Args:
            right_of_way: also mask moves to cells that a drone with a lower number may enter,
                so that drones that follow the masks never collide; by default, as the
                environment was made.

        Returns:
            bool, True where allowed, shape (num_envs, 6) in a `DroneVectorEnv`, indexed by
            `rules.Action`; (num_envs, n_drones * 6) in a `SwarmVectorEnv`, drone by drone.
        """
        if right_of_way is None:
            right_of_way = self.right_of_way
        right_of_way = checks.boolean("right_of_way", right_of_way)
        return self._action_masks(right_of_way).reshape(self.num_envs, -1)

    @property
    def matrices(self) -> Singles:
        """The table that `matrix_index` refers to: float32, (entries, N, N); read-only.

        A reset with other situations makes a new table.

        Raises:
            ValueError: there is no such table, see `write_matrices`.
        """
        return self.batch.table

    # Input.

    def _rows_of(self, mask: Any) -> Ints:
        """The swarms to reset, given the option "reset_mask"."""
        if mask is None:
            return self._all_rows
        what = f"options['reset_mask'] must be a bool array of shape ({self.num_envs},)"
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"{what}, got {mask!r}")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"{what}, got shape {mask.shape}")
        by_swarm = mask.reshape(-1, self._each)
        wanted: Flags = np.logical_or.reduce(by_swarm, axis=1)
        if not wanted.any():
            raise ValueError(f"{what} with at least one True, got none")
        if (by_swarm != wanted[:, None]).any():
            raise ValueError(f"{what}, equal for all drones of a swarm, got {mask!r}")
        return wanted.nonzero()[0]

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for each swarm, or an empty list without seeds."""
        swarms = self.batch.num_rows
        if seed is None:
            return []
        several = isinstance(seed, Sequence) and not isinstance(seed, str)
        if not several and not (isinstance(seed, np.ndarray) and seed.ndim):
            first = checks.integer("seed", seed, 0)
            return list(range(first, first + swarms))
        seeds = checks.seeds("seed", seed)
        if len(seeds) == self.num_envs:
            return seeds[:: self._each]
        if len(seeds) != swarms:
            each = f", or {self.num_envs}, one per drone" if self._each > 1 else ""
            raise ValueError(
                f"seed must be an integer, or {swarms} of them, one per swarm{each}; "
                f"got {len(seeds)}"
            )
        return seeds

    # Output.

    def _action_masks(self, right_of_way: bool) -> Flags:
        """The masks by swarm and drone: bool, (swarms, drones, 6)."""
        return action_masks(self.batch.cells, self._size, right_of_way)

    def _output(self) -> Observations:
        """The arrays for the observations of all sub-environments."""
        return self._observations.empty(self.num_envs) if self._reused is None else self._reused

    def _scaled_rewards(self) -> NDArray[np.float64]:
        """Every drone's reward: (swarms, drones); possibly the batch's own array."""
        rewards = self.batch.rewards
        return rewards if self.reward_scale == 1.0 else rewards * self.reward_scale

    def _flags(self) -> tuple[Flags, Flags]:
        """Terminations and truncations of all sub-environments."""
        endings, each = self.batch.endings, self._each
        terminated = truncated = endings != 0
        if self._separate:
            truncated = endings == Ending.TIME_LIMIT
            terminated = terminated & ~truncated
        return terminated.repeat(each), truncated.repeat(each)

    def _masked_infos(self, rows: Ints | None = None) -> Infos:
        """The infos, each with a mask of the sub-environments of these swarms."""
        mask = self._all_envs
        if rows is not None and len(rows) < self.batch.num_rows:
            mask = np.zeros_like(mask)
            mask.reshape(-1, self._each)[rows] = True
        infos = self._infos()
        return {**infos, **{f"_{key}": mask.copy() for key in infos}}

    def _final_infos(self, rows: Ints, matrices: Singles | None) -> Infos:
        """The final observations and infos of swarms whose episodes have ended.

        Args:
            rows: the swarms' numbers.
            matrices: of all swarms, or None.
        """
        envs = (rows[:, None] * self._each + np.arange(self._each)).reshape(-1)
        observed = self._observations.of_rows(rows, None if matrices is None else matrices[rows])
        final = np.full(self.num_envs, None, object)
        each = iterate(self.observation_space, observed)
        for env, observation in zip(envs.tolist(), each, strict=True):
            final[env] = observation
        mask = np.zeros(self.num_envs, np.bool_)
        mask[envs] = True
        return {
            "final_obs": final,
            "_final_obs": mask,
            "final_info": self._masked_infos(rows),
            "_final_info": mask.copy(),
        }
