"""Bayesian updates of the belief about a missing person: searches, drift, and the mean.

A belief is the joint probability of a person's hypothesis and cell, indexed
[hypothesis, y, x]. Before the first search, it equals the person's forecast. A search of cell
k with probability of detection q that does not find the person multiplies b(h, k) by 1 - q
for every hypothesis h. All searches of a step are applied together, and then the belief is
normalised; the sum before normalisation is the probability that none of these searches finds
the person. Finally, each hypothesis drifts by its own moves (L. D. Stone, Theory of Optimal
Search, 1975).

The product of these sums is the probability that no search so far has found the person; one
minus it is the cumulative probability of success (POS).

The functions take one belief or a batch: arrays may have trailing batch axes after
[hypothesis, y, x]. `posteriors.Posteriors` is the fast form for a single search. Both agree
bit for bit.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "after_drift",
    "after_search",
    "after_unsuccessful_search",
    "drift",
    "mean_over_missing",
    "means_over_missing",
    "normalise",
    "over_hypotheses",
    "shown_persons",
]

Floats = NDArray[np.float64]
FloatOrArray = TypeVar("FloatOrArray", float, Floats)


def after_unsuccessful_search(
    belief: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """The belief about one person after the searches of a step have not found that person.

    Args:
        belief: float64, shape (M, N, N), indexed [hypothesis, y, x], sums to 1.
        cells: the searched cells, y * N + x; a cell searched twice counts twice.
        probability_of_detection: the probability that a search of the person's cell
            finds the person.

    Returns:
        The new belief, and the probability that none of these searches finds the person. If
        that is 0, the searches contradict the belief, and the belief is returned unchanged.
    """
    after = belief.copy()
    by_cell = after.reshape(len(after), -1)
    for cell in cells:
        by_cell[:, cell] *= 1.0 - probability_of_detection
    missed = min(float(normalise(after)), 1.0)
    return (after, missed) if missed > 0.0 else (belief, 0.0)


def after_search(
    mass: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """One step's searches for one person, without normalising.

    Args:
        mass: float64, shape (M, N, N): probability of each hypothesis and cell, and that the
            person has not been found.
        cells: the searched cells, y * N + x, all different.
        probability_of_detection: the probability that a search of the person's cell finds the
            person.

    Returns:
        The new mass, and the probability that these searches find the person (POS).
    """
    if not cells:
        return mass, 0.0
    after, within = mass.copy(), 0.0
    for flat in after.reshape(len(after), -1):  # faster than two indices at once
        searched = flat[cells]
        flat[cells] = (1.0 - probability_of_detection) * searched
        within += float(searched.sum())
    return after, probability_of_detection * within


def normalise(belief: Floats, which: NDArray[np.bool_] | bool = True) -> Floats:
    """Scale beliefs in place so that each sums to 1; beliefs that are 0 everywhere stay.

    Args:
        belief: float64, shape (M, N, N, ...), C-contiguous.
        which: the beliefs to scale, bool, shape (...).

    Returns:
        The sums before, float64, shape (...).
    """
    # Sum over hypotheses and y first, then over x one column at a time: this order does not
    # depend on the batch. NumPy adds in this order along a first axis, but not along
    # contiguous memory.
    columns = belief.reshape(-1, *belief.shape[2:]).sum(axis=0)
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
        belief: float64, shape (M, N, N, ...), indexed [hypothesis, y, x, ...].
        right_x: the probability of a move from each column to the next higher one, shape
            (M, N, ...); 0 in the last column.
        left_x: the same to the next lower column; 0 in the first.
        right_y: the probability of a move from each row to the next higher one, shape
            (M, N, ...).
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
    (right, left), (higher, lower) = along_x, along_y
    for up, down, distance in (
        (right[:, None], left[:, None], belief[0, 0, 0].size),
        (higher[:, :, None], lower[:, :, None], belief[0, 0].size),
    ):
        np.multiply(belief, up, out=to_higher)
        np.multiply(belief, down, out=to_lower)
        np.multiply(belief, 1.0 - up - down, out=after)
        # Nobody leaves the grid, so nothing wraps around from one row or hypothesis to the
        # next, and the array can be shifted as one run of memory.
        cells[distance:] += risen[:-distance]
        cells[:-distance] += fallen[distance:]
        belief = after


def over_hypotheses(belief: Floats) -> Floats:
    """The probability of each cell: float64, shape (N, N, ...).

    Args:
        belief: float64, shape (M, N, N, ...).

    Returns:
        The sum over hypotheses; for a single one, its part of the belief itself.
    """
    total: Floats = belief[0]
    for part in belief[1:]:
        total = total + part
    return total


def mean_over_missing(beliefs: Sequence[FloatOrArray], missing: Collection[int]) -> FloatOrArray:
    """The mean belief about the missing persons, or about all persons if none is missing.

    Args:
        beliefs: of each person, see `over_hypotheses`: arrays of one shape, or the numbers of
            a single cell.
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
