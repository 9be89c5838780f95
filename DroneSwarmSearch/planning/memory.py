"""Drones that remember their last K actions: their best paths, and what paths collect.

A path gains from every search, but less from a trajectory of the person that the drone has
already searched within its last K actions. With n such searches, another one finds the fraction
q (1 - q)^n of the trajectory: its *credit*. The credits of a path along a trajectory add up to
at least the probability of finding the person there, 1 - (1 - q)^k for k searches, because the
drone may forget searches but never invents any.

The best path is a dynamic programme whose state is a cell and a *history*: the drone's cell at
each remembered search, relative to its current one; 2, 7, 25, 88 and 309 for K = 1 to 5.
Trajectories in a step are grouped by cell and *past*: the person's relative cell at each
remembered step, as far as the drone can have searched it. The credits are then one matrix
product. (Relaxations that remember recent visits: R. Baldacci, A. Mingozzi and R. Roberti,
Operations Research 59:1269, 2011, for vehicle routes.)
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch.planning.paths import Path
from DroneSwarmSearch.planning.trajectories import Trajectories

Offset = tuple[int, int] | None
"""A cell (dx, dy) relative to the drone's; None without a search, or out of the drone's reach."""

MOVES = (-1, 0), (1, 0), (0, -1), (0, 1)
"""The displacements (dx, dy) of a drone: left, right, up, down."""

PRODUCTS_PER_UPDATE = 150
"""Multiplications of the matrix product that take as long as updating one value."""


class Histories:
    """What a drone can remember of its last K actions, and how an action changes it.

    A history is a tuple of K offsets, the latest action first; searching is no worse than idling.
    Of the H histories in `all`, the first has no searches. `shorter`, (H,), is each one without its
    oldest action, as a number below S; `after_search`, (S,), and `after_move`, (4, S), follow it.
    """

    def __init__(self, memory: int) -> None:
        kept = max(memory - 1, 0)
        indices: dict[tuple[Offset, ...], int] = {(None,) * memory: 0}
        shorter: dict[tuple[Offset, ...], int] = {}
        self.all, after = [*indices], []
        for history in self.all:  # grows in the loop
            rest = history[:kept]
            if rest in shorter:
                continue
            shorter[rest] = len(shorter)
            ahead: list[tuple[Offset, ...]] = [((0, 0), *rest)[:memory]]
            for dx, dy in MOVES:
                seen = [None if each is None else (each[0] - dx, each[1] - dy) for each in rest]
                ahead.append((None, *seen)[:memory])
            for each in ahead:
                if each not in indices:
                    indices[each] = len(indices)
                    self.all.append(each)
            after.append([indices[each] for each in ahead])
        self.shorter: Ints = np.array([shorter[each[:kept]] for each in self.all])
        self.after_search, *after_move = np.array(after).T
        self.after_move: Ints = np.array(after_move)


class _Step(NamedTuple):
    """The trajectories in one step, grouped by cell and past.

    Attributes:
        group: shape (M,): the group of each trajectory.
        past: shape (G,): the past of each group, as an index into `pasts`.
        place: shape (G,): the cell of each group within the box, row by row.
        pasts: shape (K, P): the offsets of each past, the latest step first, see `_code`.
        box: the rows and columns of the grid that contain the cells with trajectories.
        n_cells: the number of these cells.
    """

    group: Ints
    past: Ints
    place: Ints
    pasts: Ints
    box: tuple[slice, slice]
    n_cells: int


class RememberingDrones:
    """The best paths of drones from their start cells y * N + x, given K remembered actions."""

    def __init__(
        self,
        trajectories: Trajectories,
        grid_size: int,
        detection: float,
        starts: Sequence[int],
        memory: int,
    ) -> None:
        self._cells, self.probabilities = trajectories
        self.detection, self._size, self._starts = detection, grid_size, list(starts)
        self._memory = min(memory, len(self._cells) - 1)
        self._histories = Histories(self._memory)
        y, x = np.divmod(self._cells, grid_size)
        self._steps = [self._grouped(here, x, y, step) for step, here in enumerate(self._cells)]
        self._values: Singles = np.zeros((0, 0, 0), np.float32)

    def until(self, steps: int) -> RememberingDrones:
        """The same drones in the first steps."""
        shorter = copy(self)
        shorter._steps = self._steps[:steps]
        return shorter

    @property
    def work(self) -> float:
        """The cost of computing the best paths once, in updates of a value."""
        products: int = sum(step.pasts.shape[1] * step.n_cells for step in self._steps)
        updates = len(self._steps) * self._size**2
        return len(self._histories.all) * (updates + products / PRODUCTS_PER_UPDATE)

    def __call__(self, weights: Floats) -> tuple[float, list[Path]]:
        """The most that all drones can gain, rounded up, and a path for each that gains it.

        The weights of each trajectory, for its credits and for its searches, have the shape (2, M).
        """
        self._compute_values(weights)
        gained = float(self._values[0, 0, self._starts].astype(np.float64).sum())
        # Single precision loses at most this fraction of a sum of positive numbers.
        pasts: int = max(step.pasts.shape[1] for step in self._steps)
        gained *= 1.0 + (pasts + 2 * len(self._steps) + 8) * 2.0**-23
        return gained, [self._path(start) for start in self._starts]

    def collected(self, paths: Sequence[Path], shares: Floats | None = None) -> Floats:
        """The credits and searches that paths collect along each trajectory: (2, M)."""
        total, q = np.zeros((2, len(self.probabilities))), self.detection
        shares = np.ones(len(paths)) if shares is None else shares
        for path, share in zip(paths, shares, strict=True):
            # Whether the path has searched each trajectory, in this step and the last K ones.
            searched = np.zeros((self._memory + 1, len(self.probabilities)), np.uint8)
            for number, searches in enumerate(path.searches):
                now = searched[number % len(searched)]
                now[:] = 0
                if searches:
                    met = np.flatnonzero(self._cells[number] == path.cells[number])
                    total[0, met] += share * q * (1.0 - q) ** searched[:, met].sum(axis=0)
                    total[1, met] += share
                    now[met] = 1
        return total

    def _grouped(self, here: Ints, x: Ints, y: Ints, number: int) -> _Step:
        """Group the trajectories in a step."""
        past, pasts = np.zeros(len(here), np.int64), np.zeros((0, 1), np.int64)
        codes_of_offsets = (2 * self._memory + 1) ** 2 + 1
        for age in range(1, self._memory + 1):
            offset = np.zeros(len(here), np.int64)
            if age <= number:
                dx, dy = x[number - age] - x[number], y[number - age] - y[number]
                near = abs(dx) + abs(dy) < age
                offset[near] = _code(dx[near], dy[near], self._memory)
            codes, past = _distinct(past * codes_of_offsets + offset)
            before, latest = np.divmod(codes, codes_of_offsets)
            pasts = np.vstack([pasts[:, before], latest])
        cells, cell = _distinct(here)
        codes, group = _distinct(past * len(cells) + cell)
        past_of, cell_of = np.divmod(codes, len(cells))
        rows, columns = np.divmod(cells, self._size)
        top, left, right = int(rows.min()), int(columns.min()), int(columns.max()) + 1
        box = slice(top, int(rows.max()) + 1), slice(left, right)
        place = ((rows - top) * (right - left) + columns - left)[cell_of]
        return _Step(group, past_of, place, pasts, box, len(cells))

    @cached_property
    def _credits(self) -> list[Singles]:
        """For each step, the credit of each history for each past: float32, shape (H, P)."""
        searched = np.array(
            [
                [0 if offset is None else _code(*offset, self._memory) for offset in history]
                for history in self._histories.all
            ]
        )
        by_number = self.detection * (1.0 - self.detection) ** np.arange(self._memory + 1.0)
        credits = []
        for step in self._steps:
            earlier = np.zeros((len(searched), step.pasts.shape[1]), np.uint8)
            for age, seen in enumerate(step.pasts):
                earlier += (searched[:, age, None] == seen) & (seen > 0)
            credits.append(by_number.astype(np.float32)[earlier])
        return credits

    def _compute_values(self, weights: Floats) -> None:
        """Compute the most that a drone can gain from each step, history and cell on."""
        size, histories = self._size, self._histories
        shape = len(self._steps) + 1, len(histories.all), size**2
        if self._values.shape != shape:
            self._values = np.zeros(shape, np.float32)
        for number in range(len(self._steps) - 1, -1, -1):
            step, here = self._steps[number], self._values[number].reshape(-1, size, size)
            ahead = self._values[number + 1].reshape(-1, size, size)
            searched = ahead.take(histories.after_search, axis=0)
            best = searched.copy()
            moved = (ahead.take(after, axis=0) for after in histories.after_move)
            np.maximum(best[:, :, 1:], next(moved)[:, :, :-1], out=best[:, :, 1:])
            np.maximum(best[:, :, :-1], next(moved)[:, :, 1:], out=best[:, :, :-1])
            np.maximum(best[:, 1:], next(moved)[:, :-1], out=best[:, 1:])
            np.maximum(best[:, :-1], next(moved)[:, 1:], out=best[:, :-1])
            best.take(histories.shorter, axis=0, out=here, mode="clip")
            rows, columns = step.box
            gains = self._gains(step, self._credits[number], weights)
            gains += searched[:, rows, columns].take(histories.shorter, axis=0)
            within = here[:, rows, columns]
            np.maximum(within, gains, out=within)

    def _gains(self, step: _Step, credits: Singles, weights: Floats) -> Singles:
        """The gain of searching each cell in the box with each history: shape (H, y, x)."""
        for_credit, for_search = weights
        height, width = (each.stop - each.start for each in step.box)
        table = np.zeros((step.pasts.shape[1], height * width), np.float32)
        table[step.past, step.place] = np.bincount(step.group, for_credit, len(step.past))
        gains: Singles = credits @ table
        if for_search.any():
            in_groups = np.bincount(step.group, for_search, len(step.past))
            gains += np.bincount(step.place, in_groups, height * width).astype(np.float32)
        return gains.reshape(-1, height, width)

    def _path(self, start: int) -> Path:
        """A path that gains as much as possible. Ties go to moving left, right, up and down."""
        n, size, histories = len(self._steps), self._size, self._histories
        cells, searches = np.empty(n + 1, np.int64), np.zeros(n, np.bool_)
        cells[0] = here = start
        history = 0
        for number in range(n):
            y, x = divmod(here, size)
            shorter = histories.shorter[history]
            best, target, remembered = -1.0, here, 0
            for (dx, dy), after in zip(MOVES, histories.after_move[:, shorter], strict=True):
                if 0 <= x + dx < size and 0 <= y + dy < size:
                    cell = here + dy * size + dx
                    value = self._values[number + 1, after, cell]
                    if value > best:
                        best, target, remembered = value, cell, after
            if self._values[number, history, here] > best:
                searches[number] = True
                target, remembered = here, histories.after_search[shorter]
            cells[number + 1] = here = target
            history = remembered
        return Path(cells, searches)


def _distinct(codes: Ints) -> tuple[Ints, Ints]:
    """The distinct codes in order, and the place of each among them; codes must not be large."""
    present = np.zeros(codes.max() + 1, np.bool_)
    present[codes] = True
    return present.nonzero()[0], (present.cumsum() - 1)[codes]


def _code(dx: Any, dy: Any, memory: int) -> Any:
    """A positive number for an offset of at most `memory` cells along each axis."""
    return (dy + memory) * (2 * memory + 1) + dx + memory + 1
