"""The reward table and the endings, line by line."""

import itertools
import math

import numpy as np
import pytest
from helpers import SCHEME_NAMES, SCHEMES

from DroneSwarmSearch import Action, Ending, RewardScheme
from DroneSwarmSearch.core import (
    OFF_GRID,
    BatchEvents,
    Grid,
    SearchRules,
    StepEvents,
    collisions,
    is_success,
    outcome,
    outcomes,
    same_cell,
    successes,
)


def reward(
    scheme, collided=False, left_grid=False, found=False, time_limit_reached=False,
    found_before=False, searched=False, probability=0.0, steps_before=0, return_so_far=0.0,
):  # fmt: skip
    """The reward of drone 0; drone 1 enters cell 1."""
    targets = [OFF_GRID if left_grid else int(collided), 1]
    events = StepEvents(
        targets=targets, observed={0: probability} if searched else {}, found=range(found),
        found_before=range(found_before), returns=[return_so_far, 0.0],
        steps_before=steps_before, all_found=False, covered=False,
    )  # fmt: skip
    limit = steps_before + 1 if time_limit_reached else 100
    rewards, _ = outcome(SearchRules(scheme, limit, is_rescue=True), events)
    return rewards[0]


def test_every_line_of_the_table_uses_its_parameter():
    """Distinct values show which line of the table was used."""
    scheme = RewardScheme(
        step=1, search=2, search_threshold=0.5, search_unlikely=3, find=5, find_early=7,
        timeout=11, leave_grid=13, collision=17,
    )  # fmt: skip
    flags = ("collided", "left_grid", "found", "time_limit_reached", "found_before", "searched")
    for values in itertools.product((False, True), repeat=len(flags)):
        case = dict(zip(flags, values, strict=True))
        for probability in () if case["collided"] and case["left_grid"] else (0.25, 0.75):
            got = reward(scheme, **case, probability=probability, return_so_far=40.0)
            lines = [
                (case["collided"], 17),
                (case["left_grid"], 13),
                (case["found"], 5 + 7),
                (case["time_limit_reached"] and not case["found_before"], 11 - 40),
                (case["searched"] and probability == 0.75, 1.5),
                (case["searched"], 3),
                (True, 1),
            ]
            assert got == next(points for applies, points in lines if applies), case


def test_a_step_without_searches_is_quiet_if_it_pays_all_drones_the_same_and_goes_on():
    scheme = RewardScheme(step=1, timeout=11, leave_grid=13, collision=17)
    rules = SearchRules(scheme, 3, is_rescue=True)
    moves = bytes((Action.LEFT, Action.IDLE, Action.DOWN))
    for *targets, before in itertools.product(range(OFF_GRID, 3), repeat=4):
        if before != OFF_GRID:
            events = StepEvents(
                targets=targets, observed={}, found=(), found_before=(),
                returns=[0.0] * 3, steps_before=before, all_found=False, covered=False,
            )  # fmt: skip
            resolved = outcome(rules, events)
            assert rules.is_quiet(moves, targets, before) == (resolved == ([1.0] * 3, None))
    assert rules.is_quiet(moves, [0, 1, 2], 0)
    assert not rules.is_quiet(bytes((Action.LEFT, Action.SEARCH, Action.DOWN)), [0, 1, 2], 0)
    assert not rules._replace(search_in_flight=True).is_quiet(moves, [0, 1, 2], 0)


def test_expected_pays_the_added_probability_of_success():
    expected = RewardScheme.expected(find=8.0)
    for happened, points in (
        ({"searched": True, "probability": 0.25}, 2.0),
        ({"searched": True, "probability": 0.25, "found": True}, 2.0),
        ({"searched": True, "probability": 0.25, "time_limit_reached": True}, 2.0),
        ({"searched": True, "probability": 0.0}, 0.0),
        ({"probability": 0.25}, 0.0),
        ({"time_limit_reached": True, "return_so_far": 5.0}, 0.0),
        ({"searched": True, "probability": 0.25, "left_grid": True}, 0.0),
        ({"searched": True, "probability": 0.25, "collided": True}, 0.0),
    ):
        got = reward(expected, **happened)
        assert (got, math.copysign(1, got)) == (points, 1), happened
    assert RewardScheme.expected().find == 1.0
    with pytest.raises(TypeError, match=r"RewardScheme\.expected_finds must be True or False"):
        RewardScheme(expected_finds=1)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"RewardScheme\.given_misses must be False without"):
        RewardScheme(given_misses=True)


@pytest.mark.parametrize(
    ("happened", "expected"),
    [
        ((False, False, False, False, False), None),
        ((True, False, False, False, False), Ending.FOUND),
        ((True, True, True, True, True), Ending.FOUND),
        ((False, True, False, False, False), Ending.COVERED),
        ((False, True, True, True, True), Ending.COVERED),
        ((False, False, True, False, False), Ending.COLLISION),
        ((False, False, True, True, True), Ending.COLLISION),
        ((False, False, False, True, True), Ending.LEFT_GRID),
        ((False, False, False, False, True), Ending.TIME_LIMIT),
    ],
)
def test_endings(happened, expected):
    all_found, covered, collided, left_grid, is_last = happened
    events = StepEvents(
        targets=[0, int(not collided), OFF_GRID if left_grid else 2],
        observed={}, found=(), found_before=(), returns=[0.0] * 3,
        steps_before=0, all_found=all_found, covered=covered,
    )  # fmt: skip
    _, ending = outcome(SearchRules(RewardScheme(), 1 if is_last else 2, is_rescue=True), events)
    assert ending is expected


@pytest.mark.thorough
@pytest.mark.parametrize("scheme", SCHEMES, ids=SCHEME_NAMES)
@pytest.mark.parametrize("limit", [1, 3])
def test_outcomes_of_a_batch_equal_those_of_each_search(scheme, limit):
    """In random steps, with figures around each threshold, to the last bit."""
    rng = np.random.default_rng(limit)
    rows = 3000
    n = 3
    likelihoods = [0.0, 1e-9, 0.01, float(np.float32(0.01)), 0.0100001, 0.25, 0.3, 1.0]
    searched = rng.random((rows, n)) < 1 / 6
    targets = rng.choice([OFF_GRID, *range(8)], (rows, n))
    observed = rng.choice(likelihoods, np.count_nonzero(searched))
    found = searched & (rng.random((rows, n)) < 0.3)
    before = rng.random((rows, n)) < 0.3
    returns = rng.choice([0.0, 12345.678, -99.9], (rows, n))
    steps = rng.integers(0, limit, rows)
    all_found, covered = rng.random((2, rows)) < 0.1
    for is_rescue in (True, False):
        rules = SearchRules(scheme, limit, is_rescue)
        events = BatchEvents(
            searching=searched, targets=targets, observed=observed,
            found=found.reshape(-1).nonzero()[0], found_before=before, returns=returns,
            steps_before=steps, all_found=all_found.nonzero()[0], covered=covered.nonzero()[0],
        )  # fmt: skip
        rewards, endings = outcomes(rules, events)
        assert (rewards.dtype, endings.dtype) == (np.float64, np.int8)
        pays = iter(observed.tolist())
        for row in range(rows):
            own = {drone: next(pays) for drone in searched[row].nonzero()[0].tolist()}
            one = StepEvents(
                targets=targets[row].tolist(), observed=own, found=found[row].nonzero()[0],
                found_before=before[row].nonzero()[0], returns=returns[row].tolist(),
                steps_before=int(steps[row]), all_found=all_found[row], covered=covered[row],
            )  # fmt: skip
            expected, reason = outcome(rules, one)
            assert rewards[row].tolist() == expected
            assert endings[row] == (reason or 0)


def test_an_episode_ends_well_with_everybody_found_or_the_mission_complete():
    well = {Ending.FOUND, Ending.COVERED}
    assert {each for each in (None, *Ending) if is_success(each)} == well
    numbers = np.arange(len(Ending) + 1, dtype=np.int8)
    assert successes(numbers).tolist() == [False, *(is_success(each) for each in Ending)]


def test_neighbours_of_every_cell():
    size = 3
    grid = Grid.of(size)
    assert grid.targets.tolist() == [list(grid.neighbours[c]) for c in range(size**2)]
    steps = {Action.LEFT: (-1, 0), Action.RIGHT: (1, 0), Action.UP: (0, -1), Action.DOWN: (0, 1)}
    for cell in range(size**2):
        around = grid.neighbours[cell]
        for action in Action:
            dx, dy = steps.get(action, (0, 0))
            x, y = cell % size + dx, cell // size + dy
            inside = 0 <= x < size and 0 <= y < size
            assert around[action] == (y * size + x if inside else OFF_GRID)


@pytest.mark.parametrize("drones", [1, 4, 33])
def test_collisions_of_a_batch_equal_those_of_each_search(drones):
    targets = np.array(list(itertools.product((OFF_GRID, 0, 1, 2), repeat=min(drones, 4))))
    if drones > 4:
        targets = np.random.default_rng(0).integers(OFF_GRID, 200, (100, drones))
    expected = [
        row * drones + drone
        for row, cells in enumerate(targets.tolist())
        for drone, cell in enumerate(cells)
        if cell in same_cell(cells)
    ]
    for cells in targets.tolist():
        assert same_cell(cells) == {c for c in cells if cells.count(c) > 1 and c != OFF_GRID}
    assert collisions(targets).tolist() == expected
