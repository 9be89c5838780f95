"""The best path for given gains equals the best of all paths."""

import hypothesis.strategies as st
import numpy as np
from hypothesis import given, settings

from DroneSwarmSearch.paths.best_paths import FORBIDDEN, best_paths, values_to_go

Board = tuple[np.ndarray, np.ndarray, np.ndarray, list[list[int]]]


def all_paths(board, start, step=0, just_searched=False):
    """All paths of a drone with their gains: staying first, then left, right, up, down."""
    gains, again, at_end, blocked = board
    n = len(gains)
    size = gains.shape[-1]
    y, x = divmod(start, size)
    if step == n:
        yield float(at_end[y, x]), [start], []
        return
    gain = float((again if just_searched else gains)[step, y, x])
    for v, u in ((y, x), (y, x - 1), (y, x + 1), (y - 1, x), (y + 1, x)):
        cell = v * size + u
        if not (0 <= u < size and 0 <= v < size) or cell in blocked[step]:
            continue
        stays = cell == start
        gained = gain if stays else 0.0
        for more, cells, searches in all_paths(board, cell, step + 1, stays):
            yield gained + more, [start, *cells], [gained > 0.0, *searches]


@st.composite
def boards(draw: st.DrawFn) -> Board:
    """Gains, final values and blocked cells. Whole numbers make sums exact and ties frequent."""
    size = draw(st.integers(2, 3))
    n = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    gains = rng.integers(0, draw(st.integers(1, 9)) + 1, (n, size, size)).astype(float)
    again = np.floor(gains * draw(st.sampled_from([0.0, 0.4, 1.0])))
    end = draw(st.sampled_from(["anywhere", "one cell", "varied"]))
    at_end = np.zeros((size, size))
    if end == "one cell":
        at_end[...] = FORBIDDEN
        at_end.reshape(-1)[draw(st.integers(0, size**2 - 1))] = 0.0
    elif end == "varied":
        at_end = rng.integers(0, 5, (size, size)).astype(float)
    most = draw(st.integers(0, 3))
    blocked = [rng.integers(0, size**2, most).tolist() for _ in range(n)]
    return gains, again, at_end, blocked


@settings(max_examples=60, derandomize=True)
@given(boards())
def test_the_best_path_is_the_first_of_all_best_paths(board):
    gains, again, at_end, blocked = board
    # Two gains at once; the second ones are twice the first.
    both = np.stack([gains, 2.0 * gains], axis=1)
    taken = [[(..., cells)] for cells in blocked]
    repeated = np.stack([again, 2.0 * again], axis=1)
    values = values_to_go(both, at_end, taken, again=repeated)
    assert values.shape == (2, len(gains) + 1, 2, *at_end.shape)
    starts = np.arange(at_end.size)
    paths = best_paths(both, values, starts, np.zeros_like(starts), again=repeated)
    twice = best_paths(both, values, starts, np.ones_like(starts), again=repeated)
    for start, value in enumerate(values[0, 0, 0].reshape(-1)):
        options = [it for it in all_paths(board, start) if it[0] > FORBIDDEN]
        if not options:
            assert value == FORBIDDEN
            continue
        gained, cells, searches = max(options, key=lambda it: it[0])  # the first of equals
        assert value == gained
        assert paths[0][:, start].tolist() == cells
        assert paths[1][:, start].tolist() == searches
        if not at_end[np.isfinite(at_end)].any():
            assert twice[0][:, start].tolist() == cells
            assert values[0, 0, 1].reshape(-1)[start] == 2.0 * gained
