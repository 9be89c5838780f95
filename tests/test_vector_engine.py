"""Every row of a batch is the single environment with the same seed, to the last bit."""

from __future__ import annotations

import copy
import gc
import math
import os
import pickle
import random
import tracemalloc
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from helpers import EVENTS, INTENTS, SCHEMES, inside, plain, planned_actions, target_of
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import (
    Action,
    DroneSwarmSearch,
    ResetNeeded,
)
from DroneSwarmSearch._internal.streams import RowGenerator, episode_keys, numbers, stream_keys
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.belief import after_drift, after_unsuccessful_search
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.vector import (
    SearchBatch,
    beliefs,
    collisions,
    on_the_fly_forecasts,
    tabulated_forecasts,
    threads,
)
from DroneSwarmSearch.vector.forecasts import DriftParameters, Forecasts
from DroneSwarmSearch.vector.on_the_fly_forecasts import OnTheFlyForecasts
from DroneSwarmSearch.vector.tabulated_forecasts import TabulatedForecasts, choose_forecasts

NAN, INF = float("nan"), float("inf")
PERSON = "person_initial_position"
POD = "probability_of_detection"
DRONES = "drones_positions"
CONSTANT = "disperse_constant"


# A batch, and a single environment for each of its rows.

# The axes of a value for all rows; with one axis more, each row has its own.
AXES = {"vector": 1, PERSON: 2, CONSTANT: 0, DRONES: 2}


def of_row(parameters: Mapping[str, Any], row: int) -> dict[str, Any]:
    """The parameters of one row, as the single environment takes them."""
    own = dict(parameters)
    for name, axes in AXES.items():
        if own.get(name) is not None:
            array = np.asarray(own[name])
            own[name] = (array[row % len(array)] if array.ndim > axes else array).tolist()
    return own


class Twins:
    """A batch, and for each row the single environment that it must reproduce."""

    def __init__(self, rows: int, parameters: Mapping[str, Any]) -> None:
        self.batch = SearchBatch(rows, **parameters)
        self.parameters = [of_row(parameters, row) for row in range(rows)]
        self.drones = [parameters_of.pop(DRONES, None) for parameters_of in self.parameters]
        self.usual = [DroneSwarmSearch(**parameters_of) for parameters_of in self.parameters]
        self.envs = list(self.usual)  # those of the episodes under way
        self.names = self.envs[0].possible_agents
        self.rewards = np.zeros((rows, len(self.names)))
        self.seeds: list[int | None] = [None] * rows
        self.episodes = [0] * rows
        self.frames: list[Frame] = []
        self.compared = 0
        self.received: Any = None

    def reset(
        self,
        seeds: list[int | None] | None = None,
        rows: list[int] | None = None,
        given: Mapping[str, Any] | None = None,
    ) -> None:
        which = range(len(self.envs)) if rows is None else rows
        self.batch.reset(seeds, None if rows is None else np.array(rows), given)
        for k, row in enumerate(which):
            self._begin(row, None if seeds is None else seeds[k], of_row(given or {}, row))
            self.rewards[row] = 0.0
        self.received = None
        self.compare()

    def _begin(self, row: int, seed: int | None, given: Mapping[str, Any]) -> None:
        self.seeds[row] = self.seeds[row] if seed is None else seed
        self.episodes[row] = 0 if seed is not None else self.episodes[row] + 1
        options = {DRONES: self.drones[row], **given}
        constant = options.pop(CONSTANT, None)
        self.envs[row] = env = self.usual[row]
        env.reset(seed=seed, options=options)
        if constant is not None:
            # The single environment's `reset` does not take it: another one goes as far.
            env = DroneSwarmSearch(**{**self.parameters[row], CONSTANT: constant})
            options = {"vector": self.usual[row].vector, **options}
            for episode in range(self.episodes[row] + 1):
                env.reset(seed=None if episode else self.seeds[row], options=options)
            self.envs[row] = env

    def step(self, actions: Any) -> None:
        ended = self.batch.ended.tolist()
        # Matrices come with a step, or are asked for after it.
        size = self.envs[0].grid_size
        asks = self.compared % 2
        self.received = np.full((len(ended), size, size), NAN, np.float32) if asks else None
        self.batch.step(actions, self.received)
        for row, env in enumerate(self.envs):
            if ended[row]:
                self._begin(row, None, {})
                self.rewards[row] = 0.0
            else:
                rewards = env.step(dict(zip(self.names, actions[row], strict=True)))[1]
                self.rewards[row] = [rewards[name] for name in self.names]
        self.compare()

    def compare(self) -> None:
        batch, size = self.batch, self.envs[0].grid_size
        self.frames = frames = [env.frame() for env in self.envs]
        every = np.arange(len(frames))
        expected = np.stack([frame.matrix for frame in frames])
        matrices = np.full_like(expected, NAN)
        batch.write_matrices(matrices)
        assert matrices.tobytes() == expected.tobytes()
        if self.received is not None:
            assert self.received.tobytes() == expected.tobytes()
        for rows in (every, every[self.compared % 2 :: 2]):
            assert batch.matrices_of(rows).tobytes() == expected[rows].tobytes()
        assert batch.rewards.tobytes() == self.rewards.tobytes()
        endings = [frame.ending for frame in frames]
        assert batch.endings.tolist() == [ending or 0 for ending in endings]
        assert batch.ended.tolist() == [ending is not None for ending in endings]
        drones = [[list(cell) for cell in frame.drones] for frame in frames]
        assert batch.positions.tolist() == drones
        assert batch.cells.tolist() == [[y * size + x for x, y in cells] for cells in drones]
        missing = batch.missing
        assert missing.tolist() == [[not f for f in frame.found] for frame in frames]
        persons = [[y * size + x for x, y in frame.persons] for frame in frames]
        assert (batch.person_cells == persons)[missing].all()
        assert batch.found.tolist() == [any(frame.found) for frame in frames]
        assert batch.searching.tolist() == [list(frame.searching) for frame in frames]
        assert batch.steps.tolist() == [frame.step for frame in frames]
        # In turn, every row's own view of itself.
        row = self.compared % len(frames)
        assert fields_of(batch.frame(row)) == fields_of(frames[row])
        self.compared += 1


def fields_of(frame: Frame) -> dict[str, Any]:
    """A frame's fields, as data that `==` compares."""
    return {**vars(frame), "matrix": frame.matrix.tobytes()}


def random_actions(rng: random.Random, twins: Twins) -> list[list[int]]:
    """Random actions, mostly searches and moves that stay on the grid."""
    size = twins.envs[0].grid_size
    chosen = []
    for frame in twins.frames:
        actions = [rng.choice([4, 4, 4, 5, rng.randrange(4)]) for _ in frame.drones]
        chosen.append(
            [
                action if inside(target_of(cell, action), size) or rng.random() < 0.1 else 5
                for cell, action in zip(frame.drones, actions, strict=True)
            ]
        )
    return chosen


# What has happened in a step.


def events_of(before: Frame, actions: list[int], after: Frame, successful: set[int]) -> set[str]:
    """The EVENTS of a step; adds the drones that find a person to `successful`."""
    drones, size, n = before.drones, before.grid_size, len(before.drones)
    targets = [target_of(cell, action) for cell, action in zip(drones, actions, strict=True)]
    left = [not inside(target, size) for target in targets]
    crowd = [0 if gone else targets.count(t) for t, gone in zip(targets, left, strict=True)]
    searches = [i for i, action in enumerate(actions) if action == Action.SEARCH]
    persons = range(len(before.persons))
    missing = {k for k in persons if not before.found[k]}
    found = {k for k in missing if after.found[k]}
    in_reach = {k for k in missing if before.persons[k] in {drones[i] for i in searches}}
    where_found = {before.persons[k] for k in persons if k not in missing}
    finders = {i for i in searches if drones[i] in {before.persons[k] for k in found}}
    last, several = after.step == after.timestep_limit, len(persons) > 1
    collided, crashed = max(crowd) > 1, max(crowd) > 1 or any(left)
    unsuccessful = [
        before.matrix[drones[i][::-1]]
        for i in searches
        if crowd[i] == 1 and i not in finders and (not last or i in successful)
    ]
    happened = {
        "collision": collided,
        "collision of three": max(crowd) > 2,
        "left the grid": any(left),
        "left and collided in one step": any(left) and collided,
        "a drone entered the cell of one that left": any(
            left[i] and drones[i] in targets for i in range(n)
        ),
        "a drone left beside a find": any(left) and bool(found),
        "exchange of cells": any(
            targets[i] == drones[j] and targets[j] == drones[i] for i in range(n) for j in range(i)
        ),
        "time up": last and not crashed and not finders,
        "time up, somebody had found somebody": last and not crashed and bool(successful),
        "find in the last step": last and bool(finders),
        "find": bool(finders),
        "two persons found by one search": len(found) > len({before.persons[k] for k in found}),
        "two drones found in one step": len(finders) > 1,
        "one of several found": several and bool(found) and found < missing,
        "all of several found": several and bool(found) and found == missing,
        "find beside a collision": bool(found) and collided,
        "missed in the right cell": bool(in_reach - found),
        "search of a likely cell": any(chance > 0.01 for chance in unsuccessful),
        "search of an unlikely cell": any(chance <= 0.01 for chance in unsuccessful),
        "search of a cell where somebody was found": any(
            drones[i] in where_found and i not in finders for i in searches
        ),
    }
    assert tuple(happened) == EVENTS
    successful |= finders
    return {event for event, did in happened.items() if did}


# Batches to try.


@dataclass(frozen=True)
class Case:
    """A batch's parameters, how it computes, and what is done with it."""

    rows: int
    parameters: dict[str, Any]
    on_the_fly: bool  # forecasts
    tile_rows: int
    few_drones: int  # up to this many are compared in pairs, see `collisions`
    plans: list[list[int]]
    seed: int
    steps: int
    resets: float  # the probability of a reset after a step
    shared: bool  # whether background threads take part


class Drawn:
    """Random values of the parameters that may differ between rows."""

    def __init__(self, rng: random.Random, rows: int, size: int, n: int, persons: int) -> None:
        self.rng, self.rows, self.n, self.persons = rng, rows, n, persons
        self.cells = [(x, y) for x in range(size) for y in range(size)]

    def one(self, name: str) -> Any:
        rng = self.rng
        if name == "vector":
            drifts = [0.0, -0.0, 0.3, -0.5, 1.0, -2.5]
            return [rng.choice(drifts), rng.choice(drifts)]
        if name == PERSON:
            pool = [rng.choice(self.cells) for _ in range(2)]  # some persons start together
            return [rng.choice(pool) for _ in range(self.persons)]
        if name == CONSTANT:
            return rng.choice([0, 1.0, 10, 1000.0])
        return rng.sample(self.cells, self.n)

    def value(self, name: str) -> Any:
        """One for all rows, or an array with one for each."""
        if self.rng.random() < 0.7:
            return self.one(name)
        return np.array([self.one(name) for _ in range(self.rows)])


def drawn_for(rng: random.Random, rows: int, parameters: Mapping[str, Any]) -> Drawn:
    persons = np.asarray(parameters[PERSON]).shape[-2]
    return Drawn(rng, rows, parameters["grid_size"], parameters["n_drones"], persons)


def random_case(rng: random.Random) -> Case:
    size, rows = rng.randint(2, 7), rng.randint(1, 6)
    n, persons = rng.randint(1, min(5, size**2)), rng.randint(1, 3)
    detections = [1.0, 1.0, 0.6, 0.2, 0.0]
    each = tuple(rng.choice(detections) for _ in range(persons))
    drawn = Drawn(rng, rows, size, n, persons)
    parameters = {
        "grid_size": size,
        "n_drones": n,
        "vector": drawn.value("vector"),
        PERSON: drawn.value(PERSON),
        CONSTANT: drawn.value(CONSTANT),
        "timestep_limit": rng.randint(1, 25),
        POD: rng.choice([each[0], each]),
        "bayesian_update": rng.random() < 0.5,
        "reward_scheme": rng.choice(SCHEMES),
        DRONES: drawn.value(DRONES) if rng.random() < 0.6 else None,
    }
    return Case(
        rows,
        parameters,
        on_the_fly=rng.random() < 0.4,
        tile_rows=rng.choice([1, 2, 3, 256]),
        few_drones=rng.choice([0, 32]),
        plans=[[rng.choice(INTENTS) for _ in range(rng.randint(1, 6))] for _ in range(n)],
        seed=rng.randrange(2**32),
        steps=rng.randint(4, 28),
        resets=rng.choice([0.0, 0.0, 0.15]),
        shared=rng.random() < 0.3,
    )


def planned(plans: list[list[int]], frame: Frame, turn: int, rng: random.Random) -> list[int]:
    """What the drones' plans come to in a step."""
    missing = [cell for cell, f in zip(frame.persons, frame.found, strict=True) if not f]
    actions = planned_actions(plans, turn, frame.drones, missing, frame.grid_size, rng)
    return list(map(int, actions))


HELPERS = threads._Workers()
HELPERS.number = 2


def use_threads(patch: pytest.MonkeyPatch) -> None:
    """Use background threads for small arrays, too, on any machine."""
    patch.setattr(threads, "_workers", HELPERS)
    patch.setattr(beliefs, "_LEAST_SHARED_BYTES", 0)
    patch.setattr(threads, "_LEAST_BYTES", 0)
    patch.setattr(threads, "_PART_BYTES", 100)  # so that there are several parts


def check_case(case: Case) -> Counter[str]:
    """Compare a batch with its environments; returns how often each event happened."""
    rng, events = random.Random(case.seed), Counter[str]()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(beliefs, "_TILE_ROWS", case.tile_rows)
        patch.setattr(beliefs, "_BEGIN_ROWS", 2)
        patch.setattr(on_the_fly_forecasts, "_CHUNK_BYTES", 500)  # so that there are several
        patch.setattr(collisions, "_FEW", case.few_drones)
        if case.on_the_fly:
            patch.setattr(tabulated_forecasts, "TABLE_BYTES", 0)
        if case.shared:
            use_threads(patch)
        twins = Twins(case.rows, case.parameters)
        twins.reset([rng.randrange(2**20) for _ in range(case.rows)])
        successful: list[set[int]] = [set() for _ in range(case.rows)]
        for turn in range(case.steps):
            before, ended = twins.frames, twins.batch.ended.tolist()
            actions = [
                planned(case.plans, frame, turn + row, rng) for row, frame in enumerate(before)
            ]
            twins.step(np.array(actions))
            for row, after in enumerate(twins.frames):
                if ended[row]:
                    successful[row] = set()
                else:
                    events.update(events_of(before[row], actions[row], after, successful[row]))
            if rng.random() < case.resets:
                rows = sorted(rng.sample(range(case.rows), rng.randint(1, case.rows)))
                drawn = drawn_for(rng, case.rows, case.parameters)
                given = {name: drawn.value(name) for name in AXES if rng.random() < 0.3}
                twins.reset([rng.choice([None, rng.randrange(99)]) for _ in rows], rows, given)
                for row in rows:
                    successful[row] = set()
    return events


@settings(deadline=None, max_examples=200, derandomize=True)
@given(st.randoms(use_true_random=False))
def test_every_row_is_the_single_environment(rng):
    check_case(random_case(rng))


@pytest.mark.slow
@settings(deadline=None, max_examples=4000, derandomize=True)
@given(st.integers(0, 2**64))
def test_every_row_is_the_single_environment_in_thousands_of_cases(seed):
    check_case(random_case(random.Random(seed)))


def test_every_event_occurs_in_the_comparisons() -> None:
    events: Counter[str] = Counter()
    for number in range(250):
        events += check_case(random_case(random.Random(number)))
    assert {event: events[event] for event in EVENTS if events[event] < 5} == {}


# Kinds of forecasts, tiles of beliefs, parameters of each row, long episodes.


@pytest.fixture(params=["tabulated", "on-the-fly"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """The forecasts that the batches of a test have."""
    if request.param == "on-the-fly":
        monkeypatch.setattr(tabulated_forecasts, "TABLE_BYTES", 0)
    return str(request.param)


def is_tabulated(batch: SearchBatch) -> bool:
    """Whether a batch of one person, without posteriors, has tables."""
    try:
        return batch.table.size > 0
    except ValueError:
        return False


def play(twins: Twins, steps: int, seed: int = 0) -> None:
    rng = random.Random(seed)
    for _ in range(steps):
        twins.step(np.array(random_actions(rng, twins)))


@pytest.mark.parametrize("bayesian", [False, True])
def test_episodes_of_many_blocks_are_those_of_the_single_environment(
    kind: str, bayesian: bool
) -> None:
    """Tables come in blocks of 32 steps; rows cross their edges at different times."""
    twins = Twins(
        3,
        {
            "grid_size": 6,
            "vector": (0.03, -0.02),
            PERSON: [(1, 4), (3, 3)],
            CONSTANT: 0.3,
            "timestep_limit": 150,
            POD: 0.2,
            "bayesian_update": bayesian,
        },
    )
    twins.reset([1, 2, 3])
    longest = 0
    rng = random.Random(1)
    for step in range(400):
        twins.step([[rng.choice([4, 5])] for _ in range(3)])
        longest = max(longest, int(twins.batch.steps.max()))
        if step == 40:
            twins.reset(rows=[1])
    assert longest == 150
    assert len(set(twins.batch.steps.tolist())) > 1


@pytest.mark.parametrize("tile_rows", [2, 3])
def test_beliefs_may_lie_in_several_tiles(
    kind: str, tile_rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beliefs, "_TILE_ROWS", tile_rows)
    twins = Twins(
        7,
        {
            "n_drones": 2,
            "vector": (0.4, 0.2),
            PERSON: [(1, 1), (3, 2), (1, 1)],
            "timestep_limit": 12,
            POD: (0.5, 1.0, 0.0),
            "bayesian_update": True,
        },
    )
    twins.reset(list(range(7)))
    play(twins, 60)


def test_searches_that_contradict_a_belief_leave_it_as_it_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No episode comes to that unless by rounding: it takes a sure search of the only cell."""
    monkeypatch.setattr(beliefs, "_TILE_ROWS", 2)
    start = np.array([[[1, 1, 0], [1, 1, 0]]])
    still = np.zeros((2, 3)), np.array([0.0, 9.0, 0.0])
    forecasts = OnTheFlyForecasts(4, DriftParameters(start, *still))
    forecasts.assign(np.arange(3), DriftParameters(start, *still))
    forecasts.begin(np.arange(3))
    forecasts.advance(np.empty(0, np.int64))  # the person of row 1 may now be in any of nine cells
    known = beliefs.Beliefs(4, (1.0,), 3)
    cells = np.array([5, 5, 0])
    everybody = np.ones((1, 3), bool)
    known.update(np.arange(3), cells, everybody, everybody, forecasts, None, lambda: None)
    matrices = known.matrices(np.arange(3), everybody)
    for row, cell in enumerate(cells.tolist()):
        forecast = ProbabilityMatrix(4, tuple(start[0, :, row].tolist()), (0, 0), still[1][row])
        learned, kept = after_unsuccessful_search(forecast.exact(1), [cell], 1.0)
        assert (kept == 0.0) == (row != 1)
        after = after_drift(learned, *forecast.moves(1))
        assert matrices[row].tobytes() == after.astype(np.float32).tobytes()


@pytest.mark.parametrize("bayesian", [False, True])
@pytest.mark.parametrize("persons", [1, 2])
def test_rows_may_have_parameters_of_their_own(kind: str, persons: int, bayesian: bool) -> None:
    rows, size, n = 5, 6, 3
    rng = np.random.default_rng(persons)
    cells = np.array([rng.permutation(size**2)[:n] for _ in range(rows)])
    own = {
        "vector": rng.uniform(-1, 1, (rows, 2)),
        PERSON: rng.integers(0, size, (rows, persons, 2)),
        CONSTANT: rng.uniform(0, 50, rows),
        DRONES: np.stack([cells % size, cells // size], axis=-1),
    }
    twins = Twins(
        rows,
        {
            "grid_size": size,
            "n_drones": n,
            "timestep_limit": 15,
            "bayesian_update": bayesian,
            POD: 0.5,
            **own,
        },
    )
    twins.reset(list(range(rows)))
    play(twins, 50)
    parameters = twins.batch.parameters
    assert parameters.keys() == own.keys()
    for name, value in own.items():
        np.testing.assert_array_equal(parameters[name], value)


def test_arrays_have_the_documented_types() -> None:
    batch = SearchBatch(3, n_drones=2, person_initial_position=[(0, 0), (1, 1)])
    batch.reset([1, 2, 3])
    batch.step(np.full((3, 2), Action.SEARCH))
    for name, dtype, shape in (
        ("rewards", np.float64, (3, 2)),
        ("endings", np.int8, (3,)),
        ("found", np.bool_, (3,)),
        ("ended", np.bool_, (3,)),
        ("steps", np.int64, (3,)),
        ("positions", np.int32, (3, 2, 2)),
        ("cells", np.int64, (3, 2)),
        ("searching", np.bool_, (3, 2)),
        ("missing", np.bool_, (3, 2)),
        ("person_cells", np.int64, (3, 2)),
    ):
        array = getattr(batch, name)
        assert (array.dtype, array.shape) == (dtype, shape), name
    assert batch.num_rows == 3


# Random numbers.


def episode_numbers(seed: int, episode: int, count: int, persons: int) -> Any:
    """The random draws of an episode: drift (count, persons, 2) and detection (count, persons)."""
    keys = episode_keys(stream_keys(seed)[:2, None], np.array([episode], np.uint64))
    places = np.arange(2 * count * persons, dtype=np.uint64)
    drift, detection = numbers(keys, places)
    return drift.reshape(count, persons, 2), detection[: count * persons].reshape(count, persons)


def moved(cell: int, number: float, higher: np.ndarray, lower: np.ndarray) -> int:
    if number < higher[cell]:
        return cell + 1
    return cell - 1 if number < higher[cell] + lower[cell] else cell


def test_persons_walk_by_the_draws_of_their_seed_and_episode(kind: str) -> None:
    size, steps, starts, seeds = 9, 40, [(4, 4), (0, 8)], [3, 3, 12345]
    parameters = {"vector": (0.3, -0.2), CONSTANT: 7.0}
    batch = SearchBatch(
        len(seeds), grid_size=size, timestep_limit=steps, person_initial_position=starts,
        **parameters,
    )  # fmt: skip
    batch.reset(seeds)
    matrices = [ProbabilityMatrix(size, start, *parameters.values()) for start in starts]
    for episode in range(2):
        drift = [episode_numbers(seed, episode, steps, len(starts))[0] for seed in seeds]
        at = [list(starts) for _ in seeds]
        for step in range(steps):
            expected = [[y * size + x for x, y in persons] for persons in at]
            assert batch.person_cells.tolist() == expected
            batch.step(np.full((len(seeds), 1), Action.IDLE))
            for row, persons in enumerate(at):
                for k, (x, y) in enumerate(persons):
                    right, left, down, up = matrices[k].moves(step)
                    u, v = drift[row][step, k]
                    persons[k] = moved(x, u, right, left), moved(y, v, down, up)
        assert batch.ended.all()
        batch.step(np.zeros((len(seeds), 1), int))


def test_searches_succeed_by_the_draws_of_their_seed_and_episode(kind: str) -> None:
    """A drone keeps searching the cell of two persons who do not move."""
    steps, pods, rows = 40, (0.15, 0.05), 20
    batch = SearchBatch(
        rows, vector=(0, 0), disperse_constant=0, timestep_limit=steps,
        person_initial_position=[(0, 0), (0, 0)], probability_of_detection=pods,
    )  # fmt: skip
    batch.reset(range(rows))
    times = Counter[int]()
    detection = [[episode_numbers(r, e, steps, 2)[1] for e in range(20)] for r in range(rows)]
    episode, found = [0] * rows, np.zeros((rows, 2), bool)
    for _ in range(90):
        before, ended = batch.steps.tolist(), batch.ended.tolist()
        batch.step(np.full((rows, 1), Action.SEARCH))
        for row in range(rows):
            if ended[row]:
                episode[row] += 1
                found[row] = False
            else:
                found[row] |= detection[row][episode[row]][before[row]] < pods
                times[before[row]] += int(found[row].all())
        assert batch.missing.tolist() == (~found).tolist()
    assert len(times) > 5  # searches failed, and succeeded


# Resets.


def seen(batch: SearchBatch) -> list[Any]:
    """All that can be seen of every row, the parameters included."""
    matrices = batch.matrices_of(np.arange(batch.num_rows))
    values = [
        batch.rewards, batch.endings, batch.found, batch.ended, batch.steps, batch.cells,
        batch.searching, batch.missing, batch.person_cells, matrices, *batch.parameters.values(),
    ]  # fmt: skip
    return [[plain(value[row]) for value in values] for row in range(batch.num_rows)]


EVERYWHERE = {
    "vector": (0.7, -0.4),
    PERSON: [(4, 4), (1, 3)],
    CONSTANT: 33.0,
    DRONES: [(3, 3), (2, 1)],
}
IN_EACH_ROW = {
    "vector": np.linspace(-0.5, 0.5, 8).reshape(4, 2),
    PERSON: np.arange(16).reshape(4, 2, 2) % 5,
    CONSTANT: np.array([0.0, 1.0, 20.0, 300.0]),
    DRONES: np.array([[(i, 1), (i, 2)] for i in range(4)]),
}


@pytest.mark.parametrize("values", [EVERYWHERE, IN_EACH_ROW], ids=["everywhere", "in each row"])
@pytest.mark.parametrize("names", [*[(name,) for name in AXES], tuple(AXES)], ids="+".join)
def test_a_vector_given_stays_and_the_rest_is_for_the_episode(
    kind: str, names: tuple[str, ...], values: dict[str, Any]
) -> None:
    twins = Twins(
        4,
        {
            "grid_size": 5,
            "n_drones": 2,
            PERSON: [(0, 0), (2, 2)],
            "timestep_limit": 8,
            "bayesian_update": True,
            POD: 0.5,
        },
    )
    twins.reset([5, 6, 7, 8])
    play(twins, 5)  # rows 0 and 2 are in mid-episode or have just ended
    usual, others = twins.batch.parameters, seen(twins.batch)
    twins.reset([None, 9], [1, 3], {name: values[name] for name in names})
    for row in (0, 2):
        assert seen(twins.batch)[row] == others[row]
    for row in (1, 3):
        expected = {**{name: value[row] for name, value in usual.items()}}
        expected.update({name: of_row(values, row)[name] for name in names})
        for name, value in twins.batch.parameters.items():
            np.testing.assert_array_equal(value[row], expected[name])
    play(twins, 30, seed=1)
    twins.reset([1, 2, 3, 4])
    for name, value in twins.batch.parameters.items():
        for row in (1, 3):
            stays = name == "vector" and "vector" in names
            expected_row = of_row(values, row)[name] if stays else usual[name][row]
            np.testing.assert_array_equal(value[row], expected_row)
    play(twins, 10)


def test_resets_with_many_vectors_switch_to_on_the_fly_forecasts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    twins = Twins(6, {"timestep_limit": 40, "vector": (0.1, 0.2)})
    twins.reset(list(range(6)))
    play(twins, 7)
    assert is_tabulated(twins.batch)
    monkeypatch.setattr(tabulated_forecasts, "TABLE_BYTES", 66_000)  # three forecasts of 41 steps
    twins.reset([3], [3], {"vector": (0.3, 0.2)})
    assert is_tabulated(twins.batch)
    play(twins, 5)
    vectors = np.random.default_rng(1).uniform(-1, 1, (6, 2))
    twins.reset([3, 4, 5], [3, 4, 5], {"vector": vectors})
    assert not is_tabulated(twins.batch)
    play(twins, 100)


def test_sequences_of_episodes_go_on_from_the_seeds_they_have() -> None:
    twins = Twins(3, {"timestep_limit": 3})
    twins.reset([1, 2, 3])
    twins.reset([None, 4, None])
    twins.reset([None, 5], [2, 0])
    twins.reset()
    assert twins.episodes == [1, 1, 3]
    assert twins.seeds == [5, 4, 3]
    play(twins, 12)


def test_rows_without_a_seed_begin_from_entropy() -> None:
    def walks(seeds: list[int | None]) -> list[bytes]:
        batch = SearchBatch(2, person_initial_position=(3, 3), timestep_limit=40)
        batch.reset(seeds)
        cells = []
        for _ in range(40):
            batch.step([[5], [5]])
            cells.append(batch.person_cells)
        return [row.tobytes() for row in np.stack(cells, axis=1)]

    first, second = walks([None, 1]), walks([None, 1])
    assert first[1] == second[1]
    assert len({*first, *second}) == 3


def test_the_batch_is_ready_once_every_row_has_begun() -> None:
    batch = SearchBatch(3)
    assert not batch.ready
    batch.reset([1, 2], np.array([0, 2]))
    assert not batch.ready
    with pytest.raises(ResetNeeded, match="reset"):
        batch.step(np.zeros((3, 1), int))
    batch.reset([1], np.array([1]))
    assert batch.ready
    batch.step(np.full((3, 1), Action.IDLE))
    assert batch.steps.tolist() == [1, 1, 1]


def test_restarted_rows_begin_their_next_episodes_and_keep_what_the_last_step_brought() -> None:
    parameters = {"grid_size": 4, "n_drones": 2, "timestep_limit": 6, "bayesian_update": True}
    restarted, reset = (SearchBatch(4, **parameters) for _ in range(2))
    restarted.reset(range(4))
    reset.reset(range(4))
    rng, endings = np.random.default_rng(1), Counter[int]()
    for _ in range(40):
        actions = rng.integers(0, 6, (4, 2))
        restarted.step(actions)
        reset.step(actions)
        if (rows := np.flatnonzero(reset.ended)).size:
            rewards = reset.rewards.tobytes()
            endings.update(reset.endings[rows].tolist())
            restarted.restart(rows)
            assert restarted.endings.tobytes() == reset.endings.tobytes()
            assert restarted.rewards.tobytes() == rewards
            reset.reset(rows=rows)
        # Rewards and endings, the first two, are cleared only by `reset`.
        assert [row[2:] for row in seen(restarted)] == [row[2:] for row in seen(reset)]
        assert not restarted.ended.any()
    assert endings.total() > 10


@pytest.mark.parametrize("read_only", [False, True])
def test_arrays_of_actions_are_only_read(read_only: bool) -> None:
    """Nor does the batch remember them as its own, which a reset writes into."""
    batch = SearchBatch(3)
    batch.reset([1, 2, 3])
    actions = np.full((3, 1), int(Action.SEARCH))
    actions.flags.writeable = not read_only
    for begin_again in (batch.reset, lambda: batch.restart(np.array([0, 2]))):
        batch.reset()
        batch.step(actions)
        begin_again()
        assert actions.tolist() == [[Action.SEARCH]] * 3
    batch.reset()
    batch.step(actions := np.full((3, 1), int(Action.SEARCH)))
    actions[:] = Action.IDLE
    assert batch.searching.all()


# Samplers.


def everything_sampled(rng: RowGenerator) -> dict[str, Any]:
    """Two drones in different halves of a grid of 6 x 6, one person anywhere."""
    return {
        "vector": rng.uniform(-1, 1, 2),
        PERSON: rng.integers(0, 6, (1, 2)),
        CONSTANT: rng.uniform(0, 30),
        DRONES: rng.integers([[0, 0], [3, 0]], [[3, 6], [6, 6]], (2, 2)),
    }


SAMPLED = {
    "grid_size": 6,
    "n_drones": 2,
    "timestep_limit": 12,
    POD: 0.5,
    "bayesian_update": True,
}


def test_what_is_sampled_depends_on_seed_and_episode_alone() -> None:
    seeds = [4, 8, 15, 16, 23]
    together = SearchBatch(5, sampler=everything_sampled, **SAMPLED)
    together.reset(seeds)
    single = [SearchBatch(1, sampler=everything_sampled, **SAMPLED) for _ in seeds]
    for batch, seed in zip(single, seeds, strict=True):
        batch.reset([seed])
    rng = np.random.default_rng(1)
    different = set()
    for _ in range(80):
        rows = seen(together)
        assert rows == [seen(batch)[0] for batch in single]
        different |= {repr(row[-4:]) for row in rows}
        actions = rng.choice([0, 1, 2, 3, 4, 4, 4, 4], (5, 2))
        together.step(actions)
        for row, batch in enumerate(single):
            batch.step(actions[row : row + 1])
    assert len(different) > 40  # episodes, each with parameters of its own


def test_sampled_parameters_given_to_single_environments_make_the_same_episodes() -> None:
    seeds = list(range(6))
    batch = SearchBatch(len(seeds), sampler=everything_sampled, **SAMPLED)
    batch.reset(seeds)
    rng = np.random.default_rng(2)

    def begin(row: int, episode: int) -> DroneSwarmSearch:
        options = {name: value[row].tolist() for name, value in batch.parameters.items()}
        env = DroneSwarmSearch(**SAMPLED, disperse_constant=options.pop(CONSTANT))
        for number in range(episode + 1):
            env.reset(seed=None if number else seeds[row], options=options)
        return env

    episodes = [0] * len(seeds)
    envs = [begin(row, 0) for row in range(len(seeds))]
    for _ in range(60):
        ended, actions = batch.ended.tolist(), rng.choice([0, 1, 2, 3, 4, 4, 4], (len(seeds), 2))
        batch.step(actions)
        for row in range(len(seeds)):
            if ended[row]:
                episodes[row] += 1
                envs[row] = begin(row, episodes[row])
            else:
                drone0, drone1 = actions[row].tolist()
                rewards = envs[row].step({"drone0": drone0, "drone1": drone1})[1]
                assert list(rewards.values()) == batch.rewards[row].tolist()
            assert plain(vars(batch.frame(row))) == plain(vars(envs[row].frame()))
    assert max(episodes) > 3


def test_what_is_not_sampled_is_as_the_batch_was_given_it() -> None:
    batch = SearchBatch(
        3,
        sampler=lambda rng: {"vector": rng.uniform(-1, 1, 2)},
        person_initial_position=[[(1, 1)], [(2, 2)], [(3, 3)]],
        disperse_constant=[1, 2, 3],
        drones_positions=[(5, 5)],
    )
    batch.reset([1, 2, 3])
    parameters = batch.parameters
    assert parameters[PERSON].tolist() == [[[1, 1]], [[2, 2]], [[3, 3]]]
    assert parameters[CONSTANT].tolist() == [1, 2, 3]
    assert parameters[DRONES].tolist() == [[[5, 5]]] * 3
    assert len(np.unique(parameters["vector"])) == 6


def test_what_reset_is_given_is_not_sampled_for_that_episode() -> None:
    batch, other = (SearchBatch(3, sampler=everything_sampled, **SAMPLED) for _ in range(2))
    for name, value in {CONSTANT: 7.5, PERSON: [[2, 3]], DRONES: [[1, 1], [4, 0]]}.items():
        batch.reset([1, 2, 3], given={name: value})
        other.reset([1, 2, 3])
        expected = other.parameters
        assert value not in expected[name].tolist()
        expected[name] = np.array([value] * 3)
        assert batch.parameters.keys() == expected.keys()
        for parameter, values in batch.parameters.items():
            assert values.tolist() == expected[parameter].tolist()
        batch.reset()
        other.reset()
        assert plain(batch.parameters) == plain(other.parameters)


def test_row_numbers_have_the_ranges_and_shapes_asked_for() -> None:
    rng = RowGenerator(stream_keys(1))
    assert len(rng) == 3
    for size, shape in (((), (3,)), (4, (3, 4)), ((2, 5), (3, 2, 5)), (0, (3, 0))):
        drawn = rng.random(size)
        assert drawn.shape == shape and drawn.dtype == np.float64
        assert rng.uniform(2, 3, size).shape == shape
        assert rng.integers(2, 9, size).shape == shape
    wide = RowGenerator(np.arange(4, dtype=np.uint64))
    uniform = wide.uniform([-3.0, 10.0], [-1.0, 11.0], (5000, 2))
    for column, (low, high) in enumerate([(-3, -1), (10, 11)]):
        drawn = uniform[..., column]
        assert low <= drawn.min() and drawn.max() < high
        error = (high - low) / math.sqrt(12 * drawn.size)
        assert abs(drawn.mean() - (low + high) / 2) < 5 * error
    integers = wide.integers([-2, 5], [1, 15], (5000, 2))
    assert integers.dtype == np.int64
    for column, (low, high) in enumerate([(-2, 1), (5, 15)]):
        values, counts = np.unique(integers[..., column], return_counts=True)
        assert values.tolist() == list(range(low, high))
        expected = integers[..., column].size / (high - low)
        assert np.abs(counts - expected).max() < 5 * math.sqrt(expected)


def test_row_numbers_go_on_and_do_not_depend_on_the_other_rows() -> None:
    keys = stream_keys(7)
    together = RowGenerator(keys)
    drawn = [together.random(3), together.uniform(0, 2), together.integers(0, 100, (2, 2))]
    for row in range(3):
        single = RowGenerator(keys[row : row + 1])
        again = [single.random(3), single.uniform(0, 2), single.integers(0, 100, (2, 2))]
        assert [plain(one[0]) for one in again] == [plain(one[row]) for one in drawn]
    assert RowGenerator(keys).random(3).tolist() == drawn[0].tolist()
    assert not set(together.random(3).ravel()) & set(drawn[0].ravel())


@pytest.mark.parametrize("size", [np.int64(3), np.uint8(3), (3,), [np.int32(3)], np.array([3])])
def test_sizes_of_random_numbers_may_be_numpy_integers(size: Any) -> None:
    keys = stream_keys(1)
    assert RowGenerator(keys).random(size).tolist() == RowGenerator(keys).random(3).tolist()
    assert RowGenerator(keys).integers(0, 9, size).shape == (3, 3)


@pytest.mark.parametrize("size", [2.0, True, -1, "3", (2, None), [(1, 2), 3], None])
def test_other_sizes_of_random_numbers_are_refused(size: Any) -> None:
    rng = RowGenerator(stream_keys(1))
    for draw in (rng.random, rng.uniform):
        with pytest.raises((TypeError, ValueError), match="size must be an integer of at least 0"):
            draw(size=size)
    assert rng.random(2).tolist() == RowGenerator(stream_keys(1)).random(2).tolist()


@pytest.mark.parametrize(
    ("low", "high", "error", "message"),
    [
        (15, 5, ValueError, "low must be below high, got 15 and 5"),
        (3, 3, ValueError, "low must be below high"),
        ([0, 9], [5, 9], ValueError, "low must be below high"),
        (0, 2.5, TypeError, "high must be an integer or an array of integers, got 2.5"),
        (0.5, 3, TypeError, "low must be an integer"),
        (0, np.nan, TypeError, "high must be an integer"),
        (0, 2**70, TypeError, "high must be an integer"),
        (0, "x", TypeError, "high must be an integer"),
        (0, [[1], [2, 3]], ValueError, "high must be an integer"),
    ],
)
def test_bounds_of_integers_are_checked(low: Any, high: Any, error: Any, message: str) -> None:
    rng = RowGenerator(stream_keys(1))
    with pytest.raises(error, match=message):
        rng.integers(low, high, 2)
    assert rng.random(2).tolist() == RowGenerator(stream_keys(1)).random(2).tolist()


@pytest.mark.parametrize(("low", "high"), [(0, 1), (5, 6), (5, 15), (1000, 1001), (-3, 4)])
def test_integers_stay_below_their_bound_whatever_is_drawn(
    low: int, high: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = RowGenerator(stream_keys(1))
    for number, expected in ((0.0, low), (1 - 2.0**-53, high - 1)):
        monkeypatch.setattr(rng, "random", lambda size=(), number=number: np.full(3, number))
        assert rng.integers(low, high).tolist() == [expected] * 3


class Configurable:
    """A sampler that returns or raises a class attribute, which copies do not contain."""

    result: Any = None

    def __call__(self, rng: RowGenerator) -> Any:
        if isinstance(self.result, Exception):
            raise self.result
        return self.result


BAD_SAMPLES: list[tuple[Any, type[Exception], str]] = [
    (None, TypeError, "sampler must return a mapping, got None"),
    ([("vector", (0, 0))], TypeError, "sampler must return a mapping"),
    ({"speed": 1}, ValueError, "'speed'"),
    ({"timestep_limit": 5}, ValueError, "'timestep_limit'"),
    ({"vector": np.zeros((7, 2))}, ValueError, "vector"),
    ({"vector": (0, NAN)}, ValueError, "vector"),
    ({"vector": "ab"}, TypeError, "vector"),
    ({CONSTANT: -1.0}, ValueError, CONSTANT),
    ({PERSON: (7, 0)}, ValueError, PERSON),
    ({PERSON: np.zeros((1, 3, 2), int)}, ValueError, PERSON),
    ({DRONES: [(0, 0), (0, 0)]}, ValueError, f"{DRONES} must hold different cells"),
    ({DRONES: [(0, 0)]}, ValueError, DRONES),
    (KeyError("broken"), KeyError, "broken"),
]


@pytest.mark.parametrize(("result", "error", "match"), BAD_SAMPLES)
def test_a_sampler_that_fails_leaves_the_batch_as_it_was(
    result: Any, error: type[Exception], match: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    batch = SearchBatch(3, n_drones=2, timestep_limit=2, sampler=Configurable())
    monkeypatch.setattr(Configurable, "result", {"vector": (0.5, 0.5)})
    batch.reset([1, 2, 3])
    batch.step(np.full((3, 2), 5))
    batch.reset([4], np.array([1]))  # so that it is in mid-episode while the others end
    batch.step(np.full((3, 2), 5))
    assert batch.ended.tolist() == [True, False, True]
    twin = copy.deepcopy(batch)
    monkeypatch.setattr(Configurable, "result", result)
    for begin in (
        batch.reset,
        lambda: batch.reset([9], np.array([1]), {"vector": (0.1, 0.1)}),
        lambda: batch.restart(np.array([0])),
        lambda: batch.step(np.full((3, 2), 5)),
    ):
        with pytest.raises(error, match=match):
            begin()
        assert seen(batch) == seen(twin)
    monkeypatch.setattr(Configurable, "result", {"vector": (0.2, 0.5)})
    for _ in range(4):
        for each in (batch, twin):
            each.step(np.full((3, 2), 5))
        assert seen(batch) == seen(twin)


# Copies.

COPIED: dict[str, dict[str, Any]] = {
    "plain": {},
    "bayesian": {"bayesian_update": True},
    "vectors": {"vector": np.linspace(-1, 1, 10).reshape(5, 2)},
    "sampler": {"sampler": everything_sampled},
    "several persons": {PERSON: [(1, 1), (4, 4), (1, 1)], POD: (0.5, 1.0, 0.2)},
    "several persons, bayesian": {PERSON: [(1, 1), (4, 4)], "bayesian_update": True},
}


@pytest.mark.parametrize(
    "through", [copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))]
)
@pytest.mark.parametrize("name", COPIED)
def test_copies_are_equal_and_independent(
    kind: str, name: str, through: Callable[[SearchBatch], SearchBatch]
) -> None:
    batch = SearchBatch(
        5, **{"grid_size": 6, "n_drones": 2, "timestep_limit": 40, POD: 0.5, **COPIED[name]}
    )
    batch.reset(range(5))
    rng = np.random.default_rng(1)
    actions = rng.choice([0, 1, 2, 3, 4, 4, 4, 5, 5, 5], (90, 5, 2))

    def play_on(batch: SearchBatch) -> list[Any]:
        log = []
        for chosen in actions[20:]:
            batch.step(chosen)
            log.append(seen(batch))
        batch.reset(given={"vector": (0.2, 0.1)})
        return [*log, seen(batch)]

    for chosen in actions[:20]:
        batch.step(chosen)
    assert batch.steps.any()
    state = pickle.dumps(batch)
    log = play_on(through(batch))
    assert pickle.dumps(batch) == state
    assert play_on(batch) == log


# Bad input.

BAD_ACTIONS: list[tuple[Any, type[Exception], str]] = [
    ([[0.0], [1.0]], TypeError, "actions must be integers from 0 to 5, got float64"),
    ([[True], [False]], TypeError, "actions must be integers from 0 to 5, got bool"),
    ([["0"], ["1"]], TypeError, "actions must be integers from 0 to 5, got <U1"),
    ([[None], [1]], TypeError, "actions must be integers from 0 to 5, got object"),
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


def test_numpys_settings_stay_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    batch = SearchBatch(2, bayesian_update=True)
    batch.reset([1, 2])
    usual, while_drifting = np.getbufsize(), []
    monkeypatch.setattr(beliefs, "drift", lambda *_: while_drifting.append(np.getbufsize()))
    batch.step([[Action.SEARCH], [Action.IDLE]])
    assert while_drifting == [beliefs._BUFFER_SIZE]
    assert np.getbufsize() == usual != beliefs._BUFFER_SIZE


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
        batch.reset([7, seed], given={"vector": (1, 1)})
    assert pickle.dumps(batch) == before


BAD_ROWS: list[tuple[Any, type[Exception], str]] = [
    ([3], ValueError, "got 3"),
    ([-1], ValueError, "got -1"),
    (np.array([0, 2**64 - 1], np.uint64), ValueError, "got -1"),
    ([1, 1], ValueError, r"got \[1, 1\]"),
    ([0.0, 1.0], TypeError, "got float64"),
    ([True, False], TypeError, "got bool"),
    (["0"], TypeError, "got <U1"),
    ("0", TypeError, "got <U1"),
    (1, ValueError, r"got shape \(\)"),
    ([[0], [1]], ValueError, r"got shape \(2, 1\)"),
    ([[0], [1, 2]], ValueError, "list or an array of integers, got"),
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
        with pytest.raises(ValueError, match=r"rows must be .*rising order; got \[2, 1\]"):
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
    batch.reset([1, 2], given={})
    for row in (2, -1):
        with pytest.raises(ValueError, match=f"row must be an integer from 0 to 1, got {row}"):
            batch.frame(row)
    with pytest.raises(TypeError, match="row must be an integer from 0 to 1"):
        batch.frame(0.0)  # type: ignore[arg-type]
    for wrong in (5, 0, [("vector", (0, 0))], "vector"):
        with pytest.raises(TypeError, match="given must be a mapping, got"):
            batch.reset([1, 2], given=wrong)  # type: ignore[arg-type]


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
        ("num_rows", lambda: SearchBatch(10**8, grid_size=10**4, sampler=Configurable())),
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
    batch = SearchBatch(8, grid_size=40, wants_table=True)
    batch.reset(range(8))
    before = pickle.dumps(batch)
    monkeypatch.setattr(  # 4 MiB
        os, "sysconf", {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**10}.get, raising=False
    )
    with pytest.raises(
        ValueError, match=r"timestep_limit must be smaller: .* 8 different forecasts"
    ):
        batch.reset(range(8), given={"vector": np.linspace(0, 1, 16).reshape(8, 2)})
    assert pickle.dumps(batch) == before


# For three rows of two drones and one person on 7 x 7 cells; the constructor and `reset`.
BAD_VALUES: list[tuple[Any, ...]] = [
    ("vector", np.zeros((2, 2)), ValueError, r"array of shape \(3, 2\); got one of shape \(2, 2\)"),
    ("vector", np.zeros((3, 3)), ValueError, r"\(3, 3\)"),
    ("vector", np.zeros((1, 3, 2)), ValueError, r"\(1, 3, 2\)"),
    ("vector", [(0, 0), (0, NAN), (0, 0)], ValueError, "nan"),
    ("vector", [(0, 0), (0, -INF), (0, 0)], ValueError, "-inf"),
    ("vector", [(0, 0), (0,), (0, 0)], ValueError, r"\(0,\)"),
    ("vector", [("a", "b")] * 3, TypeError, "'a'"),
    ("vector", np.zeros((3, 2), bool), TypeError, "False"),
    ("vector", np.zeros((3, 2), complex), TypeError, r"0\.j"),
    ("vector", (NAN, 0), ValueError, "nan"),
    ("vector", (0, 0, 0), ValueError, r"\(0, 0, 0\)"),
    ("vector", 0.5, TypeError, "0.5"),
    ("vector", "ab", TypeError, "ab"),
    ("vector", None, TypeError, "None"),
    (CONSTANT, [1, 2], ValueError, r"array of shape \(3,\); got one of shape \(2,\)"),
    (CONSTANT, [[1], [2], [3]], ValueError, r"\(3, 1\)"),
    (CONSTANT, [1, -2, 3], ValueError, "of at least 0, got -2"),
    (CONSTANT, [1, NAN, 3], ValueError, "nan"),
    (CONSTANT, [1, INF, 3], ValueError, "inf"),
    (CONSTANT, ["1", "2", "3"], TypeError, "'1'"),
    (CONSTANT, [True, True, True], TypeError, "True"),
    (CONSTANT, -0.5, ValueError, "of at least 0, got -0.5"),
    (CONSTANT, NAN, ValueError, "nan"),
    (CONSTANT, "10", TypeError, "'10'"),
    (CONSTANT, None, TypeError, "None"),
    (PERSON, np.zeros((2, 1, 2), int), ValueError, r"\(2, 1, 2\)"),
    (PERSON, np.zeros((3, 1, 3), int), ValueError, "cell"),
    (PERSON, np.zeros((3, 0, 2), int), ValueError, "cell"),
    (PERSON, np.zeros((1, 3, 1, 2), int), ValueError, "cell"),
    (PERSON, [[(0, 0)], [(7, 0)], [(0, 0)]], ValueError, r"\[1\]\[0\] .* from 0 to 6, got \[7"),
    (PERSON, [[(0, 0)], [(0, -1)], [(0, 0)]], ValueError, r"from 0 to 6, got \[.*-1"),
    (PERSON, [[(0, 0)], [(0, 0.5)], [(0, 0)]], ValueError, r"from 0 to 6, got \[.*0\.5"),
    (PERSON, [[(0, 0)], [(0, NAN)], [(0, 0)]], ValueError, r"from 0 to 6, got \[.*nan"),
    (PERSON, [[(0, 0)], [(0, 1e300)], [(0, 0)]], ValueError, r"from 0 to 6, got \[.*1e\+300"),
    (PERSON, (NAN, 0), ValueError, "nan"),
    (PERSON, (7, 0), ValueError, "7"),
    (PERSON, (1, 2, 3), ValueError, r"got shape \(3,\)"),
    (PERSON, [("0", "0")], TypeError, "'0'"),
    (PERSON, [], ValueError, "cell"),
    (PERSON, [[]], ValueError, "cell"),
    (PERSON, (True, 0), TypeError, "True"),
    (PERSON, "00", TypeError, "00"),
    (PERSON, None, TypeError, "None"),
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
        batch.reset([5, 6], np.array([0, 2]), {"vector": (0, 1), name: value})
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


FORMS: dict[str, Callable[[np.ndarray], Any]] = {
    "array": np.array,
    "floats": lambda cells: np.array(cells, float),
    "list": np.ndarray.tolist,
    "tuple": lambda cells: tuple(cells.tolist()),
    "list of arrays": list,
}
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)


@each_form
@pytest.mark.parametrize(("rows", "persons"), [(1, 1), (1, 3), (2, 2), (3, 3), (2, 1), (4, 2)])
def test_the_shape_of_start_cells_says_whose_they_are(
    form: Callable[[np.ndarray], Any], rows: int, persons: int
) -> None:
    """In every form, in the constructor, in `reset` and from a sampler."""
    cells = np.random.default_rng(0).integers(0, 7, (rows, persons, 2))
    for value, expected in (
        (form(cells[0]), np.broadcast_to(cells[0], cells.shape)),
        (form(cells), cells),
    ):
        made = SearchBatch(rows, person_initial_position=value)
        assert made.parameters[PERSON].tolist() == expected.tolist()
        usual = np.zeros((persons, 2), int)
        given = SearchBatch(rows, person_initial_position=usual)
        given.reset(range(rows), given={PERSON: value})
        assert given.parameters[PERSON].tolist() == expected.tolist()
        sampled = SearchBatch(
            rows, person_initial_position=usual, sampler=lambda rng, value=value: {PERSON: value}
        )
        sampled.reset(range(rows))
        assert sampled.parameters[PERSON].tolist() == expected.tolist()


@each_form
def test_a_cell_alone_is_one_persons_in_every_row(form: Callable[[np.ndarray], Any]) -> None:
    batch = SearchBatch(3, person_initial_position=form(np.array([4, 5])))
    assert batch.parameters[PERSON].tolist() == [[[4, 5]]] * 3


@each_form
@pytest.mark.parametrize(
    "shape",
    [(0,), (1,), (3,), (0, 2), (2, 3), (1, 2, 2), (5, 1, 2), (3, 0, 2), (3, 2, 1), (3, 1, 1, 2)],
)
def test_start_cells_of_other_shapes_are_refused(
    form: Callable[[np.ndarray], Any], shape: tuple[int, ...]
) -> None:
    cells = form(np.ones(shape, int))
    with pytest.raises((TypeError, ValueError), match=f"{PERSON} must be"):
        SearchBatch(3, person_initial_position=cells)


def test_cells_as_many_as_rows_are_not_taken_for_one_persons() -> None:
    """Who means one for each row writes (rows, 1, 2)."""
    cells = np.array([(0, 0), (1, 1), (2, 2)])
    batch = SearchBatch(3)
    batch.reset(range(3), given={PERSON: cells[:, None]})
    assert batch.parameters[PERSON].tolist() == cells[:, None].tolist()
    words = rf"{PERSON} must be .*of each search, of shape \(3, 1, 2\); got shape \(3, 2\)"
    for value in (cells, cells.tolist()):
        with pytest.raises(ValueError, match=words):
            batch.reset(range(3), given={PERSON: value})


@pytest.mark.parametrize("name", ["timestep_limit", "speed", "n_drones", ""])
def test_reset_refuses_names_that_it_does_not_know(name: str) -> None:
    batch = SearchBatch(2)
    batch.reset([1, 2])
    before = pickle.dumps(batch)
    with pytest.raises(
        ValueError, match=f"given must .*vector, {PERSON}, {CONSTANT}, {DRONES}\\), got {name!r}"
    ):
        batch.reset([1, 2], given={"vector": (1, 1), name: 1})
    assert pickle.dumps(batch) == before


def test_a_reset_cannot_change_the_number_of_persons() -> None:
    batch = SearchBatch(3, person_initial_position=[(0, 0), (1, 1)])
    for cells in ([(0, 0)], (0, 0), [(0, 0)] * 3, np.zeros((3, 1, 2), int)):
        with pytest.raises(ValueError, match=rf"{PERSON} must be .*of shape \(2, 2\), or those"):
            batch.reset([1, 2, 3], given={PERSON: cells})


def test_nothing_steps_before_the_first_reset() -> None:
    batch = SearchBatch(2)
    before = pickle.dumps(batch)
    for actions in ([[5], [5]], "nonsense"):
        with pytest.raises(ResetNeeded, match="reset"):
            batch.step(actions)
    assert pickle.dumps(batch) == before


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("vector", (Fraction(1, 2), 0)),
        ("vector", (10**30, 0)),
        ("vector", np.array([0.5, 0.25], np.float32)),
        (CONSTANT, Fraction(5, 2)),
        (CONSTANT, 10**30),
        (CONSTANT, np.float32(2.5)),
        (PERSON, (3.0, 2)),
        (PERSON, (np.int8(3), 2)),
        (PERSON, (Fraction(3), 2)),
        (PERSON, [np.array([3, 2]), (1, 1)]),
    ],
    ids=repr,
)
def test_numbers_of_every_kind_that_the_single_environment_takes_are_taken(
    name: str, value: Any
) -> None:
    env = DroneSwarmSearch(**{name: value})
    env.reset(seed=3)
    batch = SearchBatch(3, **{name: value})
    batch.reset([3, 4, 5])
    for _ in range(5):
        env.step({"drone0": 5})
        batch.step([[5], [5], [5]])
        assert plain(vars(batch.frame(0))) == plain(vars(env.frame()))


# Memory and time.


@pytest.mark.parametrize("bayesian", [False, True])
def test_nothing_grows_with_the_steps(kind: str, bayesian: bool) -> None:
    batch = SearchBatch(
        4, grid_size=5, n_drones=2, timestep_limit=20, bayesian_update=bayesian,
        probability_of_detection=0.3, person_initial_position=[(2, 2), (1, 3)],
    )  # fmt: skip
    batch.reset(range(4))
    actions = np.random.default_rng(1).choice([1, 0, 2, 3, 4, 4, 4, 4, 5, 5], (400, 4, 2))
    tracemalloc.start()
    try:
        for step, chosen in enumerate(actions):
            batch.step(chosen)
            if step == 99:
                gc.collect()
                before = tracemalloc.get_traced_memory()[0]
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 4000


def test_episodes_of_a_million_steps_need_no_more_memory_than_short_ones() -> None:
    tracemalloc.start()
    try:
        batch = SearchBatch(3, timestep_limit=10**6)
        batch.reset(range(3))
        batch.step(np.full((3, 1), Action.IDLE))
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert not is_tabulated(batch)
    assert most < 2**20


# The forecasts by themselves.


def parameters_of(
    starts: list[list[tuple[int, int]]], drifts: list[tuple[float, float]], constants: list[float]
) -> DriftParameters:
    """Forecasts of some rows: the persons' starts, the drift and the constant of each."""
    return DriftParameters(
        np.array(starts).transpose(1, 2, 0).copy(), np.array(drifts).T.copy(), np.array(constants)
    )


# Three rows of two persons on 6 x 6 cells.
SIZE = 6
STARTS = [[(0, 0), (2, 3)], [(5, 1), (5, 1)], [(2, 3), (0, 0)]]
DRIFTS = [(0.3, -0.2), (-0.5, 0.0), (0.3, -0.2)]
CONSTANTS = [3.0, 0.0, 3.0]
SIX = parameters_of(STARTS, DRIFTS, CONSTANTS)  # of the six forecasts three differ


def check_forecasts(made: Forecasts, steps: list[int]) -> None:
    """The forecasts of the three rows at some steps are those of `ProbabilityMatrix`."""
    every = np.arange(3)
    for person in range(2):
        of = [
            ProbabilityMatrix(SIZE, STARTS[row][person], DRIFTS[row], CONSTANTS[row])
            for row in every
        ]
        out = np.empty((3, SIZE, SIZE), np.float32)
        made.write_matrices(person, slice(None), out)
        matrices = np.stack([forecast.at(step) for forecast, step in zip(of, steps, strict=True)])
        assert out.tobytes() == matrices.tobytes()
        for cell in (0, 13, 35):
            shown = made.probabilities(person, every, np.full(3, cell))
            assert shown.tolist() == matrices.reshape(3, -1)[:, cell].tolist()
        x, y = made.marginals(person, every)
        right, left, down, up = made.moves(person, slice(None))
        for row, (forecast, step) in enumerate(zip(of, steps, strict=True)):
            assert plain([x[row], y[row]]) == plain(list(forecast.marginals(step)))
            moves = [chances[:, row] for chances in (right, left, down, up)]
            assert plain(moves) == plain(list(forecast.moves(step)))
        for axis, (higher, lower) in enumerate(((right, left), (down, up))):
            for at in range(SIZE):
                check_walk(made, person, axis, at, higher, lower)


def check_walk(
    made: Forecasts,
    person: int,
    axis: int,
    at: int,
    higher: np.ndarray,
    lower: np.ndarray,
) -> None:
    """From a cell persons walk as their chances say, to the last bit of the numbers drawn."""
    for chances in (higher[at], higher[at] + lower[at]):
        for numerators in (np.ceil(chances * 2**53) - 1, np.ceil(chances * 2**53)):
            draws = np.zeros((2, 2, 3), np.int64)
            draws[person, axis] = np.clip(numerators, 0, 2**53 - 1)
            cells = np.full(draws.shape, at)
            made.walk(cells, draws)
            assert cells[person, axis].tolist() == [
                moved(at, number, higher[:, row], lower[:, row])
                for row, number in enumerate((draws[person, axis] * 2.0**-53).tolist())
            ]


class Held:
    """Forecasts of three rows, with pointers that advance as in `BatchState`."""

    def __init__(self, made: Forecasts) -> None:
        self.forecasts = made
        self._now, self._first = (np.zeros((len(made.increments), 3), np.int64) for _ in range(2))
        made.bind(self._now, self._first)
        made.assign(np.arange(3), SIX)
        self.begin([0, 1, 2])

    def begin(self, rows: list[int]) -> None:
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.begin(np.array(rows))

    def advance(self, beginning: Sequence[int] = ()) -> None:
        rows = np.array(beginning, np.int64)
        self._now += self.forecasts.increments
        self._now[:, rows] = self._first[:, rows]
        self.forecasts.advance(rows)


@pytest.mark.parametrize(
    "make", [lambda: TabulatedForecasts(SIZE, 80, SIX), lambda: OnTheFlyForecasts(SIZE, SIX)]
)
def test_forecasts_are_those_of_the_matrix_at_every_rows_step(
    make: Callable[[], Forecasts],
) -> None:
    held, steps = Held(make()), [0, 0, 0]
    for step in range(80):
        check_forecasts(held.forecasts, steps)
        held.advance([2] if step == 20 else [])
        steps = [one + 1 for one in steps]
        if step == 20:
            steps[2] = 0
        if step in (5, 40):
            held.begin([1, 2])
            steps[1:] = 0, 0
    check_forecasts(held.forecasts, [80, 39, 39])
    again = Held(make())
    again.forecasts.catch_up(np.array([70, 0, 33]))
    check_forecasts(again.forecasts, [70, 0, 33])


def filled_steps(tables: TabulatedForecasts) -> int:
    """The steps for which the tables of the three forecasts hold matrices."""
    return int(tables.matrices.reshape(3, 101, -1).any(axis=(0, 2)).sum())


def test_tables_fill_as_far_as_the_rows_come() -> None:
    tables = TabulatedForecasts(SIZE, 100, SIX)
    held = Held(tables)
    filled = []
    for step in range(100):
        held.advance()
        if step == 40:
            held.begin([0, 1, 2])
        filled.append(filled_steps(tables))
    # One step ahead. Rows that restarted after step 41 must reach step 63 for the third block.
    assert filled == [32] * 30 + [64] * 70
    for _ in range(41):
        held.advance()
        filled.append(filled_steps(tables))
    assert filled[100:] == [64] * 3 + [96] * 32 + [101] * 6
    assert len(tables.matrices) == 3 * 101


def test_equal_forecasts_are_stored_once_even_with_signed_zeros() -> None:
    other = parameters_of([[(0, 0)]] * 3, [(0.0, 1.0), (-0.0, 1.0), (0.0, 2.0)], [0.0, -0.0, 0.0])
    assert len(TabulatedForecasts(SIZE, 5, other).matrices) == 2 * 6
    twice = TabulatedForecasts(SIZE, 5, SIX, SIX)
    assert twice.matrices.shape == (3 * 6, SIZE, SIZE)


def test_forecasts_are_tabulated_if_tables_are_small_or_requested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A step of a forecast takes its matrix in single precision, and of each axis the chances of
    # every cell, and of a move up and down, and what decides moves, 8 bytes each.
    step_bytes = 4 * SIZE**2 + 2 * 5 * 8 * SIZE
    monkeypatch.setattr(tabulated_forecasts, "TABLE_BYTES", 3 * 101 * step_bytes)
    assert isinstance(choose_forecasts(SIZE, 100, SIX), TabulatedForecasts)
    assert isinstance(choose_forecasts(SIZE, 101, SIX), OnTheFlyForecasts)
    assert isinstance(choose_forecasts(SIZE, 101, SIX, wants_table=True), TabulatedForecasts)
    fourth = parameters_of([[(4, 4), (5, 1)]] * 3, [(-0.5, 0.0)] * 3, [0.0] * 3)
    assert isinstance(choose_forecasts(SIZE, 100, SIX, fourth), OnTheFlyForecasts)
    assert isinstance(choose_forecasts(SIZE, 100, SIX, SIX), TabulatedForecasts)


# What a policy is made from.


def test_the_scenario_is_that_of_the_present_episodes() -> None:
    shared = {"grid_size": 6, "n_drones": 2, "bayesian_update": True, "timestep_limit": 9}
    batch, env = SearchBatch(3, **shared), DroneSwarmSearch(**shared)
    assert batch.scenario == env.scenario
    for changes in (
        {"vector": (0.4, -0.3)},
        {"person_initial_position": [(3, 2)]},
        {"vector": (0.1, 0.2), "person_initial_position": (5, 0)},
        {},
    ):
        batch.reset([1, 2, 3], given=changes)
        env.reset(seed=1, options=changes)
        assert batch.scenario == env.scenario == batch.scenario_of(2)
        idle = np.full((3, 2), Action.IDLE)
        batch.step(idle)
        env.step(dict.fromkeys(env.agents, 5))
        assert batch.scenario == env.scenario
    batch.reset(given={"disperse_constant": 2.5})
    assert batch.scenario.disperse_constant == 2.5


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("vector", np.array([(0.1, 0.2), (0.1, 0.2), (0.1, 0.3)])),
        ("person_initial_position", np.array([[(1, 1)], [(1, 1)], [(2, 1)]])),
        ("disperse_constant", np.array([1.0, 1.0, 2.0])),
    ],
)
def test_searches_that_differ_have_scenarios_of_their_own(name: str, values: Any) -> None:
    batch = SearchBatch(3, grid_size=6, **{name: values})
    later = SearchBatch(3, grid_size=6)
    later.reset([1, 2, 3], given={name: values})
    for each in (batch, later):
        with pytest.raises(ValueError, match=rf"differ in {name}; scenario_of\(row\)"):
            _ = each.scenario
        for row in range(3):
            env = DroneSwarmSearch(grid_size=6, **{name: values[row]})
            assert each.scenario_of(row) == env.scenario
            assert repr(each.scenario_of(np.int64(row))) == repr(env.scenario)
    for row in (-1, 3):
        with pytest.raises(ValueError, match=f"row must be .* got {row}"):
            batch.scenario_of(row)
    with pytest.raises(TypeError, match="row must be"):
        batch.scenario_of(1.0)  # type: ignore[arg-type]


def test_a_sampler_gives_every_search_its_own_scenario() -> None:
    batch = SearchBatch(4, sampler=lambda rng: {"vector": rng.uniform(-0.5, 0.5, 2)})
    batch.reset(range(4))
    vectors = batch.parameters["vector"].tolist()
    assert [list(batch.scenario_of(row).vector) for row in range(4)] == vectors
    with pytest.raises(ValueError, match="differ in vector"):
        _ = batch.scenario
