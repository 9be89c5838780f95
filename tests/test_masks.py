"""Masks of actions: what they close, and that drones that keep to them come to no harm."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import inside, plain, target_of
from hypothesis import given
from hypothesis import strategies as st

from DroneSwarmSearch import Action
from DroneSwarmSearch.masks import action_masks

Cell = tuple[int, int]


def masks_by_hand(cells: list[Cell], size: int, right_of_way: bool) -> list[list[bool]]:
    """The same, drone by drone and move by move."""
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
    """A grid size and some swarms, of which drones may share a cell."""
    size = draw(st.integers(2, 6))
    axis = st.integers(0, size - 1)
    drones = draw(st.integers(1, 7))
    swarm = st.lists(st.tuples(axis, axis), min_size=drones, max_size=drones)
    return size, draw(st.lists(swarm, min_size=1, max_size=5))


@given(case=swarms(), right_of_way=st.booleans())
def test_masks_close_what_they_should(
    case: tuple[int, list[list[Cell]]], right_of_way: bool
) -> None:
    size, swarm = case
    cells = [[y * size + x for x, y in drones] for drones in swarm]
    masks = action_masks(cells, size, right_of_way)
    wanted = [masks_by_hand(drones, size, right_of_way) for drones in swarm]
    assert plain(masks) == plain(np.array(wanted))


@given(case=swarms(), data=st.data())
def test_with_right_of_way_no_two_drones_meet_whatever_they_choose(
    case: tuple[int, list[list[Cell]]], data: st.DataObject
) -> None:
    size, (drones, *_) = case
    cells = list(dict.fromkeys(drones))  # no two alike, as in an episode
    for _ in range(6):
        masks = action_masks([y * size + x for x, y in cells], size, right_of_way=True)
        chosen = [data.draw(st.sampled_from(mask.nonzero()[0].tolist())) for mask in masks]
        cells = [target_of(cell, action) for cell, action in zip(cells, chosen, strict=True)]
        assert len({*cells}) == len(cells)
        assert all(inside(cell, size) for cell in cells)


def test_swarms_may_have_any_leading_axes() -> None:
    cells = np.random.default_rng(0).integers(0, 25, (2, 3, 4))
    together = action_masks(cells, 5, True)
    assert (together.dtype, together.shape) == (np.bool_, (2, 3, 4, 6))
    for index in np.ndindex(2, 3):
        assert plain(together[index]) == plain(action_masks(cells[index], 5, True))
    assert action_masks(np.empty((0, 4), np.int64), 5).shape == (0, 4, 6)


@pytest.mark.parametrize("right_of_way", [False, True])
def test_a_lone_drone_is_kept_on_the_grid_alone(right_of_way: bool) -> None:
    corner, middle = action_masks([[0], [4]], 3, right_of_way)
    assert [Action(action) for action in np.flatnonzero(~corner[0])] == [Action.LEFT, Action.UP]
    assert middle.all()
