"""Persons who drift by any Markov chain: `MarkovDrift`."""

import json
import pickle
from typing import Any

import numpy as np
import pytest
from twins import Twins, play

from DroneSwarmSearch import (
    Drift,
    DroneSwarmSearch,
    MarkovDrift,
    Person,
    RewardScheme,
    Scenario,
)
from DroneSwarmSearch.drift import drift_model
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.planning import plan_paths
from DroneSwarmSearch.vector import SearchBatch


def random_chain(size: int, seed: int = 0) -> np.ndarray:
    """Moves to any cell, most of which have no probability."""
    rng = np.random.default_rng(seed)
    chain = rng.random((size**2, size**2)) * (rng.random((size**2, size**2)) < 0.2)
    chain += 0.1 * np.eye(size**2)
    return chain / chain.sum(axis=1, keepdims=True)


def by_step(step: int) -> np.ndarray:
    return random_chain(4, step % 3)


class Sparse:
    """What is needed of a SciPy sparse matrix; entries repeat, as they may there."""

    def __init__(self, dense: np.ndarray) -> None:
        self.row, self.col = (np.tile(index, 2) for index in dense.nonzero())
        self.data = np.tile(dense[dense.nonzero()] / 2, 2)
        self.shape = dense.shape

    def tocoo(self) -> "Sparse":
        return self


STARTS = {"a cell": (1, 2), "a map": np.arange(16).reshape(4, 4)}
CHAINS: dict[str, Any] = {
    "an array": random_chain(4),
    "sparse": Sparse(random_chain(4)),
    "by step": by_step,
    "single precision": random_chain(4).astype(np.float32),
}


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_forecasts_are_products_of_the_transitions(start, chain):
    model = drift_model(MarkovDrift(start, chain), 4)
    mass = np.zeros(16)
    if np.shape(start) == (2,):
        mass[2 * 4 + 1] = 1.0
    else:
        mass = np.arange(16) / 120
    for step in range(7):
        assert model.exact(step).reshape(-1) == pytest.approx(mass, abs=1e-6)
        assert model.matrix(step).sum() == pytest.approx(1, abs=1e-6)
        dense = by_step(step) if chain is by_step else random_chain(4)
        value = np.random.default_rng(step).random((1, 4, 4))
        expected = dense @ value.reshape(-1)
        assert model.backward(value, step).reshape(-1) == pytest.approx(expected, abs=1e-6)
        mass = mass @ dense


def test_persons_are_where_the_forecast_says():
    """Also after moves to cells far away."""
    scenario = search(MarkovDrift((1, 2), random_chain(4)))
    batch = SearchBatch(20_000, scenario)
    batch.reset(seeds=range(20_000))
    for step in range(1, 4):
        batch.step(np.full((20_000, 2), 5))
        counts = np.bincount(batch.person_cells[:, 0], minlength=16) / 20_000
        expected = scenario.forecasts()[0].exact(step).reshape(-1)
        assert counts == pytest.approx(expected, abs=0.015)


def search(drift: MarkovDrift, **changes: Any) -> Scenario:
    values = {"n_drones": 2, "timestep_limit": 15, "bayesian_update": True, **changes}
    return Scenario(4, persons=[Person(drift, 0.6)], **values)


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("scheme", [RewardScheme(), RewardScheme.expected()], ids=["", "expected"])
def test_batches_are_the_same_bit_for_bit(chain, scheme):
    scenario = search(MarkovDrift((1, 2), chain), reward_scheme=scheme, crash="block")
    twins = Twins(5, {"scenario": scenario})
    twins.reset(range(5))
    play(twins, 40)
    assert max(twins.episodes) > 0


def test_several_chains_and_persons_fit_one_search():
    persons = [
        Person(MarkovDrift((0, 0), random_chain(4)), 0.5),
        Person(MarkovDrift(np.ones((4, 4)), by_step), 0.9),
        Person(Drift((2, 2), diffusion=0.2), 0.5),
    ]
    scenario = Scenario(4, n_drones=2, persons=persons, timestep_limit=12, bayesian_update=True)
    twins = Twins(4, {"scenario": scenario})
    twins.reset(range(4))
    play(twins, 30)


@pytest.mark.parametrize("policy", ["greedy-posterior", "greedy-forecast", "imitation"])
def test_policies_search_for_them(policy):
    result = evaluate(policy, search(MarkovDrift((1, 2), random_chain(4))), episodes=200)
    least = evaluate("random", search(MarkovDrift((1, 2), random_chain(4))), episodes=200)
    assert result.success.value > least.success.value + 0.1


def test_plans_find_as_often_as_they_say():
    scenario = search(MarkovDrift((1, 2), random_chain(4)))
    plan = plan_paths(scenario, [(0, 0), (1, 0)], seconds=0.5)
    model = scenario.forecasts()[0]
    mass = model.joint(0)
    for step in range(15):
        for path in plan.paths:
            if path.searches[step]:
                mass.reshape(-1)[path.cells[step]] *= 0.4
        mass = model.forward(mass, step)
    assert plan.by_time[-1] == pytest.approx(1 - mass.sum())


def test_they_can_be_saved():
    for start in STARTS.values():
        scenario = search(MarkovDrift(start, random_chain(4)))
        text = json.dumps(scenario.to_dict(), allow_nan=False)
        again = Scenario.from_dict(json.loads(text))
        assert again.forecasts()[0].exact(3) == pytest.approx(scenario.forecasts()[0].exact(3))
        assert pickle.loads(pickle.dumps(scenario)) == scenario
    assert MarkovDrift((1, 1), random_chain(4)) == MarkovDrift((1, 1), random_chain(4))
    assert MarkovDrift((1, 1), random_chain(4)) != MarkovDrift((1, 0), random_chain(4))
    with pytest.raises(TypeError, match="callable cannot be saved"):
        search(MarkovDrift((1, 2), by_step)).to_dict()


WRONG: dict[str, tuple[Any, Any, str]] = {
    "no square": ((1, 1), np.ones((16, 15)), r"transitions must be .* got shape \(16, 15\)"),
    "no grid": ((1, 1), np.eye(15), r"transitions must be .* got shape \(15, 15\)"),
    "a row that sums to less": ((1, 1), np.diag([0.5, *[1] * 15]), r"sum to 1, got 0.5 in row 0"),
    "negative": ((1, 1), np.eye(16) * -1, "probabilities of at least 0"),
    "nan": ((1, 1), np.eye(16) * np.nan, "finite probabilities"),
    "text": ((1, 1), "moves", "transitions must be an array"),
    "a start off the grid": ((4, 1), np.eye(16), r"the start of persons\[0\] must be a cell"),
    "a start between cells": ((0.5, 1), np.eye(16), "start must be a cell"),
    "another map": (np.ones((5, 5)), np.eye(16), "start must be a map of 4 x 4 cells"),
    "an empty map": (np.zeros((4, 4)), np.eye(16), "not all 0"),
    "another grid": ((1, 1), np.eye(25), "a Markov chain on 5 x 5 cells, got grid_size=4"),
    "a callable": (
        (1, 1),
        lambda step: np.eye(25),
        r"transitions\(0\) must be of shape \(16, 16\)",
    ),
}


@pytest.mark.parametrize(("start", "chain", "message"), WRONG.values(), ids=WRONG)
def test_what_is_no_chain_is_refused(start, chain, message):
    with pytest.raises((TypeError, ValueError), match=message):
        DroneSwarmSearch(scenario=search(MarkovDrift(start, chain)))
