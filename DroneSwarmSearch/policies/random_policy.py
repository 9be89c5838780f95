"""The random policy: the baseline that every other policy should beat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Ints, Singles, Words
from DroneSwarmSearch._internal.streams import episode_keys, numbers, policy_key
from DroneSwarmSearch.policies.base import BatchPolicy
from DroneSwarmSearch.rules import Action, neighbours_of_all
from DroneSwarmSearch.scenario import Scenario

__all__ = ["RandomPolicy"]


class RandomPolicy(BatchPolicy):
    """Chooses each drone's action uniformly among the safe ones.

    The drones choose in turn. Searching and idling are always safe; a move is safe if no
    drone is in the cell and no earlier drone is about to enter it. Drones therefore never collide
    and never leave the grid.

    The random draws depend only on a search's seed, its episode, the step and the drone, not
    on the rest of the batch. Row i has seed i until `reset` sets another one. A reset without
    a seed starts the next episode of the same sequence. The draws are independent of those of
    an environment with the same seed.
    """

    _seeds: int | list[int]  # as given to `reset`
    _resets: int  # resets of all rows without a seed, since then
    _keys: Words  # for each row used so far, like the next two
    _episodes: Words
    _steps: Words

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._targets = neighbours_of_all(scenario.grid_size)  # [cell, action]
        self._reset(None, 0)

    def _reset(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        if rows is None:
            if seeds is None:
                self._resets += 1
                self._episodes = self._episodes + np.uint64(1)
                self._steps = np.zeros_like(self._steps)
                return
            self._seeds, self._resets = seeds, 0
            self._keys, self._episodes, self._steps = np.empty((3, 0), np.uint64)
            return
        if not rows.size:
            return
        self._add_rows(int(rows.max()) + 1)
        self._steps[rows] = 0
        if seeds is None:
            self._episodes[rows] += np.uint64(1)
            return
        if isinstance(seeds, int):
            seeds = [seeds + row for row in rows.tolist()]
        self._keys[rows] = [policy_key(seed) for seed in seeds]
        self._episodes[rows] = 0

    def _add_rows(self, count: int) -> None:
        """Add rows up to a total of `count`."""
        known = len(self._keys)
        if count <= known:
            return
        keys = np.array([policy_key(self._seed_of(row)) for row in range(known, count)], np.uint64)
        self._keys = np.concatenate([self._keys, keys])
        episodes = np.full(count - known, self._resets, np.uint64)
        self._episodes = np.concatenate([self._episodes, episodes])
        self._steps = np.concatenate([self._steps, np.zeros(count - known, np.uint64)])

    def _seed_of(self, row: int) -> int:
        if isinstance(self._seeds, int):
            return self._seeds + row
        return self._seeds[row] if row < len(self._seeds) else row

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        drones = positions.shape[1]
        actions = np.empty((len(rows), drones), np.int64)
        if not rows.size:
            return actions
        self._add_rows(int(rows.max()) + 1)
        uniforms = self._draw(rows, drones)
        cells = positions[..., 1].astype(np.int64) * self.scenario.grid_size + positions[..., 0]
        targets = self._targets[cells]  # [row, drone, action]
        next_cells = cells.copy()
        moves = slice(Action.SEARCH)
        for drone in range(drones):
            safe = targets[:, drone] >= 0
            ahead = targets[:, drone, moves, None]
            safe[:, moves] &= (ahead != cells[:, None]).all(axis=-1)
            safe[:, moves] &= (ahead != next_cells[:, None, :drone]).all(axis=-1)
            rank = np.cumsum(safe, axis=1)  # rank among the safe actions, from 1
            drawn = (uniforms[:, drone] * rank[:, -1]).astype(np.int64) + 1
            picked = (rank == drawn[:, None]).argmax(axis=1)
            actions[:, drone] = picked
            next_cells[:, drone] = np.take_along_axis(targets[:, drone], picked[:, None], 1)[:, 0]
        return actions

    def _draw(self, rows: Ints, drones: int) -> NDArray[np.float64]:
        """A uniform number in [0, 1) for every drone in this step, shape (E, drones)."""
        first = np.multiply(self._steps[rows], np.uint64(drones), dtype=np.uint64)
        places: Words = np.add.outer(first, np.arange(drones, dtype=np.uint64))
        self._steps[rows] += np.uint64(1)
        return numbers(episode_keys(self._keys[rows], self._episodes[rows])[:, None], places)
