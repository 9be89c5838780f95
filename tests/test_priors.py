"""Priors: maps from polygons, lines, normal distributions and points."""

import math
import warnings
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Drift, priors
from DroneSwarmSearch._internal.erf import erf

NAN = math.nan
INF = math.inf
SQUARE = [(1, 1), (5, 1), (5, 5), (1, 5)]
CROSSED = [(0, 0), (2, 2), (2, 0), (0, 2)]

inside = st.tuples(st.floats(0, 8), st.floats(0, 8))


def subsampled(size: int, contains, per_cell: int = 20) -> np.ndarray:
    """The share of each cell's sample points that a region contains, normalised."""
    at = (np.arange(size * per_cell) + 0.5) / per_cell - 0.5
    x, y = np.meshgrid(at, at)
    share = contains(x, y).reshape(size, per_cell, size, per_cell).mean(axis=(1, 3))
    return share / share.sum()


def within_triangle(corners):
    def contains(x, y):
        sides = [
            (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True)
        ]
        return np.all(np.array(sides) >= 0, axis=0) | np.all(np.array(sides) <= 0, axis=0)

    return contains


def quiet(function, *arguments, **options):
    """Call a function without its warning of what lies beyond the grid."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return function(*arguments, **options)


def test_a_polygon_by_hand():
    expected = np.zeros((7, 7))
    expected[1:6, 1:6] = np.multiply.outer([0.5, 1, 1, 1, 0.5], [0.5, 1, 1, 1, 0.5]) / 16
    np.testing.assert_allclose(priors.polygon(7, SQUARE), expected, atol=1e-15)
    Drift(priors.polygon(7, SQUARE)).check_grid(7)
    triangle = priors.polygon(3, [(-0.5, -0.5), (2.5, -0.5), (-0.5, 2.5)])
    np.testing.assert_allclose(triangle * 4.5, [[1, 1, 0.5], [1, 0.5, 0], [0.5, 0, 0]], atol=1e-15)
    # It has a notch down to the middle.
    notched = priors.polygon(3, [(-0.5, -0.5), (2.5, -0.5), (1, 1), (2.5, 2.5), (-0.5, 2.5)])
    np.testing.assert_allclose(notched * 6.75, [[1, 1, 0.5], [1, 0.75, 0], [1, 1, 0.5]], atol=1e-15)


@settings(max_examples=40)
@example(((0.0, 1.0), (0.0, 2.3e-308), (3.0, 0.0)))
@given(st.tuples(inside, inside, inside))
def test_triangles_have_their_share_of_each_cell(corners):
    (ax, ay), (bx, by), (cx, cy) = corners
    area = abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2
    assume(area > 1)
    prior = priors.polygon(9, corners)
    sampled = subsampled(9, within_triangle(corners))
    # Sample points err by a cell's boundary at most.
    np.testing.assert_allclose(prior * area, sampled * area, atol=0.06)
    assert (prior > 0).sum() >= (sampled > 0).sum()
    np.testing.assert_allclose(priors.polygon(9, corners[::-1]), prior, atol=1e-12)
    np.testing.assert_allclose(priors.polygon(9, [*corners, corners[0]]), prior, atol=1e-12)
    transposed = [(y, x) for x, y in corners]
    np.testing.assert_allclose(priors.polygon(9, transposed), prior.T, atol=1e-12)


def test_a_line_by_hand():
    prior = priors.line(5, [(0, 0), (3, 0), (3, 4)])
    expected = np.zeros((5, 5))
    expected[0, :4] = [0.5, 1, 1, 0.5]
    expected[:, 3] += [0.5, 1, 1, 1, 0.5]
    np.testing.assert_allclose(prior, expected / 7, atol=1e-15)


@settings(max_examples=40)
@given(inside, inside)
def test_lines_have_their_length_in_each_cell(start, end):
    length = math.dist(start, end)
    assume(length > 0.5)
    prior = priors.line(9, [start, end])
    share = (np.arange(20_000) + 0.5) / 20_000
    points = np.array(start) + np.multiply.outer(share, np.subtract(end, start))
    np.testing.assert_allclose(prior, priors.from_points(9, points), atol=2e-4)
    np.testing.assert_allclose(priors.line(9, [end, start]), prior, atol=1e-12)


@pytest.mark.parametrize("sd", [0.3, 1.0, 2.0])
def test_a_line_with_an_error_is_a_mean_of_normal_distributions(sd):
    vertices = np.array([(6.0, 9.5), (14.2, 10.1), (9.3, 13)])
    lengths = np.hypot(*np.diff(vertices, axis=0).T)
    expected = sum(
        length * priors.gaussian(21, start + (end - start) * share, sd)
        for (start, end), length in zip(pairwise(vertices), lengths, strict=True)
        for share in (np.arange(200) + 0.5) / 200
    ) / (200 * lengths.sum())
    np.testing.assert_allclose(priors.line(21, vertices, sd=sd), expected, atol=5e-5)


@settings(max_examples=30)
@given(inside, st.floats(0.05, 3), st.floats(0.05, 3))
def test_a_normal_distribution_is_a_product(mean, sd_x, sd_y):
    edges = np.arange(10) - 0.5
    x, y = (
        np.diff(erf((edges - centre) / (sd * math.sqrt(2))))
        for centre, sd in zip(mean, (sd_x, sd_y), strict=True)
    )
    expected = np.multiply.outer(y, x)
    with np.errstate(all="raise"):
        prior = quiet(priors.gaussian, 9, mean, (sd_x, sd_y))
    np.testing.assert_allclose(prior, expected / expected.sum(), atol=1e-12)
    almost = quiet(priors.gaussian, 9, mean, (sd_x, sd_y), correlation=1e-9)
    np.testing.assert_allclose(almost, prior, atol=1e-7)


@pytest.mark.parametrize("rho", [-0.95, -0.4, 0.7, 0.99])
@pytest.mark.parametrize("sd", [(3.0, 1.5), (0.8, 2.0)])
def test_a_correlated_normal_distribution(rho, sd):
    prior = priors.gaussian(41, (20.3, 19.8), sd, correlation=rho)
    at = np.arange(41)
    x, y = prior.sum(axis=0), prior.sum(axis=1)
    mean_x = x @ at
    mean_y = y @ at
    assert (mean_x, mean_y) == pytest.approx((20.3, 19.8), abs=1e-3)
    covariance = (at - mean_y) @ prior @ (at - mean_x)
    assert covariance == pytest.approx(rho * sd[0] * sd[1], abs=0.01)
    independent = priors.gaussian(41, (20.3, 19.8), sd)
    np.testing.assert_allclose(x, independent.sum(axis=0), atol=1e-9)
    np.testing.assert_allclose(y, independent.sum(axis=1), atol=1e-9)


def test_points_by_hand():
    points = [(0, 0), (0.49, -0.49), (1.5, 2), (2, 1)]
    np.testing.assert_array_equal(
        priors.from_points(3, points) * 4, [[2, 0, 0], [0, 0, 1], [0, 0, 1]]
    )
    weighted = priors.from_points(3, points, weights=[0, 1, 2, 1])
    np.testing.assert_array_equal(weighted * 4, [[1, 0, 0], [0, 0, 1], [0, 0, 2]])


def test_what_lies_beyond_the_grid_is_cut_off_with_a_warning():
    points = [(0, 0)] * 3 + [(9, 9)]
    with pytest.warns(UserWarning, match=r"25\.0% of the prior lies beyond the grid and is cut"):
        prior = priors.from_points(3, points)
    assert prior[0, 0] == 1
    priors.from_points(3, [(0, 0)] * 200 + [(9, 9)])  # half a percent is not worth a warning
    with pytest.warns(UserWarning, match=r"50\.0% of the prior"):
        half = priors.polygon(7, [(-0.5, -3.5), (2.5, -3.5), (2.5, 2.5), (-0.5, 2.5)])
    np.testing.assert_allclose(half[:3, :3], 1 / 9)
    with pytest.warns(UserWarning, match=r"75\.0% of the prior"):
        np.testing.assert_allclose(priors.line(3, [(-0.5, 0), (11.5, 0)])[0], 1 / 3)
    with pytest.warns(UserWarning, match=r"50\.0% of the prior"):
        priors.gaussian(9, (-0.5, 4), 0.5)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: priors.polygon(9.0, SQUARE), TypeError, "grid_size must .*got 9.0"),
        (lambda: priors.gaussian(10**9, (4, 4), 1), ValueError, "grid_size must be smaller"),
        (lambda: priors.polygon(9, SQUARE[:2]), ValueError, "vertices must be at least 3"),
        (lambda: priors.polygon(9, [(0, 0), (1, 0), (0, NAN)]), ValueError, r"got \(0.0, nan\)"),
        (lambda: priors.polygon(9, [(0, 0), (1, 1), (2, 2)]), ValueError, "with an area"),
        (lambda: priors.polygon(9, CROSSED), ValueError, r"vertices\[0\] and vertices\[2\]"),
        (lambda: priors.line(9, [(1, 1), (1, 1)]), ValueError, "a line with a length"),
        (lambda: priors.line(9, [(20, 0), (20, 9)]), ValueError, "vertices must lie on the grid"),
        (lambda: priors.gaussian(9, (4, 4), (1, -1)), ValueError, "sd must .*above 0, got -1"),
        (lambda: priors.gaussian(9, (4, 4), 1, correlation=1), ValueError, "correlation must"),
        (lambda: priors.gaussian(9, (400, 4), 1), ValueError, "mean must lie on the grid"),
        (lambda: priors.from_points(9, [(1, 1)], [-1]), ValueError, "weights must .*got .-1"),
        (lambda: priors.from_points(9, [(1, 1)], [0]), ValueError, "weights must .*sum, got 0"),
    ],
)
def test_bad_values_are_rejected(call, error, message):
    with pytest.raises(error, match=message):
        call()
