"""The drift model of tracks: a Markov chain whose probabilities are counted from them.

Track p has the weight w_p, and is in the state s_p(t) at step t: a part of a cell, and a class that
never changes. With n_t(s), the weight of the tracks in s at t, and N_t(s, s'), the weight of the
tracks in s at t and in s' at t + 1, the person is the Markov chain

    P(S_0 = s) = n_0(s),    P(S_{t+1} = s' | S_t = s) = N_t(s, s') / n_t(s).

By induction P(S_t = s) = n_t(s): the matrix is the weighted histogram of the tracks at every step,
and a person only makes moves that some track made. (Transition probabilities as counts over cells:
S. M. Ulam, A Collection of Mathematical Problems, 1960.)
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.drift.model import DriftModel, Forecasts
from DroneSwarmSearch.persons.tracks import Tracks


class CountedStep(NamedTuple):
    """The states at a step, and the moves to the next one; states are numbers in flat mass.

    Attributes:
        states: in ascending order, (S,).
        mass: the probability of each.
        first: the first move of each, and the number of moves: (S + 1,).
        after: where each move leads, in the order of the states: (E,).
        sums: for each, its state's index plus the cumulative probability up to it.
        sources: the states that the moves leave, in the order of `forward`: one move into each
            state, the states with the most first; then a second one into those that have it, and so
            on.
        targets: where they lead, in this order.
        chances: their probabilities, in this order.
        into: the number of states with at least 1, 2, ... moves into them.
    """

    states: Ints
    mass: Floats
    first: Ints
    after: Ints
    sums: Floats
    sources: Ints
    targets: Ints
    chances: Floats
    into: list[int]


class Chain(DriftModel):
    """The Markov chain of some tracks; nobody moves after the last step of the tracks.

    A layer of mass holds one part of each cell that some track visits, for one class: mass has the
    shape (classes * fine², R, N). `models.drift_model` makes chains, and keeps them.
    """

    def __init__(self, tracks: Tracks, grid_size: int, fine: int, classes: int) -> None:
        self.grid_size = grid_size
        self._tracks = tracks
        self._fine = fine
        self.key = tracks, grid_size, fine, classes
        self._labels = _class_labels(tracks, classes)
        self.weights = _sums(self._labels, tracks.weights)
        visited = np.zeros(grid_size**2, np.bool_)
        for step in range(tracks.steps + 1):
            x, y = fine_cells(tracks.positions[step], grid_size, 1)
            visited[cell_number(x, y, grid_size)] = True
        self.kept_cells = visited.nonzero()[0]
        _, rows, columns = super().state_shape
        self._shape = (len(self.weights) * fine**2, rows, columns)
        self._at = lru_cache(maxsize=1)(self._states_at)  # for the next step's table
        self._steps: dict[int, CountedStep] = {}

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), self.key

    # States and cells.

    @property
    def state_shape(self) -> tuple[int, int, int]:
        return self._shape

    # The forecast, and the steps of a distribution.

    def joint(self, step: int) -> Floats:
        now = self.counted(step)
        joint = np.zeros(self._shape)
        joint.reshape(-1)[now.states] = now.mass
        return joint

    def forward(self, mass: Floats, step: int) -> Floats:
        return self.after(mass.reshape(-1), step).reshape(self._shape)

    def after(self, flat: Floats, step: int) -> Floats:
        """`forward` of flat mass."""
        now = self.counted(step)
        flow = flat.take(now.sources)
        flow *= now.chances
        return _sums(now.targets, flow, flat.size)

    def backward(self, value: Floats, step: int) -> Floats:
        now = self.counted(step)
        flow = value.reshape(-1).take(now.targets)
        flow *= now.chances
        return _sums(now.sources, flow, value.size).reshape(self._shape)

    # The steps of a person.

    def walk(
        self, state: int, step: int, draws_x: Sequence[float], draws_y: Sequence[float]
    ) -> list[int]:
        path = []
        for draw in draws_x:
            now = self.counted(step)
            number = int(now.states.searchsorted(state))
            first = now.first[number]
            last = now.first[number + 1] - 1
            chosen = bisect_right(now.sums, number + draw, first, last)
            state = int(now.after[chosen])
            path.append(state)
            step += 1
        return path

    def moved(self, states: Ints, step: int, draws_x: Floats, draws_y: Floats) -> Ints:
        now = self.counted(step)
        numbers = now.states.searchsorted(states)
        chosen = now.sums.searchsorted(numbers + draws_x, side="right")
        after: Ints = now.after[np.clip(chosen, now.first[numbers], now.first[numbers + 1] - 1)]
        return after

    def branches(self, states: Ints, probabilities: Floats, step: int) -> tuple[Ints, Ints, Floats]:
        now = self.counted(step)
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
    def batched(cls, models: Sequence[Any], **options: Any) -> ChainForecasts:
        return ChainForecasts(models, **options)

    # Counting.

    def counted(self, step: int) -> CountedStep:
        """The table of a step, counted on first use; in the last one, states stay."""
        step = min(step, self._tracks.steps)
        if step not in self._steps:
            self._steps[step] = self._count(step)
        return self._steps[step]

    def _count(self, step: int) -> CountedStep:
        size = self._shape[0] * self.layer
        weights = self._tracks.weights
        x, y, here = self._at(step)
        next_x, next_y, there = self._at(min(step + 1, self._tracks.steps))
        in_state = _sums(here, weights, size)
        states = in_state.nonzero()[0]
        mass = in_state[states]
        number = np.zeros(size, np.int64)
        number[states] = np.arange(len(states))

        # Nobody moves farther than to the next cell, so a move is a state and one of few
        # displacements.
        reach = 2 * self._fine - 1
        width = 2 * reach + 1
        code = (number[here] * width + next_y - y + reach) * width + next_x - x + reach
        counts = _sums(code, weights)
        leads_to = np.zeros(code.max() + 1, np.int64)
        leads_to[code] = there
        (made,) = counts.nonzero()
        source = made // width**2
        after = leads_to[made]
        first = source.searchsorted(np.arange(len(states) + 1))
        chances = counts[made] / mass[source]
        sums = chances.cumsum()
        sums += source - np.append(0.0, sums)[first[source]]
        sums[first[1:] - 1] = np.arange(1.0, len(states) + 1)

        order, into = _order_of_forward(after)
        return CountedStep(
            states=states,
            mass=mass,
            first=first,
            after=after,
            sums=sums,
            sources=states[source[order]],
            targets=after[order],
            chances=chances[order],
            into=into,
        )

    def _states_at(self, step: int) -> tuple[Ints, Ints, Ints]:
        """The fine cell of each track at a step, x and y, and its state."""
        size = self.grid_size
        fine = self._fine
        x, y = fine_cells(self._tracks.positions[step], size, fine)
        part = (self._labels * fine + y % fine) * fine + x % fine
        cells = cell_number(x // fine, y // fine, size)
        return x, y, part * self.layer + self.slots[cells]


def _order_of_forward(after: Ints) -> tuple[Ints, list[int]]:
    """The order of moves in `CountedStep.sources`, given where each leads; and its `into`."""
    order = after.argsort(kind="stable")
    _, start, degrees = np.unique(after[order], return_index=True, return_counts=True)
    ordinal = np.arange(len(order)) - np.repeat(start, degrees)  # of a move into its state
    rank = (-degrees).argsort(kind="stable").argsort()  # of a state, the most moves first
    order = order[np.lexsort((np.repeat(rank, degrees), ordinal))]
    return order, np.bincount(ordinal).tolist()


def _sums(indices: Ints, weights: Floats, size: int = 0) -> Floats:
    """The sum of the weights with each number, added in order; at least `size` of them."""
    sums: Any = np.bincount(indices, weights, size)
    return sums  # type: ignore[no-any-return]


def fine_cells(positions: Floats, grid_size: int, fine: int) -> Ints:
    """The fine cells, (2, P), of positions, (P, 2), x first; positions off the grid count as on it.

    Each cell has `fine` by `fine` of them.
    """
    cells = np.floor((positions.T + 0.5) * fine).astype(np.int64)
    return np.clip(cells, 0, grid_size * fine - 1, out=cells)


def _class_labels(tracks: Tracks, classes: int) -> Ints:
    """The class of each track, (P,), by its positions at six steps.

    The class with the largest sum of squares along one of these is split at its median, and so on.
    """
    steps = np.linspace(0, tracks.steps, 6).round().astype(np.int64)
    features = np.concatenate(tracks.positions[steps], axis=1)  # (P, 12)
    labels = np.zeros(len(features), np.int64)
    for new in range(1, classes):
        members = [features[labels == label] for label in range(new)]
        spreads = np.array([own.var(axis=0) * len(own) for own in members])
        widest, feature = np.unravel_index(spreads.argmax(), spreads.shape)
        values = np.where(labels == widest, features[:, feature], -np.inf)
        labels[values > np.median(values[labels == widest])] = new
    return labels


class ChainForecasts(Forecasts):
    """`Chain` for many rows, which are faster if all are at the same step."""

    def drift(self, mass: Floats, entries: Ints) -> None:
        models: Any = self._each(entries)
        if len({model.state_shape for model in self.models}) > 1:
            super().drift(mass, entries)
            return
        flat = mass.reshape(-1, len(entries))
        if (entries != entries[0]).any():
            rows = np.ascontiguousarray(flat.T)
            for row, (model, step) in zip(rows, models, strict=True):
                row[...] = model.after(row, step)
            flat[...] = rows.T
            return
        model, step = models[0]
        now = model.counted(step)
        flow = flat.take(now.sources, 0)
        flow *= now.chances[:, None]
        first = now.into[0]
        total = flow[:first]
        for count in now.into[1:]:  # in the order of `Chain.forward`
            total[:count] += flow[first : first + count]
            first += count
        flat[...] = 0.0
        flat[now.targets[: len(total)]] = total
