"""The rules of the search: actions, rewards and endings.

A drone's reward in a step is given by the first line that applies (t: steps completed before
this one; L: timestep_limit; p: what the matrix that it observed holds for its cell):

| event                                               | reward                          |
|-----------------------------------------------------|---------------------------------|
| it collided                                         | -100000                         |
| it left the grid                                    | -100000                         |
| it searched and found a person                      | 10000 + 10000 (1 - t/L)         |
| time limit, and it has found nobody in this episode | -(its return so far) - 100000   |
| it searched and found nobody                        | 10000 p if 100 p > 1, else -100 |
| anything else                                       | 1                               |

With `RewardScheme.expected_finds`, a search pays `find` times the probability of success (POS)
that it adds, whether or not it finds a person, and the line on the time limit does not apply.

All drones act at once, so a search counts even if another drone flies into the searcher: the
person is found, although the searcher gets the reward of the collision.

The episode ends for all drones together if drones collide, a drone leaves the grid or all
persons are found, and with step number L. In the coverage mission nobody is found. The line on
the time limit does not apply, and the episode also ends once less than 1% is left to find.

`reward` implements the table for one drone; `RewardScheme` holds its figures. Each rule has a
scalar form and, in the plural, an array form for many searches.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats

__all__ = [
    "OFF_GRID",
    "Action",
    "Collisions",
    "Ending",
    "RewardScheme",
    "ending",
    "endings",
    "is_success",
    "neighbours",
    "neighbours_of_all",
    "reward",
    "rewards",
    "same_cell",
    "successes",
    "uneventful_reward",
]

Drones = NDArray[np.int64]


class Action(IntEnum):
    """The actions of a drone; y increases downward, so UP is towards row 0."""

    LEFT = 0
    RIGHT = 1
    UP = 2
    DOWN = 3
    SEARCH = 4
    IDLE = 5


class Ending(IntEnum):
    """Why an episode ended. Arrays hold the numbers; 0 stands for a running episode."""

    FOUND = 1
    COLLISION = 2
    LEFT_GRID = 3
    TIME_LIMIT = 4
    COVERED = 5

    @property
    def description(self) -> str:
        """The ending in words."""
        return _DESCRIPTIONS[self]


_DESCRIPTIONS = {
    Ending.FOUND: "every person was found",
    Ending.COLLISION: "drones collided",
    Ending.LEFT_GRID: "a drone left the grid",
    Ending.TIME_LIMIT: "the time limit was reached",
    Ending.COVERED: "less than 1% was left to find",
}

COVERED_AT = 0.99
"""The coverage mission ends above this probability of success."""

OFF_GRID = -1
"""The target of a move that leaves the grid."""

_LARGEST = 1e100
"""The largest figure of a scheme."""

_NOT_ZERO = ("find", "expected_finds")

_FEW_DRONES = 32
"""Up to this many drones, comparing all pairs is faster than sorting the cells."""

_NO_DRONES: Drones = np.empty(0, np.int64)


@dataclass(frozen=True)
class RewardScheme:
    """The figures of the reward table, per step and drone.

    Attributes:
        step: a step that no other line covers.
        search: an unsuccessful search, times the observed probability of the cell.
        search_threshold: an unsuccessful search of a cell with this probability or less
            gets `search_unlikely` instead.
        search_unlikely: see `search_threshold`.
        find: finding a person.
        find_early: added to `find`, times the remaining fraction of the time limit.
        timeout: the return of a drone that has found nobody by the time limit; exact for
            whole numbers such as the defaults, else up to rounding.
        leave_grid: trying to leave the grid.
        collision: being in the same cell as another drone after moving.
        expected_finds: whether a search pays `find` times the probability of success that it
            adds, in place of what it finds or does not find; see `expected`.

    Raises:
        TypeError: a figure is not a real number, or `expected_finds` is not a bool.
        ValueError: a figure is beyond ±1e100, so that sums of rewards could overflow.
    """

    step: float = 1.0
    search: float = 10_000.0
    search_threshold: float = 0.01
    search_unlikely: float = -100.0
    find: float = 10_000.0
    find_early: float = 10_000.0
    timeout: float = -100_000.0
    leave_grid: float = -100_000.0
    collision: float = -100_000.0
    expected_finds: bool = False

    def __post_init__(self) -> None:
        checks.boolean("RewardScheme.expected_finds", self.expected_finds)
        for field in fields(self)[:-1]:
            name = f"RewardScheme.{field.name}"
            number = checks.real(name, getattr(self, field.name), -_LARGEST, _LARGEST)
            object.__setattr__(self, field.name, number)

    def largest(self, timestep_limit: int) -> float:
        """The largest absolute reward of a drone in one step.

        Args:
            timestep_limit: the number of steps in an episode.
        """
        usual = max(
            abs(self.step),
            abs(self.search),
            abs(self.search_unlikely),
            abs(self.find) + abs(self.find_early),
        )
        crash = max(abs(self.leave_grid), abs(self.collision))
        if self.expected_finds:
            return max(abs(self.step), abs(self.find), crash)
        return max(abs(self.timeout) + usual * timestep_limit, crash)

    @classmethod
    def sparse(cls) -> RewardScheme:
        """Reward 1 to a drone that finds a person, and 0 otherwise."""
        return cls(find=1.0, **cls._zeros())

    @classmethod
    def expected(cls, find: float = 1.0) -> RewardScheme:
        """Pay each search `find` times the probability of success (POS) that it adds.

        All other figures are 0. The reward does not depend on where the person is, only on
        what is known, so returns vary less than with `sparse`. A search of cell k adds the
        mean over persons of (1 - POS) b(k) q, where b is the belief and q the probability of
        detection; of several drones in a step, each counts its own cell.

        Args:
            find: the reward of a certain find.
        """
        return cls(find=find, expected_finds=True, **cls._zeros())

    @classmethod
    def _zeros(cls) -> dict[str, Any]:
        """All figures but `find` as 0."""
        return {field.name: 0.0 for field in fields(cls) if field.name not in _NOT_ZERO}


def neighbours(cell: int, grid_size: int) -> tuple[int, int, int, int, int, int]:
    """The target cell of each action, indexed by `Action`.

    Args:
        cell: y * grid_size + x.
        grid_size: cells along each side.

    Returns:
        Six cells; OFF_GRID for moves that leave the grid. SEARCH and IDLE stay.
    """
    y, x = divmod(cell, grid_size)
    return (
        cell - 1 if x > 0 else OFF_GRID,
        cell + 1 if x < grid_size - 1 else OFF_GRID,
        cell - grid_size if y > 0 else OFF_GRID,
        cell + grid_size if y < grid_size - 1 else OFF_GRID,
        cell,
        cell,
    )


def neighbours_of_all(grid_size: int) -> NDArray[np.int64]:
    """`neighbours` of all cells: int64, shape (grid_size², 6), indexed [cell, action].

    Raises:
        ValueError: the table does not fit in memory.
    """
    # Six integers of eight bytes for each cell, and as much again while they are stacked.
    checks.fits("the table of the cells' neighbours", 96 * grid_size**2, grid_size=grid_size)
    cells = np.arange(grid_size**2)
    y, x = np.divmod(cells, grid_size)
    return np.stack(
        [
            np.where(x > 0, cells - 1, OFF_GRID),
            np.where(x < grid_size - 1, cells + 1, OFF_GRID),
            np.where(y > 0, cells - grid_size, OFF_GRID),
            np.where(y < grid_size - 1, cells + grid_size, OFF_GRID),
            cells,
            cells,
        ],
        axis=1,
    )


def same_cell(targets: Sequence[int]) -> set[int]:
    """The cells that hold two or more drones after moving; these drones collide.

    A drone that tries to leave the grid is in no cell, so OFF_GRID is never in the result. Two
    drones that exchange cells do not collide.
    """
    if len(set(targets)) == len(targets):
        return set()
    counts = Counter(targets)
    return {cell for cell in counts if counts[cell] > 1 and cell != OFF_GRID}


class Collisions:
    """`same_cell` for many searches: finds the drones that collided.

    Args:
        rows: the number of searches.
        drones: the drones in each.
        dtype: the integer type of the cells.
    """

    def __init__(self, rows: int, drones: int, dtype: DTypeLike) -> None:
        self._arguments = rows, drones, dtype
        if drones > _FEW_DRONES:
            return
        # With the drones as the first axis, one call compares pairs in all rows.
        self._by_drone = np.empty((drones, rows), dtype)
        lower, higher = np.triu_indices(drones, 1)
        order = np.argsort(higher - lower, kind="stable")
        self._pairs = np.stack([higher, lower])[:, order]  # by their distance
        self._equal = np.empty((len(order), rows), np.bool_)
        ends = np.arange(drones - 1, 0, -1).cumsum()
        self._comparisons = [
            (self._by_drone[apart:], self._by_drone[:-apart], equal)
            for apart, equal in enumerate(np.split(self._equal, ends[:-1]), 1)
        ]
        # NumPy calculates faster with 0-d arrays than with Python numbers.
        self._rows, self._drones = np.array(rows), np.array(drones)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._arguments  # no state outlives a call

    def __call__(self, targets: NDArray[Any]) -> Drones:
        """Return the drones that share a cell with another drone after moving.

        Args:
            targets: the cell that each drone tried to enter, or OFF_GRID: shape
                (rows, drones).

        Returns:
            row * drones + drone for each of them; unordered, possibly with repetitions.
        """
        drones = targets.shape[1]
        if drones == 1:
            return _NO_DRONES
        if drones > _FEW_DRONES:
            return self._sorted(targets)
        self._by_drone[...] = targets.T
        for one, other, equal in self._comparisons:
            np.equal(one, other, out=equal)
        together = self._equal.reshape(-1).nonzero()[0]
        if not together.size:
            return _NO_DRONES
        pairs, rows = np.divmod(together, self._rows)
        both: Drones = self._pairs.take(pairs, axis=1)
        both += np.multiply(rows, self._drones)
        cells = targets.take(both[0])
        if np.minimum.reduce(cells) == OFF_GRID:  # drones off the grid do not collide
            both = both[:, cells != OFF_GRID]
        return both.reshape(-1)

    def _sorted(self, targets: NDArray[Any]) -> Drones:
        cells = np.sort(targets, axis=1)
        equal = (cells[:, 1:] == cells[:, :-1]) & (cells[:, 1:] != OFF_GRID)
        rows = np.logical_or.reduce(equal, axis=1).nonzero()[0]
        order = targets[rows].argsort(axis=1, kind="stable") + (rows * targets.shape[1])[:, None]
        equal = equal[rows]
        drones: Drones = np.concatenate([order[:, 1:][equal], order[:, :-1][equal]])
        return drones


def reward(
    scheme: RewardScheme,
    collided: bool,
    left_grid: bool,
    found: bool,
    time_limit_reached: bool,
    found_before: bool,
    searched: bool,
    probability: float,
    steps_before: int,
    timestep_limit: int,
    return_so_far: float,
) -> float:
    """The reward of one drone in one step: the first line of the table that applies.

    Args:
        scheme: the figures.
        collided: whether another drone is in its cell after moving.
        left_grid: whether it tried to leave the grid.
        found: whether its search found a person in this step.
        time_limit_reached: whether this is step number `timestep_limit`.
        found_before: whether it found a person in an earlier step of the episode.
        searched: whether it searched.
        probability: what the matrix that it observed holds for its cell; or, with
            `expected_finds`, the probability of success that its search adds.
        steps_before: steps completed before this one.
        timestep_limit: the number of steps in an episode.
        return_so_far: the sum of its rewards in the episode before this step.
    """
    if collided:
        return scheme.collision
    if left_grid:
        return scheme.leave_grid
    if scheme.expected_finds:
        return scheme.find * probability if searched else scheme.step
    if found:
        return scheme.find + scheme.find_early * (1 - steps_before / timestep_limit)
    if time_limit_reached and not found_before:
        return scheme.timeout - return_so_far
    if not searched:
        return scheme.step
    if probability > scheme.search_threshold:
        return scheme.search * probability
    return scheme.search_unlikely


def uneventful_reward(scheme: RewardScheme) -> float:
    """The `reward` of every drone in a step without searches, crashes and the time limit."""
    return scheme.step


def rewards(
    scheme: RewardScheme,
    drones: int,
    *,
    searched: Drones,
    probability: Floats,
    timed_out: Drones,
    return_so_far: Floats,
    found: Drones,
    steps_before: Drones,
    timestep_limit: int,
    left_grid: Drones,
    collided: Drones,
) -> Floats:
    """`reward` for many drones; applies the lines from last to first, so the first one wins.

    Args:
        scheme: the figures.
        drones: the number of drones, n; the arrays below hold numbers of drones.
        searched: the drones that searched.
        probability: for each of these, as in `reward`.
        timed_out: the drones at the time limit that found nobody before this step.
        return_so_far: for each of these, the sum of its rewards before this step.
        found: the drones whose search found a person.
        steps_before: for each of these, steps completed before this one.
        timestep_limit: the number of steps in an episode.
        left_grid: the drones that tried to leave the grid.
        collided: the drones with another drone in their cell after moving.

    Returns:
        float64, shape (n,).
    """
    points = np.empty(drones)
    points.fill(scheme.step)
    if scheme.expected_finds:
        points[searched] = scheme.find * probability
    else:
        likely = scheme.search * probability
        np.putmask(likely, probability <= scheme.search_threshold, scheme.search_unlikely)
        points[searched] = likely
    if timed_out.size and not scheme.expected_finds:
        points[timed_out] = scheme.timeout - return_so_far
    if found.size and not scheme.expected_finds:
        points[found] = scheme.find + scheme.find_early * (1 - steps_before / timestep_limit)
    if left_grid.size:
        points[left_grid] = scheme.leave_grid
    if collided.size:
        points[collided] = scheme.collision
    return points


def ending(
    all_found: bool,
    covered: bool,
    any_collided: bool,
    any_left_grid: bool,
    time_limit_reached: bool,
) -> Ending | None:
    """How the episode ends with this step; success takes precedence over crashes.

    Args:
        all_found: whether all persons have been found.
        covered: whether the coverage mission is complete, see `COVERED_AT`.
        any_collided: whether drones have collided.
        any_left_grid: whether a drone has left the grid.
        time_limit_reached: whether this is step number `timestep_limit`.

    Returns:
        The ending, or None if the episode continues.
    """
    if all_found:
        return Ending.FOUND
    if covered:
        return Ending.COVERED
    if any_collided:
        return Ending.COLLISION
    if any_left_grid:
        return Ending.LEFT_GRID
    return Ending.TIME_LIMIT if time_limit_reached else None


def endings(
    searches: int,
    *,
    all_found: Drones,
    covered: Drones,
    any_collided: Drones,
    any_left_grid: Drones,
    time_limit_reached: Drones,
) -> NDArray[np.int8]:
    """`ending` for many searches.

    Args:
        searches: the number of searches, n; the arrays below hold numbers of searches.
        all_found: the searches in which all persons have been found.
        covered: the searches whose coverage mission is complete.
        any_collided: the searches in which drones have collided.
        any_left_grid: the searches in which a drone has left the grid.
        time_limit_reached: the searches at the time limit.

    Returns:
        int8, shape (n,): each an `Ending`, or 0.
    """
    ended = np.zeros(searches, np.int8)
    for where, reason in (  # in ascending order of precedence
        (time_limit_reached, Ending.TIME_LIMIT),
        (any_left_grid, Ending.LEFT_GRID),
        (any_collided, Ending.COLLISION),
        (covered, Ending.COVERED),
        (all_found, Ending.FOUND),
    ):
        if where.size:
            ended[where] = reason
    return ended


def is_success(ending: Ending | None) -> bool:
    """Whether an episode ends with success: all persons found, or the coverage mission complete.

    Args:
        ending: why it ended, or None if it continues.
    """
    return ending in _WELL


_WELL = frozenset({Ending.FOUND, Ending.COVERED})
_SUCCESSES = np.array([False, *map(is_success, Ending)])
"""`is_success` by the number of the ending."""


def successes(endings: NDArray[np.int8]) -> NDArray[np.bool_]:
    """`is_success` for many searches.

    Args:
        endings: each an `Ending`, or 0; shape (n,).

    Returns:
        bool, shape (n,).
    """
    return _SUCCESSES.take(endings)
