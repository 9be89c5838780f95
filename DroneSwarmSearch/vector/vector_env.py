"""Gymnasium's views of the engine: a slot is a swarm, or a slot is a drone.

Both step the same batch and differ in what a slot is shown and paid. Names, autoreset and
infos follow Gymnasium's vector API (1.x).
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rules import Action, Ending
from DroneSwarmSearch.scenario import Scenario
from DroneSwarmSearch.vector.engine import SearchBatch
from DroneSwarmSearch.vector.parameters import VARIABLE, checked_rows, checked_sizes
from DroneSwarmSearch.vector.threads import parts_of, run_in_parts, worth_sharing
from DroneSwarmSearch.wrappers.layouts import (
    JOINT_LAYOUTS,
    LAYOUTS,
    Layout,
    StackedLayout,
    remaining_time_fraction,
)
from DroneSwarmSearch.wrappers.masks import action_masks

__all__ = ["Buffers", "DroneVectorEnv", "SearchVectorEnv", "SwarmVectorEnv"]

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]
Observations = Any  # an array, or a dict of arrays
Slots = Any  # an array with a first axis for the slots
Infos = dict[str, Any]

_SHOWN_BYTES = 14
"""For each number shown: itself, and its limits in the batched space."""


@dataclass(eq=False)
class Buffers:
    """Arrays that a view writes into, in place of new ones at every step.

    Attributes:
        observations: of the batched observation space's form.
        rewards: real numbers, shape (num_envs,).
        terminations: bool, shape (num_envs,).
        truncations: bool, shape (num_envs,).
    """

    observations: Observations
    rewards: Slots
    terminations: Slots
    truncations: Slots


class SearchVectorEnv(VectorEnv[Observations, ArrayLike, Any]):
    """What both views share.

    Attributes follow Gymnasium: `num_envs` counts slots.

    Args:
        swarms: the number of swarms, E; each view has a name of its own for it.
        observation: "dict", or one float32 array: "flat", "planes", "top-cells" or
            "crops"; each view says what is in them.
        top_cells: how many cells the layout "top-cells" shows; from 1 to grid_size².
        write_matrices: False shows, in place of matrices, where in the table `matrices`,
            which all swarms share, the matrix of each stands; for one person, without
            `bayesian_update` and `sampler`, and with observation="dict".
        autoreset_mode: when slots whose episodes have ended begin anew: in the next step,
            in the same step (the last observation is then in the infos, "final_obs"), or
            never by themselves.
        separate_flags: False: an episode's end is termination and truncation at once, as
            in `DroneSwarmSearch`. True: the time limit alone is truncation, all else
            termination, as value bootstrapping wants it.
        reward_scale: what rewards are multiplied by; above 0. A power of two loses nothing,
            see `wrappers.ScaledRewards`. `batch.rewards` are as they were.
        copy: return new arrays at every step; False returns the same ones every time,
            overwritten.
        render_mode: None, "ansi" or "rgb_array": whether `render` returns text or pictures.
        parameters: those of `engine.SearchBatch`: `DroneSwarmSearch`'s, of which
            `vector`, `person_initial_position` and `disperse_constant` may differ from
            swarm to swarm, and `drones_positions` and `sampler`.

    Attributes:
        batch: the engine, which knows everything about all searches.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (as in the base class)
        "name": "drone_swarm_search_v0",
        "render_modes": ["ansi", "rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        swarms: int,
        /,
        *,
        observation: str = "dict",
        top_cells: int = 8,
        write_matrices: bool = True,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        separate_flags: bool = False,
        reward_scale: float = 1.0,
        copy: bool = True,
        render_mode: str | None = None,
        **parameters: Any,
    ) -> None:
        for name in parameters:
            if name not in _ENGINE_PARAMETERS:
                known = self._count, *_VIEW_PARAMETERS, *_ENGINE_PARAMETERS
                raise TypeError(
                    f"{type(self).__name__} has no parameter {name!r}; it takes {', '.join(known)}"
                )
        self.observation = checks.choice("observation", observation, tuple(LAYOUTS))
        if observation != "top-cells":  # whose layout knows how many there are
            checks.integer("top_cells", top_cells, 1)
        self._writes = checks.boolean("write_matrices", write_matrices)
        self._separate = checks.boolean("separate_flags", separate_flags)
        self._reward_scale = checks.positive("reward_scale", reward_scale)
        copies = checks.boolean("copy", copy)
        self.render_mode = checks.choice("render_mode", render_mode, (None, "ansi", "rgb_array"))
        if not self._writes and observation != "dict":
            raise ValueError(
                f"write_matrices=False needs observation='dict', got observation={observation!r}"
            )
        try:
            self._mode = AutoresetMode(autoreset_mode)
        except ValueError:
            allowed = ", ".join(str(mode) for mode in AutoresetMode)
            raise ValueError(
                f"autoreset_mode must be one of {allowed}, got {autoreset_mode!r}"
            ) from None
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        scenario = parameters.get("scenario")
        sizes = {**_ENGINE_PARAMETERS, **parameters}
        if isinstance(scenario, Scenario):
            sizes = {"grid_size": scenario.grid_size, "n_drones": scenario.n_drones}
        number, self._size, self._drones = checked_sizes(
            self._count, swarms, sizes["grid_size"], sizes["n_drones"]
        )
        self.num_envs = number * self._per_swarm
        its_own = {"k": top_cells, "name": "top_cells"} if observation == "top-cells" else {}
        self._layout = self._choose_layout(str(observation), its_own)
        self.single_observation_space = self._space()
        checks.fits(
            "the observations",
            _SHOWN_BYTES * spaces.flatdim(self.single_observation_space) * self.num_envs,
            **{self._count: number, "grid_size": self._size, "n_drones": self._drones},
        )
        self.batch = SearchBatch(
            number, wants_table=not self._writes, rows_name=self._count, **parameters
        )
        if not self._writes:
            try:
                _ = self.batch.table
            except ValueError as error:
                raise ValueError(f"write_matrices=False needs a table: {error}") from None
        largest = self._largest_reward()
        if math.isinf(largest * self._reward_scale) and math.isfinite(largest):
            raise ValueError(
                f"reward_scale must leave rewards finite, which are up to {largest:g}, "
                f"got {reward_scale!r}"
            )
        self._limit = self.batch.scenario_of(0).timestep_limit
        self._all_rows = np.arange(number)
        self._every_slot = np.ones(self.num_envs, np.bool_)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.single_action_space = self._action_space()
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._buffers: Buffers | None = None
        self._scratch: Singles | None = None
        if not copies:
            self.use_buffers(self._new_buffers())

    # What a slot is; each view says.

    _count: str  # what the number of swarms is called
    _positions_name: str  # in the dict layout

    @property
    def _per_swarm(self) -> int:
        raise NotImplementedError

    def _action_space(self) -> spaces.Space[Any]:
        raise NotImplementedError

    def _choose_layout(self, name: str, options: dict[str, Any]) -> Layout:
        raise NotImplementedError

    def _rewards(self) -> NDArray[np.float64]:
        """What every slot is paid for the last step."""
        raise NotImplementedError

    def _infos(self) -> Infos:
        """What the slots are told, each an array of shape (slots, ...)."""
        raise NotImplementedError

    def _by_row(self, slots: Slots, rows: Ints) -> Slots:
        """An array of some swarms' slots as the layout writes it: with an axis for swarms."""
        raise NotImplementedError

    def _flat_masks(self, masks: Flags) -> Flags:
        """Masks, shape (swarms, drones, 6), as those of the slots."""
        raise NotImplementedError

    # Gymnasium's API.

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Begin episodes.

        Args:
            seed: an integer s >= 0, from which swarm i gets s + i; or one for each swarm,
                None where its sequence of episodes shall go on. Of one for each slot a
                swarm takes its first drone's. Without it all go on. The first swarm's
                seed is that of `np_random` as well.
            options: may hold "reset_mask", bool, shape (num_envs,), which slots to reset
                (all slots of a swarm or none); "vector", which stays for later episodes;
                and "person_initial_position", "disperse_constant" and
                "drones_positions", for this episode alone. Each takes one value for all
                swarms or one for each of them.

        Returns:
            The observations of all slots, and the infos of those that were reset.

        Raises:
            TypeError: an argument is of the wrong type.
            ValueError: an argument is out of its limits.
        """
        rows, given = self._wanted_rows(options)
        seeds = self._seeds(seed)
        chosen = [seeds[row] for row in rows.tolist()] if seeds else None
        self.batch.reset(chosen, rows, given or None)
        if seeds and seeds[0] is not None:
            super().reset(seed=seeds[0])  # `np_random` follows from it
        observations = self._receiver()
        matrices = self._matrices_in(observations)
        if matrices is not None:
            self.batch.write_matrices(matrices)
        self._observe(self._all_rows, matrices, observations)
        return observations, self._with_masks(rows)

    def step(self, actions: ArrayLike) -> tuple[Observations, Slots, Slots, Slots, Infos]:
        """Let every drone act once.

        Args:
            actions: of the batched action space.

        Returns:
            Observations, rewards, terminations, truncations and infos of every slot. With
            autoreset in the next step, a slot whose episode has ended gets the first
            observation of the next one and no reward, whatever its action.

        Raises:
            ResetNeeded: before the first `reset`; with autoreset disabled, where episodes
                have ended.
            TypeError: the actions are no integers.
            ValueError: they are out of range or of another shape.
            Exception: whatever a sampler raises. With autoreset in the same step, the step
                has been made then, and a reset is needed.
        """
        batch = self.batch
        observations = self._receiver()
        matrices = self._matrices_in(observations)
        # Restarted in the same step, no episode is over here, unless a step was interrupted.
        autoreset = self._mode is AutoresetMode.NEXT_STEP
        batch.step(self._by_swarm(actions), matrices, autoreset=autoreset)
        # What the step brought, rewards and endings, outlasts a restart; states do not.
        finals: Infos = {}
        if self._mode is AutoresetMode.SAME_STEP and (ended := batch.ended.nonzero()[0]).size:
            finals = self._finals(ended, matrices)
            batch.restart(ended)
            if matrices is not None:
                matrices[ended] = batch.matrices_of(ended)
        self._observe(self._all_rows, matrices, observations)
        rewards, terminated, truncated = self._rewards(), *self._flags()
        if self._buffers is not None:
            into = self._buffers
            np.copyto(into.rewards, rewards, casting="same_kind")
            np.copyto(into.terminations, terminated)
            np.copyto(into.truncations, truncated)
            rewards, terminated, truncated = into.rewards, into.terminations, into.truncations
        return observations, rewards, terminated, truncated, {**self._with_masks(), **finals}

    def render(self) -> tuple[Any, ...] | None:
        """A picture of every swarm, as text or uint8 (H, W, 3), as `render_mode` says."""
        if self.render_mode is None:
            return None
        frames = [self.frame(row) for row in self._all_rows.tolist()]
        if self.render_mode == "ansi":
            from DroneSwarmSearch.rendering.text import render_text

            return tuple(render_text(frame) for frame in frames)
        from DroneSwarmSearch.rendering.painter import Painter

        painter = Painter(self._size, render_grid=False, render_gradient=True)
        return tuple(painter.pixels(frame) for frame in frames)

    @property
    def reuses_arrays(self) -> bool:
        """Whether what `reset` and `step` return is overwritten by the next step."""
        return self._buffers is not None

    def frame(self, swarm: int) -> Frame:
        """Everything a picture of one swarm's present state shows, the persons included."""
        return self.batch.frame(checks.integer("swarm", swarm, 0, self.batch.num_rows - 1))

    def observe(self, rows: Ints) -> Observations:
        """What the slots of some swarms are shown now; new arrays.

        Args:
            rows: the swarms' numbers, in rising order; int64, shape (n,).
        """
        rows = checked_rows(rows, self.batch.num_rows, rising=True)
        return self._observed(rows, self.batch.matrices_of(rows) if self._writes else None)

    def action_masks(self, right_of_way: bool = False) -> Flags:
        """Which actions are sensible now, see `masks.action_masks`; a new array.

        Args:
            right_of_way: mask moves to where a drone of a lower number may be next, too:
                drones that keep to the masks then never collide.

        Returns:
            bool, True where allowed. Of a view of drones (slots, 6), indexed by
            `rules.Action`; of one of swarms (swarms, n_drones * 6), drone after drone.
        """
        right_of_way = checks.boolean("right_of_way", right_of_way)
        return self._flat_masks(action_masks(self.batch.cells, self._size, right_of_way))

    def use_buffers(self, buffers: Buffers) -> None:
        """From now on write what `reset` and `step` return into given arrays.

        They return these arrays, too: what an earlier step wrote is gone. This is the form
        that collectors with arrays of their own want, PufferLib's for example.

        Raises:
            TypeError: something is no array, or the observations are of another form.
            ValueError: an array is read-only, or has the wrong shape or dtype, or cannot
                hold rewards as large as those of this search.
        """
        if not isinstance(buffers, Buffers):
            raise TypeError(f"buffers must be Buffers, got {buffers!r}")
        wanted = self._new_buffers()
        for name in ("rewards", "terminations", "truncations"):
            _check_buffer(name, getattr(buffers, name), getattr(wanted, name), exact=False)
        if isinstance(wanted.observations, dict):
            keys = list(wanted.observations)
            if not isinstance(buffers.observations, Mapping) or {*buffers.observations} != {*keys}:
                raise TypeError(
                    f"buffers.observations must be a mapping with the keys {keys}, "
                    f"got {buffers.observations!r}"
                )
            for key, array in wanted.observations.items():
                _check_buffer(f"observations[{key!r}]", buffers.observations[key], array)
        else:
            _check_buffer("observations", buffers.observations, wanted.observations)
        dtype, largest = buffers.rewards.dtype, self._largest_reward() * self._reward_scale
        if dtype.kind != "f" or (dtype.itemsize < 8 and largest > float(np.finfo(dtype).max)):
            raise ValueError(
                f"buffers.rewards must hold real numbers up to {largest:g} (see reward_scale), "
                f"got {dtype}"
            )
        self._buffers = buffers

    # The parts of `reset` and `step`.

    def _wanted_rows(self, options: Mapping[str, Any] | None) -> tuple[Ints, dict[str, Any]]:
        """The swarms to reset, and the parameters given for them."""
        if options is None:
            return self._all_rows, {}
        options = checks.known_options(options, ("reset_mask", *VARIABLE), stacklevel=3)
        given = {key: options[key] for key in VARIABLE if options.get(key) is not None}
        mask = options.get("reset_mask")
        if mask is None:
            return self._all_rows, given
        what = f"options['reset_mask'] must be a bool array of shape ({self.num_envs},)"
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"{what}, got {mask!r}")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"{what}, got shape {mask.shape}")
        by_swarm = mask.reshape(-1, self._per_swarm)
        wanted: Flags = np.logical_or.reduce(by_swarm, axis=1)
        if not wanted.any():
            raise ValueError(f"{what} with at least one True, got none")
        if (by_swarm != wanted[:, None]).any():
            raise ValueError(f"{what}, alike for all drones of a swarm, got {mask!r}")
        return wanted.nonzero()[0], given

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """A seed for each swarm; none if there is none at all."""
        n = self.batch.num_rows
        if seed is None:
            return []
        several = isinstance(seed, Sequence) and not isinstance(seed, str)
        if not several and not (isinstance(seed, np.ndarray) and seed.ndim):
            first = checks.integer("seed", seed, 0)
            return list(range(first, first + n))
        seeds = checks.seeds("seed", seed)
        if len(seeds) == self.num_envs:
            return seeds[:: self._per_swarm]
        if len(seeds) != n:
            slots = f", or {self.num_envs}, one a slot" if self._per_swarm > 1 else ""
            raise ValueError(
                f"seed must be an integer or {n} of them, one a swarm{slots}; got {len(seeds)}"
            )
        return seeds

    def _by_swarm(self, actions: ArrayLike) -> NDArray[Any]:
        """The actions as (swarms, drones)."""
        chosen = checks.array("actions", actions, "an array of the shape of action_space")
        if chosen.shape != self.action_space.shape:
            raise ValueError(
                f"actions must have the shape {self.action_space.shape}, got {chosen.shape}"
            )
        return chosen.reshape(self.batch.num_rows, self._drones)

    def _rewards_of_drones(self) -> NDArray[np.float64]:
        """Every drone's reward for the last step: (swarms, drones); perhaps the batch's own."""
        rewards = self.batch.rewards
        return rewards if self._reward_scale == 1.0 else rewards * self._reward_scale

    def _largest_reward(self) -> float:
        """No reward of a slot is further from 0 than this, times the scale of rewards."""
        scenario = self.batch.scenario_of(0)
        largest = scenario.reward_scheme.largest(scenario.timestep_limit)
        return largest * (self._drones // self._per_swarm)

    def _flags(self) -> tuple[Flags, Flags]:
        """Terminations and truncations of every slot."""
        endings, each = self.batch.endings, self._per_swarm
        terminated = truncated = endings != 0
        if self._separate:
            truncated = endings == Ending.TIME_LIMIT
            terminated = terminated & ~truncated
        return terminated.repeat(each), truncated.repeat(each)

    def _receiver(self) -> Observations:
        """What receives the observations of all slots."""
        return self._new(self.num_envs) if self._buffers is None else self._buffers.observations

    def _matrices_in(self, observations: Observations) -> Singles | None:
        """What receives the matrices of all swarms, if any are shown: float32, (swarms, N, N).

        The observations themselves, where they hold matrices as the batch writes them.
        """
        if not self._writes:
            return None
        if self.observation == "dict":
            shown: Singles = observations["probability_matrix"]
            if len(shown) == self.batch.num_rows and shown.flags.c_contiguous:
                return shown
        if self._scratch is None:
            shape = (self.batch.num_rows, self._size, self._size)
            self._scratch = np.empty(shape, np.float32)
        return self._scratch

    def _finals(self, rows: Ints, matrices: Singles | None) -> Infos:
        """The last observations and infos of swarms whose episodes have ended.

        Args:
            rows: the swarms' numbers.
            matrices: of all swarms, if any are shown.
        """
        slots = (rows[:, None] * self._per_swarm + np.arange(self._per_swarm)).reshape(-1)
        observed = self._observed(rows, None if matrices is None else matrices[rows])
        last = np.full(self.num_envs, None, object)
        for place, slot in enumerate(slots.tolist()):
            if isinstance(observed, dict):
                last[slot] = {key: array[place] for key, array in observed.items()}
            else:
                last[slot] = observed[place]
        mask = np.zeros(self.num_envs, np.bool_)
        mask[slots] = True
        return {
            "final_obs": last,
            "_final_obs": mask,
            "final_info": self._with_masks(rows),
            "_final_info": mask.copy(),
        }

    def _with_masks(self, rows: Ints | None = None) -> Infos:
        """The infos, each with a mask of the slots for which it is meant."""
        mask = self._every_slot
        if rows is not None and len(rows) < self.batch.num_rows:
            mask = np.zeros_like(mask)
            mask.reshape(-1, self._per_swarm)[rows] = True
        infos = self._infos()
        return {**infos, **{f"_{key}": mask.copy() for key in infos}}

    def _new(self, slots: int) -> Observations:
        return create_empty_array(self.single_observation_space, slots, fn=np.empty)

    def _new_buffers(self) -> Buffers:
        n = self.num_envs
        flags = np.zeros(n, np.bool_)
        return Buffers(self._new(n), np.zeros(n), flags, flags.copy())

    def _space(self) -> spaces.Space[Any]:
        """What a slot is shown."""
        space = self._layout.space
        if self._writes:
            return space
        entries = dict(space.items())  # type: ignore[attr-defined]  # a Dict
        del entries["probability_matrix"]
        index = spaces.Box(0, np.iinfo(np.int32).max, (), np.int64)
        return spaces.Dict({**entries, "matrix_index": index})

    def _observed(self, rows: Ints, matrices: Singles | None) -> Observations:
        """What some swarms' slots are shown, in new arrays; arguments as for `_observe`."""
        out = self._new(len(rows) * self._per_swarm)
        self._observe(rows, matrices, out)
        return out

    def _observe(self, rows: Ints, matrices: Singles | None, out: Observations) -> None:
        """Write what some swarms' slots are shown.

        Args:
            rows: the swarms' numbers.
            matrices: theirs, or None if none are shown; afterwards anything may be in them.
            out: receives it; where `_matrices_in` says so, the matrices are in it already.
        """
        positions = self._of_rows(self.batch.positions, rows)
        if self.observation == "dict":
            self._by_row(out[self._positions_name], rows)[...] = positions
            self._show_matrices(rows, matrices, out)
            return
        assert matrices is not None
        given, shown = matrices, self._by_row(out, rows)
        left = remaining_time_fraction(self._of_rows(self.batch.steps, rows), self._limit)

        def write(some: slice) -> None:
            self._layout.write(positions[some], given[some], left[some], shown[some])

        _write_in_parts(write, shown)

    def _show_matrices(self, rows: Ints, matrices: Singles | None, out: dict[str, Slots]) -> None:
        """Write the entry of the dict layout that tells the matrix; arguments as above."""
        if matrices is None:
            index = self._of_rows(self.batch.table_index, rows)
            out["matrix_index"][...] = index.repeat(self._per_swarm)
            return
        shown = out["probability_matrix"]
        if shown is matrices:
            return
        by_drone = matrices[:, None]
        copies = shown.reshape(len(rows), self._per_swarm, self._size, self._size)

        def copy(some: slice) -> None:
            copies[some] = by_drone[some]

        _write_in_parts(copy, copies)

    @property
    def matrices(self) -> Singles:
        """The table in which `matrix_index` points: float32, (entries, N, N); read-only.

        It fills up as episodes go on; an entry once pointed to stays as it is. A reset with
        parameters given makes another table.

        Raises:
            ValueError: there is no such table, see `write_matrices`.
        """
        return self.batch.table

    def _of_rows(self, values: Slots, rows: Ints) -> Slots:
        """Values of all swarms, cut down to some."""
        return values if len(rows) == self.batch.num_rows else values[rows]


def _write_in_parts(write: Callable[[slice], None], out: Slots) -> None:
    """Let something be written, by several threads if it is much.

    Args:
        write: writes some swarms' part of it.
        out: what is written: its first axis is for the swarms.
    """
    if worth_sharing(out):
        run_in_parts(write, parts_of(out))
    else:
        write(slice(None))


def _check_buffer(name: str, given: Any, wanted: Slots, exact: bool = True) -> None:
    """Refuse an array that values like some others cannot be written into."""
    if not isinstance(given, np.ndarray):
        raise TypeError(f"buffers.{name} must be a NumPy array, got {given!r}")
    fits = np.can_cast(wanted.dtype, given.dtype, "same_kind")
    if given.shape != wanted.shape or not fits or (exact and given.dtype != wanted.dtype):
        raise ValueError(
            f"buffers.{name} must be of shape {wanted.shape} and dtype {wanted.dtype}, "
            f"got {given.shape} and {given.dtype}"
        )
    if not given.flags.writeable:
        raise ValueError(f"buffers.{name} must be writeable, got a read-only array")


def _keywords(function: Callable[..., Any], *without: str) -> dict[str, Any]:
    """The defaults of a function's keyword-only parameters."""
    parameters = inspect.signature(function).parameters.values()
    named = (each for each in parameters if each.kind is each.KEYWORD_ONLY)
    return {each.name: each.default for each in named if each.name not in without}


_VIEW_PARAMETERS = _keywords(SearchVectorEnv)
_ENGINE_PARAMETERS = _keywords(SearchBatch, "wants_table", "rows_name")


class SwarmVectorEnv(SearchVectorEnv):
    """Many searches, each slot a swarm: joint actions, team reward.

    Actions: `MultiDiscrete([6] * n_drones)` for each swarm, see `rules.Action`.

    Observations, for each swarm:

    - "dict": `positions`, every drone's (x, y), int32, shape (n_drones, 2);
      `probability_matrix`, float32, (N, N), indexed [y, x]; with write_matrices=False
      `matrix_index` in place of the matrix.
    - "flat": every drone's x and y, with the grid scaled to 1; the share of the steps left,
      1 at the beginning; the matrix row by row, with its maximum scaled to 1: float32,
      (2 n_drones + 1 + N²,).
    - "planes": the matrix, with its maximum scaled to 1; for every drone a plane with 1 at
      its cell; the share of the steps left, in every cell: float32, (2 + n_drones, N, N).
    - all others: what `DroneVectorEnv` shows of each drone, (n_drones, ...).

    Rewards: the sum over the drones. Infos: `rewards` of every drone, (E, n_drones);
    `Found`, whether anybody has been found; `persons_found`, who, (E, persons);
    `ending`, why the last step ended the episode (an `Ending`, or 0); `step`, completed
    steps. Each comes with a mask of the same name behind an underscore.

    Args:
        num_envs: the number of swarms, E.
        arguments: those of `SearchVectorEnv`.
    """

    _count = "num_envs"
    _positions_name = "positions"

    def __init__(self, num_envs: int = 1, **arguments: Any) -> None:
        super().__init__(num_envs, **arguments)

    @property
    def _per_swarm(self) -> int:
        return 1

    def _action_space(self) -> spaces.Space[Any]:
        return spaces.MultiDiscrete([len(Action)] * self._drones)

    def _choose_layout(self, name: str, options: dict[str, Any]) -> Layout:
        size, n = self._size, self._drones
        if name in JOINT_LAYOUTS:
            return JOINT_LAYOUTS[name](size, n)
        return StackedLayout(LAYOUTS[name](size, n, **options))

    def _by_row(self, slots: Slots, rows: Ints) -> Slots:
        return slots

    def _flat_masks(self, masks: Flags) -> Flags:
        return masks.reshape(len(masks), -1)

    def _rewards(self) -> NDArray[np.float64]:
        # Drone by drone, as one adds up a dict of rewards, and faster than over short rows.
        by_drone = np.ascontiguousarray(self._rewards_of_drones().T)
        total: NDArray[np.float64] = np.add.reduce(by_drone, axis=0)
        return total

    def _infos(self) -> Infos:
        batch = self.batch
        return {
            "rewards": self._rewards_of_drones().copy(),
            "Found": batch.found,
            "persons_found": ~batch.missing,
            "ending": batch.endings.copy(),
            "step": batch.steps,
        }


class DroneVectorEnv(SearchVectorEnv):
    """Many searches, each slot a drone: the form that parameter sharing wants.

    The drones of a swarm are adjacent: slot i * n_drones + k is drone k of swarm i, and
    `env.num_envs` is the number of slots, num_swarms * n_drones.

    Actions: `Discrete(6)` for each drone, see `rules.Action`.

    Observations, for each drone:

    - "dict": `position`, its (x, y), int32, shape (2,); `probability_matrix`, float32,
      (N, N), indexed [y, x]; with write_matrices=False `matrix_index` in place of it.
    - "flat": its x and y, then those of the other drones, with the grid scaled to 1; the
      share of the steps left, 1 at the beginning; the matrix row by row, with its maximum
      scaled to 1: float32, (2 n_drones + 1 + N²,).
    - "planes": the matrix, with its maximum scaled to 1; itself; the other drones (1 at
      their cells); the share of the steps left, in every cell: float32, (4, N, N).
    - "top-cells": the likeliest cells and the other drones, as they lie around it: float32,
      (3 top_cells + 2 n_drones + 1,), see `layouts.top_cells`.
    - "crops": the matrix and the other drones in windows around it, fine and coarse:
      float32, (202,) whatever the search, see `layouts.crops`.

    Rewards: the drone's own. Infos, alike for all drones of a swarm: `Found`, whether
    anybody has been found; `persons_found`, who, (slots, persons); `ending`, why the last
    step ended the episode (an `Ending`, or 0); `step`, completed steps. Each comes with a
    mask of the same name behind an underscore.

    Args:
        num_swarms: the number of swarms, E.
        arguments: those of `SearchVectorEnv`.
    """

    _count = "num_swarms"
    _positions_name = "position"

    def __init__(self, num_swarms: int = 1, **arguments: Any) -> None:
        super().__init__(num_swarms, **arguments)

    @property
    def _per_swarm(self) -> int:
        return self._drones

    def _action_space(self) -> spaces.Space[Any]:
        return spaces.Discrete(len(Action))

    def _choose_layout(self, name: str, options: dict[str, Any]) -> Layout:
        return LAYOUTS[name](self._size, self._drones, **options)

    def _by_row(self, slots: Slots, rows: Ints) -> Slots:
        return slots.reshape(len(rows), self._drones, *slots.shape[1:])

    def _flat_masks(self, masks: Flags) -> Flags:
        return masks.reshape(-1, masks.shape[-1])

    def _rewards(self) -> NDArray[np.float64]:
        return self._rewards_of_drones().reshape(-1).copy()

    def _infos(self) -> Infos:
        batch, n = self.batch, self._drones
        return {
            "Found": batch.found.repeat(n),
            "persons_found": (~batch.missing).repeat(n, axis=0),
            "ending": batch.endings.repeat(n),
            "step": batch.steps.repeat(n),
        }
