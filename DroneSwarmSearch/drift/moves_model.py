"""Drift models whose states move by tables of probabilities, one for each step."""

from __future__ import annotations

from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch.drift.model import DriftModel, Forecasts


class MoveTable(NamedTuple):
    """The states at a step, and the moves to the next one; states are numbers in flat mass.

    Attributes:
        states: in ascending order, (S,).
        first: the first move of each, and the number of moves: (S + 1,).
        after: where each move leads, in the order of the states: (E,).
        sums: for each, its state's index plus the cumulative probability up to it.
        sources: the states that the moves leave, in the order of `forward`: one move into each
            state, the states with the most first; then a second one into those that have it, and so
            on.
        targets: where they lead, in this order.
        chances: their probabilities, in this order.
        into: the number of states with at least 1, 2, ... moves into them.
        by_source: the numbers of the moves, as ordered above, in the order of the states that they
            leave: (E,).
    """

    states: Ints
    first: Ints
    after: Ints
    sums: Floats
    sources: Ints
    targets: Ints
    chances: Floats
    into: list[int]
    by_source: Ints

    @classmethod
    def of(cls, states: Ints, sources: Ints, after: Ints, chances: Floats) -> MoveTable:
        """The table of some moves.

        Args:
            states: in ascending order, (S,).
            sources: the index in `states` of each move's source, in ascending order: (E,).
            after: the state to which it leads: (E,).
            chances: its probability, given its source: (E,).
        """
        first = sources.searchsorted(np.arange(len(states) + 1))
        sums = chances.cumsum()
        sums += sources - np.append(0.0, sums)[first[sources]]
        sums[first[1:] - 1] = np.arange(1.0, len(states) + 1)
        order, into = _order_of_forward(after)
        return cls(
            states=states,
            first=first,
            after=after,
            sums=sums,
            sources=states[sources[order]],
            targets=after[order],
            chances=chances[order],
            into=into,
            by_source=sources[order].argsort(kind="stable"),
        )

    def forward(self, masses: Floats) -> Floats:
        """Several masses, by state and mass, one step later: float64, (states, n)."""
        flow = masses.take(self.sources, 0)
        flow *= self.chances[:, None]
        first = self.into[0]
        total = flow[:first].astype(np.float64, copy=False)
        for count in self.into[1:]:  # in the order of `MovesModel.forward`
            total[:count] += flow[first : first + count]
            first += count
        after = np.zeros(masses.shape)
        after[self.targets[: len(total)]] = total
        return after

    def backward(self, values: Floats) -> Floats:
        """Several expected values, by state and value, one step earlier: float64, (states, n)."""
        flow = values.take(self.targets, 0)
        flow *= self.chances[:, None]
        by_state = flow[self.by_source].astype(np.float64, copy=False)
        before = np.zeros(values.shape)
        before[self.states] = np.add.reduceat(by_state, self.first[:-1])
        return before


def _order_of_forward(after: Ints) -> tuple[Ints, list[int]]:
    """The order of moves in `MoveTable.sources`, given where each leads; and its `into`."""
    order = after.argsort(kind="stable")
    _, start, degrees = np.unique(after[order], return_index=True, return_counts=True)
    ordinal = np.arange(len(order)) - np.repeat(start, degrees)  # of a move into its state
    rank = (-degrees).argsort(kind="stable").argsort()  # of a state, the most moves first
    order = order[np.lexsort((np.repeat(rank, degrees), ordinal))]
    return order, np.bincount(ordinal).tolist()


def sums_by_number(indices: Ints, weights: Floats, size: int = 0) -> Floats:
    """The sum of the weights with each number, added in order; at least `size` of them."""
    sums: Any = np.bincount(indices, weights, size)
    return sums  # type: ignore[no-any-return]


class MovesModel(DriftModel):
    """A drift model whose states move by a `MoveTable` in each step."""

    @abstractmethod
    def table(self, step: int) -> MoveTable:
        """The moves from a step to the next; the same object where they are the same."""

    def forward(self, mass: Floats, step: int) -> Floats:
        return self.after(mass.reshape(-1), step).reshape(self.state_shape)

    def after(self, flat: Floats, step: int) -> Floats:
        """`forward` of flat mass."""
        now = self.table(step)
        flow = flat.take(now.sources)
        flow *= now.chances
        return sums_by_number(now.targets, flow, flat.size)

    def backward(self, value: Floats, step: int) -> Floats:
        now = self.table(step)
        flow = value.reshape(-1).take(now.targets)
        flow *= now.chances
        return sums_by_number(now.sources, flow, value.size).reshape(self.state_shape)

    def forward_each(self, masses: Floats, step: int) -> Floats:
        return self._of_columns(self.table(step).forward, masses)

    def backward_each(self, values: Floats, step: int) -> Floats:
        return self._of_columns(self.table(step).backward, values)

    def _of_columns(self, change: Callable[[Floats], Floats], values: Floats) -> Floats:
        """Change arrays of values, (n, M, R, N), which are the columns of `change`."""
        columns = np.ascontiguousarray(values.reshape(len(values), -1).T)
        changed: Floats = change(columns).T.reshape(values.shape)
        return changed

    # The steps of a person.

    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        path = []
        for draw in draws_x:
            now = self.table(step)
            number = int(now.states.searchsorted(state))
            first = now.first[number]
            last = now.first[number + 1] - 1
            chosen = bisect_right(now.sums, number + draw, first, last)
            state = int(now.after[chosen])
            path.append(state)
            step += 1
        return path

    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        now = self.table(step)
        numbers = now.states.searchsorted(states)
        chosen = now.sums.searchsorted(numbers + draws_x, side="right")
        after: Ints = now.after[np.clip(chosen, now.first[numbers], now.first[numbers + 1] - 1)]
        return after

    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        now = self.table(step)
        numbers = now.states.searchsorted(states)
        first = now.first[numbers]
        counts = now.first[numbers + 1] - first
        person = np.repeat(np.arange(len(states)), counts)
        # The moves of a person follow each other, from `first` on.
        since_first = np.arange(len(person)) - (counts.cumsum() - counts)[person]
        move = first[person] + since_first
        before = np.where(move > first[person], now.sums[move - 1], numbers[person])
        return person, now.after[move], probabilities[person] * (now.sums[move] - before)

    @classmethod
    def batched(cls, models: Sequence[Any], **options: Any) -> MovesForecasts:
        return MovesForecasts(models, **options)


class MovesForecasts(Forecasts):
    """`MovesModel` for many rows, which are faster if all have the same table."""

    def drift(self, mass: Floats, entries: Ints) -> None:
        models: Any = self._each(entries)
        if len({model.state_shape for model in self.models}) > 1:
            super().drift(mass, entries)
            return
        flat = mass.reshape(-1, len(entries))
        tables = [model.table(step) for model, step in models]
        now = tables[0]
        if any(table is not now for table in tables):
            rows = np.ascontiguousarray(flat.T)
            for row, (model, step) in zip(rows, models, strict=True):
                row[...] = model.after(row, step)
            flat[...] = rows.T
            return
        flat[...] = now.forward(flat)
