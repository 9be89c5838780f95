"""The observation layouts, compared with plain implementations, and their building blocks."""

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from helpers import plain
from hypothesis import given
from hypothesis import strategies as st
from layouts_by_hand import TOP_CELLS, drone_by_hand, swarm_by_hand, top_cells

from DroneSwarmSearch.layouts import (
    JOINT_LAYOUTS,
    LAYOUTS,
    Layout,
    TopCellsLayout,
    remaining_time_fraction,
)
from DroneSwarmSearch.layouts.layout import Sight
from DroneSwarmSearch.layouts.top_cells import likeliest_cells

BY_HAND = [name for name in LAYOUTS if name != "crops"]  # see test_crops.py

Arguments = tuple[np.ndarray, np.ndarray, np.ndarray]


def arguments(searches: int = 5, size: int = 6, drones: int = 3) -> Arguments:
    """Positions, matrices and remaining time fractions, with ties among drones and cells."""
    rng = np.random.default_rng(3)
    positions = rng.integers(0, size, (searches, drones, 2)).astype(np.int32)
    positions[0, :2] = positions[0, 0]  # as after a collision
    matrices = rng.integers(0, 4, (searches, size, size)).astype(np.float32)
    matrices[-1] = 0.0
    matrices[-1, 2, 3] = 1.0
    matrices /= matrices.sum(axis=(1, 2), keepdims=True)
    return positions, matrices, remaining_time_fraction(np.arange(searches), 7)


def written(layout: Layout, shown: Arguments, *leading: int) -> Any:
    """Return the observations that a layout writes into used arrays."""
    positions, matrices, left = shown

    def array(space: spaces.Space[Any]) -> np.ndarray:
        return np.full((*leading, *space.shape), 7, space.dtype)

    is_dict = isinstance(layout.space, spaces.Dict)
    out = (
        {key: array(space) for key, space in layout.space.items()}
        if is_dict
        else array(layout.space)
    )
    layout.write(Sight(positions.copy(), matrices[:, None].copy(), left), out)
    return out


@pytest.mark.parametrize("name", BY_HAND)
@pytest.mark.parametrize("drones", [1, 3])
def test_drone_layouts_match_plain_implementations(name, drones):
    shown = arguments(drones=drones)
    layout = LAYOUTS[name](6, drones)
    out = written(layout, shown, 5, drones)
    for search, (cells, matrix, left) in enumerate(zip(*shown, strict=True)):
        for drone in range(drones):
            wanted = drone_by_hand(name, drone, cells.tolist(), matrix, float(left))
            seen = (
                {key: array[search, drone] for key, array in out.items()}
                if isinstance(out, dict)
                else out[search, drone]
            )
            assert plain(seen) == plain(wanted)
            assert seen in layout.space


@pytest.mark.parametrize("name", JOINT_LAYOUTS)
def test_swarm_layouts_match_plain_implementations(name):
    shown = arguments()
    joint = LAYOUTS[name](6, 3, joint=True)
    out = written(joint, shown, 5, 1)
    for search, (cells, matrix, left) in enumerate(zip(*shown, strict=True)):
        if isinstance(out, dict):
            seen = {key: array[search, 0] for key, array in out.items()}
            assert plain(seen) == plain({"positions": cells, "probability_matrix": matrix})
        else:
            seen = out[search, 0]
            wanted = swarm_by_hand(name, cells.tolist(), matrix, float(left))
            assert plain(seen) == plain(wanted)
        assert seen in joint.space


@given(
    cells=st.lists(st.sampled_from([0.0, 0.1, 0.25, 0.3, 1.0]), min_size=16, max_size=16),
    k=st.integers(1, 16),
)
def test_top_cells_are_sorted_by_probability_then_index(cells, k):
    matrix = np.float32(cells).reshape(1, 4, 4)
    found, probabilities = likeliest_cells(matrix, k)
    wanted = np.argsort(-matrix.reshape(-1), kind="stable")[:k]
    assert plain(found) == plain(wanted[None])
    assert plain(probabilities) == plain(matrix.reshape(-1)[wanted][None])


def test_the_number_of_top_cells():
    positions, matrices, left = arguments()
    for k in (1, 3, 36):
        layout = TopCellsLayout(6, 3, k)
        assert layout.space.shape == (3 * k + 2 * 3 + 1,)
        out = written(layout, (positions, matrices, left), 5, 3)
        own, *others = positions[2].tolist()
        wanted = top_cells(own, others, matrices[2], float(left[2]), k)
        assert plain(out[2, 0]) == plain(wanted)
    assert TopCellsLayout(6, 3).k == TOP_CELLS
    for wrong, error in ((37, ValueError), (1.0, TypeError)):
        with pytest.raises(error, match=f"k must be an integer from 1 to 36, got {wrong}"):
            TopCellsLayout(6, 3, wrong)
