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
from DroneSwarmSearch._internal.cells import cell_number
from DroneSwarmSearch._internal.erf import erf

__all__ = ["from_points", "gaussian", "line", "polygon"]


_MAX_BEYOND = 0.01
_FARTHEST = 1e9  # limits rounding errors
_MAX_CORRELATION = 0.999
_NODES = np.polynomial.legendre.leggauss(8)  # and weights of a quadrature on [-1, 1]


def polygon(grid_size: int, vertices: ArrayLike) -> Floats:
    """A person anywhere in a polygon, with equal probability.

    The probability of a cell is exactly proportional to the area that it shares with the polygon.
    There are at least three vertices, in order along the boundary, shape (n, 2). The polygon need
    not be convex, but its edges must not cross.
    """
    size = _checked_size(grid_size)
    corners = _positions("vertices", vertices, 3)
    _check_simple(corners)
    x, y = corners.T
    after_x = np.roll(x, -1)
    after_y = np.roll(y, -1)
    area = float(np.sum((x - x[0]) * (after_y - y[0]) - (after_x - x[0]) * (y - y[0]))) / 2
    if area == 0.0:
        raise ValueError(f"vertices must form a polygon with an area, got {vertices!r}")
    edges = np.arange(size + 1.0) - 0.5
    # The area of the polygon in the rows and columns before each corner of the cells: by Green's
    # theorem, the integral of min(x, X) dy along the boundary, where y <= Y.
    quadrants = np.zeros((size + 1, size + 1))
    for start, end in zip(corners.tolist(), np.roll(corners, -1, axis=0).tolist(), strict=True):
        if start[1] != end[1]:
            quadrants += _before(edges, start, end)
    shares = np.diff(np.diff(quadrants, axis=0), axis=1) * math.copysign(1.0, area)
    # Rounding leaves traces in the cells that the polygon does not touch.
    reach = max(size, float(np.abs(corners).max()))
    height = float(np.abs(np.diff(np.clip(np.append(y, y[0]), -0.5, size - 0.5))).sum())
    shares[shares <= 1e-15 * reach * height] = 0.0
    return _normalised("vertices", shares, abs(area))


def line(grid_size: int, vertices: ArrayLike, *, sd: float = 0.0) -> Floats:
    """A person near a line, such as a ship's track: anywhere on it, with a normal error.

    There are at least two vertices, in order along the line, shape (n, 2); `sd` is the standard
    deviation of the distance from it along each axis, in cells. With 0, the probability of a cell
    is exactly proportional to the length of the line in it; otherwise points on the line stand for
    it, at most sd/4 (but at least 0.02 cells) apart.
    """
    size = _checked_size(grid_size)
    corners = _positions("vertices", vertices, 2)
    error = checks.real("sd", sd, 0)
    total = float(np.hypot(*np.diff(corners, axis=0).T).sum())
    if not 0.0 < total < math.inf:
        raise ValueError(f"vertices must form a line with a length, got {vertices!r}")
    mass = np.zeros((size, size))
    for start, end in pairwise(corners):
        points, lengths = _pieces(start, end, size, error)
        if error:
            x, y = (_cell_masses(size, points[:, axis, None], error) for axis in (0, 1))
            mass += (y * lengths[:, None]).T @ x
        else:
            mass += _histogram(size, points, lengths)
    return _normalised("vertices", mass, total)


def gaussian(
    grid_size: int, mean: ArrayLike, sd: float | tuple[float, float], *, correlation: float = 0.0
) -> Floats:
    """A normal distribution, summed over each cell.

    Without correlation, `Drift(mean, start_sd=sd)` is the same at less cost.

    Args:
        grid_size: cells along each side.
        mean: the most probable position, (x, y).
        sd: standard deviation in cells, above 0: a number, or a pair (x, y).
        correlation: between x and y, from -0.999 to 0.999. Positive values stretch the map
            from the upper left to the lower right, because y grows downward.
    """
    size = _checked_size(grid_size)
    centre_x, centre_y = checks.pair("mean", mean)
    both = (sd, sd) if checks.is_number(sd) else checks.pair("sd", sd)
    sd_x, sd_y = (checks.positive("sd", number) for number in both)
    rho = checks.real("correlation", correlation, -_MAX_CORRELATION, _MAX_CORRELATION)
    if rho == 0.0:
        x, y = _cell_masses(size, centre_x, sd_x), _cell_masses(size, centre_y, sd_y)
        return _normalised("mean", np.multiply.outer(y, x), 1.0)
    # Given x, y is normal too: integrate over the x of each column.
    rest = math.sqrt(1.0 - rho**2)
    scale = sd_x * min(1.0, rest / abs(rho))  # on which the integrand changes
    low, high = (
        min(max(edge, -0.5), size - 0.5) for edge in (centre_x - 9 * sd_x, centre_x + 9 * sd_x)
    )
    breaks = np.unique(np.clip(np.arange(size + 1) - 0.5, low, high))
    mass = np.zeros((size, size))
    for left, right in pairwise(breaks):
        panels = math.ceil((right - left) / scale)
        half = (right - left) / (2 * panels)
        centres = left + half * (2 * np.arange(panels) + 1)
        x = (centres[:, None] + half * _NODES[0]).ravel()
        z = (x - centre_x) / sd_x
        density = np.exp(-0.5 * z * z) / (sd_x * math.sqrt(2 * math.pi))
        weight = density * np.tile(half * _NODES[1], panels)
        y = _cell_masses(size, (centre_y + rho * sd_y * z)[:, None], sd_y * rest)
        mass[:, math.floor((left + right) / 2 + 0.5)] = weight @ y
    return _normalised("mean", mass, 1.0)


def from_points(grid_size: int, points: ArrayLike, weights: ArrayLike | None = None) -> Floats:
    """The share of some points in each cell, such as the particles of a drift simulation.

    Points have the shape (n, 2), and weights of at least 0 the shape (n,): by default all equal.
    """
    size = _checked_size(grid_size)
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


def _checked_size(grid_size: object) -> int:
    size = checks.integer("grid_size", grid_size, 2)
    checks.fits("the map", 8 * size**2, grid_size=size)
    return size


def _positions(name: str, value: object, least: int) -> Floats:
    """Finite positions (x, y) in cells, shape (n, 2)."""
    what = f"at least {least} positions (x, y), an array of shape (n, 2)"
    given = checks.numbers(name, value, what).astype(np.float64)
    if given.ndim != 2 or given.shape[1] != 2 or len(given) < least:
        raise ValueError(f"{name} must be {what}, got shape {given.shape}")
    wrong = given[~(np.abs(given) <= _FARTHEST).all(axis=1)]
    if wrong.size:
        raise ValueError(f"{name} must be numbers from -1e9 to 1e9, got {tuple(wrong[0].tolist())}")
    return given


def _normalised(name: str, mass: Floats, total: float) -> Floats:
    """Probabilities from the mass in each cell; `total` includes what lies beyond the grid."""
    inside = float(mass.sum())
    if not inside > 0.0:
        raise ValueError(f"{name} must lie on the grid, at least in part; nothing does")
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
    sums = np.bincount(cell_number(x, y, grid_size), weights[within], grid_size**2)
    return sums.astype(np.float64).reshape(grid_size, grid_size)


def _cell_masses(grid_size: int, mean: Floats | float, sd: float) -> Floats:
    """The probability of each cell of an axis: shape (..., N) for means of shape (..., 1)."""
    edges = np.arange(grid_size + 1) - 0.5
    with np.errstate(over="ignore"):  # an infinite argument of erf is clipped
        phi = erf(np.divide(edges - mean, sd * math.sqrt(2), dtype=np.float64))
    return 0.5 * np.diff(phi, axis=-1)


def _pieces(start: Floats, end: Floats, grid_size: int, error: float) -> tuple[Floats, Floats]:
    """A segment in pieces, none of which is in two cells: their middles and their lengths."""
    step = end - start
    length = float(np.hypot(*step))
    edges = np.arange(grid_size + 1) - 0.5
    with np.errstate(over="ignore"):
        cuts = [(edges - at) / by for at, by in zip(start, step, strict=True) if by]
    cuts.append(np.array([0.0, 1.0]))
    if error:
        count = math.ceil(length / max(error / 4, 0.02))
        checks.fits("the points on the line", 16 * count * grid_size, vertices=length, sd=error)
        cuts.append(np.linspace(0.0, 1.0, count + 1))
    at = np.unique(np.clip(np.concatenate(cuts), 0.0, 1.0))
    middles = start + np.multiply.outer((at[1:] + at[:-1]) / 2, step)
    return middles, np.diff(at) * length


def _before(edges: Floats, start: list[float], end: list[float]) -> Floats:
    """The integral of min(x, X) dy along an edge of a polygon, where y <= Y, indexed [Y, X].

    Y and X are the boundaries of rows and columns; what is before the first row is left out.
    """
    x0, y0 = start
    x1, y1 = end
    with np.errstate(over="ignore"):  # clipped; the heights of the ends may be almost equal
        to = np.clip((edges - y0) / (y1 - y0), 0.0, 1.0)
    first, last = (to[:1], to) if y1 > y0 else (to, to[:1])
    ends = x0 + (x1 - x0) * first, x0 + (x1 - x0) * last
    low = np.minimum(*ends)[:, None]
    high = np.maximum(*ends)[:, None]
    over = np.clip(edges, low, high) - low
    span = np.where(high > low, high - low, 1.0)
    mean = np.minimum(edges, low) + over - over * over / (2 * span)
    integral: Floats = ((last - first) * (y1 - y0))[:, None] * mean
    return integral


def _check_simple(corners: Floats) -> None:
    """Raise a ValueError if two edges of a polygon cross."""
    after = np.roll(corners, -1, axis=0)
    for index, (start, end) in enumerate(zip(corners, after, strict=True)):
        apart = _side(start, end, corners) * _side(start, end, after) < 0
        crossing = apart & (_side(corners, after, start) * _side(corners, after, end) < 0)
        if crossing.any():
            raise ValueError(
                f"vertices must form a polygon whose edges do not cross, but the edges from "
                f"vertices[{index}] and vertices[{crossing.argmax()}] do"
            )


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    """On which side of a line points are: -1, 0 or 1."""
    a = end - start
    b = point - start
    cross: Floats = np.sign(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    return cross
