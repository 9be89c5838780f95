"""The random policy: the baseline that every other policy should beat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Ints, Singles, Words
from DroneSwarmSearch._internal.streams import episode_keys, policy_key, uniforms
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.radio import hearing
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.policies.base import BatchPolicy


class RandomPolicy(BatchPolicy):
    """Chooses each drone's action uniformly among the safe ones.

    The drones choose in turn. Searching and idling are always safe; a move is safe if no drone is
    in the cell and no earlier drone is about to enter it. In a search with a `radio_range`, drones
    take only those in range into account.

    The draws depend only on a search's seed, its episode, the step and the drone, not on the rest
    of the batch, nor on the draws of an environment with the same seed. Row i has seed i until
    `reset` sets another one; a reset without a seed starts the next episode of the same sequence.
    """

    reads_persons = False

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario)
        self._targets = Grid.of(scenario.grid_size).targets  # [cell, action]
        self._reset(rows=None, seeds=0)

    def _reset(self, rows: Ints | None, seeds: int | list[int] | None) -> None:
        if rows is None and seeds is not None:
            self._seeds: int | list[int] = seeds
            self._episode = 0  # of rows to come
            self._rows: Words = np.empty((3, 0), np.uint64)  # key, episode and step of each row
            return
        if rows is None:
            self._episode += 1
            rows = np.arange(self._rows.shape[1])
        self._add_rows(rows)
        keys, episodes, steps = self._rows
        steps[rows] = 0
        if seeds is None:
            episodes[rows] += np.uint64(1)
        else:
            given = [seeds + row for row in rows.tolist()] if isinstance(seeds, int) else seeds
            keys[rows] = [policy_key(seed) for seed in given]
            episodes[rows] = 0

    def _add_rows(self, rows: Ints) -> None:
        """Add the rows up to the last one of some rows."""
        known = self._rows.shape[1]
        count = int(rows.max(initial=-1)) + 1
        if count <= known:
            return
        seeds: int | list[int] = self._seeds
        if isinstance(seeds, int):
            seeds = [seeds + row for row in range(count)]
        seeds = [*seeds, *range(len(seeds), count)][known:count]
        new = [[policy_key(seed), np.uint64(self._episode), np.uint64(0)] for seed in seeds]
        self._rows = np.concatenate([self._rows, np.array(new).T], axis=1)

    def _act(self, rows: Ints, positions: NDArray[np.integer], matrices: Singles) -> Ints:
        drones = positions.shape[1]
        actions = np.empty((len(rows), drones), np.int64)
        self._add_rows(rows)
        uniforms = self._draw(rows, drones)
        cells = positions[..., 1].astype(np.int64) * self.scenario.grid_size + positions[..., 0]
        targets = self._targets[cells]  # [row, drone, action]
        next_cells = cells.copy()
        heard = np.ones((*cells.shape, drones), np.bool_)
        if self.scenario.radio_range is not None:
            heard = hearing(cells, self.scenario.grid_size, self.scenario.radio_range)
        moves = slice(Action.SEARCH)
        for drone in range(drones):
            safe = targets[:, drone] >= 0
            ahead = targets[:, drone, moves, None]
            unheard = ~heard[:, drone, None]
            safe[:, moves] &= ((ahead != cells[:, None]) | unheard).all(axis=-1)
            before = next_cells[:, None, :drone]
            safe[:, moves] &= ((ahead != before) | unheard[..., :drone]).all(axis=-1)
            rank = np.cumsum(safe, axis=1)  # rank among the safe actions, from 1
            drawn = (uniforms[:, drone] * rank[:, -1]).astype(np.int64) + 1
            picked = (rank == drawn[:, None]).argmax(axis=1)
            actions[:, drone] = picked
            next_cells[:, drone] = np.take_along_axis(targets[:, drone], picked[:, None], 1)[:, 0]
        return actions

    def _draw(self, rows: Ints, drones: int) -> NDArray[np.float64]:
        """A uniform number in [0, 1) for every drone in this step, shape (E, drones)."""
        keys, episodes, steps = self._rows
        first = np.multiply(steps[rows], np.uint64(drones), dtype=np.uint64)
        indices: Words = np.add.outer(first, np.arange(drones, dtype=np.uint64))
        steps[rows] += np.uint64(1)
        return uniforms(episode_keys(keys[rows], episodes[rows])[:, None], indices)
