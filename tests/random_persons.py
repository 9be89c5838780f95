"""Random searches for uncertain persons: shared by tests."""

import random
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from batches import CONSTANT, PERSON, POD
from twins import Case, Twins, planned, random_case, use_tiles

from DroneSwarmSearch import Drift, Ending, Person, RewardScheme


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
