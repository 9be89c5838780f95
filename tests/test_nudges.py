"""Random changes of paths, which improve plans of small searches."""

import itertools

import numpy as np
import pytest

from DroneSwarmSearch import MarkovDrift, Person, Scenario
from DroneSwarmSearch.paths import joint_plan
from DroneSwarmSearch.paths.nudges import MOST, nudged
from DroneSwarmSearch.planning import plan_paths

SIZE = 5


def distance(one, other):
    return abs(one % SIZE - other % SIZE) + abs(one // SIZE - other // SIZE)


@pytest.mark.parametrize("is_bound", [True, False])
def test_they_are_paths_that_begin_and_end_where_they_must(is_bound):
    rng = np.random.default_rng(0)
    old = np.array([[0, 1, 1, 2, 7, 12, 12, 11, 11], [24, 23, 22, 22, 22, 17, 12, 12, 12]]).T
    goals = old[-1] if is_bound else np.full(2, -1)
    new = nudged(old, goals, 200, SIZE, rng)
    assert new.shape == (9, 2, 200)
    assert (new[0] == old[0][:, None]).all()
    for path, candidates in enumerate(new.transpose(1, 2, 0)):
        ends = {cells[-1] for cells in candidates.tolist()}
        assert ends == {old[-1, path]} if is_bound else len(ends) > 4
        for cells in candidates.tolist():
            assert all(0 <= cell < SIZE**2 for cell in cells)
            steps = itertools.pairwise(cells)
            assert all(distance(here, there) <= 1 for here, there in steps)
            changed = (np.array(cells) != old[:, path]).nonzero()[0]
            assert not len(changed) or changed[-1] - changed[0] < MOST
        assert len({tuple(cells) for cells in candidates.tolist()}) > 50


@pytest.mark.thorough
@pytest.mark.parametrize("crash", ["end", "block", "pass"])
def test_plans_with_them_keep_the_rules(crash, monkeypatch):
    monkeypatch.setattr(joint_plan, "ENOUGH_NUDGES", 60)
    rng = np.random.default_rng(1)
    chain = rng.dirichlet(np.full(SIZE**2, 0.1), SIZE**2)
    scenario = Scenario(
        SIZE,
        n_drones=3,
        timestep_limit=6,
        persons=[Person(MarkovDrift((2, 2), chain), probability_of_detection=0.8)],
        crash=crash,
    )
    plan = plan_paths(scenario, [(0, 0), (1, 0), (2, 0)], seconds=0.2)
    cells = np.array([path.cells for path in plan.paths])
    for path in plan.paths:
        stays = path.cells[1:] == path.cells[:-1]
        assert (stays[path.searches]).all()
        steps = itertools.pairwise(path.cells.tolist())
        assert all(distance(here, there) <= 1 for here, there in steps)
    if crash != "pass":
        assert all(len(set(column)) == 3 for column in cells.T.tolist())
