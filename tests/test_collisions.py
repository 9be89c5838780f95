"""Drones of a batch that share a cell: both ways to find them agree with the rule."""

from __future__ import annotations

import copy
import itertools

import numpy as np
import pytest

from DroneSwarmSearch import rules
from DroneSwarmSearch.rules import OFF_GRID, Collisions, same_cell


def named(targets: np.ndarray) -> list[set[int]]:
    """The drones named in each row."""
    found = Collisions(*targets.shape, targets.dtype)(targets)
    rows, drones = targets.shape
    sets: list[set[int]] = [set() for _ in range(rows)]
    for number in found.tolist():
        sets[number // drones].add(number % drones)
    return sets


def expected(targets: np.ndarray) -> list[set[int]]:
    return [
        {drone for drone, cell in enumerate(row) if cell in same_cell(row)}
        for row in targets.tolist()
    ]


@pytest.mark.parametrize("few", [0, 32], ids=["sorted", "compared"])
@pytest.mark.parametrize("drones", [1, 2, 3, 4])
def test_every_constellation_of_few_drones(monkeypatch, few: int, drones: int) -> None:
    monkeypatch.setattr(rules, "_FEW_DRONES", few)
    targets = np.array(list(itertools.product((OFF_GRID, 0, 1, 2), repeat=drones)))
    assert named(targets) == expected(targets)


@pytest.mark.parametrize("drones", [7, 31, 32, 33, 60])
@pytest.mark.parametrize(("cells", "dtype"), [(100, np.int16), (40_000, np.int32)])
def test_many_drones(drones: int, cells: int, dtype: type[np.integer]) -> None:
    rng = np.random.default_rng(drones)
    targets = rng.integers(OFF_GRID, cells, (200, drones), dtype)
    targets[::3, 0] = targets[::3, -1]
    assert named(targets) == expected(targets)
    assert any(expected(targets))


def test_a_copy_shares_nothing() -> None:
    finder = Collisions(2, 3, np.int64)
    twin = copy.deepcopy(finder)
    first = finder(np.array([[1, 1, 2], [0, 1, 2]]))
    twin(np.array([[0, 3, 4], [5, 5, 5]]))
    assert sorted(first.tolist()) == [0, 1]
