"""The forward and backward pass of a plan for one person, see `joint_plan`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.paths.best_paths import DronePath, cells_looked_at


@dataclass
class Target:
    """A missing person.

    Attributes:
        model: how the person drifts.
        detection: the probability that a search of the person's cell finds the person.
        belief: the mass of the person's states: (M, R, N).
        worth: of a find in each step: (n,).
    """

    model: DriftModel
    detection: float
    belief: Floats
    worth: Floats


class Passes:
    """The forward and backward pass of one target, computed as far as they are needed.

    Attributes:
        times: how often each cell is searched in each step: float64, (n, N, N).
        missed: the probability that each step's searches miss the person in a cell: (n, N, N).
        masses: the probability that the person is unfound and in a state, before each step:
            (n, M, R, N).
        rests: what the plan will gain after each step's searches, given the person's state:
            (n, M, R, N).
    """

    def __init__(
        self, target: Target, first: int, paths: Sequence[DronePath], in_flight: bool = False
    ) -> None:
        n = len(target.worth)
        size = target.model.grid_size
        self.target = target
        self.first = first
        self._in_flight = in_flight
        self.times = np.zeros((n, size, size))
        self.missed = np.ones((n, size, size))
        self.masses, self.rests = np.empty((2, n, *target.belief.shape))
        self.masses[0] = target.belief
        self.rests[-1] = 0.0
        # Masses are up to date until the one step, rests from the other one on.
        self._masses_to = 0
        self._rests_from = n - 1
        for path in paths:
            self._count(path, 0, 1)

    def _count(self, path: DronePath, begin: int, times: int) -> None:
        """Add the searches of a path, or with -1 remove them."""
        steps = path.searches.nonzero()[0]
        where = begin + steps, cells_looked_at(path.cells, self._in_flight)[steps]
        by_step = self.times.reshape(len(self.times), -1)
        by_step[where] += times
        missed = (1.0 - self.target.detection) ** by_step[where]
        self.missed.reshape(len(self.missed), -1)[where] = missed

    def replace(self, old: Sequence[DronePath], new: Sequence[DronePath], begin: int) -> None:
        """Replace the searches of some drones from one step on by others."""
        for path in old:
            self._count(path, begin, -1)
        for path in new:
            self._count(path, begin, 1)
        self._masses_to = min(self._masses_to, begin)
        self._rests_from = max(self._rests_from, begin + len(new[0].searches) - 1)

    def update(self, begin: int, end: int) -> None:
        """Bring the masses up to date until before one step, and the rests from another one on."""
        model = self.target.model
        for now in range(self._masses_to, end):
            mass = self.masses[now] * model.lift(self.missed[now])
            self.masses[now + 1] = model.forward(mass, self.first + now)
        self._masses_to = max(self._masses_to, end)
        for now in range(self._rests_from - 1, begin - 1, -1):
            missed = model.lift(self.missed[now + 1])
            worth = self.target.worth[now + 1]
            value = missed * self.rests[now + 1] + (1.0 - missed) * worth
            self.rests[now] = model.backward(value, self.first + now)
        self._rests_from = min(self._rests_from, begin)

    def found(self) -> Floats:
        """The probability of finding the person in each step: (n,)."""
        self.update(len(self.missed), len(self.missed) - 1)
        maps = self.target.model.map(self.masses)
        found: Floats = ((1.0 - self.missed) * maps).sum(axis=(1, 2))
        return found

    def gains(self) -> Floats:
        """What one more search of each cell gains in each step: (n, N, N), see `joint_plan`."""
        self.update(0, len(self.missed) - 1)
        worth = self.target.worth[:, None, None, None]
        gained: Floats = self.target.model.map(self.masses * (worth - self.rests))
        return self.target.detection * self.missed * gained
