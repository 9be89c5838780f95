"""The forward and backward pass of a plan for one person, see `plan`; and boxes of cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch._internal.arrays import Flags, Floats, Ints
from DroneSwarmSearch.drift.model import DriftModel
from DroneSwarmSearch.planning.paths import Path

NEGLIGIBLE = 1e-13
"""A cell with less probability cannot make a plan better."""


@dataclass
class Target:
    """A missing person, with the mass of the states and the worth of a find by step, shape (n,)."""

    chain: DriftModel
    detection: float
    belief: Floats
    worth: Floats


class Box(NamedTuple):
    """The cells in rows top to before bottom and columns left to before right of a grid."""

    top: int
    bottom: int
    left: int
    right: int
    size: int

    @property
    def shape(self) -> tuple[int, int]:
        return max(self.bottom - self.top, 0), max(self.right - self.left, 0)

    def slices(self, within: Box | None = None) -> tuple[slice, slice]:
        """Its rows and columns on the grid, or in another box that contains it."""
        top, left = (within.top, within.left) if within else (0, 0)
        return slice(self.top - top, self.bottom - top), slice(self.left - left, self.right - left)

    def grown(self, margin: int) -> Box:
        """The box with a margin, on the grid."""
        top, left = max(self.top - margin, 0), max(self.left - margin, 0)
        bottom, right = min(self.bottom + margin, self.size), min(self.right + margin, self.size)
        return Box(top, bottom, left, right, self.size)

    def common(self, other: Box) -> Box:
        """The cells in both boxes."""
        top, left = max(self.top, other.top), max(self.left, other.left)
        bottom, right = min(self.bottom, other.bottom), min(self.right, other.right)
        return Box(top, bottom, left, right, self.size)

    def local(self, cells: Ints) -> tuple[Ints, Ints, Flags]:
        """Rows and columns of grid cells, counted from the box's, and whether they are in it."""
        (y, x), (height, width) = np.divmod(cells, self.size), self.shape
        y, x = y - self.top, x - self.left
        return y, x, (y >= 0) & (y < height) & (x >= 0) & (x < width)


class Passes:
    """The forward and backward pass of one target, computed as far as they are needed.

    Attributes:
        kept: the probability that each step's searches miss the person in a cell: (n, N, N).
        masses: that the person is in a state, and unfound, before each step: (n, M, R, N).
        rests: what the plan will gain from a state after each step's searches: (n, M, R, N).
    """

    def __init__(self, target: Target, first: int, paths: Sequence[Path]) -> None:
        n, size = len(target.worth), target.chain.grid_size
        self.target, self.first = target, first
        self.kept = np.ones((n, size, size))
        self.masses, self.rests = np.empty((2, n, *target.belief.shape))
        self.masses[0], self.rests[-1] = target.belief, 0.0
        # Masses are up to date until the one step, rests from the other one on.
        self._masses_to, self._rests_from = 0, n - 1
        for path in paths:
            self._set_kept(path, 0, 1.0 - target.detection)

    def _set_kept(self, path: Path, begin: int, kept: float) -> None:
        steps = path.searches.nonzero()[0]
        self.kept.reshape(len(self.kept), -1)[begin + steps, path.cells[steps]] = kept

    def replace(self, old: Path, new: Path, begin: int) -> None:
        """Replace the searches of a drone from one step on by others."""
        self._set_kept(old, begin, 1.0)
        self._set_kept(new, begin, 1.0 - self.target.detection)
        self._masses_to = min(self._masses_to, begin)
        self._rests_from = max(self._rests_from, begin + len(new.searches) - 1)

    def update(self, begin: int, end: int) -> None:
        """Bring the masses up to date until before one step, and the rests from another one on."""
        chain = self.target.chain
        for now in range(self._masses_to, end):
            mass = self.masses[now] * chain.lift(self.kept[now])
            self.masses[now + 1] = chain.forward(mass, self.first + now)
        self._masses_to = max(self._masses_to, end)
        for now in range(self._rests_from - 1, begin - 1, -1):
            kept, worth = chain.lift(self.kept[now + 1]), self.target.worth[now + 1]
            value = kept * self.rests[now + 1] + (1.0 - kept) * worth
            self.rests[now] = chain.backward(value, self.first + now)
        self._rests_from = min(self._rests_from, begin)

    def likely(self, begin: int, end: int) -> Box:
        """The smallest box of the cells that the person may be in, in some steps, unless found.

        Searches do not count: one without gain may find the person once an earlier one is removed.
        """
        top, bottom, left, right = self._extents[:, begin:end]
        size = self.kept.shape[-1]
        return Box(int(top.min()), int(bottom.max()), int(left.min()), int(right.max()), size)

    @cached_property
    def _extents(self) -> Ints:
        """First row, last row + 1, first column and last column + 1 of the forecast, by step."""
        mass, extents = self.target.belief, []
        for step in range(len(self.kept)):
            is_likely: Flags = self.target.chain.map(mass) > NEGLIGIBLE
            rows, columns = (np.any(is_likely, axis=axis).nonzero()[0] for axis in (1, 0))
            extents.append((rows[0], rows[-1] + 1, columns[0], columns[-1] + 1))
            mass = self.target.chain.forward(mass, self.first + step)
        return np.array(extents).T

    def found(self) -> Floats:
        """The probability of finding the person in each step."""
        self.update(len(self.kept), len(self.kept) - 1)
        maps = self.target.chain.map(self.masses)
        found: Floats = ((1.0 - self.kept) * maps).sum(axis=(1, 2))
        return found
