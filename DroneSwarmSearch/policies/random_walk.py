"""A random walk: what any policy has to beat.

Every drone in turn picks one of its free actions, each with the same chance: to search, to
idle, and to move to any neighbouring cell in which no drone is and which no drone that
picked before it is about to enter. So drones never collide, and never leave the grid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.streams import episode_keys, numbers, policy_key
from DroneSwarmSearch.policies.swarm import BatchPolicy
from DroneSwarmSearch.rules import Action, neighbours_of_all
from DroneSwarmSearch.scenario import Scenario

__all__ = ["RandomPolicy"]

Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Singles = NDArray[np.float32]


class RandomPolicy(BatchPolicy):
    """Random: every free action of a drone is as likely as the others.

    The numbers depend on a search's seed, the step and the drone alone, not on the other
    searches of a batch. Row i has seed i until `reset` says otherwise; a reset without a
    seed goes on to other numbers. The numbers are not those of an environment with that seed.

    Args:
        scenario: the parameters of every search that the policy is going to steer.

    Raises:
        TypeError: `scenario` is no `Scenario`.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._targets = neighbours_of_all(scenario.grid_size)  # [cell, action]
        self._seed = 0  # row i has this + i
        self._given: list[int] = []  # but these for the first rows
        self._resets = 0  # of all rows, since the seed
        self._no_rows()

    def _no_rows(self) -> None:
        self._keys: Words = np.empty(0, np.uint64)
        self._episodes: Words = np.empty(0, np.uint64)
        self._steps: Words = np.empty(0, np.uint64)

    def _forget(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        if rows is None:
            if seeds is None:
                self._resets += 1
                self._episodes = self._episodes + np.uint64(1)
                self._steps = np.zeros_like(self._steps)
                return
            self._seed, self._given = (seeds, []) if isinstance(seeds, int) else (0, seeds)
            self._resets = 0
            self._no_rows()
            return
        if not rows.size:
            return
        self._know(int(rows.max()) + 1)
        self._steps[rows] = 0
        if seeds is None:
            self._episodes[rows] += np.uint64(1)
            return
        if isinstance(seeds, int):
            seeds = [seeds + row for row in rows.tolist()]
        self._keys[rows] = [policy_key(seed) for seed in seeds]
        self._episodes[rows] = 0

    def _know(self, count: int) -> None:
        """Have a key for each of the first rows."""
        known = len(self._keys)
        if count <= known:
            return
        seeds = [self._seed_of(row) for row in range(known, count)]
        keys = np.array([policy_key(seed) for seed in seeds], np.uint64)
        self._keys = np.concatenate([self._keys, keys])
        episodes = np.full(count - known, self._resets, np.uint64)
        self._episodes = np.concatenate([self._episodes, episodes])
        self._steps = np.concatenate([self._steps, np.zeros(count - known, np.uint64)])

    def _seed_of(self, row: int) -> int:
        return self._given[row] if row < len(self._given) else self._seed + row

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        drones = positions.shape[1]
        actions = np.empty((len(rows), drones), np.int64)
        if not rows.size:
            return actions
        self._know(int(rows.max()) + 1)
        luck = self._draw(rows, drones)
        cells = positions[..., 1].astype(np.int64) * self._scenario.grid_size + positions[..., 0]
        targets = self._targets[cells]  # [row, drone, action]
        taken = cells.copy()  # and from each drone that has picked, the cell it goes to
        moves = slice(Action.SEARCH)
        for drone in range(drones):
            free = targets[:, drone] >= 0
            ways = targets[:, drone, moves, None]
            free[:, moves] &= (ways != cells[:, None]).all(axis=-1)
            free[:, moves] &= (ways != taken[:, None, :drone]).all(axis=-1)
            rank = np.cumsum(free, axis=1)  # from 1, of the free actions
            wanted = (luck[:, drone] * rank[:, -1]).astype(np.int64) + 1
            picked = (rank == wanted[:, None]).argmax(axis=1)
            actions[:, drone] = picked
            taken[:, drone] = np.take_along_axis(targets[:, drone], picked[:, None], 1)[:, 0]
        return actions

    def _draw(self, rows: Ints, drones: int) -> NDArray[np.float64]:
        """A number in [0, 1) for every drone in this step, shape (E, drones)."""
        first = np.multiply(self._steps[rows], np.uint64(drones), dtype=np.uint64)
        places: Words = np.add.outer(first, np.arange(drones, dtype=np.uint64))
        self._steps[rows] += np.uint64(1)
        return numbers(episode_keys(self._keys[rows], self._episodes[rows])[:, None], places)
