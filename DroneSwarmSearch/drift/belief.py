"""Bayesian updates of the belief about a missing person: searches, drift, and the mean.

Before the first search, the belief equals the person's forecast. A search of cell k with
probability of detection q that does not find the person multiplies b(k) by 1 - q. All
searches of a step are applied together, and then the belief is normalised; the sum before
normalisation is the probability that none of these searches finds the person. Finally, the
belief drifts like the person (L. D. Stone, Theory of Optimal Search, 1975).

The functions take one belief or a batch: arrays may have trailing batch axes after [y, x].
`Posteriors` is the fast form for a single search. Both agree bit for bit.
"""

from __future__ import annotations

from array import array
from collections.abc import Collection, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.drift.probability_matrix import ProbabilityMatrix

__all__ = [
    "Posteriors",
    "after_drift",
    "after_search",
    "after_unsuccessful_search",
    "drift",
    "mean_over_missing",
    "means_over_missing",
    "normalise",
    "shown_persons",
]

Floats = NDArray[np.float64]
FloatOrArray = TypeVar("FloatOrArray", float, Floats)


def after_unsuccessful_search(
    belief: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """The belief about one person after the searches of a step have not found that person.

    Args:
        belief: float64, shape (N, N), indexed [y, x], sums to 1.
        cells: the searched cells, y * N + x; a cell searched twice counts twice.
        probability_of_detection: the probability that a search of the person's cell
            finds the person.

    Returns:
        The new belief, and the probability that none of these searches finds the person. If
        that is 0, the searches contradict the belief, and the belief is returned unchanged.
    """
    after = belief.copy()
    flat = after.reshape(-1)
    for cell in cells:
        flat[cell] *= 1.0 - probability_of_detection
    missed = float(normalise(after))
    return (after, missed) if missed > 0.0 else (belief, 0.0)


def after_search(
    mass: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """One step's searches for one person, without normalising.

    Args:
        mass: float64, shape (N, N): probability that the person is in each cell and has not
            been found.
        cells: the searched cells, y * N + x, all different.
        probability_of_detection: the chance that a search of the right cell finds.

    Returns:
        The new mass, and the probability that these searches find the person (POS).
    """
    if not cells:
        return mass, 0.0
    after = mass.copy()
    flat = after.reshape(-1)
    searched = flat[cells]
    flat[cells] = (1.0 - probability_of_detection) * searched
    return after, probability_of_detection * float(searched.sum())


def normalise(belief: Floats, which: NDArray[np.bool_] | bool = True) -> Floats:
    """Scale beliefs in place so that each sums to 1; beliefs that are 0 everywhere stay.

    Args:
        belief: float64, shape (N, N, ...), indexed [y, x, ...].
        which: the beliefs to scale, bool, shape (...).

    Returns:
        The sums before, float64, shape (...).
    """
    # Sum over y first, then over x one column at a time: this order does not depend on the
    # batch. NumPy adds in this order along a first axis, but not along contiguous memory.
    columns = belief.sum(axis=0)
    total: Floats
    if columns.size > len(columns):
        total = columns.sum(axis=0)
    else:
        total = columns.reshape(-1).cumsum()[-1].reshape(columns.shape[1:])
    factor = 1.0 / np.where(which & (total > 0.0), total, 1.0)
    # Contiguous arrays multiply faster than broadcast ones.
    belief *= np.broadcast_to(factor, columns.shape).copy() if factor.ndim else factor
    return total


def after_drift(
    belief: Floats, right_x: Floats, left_x: Floats, right_y: Floats, left_y: Floats
) -> Floats:
    """The belief one step later.

    Args:
        belief: float64, shape (N, N, ...), indexed [y, x, ...].
        right_x: the probability of a move from each column to the next higher one, shape
            (N, ...); 0 in the last column.
        left_x: the same to the next lower column; 0 in the first.
        right_y: the probability of a move from each row to the next higher one, shape (N, ...).
        left_y: the same to the next lower row.

    Returns:
        float64, of the belief's shape and with its sum.
    """
    after = np.empty_like(belief)
    scratch = np.empty_like(belief), np.empty_like(belief)
    drift(belief, (right_x, left_x), (right_y, left_y), scratch, after)
    return after


def drift(
    belief: Floats,
    along_x: tuple[Floats, Floats],
    along_y: tuple[Floats, Floats],
    scratch: tuple[Floats, Floats],
    after: Floats,
) -> None:
    """`after_drift` into given arrays, all of them C-contiguous.

    Args:
        belief: as for `after_drift`.
        along_x: the probabilities of moves to the next higher column and the next lower one.
        along_y: the same for rows.
        scratch: two arrays of the belief's shape, overwritten.
        after: receives the result; may be the belief itself.
    """
    to_higher, to_lower = scratch
    cells, risen, fallen = after.reshape(-1), to_higher.reshape(-1), to_lower.reshape(-1)
    higher, lower = along_y
    for up, down, distance in (
        (*along_x, belief[0, 0].size),
        (higher[:, None], lower[:, None], belief[0].size),
    ):
        np.multiply(belief, up, out=to_higher)
        np.multiply(belief, down, out=to_lower)
        np.multiply(belief, 1.0 - up - down, out=after)
        # Nobody leaves the grid, so nothing wraps around from one row to the next, and the
        # array can be shifted as one run of memory.
        cells[distance:] += risen[:-distance]
        cells[:-distance] += fallen[distance:]
        belief = after


def mean_over_missing(beliefs: Sequence[FloatOrArray], missing: Collection[int]) -> FloatOrArray:
    """The mean belief about the missing persons, or about all persons if none is missing.

    Args:
        beliefs: of each person: arrays of one shape, or the numbers of a single cell.
        missing: the numbers of the missing persons, in ascending order.

    Returns:
        Of a belief's shape; for a single person, that person's belief itself.
    """
    if len(beliefs) == 1:
        return beliefs[0]
    first, *others = (beliefs[person] for person in missing) if missing else beliefs
    if not others:
        return first
    total = first
    for belief in others:
        total = total + belief
    return total / (1 + len(others))


def means_over_missing(beliefs: Sequence[Floats] | Floats, shown: NDArray[np.bool_]) -> Floats:
    """`mean_over_missing` for a batch.

    Args:
        beliefs: of each person, float64, all of one shape (...); or in one array.
        shown: see `shown_persons`; broadcasts to shape (persons, ...).

    Returns:
        Of a belief's shape; for a single person, that person's beliefs themselves.
    """
    if len(beliefs) == 1:
        single: Floats = beliefs[0]
        return single
    total = np.zeros(beliefs[0].shape)
    for belief, counts in zip(beliefs, shown, strict=True):
        np.add(total, belief, out=total, where=counts)
    mean: Floats = total / shown.sum(axis=0)
    return mean


def shown_persons(missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which persons each matrix of a batch shows: the missing ones, or all if none is missing.

    Args:
        missing: bool, shape (persons, n).
    """
    shown: NDArray[np.bool_] = missing | ~missing.any(axis=0)
    return shown


class Posteriors:
    """The beliefs about all persons of a single search, updated in place.

    The arithmetic of the functions above, operation by operation, in arrays that are
    allocated once; `start` begins an episode's beliefs.

    Args:
        forecasts: of each person.
        detections: each person's probability of detection.
    """

    def __init__(self, forecasts: Sequence[ProbabilityMatrix], detections: Sequence[float]) -> None:
        size = forecasts[0].grid_size
        self._forecasts = forecasts
        self._detections = detections
        self._beliefs = [np.empty((size, size)) for _ in forecasts]
        self._make_views()

    def _make_views(self) -> None:
        size = len(self._beliefs[0])
        self._cells: list[Any] = [belief.reshape(-1).data for belief in self._beliefs]
        # The probabilities of staying, moving up and moving down, first along x, then along y.
        self._along_x, self._along_y = np.empty((2, 3, size, size))
        self._after_x = self._along_x[0]
        stay, up, down = self._along_x.reshape(3, -1)
        self._add_x = (stay[1:], up[:-1], stay[1:]), (stay[:-1], down[1:], stay[:-1])
        stay, up, down = self._along_y.reshape(3, -1)
        self._add_y = stay[size:], up[:-size], stay[size:]
        self._last_row = stay[-size:]
        self._finish_y = [
            (stay[:-size], down[size:], belief.reshape(-1)[:-size]) for belief in self._beliefs
        ]

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes its own views and scratch arrays."""
        names = ("_forecasts", "_detections", "_beliefs")
        return {name: self.__dict__[name] for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._make_views()

    def start(self, step: int) -> None:
        """Set all beliefs to the forecasts at a step."""
        for forecast, belief in zip(self._forecasts, self._beliefs, strict=True):
            block = forecast.block(step)
            x, y = block.steps.probability[step - block.first]
            np.multiply(y[:, None], x, belief)

    def search(self, searched: Collection[int], missing: Collection[int]) -> None:
        """Apply searches that have not found the missing persons, see `normalise`.

        Args:
            searched: the searched cells, y * N + x, each once.
            missing: the numbers of the missing persons.
        """
        for person in missing:
            belief, cells = self._beliefs[person], self._cells[person]
            missed = 1.0 - self._detections[person]
            before = {cell: cells[cell] for cell in searched}
            for cell, value in before.items():
                cells[cell] = value * missed
            total = np.add.accumulate(np.add.reduce(belief, 0)).item(-1)
            if total > 0.0:
                np.multiply(belief, 1.0 / total, belief)
            else:  # the searches contradict the belief, which stays
                for cell, value in before.items():
                    cells[cell] = value

    def drift(self, step: int) -> None:
        """Let all beliefs drift from a step to the next, see `drift`."""
        for forecast, belief, finish in zip(self._forecasts, self._beliefs, self._finish_y):  # noqa: B905
            block = forecast.block(step)
            along_x, along_y = block.flows_at(step)
            np.multiply(belief, along_x, self._along_x)
            for terms in self._add_x:
                np.add(*terms)
            np.multiply(self._after_x, along_y, self._along_y)
            np.add(*self._add_y)
            np.add(*finish)
            belief[-1] = self._last_row

    def matrix(self, missing: Collection[int]) -> NDArray[np.float32]:
        """The matrix that the drones observe: float32, shape (N, N), indexed [y, x]; a new array.

        Args:
            missing: see `mean_over_missing`.
        """
        return mean_over_missing(self._beliefs, missing).astype(np.float32)

    def probabilities(self, searched: Collection[int], missing: Collection[int]) -> list[float]:
        """What `matrix` holds for some cells, y * N + x."""
        if len(self._cells) == 1:
            (cells,) = self._cells
            means = [cells[cell] for cell in searched]
        else:
            means = [
                mean_over_missing([cells[cell] for cells in self._cells], missing)
                for cell in searched
            ]
        return array("f", means).tolist()  # rounded to single precision
