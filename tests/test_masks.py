"""Action masks: the actions that they forbid, and that allowed actions cause no crash."""

import numpy as np
import pytest
from helpers import inside, plain, target_of
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Action
from DroneSwarmSearch.wrappers import action_masks

Cell = tuple[int, int]


def masks_by_hand(cells: list[Cell], size: int, right_of_way: bool) -> list[list[bool]]:
    """Return the masks by a loop over drones and moves."""
    masks = []
    for drone, cell in enumerate(cells):
        mask = []
        for action in Action:
            target = target_of(cell, action)
            allowed = inside(target, size) and target not in cells
            if right_of_way:
                reach = {target_of(other, move) for other in cells[:drone] for move in Action}
                allowed = allowed and target not in reach
            mask.append(allowed or action in (Action.SEARCH, Action.IDLE))
        masks.append(mask)
    return masks


@st.composite
def swarms(draw: st.DrawFn) -> tuple[int, list[list[Cell]]]:
    """A grid size and some swarms, whose drones may share cells."""
    size = draw(st.integers(2, 6))
    axis = st.integers(0, size - 1)
    drones = draw(st.integers(1, 7))
    swarm = st.lists(st.tuples(axis, axis), min_size=drones, max_size=drones)
    return size, draw(st.lists(swarm, min_size=1, max_size=5))


@settings(max_examples=60)
@given(case=swarms(), right_of_way=st.booleans())
def test_masks_match_a_plain_implementation(case, right_of_way):
    size, swarm = case
    cells = [[y * size + x for x, y in drones] for drones in swarm]
    masks = action_masks(cells, size, right_of_way)
    wanted = [masks_by_hand(drones, size, right_of_way) for drones in swarm]
    assert plain(masks) == plain(np.array(wanted))


@settings(max_examples=40)
@given(case=swarms(), data=st.data())
def test_with_right_of_way_no_allowed_actions_collide(case, data):
    size, (drones, *_) = case
    cells = list(dict.fromkeys(drones))  # distinct, as in an episode
    for _ in range(6):
        masks = action_masks([y * size + x for x, y in cells], size, right_of_way=True)
        chosen = [data.draw(st.sampled_from(mask.nonzero()[0].tolist())) for mask in masks]
        cells = [target_of(cell, action) for cell, action in zip(cells, chosen, strict=True)]
        assert len({*cells}) == len(cells)
        assert all(inside(cell, size) for cell in cells)


BAD_CELLS = [
    ([25], ValueError, "got 25"),
    ([[0, 1], [-1, 2]], ValueError, "got -1"),
    (3, ValueError, "got 3"),
    ([1.0], TypeError, "got float64"),
    ([True], TypeError, "got bool"),
    (["a"], TypeError, "got <U1"),
    ([[0], [1, 2]], ValueError, r"got \[\[0\], \[1, 2\]\]"),
]


@pytest.mark.parametrize(("cells", "error", "came"), BAD_CELLS)
def test_cells_off_the_grid_are_rejected(cells, error, came):
    words = rf"cells must be integers from 0 to 24, of shape \(\.\.\., n\), {came}"
    with pytest.raises(error, match=words):
        action_masks(cells, 5)  # type: ignore[arg-type]
