"""The probability of success that a plan forecasts is what searches reach."""

import numpy as np
import pytest
from small_searches import paths_of, search, success_of

from DroneSwarmSearch import Drift, DroneSwarmSearch, Person
from DroneSwarmSearch.policies import make

SIZE, STEPS = 11, 20

ACROSS_THE_WIND = Person(
    [
        Drift((4, 4), start_sd=0.8, vector=vector, vector_sd=(0.03, 0.05), diffusion=0.1, adrift=12)
        for vector in [(0.15, 0.02), (0.02, 0.15)]
    ],
    probability_of_detection=0.7,
)
TWO_LAST_POSITIONS = Person(
    [
        Drift((2, 3), start_sd=(1, 0.4), diffusion=0.1, weight=3),
        Drift((8, 6), vector=(-0.1, 0.1), vector_sd=0.04, diffusion=0.05),
    ]
)
PRIOR_MAP = Person(
    Drift(np.triu(np.ones((SIZE, SIZE)), 6), vector=(-0.2, 0.1), diffusion=0.3),
    probability_of_detection=0.9,
)


@pytest.mark.parametrize(
    ("name", "persons", "bayesian_update"),
    [
        ("planner", (ACROSS_THE_WIND,), True),
        ("imitation", (ACROSS_THE_WIND,), True),
        ("planner", (TWO_LAST_POSITIONS, TWO_LAST_POSITIONS), True),
        ("greedy-posterior", (PRIOR_MAP, TWO_LAST_POSITIONS, ACROSS_THE_WIND), False),
        ("parallel-sweep", (PRIOR_MAP, TWO_LAST_POSITIONS), False),
        ("imitation", (Person(Drift((5, 5), vector=(0.1, 0.1), diffusion=0.2), 0.5),), False),
    ],
)
def test_the_success_of_a_coverage_mission_is_that_of_its_paths(persons, name, bayesian_update):
    of = search(
        [(0, 0), (10, 0)],
        grid_size=SIZE,
        timestep_limit=STEPS,
        persons=persons,
        mission="coverage",
        bayesian_update=bayesian_update,
    )
    paths = paths_of(make(name, of.scenario), of)
    env = DroneSwarmSearch(scenario=of.scenario, render_mode=None)
    policy = make(name, env.scenario)
    observations, infos = env.reset(3, drones_positions=of.drones)
    flown, success = [], []
    while env.agents:
        flown.append([y * SIZE + x for x, y in env.frame().drones])
        observations, *_, infos = env.step(policy(observations))
        success.append(infos["probability_of_success"])
        assert not infos["Found"]
    assert flown == np.array([path.cells[:-1] for path in paths]).T.tolist()
    assert 0.03 < success[-1] == pytest.approx(np.mean(success_of(of, paths)), rel=1e-12)
    for step in (8, 16):
        earlier = [
            path._replace(searches=path.searches & (np.arange(STEPS) < step)) for path in paths
        ]
        assert success[step - 1] == pytest.approx(np.mean(success_of(of, earlier)), abs=1e-13)
    assert (np.diff([0.0, *success]) >= -1e-15).all()
