"""Detection functions against published tables."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch import detection

INF = math.inf
FUNCTIONS = (detection.random_search, detection.inverse_cube, detection.definite_range)

# Coverage, and the POD of a random search and of the inverse cube law.
TABLE = (
    (0.5, 0.393469, 0.469116),
    (0.75, 0.527633, 0.652775),
    (1.0, 0.632121, 0.789909),
    (1.25, 0.713495, 0.882802),
    (1.5, 0.776870, 0.939888),
    (2.0, 0.864665, 0.987811),
)


@pytest.mark.parametrize(("coverage", "random", "cube"), TABLE)
def test_published_probabilities(coverage, random, cube):
    assert detection.random_search(coverage) == pytest.approx(random, abs=5e-7)
    assert detection.inverse_cube(coverage) == pytest.approx(cube, abs=5e-7)
    assert detection.definite_range(coverage) == min(coverage, 1)


@pytest.mark.parametrize("function", FUNCTIONS)
def test_arrays_and_numbers_agree(function):
    coverages = np.array([[0, 0.5, 1], [2, 7, 1e9]])
    probabilities = function(coverages)
    assert probabilities.dtype == np.float64 and probabilities.shape == (2, 3)
    each = [[function(float(coverage)) for coverage in row] for row in coverages]
    np.testing.assert_array_equal(probabilities, each)
    np.testing.assert_array_equal(function(coverages.tolist()), each)
    assert type(function(np.float32(0.5))) is type(function(1)) is float
    assert function(0) == 0 and function(1e9) == 1


@given(st.floats(0, 50), st.floats(0, 50))
def test_more_coverage_detects_more(one, other):
    low, high = sorted((one, other))
    for function in FUNCTIONS:
        assert 0 <= function(low) <= function(high) <= 1
    ordered = [function(low) for function in FUNCTIONS]
    assert all(one <= other + 1e-15 for one, other in pairwise(ordered))


def test_the_inverse_cube_law_is_that_of_parallel_tracks():
    """The sum over all tracks of the lateral range function's exponent, averaged over a strip."""
    spacing = 130.0
    width = 100.0
    across = (np.arange(2000) + 0.5) / 2000 * spacing
    tracks = np.arange(-3000, 3001) * spacing
    exponent = sum(width**2 / (4 * np.pi * (across - track) ** 2) for track in tracks)
    expected = np.mean(1 - np.exp(-exponent))
    assert detection.inverse_cube(width / spacing) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: detection.random_search(-0.1), ValueError, "coverage must .*got -0.1"),
        (lambda: detection.inverse_cube("1"), TypeError, "coverage must .*got '1'"),
        (lambda: detection.definite_range([1, INF]), ValueError, r"coverage must .*got \[1, inf\]"),
        (lambda: detection.coverage(-1, 1, 1, 1), ValueError, "sweep_width must .*got -1"),
        (lambda: detection.coverage(1, 1, 1, [1, 0]), ValueError, "area must .*above 0"),
        (lambda: detection.coverage([1, 2], [1, 2, 3], 1, 1), ValueError, "broadcast"),
    ],
)
def test_bad_values_are_rejected(call, error, message):
    with pytest.raises(error, match=message):
        call()
