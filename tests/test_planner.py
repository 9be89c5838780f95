"""The planner: the quality of its plans, replanning, and batches."""

import copy
import pickle
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from small_searches import (
    SMALL,
    assert_legal,
    best,
    fly,
    paths_of,
    search,
    shortened,
    success_of,
    uncertain_persons,
)

from DroneSwarmSearch.evaluation import NamedSearch
from DroneSwarmSearch.planning import DronePath
from DroneSwarmSearch.policies import BeliefTracker, PlannerPolicy, PosteriorGreedyPolicy


def planner(of: NamedSearch) -> PlannerPolicy:
    return PlannerPolicy(of.scenario, seconds=4.0)


def planner_success(of: NamedSearch) -> float:
    """The probability that the planner finds the person of a search."""
    return success_of(of, paths_of(planner(of), of))[0]


@pytest.fixture
def plans_made(monkeypatch):
    """A list of the steps at which plans are made."""
    steps: list[int] = []
    plan = PlannerPolicy.plan

    def recorded(self: PlannerPolicy, tracker: BeliefTracker, *rest: Any) -> Any:
        steps.append(tracker.step)
        return plan(self, tracker, *rest)

    monkeypatch.setattr(PlannerPolicy, "plan", recorded)
    return steps


@st.composite
def small_searches(draw: st.DrawFn) -> NamedSearch:
    """A search for one person, too large for branch and bound."""
    size = draw(st.integers(5, 8))
    cells = [(x, y) for y in range(size) for x in range(size)]
    return search(
        draw(st.permutations(cells))[: draw(st.integers(1, 3))],
        grid_size=size,
        persons=draw(uncertain_persons(size)),
        timestep_limit=draw(st.integers(17, 24)),
    )


TYPICAL = (3, 6, 10, 13)
"""Searches of `SMALL`: with and without drift, one drone and two, hypotheses and arrays."""


@pytest.mark.thorough
@pytest.mark.good_plans
@pytest.mark.parametrize(
    "index",
    [
        pytest.param(index, marks=[pytest.mark.slow] * (index not in TYPICAL))
        for index in range(len(SMALL))
    ],
)
def test_is_close_to_the_optimum(index):
    most = best(index)
    assert most > 0.05
    assert 0.97 * most <= planner_success(SMALL[index]) <= most + 1e-12


@pytest.mark.thorough
@settings(max_examples=4, derandomize=True)
@given(small_searches())
def test_is_never_below_greedy_with_one_person(of):
    """Holds for plans made with little work, too."""
    greedy = success_of(of, paths_of(PosteriorGreedyPolicy(of.scenario), of))[0]
    assert planner_success(of) >= greedy - 1e-12


@pytest.mark.thorough
@pytest.mark.good_plans
def test_more_work_finds_more_and_the_same_work_the_same():
    of = search(
        [(0, 0), (1, 0), (2, 0)], grid_size=12, timestep_limit=24,
        person_initial_position=(7, 7), vector=(0.2, -0.1), disperse_constant=8,
    )  # fmt: skip
    success = []
    for seconds in (0.0, 0.7, 0.7):
        policy = PlannerPolicy(of.scenario, seconds=seconds)
        success.append(success_of(of, paths_of(policy, of))[0])
    assert success[0] + 0.005 < success[1] == success[2]
    with pytest.raises(ValueError, match="seconds must be"):
        PlannerPolicy(of.scenario, seconds=-1)


A_SEARCH = search(
    [(0, 0), (7, 7)], grid_size=8, person_initial_position=[(3, 4), (5, 2)],
    vector=(0.1, -0.1), disperse_constant=4, timestep_limit=16,
    probability_of_detection=(1.0, 0.7),
)  # fmt: skip


class TestFollowingPlans:
    def test_follows_one_plan_until_a_find(self, plans_made):
        paths = paths_of(planner(A_SEARCH), A_SEARCH)
        assert_legal(paths, [0, 63], 8)
        assert plans_made == [0]
        assert min(success_of(A_SEARCH, paths)) > 0.2

    @pytest.mark.thorough
    def test_copies_include_a_prepared_plan(self, plans_made):
        policy = planner(A_SEARCH)
        policy.prepare(A_SEARCH.drones)
        assert plans_made == [0]
        twin = pickle.loads(pickle.dumps(policy))
        paths = paths_of(twin, A_SEARCH)
        assert plans_made == [0]
        for path, other in zip(paths, paths_of(planner(A_SEARCH), A_SEARCH), strict=True):
            assert all(map(np.array_equal, path, other))
        assert plans_made == [0, 0]

    def test_a_long_episode_is_planned_in_parts(self, plans_made, monkeypatch):
        monkeypatch.setattr("DroneSwarmSearch.policies.open_loop.HORIZON", 6)
        monkeypatch.setattr("DroneSwarmSearch.policies.planner.HORIZON", 6)
        paths = paths_of(planner(A_SEARCH), A_SEARCH)
        assert plans_made == [0, 6, 12]
        assert_legal(paths, [0, 63], 8)
        assert min(success_of(A_SEARCH, paths)) > 0.15


class TestReplanning:
    def test_after_a_find_for_those_still_missing(self, plans_made):
        of = A_SEARCH
        policy = planner(A_SEARCH)
        tracker = BeliefTracker(of.scenario)
        cells = list(of.drones)
        step = 0
        while True:
            before = tracker.belief(0)
            paths = fly(policy, tracker, cells, 1)
            searched = [path.cells[0] for path in paths if path.searches[0]]
            cells = [divmod(int(path.cells[1]), 8)[::-1] for path in paths]
            step += 1
            if before.reshape(-1)[searched].sum() > 0.05:
                break
        assert plans_made == [0]

        # One belief is that no person was found, the other that person 0 was.
        left = of.scenario.timestep_limit - step
        steps = []
        success = []
        for missing in ((0, 1), (1,)):
            pilot = copy.deepcopy(policy)
            twin = copy.deepcopy(tracker)
            twin.missing = missing
            at_find = copy.deepcopy(twin)
            paths = fly(pilot, twin, cells, left)
            at_find.missing = (1,)
            success.append(success_of(of, paths, at_find)[0])
            steps.append(list(plans_made))
        assert steps[0] == [0], "without a find there is no new plan"
        assert steps[1] == [0, step]
        assert success[1] > success[0] + 0.01

    def test_after_a_drone_was_displaced(self, plans_made):
        of = shortened(SMALL[3], 20)
        policy = planner(of)
        tracker = BeliefTracker(of.scenario)
        (path,) = fly(policy, tracker, of.drones, 1)
        assert plans_made == [0]
        # From the likeliest cell, the new plan is better than staying there.
        belief = tracker.belief(0)
        likeliest = int(belief.argmax())
        assert path.cells[1] != likeliest
        cell = divmod(likeliest, of.scenario.grid_size)[::-1]
        start = copy.deepcopy(tracker)
        paths = fly(policy, tracker, [cell], 19)
        assert plans_made == [0, 1]
        staying = DronePath(np.full(20, likeliest), np.ones(19, bool))
        assert success_of(of, paths, start)[0] > success_of(of, [staying], start)[0] > belief.max()
