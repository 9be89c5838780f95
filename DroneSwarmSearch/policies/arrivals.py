"""The inputs of the network "imitation": the success of searches at each drone's time of arrival.

They do not depend on the scale of the probabilities, and have one length for all grids and
numbers of drones, so one network serves them all. Turning a search by a right angle only changes
their order, see `VIEWS`, so that a network can score every direction in the same way.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Integers, Singles
from DroneSwarmSearch.core.grid import moves_between
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.layouts.crops import LENGTH, SCALES, WINDOW, CropsLayout
from DroneSwarmSearch.policies.greedy import (
    CLAIMED,
    DISCOUNT,
    WORTHWHILE_ON_ARRIVAL,
    claimed_in_turn,
    worthwhile,
)

NEAR = DISCOUNT
FAR = 0.9
"""Factors on success for each step of the way: for the best cell, and for a wider view."""

STEPS = 32  # the most steps to look ahead; farther cells count as they will be in the last of them

LEAST = 1e-5
"""The least score of an action, relative to the best one's, that is distinguished from 0."""

TINY = np.float32(1e-30)  # replaces sums of 0 in denominators

TURNS = (Action.RIGHT, Action.DOWN, Action.LEFT, Action.UP)
"""The directions of the four views, each a quarter turn to the right of the one before."""

NEAR_BORDER = 8  # distances from the border, in cells, are distinguished up to this one

_BOXES = len(SCALES) * WINDOW**2
_SCORES = LENGTH + 3 * _BOXES  # of the scores: groups of four directions and a fifth number
_GROUPS = 6
_DRIFT = _SCORES + 5 * _GROUPS
_BORDER = _DRIFT + 4
_HEADING = _BORDER + 4
_GLOBALS = _HEADING + 4

INPUTS = _GLOBALS + 6  # the number of inputs

BASELINE = (_SCORES, _SCORES + 4)
"""Two inputs: the forecast's greedy scores for flying straight ahead and for searching."""


def _views() -> NDArray[np.int64]:
    views = np.tile(np.arange(INPUTS), (4, 1))
    middle = WINDOW // 2
    right, ahead = np.mgrid[-middle : middle + 1, -middle : middle + 1]
    windows = [*range(0, LENGTH - 2, WINDOW**2), *range(LENGTH, _SCORES, WINDOW**2)]
    directions = [*range(_SCORES, _DRIFT, 5), _DRIFT, _BORDER, _HEADING]
    for turn, view in enumerate(views):
        x, y = ((ahead, right), (-right, ahead), (-ahead, -right), (right, -ahead))[turn]
        boxes = ((y + middle) * WINDOW + x + middle).reshape(-1)
        for first in windows:
            view[first : first + WINDOW**2] = first + boxes
        for first in directions:
            view[first : first + 4] = first + (np.arange(4) + turn) % 4
    return views


VIEWS = _views()
"""The order of the inputs in each view: int64, shape (4, INPUTS). `inputs[..., VIEWS[k]]` is what a
drone observes that looks in direction `TURNS[k]`: x points straight ahead and y to its right."""


class Arrivals:
    """The inputs of all drones of several searches with one grid size and number of drones.

    Each drone has `INPUTS` numbers:

    - the layout "crops" (`CropsLayout`) of the success of searches now, with 0 in place of the
      maximum's logarithm;
    - windows as in that layout, without the drones: of the success on arrival, times ``FAR`` to
      the power of the distance; of the same in the cells that no other drone is closer to; and of
      the discounted sum of the successes on arrival and later, where a person drifts past;
    - six groups of scores of the directions in `TURNS`. In the first five, the fifth number is
      the score of searching, and each is the logarithm relative to the greatest: the best
      target on that side, discounted by ``NEAR``, and the best cell, discounted by ``FAR``, both
      without the cells that other drones claim; the sums over all cells on that side in the first
      two windows; and the best cell for waiting. The last group shows which moves lead closer to
      the drone's own claim, and how far that is;
    - the mean drift towards and the distance from the border in the directions in `TURNS`, and
      which of them the drone moved in last;
    - the remaining steps, probability of detection, number of drones, size of the likely area,
      and that size relative to the searches left, on logarithmic scales except for the second;
      and the discount of the best cell.

    Drones claim targets in turn (`greedy.claimed_in_turn`): cells with at least
    ``WORTHWHILE_ON_ARRIVAL`` times the success of the drone's best cell, or any if none is left.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        self.grid_size = grid_size
        self.n_drones = n_drones
        self._crops = CropsLayout(grid_size, n_drones)
        self._windows = CropsLayout(grid_size, 1)
        axis = np.arange(grid_size)
        self._axis = axis.astype(np.float32)
        self._offsets = np.abs(axis[:, None] - axis)
        self._cells = axis[:, None] * grid_size + axis
        exponents = np.arange(2 * grid_size)
        self._discounts = [(factor**exponents).astype(np.float32) for factor in (NEAR, FAR)]
        # [drone's coordinate, cell's coordinate]: whether the cell is on that side.
        self._higher = axis > axis[:, None]
        self._lower = axis < axis[:, None]

    def steps(self, remaining: int) -> int:
        """How many steps to look ahead, given the steps remaining until the time limit."""
        return min(remaining - 1, 2 * self.grid_size - 2, STEPS)

    def inputs(
        self,
        ahead: NDArray[np.floating],
        positions: Integers,
        remaining: Integers,
        limit: int,
        detections: NDArray[np.floating],
        headings: Integers,
    ) -> Singles:
        """The inputs of every drone: float32, shape (searches, n, INPUTS).

        Args:
            ahead: the probability of success (POS) of a search of each cell, now and in the next
                steps, see `BeliefTracker.success_ahead`; shape (searches, steps + 1, N, N), at any
                scale. If no search can succeed now, all cells count as equal.
            positions: every drone's (x, y), shape (searches, n, 2).
            remaining: steps until the time limit, at least 1; shape (searches,).
            limit: the time limit, in steps.
            detections: the probability of detection, shape (searches,).
            headings: every drone's latest move, an `Action`, or any other before the first;
                shape (searches, n).
        """
        searches = len(ahead)
        n = self.n_drones
        size = self.grid_size
        out = np.empty((searches, n, INPUTS), np.float32)
        flat = out.reshape(-1, INPUTS)
        # The best cell now is 1; without a possible success, all cells are.
        highest = ahead[:, 0].max(axis=(1, 2))[:, None, None, None]
        relative = ahead / np.where(highest > 0.0, highest, 1.0)
        ahead = np.where(highest > 0.0, relative, 1.0).astype(np.float32)
        fraction = (remaining / limit).astype(np.float32)
        self._crops.write(positions, ahead[:, 0], fraction, out[..., :LENGTH])
        out[..., LENGTH - 1] = 0.0

        x, y = positions.reshape(-1, 2).T
        distances = self._offsets[y][:, :, None] + self._offsets[x][:, None, :]
        too_far = distances >= remaining.repeat(n)[:, None, None]
        later = ahead * self._discounts[1][: ahead.shape[1], None, None]
        for step in reversed(range(ahead.shape[1] - 1)):
            later[:, step] += later[:, step + 1]
        arrivals, waits = (self._on_arrival(values, distances) for values in (ahead, later))
        arrivals[too_far] = waits[too_far] = 0.0
        far = arrivals * self._discounts[1].take(distances)
        by_search = distances.reshape(searches, n, size, size)
        closest = by_search == by_search.min(axis=1, keepdims=True)
        own = far * closest.reshape(distances.shape)
        sums = [self._on_each_side(values, x, y, np.sum) for values in (far, own)]
        for place, values in enumerate((far, own, waits)):
            first = LENGTH + place * _BOXES
            windows = flat[:, None, first : first + _BOXES]
            self._windows.write_windows(np.stack([x, y], 1)[:, None], values, windows)

        near = worthwhile(arrivals, WORTHWHILE_ON_ARRIVAL) * self._discounts[0].take(distances)
        claims = claimed_in_turn(near.reshape(searches, n, -1))
        self._take_off(claims, near, far)
        best = [self._on_each_side(values, x, y, np.max) for values in (near, far)]
        sums.append(self._on_each_side(waits, x, y, np.max))
        scores = flat[:, _SCORES:_DRIFT].reshape(-1, _GROUPS, 5)
        for place, values in enumerate((*best, *sums)):
            relative = values / np.maximum(values.max(axis=1, keepdims=True), TINY)
            scores[:, place] = np.log(np.maximum(relative, np.float32(LEAST))) / 2
        down = claims.reshape(-1) // size - y
        right = claims.reshape(-1) % size - x
        scores[:, -1, :4] = np.stack([right, down, -right, -down], 1) > 0
        scores[:, -1, 4] = moves_between(right, down) / np.float32(size)

        drift_x, drift_y = self._drift(ahead)
        drift = np.stack([drift_x, drift_y, -drift_x, -drift_y], 1)
        out[..., _DRIFT:_BORDER] = drift.clip(0.0)[:, None]
        border = np.stack([size - 1 - x, size - 1 - y, x, y], 1)
        flat[:, _BORDER:_HEADING] = border.clip(0, NEAR_BORDER) / NEAR_BORDER

        out[..., _HEADING:_GLOBALS] = headings[..., None] == np.array(TURNS)

        now = ahead[:, 0].reshape(searches, -1)
        squares = np.maximum(np.square(now).sum(axis=1), TINY)
        area = np.maximum(now.sum(axis=1) ** 2 / squares, 1.0)  # of as many equal cells
        effort = n * remaining * np.maximum(detections, 0.01)
        common = out[..., _GLOBALS:]
        common[..., 0] = (np.log(remaining) / 4)[:, None]
        common[..., 1] = detections[:, None]
        common[..., 2] = np.log(n) / 3
        common[..., 3] = (np.log(area) / 4)[:, None]
        common[..., 4] = (np.log(area / effort) / 4)[:, None]
        highest = np.maximum(arrivals.max(axis=(1, 2)), TINY)
        common[..., 5] = (best[1].max(axis=1) / highest).reshape(searches, n)
        return out

    def _on_arrival(self, ahead: Singles, distances: Integers) -> Singles:
        """Each cell's value in `ahead` when each drone arrives: float32, shape (drones, N, N)."""
        searches, steps, *_ = ahead.shape
        search = np.arange(searches).repeat(self.n_drones)[:, None, None]
        step = search * steps + np.minimum(distances, steps - 1)
        arrivals: Singles = ahead.reshape(-1).take(step * self.grid_size**2 + self._cells)
        return arrivals

    def _take_off(self, claims: Integers, *maps: Singles) -> None:
        """Lower each drone's values, (drones, N, N), of the cells that the others claim."""
        drones = np.arange(claims.size)
        own = claims.reshape(-1)
        for shift in range(1, self.n_drones):
            other = np.roll(claims, shift, axis=1).reshape(-1)
            differs = other != own
            for values in maps:
                values.reshape(len(own), -1)[drones[differs], other[differs]] *= CLAIMED

    def _on_each_side(self, values: Singles, x: Integers, y: Integers, reduce: Any) -> Singles:
        """The maximum or sum (`reduce`) on each drone's side of each direction, and in its cell.

        The values of each cell to each drone have the shape (drones, N, N) and are at least 0.
        """
        columns = reduce(values, axis=1)
        rows = reduce(values, axis=2)
        parts = [
            reduce(line * side[at], axis=1)
            for side in (self._higher, self._lower)
            for line, at in ((columns, x), (rows, y))
        ]
        return np.stack([*parts, values[np.arange(len(x)), y, x]], 1)

    def _drift(self, ahead: Singles) -> tuple[Singles, Singles]:
        """The mean drift over the next steps along x and y, in cells per step: (searches,)."""
        last = min(4, ahead.shape[1] - 1)
        now = ahead[:, 0]
        later = ahead[:, last]
        before, after = (
            [
                part.sum(axis=axis) @ self._axis / np.maximum(part.sum(axis=(1, 2)), TINY)
                for axis in (1, 2)
            ]
            for part in (now, later)
        )
        return (after[0] - before[0]) / max(last, 1), (after[1] - before[1]) / max(last, 1)
