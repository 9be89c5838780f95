"""Base classes: one policy for a single search or a batch, with a memory for each search."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Ints, Singles
from DroneSwarmSearch.core.grid import Cell
from DroneSwarmSearch.core.observations import Observation
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario

_NO_GROUP = -1


class BatchPolicy(ABC):
    """A policy that accepts the observations of one search or of a batch.

    Derive your own from `SwarmPolicy`. `scenario`: the parameters of every search to steer.

    Raises:
        TypeError: `scenario` is not a `Scenario`.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = checked_scenario(scenario)

    @overload
    def __call__(self, observations: Mapping[str, Observation], /) -> dict[str, int]: ...
    @overload
    def __call__(self, observations: Mapping[str, NDArray[Any]], /) -> Ints: ...
    def __call__(self, observations: Mapping[str, Any], /) -> dict[str, int] | Ints:
        """Choose an action for every drone.

        Args:
            observations: those of one search, as `DroneSwarmSearch` returns them; or of E searches,
                as `SwarmVectorEnv` returns them in its dict layout: "positions", integers of shape
                (E, n_drones, 2), every drone's (x, y); "probability_matrix", float32 of shape
                (E, N, N), indexed [y, x]; and optionally "row", shape (E,): the index of each
                search in its batch, by default 0 to E - 1. A single search has index 0.

        Returns:
            Actions, 0 to 5 (see `Action`): a dict from agent names, or int64, shape (E, n_drones).

        Raises:
            TypeError: positions or rows are not integers.
            ValueError: an array does not fit the scenario, or rows are negative or repeated.
        """
        if "positions" in observations:
            return self._act(*self._checked(observations))
        if not observations:
            return {}
        seen = [observation["observation"] for observation in observations.values()]
        positions = np.array([[cell for cell, _ in seen]])
        matrices = seen[0][1][None]
        self._check_shape("observations", positions, self.scenario.n_drones, 2)
        size = self.scenario.grid_size
        self._check_shape("matrix", matrices, size, size)
        actions: list[int] = self._act(np.zeros(1, np.int64), positions, matrices)[0].tolist()
        return dict(zip(observations, actions, strict=True))

    def reset(self, seed: int | Sequence[int] | None = None, rows: ArrayLike | None = None) -> None:
        """Start new episodes: the next observations are the first of an episode.

        Args:
            seed: for policies that draw random numbers: an integer >= 0, with which row i gets
                seed + i, or one for each row. By default, the random sequence continues.
            rows: the indices of the searches to reset; all by default.

        Raises:
            TypeError: a seed or a row is not an integer.
            ValueError: a seed or a row is negative, or the numbers of seeds and rows differ.
        """
        indices = None if rows is None else _checked_rows("rows", rows)
        self._reset(indices, _checked_seeds(seed, indices))

    @abstractmethod
    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        """`__call__` for the searches with some indices; the arguments are valid."""

    @abstractmethod
    def _reset(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        """`reset`; the arguments are valid."""

    def _checked(
        self, observations: Mapping[str, NDArray[Any]]
    ) -> tuple[Ints, NDArray[np.integer], Singles]:
        """The validated rows, positions and matrices of a batch."""
        if "probability_matrix" not in observations:
            given = ", ".join(observations)
            raise ValueError(f"observations must hold a probability_matrix, got {given}")
        positions = np.asarray(observations["positions"])
        if positions.dtype.kind not in "iu":
            raise TypeError(f"positions must be integers, got {positions.dtype}")
        self._check_shape("positions", positions, self.scenario.n_drones, 2)
        matrices = np.asarray(observations["probability_matrix"], np.float32)
        size = self.scenario.grid_size
        self._check_shape("probability_matrix", matrices, size, size)
        rows = _checked_rows("row", observations.get("row", np.arange(len(positions))))
        for name, array in (("probability_matrix", matrices), ("row", rows)):
            if len(array) != len(positions):
                raise ValueError(
                    f"{name} must have the length of positions, {len(positions)}, got {len(array)}"
                )
        return rows, positions, matrices

    @staticmethod
    def _check_shape(name: str, array: NDArray[Any], *expected: int) -> None:
        if array.shape[1:] != expected:
            raise ValueError(
                f"{name} must be of shape {expected} for each search, got {array.shape[1:]}"
            )


class SwarmPolicy(BatchPolicy):
    """A policy for one search: `begin` returns its memory, `choose` the actions.

    It steers batches as well. `choose` must be deterministic: searches whose observations have been
    identical since they began share one memory and one call, so that a batch costs little more.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._reset(rows=None, seeds=None)

    @abstractmethod
    def begin(self) -> Any:
        """The memory of a search before its first observation.

        It must support `copy.deepcopy`; let copies share large constant data (forecasts, tables).
        """

    @abstractmethod
    def choose(self, memory: Any, cells: list[Cell], matrix: Singles) -> Sequence[int]:
        """Choose an action, 0 to 5, for every drone.

        Args:
            memory: the memory of this search; change it in place.
            cells: every drone's (x, y).
            matrix: float32, shape (N, N), indexed [y, x]; do not keep or change it.
        """

    def _reset(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        # Rows whose observations have been identical form a group with one memory.
        if rows is None:
            self._group_of: Ints = np.empty(0, np.int64)  # by row
            self._memories: dict[int, Any] = {}  # by group
            self._next_group = 0
        else:
            self._group_of[rows[rows < len(self._group_of)]] = _NO_GROUP

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        actions = np.empty(positions.shape[:2], np.int64)
        if not rows.size:
            return actions
        more = int(rows.max()) + 1 - len(self._group_of)
        if more > 0:
            self._group_of = np.append(self._group_of, np.full(more, _NO_GROUP))
        new = rows[self._group_of[rows] == _NO_GROUP]
        if new.size:
            self._add_group(new, self.begin())
        groups, counts = np.unique(self._group_of, return_counts=True)
        sizes = dict(zip(groups.tolist(), counts.tolist(), strict=True))
        for group in self._memories.keys() - sizes.keys():
            del self._memories[group]
        for indices in _identical(self._group_of[rows], positions, matrices):
            group = int(self._group_of[rows[indices[0]]])
            memory = self._memories[group]
            if len(indices) < sizes[group]:
                sizes[group] -= len(indices)
                memory = copy.deepcopy(memory)
                self._add_group(rows[indices], memory)
            cells = [(x, y) for x, y in positions[indices[0]].tolist()]
            actions[indices] = self.choose(memory, cells, matrices[indices[0]])
        return actions

    def _add_group(self, rows: Ints, memory: Any) -> None:
        self._group_of[rows] = self._next_group
        self._memories[self._next_group] = memory
        self._next_group += 1


def _identical(groups: Ints, positions: NDArray[np.integer], matrices: Singles) -> Iterator[Ints]:
    """The indices of rows that share a memory and have identical observations now."""
    order = np.argsort(groups, kind="stable")
    borders = np.flatnonzero(np.diff(groups[order])) + 1
    for indices in np.split(order, borders):
        if len(indices) == 1:
            yield indices
            continue
        here = slice(None) if len(indices) == len(groups) else indices  # a slice copies nothing
        seen = positions[here], matrices[here]
        equal = [(array == array[0]).reshape(len(indices), -1).all(axis=1) for array in seen]
        same = np.logical_and(*equal)
        yield indices[same]
        others: dict[tuple[bytes, bytes], list[int]] = {}
        for index in indices[~same].tolist():
            key = positions[index].tobytes(), matrices[index].tobytes()
            others.setdefault(key, []).append(index)
        yield from map(np.array, others.values())


def _checked_rows(name: str, value: ArrayLike) -> Ints:
    """Valid row indices: int64, shape (n,)."""
    rows = np.asarray(value)
    what = f"{name} must be different integers of at least 0"
    if rows.size and rows.dtype.kind not in "iu":
        raise TypeError(f"{what}, got {rows.dtype}")
    if rows.ndim != 1 or (rows < 0).any() or len(np.unique(rows)) < len(rows):
        raise ValueError(f"{what}, of shape (n,), got {value!r:.100}")
    return rows.astype(np.int64, copy=False)


def _checked_seeds(seed: object, rows: Ints | None) -> int | list[int] | None:
    """The valid seeds of a reset."""
    if not isinstance(seed, (list, tuple, np.ndarray)):
        return None if seed is None else checks.integer("seed", seed, 0)
    if rows is not None and len(seed) != len(rows):
        raise ValueError(f"seed must be {len(rows)} integers, one for each row, got {seed!r}")
    return [checks.integer(f"seed[{i}]", value, 0) for i, value in enumerate(seed)]
