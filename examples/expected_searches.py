"""Searches in expectation, on which train_imitation.py trains.

Nobody is found, and each search pays its probability of success. With one person, everything
before the find follows from the drones' actions. What a search removes from the unnormalised
belief is the probability that it finds the person then. These rewards add up to the episode's
probability of success; with several persons, the mean over them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.drift.model import forecasts_of
from DroneSwarmSearch.policies.arrivals import STEPS, Arrivals


class ExpectedSearches:
    """Searches with one grid size, number of drones and time limit, stepped together.

    Beliefs are float32, and move as those of `drift.belief` do.

    Args:
        scenarios: their parameters. The persons of a search have the same probability of
            detection.
        drones_positions: every drone's start cell (x, y), shape (searches, n, 2).

    Attributes:
        grid_size: cells along each side, N.
        n_drones: drones in each search, n.
        timestep_limit: steps in a search.
        step: completed steps.
        cells: every drone's cell, y * N + x: shape (searches, n).
        found: the probability of success (POS) so far: float64, shape (searches,).

    Raises:
        ValueError: the scenarios differ in size, number of drones or time limit, persons of one
            search differ in their probability of detection, or a position is invalid.
    """

    def __init__(self, scenarios: Sequence[Scenario], drones_positions: ArrayLike) -> None:
        if not scenarios:
            raise ValueError("scenarios must hold at least one Scenario, got none")
        sizes = {(each.grid_size, each.n_drones, each.timestep_limit) for each in scenarios}
        if len(sizes) > 1 or any(len({*each.detections}) > 1 for each in scenarios):
            raise ValueError(
                "scenarios must have one grid_size, n_drones and timestep_limit, and each one "
                f"probability of detection, got {scenarios!r}"
            )
        [(self.grid_size, self.n_drones, self.timestep_limit)] = sizes
        places = zip(scenarios, np.asarray(drones_positions), strict=True)
        self.cells: NDArray[np.integer] = np.array(
            [each.drone_cells(positions) for each, positions in places]
        )
        self.step = 0
        self.found = np.zeros(len(scenarios))
        self._headings = np.full(self.cells.shape, int(Action.IDLE))
        self._detections = np.array([each.detections[0] for each in scenarios], np.float32)
        self._arrivals = Arrivals(self.grid_size, self.n_drones)
        self._neighbours = Grid.of(self.grid_size).targets  # [cell, action]
        models = [each.forecasts() for each in scenarios]
        last = self.timestep_limit + STEPS
        self._forecasts, numbers = forecasts_of(
            [model for each in models for model in each],
            last=last,
            keeps_matrices=False,
        )
        self._forecasts.reach(last)
        # The model of each person in each search; a search with fewer persons has zeros.
        counts = np.array([len(each) for each in models])
        is_person = np.arange(counts.max()) < counts[:, None]
        by_search = np.zeros(is_person.shape, np.int64)
        by_search[is_person] = numbers
        self._numbers = by_search.T.reshape(-1)  # [person, search], flat
        joint = self._forecasts.joint(self._numbers)
        joint *= (is_person / counts[:, None]).T.reshape(-1, 1, 1)
        # [layer, place, person and search]
        self._beliefs: Any = np.moveaxis(joint, 0, -1).astype(np.float32, order="C")

    def _drift(self, beliefs: Any, step: int) -> None:
        """Let the beliefs drift by a step, in place."""
        self._forecasts.drift(beliefs, step * self._forecasts.count + self._numbers)

    @property
    def positions(self) -> NDArray[np.integer]:
        """Every drone's (x, y), shape (searches, n, 2)."""
        return np.stack([self.cells % self.grid_size, self.cells // self.grid_size], -1)

    def inputs(self) -> NDArray[np.float32]:
        """What every drone observes, see `Arrivals`: float32, shape (searches, n, INPUTS)."""
        remaining = self.timestep_limit - self.step
        steps = self._arrivals.steps(remaining)
        size = self.grid_size
        count = len(self.cells)
        ahead = np.empty((count, steps + 1, size, size), np.float32)
        beliefs = self._beliefs.copy()
        for step in range(steps + 1):
            if step:
                self._drift(beliefs, self.step + step - 1)
            maps = self._forecasts.map(beliefs, self._numbers).reshape(size, size, -1, count)
            ahead[:, step] = maps.sum(axis=2).transpose(2, 0, 1)
        return self._arrivals.inputs(
            ahead,
            self.positions,
            np.full(count, remaining),
            self.timestep_limit,
            self._detections,
            self._headings,
        )

    def advance(self, actions: NDArray[np.integer]) -> NDArray[np.float64]:
        """Advance all searches by one step; drones must neither collide nor leave the grid.

        Args:
            actions: see `Action`, shape (searches, n).

        Returns:
            The probability of success that each drone's action adds: float64, shape (searches, n).
        """
        rewards = np.zeros(actions.shape)
        search, drone = (actions == Action.SEARCH).nonzero()
        detections = self._detections[search]
        columns = np.arange(len(self._numbers)).reshape(-1, len(self.cells))[:, search]
        cells = np.broadcast_to(self.cells[search, drone], columns.shape)
        where = slice(None), self._forecasts.slots(self._numbers[columns], cells), columns
        before = self._beliefs[where]  # [layer, person, search]; no two drones are in one cell
        rewards[search, drone] = detections * before.sum(axis=(0, 1))
        self._beliefs[where] = (1.0 - detections) * before
        self.found += rewards.sum(axis=1)
        self.cells = self._neighbours[self.cells, actions]
        self._headings = np.where(actions < Action.SEARCH, actions, self._headings)
        self._drift(self._beliefs, self.step)
        self.step += 1
        return rewards
