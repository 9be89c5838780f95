"""The drones of a batch: their cells and returns, and the outcomes of a step.

The array form of `drones.Drones`. Drones are numbered throughout the batch: row * n_drones +
drone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.rules import OFF_GRID, Action
from DroneSwarmSearch.scenario import Scenario

__all__ = ["BatchDrones"]

_SEARCH, _ACTIONS = int(Action.SEARCH), len(Action)


class BatchDrones:
    """The drones of many searches.

    Args:
        scenario: the shared parameters.
        rows: the number of rows.

    Attributes:
        cells: every drone's cell, y * N + x: int64, (rows, n_drones).
        chosen: every drone's last action: int64, (rows, n_drones).
        row_of: the row of each drone: int64, (rows * n_drones,).
        rewards: of the last step: float64, (rows, n_drones).
        returns: the sum of each drone's rewards in the episode: float64, (rows, n_drones).
        endings: why the last step ended episodes, each an `Ending` or 0: int8, (rows,).
        ended: rows whose episode has ended: bool, (rows,).
    """

    def __init__(self, scenario: Scenario, rows: int) -> None:
        n = scenario.n_drones
        self._scenario = scenario
        self._neighbours = rules.neighbours_of_all(scenario.grid_size)
        y, x = np.divmod(np.arange(scenario.grid_size**2, dtype=np.int32), scenario.grid_size)
        self._positions = np.stack([x, y], axis=1)  # of every cell
        self.cells: Ints = np.zeros((rows, n), np.int64)
        self.chosen: Ints = np.full((rows, n), Action.IDLE, np.int64)
        self.row_of = np.arange(rows).repeat(n)
        self.rewards: Floats = np.zeros((rows, n))
        self.returns: Floats = np.zeros((rows, n))
        self.endings = np.zeros(rows, np.int8)
        self.ended: Flags = np.ones(rows, np.bool_)
        self._found: Flags = np.zeros((rows, n), np.bool_)  # in this episode

    @property
    def positions(self) -> NDArray[np.int32]:
        """Every drone's cell (x, y): int32, (rows, n_drones, 2)."""
        return self._positions.take(self.cells, axis=0)

    def begin(self, rows: Ints, cells: Ints) -> None:
        """Start the episodes of some rows with the drones in these cells: (n, n_drones)."""
        self.cells[rows] = cells
        self.chosen[rows] = Action.IDLE
        self.returns[rows] = 0.0
        self._found[rows] = False
        self.ended[rows] = False

    def forget(self, rows: Ints) -> None:
        """Forget the last step's rewards and endings of some rows."""
        self.rewards = self.rewards.copy()  # the caller may keep the array
        self.rewards[rows] = 0.0
        self.endings[rows] = 0

    # A step: `move`, then `resolve`.

    def move(self, chosen: Ints) -> tuple[Ints, Ints]:
        """The cell that each drone tries to enter, or OFF_GRID, and the drones that search.

        Args:
            chosen: each drone's action: (rows, n_drones).
        """
        targets = self._neighbours.take(self.cells * _ACTIONS + chosen)
        return targets, (chosen == _SEARCH).reshape(-1).nonzero()[0]

    def resolve(
        self,
        steps: Ints,
        targets: Ints,
        searches: Ints,
        probability: Floats,
        found: Ints,
        all_found: Ints,
        covered: Ints,
    ) -> None:
        """Apply the rules to a step: determine rewards and endings, move the drones.

        Args:
            steps: completed steps before this one: (rows,).
            targets: the cell that each drone tries to enter; those that leave the grid stay.
            searches: the drones that searched.
            probability: what each of them pays for, see `BatchState.observed`.
            found: the drones that found someone, possibly with repetitions.
            all_found: the rows in which all persons have been found.
            covered: the rows whose coverage mission is complete.
        """
        scenario = self._scenario
        left_grid = (targets.reshape(-1) == OFF_GRID).nonzero()[0]
        collided = rules.collisions(targets)
        last = (steps == scenario.timestep_limit - 1).nonzero()[0]
        timed_out = last[:0]
        if scenario.mission == "rescue":
            drones = last[:, None] * scenario.n_drones + np.arange(scenario.n_drones)
            timed_out = drones[~self._found[last]]
        self._found.reshape(-1)[found] = True
        self.rewards = rules.rewards(
            scenario.reward_scheme,
            targets.size,
            searched=searches,
            probability=probability,
            timed_out=timed_out,
            return_so_far=self.returns.take(timed_out),
            found=found,
            steps_before=steps.take(self.row_of.take(found)),
            timestep_limit=scenario.timestep_limit,
            left_grid=left_grid,
            collided=collided,
        ).reshape(targets.shape)
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
        targets.reshape(-1)[left_grid] = self.cells.reshape(-1).take(left_grid)
        self.cells = targets
