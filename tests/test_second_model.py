"""Drift models of other kinds reach everything: environment, batch, policies and bound.

One is made here: a person follows one of a few tracks, some of whose steps are longer than a cell;
the transition matrices are dense. The other one is the chain of `Tracks`.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from helpers import wandering
from trainer_examples import module
from twins import Twins

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, RewardScheme, Scenario
from DroneSwarmSearch.drift import DriftModel, drift_model
from DroneSwarmSearch.persons import Hypotheses
from DroneSwarmSearch.planning import success_bound
from DroneSwarmSearch.policies import BeliefTracker, make

ExpectedSearches: Any = module("expected_searches").ExpectedSearches
SIZE = 5
LIMIT = 12
TRACKS = (
    ((0, 0), (1, 1), (3, 1), (3, 4), (4, 4)),
    ((0, 0), (0, 2), (1, 3), (1, 4)),
    ((4, 0), (2, 2), (0, 4)),
)


class Tracks(DriftModel):
    """In each step, the person goes on along the track, or stays with a chance of .4."""

    def __init__(self, tracks: Any, weights: tuple[float, ...]) -> None:
        self.grid_size = SIZE
        self.key = ("tracks", tracks, weights)
        self.weights = np.array(weights)
        cells = [[y * SIZE + x for x, y in track] for track in tracks]
        self._start = np.zeros((len(tracks), SIZE**2))
        self._chances = np.tile(np.eye(SIZE**2), (len(tracks), 1, 1))  # [track, from, to]
        for track, start, chances in zip(cells, self._start, self._chances, strict=True):
            start[track[0]] = weights[cells.index(track)]
            for here, there in pairwise(track):
                chances[here, [here, there]] = 0.4, 0.6

    def joint(self, step: int) -> np.ndarray:
        mass = self._start.reshape(self.state_shape).copy()
        for before in range(step):
            mass = self.forward(mass, before)
        return mass

    def forward(self, mass: np.ndarray, step: int) -> np.ndarray:
        by_cell = mass.reshape(*mass.shape[:-2], 1, -1)
        return (by_cell @ self._chances).reshape(mass.shape)

    def backward(self, value: np.ndarray, step: int) -> np.ndarray:
        by_cell = value.reshape(*value.shape[:-2], -1, 1)
        return (self._chances @ by_cell).reshape(value.shape)

    def moved(self, states: Any, step: int, draws_x: Any, draws_y: Any) -> np.ndarray:
        tracks, cells = np.divmod(states, SIZE**2)
        passed = self._chances[tracks, cells].cumsum(axis=1) <= draws_x[:, None]
        return tracks * SIZE**2 + passed.sum(axis=1)

    def branches(self, states: Any, probabilities: Any, step: int) -> Any:
        tracks, cells = np.divmod(states, SIZE**2)
        chances = probabilities[:, None] * self._chances[tracks, cells]
        place, to = chances.nonzero()
        return place, tracks[place] * SIZE**2 + to, chances[place, to]


class Ways(Hypotheses):
    """The person follows one of some tracks; one hypothesis stands for each."""

    def __init__(self, ways: Any) -> None:
        super().__init__([Drift(way[0]) for way in ways])
        self.ways = ways

    def __reduce__(self) -> tuple[object, ...]:
        return Ways, (self.ways,)


@drift_model.register
def _of_ways(known: Ways, grid_size: int) -> DriftModel:
    return Tracks(known.ways, known.weights)


def follower(detection: float, tracks: Any = TRACKS) -> Person:
    return Person(Ways(tracks), detection)


USUAL = Person([Drift((2, 2), vector=(0.2, 0.1), diffusion=0.2)], 0.7)
CHAIN = Person(wandering(2000, LIMIT, start=(1, 1), drift=(0.2, 0.1)), 0.8)
PERSONS = {
    "one": [follower(0.8)],
    "two": [follower(1.0), follower(0.6, TRACKS[1:])],
    "mixed": [follower(0.9), USUAL],
    "chain": [CHAIN],
    "chains": [CHAIN, Person(CHAIN.drift.tracks, 0.6, fine=1, classes=3)],
    "chain and usual": [CHAIN, USUAL],
}


def scenario_of(persons: str, **parameters: Any) -> Scenario:
    sizes = {"grid_size": SIZE, "n_drones": 2, "timestep_limit": LIMIT}
    return Scenario(**{**sizes, "persons": PERSONS[persons], **parameters})


@pytest.mark.thorough
@pytest.mark.parametrize("persons", PERSONS)
@pytest.mark.parametrize("updates", [False, True])
@pytest.mark.parametrize("scheme", [RewardScheme(), RewardScheme.expected()])
def test_batches_equal_single_environments(persons, updates, scheme):
    parameters = {
        name: getattr(scenario_of(persons), name)
        for name in ("grid_size", "n_drones", "timestep_limit", "persons")
    }
    twins = Twins(6, {**parameters, "bayesian_update": updates, "reward_scheme": scheme})
    twins.reset(list(range(6)))
    rng = np.random.default_rng(2)
    found = 0
    for _ in range(40):
        actions = rng.choice([Action.RIGHT, Action.DOWN, Action.SEARCH, Action.SEARCH], (6, 2))
        twins.step(actions.tolist())
        found += int(twins.batch.found.sum())
    assert found > 10


@pytest.mark.parametrize("persons", PERSONS)
def test_trackers_follow_the_posterior_of_the_environment(persons):
    scenario = scenario_of(persons, bayesian_update=True)
    env = DroneSwarmSearch(scenario=scenario)
    tracker = BeliefTracker(scenario)
    observations, _ = env.reset(seed=3)
    policy = make("greedy-posterior", scenario)
    while env.agents:
        matrix = observations["drone0"]["observation"][1]
        tracker.observe(matrix)
        assert tracker.matrix().tobytes() == matrix.tobytes()
        actions = policy(observations)
        tracker.update(env.frame().drones, actions.values())
        observations, *_ = env.step(actions)
    assert tracker.step == env.frame().step > 2


@pytest.mark.thorough
@pytest.mark.parametrize("persons", PERSONS)
def test_plans_bounds_and_searches_in_expectation(persons):
    """Exactly: what a plan promises is what its searches add, and the bound is above it."""
    scenario = scenario_of(persons, mission="coverage")
    starts = [(0, 0), (4, 4)]
    success = {}
    for name in ("creeping-line", "greedy-matrix", "greedy-posterior", "planner"):
        env = DroneSwarmSearch(scenario=scenario)
        policy = make(name, scenario)
        searches = (
            ExpectedSearches([scenario], [starts]) if len(scenario.persons_to_find) == 1 else None
        )
        observations, _ = env.reset(options={"drones_positions": starts})
        while env.agents:
            actions = policy(observations)
            observations, *_ = env.step(actions)
            if searches is not None:
                searches.advance(np.array([[*actions.values()]]))
        success[name] = env.frame().probability_of_success
        if searches is not None:
            assert searches.found[0] == pytest.approx(success[name], abs=1e-6)
    if persons in ("mixed", "chain and usual"):
        return
    bound = success_bound(scenario, starts, memory=1, horizons=1)
    assert success["greedy-matrix"] > 0.2
    assert max(success.values()) == pytest.approx(success["planner"], abs=0.02)
    assert success["planner"] <= bound.by_limit + 1e-9 <= 1.0
