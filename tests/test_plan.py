"""Plans: their exact value by brute force and simulation, their improvement, and the optimum."""

import random
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from helpers import careful_actions
from hypothesis import given, settings
from small_searches import (
    assert_legal,
    fly,
    forecast_of,
    found_in_each_step,
    schedule_of,
    search,
    targets_of,
    uncertain_persons,
)

from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.paths.joint_plan import JointPlan
from DroneSwarmSearch.paths.passes import Passes
from DroneSwarmSearch.paths.windows import Boxes, TargetWindow
from DroneSwarmSearch.planning import DronePath
from DroneSwarmSearch.policies import BeliefTracker


def starts_of(of: NamedSearch) -> list[int]:
    """Every drone's first cell, y * N + x."""
    return [y * of.scenario.grid_size + x for x, y in of.drones]


def random_paths(of: NamedSearch, steps: int, seed: int) -> list[DronePath]:
    """Legal paths that search in about every other step."""
    rng = random.Random(seed)
    size = of.scenario.grid_size

    def act(seen: dict[str, Any]) -> dict[str, int]:
        return careful_actions(rng, seen, size)

    return fly(act, BeliefTracker(of.scenario), of.drones, steps)


@st.composite
def plans(draw: st.DrawFn, most_steps: int = 4) -> tuple[NamedSearch, list[DronePath], np.ndarray]:
    """A search with legal paths, and the value of a find in each step."""
    size = draw(st.integers(2, 4))
    cells = [(x, y) for y in range(size) for x in range(size)]
    drones = draw(st.permutations(cells))[: draw(st.integers(1, 3))]
    steps = draw(st.integers(1, most_steps))
    persons = draw(st.lists(uncertain_persons(size), min_size=1, max_size=2))
    of = search(drones, grid_size=size, persons=persons, timestep_limit=steps)
    worth = 1.0 + draw(st.sampled_from([0.0, 0.1, 2.0])) * np.linspace(1, 0, steps)
    return of, random_paths(of, steps, draw(st.integers(0, 2**32))), worth


@settings(max_examples=20, derandomize=True)
@given(plans(), st.sampled_from([1.0, 0.5, 3.0]))
def test_value_and_success_are_the_sums_over_all_trajectories(plan_of, weight):
    of, paths, worth = plan_of
    targets = targets_of(of, worth=worth)
    targets[-1].worth = weight * worth
    plan = JointPlan(targets, 0, paths)
    found = [
        found_in_each_step(forecast_of(of, person), target.detection, schedule_of(paths))
        for person, target in enumerate(targets)
    ]
    np.testing.assert_allclose(plan.found(), found, atol=1e-12)
    value = sum(float(t.worth @ steps) for t, steps in zip(targets, found, strict=True))
    assert plan.value() == pytest.approx(value, abs=1e-12)


@pytest.mark.thorough
@settings(max_examples=60, derandomize=True)
@given(plans(most_steps=9), st.integers(0, 2**32), st.sampled_from([1e-9, 0.01, 10.0]))
def test_annealing_keeps_paths_legal_and_values_exact(plan_of, seed, heat):
    of, paths, worth = plan_of
    plan = JointPlan(targets_of(of, worth=worth), 0, paths)
    value = plan.value()
    fractions = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("DroneSwarmSearch.paths.joint_plan.TRIES", ((heat, 1.0), (0.1, 0.5)))
        plan.anneal(0.02, np.random.default_rng(seed), on_progress=fractions.append)
    assert plan.value() >= value - 1e-9
    assert plan.value() == pytest.approx(
        JointPlan(targets_of(of, worth=worth), 0, plan.paths).value(), abs=1e-12
    )
    assert_legal(plan.paths, starts_of(of), of.scenario.grid_size)
    assert fractions == sorted(fractions)
    assert 0.0 <= fractions[0] <= fractions[-1] <= 1.0


@pytest.mark.thorough
def test_the_better_try_counts(monkeypatch):
    """Whichever comes first; one with hardly any work gains little."""
    monkeypatch.setattr("DroneSwarmSearch.paths.joint_plan.ENOUGH", 1000)  # none left for nudges
    of = search(
        [(0, 0), (11, 11)], grid_size=12, timestep_limit=24,
        person_initial_position=(5, 6), vector=(0.2, -0.1), disperse_constant=5,
    )  # fmt: skip
    little = (0.1, 0.02)
    much = (0.1, 1.0)

    def found(*tries: tuple[float, float]) -> float:
        monkeypatch.setattr("DroneSwarmSearch.paths.joint_plan.TRIES", tries)
        plan = JointPlan(targets_of(of, worth=np.ones(24)), 0, random_paths(of, 24, 0))
        plan.anneal(0.3, np.random.default_rng(0))
        return plan.value()

    assert found(much) > found(little) + 0.05
    assert found(much, little) >= found(much)
    assert found(little, much) > found(little) + 0.05


@settings(max_examples=40, derandomize=True)
@given(plans(most_steps=9), st.integers(0, 2**32))
def test_the_gain_of_a_trial_is_exact(plan_of, seed):
    """Hot trials change paths at random, of one drone or of two that exchange their rests."""
    of, paths, worth = plan_of
    rng = np.random.default_rng(seed)
    plan = JointPlan(targets_of(of, worth=worth), 0, paths)
    factors = np.exp(rng.normal(size=2**18))
    for _ in range(5):
        begin = int(rng.integers(len(worth)))
        end = int(rng.integers(begin + 1, len(worth) + 1))
        before = plan.value()
        gained, _ = plan.trial(begin, end, 1e3, factors, rng)
        assert plan.value() - before == pytest.approx(gained, abs=1e-5)  # in float32
        assert_legal(plan.paths, starts_of(of), of.scenario.grid_size)


@pytest.mark.parametrize("detection", [1.0, 0.6])
def test_a_repeated_search_gains_what_the_first_has_left(detection):
    """Exactly, if the person stays; in a window's first step, no search of it comes before."""
    of = search(
        [(0, 0)], grid_size=4, person_initial_position=(2, 1), vector=(0, 0),
        disperse_constant=0, timestep_limit=6, probability_of_detection=detection,
    )  # fmt: skip
    (target,) = targets_of(of, worth=np.ones(6))
    passes = Passes(target, 0, random_paths(of, 6, 0))
    everywhere = Boxes(np.array([0]), np.array([0]), 4, 4, 4)
    gains, again = TargetWindow(passes, 2, 3, everywhere).gains(everywhere)
    assert gains.shape == (3, 1, 1, 4, 4)
    assert gains[0, 0, 0, 1, 2] > 0.0
    np.testing.assert_allclose(again[0], gains[0])
    np.testing.assert_allclose(again[1:], (1.0 - detection) * gains[1:], rtol=1e-6)


def test_a_path_meets_the_person_as_early_as_possible():
    """A person who moves as fast as a drone, in a known direction, can be searched only once."""
    of = search(
        [(3, 2)], grid_size=6, person_initial_position=(0, 0), vector=(1, 0),
        disperse_constant=0, timestep_limit=5, probability_of_detection=0.6,
    )  # fmt: skip
    idle = DronePath(np.full(6, 15), np.zeros(5, np.bool_))
    plan = JointPlan(targets_of(of, worth=np.linspace(2, 1, 5)), 0, [idle])
    plan.anneal(0.1, np.random.default_rng(0))
    assert plan.value() == pytest.approx(0.6 * 1.25)
    assert plan.paths[0].cells[3] == 3  # (3, 0), in step 3 as the person
    assert plan.paths[0].searches.tolist() == [False, False, False, True, False]
