"""The outcomes of a batch's steps: rewards, returns and endings."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch import rules
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.scenario import Scenario

__all__ = ["Outcomes"]

_NO_DRONES: Ints = np.empty(0, np.int64)
_NO_RETURNS: Floats = np.empty(0)


class Outcomes:
    """The rewards and endings of the last step, and what they depend on.

    Drones are numbered throughout the batch: row * n_drones + drone.

    Args:
        scenario: the shared parameters.
        rows: the number of rows.

    Attributes:
        rewards: of the last step: float64, (rows, n_drones).
        endings: why the last step ended episodes, each an `Ending` or 0: int8, (rows,).
        ended: rows whose episode has ended: bool, (rows,).
        returns: the sum of each drone's rewards in the episode: float64, (rows, n_drones).
    """

    def __init__(self, scenario: Scenario, rows: int) -> None:
        n = scenario.n_drones
        self._scheme = scenario.reward_scheme
        self._limit = scenario.timestep_limit
        self._last_step = np.array(scenario.timestep_limit - 1)  # 0-d: faster than an int
        self._several = len(scenario.person_initial_position) > 1
        self._drones_of = np.arange(rows * n).reshape(rows, n)
        self._row_of = np.arange(rows).repeat(n)
        self.rewards: Floats = np.zeros((rows, n))
        self.returns: Floats = np.zeros((rows, n))
        self.endings = np.zeros(rows, np.int8)
        self.ended = np.ones(rows, np.bool_)
        # Drones that found one of several persons; finding a single one ends the episode.
        self._finders = np.zeros((rows, n), np.bool_)

    def begin(self, drones: Ints) -> None:
        """Start the episode of some drones."""
        self.returns.reshape(-1)[drones] = 0.0
        if self._several:
            self._finders.reshape(-1)[drones] = False

    def clear(self, rows: Ints) -> None:
        """Forget the last step of some rows."""
        self.rewards = self.rewards.copy()  # the caller may keep the array
        self.rewards[rows] = 0.0
        self.endings[rows] = 0
        self.ended[rows] = False

    def decide(
        self,
        steps: Ints,
        searches: Ints,
        probability: Floats,
        found: Ints,
        all_found: Ints,
        left_grid: Ints,
        collided: Ints,
        beginning: Ints,
    ) -> None:
        """Apply the rules to a step.

        Args:
            steps: completed steps before this one: (rows,).
            searches: the drones that searched.
            probability: the matrix entry that each of them was shown of its cell.
            found: the drones that found someone, possibly with repetitions.
            all_found: the rows in which all persons have been found.
            left_grid: the drones that tried to leave the grid.
            collided: the drones that collided.
            beginning: the drones that begin an episode in this step and get no reward.
        """
        last = np.greater(np.equal(steps, self._last_step), self.ended).nonzero()[0]
        timed_out, return_so_far, steps_before = _NO_DRONES, _NO_RETURNS, _NO_DRONES
        if last.size:
            timed_out = self._drones_of.take(last, axis=0).reshape(-1)
            if self._several:
                timed_out = timed_out[~self._finders.take(timed_out)]
            return_so_far = self.returns.take(timed_out)
        if found.size:
            steps_before = steps.take(self._row_of.take(found))
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
            any_collided=self._row_of.take(collided),
            any_left_grid=self._row_of.take(left_grid),
            time_limit_reached=last,
        )
        self.ended = self.endings != 0
