"""The greedy policies: their choices, and their success in whole episodes."""

import numpy as np
import pytest
from helpers import target_of
from small_searches import observations, paths_of, search, success_of

from DroneSwarmSearch import Action, DroneSwarmSearch, Scenario
from DroneSwarmSearch.persons import Drift, Person
from DroneSwarmSearch.policies import (
    BeliefTracker,
    ForecastGreedyPolicy,
    GreedyPolicy,
    PosteriorGreedyPolicy,
)
from DroneSwarmSearch.policies.greedy import DISCOUNT, WORTHWHILE, WORTHWHILE_ON_ARRIVAL

FAR = 0.1 / DISCOUNT**2
"""As good a probability as .1, two steps farther away."""


def seen(size, cells, peaks):
    """Observations of drones in some cells, with a matrix of peaks at some (x, y)."""
    matrix = np.zeros((size, size), np.float32)
    for (x, y), probability in peaks.items():
        matrix[y, x] = probability
    matrix.flags.writeable = False
    return observations(cells, matrix)


def choose(size, cells, peaks):
    policy = GreedyPolicy(Scenario(grid_size=size, n_drones=len(cells)))
    return [Action(action) for action in policy(seen(size, cells, peaks)).values()]


class TestChoice:
    @pytest.mark.parametrize(
        ("cell", "peaks", "action"),
        [
            ((3, 3), {(0, 3): 1.0}, Action.LEFT),
            ((3, 3), {(6, 3): 1.0}, Action.RIGHT),
            ((3, 3), {(3, 0): 1.0}, Action.UP),
            ((3, 3), {(3, 6): 1.0}, Action.DOWN),
            ((3, 3), {(3, 3): 1.0}, Action.SEARCH),
            # Probability is weighed against distance.
            ((3, 3), {(2, 3): 0.1, (6, 3): 0.99 * FAR}, Action.LEFT),
            ((3, 3), {(2, 3): 0.1, (6, 3): 1.01 * FAR}, Action.RIGHT),
            # Through the likelier cells; in a tie, along the longer leg first.
            ((1, 1), {(4, 4): 0.9, (1, 2): 0.01}, Action.DOWN),
            ((1, 1), {(4, 4): 0.9, (2, 1): 0.01}, Action.RIGHT),
            ((1, 1), {(2, 5): 1.0}, Action.DOWN),
            ((1, 5), {(2, 1): 1.0}, Action.UP),
            ((1, 1), {(5, 2): 1.0}, Action.RIGHT),
        ],
    )
    def test_moves_to_the_likely_cell_and_searches_it(self, cell, peaks, action):
        assert choose(7, [cell], peaks) == [action]

    def test_never_enters_an_occupied_or_claimed_cell(self):
        # Two drones next to the only likely cell, and one in it.
        actions = choose(5, [(1, 2), (3, 2), (2, 2)], {(2, 2): 1.0})
        assert actions == [Action.IDLE, Action.IDLE, Action.SEARCH]
        # The cell is empty: one of them enters it.
        actions = choose(5, [(1, 2), (3, 2)], {(2, 2): 1.0})
        assert actions == [Action.RIGHT, Action.IDLE]
        # A drone about to leave its cell may be blocked, so its cell is not entered either.
        actions = choose(5, [(1, 2), (2, 2)], {(4, 2): 1.0})
        assert actions == [Action.IDLE, Action.RIGHT]


def test_remembers_a_search_that_the_matrix_does_not_show_until_a_new_episode():
    here = (1, 3)
    there = (2, 3)
    peaks = {here: 0.2, there: 0.19, (6, 6): 0.01}
    policy = GreedyPolicy(Scenario(grid_size=7, n_drones=1))
    search = {"drone0": int(Action.SEARCH)}
    away = {"drone0": int(Action.RIGHT)}
    assert policy(seen(7, [here], peaks)) == search
    assert policy(seen(7, [here], peaks)) == away
    policy.reset()
    assert policy(seen(7, [here], peaks)) == search
    # A posterior shows the search, so it is not remembered.
    policy = GreedyPolicy(Scenario(grid_size=7, n_drones=1, bayesian_update=True))
    assert policy(seen(7, [here], peaks)) == search
    assert policy(seen(7, [here], peaks)) == search


def test_posterior_greedy_ignores_unlikely_cells():
    # Before the first search, forecast and posterior are equal.
    person = {"vector": (0, 0), "person_initial_position": (9, 9), "disperse_constant": 50}
    env = DroneSwarmSearch(20, **person, timestep_limit=60, bayesian_update=True)
    policy = PosteriorGreedyPolicy(env.scenario)
    shown, _ = env.reset(1)
    likely = []
    while env.agents:
        actions = policy(shown)
        (x, y), matrix = shown["drone0"]["observation"]
        if actions["drone0"] == Action.SEARCH:
            likely.append(float(matrix[y, x] / matrix.max()))
        shown, *_ = env.step(actions)
    assert likely and min(likely) >= WORTHWHILE * (1 - 1e-6)


class TestForecastGreedy:
    """Greedy on the posterior at the time of arrival."""

    def test_meets_a_person_whose_drift_is_certain(self):
        # From (2, 5), one cell to the right in each step: in (7, 5) after five steps.
        person = {"person_initial_position": (2, 5), "vector": (1, 0), "disperse_constant": 0}
        of = search([(7, 0)], grid_size=40, timestep_limit=8, **person)
        (path,) = paths_of(ForecastGreedyPolicy(of.scenario), of)
        assert path.cells[:6].tolist() == [40 * y + 7 for y in range(6)]
        assert path.searches[:6].tolist() == [False] * 5 + [True]
        assert success_of(of, [path]) == [1.0]
        assert success_of(of, paths_of(PosteriorGreedyPolicy(of.scenario), of)) == [0.0]

    def test_targets_have_the_best_discounted_success_on_arrival(self):
        persons = [
            Person([Drift((3, 9), vector=(0.6, -0.3)), Drift((12, 12), vector=(-0.4, -0.5))], 0.6),
            Person(Drift((9, 2), start_sd=1, vector=(0.1, 0.5), diffusion=0.3), 0.9),
        ]
        scenario = Scenario(16, n_drones=1, persons=persons, timestep_limit=60, mission="coverage")
        policy = ForecastGreedyPolicy(scenario)
        tracker = BeliefTracker(scenario)
        cell = (15, 0)
        for _ in range(55):
            steps = scenario.timestep_limit - tracker.step - 1
            ahead = tracker.success_ahead(steps)
            best = -1.0
            target = cell
            near = {
                (x, y): abs(x - cell[0]) + abs(y - cell[1]) for y in range(16) for x in range(16)
            }
            arrivals = {(x, y): ahead[d, y, x] for (x, y), d in near.items() if d <= steps}
            worthwhile = WORTHWHILE_ON_ARRIVAL * max(arrivals.values())
            for there, success in arrivals.items():
                if success >= worthwhile and success * DISCOUNT ** near[there] > best:
                    best = success * DISCOUNT ** near[there]
                    target = there
            (action,) = policy(observations([cell], tracker.matrix())).values()
            tracker.update([cell], [action])
            ahead_cell = target_of(cell, action)
            if target == cell:
                assert action == Action.SEARCH
            else:
                assert near[target] - 1 == sum(abs(np.subtract(target, ahead_cell)))
            cell = ahead_cell
