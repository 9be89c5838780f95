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

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch.drift.moves_model import MovesModel, MoveTable, sums_by_number
from DroneSwarmSearch.persons.tracks import Tracks


class CountedStep(NamedTuple):
    """What is counted of a step.

    Attributes:
        mass: the probability of each of the table's states.
        table: the moves to the next step.
    """

    mass: Floats
    table: MoveTable


class Chain(MovesModel):
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
        self.weights = sums_by_number(self._labels, tracks.weights)
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
        now = self._counted(step)
        joint = np.zeros(self._shape)
        joint.reshape(-1)[now.table.states] = now.mass
        return joint

    # Counting.

    def table(self, step: int) -> MoveTable:
        return self._counted(step).table

    def _counted(self, step: int) -> CountedStep:
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
        in_state = sums_by_number(here, weights, size)
        states = in_state.nonzero()[0]
        mass = in_state[states]
        number = np.zeros(size, np.int64)
        number[states] = np.arange(len(states))

        # Nobody moves farther than to the next cell, so a move is a state and one of few
        # displacements.
        reach = 2 * self._fine - 1
        width = 2 * reach + 1
        code = (number[here] * width + next_y - y + reach) * width + next_x - x + reach
        counts = sums_by_number(code, weights)
        leads_to = np.zeros(code.max() + 1, np.int64)
        leads_to[code] = there
        (made,) = counts.nonzero()
        source = made // width**2
        after = leads_to[made]
        chances = counts[made] / mass[source]
        return CountedStep(mass, MoveTable.of(states, source, after, chances))

    def _states_at(self, step: int) -> tuple[Ints, Ints, Ints]:
        """The fine cell of each track at a step, x and y, and its state."""
        size = self.grid_size
        fine = self._fine
        x, y = fine_cells(self._tracks.positions[step], size, fine)
        part = (self._labels * fine + y % fine) * fine + x % fine
        cells = cell_number(x // fine, y // fine, size)
        return x, y, part * self.layer + self.slots[cells]


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
