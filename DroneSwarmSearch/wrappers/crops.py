"""The layout "crops": windows around the drone, fine and coarse, whatever the grid.

What is near is shown cell by cell, what is far in larger and larger boxes, as the eye sees
(a "crop sensor": V. Mnih, N. Heess, A. Graves, K. Kavukcuoglu, Recurrent models of visual
attention, NeurIPS 2014). The length does not depend on the size of the grid nor on the
number of drones, so that one network serves all searches.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.wrappers.layout import Layout, Positions, Singles
from DroneSwarmSearch.wrappers.layout_observation import LayoutObservation

__all__ = ["LENGTH", "SCALES", "WINDOW", "CropsLayout", "CropsObservation"]

WINDOW = 5
"""Boxes along each side of a window; odd, so that the drone is in the middle one."""

SCALES = (1, 3, 9, 27)
"""Cells along each side of a box, for each window; odd, for the same reason."""

LENGTH = 2 * len(SCALES) * WINDOW**2 + 2
"""Of what a drone is shown."""

FAINT = 1e-6
"""The least maximum of a matrix that is told from smaller ones."""

_DRONES_AT_ONCE = 1000
"""What the windows of so many are made from fits a cache. No power of two: numbers that lie
such a distance apart would drive each other out of it."""


class CropsLayout(Layout):
    """For each drone a vector: float32, length 2 * 4 * 5² + 2 = 202.

    For each scale, of boxes of 1, 3, 9 and 27 cells a side: a window of 5 x 5 boxes around
    the drone, row by row, with the square root of the mean probability of each box's cells,
    the matrix's maximum scaled to 1 and cells off the grid counting 0; and the same window
    with the number of other drones in each box. Then the share of the steps left, and the
    logarithm of the matrix's maximum, from 1e-6 to 1, scaled to [-1, 0].

    The square root lifts what is slight: where a matrix is spread out, cells differ little.
    """

    def __init__(self, grid_size: int, n_drones: int) -> None:
        super().__init__(grid_size, n_drones)
        checks.fits("which drones are others", n_drones**2, n_drones=n_drones)
        # [scale, probabilities or drones, box]: how the windows lie in what a drone is shown.
        self._windows = (len(SCALES), 2, WINDOW**2)
        high = np.ones(LENGTH, np.float32)
        high[:-2].reshape(self._windows)[:, 1] = n_drones - 1
        low = np.zeros(LENGTH, np.float32)
        low[-1] = -1.0
        self.space = spaces.Box(low, high, dtype=np.float32)
        scales = np.array(SCALES)[:, None]
        # [scale, border, column or row of the drone]: where along an axis boxes begin and
        # end, cut off at the edges of the grid.
        borders = (np.arange(WINDOW + 1) - WINDOW // 2) * scales - scales // 2
        self._borders = np.clip(borders[..., None] + np.arange(grid_size), 0, grid_size)
        self._areas = (scales**2).astype(np.float32)[..., None, None]  # of boxes, in cells
        # Products with this sum up along an axis, several times as fast as cumsum.
        self._summing = np.triu(np.ones((grid_size, grid_size), np.float32))
        # [scale, offset + N - 1]: the box of a window's axis that a drone is in whose cell
        # lies so far from one's own; beyond all boxes if it is out of the window.
        offsets = np.arange(1 - grid_size, grid_size)
        boxes = (offsets + scales // 2) // scales + WINDOW // 2
        self._axes = np.where((boxes < 0) | (boxes >= WINDOW), WINDOW**2, boxes)
        self._is_other = ~np.eye(n_drones, dtype=np.bool_)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        count = max(1, _DRONES_AT_ONCE // self.n_drones)
        for first in range(0, len(positions), count):
            here = slice(first, first + count)
            self._write_some(positions[here], matrices[here], left[here], out[here])

    def _write_some(
        self, positions: Positions, matrices: Singles, left: Singles, out: Singles
    ) -> None:
        highest = matrices.max(axis=(1, 2))
        windows = out[..., :-2].reshape(*out.shape[:2], *self._windows)
        self._write_boxes(positions, matrices, highest, windows[..., 0, :])
        self._write_others(positions, windows[..., 1, :])
        out[..., -2] = left[:, None]
        out[..., -1] = (np.log10(np.maximum(highest, FAINT)) / -np.log10(FAINT))[:, None]

    def _write_boxes(
        self, positions: Positions, matrices: Singles, highest: Singles, out: Singles
    ) -> None:
        """Write the windows of probabilities, by way of sums over rectangles.

        Args:
            positions: as for `write`.
            matrices: likewise.
            highest: their maxima.
            out: float32, shape (searches, drones, scales, boxes).
        """
        searches, drones, scales, boxes = out.shape
        width = self.grid_size + 1
        # [search, y, x]: the sum over all cells above and to the left.
        sums = np.zeros((searches, width, width), np.float32)
        sums[:, 1:, 1:] = self._summing.T @ (matrices @ self._summing)
        # With the drones as the last axis, which is long, all the others are fast.
        x, y = positions.reshape(-1, 2).T
        across = self._borders.take(x, axis=2)
        down = self._borders.take(y, axis=2) * width
        down += np.arange(0, sums.size, width**2).repeat(drones)
        corners = sums.reshape(-1).take(down[:, :, None] + across[:, None], mode="clip")
        strips = corners[:, 1:] - corners[:, :-1]
        means = strips[:, :, 1:] - strips[:, :, :-1]
        means /= highest.repeat(drones) * self._areas
        np.clip(means, 0.0, 1.0, out=means)  # rounding
        np.sqrt(means, out=means)
        out[...] = means.reshape(scales, boxes, searches, drones).transpose(2, 3, 0, 1)

    def _write_others(self, positions: Positions, out: Singles) -> None:
        """Write the windows of the other drones.

        Args:
            positions: as for `write`.
            out: float32, shape (searches, drones, scales, boxes).
        """
        searches, drones, scales, boxes = out.shape
        # [search, drone, other]: how far the other is to the right and down, plus N - 1.
        offsets = positions[:, None, :] - positions[:, :, None] + (self.grid_size - 1)
        # [scale, search, drone, other]: the box that the other is in.
        across, down = (self._axes.take(offsets[..., axis], axis=1) for axis in (0, 1))
        box = down * WINDOW + across
        seen = (box < boxes) & self._is_other
        first = np.arange(0, out.size, boxes).reshape(searches, drones, 1, scales)
        places = first.transpose(3, 0, 1, 2) + box  # in `out`, flat
        out[...] = np.bincount(places[seen], minlength=out.size).reshape(out.shape)


class CropsObservation(LayoutObservation):
    """Shows each drone the matrix and the other drones in windows around itself.

    float32, shape (202,), whatever the size of the grid and the number of drones, see
    `layouts.crops`. The policy "ppo" sees this.

    Args:
        env: the environment.

    Raises:
        TypeError: `env` is no `DroneSwarmSearch` and no wrapper of one.
        ValueError: it has masks in its observations.
    """

    def __init__(self, env: ParallelEnv[str, Any, int]) -> None:
        super().__init__(env, CropsLayout)
