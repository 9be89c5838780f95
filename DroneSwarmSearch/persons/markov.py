"""Persons who drift by any Markov chain over the cells of a grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats, Ints
from DroneSwarmSearch._internal.cells import cell_position
from DroneSwarmSearch.persons.known import KnownDrift

TOLERANCE = 1e-6
"""How far the sum of a row may be from 1, as those of single precision are; it is then scaled."""

_WHAT = "an array or a SciPy sparse matrix of shape (N², N²), or a callable of the step"


class Moves(NamedTuple):
    """The moves of a step that have a probability above 0, by source, then by target.

    Attributes:
        sources: the cells that they leave, y * N + x: int64, (E,).
        targets: the cells that they lead to: int64, (E,).
        chances: their probabilities; those from one cell sum to 1: float64, (E,).
    """

    sources: Ints
    targets: Ints
    chances: Floats


class MarkovDrift(KnownDrift):
    """A Markov chain over the cells: a motion model of your own.

    The person starts in a cell, or in one drawn from a map, and in each step moves to any cell
    with the probabilities of a row of `transitions`::

        stay_or_step = ...  # (N², N²): from cell y * N + x in each row to all cells
        Person(MarkovDrift((4, 4), stay_or_step), probability_of_detection=0.8)

    Args:
        start: a cell (x, y), or weights of the cells, (N, N), indexed [y, x], at least 0, which are
            scaled to sum to 1.
        transitions: the probability of each move from a cell, row y * N + x, to a cell, column
            y * N + x: an array or a SciPy sparse matrix of shape (N², N²), whose rows sum to 1; or
            a callable that returns one for the number of completed steps. It must return the same
            for the same step.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits. What a callable returns is checked when a
            search uses it.
    """

    outline = " by a Markov chain"

    def __init__(
        self, start: ArrayLike, transitions: ArrayLike | Callable[[int], ArrayLike]
    ) -> None:
        self._start = _checked_start(start)
        self._of_step = transitions if callable(transitions) else None
        self._constant: Moves | None = None
        self.size: int | None = None
        if not callable(transitions):
            self._constant, self.size = _moves("transitions", transitions)
        if self._start.ndim == 2:
            if self.size not in (None, len(self._start)):
                raise ValueError(
                    f"start must be a map of {self.size} x {self.size} cells, as transitions are, "
                    f"got {len(self._start)} x {len(self._start)}"
                )
            self.size = len(self._start)
        by_step = self._of_step
        parts = self._constant if by_step is None else None
        moves = by_step if parts is None else tuple(part.tobytes() for part in parts)
        self.key = (self._start.tobytes(), self._start.shape, moves)

    def __eq__(self, other: object) -> bool:
        return self.key == other.key if isinstance(other, MarkovDrift) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.key)

    def __repr__(self) -> str:
        what = "transitions by step"
        if self._constant is not None:
            what = f"{len(self._constant.chances):,} moves"
        start = "a map"
        if self._start.ndim == 1:
            start = str(tuple(self._start.tolist()))
        return f"<MarkovDrift: from {start}, {what}>"

    @property
    def is_constant(self) -> bool:
        """Whether the probabilities are the same in all steps."""
        return self._constant is not None

    def start_map(self, grid_size: int) -> Floats:
        """The probability of each cell at the start: float64, (N, N), a new array."""
        if self._start.ndim == 2:
            return self._start.copy()
        x, y = self._start.astype(np.int64).tolist()
        start = np.zeros((grid_size, grid_size))
        start[y, x] = 1.0
        return start

    def moves(self, step: int, grid_size: int) -> Moves:
        """The moves from a step to the next.

        Raises:
            TypeError: a callable returned no numbers.
            ValueError: it returned probabilities that are out of their limits.
        """
        if self._constant is not None:
            return self._constant
        assert self._of_step is not None
        moves, size = _moves(f"transitions({step})", self._of_step(step))
        if size != grid_size:
            raise ValueError(
                f"transitions({step}) must be of shape ({grid_size**2}, {grid_size**2}), got "
                f"({size**2}, {size**2})"
            )
        return moves

    @property
    def vector(self) -> tuple[float, float]:  # type: ignore[override]
        """The mean move from the start in the first step, in cells, (x, y)."""
        size = self.size
        if size is None:
            assert self._of_step is not None
            _, size = _moves("transitions(0)", self._of_step(0))
        now = self.moves(0, size)
        here = self.start_map(size).reshape(-1)[now.sources] * now.chances
        from_x, from_y = cell_position(now.sources, size)
        to_x, to_y = cell_position(now.targets, size)
        return float(here @ (to_x - from_x)), float(here @ (to_y - from_y))

    def check(self, grid_size: int, timestep_limit: int, name: str) -> None:
        if self.size is not None and self.size != grid_size:
            raise ValueError(
                f"{name} has a Markov chain on {self.size} x {self.size} cells, got "
                f"grid_size={grid_size}"
            )
        if self._start.ndim == 1:
            checks.cell(f"the start of {name}", self._start.astype(np.int64).tolist(), grid_size)
        self.moves(0, grid_size)

    def mass_beyond(self, grid_size: int, step: int) -> float:
        return 0.0  # the chain never leaves the grid

    def to_dict(self) -> dict[str, Any]:
        if self._constant is None:
            raise TypeError(
                "a MarkovDrift whose transitions are a callable cannot be saved; give an array"
            )
        moves = [part.tolist() for part in self._constant]
        names = ("sources", "targets", "chances")
        start = self._start.astype(np.int64) if self._start.ndim == 1 else self._start
        return {
            "markov": {
                "start": start.tolist(),
                "size": self.size,
                **dict(zip(names, moves, strict=True)),
            }
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> MarkovDrift:
        """Make one from the value of "markov" in the output of `to_dict`."""
        names = ("start", "size", "sources", "targets", "chances")
        values = checks.known_keys("markov", data, names, ValueError)
        size = checks.integer("size", values.get("size"), 2)
        checks.fits("the transitions", 8 * size**4, grid_size=size)
        transitions = np.zeros((size**2, size**2))
        what = f"cells, integers from 0 to {size**2 - 1}"
        sources, targets = (
            checks.integer_array(name, values.get(name), what, 0, size**2 - 1)
            for name in names[2:4]
        )
        what = "a number for each of sources and targets"
        chances = checks.numbers("chances", values.get("chances"), what)
        if not sources.shape == targets.shape == chances.shape:
            raise ValueError(f"chances must be {what}, got shape {chances.shape}")
        transitions[sources, targets] = chances
        return cls(values.get("start"), transitions)  # type: ignore[arg-type]


def _checked_start(start: ArrayLike) -> Floats:
    """A cell, (2,), or a map whose sum is 1, (N, N)."""
    what = "a cell (x, y), or weights of the cells of shape (N, N)"
    given = checks.numbers("start", start, what)
    if given.shape == (2,):
        if (given != np.floor(given)).any() or (given < 0).any():
            raise ValueError(f"start must be {what}, got {start!r:.100}")
        return given.astype(np.float64)
    if given.ndim != 2 or given.shape[0] != given.shape[1] or len(given) < 2:
        raise ValueError(f"start must be {what}, got shape {given.shape}")
    weights = given.astype(np.float64)
    if not np.isfinite(weights).all() or weights.min() < 0.0 or weights.max() == 0.0:
        raise ValueError("start must hold finite weights of at least 0, not all 0")
    weights = weights / weights.max()
    scaled: Floats = weights / weights.sum()
    return scaled


def _moves(name: str, transitions: Any) -> tuple[Moves, int]:
    """The moves of a matrix of transitions, and the cells along each side of its grid."""
    if hasattr(transitions, "tocoo"):  # a sparse matrix of SciPy
        sparse = transitions.tocoo()
        shape = sparse.shape
        sources = np.asarray(sparse.row, np.int64)
        targets = np.asarray(sparse.col, np.int64)
        chances = np.asarray(sparse.data, np.float64)
    else:
        given = checks.numbers(name, transitions, _WHAT)
        shape = given.shape
        if given.ndim == 2:
            sources, targets = given.nonzero()
            chances = given[sources, targets].astype(np.float64)
    size = round(shape[0] ** 0.5) if len(shape) == 2 else 0
    if len(shape) != 2 or shape[0] != shape[1] or size**2 != shape[0] or size < 2:
        raise ValueError(f"{name} must be {_WHAT}, got shape {shape}")
    _check_chances(name, chances, sources, size)
    keys, index = np.unique(sources * size**2 + targets, return_inverse=True)
    sums: Any = np.bincount(index, chances, len(keys))  # a sparse matrix may repeat entries
    keys = keys[sums > 0.0]
    chances = sums[sums > 0.0]
    sources, targets = np.divmod(keys, size**2)
    chances = chances / np.bincount(sources, chances, size**2)[sources]
    return Moves(sources, targets, chances), size


def _check_chances(name: str, chances: Floats, sources: Ints, size: int) -> None:
    """Raise a ValueError unless all are probabilities, and those from each cell sum to 1."""
    if not (np.isfinite(chances).all() and (chances >= 0.0).all()):
        raise ValueError(f"{name} must hold finite probabilities of at least 0")
    sums = np.bincount(sources, chances, size**2)
    wrong = np.abs(sums - 1.0) > TOLERANCE
    if wrong.any():
        row = int(wrong.argmax())
        x, y = cell_position(row, size)
        raise ValueError(
            f"the rows of {name} must sum to 1, got {sums[row]:.9g} in row {row}, cell ({x}, {y})"
        )
