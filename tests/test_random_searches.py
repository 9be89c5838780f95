"""Random searches to train on, those held out, and the success of policies in them."""

from functools import partial

import numpy as np
import pytest
from trainer_examples import module

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.policies import make

example = module("drawn_searches")
draw_searches = example.draw_searches
held_out_searches = example.held_out_searches


def test_drawn_searches_vary():
    rng = np.random.default_rng(0)
    sizes = set()
    drones = set()
    limits = set()
    persons = set()
    for _ in range(40):
        scenarios, starts = draw_searches(rng)
        assert 4 <= len(scenarios) <= 24
        (shape,) = {(each.grid_size, each.n_drones, each.timestep_limit) for each in scenarios}
        size, n_drones, limit = shape
        assert starts.shape == (len(scenarios), n_drones, 2)
        assert (starts >= 0).all() and (starts < size).all()
        assert all(len({*map(tuple, cells)}) == n_drones for cells in starts.tolist())
        assert all(len({*each.detections}) == 1 for each in scenarios)
        sizes.add(size), drones.add(n_drones), limits.add(limit)
        persons |= {len(each.detections) for each in scenarios}
    assert min(sizes) >= 15 and max(sizes) <= 45 and len(sizes) > 10
    assert {1, 2, 16} <= drones
    assert min(limits) < 70 and max(limits) > 300
    assert persons == {1, 2}


def test_the_same_searches_are_held_out_every_time():
    three = held_out_searches(3)
    two = held_out_searches(2)
    assert [each.scenario for each in three[:2]] == [each.scenario for each in two]
    assert [each.drones for each in three[:2]] == [each.drones for each in two]
    assert {each.scenario.mission for each in three} == {"coverage"}
    trained_on, _ = draw_searches(np.random.default_rng([0, 0]))
    assert three[0].scenario.persons != trained_on[0].persons


def test_the_mean_success_is_that_of_the_evaluations():
    searches = []
    for number, start in enumerate([(2, 3), (6, 1)]):
        scenario = Scenario(
            8, 2, timestep_limit=9, persons=(Person(Drift(start), 0.5),), mission="coverage"
        )
        searches.append(NamedSearch(f"drawn-{number}", "Drawn.", scenario))
    each = [evaluate("greedy-posterior", search, episodes=1).success.value for search in searches]
    assert each[0] != each[1]
    mean = example.mean_success(partial(make, "greedy-posterior"), searches)
    assert mean == pytest.approx(np.mean(each))
