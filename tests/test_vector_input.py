"""Input of the batch: bad values raise errors that name them, and change nothing."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from batches import DRONES, NAN, POD, seen

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, ResetNeeded
from DroneSwarmSearch.vector import SearchBatch

BAD_ACTIONS: list[tuple[Any, type[Exception], str]] = [
    ([[0.0], [1.0]], TypeError, "actions must be integers from 0 to 5, got float64"),
    ([[True], [False]], TypeError, "actions must be integers from 0 to 5, got bool"),
    ([["0"], ["1"]], TypeError, "actions must be integers from 0 to 5, got <U1"),
    ([[None], [1]], TypeError, r"actions must be integers from 0 to 5, got \[\[None\], \[1\]\]"),
    (None, TypeError, "actions must be integers from 0 to 5"),
    ([[0], [10**30]], TypeError, "actions must be integers from 0 to 5"),
    ([0, 1], ValueError, r"actions must have the shape \(2, 1\).*got \(2,\)"),
    ([[0, 1]], ValueError, r"actions must have the shape \(2, 1\).*got \(1, 2\)"),
    ([[0], [1], [2]], ValueError, r"actions must have the shape \(2, 1\).*got \(3, 1\)"),
    (5, ValueError, r"actions must have the shape \(2, 1\).*got \(\)"),
    ([[1], [1, 2]], ValueError, "actions must have the shape"),
    ([[0], [6]], ValueError, "integers from 0 to 5, got 6 for drone 0 of search 1"),
    ([[-1], [6]], ValueError, "integers from 0 to 5, got -1 for drone 0 of search 0"),
    (np.array([[5], [-128]], np.int8), ValueError, "from 0 to 5, got -128 for .* search 1"),
    (np.array([[5], [255]], np.uint8), ValueError, "from 0 to 5, got 255 for .* search 1"),
    (np.array([[5], [2**64 - 1]], np.uint64), ValueError, f"got {2**64 - 1} for .* search 1"),
    (np.array([[2**63], [5]], np.uint64), ValueError, f"got {2**63} for .* search 0"),
]


@pytest.mark.parametrize(("actions", "error", "match"), BAD_ACTIONS)
def test_bad_actions_are_refused_and_change_nothing(
    actions: Any, error: type[Exception], match: str
) -> None:
    batch = SearchBatch(2, timestep_limit=2, bayesian_update=True)
    idle = [[Action.IDLE], [Action.IDLE]]
    for ended, call in (
        ([False, False], lambda: batch.reset([1, 2])),
        ([False, False], lambda: batch.step([[Action.RIGHT], [Action.DOWN]])),
        ([True, True], lambda: batch.step(idle)),
        ([False, True], lambda: batch.reset([3], np.array([0]))),
        ([False, False], lambda: batch.step(idle)),
    ):
        call()
        assert batch.ended.tolist() == ended
        before = pickle.dumps(batch)
        with pytest.raises(error, match=match):
            batch.step(actions)
        assert pickle.dumps(batch) == before


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int32, np.uint64, ">i4"])
def test_integers_of_every_kind_are_actions(dtype: Any) -> None:
    batches = [SearchBatch(2, n_drones=2) for _ in range(3)]
    chosen = np.array([[1, 3], [5, 4]])
    forms = (chosen, chosen.astype(dtype), np.asfortranarray(chosen.astype(dtype)))
    for batch, actions in zip(batches, forms, strict=True):
        batch.reset([1, 2])
        batch.step(actions)
    assert seen(batches[0]) == seen(batches[1]) == seen(batches[2])


@pytest.mark.parametrize("seeds", [[1], [1, 2, 3], []])
def test_a_wrong_number_of_seeds_is_refused(seeds: list[int]) -> None:
    batch = SearchBatch(2)
    before = pickle.dumps(batch)
    with pytest.raises(ValueError, match="seeds"):
        batch.reset(seeds)
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(("seed", "error"), [(-1, ValueError), (1.5, TypeError), ("1", TypeError)])
def test_bad_seeds_are_refused_and_change_nothing(seed: Any, error: type[Exception]) -> None:
    batch = SearchBatch(2)
    batch.reset([1, 2])
    batch.step([[4], [5]])
    before = pickle.dumps(batch)
    with pytest.raises(error):
        batch.reset([7, seed])
    assert pickle.dumps(batch) == before


BAD_ROWS: list[tuple[Any, type[Exception], str]] = [
    ([3], ValueError, "got 3"),
    ([-1], ValueError, "got -1"),
    (np.array([0, 2**64 - 1], np.uint64), ValueError, "got 18446744073709551615"),
    ([1, 1], ValueError, r"got \[1, 1\]"),
    ([0.0, 1.0], TypeError, "got float64"),
    ([True, False], TypeError, "got bool"),
    (["0"], TypeError, "got <U1"),
    ("0", TypeError, "got '0'"),
    (1, ValueError, r"got shape \(\)"),
    ([[0], [1]], ValueError, r"got shape \(2, 1\)"),
    ([[0], [1, 2]], ValueError, "array of integers from 0 to 2, .* got"),
]


@pytest.mark.parametrize(("rows", "error", "match"), BAD_ROWS)
def test_unknown_rows_are_refused_and_change_nothing(
    rows: Any, error: type[Exception], match: str
) -> None:
    batch = SearchBatch(3, bayesian_update=True)
    batch.reset([1, 2, 3])
    batch.step([[4], [5], [1]])
    before = pickle.dumps(batch)
    calls: list[Callable[[], Any]] = [
        lambda: batch.reset(None, rows),
        lambda: batch.reset([1, 2], rows),
        lambda: batch.restart(rows),
        lambda: batch.matrices_of(rows),
    ]
    if match != r"got \[1, 1\]":  # two cells of a row may be asked for
        calls.append(lambda: batch.probabilities(rows, [0, 0]))
    for call in calls:
        with pytest.raises(error, match=f"rows must be .*{match}"):
            call()
        assert pickle.dumps(batch) == before


def test_rows_must_be_in_rising_order_when_read_together() -> None:
    batch = SearchBatch(3)
    batch.reset([1, 2, 3])
    for read in (batch.matrices_of, lambda rows: batch.probabilities(rows, [0, 0])):
        with pytest.raises(ValueError, match=r"rows must be .*ascending order; got \[2, 1\]"):
            read([2, 1])
    assert batch.probabilities([1, 1, 2], [0, 5, 0]).shape == (3,)
    assert batch.matrices_of([]).shape == (0, 7, 7)


@pytest.mark.parametrize(
    ("cells", "error", "match"),
    [
        ([49, 0], ValueError, "got 49"),
        ([0, -1], ValueError, "got -1"),
        ([0], ValueError, r"got shape \(1,\)"),
        (0, ValueError, r"got shape \(\)"),
        ([0.0, 1.0], TypeError, "got float64"),
        ([True, False], TypeError, "got bool"),
        ([[0], [1, 2]], ValueError, "got"),
    ],
)
def test_unknown_cells_are_refused(cells: Any, error: type[Exception], match: str) -> None:
    batch = SearchBatch(3)
    batch.reset([1, 2, 3])
    with pytest.raises(error, match=f"cells must be integers from 0 to 48.*{match}"):
        batch.probabilities([0, 2], cells)


@pytest.mark.parametrize(
    ("seeds", "error", "match"),
    [
        (5, TypeError, "seeds must be a list or an array of integers of at least 0, got 5"),
        ("12", TypeError, "seeds must be a list or an array"),
        ([1, True], TypeError, r"seeds\[1\] must be an integer of at least 0, got True"),
        ([-1, 2], ValueError, r"seeds\[0\] must be an integer of at least 0, got -1"),
        (np.array([1.0, 2.0]), TypeError, r"seeds\[0\] must be an integer"),
        ([[1], [2]], TypeError, r"seeds\[0\] must be an integer"),
        ([1, 2, 3], ValueError, "seeds must be 2, one for each row, got 3"),
    ],
)
def test_other_seeds_are_refused_by_name(seeds: Any, error: type[Exception], match: str) -> None:
    batch = SearchBatch(2)
    batch.reset(np.array([1, 2]))
    before = pickle.dumps(batch)
    with pytest.raises(error, match=match):
        batch.reset(seeds)
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"sampler": 5}, TypeError, "sampler must be callable, or None, got 5"),
        ({"sampler": {"vector": (0, 0)}}, TypeError, "sampler must be callable"),
        ({"wants_table": 1}, TypeError, "wants_table must be True or False, got 1"),
        ({"timestep_limit": 2**63}, ValueError, "timestep_limit must be an integer from 1 to"),
    ],
)
def test_other_arguments_are_refused_by_name(
    arguments: dict[str, Any], error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match):
        SearchBatch(2, **arguments)


def test_other_calls_are_refused_by_name() -> None:
    batch = SearchBatch(2)
    with pytest.raises(ResetNeeded, match="restart"):
        batch.restart(np.array([0]))
    batch.reset([1, 2])
    for row in (2, -1):
        with pytest.raises(ValueError, match=f"row must be an integer from 0 to 1, got {row}"):
            batch.frame(row)
    with pytest.raises(TypeError, match="row must be an integer from 0 to 1"):
        batch.frame(0.0)  # type: ignore[arg-type]


def test_the_longest_episode_there_may_be_begins_like_others() -> None:
    batches = [SearchBatch(2, timestep_limit=limit) for limit in (1000, 2**53)]
    for batch in batches:
        batch.reset([1, 2])
        for _ in range(5):
            batch.step([[4], [5]])
    assert batches[0].person_cells.tolist() == batches[1].person_cells.tolist()
    assert batches[0].rewards.tolist() == batches[1].rewards.tolist()


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("num_rows", lambda: SearchBatch(10**13)),
        ("num_rows", lambda: SearchBatch(2**63, n_drones=2)),
        ("grid_size", lambda: SearchBatch(1, grid_size=10**7)),
        ("grid_size", lambda: SearchBatch(1, grid_size=150_000)),
        ("num_rows", lambda: SearchBatch(10**7, grid_size=10**4, bayesian_update=True)),
        ("timestep_limit", lambda: SearchBatch(1, timestep_limit=10**12, wants_table=True)),
    ],
)
def test_a_batch_that_does_not_fit_in_memory_is_refused_by_name(
    name: str, make: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(  # a machine of 1 TiB
        os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**28}.get, raising=False
    )
    with pytest.raises(ValueError, match=rf"{name}.* must be smaller: with .*{name}=.* GiB"):
        make()


def test_a_table_that_a_reset_would_let_grow_too_large_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batch = SearchBatch(8, grid_size=40, situations=[[Person(Drift((0, 0)))]], wants_table=True)
    batch.reset(range(8))
    before = pickle.dumps(batch)
    monkeypatch.setattr(  # 4 MiB
        os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**10}.get, raising=False
    )
    with pytest.raises(
        ValueError, match=r"timestep_limit must be smaller: .* 8 different forecasts"
    ):
        batch.reset(range(8), situations=[[Person(Drift((x, 0)))] for x in range(8)])
    assert pickle.dumps(batch) == before


# For three rows of two drones on 7 x 7 cells; the constructor and `reset`.
BAD_VALUES: list[tuple[Any, ...]] = [
    (DRONES, [(0, 0)], ValueError, "must hold 2 cells .* got 1: "),
    (DRONES, np.zeros((3, 2, 3), int), ValueError, r"\(2, 2\), or \(3, 2, 2\)"),
    (DRONES, np.zeros((2, 2, 2), int), ValueError, r"\(2, 2\), or \(3, 2, 2\)"),
    (DRONES, np.zeros((3, 2), int), ValueError, "must hold 2 cells .* got 3: "),
    (
        DRONES,
        [(1, 2), (1, 2)],
        ValueError,
        r"different cells, got \(1, 2\) for both drone0 and drone1",
    ),
    (DRONES, [[(0, 0), (1, 0)], [(4, 5)] * 2, [(0, 0), (0, 1)]], ValueError, r"\[1\] .*\(4, 5\)"),
    (DRONES, [(0, 0), (0, 7)], ValueError, r"\[1\] .* from 0 to 6, got \(0, 7\)"),
    (DRONES, [(0, 0), (0, 1.5)], ValueError, r"from 0 to 6, got \(0, 1\.5\)"),
    (DRONES, [(0, 0), (0, NAN)], ValueError, r"from 0 to 6, got \(0, nan\)"),
    (DRONES, np.full((3, 2, 2), NAN), ValueError, r"\[0\]\[0\] .* got \[nan, nan\]"),
    (DRONES, [("a", "b"), ("c", "d")], TypeError, "'a'"),
    (DRONES, 5, TypeError, "2 cells .* got 5"),
]


@pytest.mark.parametrize(("name", "value", "error", "match"), BAD_VALUES)
def test_bad_values_are_refused_by_name(
    name: str, value: Any, error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=f"(?s){name}.*{match}"):
        SearchBatch(3, n_drones=2, **{name: value})


@pytest.mark.parametrize(("name", "value", "error", "match"), BAD_VALUES)
def test_bad_values_given_to_reset_change_nothing(
    name: str, value: Any, error: type[Exception], match: str
) -> None:
    batch = SearchBatch(3, n_drones=2)
    batch.reset([1, 2, 3])
    batch.step(np.full((3, 2), [4, 5]))
    before = pickle.dumps(batch)
    with pytest.raises(error, match=f"(?s){name}.*{match}"):
        batch.reset([5, 6], np.array([0, 2]), **{name: value})
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(
    ("parameters", "error", "match"),
    [
        ({"grid_size": 1}, ValueError, "grid_size"),
        ({"grid_size": 7.0}, TypeError, "grid_size"),
        ({"n_drones": 50}, ValueError, "n_drones"),
        ({"timestep_limit": 0}, ValueError, "timestep_limit"),
        ({"timestep_limit": "9"}, TypeError, "timestep_limit"),
        ({POD: 1.5}, ValueError, POD),
        ({POD: (0.5, 0.5)}, ValueError, POD),
        ({POD: NAN}, ValueError, POD),
        ({"bayesian_update": 1}, TypeError, "bayesian_update"),
        ({"reward_scheme": None}, TypeError, "reward_scheme"),
    ],
)
def test_shared_parameters_have_the_single_environments_messages(
    parameters: dict[str, Any], error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match) as of_one:
        DroneSwarmSearch(**parameters)
    with pytest.raises(error, match=match) as of_many:
        SearchBatch(3, **parameters)
    assert str(of_many.value) == str(of_one.value)


@pytest.mark.parametrize(("rows", "error"), [(0, ValueError), (2.0, TypeError), (True, TypeError)])
def test_a_batch_has_a_whole_number_of_rows(rows: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match="must be an integer of at least 1"):
        SearchBatch(rows)


def test_nothing_steps_before_the_first_reset() -> None:
    batch = SearchBatch(2)
    before = pickle.dumps(batch)
    for actions in ([[5], [5]], "nonsense"):
        with pytest.raises(ResetNeeded, match="reset"):
            batch.step(actions)
    assert pickle.dumps(batch) == before


# Output arrays.


@pytest.mark.parametrize(
    ("receiver", "error", "came"),
    [
        ([0.0], TypeError, r"got \[0.0\]"),
        (np.zeros((2, 7, 7)), ValueError, r"got float64 of shape \(2, 7, 7\)"),
        (np.zeros((3, 7, 7), np.float32), ValueError, r"got float32 of shape \(3, 7, 7\)"),
        (np.zeros((2, 7, 14), np.float32)[..., ::2], ValueError, "got one with gaps or in"),
        (np.frombuffer(bytes(392), np.float32).reshape(2, 7, 7), ValueError, "got a read-only"),
    ],
)
def test_the_output_array_for_matrices_is_validated(
    receiver: Any, error: type[Exception], came: str
) -> None:
    batch = SearchBatch(2)
    batch.reset([1, 2])
    before = pickle.dumps(batch)
    actions = [[Action.SEARCH], [Action.RIGHT]]
    wanted = r"matrices must be a writeable C-contiguous float32 array of shape \(2, 7, 7\), "
    for write in (batch.write_matrices, lambda given: batch.step(actions, given)):
        with pytest.raises(error, match=wanted + came):
            write(receiver)
        assert pickle.dumps(batch) == before
