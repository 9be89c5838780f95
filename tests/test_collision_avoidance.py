"""Conflict resolution: no drones collide, and none waits unnecessarily."""

import itertools

import hypothesis.strategies as st
from hypothesis import given, settings

from DroneSwarmSearch.core import Cell, resolve_conflicts

LINE = [(x, 0) for x in range(4)]


def check(cells: list[Cell], wanted: list[Cell], nexts: list[Cell]) -> None:
    """Check that drones move or stay, do not collide, and stay only to avoid a collision."""
    assert len(nexts) == len(set(nexts)) == len(cells)
    for cell, goal, ahead in zip(cells, wanted, nexts, strict=True):
        assert ahead in (cell, goal)
        assert ahead == goal or goal in nexts


def test_every_case_of_up_to_four_drones_in_a_row_of_four_cells():
    # The wanted cells need not be adjacent.
    for n in range(1, 5):
        for cells in itertools.permutations(LINE, n):
            for wanted in itertools.product(LINE, repeat=n):
                check(list(cells), list(wanted), resolve_conflicts(cells, wanted))


@settings(max_examples=60, derandomize=True)
@given(st.data())
def test_no_drones_collide_and_none_waits_unnecessarily(data):
    size = data.draw(st.integers(2, 4))
    grid = [(x, y) for y in range(size) for x in range(size)]
    n = data.draw(st.integers(1, len(grid)))
    cells = data.draw(st.permutations(grid))[:n]
    wanted = []
    for x, y in cells:
        around = [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)]
        wanted.append(data.draw(st.sampled_from([cell for cell in around if cell in grid])))
    nexts = resolve_conflicts(cells, wanted)
    check(cells, wanted, nexts)
    if wanted[0] not in cells:
        assert nexts[0] == wanted[0], "the first moves if no drone is in its way"


def test_a_ring_rotates_even_if_another_drone_would_enter():
    # Drones 1 and 2 exchange cells; drone 0 would enter the cell of drone 1.
    cells = [(0, 0), (1, 0), (2, 0)]
    wanted = [(1, 0), (2, 0), (1, 0)]
    assert resolve_conflicts(cells, wanted) == [(0, 0), (2, 0), (1, 0)]
    square = [(1, 0), (2, 0), (2, 1), (1, 1)]
    turned = square[1:] + square[:1]
    assert resolve_conflicts([(0, 0), *square], [(1, 0), *turned]) == [(0, 0), *turned]
