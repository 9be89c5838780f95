"""The layout "crops", compared with sums over boxes, cell by cell."""

import numpy as np
import pytest
from helpers import plain
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch.layouts import CropsLayout
from DroneSwarmSearch.layouts.crops import SCALES, WINDOW
from DroneSwarmSearch.layouts.layout import Sight

BOXES = WINDOW**2


def crops(positions: np.ndarray, matrices: np.ndarray, left: np.ndarray) -> np.ndarray:
    layout = CropsLayout(matrices.shape[-1], positions.shape[1])
    out = np.full((*positions.shape[:2], *layout.space.shape), 7, np.float32)
    layout.write(Sight(positions, matrices[:, None].copy(), left), out)
    for vector in out.reshape(-1, out.shape[-1]):
        assert layout.space.contains(vector)
    return out


def window(scale: int, own: list[int], values: np.ndarray) -> np.ndarray:
    """The sum of some values of cells, [y, x], in every box of a window around a drone."""
    reach = scale * WINDOW // 2
    x, y = own
    around = np.pad(values, reach)
    cells = around[y : y + 2 * reach + 1, x : x + 2 * reach + 1]
    return cells.reshape(WINDOW, scale, WINDOW, scale).sum(axis=(1, 3)).reshape(-1)


@st.composite
def searches(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, matrices and remaining time fractions."""
    count = draw(st.integers(1, 3))
    size = draw(st.integers(2, 24))
    drones = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    cells = np.stack([rng.permutation(size**2)[:drones] for _ in range(count)])
    matrices = rng.random((count, size, size)) ** draw(st.sampled_from([1, 20]))
    matrices /= matrices.sum(axis=(1, 2), keepdims=True)
    positions = np.stack([cells % size, cells // size], axis=-1)
    return positions, matrices.astype(np.float32), rng.random(count).astype(np.float32)


@given(shown=searches())
def test_windows_show_the_boxes_around_the_drone(shown):
    positions, matrices, left = shown
    seen = crops(*shown)
    for search, matrix in enumerate(matrices.astype(np.float64)):
        for drone, own in enumerate(positions[search].tolist()):
            vector = seen[search, drone]
            others = np.zeros(matrix.shape)
            for x, y in np.delete(positions[search], drone, axis=0).tolist():
                others[y, x] += 1
            for place, scale in enumerate(SCALES):
                start = 2 * place * BOXES
                mean = window(scale, own, matrix / matrix.max()) / scale**2
                boxes = vector[start : start + BOXES].astype(np.float64) ** 2
                assert np.allclose(boxes, mean, atol=3e-4)  # sums in single precision
                counts = vector[start + BOXES : start + 2 * BOXES]
                assert plain(counts) == plain(window(scale, own, others).astype(np.float32))
            assert vector[-2] == left[search]
            assert vector[-1] == pytest.approx(np.log10(matrix.max()) / 6, abs=1e-6)


def test_searches_of_large_batches_are_independent():
    """Batches of thousands of drones are processed in parts."""
    rng = np.random.default_rng(0)
    few = (
        rng.integers(0, 5, (7, 3, 2)),
        rng.random((7, 5, 5), np.float32),
        rng.random(7, np.float32),
    )
    many = [np.tile(array, (120, *[1] * (array.ndim - 1))) for array in few]
    assert plain(crops(*many)) == plain(np.tile(crops(*few), (120, 1, 1)))
