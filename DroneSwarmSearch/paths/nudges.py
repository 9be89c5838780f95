"""Random changes of paths in a few steps: the candidates that improve plans of small searches."""

from __future__ import annotations

import numpy as np

from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch._internal.cells import cell_number, cell_position

FEWEST = 2  # steps that change
MOST = 6


def nudged(old: Ints, goals: Ints, count: int, size: int, rng: np.random.Generator) -> Ints:
    """Paths that leave the old ones for a random way, and come back to them in time.

    Args:
        old: the cells of K paths at the beginning and after each step: (L + 1, K).
        goals: the cells in which they must end, or -1 if the last step may lead anywhere: (K,).
        count: the number of new paths for each.
        size: cells along a side of the grid.
        rng: the random numbers.

    Returns:
        The cells: int64, (L + 1, K, count).
    """
    steps = len(old) - 1
    shape = (old.shape[1], count)
    first = rng.integers(0, steps, shape)
    last = np.minimum(first + rng.integers(FEWEST, MOST + 1, shape), steps)
    goes_anywhere = (last == steps) & (goals[:, None] < 0)
    end_x, end_y = cell_position(np.take_along_axis(old.T, last, axis=1), size)
    new = np.repeat(old[:, :, None], count, axis=2)
    for step in range(1, steps + 1):
        x, y = cell_position(new[step - 1], size)
        xs = np.array([x, x + 1, x - 1, x, x])
        ys = np.array([y, y, y, y + 1, y - 1])
        is_inside = (xs >= 0) & (xs < size) & (ys >= 0) & (ys < size)
        in_time = np.abs(xs - end_x) + np.abs(ys - end_y) <= last - step
        can = is_inside & (in_time | goes_anywhere)
        chosen = np.where(can, rng.random(can.shape), -1.0).argmax(axis=0)
        there = np.take_along_axis(cell_number(xs, ys, size), chosen[None], axis=0)[0]
        leaves = (step > first) & ((step < last) | goes_anywhere)
        new[step] = np.where(leaves, there, new[step])
    return new
