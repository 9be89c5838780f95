"""Batches whose persons have hypotheses, catalogues of situations, and the coverage mission."""

import pickle
import random
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from batches import CATALOGUE, CONSTANT, PERSON, POD
from helpers import plain, without_history
from test_vector_engine import Case, Twins, planned, play, random_case, use_tiles

from DroneSwarmSearch import Drift, DroneSwarmSearch, Ending, Person, RewardScheme
from DroneSwarmSearch._internal.streams import episode_keys, stream_keys, uniforms
from DroneSwarmSearch.vector import SearchBatch, SwarmVectorEnv

SIZES = {"grid_size": 6, "n_drones": 2, "timestep_limit": 15}


def random_drift(rng: random.Random, size: int) -> Drift:
    known: dict[str, Any] = {
        "vector": (rng.choice([0, 0.3, -0.5, 1.0, -2.5, 1e6]), rng.choice([0, 0.2, -0.0])),
        "vector_sd": rng.choice([0.0, 0.05, (0.1, 0.0), (0.2, 0.3), [(0.2, 0.1), (-0.1, 0)]]),
        "diffusion": rng.choice([0.0, 0.1, 0.3, 2 / 3]),
        "weight": rng.choice([1, 2, 0.3, 1e-3]),
    }
    if rng.random() < 0.3:
        turns = rng.randint(1, 12), rng.randint(13, 30)
        known["vector"] = {0: (0.4, 0), **{step: (rng.uniform(-1, 1), 0.1) for step in turns}}
    kind = rng.choice(["prior", "cell", "uncertain", "adrift"])
    if kind == "prior":
        prior = np.array([[rng.choice([0, 0, 0, 1, 2.5]) for _ in range(size)] for _ in "x" * size])
        prior[rng.randrange(size), rng.randrange(size)] += 1
        return Drift(prior, **known)
    if kind == "cell":
        return Drift((rng.randrange(size), rng.randrange(size)), **known)
    start = rng.uniform(-1, size), rng.uniform(-1, size)
    if kind == "adrift":
        return Drift(start, adrift=rng.randint(1, 9), **known)
    return Drift(start, start_sd=rng.choice([0.5, 2.0, (0.3, 1.0)]), **known)


def random_situations(rng: random.Random, size: int) -> list[list[Person]]:
    """Situations with equal and different persons, some without arrays as starts."""
    drifts = [random_drift(rng, size) for _ in range(6)]
    if rng.random() < 0.5:
        drifts = [drift for drift in drifts if drift.prior is None] or [Drift((0, 0))]
    pool = [rng.choices(drifts, k=rng.randint(1, 3)) for _ in range(rng.randint(1, 4))]
    persons = rng.randint(1, 3)
    return [
        [Person(rng.choice(pool), rng.choice([1.0, 0.6, 0.2, 0.0])) for _ in range(persons)]
        for _ in range(rng.randint(1, 4))
    ]


def random_search(rng: random.Random) -> Case:
    case = random_case(rng)
    parameters = dict(case.parameters)
    if rng.random() < 0.7:
        for name in ("vector", PERSON, CONSTANT, POD):
            del parameters[name]
        situations = random_situations(rng, parameters["grid_size"])
        if rng.random() < 0.3:
            parameters["persons"] = situations[0]
        else:
            parameters["situations"] = situations
            if rng.random() < 0.3:
                parameters["situation"] = random_situation(rng, len(situations), case.rows)
    if rng.random() < 0.4:
        parameters["mission"] = "coverage"
        schemes = RewardScheme(), RewardScheme.sparse(), RewardScheme(step=-1.0, timeout=-5.0)
        parameters["reward_scheme"] = rng.choice(schemes)
    elif rng.random() < 0.4:
        parameters["reward_scheme"] = RewardScheme.expected(rng.choice([1.0, 7.5]))
    return replace(case, parameters=parameters)


def random_situation(rng: random.Random, count: int, rows: int) -> Any:
    """One for all rows, or one for each."""
    if rng.random() < 0.5:
        return rng.randrange(count)
    return np.array([rng.randrange(count) for _ in range(rows)])


def check_search(case: Case) -> Counter[Ending]:
    """Compare a batch with its environments; returns how often each ending occurred."""
    rng = random.Random(case.seed)
    endings = Counter[Ending]()
    with pytest.MonkeyPatch.context() as patch:
        use_tiles(patch, case)
        twins = Twins(case.rows, case.parameters)
        twins.reset([rng.randrange(2**20) for _ in range(case.rows)])
        for turn in range(case.steps):
            actions = []
            for row, frame in enumerate(twins.frames):
                if not frame.persons:  # the coverage mission: hunt the likeliest cell
                    y, x = divmod(int(frame.matrix.argmax()), frame.grid_size)
                    frame = replace(frame, persons=((x, y),), found_by=(None,))
                actions.append(planned(case.plans, frame, turn + row, rng))
            twins.step(np.array(actions))
            endings.update(frame.ending for frame in twins.frames if frame.ending is not None)
            if rng.random() < case.resets:
                rows = sorted(rng.sample(range(case.rows), rng.randint(1, case.rows)))
                given = {}
                if twins.situations is not None and rng.random() < 0.4:
                    count = len(twins.situations)
                    given = {"situation": random_situation(rng, count, case.rows)}
                twins.reset([rng.choice([None, rng.randrange(99)]) for _ in rows], rows, given)
    return endings


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
