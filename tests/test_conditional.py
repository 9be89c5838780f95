"""Conditional success: against exact values, enumerated paths, and shares of found episodes."""

from typing import Any

import numpy as np
import pytest
from exact_searches import PERSONS, Recorder, curve_of, named

from DroneSwarmSearch import Ending
from DroneSwarmSearch.evaluation import (
    Estimate,
    Evaluation,
    NamedSearch,
    View,
    compare,
    difference,
    evaluate,
    roll_out,
)
from DroneSwarmSearch.evaluation.text_tables import figure, signed
from DroneSwarmSearch.policies import make
from DroneSwarmSearch.vector import SearchBatch

LIMIT = 14


def evaluated(policy: Any, search: NamedSearch, **options: Any) -> Evaluation:
    return evaluate(policy, search, **{"episodes": 60, "progress": False, **options})


@pytest.mark.parametrize("view", ["swarm", "parallel"])
@pytest.mark.parametrize("person", PERSONS)
def test_every_episode_has_the_success_of_its_path(person, view):
    search = named(person, bayesian_update=True, timestep_limit=8)
    policy = Recorder(make("random", search.scenario))
    episodes = roll_out(policy, search, range(20), View(view))
    for curve, actions in zip(episodes.curves, policy.actions, strict=True):
        np.testing.assert_allclose(curve, curve_of(search, actions), rtol=0, atol=1e-12)
    assert np.ptp(episodes.curves[:, -1]) > 0.0


@pytest.mark.thorough
@pytest.mark.parametrize("persons", [("known", "missed"), ("known", "missed", "hypotheses")])
def test_several_persons(persons):
    """Sampled until one person is missing."""
    search = named(*persons, timestep_limit=30)
    n = 300
    got = evaluated("parallel-sweep", search, episodes=n, deterministic=False)
    last_but_one = np.sort(np.where(got.episodes.found_at > 0, got.episodes.found_at, 99))[:, -2]
    for step, curve in zip(last_but_one.tolist(), got.curves, strict=True):
        assert not curve[:step].any()
        assert step > 25 or curve[-1] > 0.0
    final = got.curves[:, -1]
    finds = np.where(got.episodes.endings == Ending.FOUND, got.episodes.steps, 30)
    share = got.endings[Ending.FOUND] / n
    assert final.var() < 0.6 * share * (1 - share)
    assert got.times.var() < finds.var()
    error = np.sqrt(share * (1 - share) / n)
    assert abs(final.mean() - share) < 4 * error


@pytest.mark.parametrize("persons", [("missed",), ("missed", "hypotheses", "known")])
def test_the_last_person_is_never_found(persons):
    scenario = named(*persons, bayesian_update=True, timestep_limit=60).scenario
    batch = SearchBatch(30, scenario=scenario, finds_last=False, drones_positions=[(2, 2), (4, 2)])
    batch.reset([*range(30)])
    policy = make("greedy-posterior", scenario)
    rows = np.arange(30)
    for _ in range(59):
        is_last = batch.missing.sum(axis=1) == 1
        before = batch.probability_of_failure
        shown = {"positions": batch.positions, "probability_matrix": batch.matrices_of(rows)}
        batch.step(policy(shown))
        assert (batch.missing[is_last].sum(axis=1) == 1).all()
        assert not batch.ended[is_last].any()
        after = batch.probability_of_failure
        assert before is not None
        assert after is not None
        assert (after[is_last] <= before[is_last]).all()
    assert is_last.sum() > 20
    assert np.median(after[is_last].min(axis=1)) < 0.3


def test_differences():
    search = named("hypotheses")
    tossed = evaluated("greedy-matrix", search, deterministic=False)
    other = evaluated("random", search)
    exact = evaluated("greedy-posterior", search)
    got = compare(tossed, other)
    assert got.success.value == pytest.approx(tossed.success.value - other.success.value)
    assert got.time.value == pytest.approx(tossed.time.value - other.time.value)
    assert got.success.low < got.success.value < got.success.high
    assert compare(exact, other).success == difference(exact.success, other.success)
    assert compare(exact, other).time == difference(exact.time, other.time)
    with pytest.raises(ValueError, match="60 from seed 1, got 60 from seed 0"):
        compare(evaluated("random", search, seed=1), other)


@pytest.mark.parametrize(
    ("estimate", "unsigned", "with_sign"),
    [
        (Estimate(12.34, 11.0, 13.9), "12.3 (11.0-13.9)", "+12.3 (+11.0 to +13.9)"),
        (Estimate(0.8912, 0.8771, 0.9053), "0.89 (0.88-0.91)", "+0.89 (+0.88 to +0.91)"),
        (Estimate(1e-9, 0.0, 2e-9), "0.0000 (0.0000-0.0000)", "+0.0000 (+0.0000 to +0.0000)"),
        (Estimate(2.0, 2.0, 2.0), "2.0", "+2.0"),
    ],
)
def test_tables_have_enough_decimals_for_the_interval(estimate, unsigned, with_sign):
    assert figure(estimate) == unsigned
    assert signed(estimate) == with_sign
