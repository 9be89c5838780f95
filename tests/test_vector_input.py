"""Input of the batch: bad values raise errors that name them, and change nothing."""

import os
import pickle
from typing import Any

import numpy as np
import pytest
from batches import DRONES, NAN

from DroneSwarmSearch import Action, ResetNeeded
from DroneSwarmSearch.vector import SearchBatch

BAD_ACTIONS: list[tuple[Any, type[Exception], str]] = [
    ([[0.0], [1.0]], TypeError, "actions must be integers from 0 to 5 .*, got float64"),
    ([[True], [False]], TypeError, "actions must be integers from 0 to 5 .*, got bool"),
    ([[None], [1]], TypeError, "actions must be integers from 0 to 5 .*, got object"),
    ([0, 1], ValueError, r"actions must be .* of shape \(2, 1\).*got shape \(2,\)"),
    ([[1], [1, 2]], ValueError, r"actions must be .* of shape \(2, 1\)"),
    ([[-1], [6]], ValueError, "integers from 0 to 5 .*, got -1"),
    (np.array([[5], [255]], np.uint8), ValueError, "from 0 to 5 .*, got 255"),
    (np.array([[5], [2**64 - 1]], np.uint64), ValueError, f"got {2**64 - 1}"),
]


@pytest.mark.parametrize(("actions", "error", "match"), BAD_ACTIONS)
def test_bad_actions_are_refused_and_change_nothing(actions, error, match):
    batch = SearchBatch(2, timestep_limit=2, bayesian_update=True)
    with pytest.raises(ResetNeeded, match="reset"):
        batch.step(actions)
    batch.reset([1, 2])
    batch.step([[Action.RIGHT], [Action.DOWN]])
    batch.reset([3], [0])
    batch.step([[Action.IDLE], [Action.IDLE]])
    assert batch.ended.tolist() == [False, True]
    before = pickle.dumps(batch)
    with pytest.raises(error, match=match):
        batch.step(actions)
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(
    ("seeds", "error", "match"),
    [
        (5, TypeError, "seeds must be a list or an array of integers of at least 0, got 5"),
        ([1, True], TypeError, r"seeds\[1\] must be an integer of at least 0, got True"),
        ([-1, 2], ValueError, r"seeds\[0\] must be an integer of at least 0, got -1"),
        (np.array([1.0, 2.0]), TypeError, r"seeds\[0\] must be an integer"),
        ([1, 2, 3], ValueError, "seeds must be 2, one for each row, got 3"),
    ],
)
def test_bad_seeds_are_refused_and_change_nothing(seeds, error, match):
    batch = SearchBatch(2)
    batch.reset(np.array([1, 2]))
    before = pickle.dumps(batch)
    with pytest.raises(error, match=match):
        batch.reset(seeds)
    assert pickle.dumps(batch) == before


def test_rows_are_those_of_numpy():
    batch = SearchBatch(3, bayesian_update=True)
    cells = [0, 5]
    batch.reset([1, 2, 3])
    batch.step([[4], [5], [1]])
    before = pickle.dumps(batch)
    for rows in ([3], [0.0, 1.0]):
        for call in (
            lambda rows: batch.reset(None, rows),
            batch.matrices_of,
            lambda rows: batch.probabilities(rows, cells[: len(rows)]),
        ):
            with pytest.raises(IndexError):
                call(rows)
            assert pickle.dumps(batch) == before
    matrices = batch.matrices_of([2, 0, 0])
    assert matrices.tobytes() == batch.matrices_of([-1, 0, 0]).tobytes()
    assert batch.probabilities([2, 0], cells).tolist() == [matrices[0, 0, 0], matrices[1, 0, 5]]
    batch.reset(None, np.array([False, True, True]))
    assert batch.steps.tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("grid_size", lambda: SearchBatch(1, grid_size=10**7)),
    ],
)
def test_a_batch_that_does_not_fit_in_memory_is_refused_by_name(name, make, monkeypatch):
    monkeypatch.setattr(  # a machine of 1 TiB
        os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**28}.get, raising=False
    )
    with pytest.raises(ValueError, match=rf"{name}.* must be smaller: with .*{name}=.* GiB"):
        make()


# For three rows of two drones on 7 x 7 cells.
BAD_CELLS: list[tuple[Any, type[Exception], str]] = [
    ([(0, 0)], ValueError, "must hold 2 cells .* got 1: "),
    (np.zeros((2, 2, 2), int), ValueError, "for each of 3 searches"),
    ([(1, 2), (1, 2)], ValueError, r"got \(1, 2\) for both drone0 and drone1"),
    ([[(0, 0), (1, 0)], [(4, 5)] * 2, [(0, 0), (0, 1)]], ValueError, r"\[1\] .*\(4, 5\)"),
    ([(0, 0), (0, 1.5)], ValueError, r"from 0 to 6, got \(0, 1\.5\)"),
    (np.full((3, 2, 2), NAN), ValueError, r"\[0\]\[0\] .* got \[nan, nan\]"),
    ([("a", "b"), ("c", "d")], TypeError, "'a'"),
]


@pytest.mark.parametrize(("value", "error", "match"), BAD_CELLS)
def test_bad_cells_of_drones_are_refused_and_change_nothing(value, error, match):
    with pytest.raises(error, match=f"(?s){DRONES}.*{match}"):
        SearchBatch(3, n_drones=2, drones_positions=value)
    batch = SearchBatch(3, n_drones=2)
    batch.reset([1, 2, 3])
    batch.step(np.full((3, 2), [4, 5]))
    before = pickle.dumps(batch)
    with pytest.raises(error, match=f"(?s){DRONES}.*{match}"):
        batch.reset([5, 6], np.array([0, 2]), drones_positions=value)
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(("rows", "error"), [(0, ValueError), (2.0, TypeError), (True, TypeError)])
def test_a_batch_has_a_whole_number_of_rows(rows, error):
    with pytest.raises(error, match="num_rows must be an integer of at least 1"):
        SearchBatch(rows)
