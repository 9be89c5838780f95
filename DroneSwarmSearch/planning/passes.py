"""The forward and backward pass of a plan, for one person, and boxes of cells.

See `plan` for what the passes are for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.planning.paths import Path

__all__ = ["Box", "Passes", "Target"]


NEGLIGIBLE = 1e-13
"""A cell with less probability cannot make a plan better."""


@dataclass
class Target:
    """A missing person.

    Attributes:
        chain: the person's steps.
        detection: the probability of detection.
        belief: the person's distribution at the plan's first step: float64, shape (M, N, N),
            indexed [hypothesis, y, x].
        worth: the worth of finding this person in each step of the plan: float64, shape (n,).
    """

    chain: DriftModel
    detection: float
    belief: Floats
    worth: Floats


@dataclass(frozen=True)
class Box:
    """A rectangle of cells: rows top to before bottom, columns left to before right."""

    top: int
    bottom: int
    left: int
    right: int
    size: int

    @property
    def shape(self) -> tuple[int, int]:
        return max(self.bottom - self.top, 0), max(self.right - self.left, 0)

    @property
    def rows(self) -> slice:
        return slice(self.top, self.bottom)

    @property
    def columns(self) -> slice:
        return slice(self.left, self.right)

    def grown(self, margin: int) -> Box:
        """The box with a margin, on the grid."""
        return Box(
            max(self.top - margin, 0),
            min(self.bottom + margin, self.size),
            max(self.left - margin, 0),
            min(self.right + margin, self.size),
            self.size,
        )

    def common(self, other: Box) -> Box:
        """The cells in both boxes."""
        return Box(
            max(self.top, other.top),
            min(self.bottom, other.bottom),
            max(self.left, other.left),
            min(self.right, other.right),
            self.size,
        )

    def to_local(self, cell: int) -> int:
        """The number of a grid cell within the box."""
        y, x = divmod(cell, self.size)
        return (y - self.top) * (self.right - self.left) + x - self.left

    def to_grid(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """The grid cells of cells within the box."""
        y, x = np.divmod(cells, self.right - self.left)
        return (y + self.top) * self.size + x + self.left

    def inside(self, cells: NDArray[np.int64]) -> list[list[int]]:
        """For each column of grid cells, the numbers within the box of those inside it."""
        y, x = np.divmod(cells, self.size)
        is_inside = (self.top <= y) & (y < self.bottom) & (self.left <= x) & (x < self.right)
        local = (y - self.top) * (self.right - self.left) + x - self.left
        result: list[list[int]] = [[] for _ in range(cells.shape[1])]
        for which, step in zip(*is_inside.nonzero(), strict=True):
            result[step].append(int(local[which, step]))
        return result


class Passes:
    """The forward and backward pass of one target, computed as far as they are needed.

    Attributes:
        first: the plan's first step.
        kept: the probability that the searches of a step miss the person in a cell, by step:
            shape (n, N, N).
        masses: the probability that the person is in a cell, and unfound, before each step:
            shape (n, M, N, N).
        rests: what the plan is expected to gain from a person in a cell after the searches of
            each step: shape (n, M, N, N).
    """

    def __init__(self, target: Target, first: int, paths: Sequence[Path]) -> None:
        n, grid = len(target.worth), target.belief.shape[1:]
        self.target = target
        self.first = first
        self.kept = np.ones((n, *grid))
        self.masses, self.rests = np.empty((2, n, *target.belief.shape))
        self.masses[0], self.rests[-1] = target.belief, 0.0
        self._masses_to = 0  # masses are up to date until this step
        self._rests_from = n - 1  # rests are up to date from this step
        for path in paths:
            self.change(path, 0, self.target.detection)

    def change(self, path: Path, begin: int, detection: float) -> None:
        """Add the searches of a path that begins in a step; a detection of 0 removes them."""
        steps = path.searches.nonzero()[0]
        flat = self.kept.reshape(len(self.kept), -1)
        flat[begin + steps, path.cells[steps]] = 1.0 - detection

    def invalidate(self, begin: int, end: int) -> None:
        """Mark the passes as out of date: searches from `begin` to before `end` have changed."""
        self._masses_to = min(self._masses_to, begin)
        self._rests_from = max(self._rests_from, end - 1)

    def forward_to(self, step: int) -> None:
        """Bring the masses up to date until before a step."""
        chain = self.target.chain
        for now in range(self._masses_to, step):
            mass = self.masses[now] * chain.lift(self.kept[now])
            self.masses[now + 1] = chain.forward(mass, self.first + now)
        self._masses_to = max(self._masses_to, step)

    def backward_to(self, step: int) -> None:
        """Bring the rests up to date from a step on."""
        chain = self.target.chain
        for now in range(self._rests_from - 1, step - 1, -1):
            kept, worth = chain.lift(self.kept[now + 1]), self.target.worth[now + 1]
            value = kept * self.rests[now + 1] + (1.0 - kept) * worth
            self.rests[now] = chain.backward(value, self.first + now)
        self._rests_from = min(self._rests_from, step)

    def likely(self, begin: int, end: int) -> Box:
        """The smallest box of the cells that the person may be in, in some steps, unless found.

        It ignores searches: one that gains nothing may find the person once an earlier one is
        removed.
        """
        top, bottom, left, right = self._extents[:, begin:end]
        size = self.kept.shape[-1]
        return Box(int(top.min()), int(bottom.max()), int(left.min()), int(right.max()), size)

    @cached_property
    def _extents(self) -> NDArray[np.int64]:
        """First row, last row + 1, first column and last column + 1 of the forecast, by step."""
        mass, extents = self.target.belief, []
        for step in range(len(self.kept)):
            is_likely = mass.max(axis=0) > NEGLIGIBLE
            rows, columns = is_likely.any(axis=1).nonzero()[0], is_likely.any(axis=0).nonzero()[0]
            extents.append((rows[0], rows[-1] + 1, columns[0], columns[-1] + 1))
            mass = self.target.chain.forward(mass, self.first + step)
        return np.array(extents).T

    def found(self) -> Floats:
        """The probability of finding the person in each step."""
        self.forward_to(len(self.kept) - 1)
        found: Floats = ((1.0 - self.kept) * self.masses.sum(axis=1)).sum(axis=(1, 2))
        return found
