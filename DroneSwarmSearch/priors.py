"""Maps of where a person may be at the start, as in `Drift(priors.polygon(40, vertices))`.

Each function returns the probability of every cell: float64, shape (grid_size, grid_size), indexed
[y, x], with a sum of 1; `grid_size` is at least 2. Positions are in cells, (x, y), and may be real
numbers. The centre of a cell has whole coordinates, so that the grid extends from -0.5 to
grid_size - 0.5. What lies beyond the grid is cut off, with a warning if it is more than 1%. The
functions raise a TypeError for a value of the wrong type, and a ValueError for one out of its
limits or a prior off the grid.
"""

from __future__ import annotations

import math
import warnings
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.arrays import Floats
from DroneSwarmSearch._internal.erf import erf

__all__ = ["from_points", "gaussian", "line", "polygon"]


_MAX_BEYOND = 0.01
_MAX_CORRELATION = 0.999

_PARTS = 100
"""Rows or columns into which cells are divided, and points per cell of a line: an error of 1%."""


def polygon(grid_size: int, vertices: ArrayLike) -> Floats:
    """A person anywhere in a polygon, with equal probability.

    The probability of a cell is proportional to the area that it shares with the polygon, measured
    along 100 lines through the cell: accurate to 1% of its area. There are at least three vertices,
    in order along the boundary, shape (n, 2). The polygon need not be convex, but its edges must
    not cross.
    """
    size = checks.integer("grid_size", grid_size, 2)
    corners = _positions("vertices", vertices, 3)
    x, y = corners.T
    end_x, end_y = np.roll(x, -1), np.roll(y, -1)
    area = abs(float(np.sum(x * end_y - end_x * y))) / 2
    if area == 0.0:
        raise ValueError(f"vertices must form a polygon with an area, got {vertices!r}")
    edges = np.arange(size + 1) - 0.5
    mass = np.zeros((size, size))
    for number, height in enumerate(_parts(size)):
        crossed = (y > height) != (end_y > height)
        share = (height - y[crossed]) / (end_y - y)[crossed]
        crossings = np.sort(x[crossed] + share * (end_x - x)[crossed])
        # The polygon is between the first two crossings, between the next two, and so on.
        before = np.minimum.outer(edges, crossings)
        lengths = (before[:, 1::2] - before[:, ::2]).sum(axis=1)
        mass[number // _PARTS] += np.diff(lengths) / _PARTS
    # Rows measure a narrow polygon less accurately than the warning needs.
    is_inside = np.array_equal(corners, np.clip(corners, -0.5, size - 0.5))
    return _normalised("vertices", mass, float(mass.sum()) if is_inside else area)


def line(grid_size: int, vertices: ArrayLike, *, sd: float = 0.0) -> Floats:
    """A person near a line, such as a ship's track: anywhere on it, with a normal error.

    There are at least two vertices, in order along the line, shape (n, 2); `sd` is the standard
    deviation of the distance from it along each axis, in cells. Points on the line stand for it,
    sd/4 apart but at least 1/100 of a cell, so with 0, the length in each cell is accurate to that.
    """
    size = checks.integer("grid_size", grid_size, 2)
    corners = _positions("vertices", vertices, 2)
    error = checks.real("sd", sd, 0)
    mass, total = np.zeros((size, size)), 0.0
    for start, end in pairwise(corners):
        length = math.dist(start, end)
        count = math.ceil(length / max(error / 4, 1 / _PARTS)) or 1
        shares = (np.arange(count) + 0.5) / count
        points = start + np.multiply.outer(shares, end - start)
        if error:
            x, y = (_cell_masses(size, points[:, axis, None], error) for axis in (0, 1))
            mass += length / count * (y.T @ x)
        else:
            mass += _histogram(size, points, np.full(count, length / count))
        total += length
    return _normalised("vertices", mass, total)


def gaussian(
    grid_size: int, mean: ArrayLike, sd: float | tuple[float, float], *, correlation: float = 0.0
) -> Floats:
    """A normal distribution, summed over each cell.

    Without correlation, `Drift(mean, start_sd=sd)` is the same at less cost. With it, probabilities
    are accurate to 0.001 if the standard deviations are at least 0.1.

    Args:
        grid_size: cells along each side.
        mean: the most probable position, (x, y).
        sd: standard deviation in cells, above 0: a number, or a pair (x, y).
        correlation: between x and y, from -0.999 to 0.999. Positive values stretch the map
            from the upper left to the lower right, because y grows downward.
    """
    size = checks.integer("grid_size", grid_size, 2)
    centre_x, centre_y = checks.pair("mean", mean)
    both = (sd, sd) if checks.is_number(sd) else checks.pair("sd", sd)
    sd_x, sd_y = (checks.positive("sd", each) for each in both)
    rho = checks.real("correlation", correlation, -_MAX_CORRELATION, _MAX_CORRELATION)
    x = _parts(size)
    chances = _cell_masses(size * _PARTS, (centre_x + 0.5) * _PARTS - 0.5, sd_x * _PARTS)
    # Given x, y is normal, too.
    means, rest = centre_y + rho * sd_y / sd_x * (x - centre_x), sd_y * math.sqrt(1.0 - rho**2)
    mass = np.zeros((size, size))
    for column in range(size):
        parts = slice(column * _PARTS, (column + 1) * _PARTS)
        mass[:, column] = chances[parts] @ _cell_masses(size, means[parts, None], rest)
    return _normalised("mean", mass, 1.0)


def from_points(grid_size: int, points: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """The share of some points in each cell, such as the particles of a drift simulation.

    Points have the shape (n, 2), and weights of at least 0 the shape (n,): by default all equal.
    """
    size = checks.integer("grid_size", grid_size, 2)
    given = _positions("points", points, 1)
    share = np.ones(len(given))
    if weights is not None:
        what = f"{len(given)} numbers of at least 0, one for each point"
        share = checks.numbers("weights", weights, what).astype(np.float64)
        if share.shape != (len(given),) or not (share >= 0.0).all():
            raise ValueError(f"weights must be {what}, got {weights!r:.100}")
    total = float(share.sum())
    if not 0.0 < total < math.inf:
        raise ValueError(f"weights must have a positive, finite sum, got {total}")
    return _normalised("points", _histogram(size, given, share), total)


def _parts(grid_size: int) -> Floats:
    """The middles of the parts of all cells along an axis."""
    middles: Floats = (np.arange(grid_size * _PARTS) + 0.5) / _PARTS - 0.5
    return middles


def _positions(name: str, value: object, least: int) -> Floats:
    """Finite positions (x, y) in cells, shape (n, 2)."""
    what = f"at least {least} positions (x, y), an array of shape (n, 2)"
    given = checks.numbers(name, value, what).astype(np.float64)
    if given.ndim != 2 or given.shape[1] != 2 or len(given) < least:
        raise ValueError(f"{name} must be {what}, got shape {given.shape}")
    wrong = given[~np.isfinite(given).all(axis=1)]
    if wrong.size:
        raise ValueError(f"{name} must be finite, got {tuple(wrong[0].tolist())}")
    return given


def _normalised(name: str, mass: Floats, total: float) -> Floats:
    """Probabilities from the mass in each cell; `total` includes what lies beyond the grid."""
    inside = float(mass.sum())
    if not inside > 0.0:
        raise ValueError(f"{name} must cover a part of the grid; nothing does")
    if inside < (1.0 - _MAX_BEYOND) * total:
        warnings.warn(
            f"{1.0 - inside / total:.1%} of the prior lies beyond the grid and is cut off",
            stacklevel=3,
        )
    return mass / inside


def _histogram(grid_size: int, points: Floats, weights: Floats) -> Floats:
    """The sum of the weights of the points in each cell, shape (N, N), indexed [y, x]."""
    within = ((points >= -0.5) & (points < grid_size - 0.5)).all(axis=1)
    x, y = np.floor(points[within] + 0.5).astype(np.int64).T
    sums = np.bincount(y * grid_size + x, weights[within], grid_size**2)
    return sums.astype(np.float64).reshape(grid_size, grid_size)


def _cell_masses(grid_size: int, mean: Floats | float, sd: float) -> Floats:
    """The probability of each cell of an axis: shape (..., N) for means of shape (..., 1)."""
    edges = np.arange(grid_size + 1) - 0.5
    with np.errstate(over="ignore"):  # an infinite argument of erf is clipped
        phi = erf(np.divide(edges - mean, sd * math.sqrt(2), dtype=np.float64))
    return 0.5 * np.diff(phi, axis=-1)
