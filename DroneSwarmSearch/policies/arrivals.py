"""The inputs of the network "imitation": the success of searches at each drone's time of arrival.

They do not depend on the scale of the probabilities, and have one length for all grids and
numbers of drones, so one network serves them all. Turning a search by a right angle only changes
their order, see `VIEWS`, so that a network can score every direction in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Integers, Singles
from DroneSwarmSearch._internal.cells import cell_number, cell_position
from DroneSwarmSearch.core.grid import moves_between
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.layouts.crops import LENGTH, SCALES, WINDOW, CropsLayout
from DroneSwarmSearch.layouts.layout import Sight
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


@dataclass(frozen=True, eq=False)
class _Values:
    """What each cell is worth to each drone, all (drones, N, N); drones of all searches in a row.

    Attributes:
        x, y: each drone's cell, (drones,).
        distances: moves to the cell.
        arrivals: the success of a search on arrival.
        far: the same, times ``FAR`` to the power of the distance.
        own: the same in the cells that no other drone is closer to, else 0.
        waits: the discounted sum of the successes on arrival and later.
    """

    x: Integers
    y: Integers
    distances: Integers
    arrivals: Singles
    far: Singles
    own: Singles
    waits: Singles


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
        self._cells = cell_number(axis, axis[:, None], grid_size)
        exponents = np.arange(2 * grid_size)
        self._near = (NEAR**exponents).astype(np.float32)  # by distance
        self._far = (FAR**exponents).astype(np.float32)
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
            ahead: what a search of each cell gains, now and in the next steps, see `SearchGains`;
                shape (searches, steps + 1, N, N), at any scale. If no search can succeed now, all
                cells count as equal.
            positions: every drone's (x, y), shape (searches, n, 2).
            remaining: steps until the time limit, at least 1; shape (searches,).
            limit: the time limit, in steps.
            detections: the probability of detection, shape (searches,).
            headings: every drone's latest move, an `Action`, or any other before the first;
                shape (searches, n).
        """
        # The best cell now is 1; without a possible success, all cells are.
        highest = ahead[:, 0].max(axis=(1, 2))[:, None, None, None]
        relative = ahead / np.where(highest > 0.0, highest, 1.0)
        ahead = np.where(highest > 0.0, relative, 1.0).astype(np.float32)

        out = np.empty((len(ahead), self.n_drones, INPUTS), np.float32)
        self._write_crops(out, ahead, positions, remaining / limit)
        values = self._values(ahead, positions, remaining)
        self._write_windows(out, values)
        best = self._write_scores(out, values)
        self._write_surroundings(out, ahead, positions, headings)
        self._write_globals(out, ahead, remaining, detections)
        highest_on_arrival = np.maximum(values.arrivals.max(axis=(1, 2)), TINY)
        discount = best.max(axis=1) / highest_on_arrival
        out[..., -1] = discount.reshape(out.shape[:2])
        return out

    def _write_crops(
        self, out: Singles, ahead: Singles, positions: Integers, left: NDArray[np.floating]
    ) -> None:
        """Write the layout "crops" of the success of searches now."""
        crops = out[..., :LENGTH]
        self._crops.write(Sight(positions, ahead[:, :1], left.astype(np.float32)), crops)
        crops[..., -1] = 0.0

    def _values(self, ahead: Singles, positions: Integers, remaining: Integers) -> _Values:
        """What each cell is worth to each drone."""
        x, y = positions.reshape(-1, 2).T
        distances = self._offsets[y][:, :, None] + self._offsets[x][:, None, :]
        later = ahead * self._far[: ahead.shape[1], None, None]
        for step in reversed(range(ahead.shape[1] - 1)):
            later[:, step] += later[:, step + 1]
        arrivals = self._on_arrival(ahead, distances)
        waits = self._on_arrival(later, distances)
        too_far = distances >= remaining.repeat(self.n_drones)[:, None, None]
        arrivals[too_far] = 0.0
        waits[too_far] = 0.0
        far = arrivals * self._far.take(distances)
        by_search = distances.reshape(len(ahead), self.n_drones, *distances.shape[1:])
        is_closest = by_search == by_search.min(axis=1, keepdims=True)
        return _Values(
            x=x,
            y=y,
            distances=distances,
            arrivals=arrivals,
            far=far,
            own=far * is_closest.reshape(distances.shape),
            waits=waits,
        )

    def _write_windows(self, out: Singles, values: _Values) -> None:
        """Write the windows of what is best far away, of the drone's own cells, and for waiting."""
        flat = out.reshape(-1, INPUTS)
        positions = np.stack([values.x, values.y], 1)[:, None]
        for number, shown in enumerate((values.far, values.own, values.waits)):
            first = LENGTH + number * _BOXES
            windows = flat[:, None, first : first + _BOXES]
            self._windows.write_windows(positions, shown, windows)

    def _write_scores(self, out: Singles, values: _Values) -> Singles:
        """Write the scores of the directions; returns those of the best cell, (drones, 5)."""
        x = values.x
        y = values.y
        searches = len(out)
        # The sums come first, because claims then lower what is far.
        sum_of_far = self._on_each_side(values.far, x, y, np.sum)
        sum_of_own = self._on_each_side(values.own, x, y, np.sum)
        targets = worthwhile(values.arrivals, WORTHWHILE_ON_ARRIVAL)
        near = targets * self._near.take(values.distances)
        claims = claimed_in_turn(near.reshape(searches, self.n_drones, -1))
        self._take_off(claims, near, values.far)
        best_target = self._on_each_side(near, x, y, np.max)
        best_cell = self._on_each_side(values.far, x, y, np.max)
        best_wait = self._on_each_side(values.waits, x, y, np.max)
        groups = (best_target, best_cell, sum_of_far, sum_of_own, best_wait)

        scores = out.reshape(-1, INPUTS)[:, _SCORES:_DRIFT].reshape(-1, _GROUPS, 5)
        for number, group in enumerate(groups):
            relative = group / np.maximum(group.max(axis=1, keepdims=True), TINY)
            scores[:, number] = np.log(np.maximum(relative, np.float32(LEAST))) / 2
        column, row = cell_position(claims.reshape(-1), self.grid_size)
        down = row - y
        right = column - x
        scores[:, -1, :4] = np.stack([right, down, -right, -down], 1) > 0
        scores[:, -1, 4] = moves_between(right, down) / np.float32(self.grid_size)
        return best_cell

    def _write_surroundings(
        self, out: Singles, ahead: Singles, positions: Integers, headings: Integers
    ) -> None:
        """Write the drift, the distances from the border, and the latest moves, by direction."""
        drift_x, drift_y = self._drift(ahead)
        drift = np.stack([drift_x, drift_y, -drift_x, -drift_y], 1)
        out[..., _DRIFT:_BORDER] = drift.clip(0.0)[:, None]
        x = positions[..., 0]
        y = positions[..., 1]
        last = self.grid_size - 1
        border = np.stack([last - x, last - y, x, y], -1)
        out[..., _BORDER:_HEADING] = border.clip(0, NEAR_BORDER) / NEAR_BORDER
        out[..., _HEADING:_GLOBALS] = headings[..., None] == np.array(TURNS)

    def _write_globals(
        self, out: Singles, ahead: Singles, remaining: Integers, detections: NDArray[np.floating]
    ) -> None:
        """Write what all drones of a search have in common."""
        now = ahead[:, 0].reshape(len(ahead), -1)
        squares = np.maximum(np.square(now).sum(axis=1), TINY)
        area = np.maximum(now.sum(axis=1) ** 2 / squares, 1.0)  # of as many equal cells
        effort = self.n_drones * remaining * np.maximum(detections, 0.01)
        common = out[..., _GLOBALS:]
        common[..., 0] = (np.log(remaining) / 4)[:, None]
        common[..., 1] = detections[:, None]
        common[..., 2] = np.log(self.n_drones) / 3
        common[..., 3] = (np.log(area) / 4)[:, None]
        common[..., 4] = (np.log(area / effort) / 4)[:, None]

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
        x_before, y_before = self._mean_cell(ahead[:, 0])
        x_after, y_after = self._mean_cell(ahead[:, last])
        steps = max(last, 1)
        return (x_after - x_before) / steps, (y_after - y_before) / steps

    def _mean_cell(self, maps: Singles) -> tuple[Singles, Singles]:
        """The mean x and y of maps, (searches, N, N): each (searches,)."""
        total = np.maximum(maps.sum(axis=(1, 2)), TINY)
        x: Singles = maps.sum(axis=1) @ self._axis / total
        y: Singles = maps.sum(axis=2) @ self._axis / total
        return x, y
