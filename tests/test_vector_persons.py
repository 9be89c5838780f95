"""Batches whose persons have hypotheses, catalogues of situations, and the coverage mission."""

import pickle
import random
from collections import Counter
from typing import Any

import numpy as np
import pytest
from batches import CATALOGUE, POD
from helpers import plain, without_history
from random_persons import check_search, random_search
from twins import Twins, play

from DroneSwarmSearch import DroneSwarmSearch, Ending
from DroneSwarmSearch._internal.streams import episode_keys, stream_keys, uniforms
from DroneSwarmSearch.vector import SearchBatch, SwarmVectorEnv

SIZES = {"grid_size": 6, "n_drones": 2, "timestep_limit": 15}


@pytest.mark.thorough
def test_every_row_is_the_single_environment():
    endings: Counter[Ending] = Counter()
    for number in range(60, 100):
        endings += check_search(random_search(random.Random(number)))
    assert {ending: endings[ending] for ending in Ending if not endings[ending]} == {}


@pytest.mark.slow
def test_every_row_is_the_single_environment_in_thousands_of_cases():
    for number in range(1000):
        check_search(random_search(random.Random(number)))


def test_episodes_draw_situations_with_equal_chances_from_their_sampling_streams():
    count = 3
    rows = 40
    batch = SearchBatch(rows, situations=CATALOGUE, **SIZES)
    for episode in range(3):
        batch.reset(range(rows) if episode == 0 else None)
        keys = np.array([stream_keys(row)[2] for row in range(rows)])
        of_episode = episode_keys(keys, np.array([episode], np.uint64))
        first = uniforms(of_episode, np.zeros(1, np.uint64))
        assert batch.situation.tolist() == (first * count).astype(int).tolist()


def test_scenarios_of_rows_reproduce_their_episodes():
    batch = SearchBatch(6, situations=CATALOGUE, bayesian_update=True, **SIZES)
    batch.reset(range(6))
    envs = [DroneSwarmSearch(scenario=batch.scenario_of(row)) for row in range(6)]
    for seed, (env, number) in enumerate(zip(envs, batch.situation.tolist(), strict=True)):
        env.reset(seed=seed)
        assert env.scenario.persons == tuple(CATALOGUE[number])
        assert plain(vars(batch.frame(seed))) == without_history(env.frame())
    batch.reset(situation=1)
    assert batch.scenario_of(3) == envs[0].scenario.replace(persons=CATALOGUE[1])


def test_a_given_situation_is_for_the_episode_alone():
    twins = Twins(5, {"situations": CATALOGUE, "bayesian_update": True, **SIZES})
    other = SearchBatch(5, situations=CATALOGUE, **SIZES)
    for given in ({"situation": 2}, {"situation": [0, 1, 2, 2, 1]}):
        twins.reset(list(range(5)), given=given)
        other.reset(range(5))
        assert twins.batch.situation.tolist() in ([2] * 5, given["situation"])
        play(twins, 1)
        twins.reset()
        other.reset()
        drawn = other.situation
        assert twins.batch.situation.tolist() == drawn.tolist()
        assert len(set(drawn.tolist())) > 1


BAD_ARGUMENTS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"situations": []}, ValueError, "situations must hold at least one situation"),
    ({"situations": CATALOGUE[0][0]}, TypeError, "situations must be a sequence of situations"),
    ({"situations": [CATALOGUE[0], [3]]}, TypeError, r"persons\[0\] must be a Person, got 3"),
    ({"situations": CATALOGUE, POD: 0.5}, ValueError, f"{POD} cannot be given together"),
    ({"situations": CATALOGUE, "situation": 1.0}, TypeError, "integer from 0 to 2, got 1.0"),
    ({"situations": CATALOGUE, "situation": [0, 1]}, ValueError, r"array of shape \(3,\)"),
    ({"situations": CATALOGUE, "situation": [0, 1, 3]}, ValueError, "situation must be .* got 3"),
]


@pytest.mark.parametrize(("arguments", "error", "match"), BAD_ARGUMENTS)
def test_bad_arguments_are_refused_by_name(arguments, error, match):
    for make in (SearchBatch, SwarmVectorEnv):
        with pytest.raises(error, match=match):
            make(3, **SIZES, **arguments)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"situation": 3}, "situation must be an integer from 0 to 2, got 3"),
        ({"situations": [CATALOGUE[0] * 2]}, "number of persons, 1, got 2"),
        ({"situations": CATALOGUE[:1], "situation": 1}, "from 0 to 0, got 1"),
    ],
)
def test_bad_values_in_resets_change_nothing(given, match):
    batch = SearchBatch(3, situations=CATALOGUE, **SIZES)
    batch.reset([1, 2, 3])
    before = pickle.dumps(batch)
    with pytest.raises(ValueError, match=match):
        batch.reset([1, 2, 3], **given)
    assert pickle.dumps(batch) == before


# The probability of success, and the coverage mission.
