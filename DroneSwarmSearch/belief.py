"""The belief about a person after searches: Bayes' rule and drift.

While nobody has searched, the belief equals the matrix of the law. A search of cell k
with probability of detection q that finds nothing multiplies b(k) by 1 - q; all
searches of a step count together, then the belief is normalised. What normalisation
takes away is the probability that the searches would have succeeded. Then the belief
drifts as the person does (Stone, Theory of Optimal Search, 1975, treats both).

Arrays may have leading batch axes; the last two are [y, x].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["after_drift", "after_fruitless_search"]

Floats = NDArray[np.float64]


def after_fruitless_search(
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
    kept = float(flat.sum())
    if kept <= 0.0:
        return belief, 0.0
    after /= kept
    return after, kept


def after_drift(
    belief: Floats, right_x: Floats, left_x: Floats, right_y: Floats, left_y: Floats
) -> Floats:
    """The belief one step later.

    Args:
        belief: float64, shape (..., N, N), indexed [..., y, x].
        right_x: shape (..., N): the chance to move from each column to the next higher.
        left_x: the same to the next lower.
        right_y: shape (..., N): the chance to move from each row to the next higher.
        left_y: the same to the next lower.

    Returns:
        float64, of the belief's shape and with its sum.
    """
    right, left = right_x[..., None, :], left_x[..., None, :]
    across = belief * (1.0 - right - left)
    across[..., :, 1:] += (belief * right)[..., :, :-1]
    across[..., :, :-1] += (belief * left)[..., :, 1:]
    down, up = right_y[..., :, None], left_y[..., :, None]
    after = across * (1.0 - down - up)
    after[..., 1:, :] += (across * down)[..., :-1, :]
    after[..., :-1, :] += (across * up)[..., 1:, :]
    return after
