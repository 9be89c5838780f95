"""What policies have in common: one search or many, and a memory for each search.

A policy is written for one search and serves any number of them. Searches in which it has
seen the same from the beginning on share one memory, and it chooses once for all of them:
with one person adrift and a policy that draws no random numbers, a batch of thousands
costs little more than a single search. When two see different things their memories part.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.observations import Observation
from DroneSwarmSearch.scenario import Cell, Scenario

__all__ = ["BatchPolicy", "SwarmPolicy"]

Ints = NDArray[np.int64]
Singles = NDArray[np.float32]

_NOT_BEGUN = -1


class BatchPolicy(ABC):
    """The two forms of observations, brought to one: arrays with an axis for the searches.

    Subclasses write `_act` and `_forget`; those that choose for one search at a time are
    derived from `SwarmPolicy`.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def __init__(self, scenario: Scenario) -> None:
        if not isinstance(scenario, Scenario):
            raise TypeError(f"scenario must be a Scenario, got {scenario!r}")
        self._scenario = scenario

    @property
    def scenario(self) -> Scenario:
        """The parameters of every search that the policy steers."""
        return self._scenario

    @overload
    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]: ...
    @overload
    def __call__(self, observations: Mapping[str, NDArray[Any]], /) -> Ints: ...
    def __call__(self, observations: Mapping[str, Any], /) -> dict[str, int] | Ints:
        """Choose an action for every drone.

        Args:
            observations: of one search, as `DroneSwarmSearch` hands them out, one for each
                drone; or of E searches, as `SwarmVectorEnv` does in its dict layout:
                "positions", integers of shape (E, n_drones, 2), every drone's (x, y);
                "probability_matrix", float32 of shape (E, N, N), indexed [y, x]; and
                perhaps "row", integers of shape (E,), the number of each search in its
                batch, no two alike. Without it they are 0 to E - 1, and one search is
                number 0.

        Returns:
            The actions, 0 to 5, see `rules.Action`: a dict from each drone's name for one
            search, an array, int64, of shape (E, n_drones) for many.

        Raises:
            TypeError: positions or rows are no integers.
            ValueError: the number of drones is not the scenario's, an array is of another
                shape, or rows are negative or repeated.
        """
        if "positions" in observations:
            return self._act(*self._arrays(observations))
        if not observations:
            return {}
        seen = [observation["observation"] for observation in observations.values()]
        positions, matrices = np.array([[cell for cell, _ in seen]]), seen[0][1][None]
        self._check_shape("observations", positions, self._scenario.n_drones, 2)
        self._check_shape("matrix", matrices, *self._board)
        actions: list[int] = self._act(np.zeros(1, np.int64), positions, matrices)[0].tolist()
        return dict(zip(observations, actions, strict=True))

    def reset(self, seed: int | Sequence[int] | None = None, rows: ArrayLike | None = None) -> None:
        """Forget episodes: the next observations are the first of other ones.

        Args:
            seed: for policies that draw random numbers: an integer >= 0, from which row i
                gets seed + i, or one for each row. Without it a policy goes on drawing
                new numbers.
            rows: the numbers of the searches that begin anew; without it all of them.

        Raises:
            TypeError: a seed or a row is no integer.
            ValueError: a seed or a row is negative, or there are not as many seeds as rows.
        """
        numbers = None if rows is None else _row_numbers("rows", rows)
        self._forget(numbers, _seeds(seed, numbers))

    @abstractmethod
    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        """The actions in some searches, checked arguments given.

        Args:
            rows: their numbers, shape (E,); never none at all in one search, perhaps in many.
            positions: every drone's (x, y), shape (E, n_drones, 2).
            matrices: float32, shape (E, N, N), indexed [y, x]; not to be kept or changed.

        Returns:
            int64, shape (E, n_drones).
        """

    @abstractmethod
    def _forget(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        """Forget some searches, or all without `rows`, and take the seeds of the next ones.

        Args:
            rows: their numbers.
            seeds: one for each of them, or one from which row i gets that + i, or None.
        """

    @property
    def _board(self) -> tuple[int, int]:
        return self._scenario.grid_size, self._scenario.grid_size

    def _arrays(
        self, observations: Mapping[str, NDArray[Any]]
    ) -> tuple[Ints, NDArray[np.integer], Singles]:
        """Rows, positions and matrices of many searches, checked."""
        positions = np.asarray(observations["positions"])
        if positions.dtype.kind not in "iu":
            raise TypeError(f"positions must be integers, got {positions.dtype}")
        self._check_shape("positions", positions, self._scenario.n_drones, 2)
        if "probability_matrix" not in observations:
            raise ValueError(
                f"observations must hold a probability_matrix, got {', '.join(observations)}"
            )
        matrices = np.asarray(observations["probability_matrix"], np.float32)
        self._check_shape("probability_matrix", matrices, *self._board)
        if len(matrices) != len(positions):
            raise ValueError(
                f"probability_matrix must be of {len(positions)} searches, as positions are, "
                f"got {len(matrices)}"
            )
        if "row" not in observations:
            return np.arange(len(positions)), positions, matrices
        rows = _row_numbers("row", observations["row"])
        if len(rows) != len(positions):
            raise ValueError(f"row must be {len(positions)} numbers, got {len(rows)}")
        return rows, positions, matrices

    @staticmethod
    def _check_shape(name: str, array: NDArray[Any], *wanted: int) -> None:
        """Refuse arrays in which the shape of one search is not the wanted one."""
        if array.shape[1:] != wanted:
            raise ValueError(
                f"{name} must be of shape {wanted} for each search, got {array.shape[1:]}"
            )


class SwarmPolicy(BatchPolicy):
    """A policy written for one search: `begin` makes its memory, `choose` the actions.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._forget(None, None)

    @abstractmethod
    def begin(self) -> Any:
        """The memory of a search before its first observation: anything that can be deep-copied.

        What copies may share (forecasts, tables) is best shared: see `copy.deepcopy`.
        """

    @abstractmethod
    def choose(self, memory: Any, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        """The actions of a step.

        Args:
            memory: of this search, to be changed in place.
            cells: every drone's (x, y).
            matrix: float32, shape (N, N), indexed [y, x]; not to be kept or changed.

        Returns:
            An action, 0 to 5, for every drone; the same whenever the arguments are the same.
        """

    def _forget(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        if rows is None:
            self._group_of: Ints = np.empty(0, np.int64)  # of each row; groups share a memory
            self._memories: dict[int, Any] = {}
            self._sizes: dict[int, int] = {}  # rows in each group
            self._next_group = 0
            return
        for row in rows[rows < len(self._group_of)].tolist():
            self._leave(int(self._group_of[row]), 1)
            self._group_of[row] = _NOT_BEGUN

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        actions = np.empty(positions.shape[:2], np.int64)
        if not rows.size:
            return actions
        self._begin_new(rows)
        for places in self._alike(self._group_of[rows], positions, matrices):
            memory = self._memory_of(rows[places])
            cells = [(x, y) for x, y in positions[places[0]].tolist()]
            actions[places] = self.choose(memory, cells, matrices[places[0]])
        return actions

    def _begin_new(self, rows: Ints) -> None:
        """Give a memory to the rows that are seen for the first time."""
        missing = int(rows.max()) + 1 - len(self._group_of)
        if missing > 0:
            more = np.full(missing, _NOT_BEGUN)
            self._group_of = np.concatenate([self._group_of, more])
        new = rows[self._group_of[rows] == _NOT_BEGUN]
        if new.size:
            self._found_group(new, self.begin())

    def _found_group(self, rows: Ints, memory: Any) -> None:
        group = self._next_group
        self._next_group += 1
        self._group_of[rows] = group
        self._memories[group], self._sizes[group] = memory, len(rows)

    def _leave(self, group: int, rows: int) -> None:
        """Some rows have left a group; the last of them takes it along."""
        if group == _NOT_BEGUN:
            return
        self._sizes[group] -= rows
        if not self._sizes[group]:
            del self._sizes[group], self._memories[group]

    def _memory_of(self, rows: Ints) -> Any:
        """The memory of rows of one group, and of no others from now on."""
        group = int(self._group_of[rows[0]])
        memory = self._memories[group]
        if len(rows) < self._sizes[group]:
            memory = copy.deepcopy(memory)
            self._leave(group, len(rows))
            self._found_group(rows, memory)
        return memory

    @staticmethod
    def _alike(groups: Ints, positions: NDArray[np.integer], matrices: Singles) -> Iterator[Ints]:
        """The places in the arrays of rows that share a memory and see the same now."""
        order = np.argsort(groups, kind="stable")
        borders = np.flatnonzero(np.diff(groups[order])) + 1
        for places in np.split(order, borders):
            if len(places) == 1:
                yield places
                continue
            here = slice(None) if len(places) == len(groups) else places  # without a copy
            seen = positions[here], matrices[here]
            alike = [(array == array[0]).reshape(len(places), -1).all(axis=1) for array in seen]
            same = np.logical_and(*alike)
            yield places[same]
            others: dict[tuple[bytes, bytes], list[int]] = {}
            for place in places[~same].tolist():
                key = positions[place].tobytes(), matrices[place].tobytes()
                others.setdefault(key, []).append(place)
            yield from map(np.array, others.values())


def _row_numbers(name: str, value: ArrayLike) -> Ints:
    """Numbers of rows, checked: int64, shape (n,)."""
    rows = np.asarray(value)
    if rows.size == 0:
        rows = rows.astype(np.int64)
    if rows.dtype.kind not in "iu":
        raise TypeError(f"{name} must be integers of at least 0, got {rows.dtype}")
    if rows.ndim != 1:
        raise ValueError(f"{name} must be one number for each search, got shape {rows.shape}")
    if rows.size and rows.min() < 0:
        raise ValueError(f"{name} must be integers of at least 0, got {int(rows.min())}")
    if len(np.unique(rows)) < len(rows):
        raise ValueError(f"{name} must name no search twice, got {rows.tolist()}")
    return rows.astype(np.int64, copy=False)


def _seeds(seed: object, rows: Ints | None) -> int | list[int] | None:
    """The seeds given to a reset, checked."""
    if seed is None:
        return None
    if isinstance(seed, (list, tuple, np.ndarray)):
        seeds = [checks.integer(f"seed[{i}]", value, 0) for i, value in enumerate(seed)]
        if rows is not None and len(seeds) != len(rows):
            raise ValueError(f"seed must be {len(rows)} integers, one for each row, got {seed!r}")
        return seeds
    return checks.integer("seed", seed, 0)
