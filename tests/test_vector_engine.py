"""Every row of a batch is the single environment with the same seed, to the last bit."""

import copy
import pickle
import tracemalloc
from typing import Any

import numpy as np
import pytest
from batches import CATALOGUE, PERSON, everything_sampled, seen
from helpers import (
    wandering,
)
from twins import Twins, play

from DroneSwarmSearch import Action, Drift, Person
from DroneSwarmSearch.vector import SearchBatch


def test_arrays_have_the_documented_types():
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


def test_a_reset_replaces_the_catalogue_and_leaves_episodes_under_way_alone():
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


def test_a_catalogue_of_drifts_replaces_one_with_tracks():
    """Tracks in every cell need more places than the grid has, and more layers than drifts."""
    tracks = wandering(900, 12, start=(1, 1), sd=0.6, size=3)
    prior = np.eye(3)
    drift = [Person(Drift((1, 1), diffusion=0.3), 0.5)]
    sizes = {"grid_size": 3, "timestep_limit": 12, "bayesian_update": True}
    for other in (Drift((0, 2), diffusion=0.2), Drift(prior, diffusion=0.2)):
        twins = Twins(4, {"situations": [[Person(tracks, 0.5)], drift], **sizes})
        twins.reset([1, 2, 3, 4], given={"situation": [0, 1, 0, 1]})
        twins.step([[Action.SEARCH]] * 4)
        twins.reset(rows=[0, 2], given={"situations": [[Person(other, 0.5)]]})
        play(twins, 30)


COPIED: dict[str, dict[str, Any]] = {
    "sampler": {"sampler": everything_sampled},
    "several persons, bayesian": {PERSON: [(1, 1), (4, 4)], "bayesian_update": True},
    "situations": {"situations": CATALOGUE},
}


@pytest.mark.parametrize("name", COPIED)
def test_copies_are_equal_and_independent(name):
    batch = SearchBatch(5, **{"grid_size": 6, "n_drones": 2, "timestep_limit": 16, **COPIED[name]})
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
    log = play_on(copy.deepcopy(batch))
    assert pickle.dumps(batch) == state
    assert play_on(pickle.loads(state)) == log == play_on(batch)


def test_episodes_of_a_million_steps_need_no_more_memory_than_short_ones():
    tracemalloc.start()
    try:
        batch = SearchBatch(3, timestep_limit=10**6)
        batch.reset(range(3))
        batch.step(np.full((3, 1), Action.IDLE))
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 2**20


def test_searches_that_contradict_a_belief_leave_it_as_it_was():
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
