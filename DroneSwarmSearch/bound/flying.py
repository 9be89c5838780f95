"""Remembering drones that search in flight: the cell in which they arrive, in every step.

See `memory`: the state of the dynamic programme is again a cell and a history, now of a drone that
has arrived and is about to search. With W[t](h, c) for the most that is still gained then, and
gain[t](h, c) for that search,

    W[t](h, c) = gain[t](h, c) + max over actions a of W[t+1](h after a, c after a).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints, Singles
from DroneSwarmSearch.bound.memory import History, Offset, RememberingDrones
from DroneSwarmSearch.core.grid import MOVES, SHIFTS

STAYING = ((..., slice(None), slice(None)), (..., slice(None), slice(None)))
"""Like `SHIFTS`, for the action of staying."""

ACTIONS = (STAYING, *SHIFTS)


class FlyingHistories:
    """What a drone that searches in flight can remember of its last K searches.

    A history is a tuple of the cells of these searches, relative to the cell where it now is, the
    latest first. Of the H histories in `all`, the first is empty. `after`, (5, H), follows each
    one if the drone searches, and then stays or moves.
    """

    def __init__(self, memory: int) -> None:
        nothing: History = (None,) * memory
        indices = {nothing: 0}
        after = []
        to_extend = deque([nothing])
        while to_extend:
            history = to_extend.popleft()
            ahead = [_moved(((0, 0), *history)[:memory], dx, dy) for dx, dy in ((0, 0), *MOVES)]
            for other in ahead:
                if other not in indices:
                    indices[other] = len(indices)
                    to_extend.append(other)
            after.append([indices[other] for other in ahead])
        self.all = list(indices)
        self.after: Ints = np.array(after).T


def _moved(history: History, dx: int, dy: int) -> History:
    """A history relative to the cell to which the drone moves."""
    offsets: list[Offset] = [
        None if offset is None else (offset[0] - dx, offset[1] - dy) for offset in history
    ]
    return tuple(offsets)


class FlyingDrones(RememberingDrones):
    """`RememberingDrones` that search in flight."""

    _spare_moves = 1  # a drone that has searched at age n has made n moves since then

    @cached_property
    def _flying(self) -> FlyingHistories:
        return FlyingHistories(self._memory)

    @property
    def _all_histories(self) -> list[History]:
        return self._flying.all

    def most(self, sums: Sequence[Floats]) -> float:
        size = self._size
        values: Singles = np.zeros((len(self._flying.all), size, size), np.float32)
        for step, credits, step_sums in self._backward(sums):
            if step is not self._steps[-1]:
                values = self._best_ahead(values)
            rows, columns = step.box
            values[:, rows, columns] += self._gains(step, credits, step_sums)
        # Before the first search, all histories are empty.
        best: Singles = np.full((size, size), -np.inf, np.float32)
        for here, there in ACTIONS:
            np.maximum(best[here], values[0][there], out=best[here])
        return self._total(best)

    def _best_ahead(self, values: Singles) -> Singles:
        """The best of the values after each action: (H, N, N)."""
        best: Singles = values.take(self._flying.after[0], axis=0)
        for after, (here, there) in zip(self._flying.after[1:], SHIFTS, strict=True):
            np.maximum(best[here], values.take(after, axis=0)[there], out=best[here])
        return best

    def soft_flow(self, sums: Sequence[Floats]) -> Singles:
        size = self._size
        steps = len(self._steps)
        shape = (len(self._flying.all), size, size)
        moves = np.empty((steps, len(ACTIONS), *shape), np.float32)  # after each step's search
        values: Singles = np.zeros(shape, np.float32)
        number = steps
        for step, credits, step_sums in self._backward(sums):
            number -= 1
            if number < steps - 1:
                values = self._soften(moves[number], values)
            rows, columns = step.box
            values[:, rows, columns] += self._gains(step, credits, step_sums)
        first = np.empty((len(ACTIONS), 1, size, size), np.float32)
        self._soft_choice(first, [values[:1]] * len(ACTIONS))

        flow = np.zeros((steps, *shape), np.float32)
        begin = np.zeros((1, size, size), np.float32)
        np.add.at(begin[0].reshape(-1), self._starts, 1.0)
        for share, (here, there) in zip(first, ACTIONS, strict=True):
            flow[0, :1][there] += (share * begin)[here]
        for now in range(steps - 1):
            for share, after, (here, there) in zip(
                moves[now], self._flying.after, ACTIONS, strict=True
            ):
                arriving = np.zeros(shape, np.float32)
                arriving[there] = (share * flow[now])[here]
                np.add.at(flow[now + 1], after, arriving)
        return flow

    def _soften(self, moves: Singles, values: Singles) -> Singles:
        """Write the probabilities of the actions after a search; returns the soft maximum."""
        ahead = [values.take(after, axis=0) for after in self._flying.after]
        return self._soft_choice(moves, ahead)

    @staticmethod
    def _soft_choice(moves: Singles, ahead: Sequence[Singles]) -> Singles:
        """Write each action's probability, given the values after it; returns the soft maximum."""
        moves[:] = -1e9
        for move, values, (here, there) in zip(moves, ahead, ACTIONS, strict=True):
            move[here] = values[there]
        most: Singles = moves.max(axis=0)
        moves -= most
        np.exp(moves, out=moves)
        total = moves.sum(axis=0)
        moves /= total
        most += np.log(total)
        return most
