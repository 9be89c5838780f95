"""The layout "crops": multi-scale egocentric windows, of one size for all searches.

Close to the drone, the windows show single cells; farther away, ever larger boxes, like the
retina (the "glimpse sensor" of V. Mnih, N. Heess, A. Graves, K. Kavukcuoglu, Recurrent models
of visual attention, NeurIPS 2014). The length depends neither on the grid size nor on the
number of drones, so one network can be used for all searches.
"""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from DroneSwarmSearch._internal.arrays import Singles
from DroneSwarmSearch.layouts.layout import Heard, Layout, Positions, Sight, maxima

WINDOW = 5  # boxes along each side of a window; odd, so that the drone is in the middle box

SCALES = (1, 3, 9, 27)
"""Cells along each side of a box, for each window; odd, so that the drone is in the middle."""

LENGTH = 2 * len(SCALES) * WINDOW**2 + 2  # the length of an observation
_NO_BOX = len(SCALES) * WINDOW**2  # the number after those of all boxes
_OWN_BOXES = slice(WINDOW**2 // 2, _NO_BOX, WINDOW**2)  # the middle box of each scale

_LEAST_MAXIMUM = 1e-6  # smaller maxima of a matrix are shown as this one
_DECADES = -np.log10(_LEAST_MAXIMUM)

_CHUNK_DRONES = 1000
"""Drones processed at once, so that temporary arrays fit a cache. Not a power of two, because
array elements at such distances would evict each other from the cache."""


class CropsLayout(Layout):
    """For each drone a vector: float32, length 2 * 4 * 5² + 2 = 202.

    For each scale, with boxes of 1, 3, 9 and 27 cells per side: a window of 5 x 5 boxes around
    the drone, row by row, with the square root of the mean probability of each box's cells,
    the matrix's maximum scaled to 1 and cells off the grid counting 0; and the same window
    with the number of other drones in each box. Then the remaining time fraction, and the
    logarithm of the matrix's maximum, from 1e-6 to 1, scaled to [-1, 0].

    With `radio`, the matrix is the drone's own, and another drone counts in the box where it was
    last heard: 1 if it is in range, less the fraction of the time limit since then.

    The square root makes small probabilities visible.
    """

    def __init__(self, grid_size: int, n_drones: int, radio: bool = False) -> None:
        super().__init__(grid_size, n_drones, radio)
        # [scale, probabilities or drones, box]: the windows within an observation.
        self._windows = (len(SCALES), 2, WINDOW**2)
        high = np.ones(LENGTH, np.float32)
        # At least 1, because Gymnasium's checker warns of equal limits.
        high[:-2].reshape(self._windows)[:, 1] = max(n_drones - 1, 1)
        low = np.zeros(LENGTH, np.float32)
        low[-1] = -1.0
        self.space = spaces.Box(low, high, dtype=np.float32)
        scales = np.array(SCALES)[:, None]
        # [scale, border, column or row of the drone]: the borders of the boxes along an axis,
        # clipped to the grid.
        borders = (np.arange(WINDOW + 1) - WINDOW // 2) * scales - scales // 2
        self._columns = np.clip(borders[..., None] + np.arange(grid_size), 0, grid_size)
        self._rows = self._columns * (grid_size + 1)  # as offsets in a flat table
        self._areas = (scales**2).astype(np.float32)[..., None]  # of boxes, in cells
        # A product with this matrix is a cumulative sum, several times as fast as cumsum.
        self._summing = np.triu(np.ones((grid_size, grid_size), np.float32))
        # [offset down and to the right, scale]: which of all boxes hold a drone at this offset, or
        # `_NO_BOX`. Offsets are in a square of this reach, row by row.
        self._reach = min(grid_size - 1, (WINDOW * SCALES[-1]) // 2 + 1)
        offsets = np.arange(-self._reach, self._reach + 1)
        along = (offsets + scales // 2) // scales + WINDOW // 2  # (scales, offsets)
        is_seen = (along >= 0) & (along < WINDOW)
        first_box = WINDOW**2 * np.arange(len(SCALES))[:, None, None]  # of a scale
        boxes = first_box + along[:, :, None] * WINDOW + along[:, None]
        is_seen_both = is_seen[:, :, None] & is_seen[:, None]
        self._boxes = np.where(is_seen_both, boxes, _NO_BOX).reshape(len(SCALES), -1).T.copy()

    def write(self, sight: Sight, out: Singles) -> None:
        count = max(1, _CHUNK_DRONES // self.n_drones)
        for first in range(0, len(sight.positions), count):
            here = slice(first, first + count)
            self._write_some(sight.of(here), out[here])

    def _write_some(self, sight: Sight, out: Singles) -> None:
        positions, matrices, left, heard = sight
        size = self.grid_size
        highest = maxima(matrices)  # (searches, matrices)
        windows = out[..., :-2].reshape(*out.shape[:2], *self._windows)
        # A matrix, and the drones that observe it.
        watchers = positions.reshape(highest.size, -1, 2)
        boxes = np.empty((*watchers.shape[:2], len(SCALES), WINDOW**2), np.float32)
        self._write_boxes(watchers, matrices.reshape(-1, size, size), highest.reshape(-1), boxes)
        windows[..., 0, :] = boxes.reshape(*out.shape[:2], *boxes.shape[2:])
        self._write_others(positions, heard, windows[..., 1, :])
        out[..., -2] = left[:, None]
        out[..., -1] = np.log10(np.maximum(highest, _LEAST_MAXIMUM)) / _DECADES

    def write_windows(self, positions: Positions, matrices: Singles, out: Singles) -> None:
        """Write only the windows of probabilities, scale by scale.

        Matrices are (searches, N, N), at any scale; `out` is float32, (searches, n, 4 * 5²).
        """
        highest = np.maximum(maxima(matrices), np.finfo(np.float32).tiny)
        windows = out.reshape(*out.shape[:2], len(SCALES), WINDOW**2)
        self._write_boxes(positions, matrices, highest, windows)

    def _write_boxes(
        self, positions: Positions, matrices: Singles, highest: Singles, out: Singles
    ) -> None:
        """Write the windows of probabilities: shape (searches, drones, scales, boxes)."""
        searches, drones, scales, boxes = out.shape
        width = self.grid_size + 1
        # [search, y, x]: the sum over all cells above and to the left (summed-area table).
        sums = np.zeros((searches, width, width), np.float32)
        sums[:, 1:, 1:] = self._summing.T @ (matrices @ self._summing)
        # The drones are the last axis, because operations along a long last axis are fast.
        x, y = positions.reshape(-1, 2).T
        across = self._columns.take(x, axis=2, mode="clip")
        down = self._rows.take(y, axis=2, mode="clip")
        if searches > 1:
            down += np.arange(0, sums.size, width**2).repeat(drones)
        corners = sums.reshape(-1).take(down[:, :, None] + across[:, None], mode="clip")
        strips = corners[:, 1:] - corners[:, :-1]
        means = strips[:, :, 1:] - strips[:, :, :-1]
        means = means.reshape(scales, boxes, -1)
        means /= highest.repeat(drones) * self._areas
        means.clip(0.0, 1.0, out=means)  # rounding
        np.sqrt(means, out=means)
        out[...] = means.reshape(scales, boxes, searches, drones).transpose(2, 3, 0, 1)

    def _write_others(self, positions: Positions, heard: Heard | None, out: Singles) -> None:
        """Write the windows of the other drones: shape (searches, drones, scales, boxes)."""
        searches, drones = out.shape[:2]
        # [search, drone, other]: the other's offset to the right and down.
        others = positions[:, None] if heard is None else heard.positions
        offsets = others - positions[:, :, None]
        if self._reach < self.grid_size - 1:
            np.clip(offsets, -self._reach, self._reach, out=offsets)
        side = 2 * self._reach + 1
        indices = offsets[..., 1] * side + offsets[..., 0] + (self._reach * (side + 1))
        boxes = self._boxes.take(indices, axis=0, mode="clip")  # (searches, drones, others, scales)
        # The boxes of every drone in a row of their own, with a last one for those not seen.
        width = _NO_BOX + 1
        boxes += np.arange(0, searches * drones * width, width).reshape(searches, drones, 1, 1)
        weights = None
        if heard is not None:
            weights = np.repeat(1.0 - heard.ages[..., None], len(SCALES), axis=-1).reshape(-1)
        counts = np.bincount(boxes.reshape(-1), weights, minlength=searches * drones * width)
        counts = counts.reshape(searches, drones, width)
        counts[..., _OWN_BOXES] -= 1  # the drone itself
        out[...] = counts[..., :-1].reshape(out.shape)
