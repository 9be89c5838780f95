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

from collections import deque
from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch.bound.trajectories import Trajectories
from DroneSwarmSearch.core.grid import MOVES, SHIFTS, moves_between

Offset = tuple[int, int] | None
"""A cell (dx, dy) relative to the drone's; None without a search, or out of the drone's reach."""

History = tuple[Offset, ...]
"""The drone's cell at each remembered search, the latest action first."""

EVERYTHING = slice(None)

PRODUCTS_PER_UPDATE = 150
"""Multiplications of the matrix product that take as long as updating one value."""


class Histories:
    """What a drone can remember of its last K actions, and how an action changes it.

    A history is a tuple of K offsets, the latest action first; searching is no worse than idling.
    Of the H histories in `all`, the first has no searches. `shorter`, (H,), is each one without its
    oldest action, as a number below S; `after_search`, (S,), and `after_move`, (4, S), follow it.
    """

    def __init__(self, memory: int) -> None:
        rest_length = max(memory - 1, 0)
        nothing: History = (None,) * memory
        indices = {nothing: 0}
        shorter: dict[History, int] = {}
        after = []
        to_extend = deque([nothing])
        while to_extend:
            rest = to_extend.popleft()[:rest_length]
            if rest in shorter:
                continue
            shorter[rest] = len(shorter)
            ahead = _after_an_action(rest, memory)
            for history in ahead:
                if history not in indices:
                    indices[history] = len(indices)
                    to_extend.append(history)
            after.append([indices[history] for history in ahead])
        self.all = list(indices)
        self.shorter: Ints = np.array([shorter[history[:rest_length]] for history in self.all])
        self.after_search, *after_move = np.array(after).T
        self.after_move: Ints = np.array(after_move)


def _after_an_action(rest: History, memory: int) -> list[History]:
    """The histories after a search, and after each move, given the actions before it."""
    searched: History = ((0, 0), *rest)
    histories = [searched[:memory]]
    for dx, dy in MOVES:
        moved: list[Offset] = [None]
        for offset in rest:
            moved.append(None if offset is None else (offset[0] - dx, offset[1] - dy))
        histories.append(tuple(moved)[:memory])
    return histories


class _Grouped(NamedTuple):
    """The trajectories in one step, grouped by cell and past.

    Attributes:
        group: shape (M,): the group of each trajectory.
        past: shape (G,): the past of each group, as an index into `pasts`.
        cell: shape (G,): the cell of each group within the box, row by row.
        pasts: shape (K, P): the offsets of each past, the latest step first, see `_code`.
        box: the rows and columns of the grid that contain the cells with trajectories.
        n_cells: the number of these cells.
    """

    group: Ints
    past: Ints
    cell: Ints
    pasts: Ints
    box: tuple[slice, slice]
    n_cells: int


class RememberingDrones:
    """The best paths of drones from their start cells y * N + x, given K remembered actions.

    Sums are the weights of trajectories for their credits and searches, added up by group: an
    array of shape (2, G) for each step. A flow is a mixture of paths: the mean number of searches
    in each step, history and cell: float32, (T, H, N, N).
    """

    _spare_moves = 0  # a drone that has searched at age n has made n - 1 moves since then

    def __init__(
        self,
        trajectories: Trajectories,
        grid_size: int,
        detection: float,
        starts: Sequence[int],
        memory: int,
    ) -> None:
        self._cells, self.probabilities = trajectories
        self.detection = detection
        self._size = grid_size
        self._starts = list(starts)
        self._memory = min(memory, len(self._cells) - 1)
        self._steps = [self._grouped(step) for step in range(len(self._cells))]

    @cached_property
    def _histories(self) -> Histories:
        return Histories(self._memory)

    @property
    def _all_histories(self) -> list[History]:
        return self._histories.all

    def until(self, steps: int) -> RememberingDrones:
        """The same drones in the first steps."""
        shorter = copy(self)
        shorter._steps = self._steps[:steps]
        return shorter

    @property
    def count(self) -> int:
        """The number of drones."""
        return len(self._starts)

    @property
    def work(self) -> float:
        """The cost of the best paths, in updates of a value."""
        products: int = sum(step.pasts.shape[1] * step.n_cells for step in self._steps)
        updates = len(self._steps) * self._size**2
        return len(self._all_histories) * (updates + products / PRODUCTS_PER_UPDATE)

    def sums(self, weights: Floats, part: slice = EVERYTHING) -> list[Floats]:
        """Add up the weights of some trajectories, (2, m), by group."""
        return [
            np.array([np.bincount(step.group[part], weight, len(step.past)) for weight in weights])
            for step in self._steps
        ]

    def collected(self, flow: Singles, part: slice = EVERYTHING) -> Floats:
        """The mean credits and searches along some trajectories: (2, m)."""
        total = np.zeros((2, len(self.probabilities[part])))
        for step, credits, searches in zip(self._steps, self._credits, flow, strict=False):
            rows, columns = step.box
            within = searches[:, rows, columns].reshape(len(searches), -1)
            credited = (credits.T @ within)[step.past, step.cell]
            searched = within.sum(axis=0)[step.cell]
            total += np.take((credited, searched), step.group[part], axis=1)
        return total

    def most(self, sums: Sequence[Floats]) -> float:
        """The most that all drones can gain, rounded up."""
        size = self._size
        histories = self._histories
        values: Singles = np.zeros((len(histories.all), size, size), np.float32)
        for step, credits, step_sums in self._backward(sums):
            best = values.take(histories.after_search, axis=0)
            searched = best.take(histories.shorter, axis=0)
            for after, (here, there) in zip(histories.after_move, SHIFTS, strict=True):
                np.maximum(best[here], values.take(after, axis=0)[there], out=best[here])
            values = best.take(histories.shorter, axis=0)
            rows, columns = step.box
            searched[:, rows, columns] += self._gains(step, credits, step_sums)
            np.maximum(values, searched, out=values)
        return self._total(values[0])

    def _total(self, values: Singles) -> float:
        """The sum of the values of all drones' first cells, (N, N), rounded up."""
        total = float(values.reshape(-1)[self._starts].astype(np.float64).sum())
        # Single precision loses at most this fraction of a sum of positive numbers.
        pasts: int = max(step.pasts.shape[1] for step in self._steps)
        return total * (1.0 + (pasts + 2 * len(self._steps) + 8) * 2.0**-23)

    def soft_flow(self, sums: Sequence[Floats]) -> Singles:
        """The mixture in which a path's share is proportional to exp(what the path gains)."""
        flow, moves = self._soft_choices(sums)
        self._follow(flow, moves)
        return flow

    def _soft_choices(self, sums: Sequence[Floats]) -> tuple[Singles, Singles]:
        """The probabilities of searching, and of the moves otherwise, from the last step back.

        Returns:
            In each step, history and cell, the probability of a search, (T, H, N, N); and in each
            step and shorter history, those of the moves if there is none, (T, 4, S, N, N).
        """
        size = self._size
        histories = self._histories
        steps = len(self._steps)
        shape = (len(histories.all), size, size)
        values: Singles = np.zeros(shape, np.float32)
        searching = np.empty((steps, *shape), np.float32)
        moves = np.empty((steps, len(MOVES), len(histories.after_search), size, size), np.float32)
        number = steps
        for step, credits, step_sums in self._backward(sums):
            number -= 1
            move = moves[number]
            move[:] = -1e9
            for k, (here, there) in enumerate(SHIFTS):
                move[k][here] = values.take(histories.after_move[k], axis=0)[there]
            most = move.max(axis=0)
            move -= most
            np.exp(move, out=move)
            total = move.sum(axis=0)
            move /= total
            most += np.log(total)
            moved = most.take(histories.shorter, axis=0)
            searched = values.take(histories.after_search, axis=0).take(histories.shorter, axis=0)
            rows, columns = step.box
            searched[:, rows, columns] += self._gains(step, credits, step_sums)
            most = np.maximum(searched, moved)
            # Faster than np.logaddexp in single precision.
            values = most + np.log1p(np.exp(np.minimum(searched, moved) - most))
            np.exp(searched - values, out=searching[number])
        return searching, moves

    def _follow(self, flow: Singles, moves: Singles) -> None:
        """Turn the probabilities of `_soft_choices` into the flow of all drones, in place."""
        histories = self._histories
        shape = flow.shape[1:]
        count, size, _ = shape
        n_shorter = len(histories.after_search)
        here_now: Singles = np.zeros(shape, np.float32)
        np.add.at(here_now[0].reshape(-1), self._starts, 1.0)
        to_shorter = np.zeros((n_shorter, count), np.float32)
        to_shorter[histories.shorter, np.arange(count)] = 1.0
        for move, searching in zip(moves, flow, strict=True):
            searching *= here_now
            here_now -= searching
            leaving = (to_shorter @ here_now.reshape(count, -1)).reshape(-1, size, size)
            staying = (to_shorter @ searching.reshape(count, -1)).reshape(-1, size, size)
            here_now = np.zeros(shape, np.float32)
            here_now[histories.after_search] = staying
            move *= leaving
            for k, (here, there) in enumerate(SHIFTS):
                arriving = np.zeros_like(leaving)
                arriving[there] = move[k][here]
                here_now[histories.after_move[k]] += arriving

    def _backward(self, sums: Sequence[Floats]) -> Iterator[tuple[_Grouped, Singles, Floats]]:
        """The steps, the last one first, with their credits and sums."""
        steps = len(self._steps)
        return zip(self._steps[::-1], self._credits[:steps][::-1], sums[:steps][::-1], strict=True)

    def _grouped(self, number: int) -> _Grouped:
        """Group the trajectories in a step."""
        here = self._cells[number]
        x, y = cell_position(here, self._size)
        past = np.zeros(len(here), np.int64)
        pasts = np.zeros((0, 1), np.int64)
        codes_of_offsets = (2 * self._memory + 1) ** 2 + 1
        for age in range(1, self._memory + 1):
            offset = np.zeros(len(here), np.int64)
            if age <= number:
                earlier_x, earlier_y = cell_position(self._cells[number - age], self._size)
                dx = earlier_x - x
                dy = earlier_y - y
                near = moves_between(dx, dy) < age + self._spare_moves
                offset[near] = _code(dx[near], dy[near], self._memory)
            codes, past = _distinct(past * codes_of_offsets + offset)
            before, latest = np.divmod(codes, codes_of_offsets)
            pasts = np.vstack([pasts[:, before], latest])
        cells, cell = _distinct(here)
        codes, group = _distinct(past * len(cells) + cell)
        past_of, cell_of = np.divmod(codes, len(cells))
        columns, rows = cell_position(cells, self._size)
        top = int(rows.min())
        left = int(columns.min())
        right = int(columns.max()) + 1
        in_box = (rows - top) * (right - left) + columns - left
        return _Grouped(
            group=group.astype(np.int32),
            past=past_of,
            cell=in_box[cell_of],
            pasts=pasts,
            box=(slice(top, int(rows.max()) + 1), slice(left, right)),
            n_cells=len(cells),
        )

    @cached_property
    def _credits(self) -> list[Singles]:
        """For each step, the credit of each history for each past: float32, shape (H, P)."""
        codes = [
            [0 if offset is None else _code(*offset, self._memory) for offset in history]
            for history in self._all_histories
        ]
        searched = np.array(codes)
        by_number = self.detection * (1.0 - self.detection) ** np.arange(self._memory + 1.0)
        credits = []
        for step in self._steps:
            earlier = np.zeros((len(searched), step.pasts.shape[1]), np.uint8)
            for age, seen in enumerate(step.pasts):
                earlier += (searched[:, age, None] == seen) & (seen > 0)
            credits.append(by_number.astype(np.float32)[earlier])
        return credits

    def _gains(self, step: _Grouped, credits: Singles, sums: Floats) -> Singles:
        """The gain of searching each cell in the box with each history: shape (H, y, x)."""
        height, width = (part.stop - part.start for part in step.box)
        table = np.zeros((step.pasts.shape[1], height * width), np.float32)
        table[step.past, step.cell] = sums[0]
        gains: Singles = credits @ table
        if sums[1].any():
            gains += np.bincount(step.cell, sums[1], height * width).astype(np.float32)
        return gains.reshape(-1, height, width)


def _distinct(codes: Ints) -> tuple[Ints, Ints]:
    """The distinct codes in order, and the index of each among them; codes must not be large."""
    present = np.zeros(codes.max() + 1, np.bool_)
    present[codes] = True
    return present.nonzero()[0], (present.cumsum() - 1)[codes]


def _code(dx: Any, dy: Any, memory: int) -> Any:
    """A positive number for an offset of at most `memory` cells along each axis."""
    return (dy + memory) * (2 * memory + 1) + dx + memory + 1
