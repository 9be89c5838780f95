"""Base classes: one policy for a single search or a batch, with a memory for each search."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Ints, Singles
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.core.grid import Cell, Grid
from DroneSwarmSearch.core.moves import searched
from DroneSwarmSearch.core.observations import Observation
from DroneSwarmSearch.core.radio import hearing
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario, checked_scenario

_NO_GROUP = -1
_NO_ACTION = -1
_UNHEARD = -1


OWN = "own"
AGREED = "agreed"
ALL = "all"


class BatchPolicy(ABC):
    """A policy that accepts the observations of one search or of a batch.

    Derive your own from `SwarmPolicy`. `scenario`: the parameters of every search to steer.

    Attributes:
        knows: what the drones act on in a search with a `radio_range`: "own": each on what it has
            done and heard; "agreed": all on what they knew before the start; "all": on what all
            drones together know. The last is for yardsticks; only evaluations show it.
        reads_persons: whether actions follow from the persons of the scenario, and not only from
            what is observed: such a policy steers no searches for other persons.

    Raises:
        TypeError: `scenario` is not a `Scenario`.
    """

    knows: ClassVar[str] = OWN
    reads_persons: ClassVar[bool] = True

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = checked_scenario(scenario)

    @property
    def hears(self) -> bool:
        """Whether each drone acts on a matrix of its own."""
        return self.scenario.radio_range is not None and self.knows == OWN

    @property
    def _maps(self) -> tuple[int, ...]:
        """The shape of the matrices of a search."""
        size = self.scenario.grid_size
        if self.scenario.radio_range is None:
            return size, size
        return self.scenario.n_drones, size, size

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
                (E, N, N), indexed [y, x], or with a `radio_range` (E, n_drones, N, N); and
                optionally "row", shape (E,): the index of each search in its batch, by default 0
                to E - 1. A single search has index 0.

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
        self._check_shape("observations", positions, self.scenario.n_drones, 2)
        if self.scenario.radio_range is None:
            matrices = seen[0][1][None]
        else:
            matrices = np.array([[matrix for _, matrix in seen]])
        self._check_maps("matrix", matrices)
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
        self._check_maps("probability_matrix", matrices)
        rows = _checked_rows("row", observations.get("row", np.arange(len(positions))))
        for name, array in (("probability_matrix", matrices), ("row", rows)):
            if len(array) != len(positions):
                raise ValueError(
                    f"{name} must have the length of positions, {len(positions)}, got {len(array)}"
                )
        return rows, positions, matrices

    def _check_maps(self, name: str, matrices: Singles) -> None:
        if self.knows == ALL and self.scenario.radio_range is not None:
            raise ValueError(
                f"{type(self).__name__} acts on what all drones know, and cannot use the matrix of "
                "each drone of a search with a radio_range; evaluate, play and record show it the "
                "common one"
            )
        self._check_shape(name, matrices, *self._maps)

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

    In a search with a `radio_range`, each drone has a memory of its own: it chooses the actions of
    all drones that it hears, and takes its own (see `knows`).
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
            cells: every drone's (x, y); for a drone with a radio, those of the drones in range, by
                number, its own among them, and last of one that has just blocked it unheard.
            matrix: float32, shape (N, N), indexed [y, x]; do not keep or change it.
        """

    def notice(self, memory: Any, drones: list[int]) -> None:
        """Take note of which drones are in range, before a choice; by default, nothing is noted.

        Args:
            memory: the memory of this search; change it in place.
            drones: their numbers, in the order of the cells of `choose`.
        """

    def learn(self, memory: Any, searched: list[int], actions: list[int]) -> None:
        """Take note of a step, before the next choice; by default, nothing is noted.

        Args:
            memory: the memory of this search; change it in place.
            searched: the cells searched, y * N + x, each as often as it was searched.
            actions: what every drone did; idling for drones that were not heard.
        """

    def _reset(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        # Rows whose observations have been identical form a group with one memory.
        n = self.scenario.n_drones
        if rows is None:
            self._group_of: Ints = np.empty(0, np.int64)  # by observer, see `_act`
            self._memories: dict[int, Any] = {}  # by group
            self._next_group = 0
            self._latest: Ints = np.empty((0, n), np.int64)  # the last actions, by row
            self._cells: Ints = np.empty((0, n), np.int64)  # where they were taken
            return
        known = rows[rows < len(self._latest)]
        self._latest[known] = _NO_ACTION
        self._group_of.reshape(-1, self._observers)[known] = _NO_GROUP

    @property
    def _observers(self) -> int:
        return self.scenario.n_drones if self.hears else 1

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        """The actions; each drone of a row is an observer of its own, or there is one for all."""
        n = self.scenario.n_drones
        each = self._observers
        if not rows.size:
            return np.empty((0, n), np.int64)
        self._make_room(int(rows.max()) + 1)
        who = (rows[:, None] * each + np.arange(each)).reshape(-1)
        new = who[self._group_of[who] == _NO_GROUP]
        if new.size:
            self._add_group(new, self.begin())
        if matrices.ndim == 3:
            matrices = matrices[:, None]
        seen = self._seen(rows, positions, matrices)
        chosen = self._choices(who, seen)  # of all drones, by each observer
        own = np.arange(n) if each == n else np.zeros(n, np.int64)
        actions: Ints = chosen.reshape(len(rows), each, n)[:, own, np.arange(n)]
        self._latest[rows] = actions
        self._cells[rows] = self._numbers(positions)
        return actions

    def _numbers(self, positions: NDArray[np.integer]) -> Ints:
        """The drones' cells, y * N + x, of their positions."""
        x, y = np.moveaxis(positions.astype(np.int64), -1, 0)
        cells: Ints = cell_number(x, y, self.scenario.grid_size)
        return cells

    def _make_room(self, rows: int) -> None:
        """Make room for some rows."""
        more = rows - len(self._latest)
        if more > 0:
            self._group_of = np.append(self._group_of, np.full(more * self._observers, _NO_GROUP))
            unknown = np.full((more, self.scenario.n_drones), _NO_ACTION)
            self._latest = np.concatenate([self._latest, unknown])
            self._cells = np.concatenate([self._cells, unknown])

    def _seen(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> _Seen:
        """What each observer sees of the drones that it hears."""
        each = self._observers
        n = self.scenario.n_drones
        heard = np.ones((len(rows), each, n), np.bool_)
        obstacles = np.full((len(rows), each, 2), _UNHEARD)
        if self.hears:
            cells = self._numbers(positions)
            heard = hearing(cells, self.scenario.grid_size, self.scenario.radio_range or 0.0)
            obstacles = self._obstacles(rows, cells)
        latest = self._latest[rows][:, None]
        seen_actions = np.where(heard, latest, np.where(latest < 0, _NO_ACTION, Action.IDLE.value))
        seen_positions = np.where(heard[..., None], positions[:, None], _UNHEARD)
        return _Seen(
            positions=seen_positions.reshape(-1, n, 2),
            matrices=matrices[:, :each].reshape(-1, *matrices.shape[2:]),
            actions=seen_actions.reshape(-1, n),
            obstacles=obstacles.reshape(-1, 2),
        )

    def _obstacles(self, rows: Ints, cells: Ints) -> Ints:
        """Where each drone has just met another one that blocked it, (x, y): (rows, n, 2).

        A drone that could not move knows that somebody is there, although it hears nobody.
        """
        latest = self._latest[rows]
        grid = Grid.of(self.scenario.grid_size)
        ahead = grid.targets[cells, np.maximum(latest, 0)]
        is_blocked = (latest >= 0) & (ahead != cells) & (ahead >= 0) & (cells == self._cells[rows])
        obstacles: Ints = np.where(is_blocked[..., None], grid.coordinates[ahead], _UNHEARD)
        return obstacles

    def _choices(self, who: Ints, seen: _Seen) -> Ints:
        """What each observer would have all drones do, as far as it hears them: (observers, n)."""
        chosen = np.full(seen.actions.shape, Action.IDLE.value)
        groups, counts = np.unique(self._group_of, return_counts=True)
        sizes = dict(zip(groups.tolist(), counts.tolist(), strict=True))
        for group in self._memories.keys() - sizes.keys():
            del self._memories[group]
        for indices in _identical(self._group_of[who], seen):
            group = int(self._group_of[who[indices[0]]])
            memory = self._memories[group]
            if len(indices) < sizes[group]:
                sizes[group] -= len(indices)
                memory = copy.deepcopy(memory)
                self._add_group(who[indices], memory)
            positions, matrix, actions, obstacle = (array[indices[0]] for array in seen)
            heard = (positions[:, 0] != _UNHEARD).nonzero()[0]
            cells = [(x, y) for x, y in positions[heard].tolist()]
            if actions[0] != _NO_ACTION:
                numbers = [cell_number(x, y, self.scenario.grid_size) for x, y in cells]
                cells_searched = searched(self.scenario, numbers, actions[heard].tolist())
                self.learn(memory, cells_searched, actions.tolist())
            self.notice(memory, heard.tolist())
            x, y = obstacle.tolist()
            if x != _UNHEARD and (x, y) not in cells:
                cells.append((x, y))  # a drone whose number is not known
            actions = self.choose(memory, cells, matrix)[: len(heard)]
            chosen[indices[:, None], heard] = actions
        return chosen

    def _add_group(self, who: Ints, memory: Any) -> None:
        self._group_of[who] = self._next_group
        self._memories[self._next_group] = memory
        self._next_group += 1


class _Seen(NamedTuple):
    """What observers see; the first axis is the observer.

    Attributes:
        positions: of the drones that are heard, (x, y); others are `_UNHEARD`: (..., n, 2).
        matrices: (..., N, N).
        actions: in the last step; `_NO_ACTION` before the first: (..., n).
        obstacles: where a drone that is not heard has just blocked the observer, (x, y), or
            `_UNHEARD`: (..., 2).
    """

    positions: NDArray[np.integer]
    matrices: Singles
    actions: Ints
    obstacles: Ints


def _identical(groups: Ints, seen: _Seen) -> Iterator[Ints]:
    """The indices of observers that share a memory and see the same now."""
    order = np.argsort(groups, kind="stable")
    borders = np.flatnonzero(np.diff(groups[order])) + 1
    for indices in np.split(order, borders):
        if len(indices) == 1:
            yield indices
            continue
        here = slice(None) if len(indices) == len(groups) else indices  # a slice copies nothing
        arrays = [array[here] for array in seen]
        equal = [(array == array[0]).reshape(len(indices), -1).all(axis=1) for array in arrays]
        same = np.logical_and.reduce(equal)
        yield indices[same]
        others: dict[tuple[bytes, ...], list[int]] = {}
        for index in indices[~same].tolist():
            key = tuple(array[index].tobytes() for array in seen)
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
