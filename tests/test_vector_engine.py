"""Every row of a batch is the single environment with the same seed, to the last bit."""

from __future__ import annotations

import copy
import gc
import pickle
import random
import tracemalloc
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from batches import (
    AXES,
    CATALOGUE,
    CONSTANT,
    DRONES,
    NAN,
    PERSON,
    POD,
    everything_sampled,
    moved,
    seen,
)
from helpers import EVENTS, INTENTS, SCHEMES, inside, planned_actions, target_of
from hypothesis import given, settings
from hypothesis import strategies as st

from DroneSwarmSearch import Action, DroneSwarmSearch, ResetNeeded
from DroneSwarmSearch._internal.streams import (
    episode_keys,
    numbers,
    stream_keys,
)
from DroneSwarmSearch.drift import ProbabilityMatrix
from DroneSwarmSearch.drift.persons import Drift, Person
from DroneSwarmSearch.drift.tables import dispersion_rate
from DroneSwarmSearch.frame import Frame
from DroneSwarmSearch.layouts.masks import action_masks
from DroneSwarmSearch.vector import SearchBatch, beliefs

# A batch, and a single environment for each of its rows.


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
        self.situations = parameters.get("situations")
        for parameters_of in self.parameters:
            parameters_of.pop("situation", None)
            if parameters_of.pop("situations", None) is not None:
                parameters_of["persons"] = self.situations[0]
        self.envs = [DroneSwarmSearch(**parameters_of) for parameters_of in self.parameters]
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
        self.batch.reset(seeds, None if rows is None else np.array(rows), **(given or {}))
        self.situations = (given or {}).get("situations", self.situations)
        for k, row in enumerate(which):
            self._begin(row, None if seeds is None else seeds[k], of_row(given or {}, row))
            self.rewards[row] = 0.0
        self.received = None
        self.compare()

    def _begin(self, row: int, seed: int | None, given: Mapping[str, Any]) -> None:
        self.seeds[row] = self.seeds[row] if seed is None else seed
        self.episodes[row] = 0 if seed is not None else self.episodes[row] + 1
        options = {DRONES: self.drones[row], **given}
        options.pop("situations", None)
        if self.situations is not None:
            number = self.batch.situation[row]
            assert number == options.pop("situation", number)
            options["persons"] = self.situations[number]
        self.envs[row].reset(seed=seed, options=options)

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
        if self.envs[0].scenario.mission == "rescue":
            assert missing.tolist() == [[not f for f in frame.found] for frame in frames]
        else:
            assert missing.all()
        if self.envs[0].scenario.mission == "rescue":
            persons = [[y * size + x for x, y in frame.persons] for frame in frames]
            assert (batch.person_cells == persons)[missing].all()
        success = [frame.probability_of_success for frame in frames]
        shown = batch.probability_of_success
        assert success == ([None] * len(frames) if shown is None else shown.tolist())
        assert batch.found.tolist() == [any(frame.found) for frame in frames]
        assert batch.searching.tolist() == [list(frame.searching) for frame in frames]
        assert batch.steps.tolist() == [frame.step for frame in frames]
        row = self.compared % len(frames)
        assert fields_of(batch.frame(row)) == fields_of(frames[row])
        self.compared += 1


def fields_of(frame: Frame) -> dict[str, Any]:
    """What batches know of a frame, as data that `==` compares."""
    prior = None if frame.prior is None else frame.prior.tobytes()
    known = {**vars(frame), "matrix": frame.matrix.tobytes(), "prior": prior}
    return {**known, "trails": (), "searched": ()}


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
        "a drone left in the step of a find": any(left) and bool(found),
        "exchange of cells": any(
            targets[i] == drones[j] and targets[j] == drones[i] for i in range(n) for j in range(i)
        ),
        "time limit": last and not crashed and not finders,
        "time limit after a find": last and not crashed and bool(successful),
        "find in the last step": last and bool(finders),
        "find": bool(finders),
        "two persons found by one search": len(found) > len({before.persons[k] for k in found}),
        "two drones found in one step": len(finders) > 1,
        "one of several found": several and bool(found) and found < missing,
        "all of several found": several and bool(found) and found == missing,
        "find in the step of a collision": bool(found) and collided,
        "missed in the right cell": bool(in_reach - found),
        "search of a likely cell": any(chance > 0.01 for chance in unsuccessful),
        "search of an unlikely cell": any(chance <= 0.01 for chance in unsuccessful),
        "search of a found person's cell": any(
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
    tile_rows: int
    plans: list[list[int]]
    seed: int
    steps: int
    resets: float  # the probability of a reset after a step


def random_drones(rng: random.Random, rows: int, size: int, n: int) -> Any:
    """Start cells for all rows, or an array with those of each."""
    cells = [(x, y) for x in range(size) for y in range(size)]
    if rng.random() < 0.7:
        return rng.sample(cells, n)
    return np.array([rng.sample(cells, n) for _ in range(rows)])


def random_case(rng: random.Random) -> Case:
    size, rows = rng.randint(2, 7), rng.randint(1, 6)
    n, persons = rng.randint(1, min(5, size**2)), rng.randint(1, 3)
    detections = [1.0, 1.0, 0.6, 0.2, 0.0]
    each = tuple(rng.choice(detections) for _ in range(persons))
    drifts = [0.0, -0.0, 0.3, -0.5, 1.0, -2.5]
    pool = [(rng.randrange(size), rng.randrange(size)) for _ in range(2)]  # some start together
    parameters = {
        "grid_size": size,
        "n_drones": n,
        "vector": [rng.choice(drifts), rng.choice(drifts)],
        PERSON: [rng.choice(pool) for _ in range(persons)],
        CONSTANT: rng.choice([0, 1.0, 10, 1000.0]),
        "timestep_limit": rng.randint(1, 25),
        POD: rng.choice([each[0], each]),
        "bayesian_update": rng.random() < 0.5,
        "reward_scheme": rng.choice(SCHEMES),
        DRONES: random_drones(rng, rows, size, n) if rng.random() < 0.6 else None,
    }
    return Case(
        rows,
        parameters,
        tile_rows=rng.choice([1, 2, 3, 256]),
        plans=[[rng.choice(INTENTS) for _ in range(rng.randint(1, 6))] for _ in range(n)],
        seed=rng.randrange(2**32),
        steps=rng.randint(4, 28),
        resets=rng.choice([0.0, 0.0, 0.15]),
    )


def planned(plans: list[list[int]], frame: Frame, turn: int, rng: random.Random) -> list[int]:
    """What the drones' plans come to in a step."""
    missing = [cell for cell, f in zip(frame.persons, frame.found, strict=True) if not f]
    actions = planned_actions(plans, turn, frame.drones, missing, frame.grid_size, rng)
    return list(map(int, actions))


def use_tiles(patch: pytest.MonkeyPatch, case: Case) -> None:
    """Divide the beliefs into the tiles of a case, however small."""
    patch.setattr(beliefs, "_LEAST_ROWS", 1)
    patch.setattr(beliefs, "_MOST_ROWS", case.tile_rows)
    patch.setattr(beliefs, "_BEGIN_ROWS", 2)


def check_case(case: Case) -> Counter[str]:
    """Compare a batch with its environments; returns how often each event happened."""
    rng, events = random.Random(case.seed), Counter[str]()
    with pytest.MonkeyPatch.context() as patch:
        use_tiles(patch, case)
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
                sizes = case.parameters["grid_size"], case.parameters["n_drones"]
                given = (
                    {DRONES: random_drones(rng, case.rows, *sizes)} if rng.random() < 0.4 else {}
                )
                twins.reset([rng.choice([None, rng.randrange(99)]) for _ in rows], rows, given)
                for row in rows:
                    successful[row] = set()
    return events


@pytest.mark.slow
@settings(deadline=None, max_examples=4000, derandomize=True)
@given(st.integers(0, 2**64))
def test_every_row_is_the_single_environment_in_thousands_of_cases(seed):
    check_case(random_case(random.Random(seed)))


def test_every_row_is_the_single_environment() -> None:
    """In random cases, in which every event occurs."""
    events: Counter[str] = Counter()
    for number in range(50):
        events += check_case(random_case(random.Random(number)))
    assert [event for event in EVENTS if not events[event]] == []


# Tiles of beliefs, long episodes.


def play(twins: Twins, steps: int, seed: int = 0) -> None:
    rng = random.Random(seed)
    for _ in range(steps):
        twins.step(np.array(random_actions(rng, twins)))


@pytest.mark.parametrize("bayesian", [False, True])
def test_episodes_of_many_blocks_are_those_of_the_single_environment(bayesian: bool) -> None:
    """Tables come in blocks of 32 steps; rows cross their edges at different times."""
    twins = Twins(
        3,
        {
            "grid_size": 6,
            "vector": (0.03, -0.02),
            PERSON: [(1, 4), (3, 3)],
            CONSTANT: 0.3,
            "timestep_limit": 75,
            POD: 0.2,
            "bayesian_update": bayesian,
        },
    )
    twins.reset([1, 2, 3])
    longest = 0
    rng = random.Random(1)
    for step in range(160):
        twins.step([[rng.choice([4, 5])] for _ in range(3)])
        longest = max(longest, int(twins.batch.steps.max()))
        if step == 40:
            twins.reset(rows=[1])
    assert longest == 75
    assert len(set(twins.batch.steps.tolist())) > 1


@pytest.mark.parametrize("tile_rows", [2, 3])
def test_beliefs_may_lie_in_several_tiles(tile_rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(beliefs, "_LEAST_ROWS", 1)
    monkeypatch.setattr(beliefs, "_MOST_ROWS", tile_rows)
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
    play(twins, 36)


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


def test_persons_walk_by_the_draws_of_their_seed_and_episode() -> None:
    size, steps, starts, seeds = 9, 40, [(4, 4), (0, 8)], [3, 3, 12345]
    parameters: dict[str, Any] = {"vector": (0.3, -0.2), CONSTANT: 7.0}
    batch = SearchBatch(
        len(seeds), grid_size=size, timestep_limit=steps, person_initial_position=starts,
        **parameters,
    )  # fmt: skip
    batch.reset(seeds)
    diffusion = dispersion_rate(parameters[CONSTANT])
    matrices = [
        ProbabilityMatrix(size, Drift(start, vector=parameters["vector"], diffusion=diffusion))
        for start in starts
    ]
    for episode in range(2):
        drift = [episode_numbers(seed, episode, steps, len(starts))[0] for seed in seeds]
        at = [list(starts) for _ in seeds]
        for step in range(steps):
            expected = [[y * size + x for x, y in persons] for persons in at]
            assert batch.person_cells.tolist() == expected
            batch.step(np.full((len(seeds), 1), Action.IDLE))
            for row, persons in enumerate(at):
                for k, (x, y) in enumerate(persons):
                    right, left, down, up = (moves[0] for moves in matrices[k].moves(step))
                    u, v = drift[row][step, k]
                    persons[k] = moved(x, u, right, left), moved(y, v, down, up)
        assert batch.ended.all()
        batch.step(np.zeros((len(seeds), 1), int))


def test_searches_succeed_by_the_draws_of_their_seed_and_episode() -> None:
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


def test_a_reset_replaces_the_catalogue_and_leaves_episodes_under_way_alone() -> None:
    sizes = {"grid_size": 6, "n_drones": 2, "timestep_limit": 40}
    for bayesian in (False, True):
        twins = Twins(6, {"situations": CATALOGUE[1:2], "bayesian_update": bayesian, **sizes})
        twins.reset(list(range(6)))
        play(twins, 5)
        others = seen(twins.batch)
        twins.batch.reset([3, 4], np.array([3, 4]), situations=CATALOGUE[::-1])
        twins.situations = [*CATALOGUE[::-1], CATALOGUE[1]]
        assert twins.batch.situation.tolist()[:3] == [3, 3, 3]
        after = seen(twins.batch)
        for row in (0, 1, 2, 5):
            assert after[row][:-1] == others[row][:-1]
        for row in (3, 4):
            twins._begin(row, row, {})
            twins.rewards[row] = 0.0
        play(twins, 100)
        assert twins.batch.situation.max() < 3


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


# Copies.


COPIED: dict[str, dict[str, Any]] = {
    "plain": {},
    "bayesian": {"bayesian_update": True},
    "sampler": {"sampler": everything_sampled},
    "several persons": {PERSON: [(1, 1), (4, 4), (1, 1)], POD: (0.5, 1.0, 0.2)},
    "several persons, bayesian": {PERSON: [(1, 1), (4, 4)], "bayesian_update": True},
    "persons": {"persons": CATALOGUE[0]},
    "situations": {"situations": CATALOGUE},
    "situations, bayesian": {"situations": CATALOGUE[:2], "bayesian_update": True},
    "coverage": {"situations": CATALOGUE[:2], "mission": "coverage"},
}


@pytest.mark.parametrize(
    "through", [copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))]
)
@pytest.mark.parametrize("name", COPIED)
def test_copies_are_equal_and_independent(
    name: str, through: Callable[[SearchBatch], SearchBatch]
) -> None:
    batch = SearchBatch(
        5,
        **{"grid_size": 6, "n_drones": 2, "timestep_limit": 16, **COPIED[name]},
    )
    batch.reset(range(5))
    rng = np.random.default_rng(1)
    actions = rng.choice([0, 1, 2, 3, 4, 4, 4, 5, 5, 5], (24, 5, 2))

    def play_on(batch: SearchBatch) -> list[Any]:
        log = []
        for chosen in actions[10:]:
            batch.step(chosen)
            log.append(seen(batch))
        batch.reset(drones_positions=[(2, 2), (4, 1)])
        return [*log, seen(batch)]

    for chosen in actions[:10]:
        batch.step(chosen)
    assert batch.steps.any()
    state = pickle.dumps(batch)
    log = play_on(through(batch))
    assert pickle.dumps(batch) == state
    assert play_on(batch) == log


# Memory and time.


@pytest.mark.parametrize("bayesian", [False, True])
def test_nothing_grows_with_the_steps(bayesian: bool) -> None:
    batch = SearchBatch(
        4, grid_size=5, n_drones=2, timestep_limit=20, bayesian_update=bayesian,
        probability_of_detection=0.3, person_initial_position=[(2, 2), (1, 3)],
    )  # fmt: skip
    batch.reset(range(4))
    actions = np.random.default_rng(1).choice([1, 0, 2, 3, 4, 4, 4, 4, 5, 5], (70, 4, 2))
    tracemalloc.start()
    try:
        for step, chosen in enumerate(actions):
            batch.step(chosen)
            if step == 29:
                gc.collect()
                before = tracemalloc.get_traced_memory()[0]
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 1200


def test_episodes_of_a_million_steps_need_no_more_memory_than_short_ones() -> None:
    tracemalloc.start()
    try:
        batch = SearchBatch(3, timestep_limit=10**6)
        batch.reset(range(3))
        batch.step(np.full((3, 1), Action.IDLE))
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 2**20


def test_searches_that_contradict_a_belief_leave_it_as_it_was() -> None:
    """The person is certainly in the searched cell, and may not be found."""
    drones = [(0, 0), (2, 3)]
    batch = SearchBatch(
        3, situations=[[Person(Drift((2, 3)))], [Person([Drift((2, 3)), Drift((5, 5))])]],
        situation=[0, 1, 0], n_drones=2, bayesian_update=True, finds_last=False,
        drones_positions=drones,
    )  # fmt: skip
    batch.reset([1, 2, 3])
    before = batch.matrices_of([0, 1, 2])
    batch.step([[Action.IDLE, Action.SEARCH], [Action.IDLE, Action.SEARCH], [Action.IDLE] * 2])
    after = batch.matrices_of([0, 1, 2])
    assert after[0].tobytes() == before[0].tobytes() == after[2].tobytes()
    assert after[1][5, 5] == 1.0 == before[1].sum() > before[1][5, 5]
    assert batch.probability_of_success.tolist() == [1.0, 0.5, 0.0]
    batch.step([[Action.IDLE, Action.SEARCH]] * 3)
    assert batch.matrices_of([0])[0].tobytes() == before[0].tobytes()
    assert batch.probability_of_success.tolist() == [1.0, 0.5, 1.0]


# What a policy is made from.


def test_the_scenario_is_that_of_the_present_episodes() -> None:
    shared = {"grid_size": 6, "n_drones": 2, "bayesian_update": True, "timestep_limit": 9}
    batch, env = SearchBatch(3, **shared), DroneSwarmSearch(**shared)
    assert batch.scenario == env.scenario
    batch.reset([1, 2, 3])
    env.reset(seed=1)
    assert batch.scenario == env.scenario == batch.scenario_of(2)


def test_searches_that_differ_have_scenarios_of_their_own() -> None:
    batch = SearchBatch(3, grid_size=6, situations=CATALOGUE, situation=[0, 0, 1])
    batch.reset([1, 2, 3])
    with pytest.raises(ValueError, match=r"different persons; scenario_of\(row\)"):
        _ = batch.scenario
    for row in range(3):
        env = DroneSwarmSearch(grid_size=6, persons=CATALOGUE[row // 2])
        assert batch.scenario_of(row) == batch.scenario_of(np.int64(row)) == env.scenario
    for row in (-1, 3):
        with pytest.raises(ValueError, match=f"row must be .* got {row}"):
            batch.scenario_of(row)
    with pytest.raises(TypeError, match="row must be"):
        batch.scenario_of(1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "parameters",
    [
        {"person_initial_position": [(2, 2), (3, 2), (2, 2)]},
        {"bayesian_update": True, "probability_of_detection": 0.5},
        {"mission": "coverage"},
    ],
)
def test_states_are_those_of_the_single_environment(parameters: dict[str, Any]) -> None:
    shared = {"grid_size": 6, "n_drones": 2, "timestep_limit": 12, **parameters}
    batch = SearchBatch(4, **shared)
    singles = [DroneSwarmSearch(**shared) for _ in range(4)]
    batch.reset([5, 6, 7, 8])
    for seed, single in enumerate(singles, 5):
        single.reset(seed=seed)
    rng = np.random.default_rng(0)
    finds = 0
    while not batch.ended.any():
        expected = np.stack([single.state() for single in singles])
        assert batch.state_planes().dtype == np.float32
        assert np.array_equal(batch.state_planes(), expected)
        masks = [action_masks(cells, 6, right_of_way=True) for cells in batch.cells]
        actions = np.array([[rng.choice(each.nonzero()[0]) for each in mask] for mask in masks])
        batch.step(actions)
        for single, chosen in zip(singles, actions.tolist(), strict=True):
            single.step(dict(zip(single.possible_agents, chosen, strict=True)))
        finds += int((~batch.missing).sum())
    assert np.array_equal(batch.state_planes(), [single.state() for single in singles])
    assert finds or parameters.get("mission") == "coverage"
