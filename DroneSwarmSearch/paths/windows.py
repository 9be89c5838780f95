"""What a drone's searches in a few steps gain, given all other searches of a plan.

Searches in L steps change the passes of the other steps and cells only near them. A drone stays in
a box, its reach, and a person who leaves the box must come back to be searched again, so a margin
of L / 2 cells makes the passes exact. A person whose drift model has no `transitions` may move
farther, and gets all of the mass. Single precision suffices to choose among candidates.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number, cell_position
from DroneSwarmSearch.core.grid import Grid
from DroneSwarmSearch.paths.passes import Passes

Index = tuple[Any, ...]  # of an array


class Boxes(NamedTuple):
    """K boxes of one shape on a grid: the first row and the first column of each, (K,)."""

    top: Ints
    left: Ints
    height: int
    width: int
    size: int

    @classmethod
    def around(cls, starts: Ints, goals: Ints, moves: int, margin: int, size: int) -> Boxes:
        """The cells on the ways from some cells to others, (K, ...), in some moves, and a margin.

        A goal of -1 stands for all cells within reach.
        """
        is_anywhere = goals < 0
        spare_moves = (moves - Grid.of(size).distance(starts, goals)) // 2
        slack = np.where(is_anywhere, moves, spare_moves)
        goals = np.where(is_anywhere, starts, goals)
        first: list[Ints] = []
        lengths: list[int] = []
        axes = zip(cell_position(starts, size), cell_position(goals, size), strict=True)
        for start, goal in axes:
            low = (np.minimum(start, goal) - slack).min(axis=1) - margin
            high = (np.maximum(start, goal) + slack).max(axis=1) + margin
            length = min(int((high - low).max()) + 1, size)
            lengths.append(length)
            first.append(np.clip(low, 0, size - length))
        left, top = first
        width, height = lengths
        return cls(top, left, height, width, size)

    @property
    def rows(self) -> Ints:
        """The rows of each box: (K, height)."""
        rows: Ints = self.top[:, None] + np.arange(self.height)
        return rows

    @property
    def columns(self) -> Ints:
        """The columns of each box: (K, width)."""
        columns: Ints = self.left[:, None] + np.arange(self.width)
        return columns

    def indices(self, cells: Ints) -> Ints:
        """The indices y * width + x in the boxes of cells on the grid, (..., K); -1 if outside."""
        column, row = cell_position(cells, self.size)
        x = column - self.left
        y = row - self.top
        is_inside = (y >= 0) & (y < self.height) & (x >= 0) & (x < self.width)
        indices: Ints = np.where(is_inside, cell_number(x, y, self.width), -1)
        return indices

    def cells(self, indices: Ints) -> Ints:
        """The cells on the grid of indices in the boxes, (..., K, m)."""
        x, y = cell_position(indices, self.width)
        return cell_number(x + self.left[:, None], y + self.top[:, None], self.size)

    def meet(self, box: int) -> Flags:
        """Whether each box has a cell in common with one of them: (K,)."""
        by_row = abs(self.top - self.top[box]) < self.height
        by_column = abs(self.left - self.left[box]) < self.width
        meets: Flags = by_row & by_column
        return meets


class TargetWindow:
    """The masses and losses of one target in L steps, in K boxes of the grid.

    A loss is what a search loses to the rest of the plan: the worth of a find, less the rest. In
    each box, several candidates for the paths of some drones can be tried. Masses, losses and
    fractions missed are indexed [step, layer, box, candidate, y, x], with one candidate at first.

    Args:
        passes: the passes of the plan.
        begin: the first step.
        steps: the number of steps, L.
        boxes: the boxes.
        shares_cells: whether several drones may search one cell in one step.
    """

    def __init__(
        self, passes: Passes, begin: int, steps: int, boxes: Boxes, shares_cells: bool = False
    ) -> None:
        self._shares_cells = shares_cells
        self._target = passes.target
        self._first = passes.first + begin
        self._boxes = boxes
        end = begin + steps
        passes.update(begin, end - 1)
        model = self._target.model

        pairs = (model.transitions(self._first + step) for step in range(steps))
        size = boxes.size
        self._transitions = [
            (
                _part(along_x, _flat_indices(boxes.columns, boxes.columns, size)),
                _part(along_y, _flat_indices(boxes.rows, boxes.rows, size)),
            )
            for along_x, along_y in filter(None, pairs)
        ]
        masses: Any = passes.masses[begin:end]
        rests: Any = passes.rests[begin:end]
        times: Any = model.lift(passes.times[begin:end])
        if self._transitions:
            cells = _flat_indices(boxes.rows, boxes.columns, size)
            masses, rests, times = (_part(values, cells) for values in (masses, rests, times))
        else:
            masses, rests, times = (
                values[:, :, None, None].astype(np.float32) for values in (masses, rests, times)
            )
        worth = self._target.worth[begin:end].astype(np.float32)
        self._masses = masses
        self._times = times
        self._kept = self._missed(times)
        self._losses = worth[:, None, None, None, None, None] - rests
        self.cells = self._masses[0].size

    def remove(self, cells: Ints, searches: Flags) -> Floats:
        """Remove the searches of one drone in each box; returns what they have gained, (K,).

        More is then left to find, and less is found later.

        Args:
            cells: the cell on the grid that the drone searches in each step: (L, K).
            searches: whether it searches in each step: (L, K).
        """
        where = self._indices(cells[..., None], searches[..., None])
        found = [masses[index] for masses, index in zip(self._masses, where, strict=True)]
        for step, index in enumerate(where):
            self._times[step][index] -= 1.0
            self._kept[step][index] = self._missed(self._times[step][index])
        steps = range(len(where))
        self._change(self._masses, steps, self._forward, where, sign=1.0)
        self._change(self._losses, steps[::-1], self._backward, where, sign=1.0)
        return self._gained(found, self._losses, self._kept, where)[:, 0]

    def _missed(self, times: Floats) -> Floats:
        """The probability that searches, so many of each cell, miss a person there."""
        missed: Floats = ((1.0 - self._target.detection) ** times.astype(np.float64)).astype(
            np.float32
        )
        return missed

    def gains(self, boxes: Boxes) -> Floats:
        """What one search of each cell gains in each step: (2, L, K, candidates, h, w).

        The second gains are for a search right after another one in the same cell, if as many
        persons as possible have stayed there. The boxes of the cells are smaller, each within one
        of the window.
        """
        stayed = np.zeros_like(self._masses)
        np.minimum(self._masses[:-1], self._masses[1:], out=stayed[1:])
        gains = np.array([self._masses, self._masses - self._target.detection * stayed])
        gains *= self._losses
        gains *= self._target.detection
        if self._shares_cells:
            gains *= self._kept
        y = boxes.rows
        x = boxes.columns
        if self._transitions:
            y = y - self._boxes.top[:, None]
            x = x - self._boxes.left[:, None]
            total = gains[:, :, 0] if gains.shape[2] == 1 else gains.sum(axis=2)
        else:
            total = self._target.model.map(np.moveaxis(gains, 2, -3))
        box = np.arange(len(y))[:, None, None]
        inner: Floats = total.swapaxes(2, 3)[..., box, y[:, :, None], x[:, None]]
        return inner.swapaxes(2, 3)

    def add(self, cells: Ints, searches: Flags, *, is_last: bool) -> Floats:
        """Add the searches of one drone in each box, by m candidates; returns their gains, (K, m).

        Args:
            cells: the cell on the grid that the drone searches in each step: (L, K, m).
            searches: whether it searches in each step: (L, K, m).
            is_last: whether nothing else will be added, so that only the gains matter.
        """
        where = self._indices(cells, searches)
        steps = range(len(cells))
        shape = (*self._masses.shape[:3], cells.shape[-1], *self._masses.shape[-2:])
        masses = np.broadcast_to(self._masses, shape)
        losses = np.broadcast_to(self._losses, shape)
        self._kept = np.broadcast_to(self._kept, (len(where), 1, *shape[2:]))
        if not is_last:
            masses = masses.copy()
        found = self._change(masses, steps, self._forward, where, sign=-1.0)
        gained = self._gained(found, losses, self._kept, where)
        if is_last:
            return gained
        self._masses = masses
        self._losses = losses.copy()
        self._change(self._losses, steps[::-1], self._backward, where, sign=-1.0)
        self._kept = self._kept.copy()
        self._times = np.broadcast_to(self._times, self._kept.shape).copy()
        for step, index in enumerate(where):
            self._times[step][index] += 1.0
            self._kept[step][index] = self._missed(self._times[step][index])
        return gained

    def _gained(
        self, found: list[Floats], losses: Floats, kept: Floats, where: list[Index]
    ) -> Floats:
        """What searches gain, (K, m), given the masses that they meet.

        `kept` is the share of these that the searches of others in the same step leave.
        """
        gained = np.zeros(losses.shape[2:4])
        for mass, loss, left, index in zip(found, losses, kept, where, strict=True):
            gained[index[1:3]] += (mass * left[index] * loss[index]).sum(axis=0)
        return gained * self._target.detection

    def _indices(self, cells: Ints, searches: Flags) -> list[Index]:
        """The index of the searched states in each step, given the arguments of `add`."""
        model = self._target.model
        if self._transitions:
            column, row = cell_position(cells, model.grid_size)
            x = column - self._boxes.left[:, None]
            y = row - self._boxes.top[:, None]
        else:
            x, y = cell_position(model.slots[cells], model.grid_size)
        indices = []
        for step, searching in enumerate(searches):
            who = searching.nonzero()
            indices.append((slice(None), *who, y[step][who], x[step][who]))
        return indices

    def _change(
        self,
        values: Floats,
        steps: range,
        drift: Callable[[Floats, int], Floats],
        where: list[Index],
        *,
        sign: float,
    ) -> list[Floats]:
        """Remove (sign 1) or add (sign -1) searches, from one end of the window to the other.

        Returns the values of the searched states; all others change if they are not read-only.
        """
        more = np.zeros(values.shape[1:], values.dtype)
        searched = []
        for step in steps:
            here = values[step][where[step]]
            if sign < 0.0:
                here -= more[where[step]]
            searched.append(here)
            if values.flags.writeable:
                values[step] += sign * more
            if step != steps[-1]:
                more *= self._kept[step]
                left = self._kept[step][where[step]]
                more[where[step]] += self._target.detection * left * here
                more = drift(more, step)
        return searched

    def _forward(self, mass: Floats, step: int) -> Floats:
        """The mass, [layer, box, candidate, y, x], one step later."""
        if not self._transitions:
            return self._each(self._target.model.forward_each, mass, self._first + step)
        along_x, along_y = self._transitions[step]
        moved: Floats = along_y.swapaxes(-1, -2) @ mass @ along_x
        return moved

    def _backward(self, value: Floats, step: int) -> Floats:
        """The expected value, [layer, box, candidate, y, x], one step earlier."""
        if not self._transitions:
            return self._each(self._target.model.backward_each, value, self._first + step - 1)
        along_x, along_y = self._transitions[step - 1]
        expected: Floats = along_y @ value @ along_x.swapaxes(-1, -2)
        return expected

    def _each(self, drift: Callable[[Floats, int], Floats], values: Floats, step: int) -> Floats:
        """The drift of each candidate's values, for a model without transitions."""
        return drift(values[:, 0].swapaxes(0, 1), step).swapaxes(0, 1)[:, None]


def _flat_indices(rows: Ints, columns: Ints, size: int) -> Ints:
    """The indices row * size + column of all pairs in each box: (K, 1, rows, columns)."""
    indices: Ints = rows[:, None, :, None] * size + columns[:, None, None, :]
    return indices


def _part(values: Floats, at: Ints) -> Floats:
    """Values (..., N, N) at some indices of their last two axes together, (...)."""
    flat = values.reshape(*values.shape[:-2], -1)
    part: Floats = flat.take(at, axis=-1).astype(np.float32)
    return part
