"""The belief tracker equals the environment's matrix bit for bit and infers who was found."""

import random

import hypothesis.strategies as st
import numpy as np
import pytest
from helpers import HUNT, SPREAD, planned_actions
from hypothesis import given, settings
from small_searches import parameters

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Scenario
from DroneSwarmSearch.paths.best_paths import DronePath
from DroneSwarmSearch.policies import BeliefTracker, Outlook, SearchGains


@settings(max_examples=35, derandomize=True)
@given(parameters(), st.integers(0, 2**32))
def test_the_mean_belief_of_several_persons_equals_the_environments_matrix(search, seed):
    env = DroneSwarmSearch(**search)
    tracker = BeliefTracker(env.scenario)
    rng = random.Random(seed)
    observations, _ = env.reset(seed)
    while env.agents:
        frame = env.frame()
        tracker.observe(frame.matrix)
        assert np.array_equal(tracker.matrix(), frame.matrix)
        assert len(tracker.missing) >= frame.found.count(False)
        lost = [p for p, found in zip(frame.persons, frame.found, strict=True) if not found]
        plans = [(rng.choice([HUNT, SPREAD, Action.SEARCH]),) for _ in frame.drones]
        chosen = planned_actions(plans, 0, frame.drones, lost, env.grid_size, rng)
        tracker.update(frame.drones, chosen)
        observations, *_ = env.step(dict(zip(observations, chosen, strict=True)))


STILL = {"vector": (0, 0), "person_initial_position": [(0, 0), (4, 4)], "disperse_constant": 0}
TWO = {"grid_size": 5, "n_drones": 2, **STILL}
"""Two stationary persons in known cells, and two drones."""


@pytest.mark.parametrize("bayesian_update", [False, True])
@pytest.mark.parametrize("found", [0, 1])
def test_infers_who_was_found(found, bayesian_update):
    env = DroneSwarmSearch(**TWO, bayesian_update=bayesian_update)
    cells = [(0, 0), (4, 4)]
    env.reset(0, drones_positions=cells)
    tracker = BeliefTracker(env.scenario)
    actions = [Action.IDLE, Action.IDLE]
    actions[found] = Action.SEARCH
    tracker.observe(env.frame().matrix)
    tracker.update(cells, actions)
    env.step(dict(zip(env.possible_agents, actions, strict=True)))
    tracker.observe(env.frame().matrix)
    assert tracker.missing == (1 - found,)


def test_rounding_errors_and_unexplained_matrices_change_nothing():
    tracker = BeliefTracker(Scenario(**{**TWO, "disperse_constant": 5}))
    tracker.update([(0, 0), (4, 4)], [Action.SEARCH, Action.SEARCH])
    both = tracker.matrix()
    rounded = np.float32(1 + 1e-6)
    for matrix, missing in (
        (both * rounded, (0, 1)),
        (np.full_like(both, 1 / 25), (0, 1)),
        (tracker.matrix([1]) * rounded, (1,)),
    ):
        tracker.observe(matrix)
        assert tracker.missing == missing


def test_success_is_the_mean_of_detection_times_belief_over_the_missing():
    changes = {"probability_of_detection": (0.5, 0.25), "disperse_constant": 5}
    tracker = BeliefTracker(Scenario(**{**TWO, **changes}))
    expected = (0.5 * tracker.belief(0) + 0.25 * tracker.belief(1)) / 2
    np.testing.assert_allclose(tracker.success, expected)
    tracker.update([(1, 1), (4, 4)], [Action.IDLE, Action.SEARCH])
    tracker.observe(tracker.matrix([0]))
    np.testing.assert_allclose(tracker.success, 0.5 * tracker.belief(0))


def test_in_coverage_missions_a_person_who_would_have_been_found_counts_no_more():
    persons = [Person(Drift((1, 1))), Person(Drift((3, 3), start_sd=1))]
    for mission, share in (("coverage", 0.0), ("rescue", 0.5)):
        tracker = BeliefTracker(Scenario(5, persons=persons, mission=mission))
        tracker.update([(1, 1)], [Action.SEARCH])
        other = tracker.belief(1)[1, 1] / 2
        assert tracker.success[1, 1] == pytest.approx(share + other)


def two_drifting(mission: str) -> BeliefTracker:
    """The tracker of two drifting persons, one with two hypotheses."""
    prior = np.zeros((7, 7))
    prior[1, 2:5] = 1, 2, 3
    persons = [
        Person([Drift((1, 2), vector=(0.5, 0.2)), Drift(prior, vector=(-0.2, 0.9))], 0.7),
        Person(Drift((4, 4), start_sd=1, vector=(0.1, -0.3), diffusion=0.2), 0.4),
    ]
    return BeliefTracker(Scenario(7, persons=persons, mission=mission, n_drones=2))


@pytest.mark.parametrize("searches", [0, 3])
@pytest.mark.parametrize("mission", ["rescue", "coverage"])
def test_success_ahead_is_what_idle_drones_see_later(searches, mission):
    tracker = two_drifting(mission)
    cells = [(1, 1), (4, 4)]
    for _ in range(searches):
        tracker.update(cells, [Action.SEARCH, Action.SEARCH])
    ahead = tracker.success_ahead(9)
    assert (ahead.shape, ahead.dtype) == ((10, 7, 7), np.float64)
    assert np.array_equal(ahead[0], tracker.success)
    for later in ahead:
        np.testing.assert_allclose(tracker.success, later, rtol=1e-9, atol=1e-15)
        tracker.update(cells, [Action.IDLE, Action.IDLE])


@pytest.mark.parametrize("mission", ["rescue", "coverage"])
def test_planned_searches_take_off_what_they_find_wherever_it_drifts(mission):
    tracker = two_drifting(mission)
    outlook = Outlook(tracker, 8)
    before = outlook.success.copy()
    outlook.search((2, 2), 2)
    outlook.search((4, 4), 3)
    assert np.array_equal(before[:2], outlook.success[:2])
    # The mass that no search has found, carried along by hand.
    expected = np.zeros((7, 7))
    for number, detection in enumerate((0.7, 0.4)):
        mass = tracker.joint(number)
        forecast = tracker.forecasts[number]
        for step in range(8):
            if step in (2, 3):
                cell = 2 * step - 2  # (2, 2), then (4, 4)
                mass[:, cell, cell] *= 1 - detection
            mass = forecast.drift(mass, step)
        expected += detection * mass.sum(axis=0) / 2
    np.testing.assert_allclose(outlook.success[8], expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("mission", ["rescue", "coverage"])
def test_gains_are_the_persons_that_searches_find(mission):
    tracker = two_drifting(mission)
    tracker.update([(1, 1), (4, 4)], [Action.SEARCH, Action.SEARCH])
    gains = SearchGains(tracker, 6)
    np.testing.assert_allclose(gains.beside([]), 2 * tracker.success_ahead(5))
    path = DronePath(np.array([16, 16, 17, 17, 17, 17, 17]), np.arange(6) == 3)  # in (3, 2)
    outlook = Outlook(tracker, 5)
    outlook.search((3, 2), 3)
    beside = gains.beside([path])
    np.testing.assert_allclose(beside[:3], 2 * outlook.success[:3])
    np.testing.assert_allclose(beside[4:], 2 * outlook.success[4:])


def test_a_first_find_also_gains_what_it_teaches():
    """By hand: of three persons, in a hypothesis with the probability 1/4."""
    weights = 3.0, 1.0
    cells = (1, 1), (3, 3)
    drifts = [Drift(cell, weight=weight) for cell, weight in zip(cells, weights, strict=True)]
    scenario = Scenario(
        5,
        persons=[Person(drifts, 0.5)] * 3,
        shared_drift=True,
        bayesian_update=True,
        timestep_limit=10,
    )
    found = 0.5 * 3 * 0.25
    lesson = 10.0 * (1 - 0.25) * 2 * 9 / 10
    tracker = BeliefTracker(scenario)
    gains = SearchGains(tracker, 2).beside([])
    assert gains[0, 3, 3] == pytest.approx(found * (1 + lesson))
    coverage = BeliefTracker(scenario.replace(mission="coverage"))  # no find is told
    assert SearchGains(coverage, 2).beside([])[0, 3, 3] == pytest.approx(found)
    # Once a person has been found there, the hypothesis is certain, and a find teaches nothing.
    env = DroneSwarmSearch(scenario=scenario, render_mode=None)
    for seed in range(100):
        env.reset(seed, drones_positions=[(3, 3)])
        env.step({"drone0": Action.SEARCH})
        if sum(env.frame().found) == 1:
            break
    tracker.update([(3, 3)], [Action.SEARCH])
    tracker.observe(env.frame().matrix)
    assert len(tracker.missing) == 2
    assert SearchGains(tracker, 2).beside([])[0, 3, 3] == pytest.approx(0.5 * 2)
