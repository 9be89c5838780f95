"""Right of way: nobody collides, and nobody waits without need."""

from __future__ import annotations

import itertools

import hypothesis.strategies as st
from hypothesis import given, settings

from DroneSwarmSearch.policies.conflicts import resolve_conflicts
from DroneSwarmSearch.scenario import Cell

LINE = [(x, 0) for x in range(4)]


def check(cells: list[Cell], wishes: list[Cell], nexts: list[Cell]) -> None:
    """Everybody goes or stays, no two meet, and who stays would meet somebody by going."""
    assert len(nexts) == len(set(nexts)) == len(cells)
    for cell, wish, ahead in zip(cells, wishes, nexts, strict=True):
        assert ahead in (cell, wish)
        assert ahead == wish or wish in nexts


def test_every_case_of_up_to_four_drones_in_a_row_of_four_cells() -> None:
    # Any cell may be wished for, near or far.
    for n in range(1, 5):
        for cells in itertools.permutations(LINE, n):
            for wishes in itertools.product(LINE, repeat=n):
                check(list(cells), list(wishes), resolve_conflicts(cells, wishes))


@settings(deadline=None, max_examples=150, derandomize=True)
@given(st.data())
def test_nobody_meets_and_nobody_waits_without_need(data: st.DataObject) -> None:
    size = data.draw(st.integers(2, 4))
    grid = [(x, y) for y in range(size) for x in range(size)]
    n = data.draw(st.integers(1, len(grid)))
    cells = data.draw(st.permutations(grid))[:n]
    wishes = []
    for x, y in cells:
        around = [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
        wishes.append(data.draw(st.sampled_from([cell for cell in around if cell in grid])))
    priority = data.draw(st.permutations(range(n)))
    nexts = resolve_conflicts(cells, wishes, priority)
    check(cells, wishes, nexts)
    first = priority[0]
    if wishes[first] not in cells:
        assert nexts[first] == wishes[first], "the first goes if nobody is in its way"


def test_drones_exchange_cells() -> None:
    assert resolve_conflicts([(0, 0), (1, 0)], [(1, 0), (0, 0)]) == [(1, 0), (0, 0)]


def test_drones_follow_one_another() -> None:
    assert resolve_conflicts(LINE[:3], LINE[1:]) == LINE[1:]


def test_of_two_that_want_a_cell_the_first_in_priority_goes() -> None:
    cells, wishes = [(0, 0), (2, 0)], [(1, 0), (1, 0)]
    assert resolve_conflicts(cells, wishes) == [(1, 0), (2, 0)]
    assert resolve_conflicts(cells, wishes, priority=[1, 0]) == [(0, 0), (1, 0)]


def test_whoever_wants_the_cell_of_one_that_stays_stays_too() -> None:
    assert resolve_conflicts(LINE[:3], [(1, 0), (2, 0), (2, 0)]) == LINE[:3]


def test_a_ring_turns_whoever_else_wants_in() -> None:
    # 1 and 2 exchange cells; 0, first in priority, wants the cell of 1.
    cells, wishes = [(0, 0), (1, 0), (2, 0)], [(1, 0), (2, 0), (1, 0)]
    assert resolve_conflicts(cells, wishes) == [(0, 0), (2, 0), (1, 0)]
    square = [(1, 0), (2, 0), (2, 1), (1, 1)]
    turned = square[1:] + square[:1]
    assert resolve_conflicts([(0, 0), *square], [(1, 0), *turned]) == [(0, 0), *turned]
