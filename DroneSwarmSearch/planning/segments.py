"""One segment of one drone's path: what its searches gain, and what a replacement would gain.

Removing or adding the searches of a segment changes the passes only near the segment. A drone
that gets from one end to the other in L steps stays in a box, and a person who leaves the box must
come back to be searched again, so a margin of L / 2 cells around it makes the passes exact. A
person whose drift model has no `matrices` may move farther, and gets the whole grid.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.belief import over_hypotheses
from DroneSwarmSearch.planning.passes import Box, Passes
from DroneSwarmSearch.planning.paths import Path

__all__ = ["Segment", "reach_of"]


Cell = tuple[int, int]
"""A row and a column within a box."""


def reach_of(start: int, goal: int | None, steps: int, size: int) -> Box:
    """The cells on the way from a start cell to a goal, in a number of steps."""
    y, x = divmod(start, size)
    if goal is None:
        return Box(y, y + 1, x, x + 1, size).grown(steps)
    to_y, to_x = divmod(goal, size)
    slack = (steps - abs(to_y - y) - abs(to_x - x)) // 2
    box = Box(min(y, to_y), max(y, to_y) + 1, min(x, to_x), max(x, to_x) + 1, size)
    return box.grown(slack)


class Segment:
    """What one target contributes to the gains of a segment of one drone's path.

    Args:
        passes: those of the target.
        old: the current path in this segment.
        begin: the segment's first step.
        end: the step before which it ends.
        reach: the cells that the drone can reach in it.

    Attributes:
        cells: the number of cells of all hypotheses in which the passes are computed; 0 if the
            person cannot be there.
    """

    def __init__(self, passes: Passes, old: Path, begin: int, end: int, reach: Box) -> None:
        passes.forward_to(end - 1)
        passes.backward_to(begin)
        self._reach = reach
        masses = passes.masses[begin:end]
        self._chain, self._first = passes.target.chain, passes.first + begin
        matrices = [self._chain.matrices(passes.first + step) for step in range(begin, end)]
        margin = (end - begin) // 2 if matrices[0] is not None else reach.size
        box = reach.grown(margin)
        if matrices[0] is not None:
            box = box.common(passes.likely(begin, end))
        self._box = box
        self.cells = 0
        if not all(box.shape):
            return
        where = (slice(None), slice(None), box.rows, box.columns)
        self.cells = masses[0][where[1:]].size
        self._q, self._worth = passes.target.detection, passes.target.worth[begin:end]
        self._matrices = [
            (each[0][:, box.columns, box.columns], each[1][:, box.rows, box.rows])
            for each in matrices
            if each is not None
        ]
        self._kept = passes.kept[begin:end, box.rows, box.columns].copy()
        searches = self._local(old)
        for step, (y, x) in searches.items():
            self._kept[step, y, x] = 1.0
        # The masses and rests without the drone's own searches.
        self._masses, self._rests = masses[where].copy(), passes.rests[begin:end][where].copy()
        for step, found in enumerate(self._found_by(searches, masses[where], are_counted=True)):
            if found is not None:
                self._masses[step] += found
        self._old_gain = self._remove_from_rests(searches, masses[where])

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
        self, searches: dict[int, Cell], masses: Floats, are_counted: bool
    ) -> Iterator[Floats | None]:
        """The mass that some searches have found, before each step until the last of `masses`.

        Args:
            searches: of the drone, by step.
            masses: of the person.
            are_counted: whether the masses lack what these searches find.

        Yields:
            The mass where it would be, of shape (M, y, x); None for 0.
        """
        found: Floats | None = None
        for step, mass in enumerate(masses):
            yield found
            search = searches.get(step)
            if step == len(masses) - 1 or (found is None and search is None):
                continue
            after = np.zeros_like(mass) if found is None else found * self._kept[step]
            if search is not None:
                here = (slice(None), *search)
                left = mass[here] if are_counted or found is None else mass[here] - found[here]
                after[here] += self._q * left
            found = self._forward(after, step)

    def _remove_from_rests(self, searches: dict[int, Cell], masses: Floats) -> float:
        """Subtract from earlier rests what the drone's searches gain.

        Args:
            searches: the drone's, by step.
            masses: those with these searches.

        Returns:
            What the searches gain.
        """
        fewer: Floats | None = None
        gain = 0.0
        for step in range(len(masses) - 1, -1, -1):
            search = searches.get(step)
            if fewer is not None:
                before = fewer * self._kept[step]
            elif search is not None:
                before = np.zeros_like(self._rests[0])
            else:
                continue
            if search is not None:
                worth, here = self._worth[step], (step, slice(None), *search)
                rest = self._rests[here]
                before[(slice(None), *search)] += self._q * (worth - rest)
                without = rest if fewer is None else rest - fewer[(slice(None), *search)]
                gain += self._q * float(masses[here] @ (worth - without))
            if fewer is not None:
                self._rests[step] -= fewer
            if step:
                fewer = self._backward(before, step - 1)
        return gain

    def _local(self, path: Path) -> dict[int, Cell]:
        """The searches of a path in the box: row and column by step."""
        steps = path.searches.nonzero()[0]
        y, x = np.divmod(path.cells[steps], self._box.size)
        box = self._box
        inside = (box.top <= y) & (y < box.bottom) & (box.left <= x) & (x < box.right)
        rows, columns = (y[inside] - box.top).tolist(), (x[inside] - box.left).tolist()
        return dict(zip(steps[inside].tolist(), zip(rows, columns, strict=True), strict=True))

    def add_gains(self, gains: Floats) -> None:
        """Add the gain of one search of each cell in reach in each step."""
        if not self.cells:
            return
        box, reach = self._box, self._reach
        common = box.common(reach)
        if not all(common.shape):
            return
        inner = (
            slice(None),
            slice(None),
            slice(common.top - box.top, common.bottom - box.top),
            slice(common.left - box.left, common.right - box.left),
        )
        gain = self._worth[:, None, None, None] - self._rests[inner]
        gain *= self._masses[inner]
        gain *= self._q
        outer = (
            slice(None),
            slice(common.top - reach.top, common.bottom - reach.top),
            slice(common.left - reach.left, common.right - reach.left),
        )
        gains[outer] += over_hypotheses(gain.swapaxes(0, 1))

    def gain(self, new: Path) -> float:
        """How much the value increases if the segment is replaced."""
        if not self.cells:
            return 0.0
        searches, gain = self._local(new), 0.0
        masses = self._masses[: max(searches, default=-1) + 1]
        for step, found in enumerate(self._found_by(searches, masses, are_counted=False)):
            if step in searches:
                here = (slice(None), *searches[step])
                mass = masses[step][here] if found is None else masses[step][here] - found[here]
                gain += self._q * float(mass @ (self._worth[step] - self._rests[step][here]))
        return gain - self._old_gain
