"""Samplers: searches drawn for the episodes of a batch."""

from typing import Any

import numpy as np
import pytest
from batches import CATALOGUE, DRONES, NAN, PERSON, SAMPLED, everything_sampled, seen
from helpers import plain, without_history

from DroneSwarmSearch import DroneSwarmSearch, Person
from DroneSwarmSearch.vector import SearchBatch


@pytest.mark.thorough
@pytest.mark.parametrize("bayesian", [False, True])
def test_sampled_searches_are_those_of_the_single_environment_across_catalogues(bayesian):
    """Enough episodes that the sampler draws anew while others are under way."""
    calls = [0]
    shared = {**SAMPLED, "bayesian_update": bayesian}

    def sampler(rng: np.random.Generator) -> dict[str, Any]:
        calls[0] += 1
        hypotheses = CATALOGUE[rng.integers(0, 3)]  # of one to two hypotheses
        if rng.random() < 0.5:
            return {"persons": hypotheses, DRONES: everything_sampled(rng)[DRONES]}
        return {**everything_sampled(rng), "probability_of_detection": 0.4}

    del shared["probability_of_detection"]
    rows = 20
    batch = SearchBatch(rows, sampler=sampler, **shared)
    batch.reset(range(rows))
    drawn = calls[0]
    different = set()
    envs = [None] * rows
    episodes = [0] * rows
    rng = np.random.default_rng(2)
    ended = np.ones(rows, bool)
    checked = range(0, rows, 10)
    for turn in range(500):
        for row in checked:
            if ended[row]:
                envs[row] = env = DroneSwarmSearch(scenario=batch.scenario_of(row))
                positions = {DRONES: batch.positions[row].tolist()}
                for episode in range(episodes[row] + 1):
                    env.reset(seed=None if episode else row, options=positions)
                episodes[row] += 1
                different.add(batch.scenario_of(row).persons_to_find)
            if turn % 5 == 0 or ended[row]:
                assert plain(vars(batch.frame(row))) == without_history(envs[row].frame())
        actions = rng.choice([0, 1, 2, 3, 4, 4, 4, 5, 5], (rows, 2))
        going = ~batch.ended
        batch.step(actions)
        ended = ~going
        for row in checked:
            if going[row]:
                drones = actions[row].tolist()
                rewards = envs[row].step(dict(zip(("drone0", "drone1"), drones, strict=True)))[1]
                assert list(rewards.values()) == batch.rewards[row].tolist()
    assert calls[0] >= 2 * drawn
    assert len(different) > 30


def test_a_new_catalogue_serves_episodes_under_way_before_their_next_step():
    batch = SearchBatch(2, sampler=everything_sampled, **{**SAMPLED, "timestep_limit": 400})
    batch.reset([1, 2])
    for _ in range(100):  # row 1 flies on, beyond the steps that a new table begins with
        batch.step([[5, 5]] * 2)
    before = batch.scenario_of(1).persons_to_find
    for _ in range(1100):  # more episodes than a catalogue lasts
        batch.reset(rows=np.array([0]))
        frame = batch.frame(1)
    assert batch.scenario_of(1).persons_to_find == before
    batch.step([[5, 5], [4, 4]])
    assert frame.step == 100 and frame.matrix.sum() > 0.1


BAD_SAMPLES: list[tuple[Any, type[Exception], str]] = [
    ({"timestep_limit": 5}, ValueError, "'timestep_limit'"),
    ({"vector": (0, NAN)}, ValueError, "vector"),
    (
        {PERSON: [(0, 0), (1, 1)]},
        ValueError,
        "sampler must return as many persons as the environment has, 1, got 2",
    ),
    ({DRONES: [(0, 0), (0, 0)]}, ValueError, f"{DRONES} must hold different cells"),
    (KeyError("broken"), KeyError, "broken"),
]


@pytest.mark.parametrize(("result", "error", "match"), BAD_SAMPLES)
def test_a_sampler_that_fails_leaves_the_batch_as_it_was(result, error, match):
    results: list[Any] = [{"vector": (0.5, 0.5)}]

    def sampler(rng: np.random.Generator) -> Any:
        if isinstance(results[-1], Exception):
            raise results[-1]
        return results[-1]

    batch = SearchBatch(64, n_drones=2, timestep_limit=1, sampler=sampler)
    idle = np.full((64, 2), 5)
    for _ in range(16):  # the episodes for which the sampler draws at a time
        batch.reset()
    batch.step(idle)
    results.append(result)
    before = seen(batch)
    for begin in (lambda: batch.reset(range(64)), lambda: batch.step(idle)):
        with pytest.raises(error, match=match):
            begin()
        assert seen(batch) == before
    results.append({"vector": (0.2, 0.5)})
    batch.step(idle)
    assert {batch.scenario_of(row).vector for row in range(64)} == {(0.2, 0.5)}


def test_samplers_are_refused_together_with_what_they_draw():
    def sampler(rng: np.random.Generator) -> dict[str, Any]:
        return {}

    with pytest.raises(ValueError, match="sampler cannot be given together with situations"):
        SearchBatch(3, situations=CATALOGUE, sampler=sampler)
    batch = SearchBatch(3, sampler=sampler)
    with pytest.raises(ValueError, match="situations cannot be given together with a sampler"):
        batch.reset(situations=[[Person(each.drift.drifts) for each in CATALOGUE[0]]])
