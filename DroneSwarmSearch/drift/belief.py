"""The belief about a person after searches: Bayes' rule and drift.

While nobody has searched, the belief equals the matrix of the forecast. A search of cell k
with probability of detection q that finds nothing multiplies b(k) by 1 - q; all
searches of a step count together, then the belief is normalised. What normalisation
takes away is the probability that the searches would have succeeded. Then the belief
drifts as the person does (Stone, Theory of Optimal Search, 1975, treats both).

Arrays may have trailing batch axes; the first two are [y, x].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "after_drift",
    "after_search",
    "after_unsuccessful_search",
    "mean_over_missing",
    "means_over_missing",
    "normalise",
    "shown_persons",
]

Floats = NDArray[np.float64]


def after_unsuccessful_search(
    belief: Floats, cells: Sequence[int], probability_of_detection: float
) -> tuple[Floats, float]:
    """The belief about one person once a step's searches have not found that person.

    Args:
        belief: float64, shape (N, N), indexed [y, x], sums to 1.
        cells: the searched cells, y * N + x; a cell searched twice counts twice.
        probability_of_detection: the chance that a search of the right cell finds.

    Returns:
        The new belief, and the probability that these searches find nothing. Where that
        is 0 the searches contradict the belief, which is then returned as it was.
    """
    after = belief.copy()
    flat = after.reshape(-1)
    for cell in cells:
        flat[cell] *= 1.0 - probability_of_detection
    kept = float(normalise(after))
    return (after, kept) if kept > 0.0 else (belief, 0.0)


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
    """Scale beliefs in place so that each sums to 1; those that are 0 everywhere stay.

    Args:
        belief: float64, shape (N, N, ...), indexed [y, x, ...].
        which: the beliefs meant, shape (...); the others stay as well.

    Returns:
        The sums before, float64, shape (...).
    """
    # Columns first, then one after another: an order of summation that does not depend on
    # the batch, so that one belief and a batch of thousands agree to the last bit. NumPy
    # sums so along a first axis, but what lies in one run of memory in another order.
    columns = belief.sum(axis=0)
    total: Floats
    if columns.size > len(columns):
        total = columns.sum(axis=0)
    else:
        total = columns.reshape(-1).cumsum()[-1].reshape(columns.shape[1:])
    factor = 1.0 / np.where(which & (total > 0.0), total, 1.0)
    # Long runs of memory multiply faster.
    belief *= np.broadcast_to(factor, columns.shape).copy() if factor.ndim else factor
    return total


def after_drift(
    belief: Floats, right_x: Floats, left_x: Floats, right_y: Floats, left_y: Floats
) -> Floats:
    """The belief one step later.

    Args:
        belief: float64, shape (N, N, ...), indexed [y, x, ...].
        right_x: shape (N, ...): the chance to move from each column to the next higher;
            0 in the last.
        left_x: the same to the next lower; 0 in the first.
        right_y: shape (N, ...): the chance to move from each row to the next higher.
        left_y: the same to the next lower.

    Returns:
        float64, of the belief's shape and with its sum.
    """
    after = np.empty_like(belief)
    spare = np.empty_like(belief), np.empty_like(belief)
    drift(belief, (right_x, left_x), (right_y, left_y), spare, after)
    return after


def drift(
    belief: Floats,
    along_x: tuple[Floats, Floats],
    along_y: tuple[Floats, Floats],
    spare: tuple[Floats, Floats],
    after: Floats,
) -> None:
    """`after_drift` in arrays that are given, all of them C-contiguous.

    Args:
        belief: as there.
        along_x: the chances to move to the next higher column and to the next lower one.
        along_y: the same for rows.
        spare: two arrays to work in.
        after: for the result; it may be the belief's own array.
    """
    to_higher, to_lower = spare
    cells, risen, fallen = after.reshape(-1), to_higher.reshape(-1), to_lower.reshape(-1)
    higher, lower = along_y
    for right, left, distance in (
        (*along_x, belief[0, 0].size),
        (higher[:, None], lower[:, None], belief[0].size),
    ):
        np.multiply(belief, right, out=to_higher)
        np.multiply(belief, left, out=to_lower)
        np.multiply(belief, 1.0 - right - left, out=after)
        # Nobody leaves the grid, so what a shift carries out of one row of cells into the
        # next is zero: everything can be shifted as one run of memory.
        cells[distance:] += risen[:-distance]
        cells[:-distance] += fallen[distance:]
        belief = after


def mean_over_missing(beliefs: Sequence[Floats], missing: Sequence[int]) -> Floats:
    """The mean belief about the missing persons, or about all persons once none is missing.

    Args:
        beliefs: of each person, float64, all of one shape.
        missing: the numbers of the missing persons, in ascending order.

    Returns:
        float64, of a belief's shape; with one person shown, that person's belief itself.
    """
    shown = missing or range(len(beliefs))
    total = beliefs[shown[0]]
    for person in shown[1:]:
        total = total + beliefs[person]
    return total / len(shown) if len(shown) > 1 else total


def means_over_missing(beliefs: Sequence[Floats], shown: NDArray[np.bool_]) -> Floats:
    """`mean_over_missing` for a batch, equal to it bit for bit.

    Args:
        beliefs: of each person, float64, all of one shape (...).
        shown: see `shown_persons`; broadcasts to shape (persons, ...).
    """
    total = np.zeros(beliefs[0].shape)
    for belief, counts in zip(beliefs, shown, strict=True):
        np.add(total, belief, out=total, where=counts)
    mean: Floats = total / shown.sum(axis=0)
    return mean


def shown_persons(missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which persons each matrix of a batch shows: the missing ones, or all once none is missing.

    Args:
        missing: bool, shape (persons, n).
    """
    shown: NDArray[np.bool_] = missing | ~missing.any(axis=0)
    return shown
