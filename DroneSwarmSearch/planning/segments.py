"""One segment of one drone's path: what its searches gain, and what a replacement would gain.

Removing or adding the searches of a segment changes the passes only near the segment. A drone
that gets from one end to the other in L steps stays in a box, and a person who leaves the box must
come back to be searched again, so a margin of L / 2 cells around it makes the passes exact. A
person whose drift model has no `matrices` may move farther, and gets all of the mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import over_layers
from DroneSwarmSearch.planning.passes import Box, Passes
from DroneSwarmSearch.planning.paths import Path

Searches = dict[int, tuple[slice, int, int]]
"""For each step with a search, the indices of its cell's states in the mass."""


def reach_of(start: int, goal: int | None, steps: int, size: int) -> Box:
    """The cells on the way from a start cell to a goal, if any, in a number of steps."""
    y, x = divmod(start, size)
    if goal is None:
        return Box(y, y + 1, x, x + 1, size).grown(steps)
    to_y, to_x = divmod(goal, size)
    slack = (steps - abs(to_y - y) - abs(to_x - x)) // 2
    box = Box(min(y, to_y), max(y, to_y) + 1, min(x, to_x), max(x, to_x) + 1, size)
    return box.grown(slack)


class Segment:
    """What one target contributes to the gains of a segment of one drone's path.

    `reach` are the cells that the drone can reach in it, `cells` the number of states for which
    the passes are computed; 0 if the person cannot be there.
    """

    def __init__(self, passes: Passes, old: Path, begin: int, reach: Box) -> None:
        steps, target = len(old.searches), passes.target
        end = begin + steps
        passes.update(begin, end - 1)
        self._chain, self._first = target.chain, passes.first + begin
        matrices = [self._chain.matrices(self._first + step) for step in range(steps)]
        self._reach, rows, columns = reach, slice(None), slice(None)
        self._box: Box | None = None
        self.cells, kept = target.belief.size, self._chain.lift(passes.kept[begin:end])[:, 0]
        if matrices[0] is not None:
            self._box = reach.grown(steps // 2).common(passes.likely(begin, end))
            self.cells = len(target.belief) * math.prod(self._box.shape)
            rows, columns = self._box.slices()
        if not self.cells:
            return
        self._q, self._worth = target.detection, target.worth[begin:end]
        self._matrices = [
            (along_x[:, columns, columns], along_y[:, rows, rows])
            for along_x, along_y in filter(None, matrices)
        ]
        self._kept = kept[:, rows, columns].copy()
        searches = self._local(old)
        for step, (_, y, x) in searches.items():
            self._kept[step, y, x] = 1.0
        # The masses and rests without the drone's own searches.
        masses = passes.masses[begin:end, :, rows, columns]
        self._masses = masses.copy()
        self._rests = passes.rests[begin:end, :, rows, columns].copy()
        for step, found in self._found_by(searches, masses, are_counted=True):
            self._masses[step] += found
        self._old_gain = self._remove_from_rests(searches, masses)

    def _local(self, path: Path) -> Searches:
        """The searches of a path in the box."""
        steps, size = path.searches.nonzero()[0], self._reach.size
        box, places = self._box, path.cells[steps]
        if box is None:
            box, places = Box(0, size + 1, 0, size, size), self._chain.places[places]
        y, x, inside = box.local(places)
        found = zip(steps[inside].tolist(), y[inside].tolist(), x[inside].tolist(), strict=True)
        return {step: (slice(None), row, column) for step, row, column in found}

    def _forward(self, mass: Floats, step: int) -> Floats:
        if not self._matrices:
            return self._chain.forward(mass, self._first + step)
        along_x, along_y = self._matrices[step]
        moved: Floats = along_y.swapaxes(1, 2) @ mass @ along_x
        return moved

    def _backward(self, value: Floats, step: int) -> Floats:
        if not self._matrices:
            return self._chain.backward(value, self._first + step)
        along_x, along_y = self._matrices[step]
        expected: Floats = along_y @ value @ along_x.swapaxes(1, 2)
        return expected

    def _found_by(
        self, searches: Searches, masses: Floats, are_counted: bool
    ) -> Iterator[tuple[int, Floats]]:
        """The mass that searches have found, where it would be before each step from the first on.

        `are_counted`: whether the masses of the person already lack what these searches find.
        """
        first, last = min(searches, default=len(masses)), len(masses) - 1
        found = np.zeros(self._masses.shape[1:])
        for step in range(first, last + 1):
            yield step, found
            if step < last:
                after = found * self._kept[step]
                if step in searches:
                    here, mass = searches[step], masses[step]
                    left = mass[here] if are_counted else mass[here] - found[here]
                    after[here] += self._q * left
                found = self._forward(after, step)

    def _remove_from_rests(self, searches: Searches, masses: Floats) -> float:
        """Subtract from the rests what the drone's searches gain; returns all that they gain."""
        fewer, gain = np.zeros(masses.shape[1:]), 0.0
        for step in range(max(searches, default=-1), -1, -1):
            before, worth = fewer * self._kept[step], self._worth[step]
            if step in searches:
                here = searches[step]
                rest = self._rests[step][here]
                before[here] += self._q * (worth - rest)
                gain += self._q * float(masses[step][here] @ (worth - (rest - fewer[here])))
            self._rests[step] -= fewer
            if step:
                fewer = self._backward(before, step - 1)
        return gain

    def add_gains(self, gains: Floats) -> None:
        """Add the gain of one search of each cell in reach in each step."""
        if not self.cells:
            return
        inner: tuple[Any, ...] = (...,)
        if self._box is not None:
            common = self._box.common(self._reach)
            if not all(common.shape):
                return
            inner, outer = ((..., *common.slices(box)) for box in (self._box, self._reach))
        gain = self._worth[:, None, None, None] - self._rests[inner]
        gain *= self._masses[inner]
        gain *= self._q
        if self._box is None:
            gains += self._chain.map(gain)[(..., *self._reach.slices())]
        else:
            gains[outer] += over_layers(gain.swapaxes(0, 1))

    def gain(self, new: Path) -> float:
        """How much the value increases if the segment is replaced."""
        if not self.cells:
            return 0.0
        searches, gain = self._local(new), 0.0
        masses = self._masses[: max(searches, default=-1) + 1]
        for step, found in self._found_by(searches, masses, are_counted=False):
            if step in searches:
                here = searches[step]
                left = masses[step][here] - found[here]
                gain += self._q * float(left @ (self._worth[step] - self._rests[step][here]))
        return gain - self._old_gain
