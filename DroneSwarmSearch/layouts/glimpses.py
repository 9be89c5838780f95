"""The layout "glimpses": windows around the drone, fine and coarse, whatever the grid.

What is near is shown cell by cell, what is far in larger and larger boxes, as the eye sees
(a "glimpse sensor": V. Mnih, N. Heess, A. Graves, K. Kavukcuoglu, Recurrent models of visual
attention, NeurIPS 2014). The length does not depend on the size of the grid nor on the
number of drones, so that one network serves all searches.
"""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from DroneSwarmSearch.layouts.layout import Layout, Positions, Singles

__all__ = ["LENGTH", "SCALES", "WINDOW", "GlimpsesLayout"]

WINDOW = 5
"""Boxes along each side of a window; odd, so that the drone is in the middle one."""

SCALES = (1, 3, 9, 27)
"""Cells along each side of a box, for each window; odd, for the same reason."""

LENGTH = 2 * len(SCALES) * WINDOW**2 + 2
"""Of what a drone is shown."""

FAINT = 1e-6
"""The least maximum of a matrix that is told from smaller ones."""


class GlimpsesLayout(Layout):
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
        self._boxes = WINDOW**2
        # Windows one behind another: probabilities of a scale, then drones of that scale.
        self._starts = [2 * place * self._boxes for place in range(len(SCALES))]
        high = np.ones(LENGTH, np.float32)
        for start in self._starts:
            high[start + self._boxes : start + 2 * self._boxes] = n_drones - 1
        low = np.zeros(LENGTH, np.float32)
        low[-1] = -1.0
        self.space = spaces.Box(low, high, dtype=np.float32)
        # For each scale, [column or row of the drone, border]: where along an axis boxes
        # begin and end, cut off at the edges of the grid.
        borders = np.arange(WINDOW + 1) - WINDOW // 2
        axis = np.arange(grid_size)[:, None]
        self._borders = [
            np.clip(axis + borders * scale - scale // 2, 0, grid_size) for scale in SCALES
        ]
        # Products with this sum up along an axis, several times as fast as cumsum.
        self._summing = np.triu(np.ones((grid_size, grid_size), np.float32))
        # For each scale, [offset + N - 1]: the box of a window's axis that a drone is in
        # whose cell lies so far from one's own; beyond all boxes if it is out of the window.
        offsets = np.arange(1 - grid_size, grid_size)
        self._axes = []
        for scale in SCALES:
            boxes = (offsets + scale // 2) // scale + WINDOW // 2
            self._axes.append(np.where((boxes < 0) | (boxes >= WINDOW), self._boxes, boxes))
        self._is_other = ~np.eye(n_drones, dtype=np.bool_)

    def write(self, positions: Positions, matrices: Singles, left: Singles, out: Singles) -> None:
        highest = matrices.max(axis=(1, 2))
        self._write_boxes(positions, matrices, highest, out)
        self._write_others(positions, out)
        out[..., -2] = left[:, None]
        out[..., -1] = (np.log10(np.maximum(highest, FAINT)) / -np.log10(FAINT))[:, None]

    def _write_boxes(
        self, positions: Positions, matrices: Singles, highest: Singles, out: Singles
    ) -> None:
        """Write the windows of probabilities, by way of sums over rectangles."""
        searches, width = len(matrices), self.grid_size + 1
        # [search, y, x]: the sum over all cells above and to the left.
        sums = np.zeros((searches, width, width), np.float32)
        sums[:, 1:, 1:] = self._summing.T @ (matrices @ self._summing)
        of_search = (np.arange(searches) * width**2)[:, None, None]
        for start, scale, borders in zip(self._starts, SCALES, self._borders, strict=True):
            across = borders.take(positions[..., 0], axis=0)
            down = borders.take(positions[..., 1], axis=0) * width + of_search
            corners = sums.reshape(-1).take(down[..., :, None] + across[..., None, :])
            strips = corners[..., 1:, :] - corners[..., :-1, :]
            boxes = strips[..., 1:] - strips[..., :-1]
            boxes /= (highest * scale**2)[:, None, None, None]
            np.clip(boxes, 0.0, 1.0, out=boxes)  # rounding
            np.sqrt(boxes, out=boxes)
            out[..., start : start + self._boxes] = boxes.reshape(searches, -1, self._boxes)

    def _write_others(self, positions: Positions, out: Singles) -> None:
        """Write the windows of the other drones."""
        searches, drones = positions.shape[:2]
        # [search, drone, other]: how far the other is to the right and down, plus N - 1.
        offsets = positions[:, None, :] - positions[:, :, None] + (self.grid_size - 1)
        across, down = offsets[..., 0], offsets[..., 1]
        slots = np.arange(searches * drones).reshape(searches, drones, 1) * self._boxes
        for start, axis in zip(self._starts, self._axes, strict=True):
            boxes = axis.take(down) * WINDOW + axis.take(across)
            seen = (boxes < self._boxes) & self._is_other
            counts = np.bincount((slots + boxes)[seen], minlength=slots.size * self._boxes)
            first = start + self._boxes
            out[..., first : first + self._boxes] = counts.reshape(searches, drones, -1)
