"""The drones of a batch: their cells and returns, and the outcomes of a step.

The array form of `drones.Drones`. Drones are numbered throughout the batch: row * n_drones +
drone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.rules import OFF_GRID, Action
from DroneSwarmSearch.scenario import Scenario

__all__ = ["BatchDrones"]

# NumPy calculates faster with 0-d arrays than with Python numbers.
_SEARCH, _ACTIONS, _OFF_GRID = (
    np.array(number, np.int16) for number in (Action.SEARCH, len(Action), OFF_GRID)
)

_NO_DRONES: Ints = np.empty(0, np.int64)
_NO_RETURNS: Floats = np.empty(0)


class BatchDrones:
    """The drones of many searches.

    Args:
        scenario: the shared parameters.
        rows: the number of rows.

    Attributes:
        dtype: the integer type of cells and actions; narrow integers are faster.
        cells: every drone's cell, y * N + x: (rows, n_drones).
        chosen: every drone's last action: (rows, n_drones).
        of_rows: the numbers of each row's drones: int64, (rows, n_drones).
        row_of: the row of each drone: int64, (rows * n_drones,).
        rewards: of the last step: float64, (rows, n_drones).
        returns: the sum of each drone's rewards in the episode: float64, (rows, n_drones).
        endings: why the last step ended episodes, each an `Ending` or 0: int8, (rows,).
        ended: rows whose episode has ended: bool, (rows,).
    """

    def __init__(self, scenario: Scenario, rows: int) -> None:
        n, size = scenario.n_drones, scenario.grid_size
        self._scheme = scenario.reward_scheme
        self._limit = scenario.timestep_limit
        self._last_step = np.array(scenario.timestep_limit - 1)  # 0-d, as above
        self._several = len(scenario.situation) > 1
        self._covers = scenario.mission == "coverage"
        neighbours = rules.neighbours_of_all(size)  # which checks that such tables fit in memory
        kinds = (np.int16, np.int32, np.int64)
        self.dtype: Any = next(kind for kind in kinds if neighbours.size <= np.iinfo(kind).max)
        self._neighbours = neighbours.reshape(-1).astype(self.dtype)
        self._collided = rules.Collisions(rows, n, self.dtype)
        # The (x, y) of every cell: two int32 in one int64, so that one look-up returns both.
        y, x = np.divmod(np.arange(size**2, dtype=np.int32), size)
        self._positions: Ints = np.stack([x, y], axis=1).view(np.int64).reshape(-1)

        self.cells: NDArray[Any] = np.zeros((rows, n), self.dtype)
        self.chosen: NDArray[Any] = np.full((rows, n), Action.IDLE, self.dtype)
        self.of_rows = np.arange(rows * n).reshape(rows, n)
        self.row_of = np.arange(rows).repeat(n)
        self.rewards: Floats = np.zeros((rows, n))
        self.returns: Floats = np.zeros((rows, n))
        self.endings = np.zeros(rows, np.int8)
        self.ended = np.ones(rows, np.bool_)
        # Drones that found one of several persons; finding a single one ends the episode.
        self._finders = np.zeros((rows, n), np.bool_)

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (rows, n_drones, 2)."""
        pairs = self._positions.take(self.cells, mode="clip")
        return pairs.view(np.int32).reshape(*self.cells.shape, 2)

    @property
    def searching(self) -> Flags:
        """Which drones searched in the last step: bool, (rows, n_drones)."""
        searched: Flags = self.chosen == _SEARCH
        return searched

    def begin(self, rows: Ints, cells: Ints) -> Ints:
        """Start the episodes of some rows; returns the numbers of their drones.

        Args:
            rows: their numbers.
            cells: the start cells of all drones: (rows, n_drones).
        """
        drones: Ints = self.of_rows.take(rows, axis=0).reshape(-1)
        self.cells.reshape(-1)[drones] = cells.take(drones)
        self.returns.reshape(-1)[drones] = 0.0
        if self._several:
            self._finders.reshape(-1)[drones] = False
        return drones

    def clear(self, rows: Ints) -> None:
        """Forget the last step's rewards and endings of some rows."""
        self.rewards = self.rewards.copy()  # the caller may keep the array
        self.rewards[rows] = 0.0
        self.endings[rows] = 0
        self.ended[rows] = False

    # A step: `move`, then `resolve`.

    def move(self, chosen: NDArray[Any]) -> tuple[NDArray[Any], Ints]:
        """The cell that each drone tries to enter, or OFF_GRID, and the drones that search.

        Args:
            chosen: each drone's action: (rows, n_drones).
        """
        moves = self.cells * _ACTIONS
        moves += chosen
        searches: Ints = (chosen == _SEARCH).reshape(-1).nonzero()[0]
        return self._neighbours.take(moves, mode="clip"), searches

    def resolve(
        self,
        steps: Ints,
        targets: NDArray[Any],
        searches: Ints,
        probability: Floats,
        found: Ints,
        all_found: Ints,
        covered: Ints,
        beginning: Ints,
    ) -> None:
        """Apply the rules to a step: determine rewards and endings.

        Args:
            steps: completed steps before this one: (rows,).
            targets: the cell that each drone tries to enter; those that leave the grid are
                put back into their cells.
            searches: the drones that searched.
            probability: what each of them pays for, see `BatchState.observed`.
            found: the drones that found someone, possibly with repetitions.
            all_found: the rows in which all persons have been found.
            covered: the rows whose coverage mission is complete.
            beginning: the drones that begin an episode in this step and get no reward.
        """
        left_grid = (targets.reshape(-1) == _OFF_GRID).nonzero()[0]
        collided = self._collided(targets)
        last = np.greater(np.equal(steps, self._last_step), self.ended).nonzero()[0]
        timed_out, return_so_far, steps_before = _NO_DRONES, _NO_RETURNS, _NO_DRONES
        if last.size and not self._covers:
            timed_out = self.of_rows.take(last, axis=0).reshape(-1)
            if self._several:
                timed_out = timed_out[~self._finders.take(timed_out)]
            return_so_far = self.returns.take(timed_out)
        if found.size:
            steps_before = steps.take(self.row_of.take(found))
            self._finders.reshape(-1)[found] = True
        self.rewards = rules.rewards(
            self._scheme,
            self.rewards.size,
            searched=searches,
            probability=probability,
            timed_out=timed_out,
            return_so_far=return_so_far,
            found=found,
            steps_before=steps_before,
            timestep_limit=self._limit,
            left_grid=left_grid,
            collided=collided,
        ).reshape(self.rewards.shape)
        if beginning.size:
            self.rewards.reshape(-1)[beginning] = 0.0
        self.returns += self.rewards
        self.endings = rules.endings(
            len(steps),
            all_found=all_found,
            covered=covered,
            any_collided=self.row_of.take(collided),
            any_left_grid=self.row_of.take(left_grid),
            time_limit_reached=last,
        )
        self.ended = self.endings != 0
        if left_grid.size:
            targets.reshape(-1)[left_grid] = self.cells.reshape(-1).take(left_grid)
