"""Drones that search in flight: `search_in_flight`, in engines, policies, plans and bounds."""

from typing import Any

import numpy as np
import pytest
from twins import Twins, play

from DroneSwarmSearch import (
    Action,
    Drift,
    DroneSwarmSearch,
    MarkovDrift,
    Person,
    RewardScheme,
    Scenario,
)
from DroneSwarmSearch.bound import success_bound
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.planning import plan_paths
from DroneSwarmSearch.vector import SearchBatch

LEFT, RIGHT, UP, DOWN, SEARCH, IDLE = map(int, Action)


def search(**changes: Any) -> Scenario:
    person = Person(Drift((2, 2), vector=(0.2, 0.1), diffusion=0.2), 0.6)
    values = {"n_drones": 2, "timestep_limit": 20, "persons": [person], "bayesian_update": True}
    return Scenario(5, **{**values, "crash": "block", "search_in_flight": True, **changes})


@pytest.mark.parametrize(
    ("action", "where"), [(RIGHT, (2, 1)), (DOWN, (1, 2)), (SEARCH, (1, 1)), (IDLE, (1, 1))]
)
def test_a_drone_looks_where_it_arrives(action, where):
    still = Person(Drift(where, vector=(0, 0), diffusion=0))
    env = DroneSwarmSearch(scenario=search(n_drones=1, persons=[still]))
    env.reset(seed=0, drones_positions=[(1, 1)])
    _, rewards, _, _, infos = env.step({"drone0": action})
    assert infos["Found"] and rewards["drone0"] == 20_000
    assert env.frame().searching == (True,)
    elsewhere = DroneSwarmSearch(scenario=search(n_drones=1, persons=[still]))
    elsewhere.reset(seed=0, drones_positions=[(4, 4)])
    _, rewards, _, _, infos = elsewhere.step({"drone0": IDLE})
    assert not infos["Found"] and rewards["drone0"] == -100


@pytest.mark.thorough
@pytest.mark.parametrize("crash", ["end", "block", "pass"])
@pytest.mark.parametrize("radio_range", [None, 1.5])
@pytest.mark.parametrize("scheme", [RewardScheme(), RewardScheme.expected()], ids=["", "expected"])
def test_batches_are_the_same_bit_for_bit(crash, radio_range, scheme):
    scenario = search(crash=crash, radio_range=radio_range, reward_scheme=scheme)
    twins = Twins(5, {"scenario": scenario, "drones_positions": [(1, 1), (3, 1)]})
    twins.reset(range(5))
    play(twins, 50)
    assert max(twins.episodes) > 0


@pytest.mark.thorough
@pytest.mark.parametrize("crash", ["block", "pass"])
def test_plans_find_as_often_as_they_say(crash):
    """By their paths, step by step, and in episodes that are played."""
    scenario = search(crash=crash)
    starts = [(0, 0), (1, 0)]
    plan = plan_paths(scenario, starts, seconds=0.5)
    model = scenario.forecasts()[0]
    mass = model.joint(0)
    found = [0.0]
    for step in range(20):
        for path in plan.paths:
            assert path.searches[step]
            mass.reshape(-1)[path.cells[step + 1]] *= 0.4
        found.append(1 - mass.sum())
        mass = model.forward(mass, step)
    assert plan.by_time == pytest.approx(found)
    batch = SearchBatch(20_000, scenario, drones_positions=starts)
    batch.reset(seeds=range(20_000))
    moves = {1: RIGHT, -1: LEFT, 5: DOWN, -5: UP, 0: IDLE}
    has_found = np.zeros(20_000, np.bool_)
    for step in range(20):
        changes = [int(path.cells[step + 1] - path.cells[step]) for path in plan.paths]
        batch.step(np.tile([moves[change] for change in changes], (20_000, 1)))
        has_found |= batch.endings == 1
    assert has_found.mean() == pytest.approx(found[-1], abs=0.012)


POLICIES = ["greedy-matrix", "greedy-posterior", "greedy-forecast", "imitation", "parallel-sweep"]


@pytest.fixture(scope="module")
def upper_bound() -> float:
    quick = {"memory": 1, "sample": 2**12, "gap": 0.02, "horizons": 1}
    return success_bound(search(), [(0, 0), (1, 0)], **quick).by_limit


@pytest.mark.thorough
@pytest.mark.parametrize("policy", POLICIES)
def test_policies_find_more_by_looking_on_the_way(policy, upper_bound):
    in_flight = evaluate(policy, search(), episodes=300, progress=False)
    stopping = evaluate(policy, search(search_in_flight=False), episodes=300, progress=False)
    assert in_flight.success.value > stopping.success.value
    assert in_flight.success.value <= upper_bound


def side_neighbours(size: int, stay: float) -> np.ndarray:
    """A target that stays, or else moves to a side neighbour, each with equal chances."""
    chain = np.eye(size**2) * stay
    for cell in range(size**2):
        x, y = cell % size, cell // size
        near = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        inside = [(a, b) for a, b in near if 0 <= a < size and 0 <= b < size]
        for a, b in inside:
            chain[cell, b * size + a] = (1 - stay) / len(inside)
    return chain


# Optima of J. N. Eagle, Operations Research 32:1107, 1984, Table I, by start of the searcher.
EAGLE = {(0, 0): 0.7786, (1, 0): 0.8631, (1, 1): 0.8631, (2, 1): 1.0}


@pytest.mark.thorough
@pytest.mark.good_plans
@pytest.mark.parametrize(("start", "optimum"), EAGLE.items())
def test_plans_reach_published_optima_and_bounds_do_not_fall_below(start, optimum):
    person = Person(MarkovDrift((2, 2), side_neighbours(3, 0.4)))
    scenario = Scenario(3, persons=[person], timestep_limit=10, search_in_flight=True)
    plan = plan_paths(scenario, [start], seconds=0.3)
    assert plan.by_time[-1] == pytest.approx(optimum, abs=5e-5)
    bound = success_bound(scenario, [start], memory=1, sample=2**12, gap=0.02, horizons=1)
    assert bound.by_limit >= optimum - 5e-5


@pytest.mark.parametrize("memory", [0, 1, 2, 3])
def test_bounds_of_one_look_are_exact_whatever_drones_remember(memory):
    """One step: two drones look in two cells."""
    person = Person(Drift(np.arange(9.0).reshape(3, 3)), 0.5)
    scenario = Scenario(
        3, 2, timestep_limit=1, persons=[person], search_in_flight=True, crash="block"
    )
    bound = success_bound(scenario, [(2, 1), (1, 2)], memory=memory)
    assert bound.by_limit == pytest.approx(0.5 * (8 + 7) / 36, abs=0.01)


def test_several_searchers_may_share_cells():
    """The best plan without crashes lets all three look in the person's cell."""
    still = Person(Drift((1, 1), vector=(0, 0), diffusion=0), 0.5)
    scenario = Scenario(
        3, 3, timestep_limit=1, persons=[still], search_in_flight=True, crash="pass"
    )
    starts = [(1, 0), (1, 0), (1, 1)]
    plan = plan_paths(scenario, starts, seconds=0.2)
    assert plan.by_time[-1] == pytest.approx(1 - 0.5**3)
    assert success_bound(scenario, starts).by_limit >= 1 - 0.5**3 - 1e-9
    with pytest.raises(ValueError, match="drones_positions must hold different cells"):
        plan_paths(scenario.replace(crash="block"), starts)
