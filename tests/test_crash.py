"""What happens to drones that leave the grid or meet: `crash`."""

from typing import Any

import numpy as np
import pytest
from twins import Twins

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, RewardScheme, Scenario
from DroneSwarmSearch.core import rules
from DroneSwarmSearch.core.collision_avoidance import action_masks
from DroneSwarmSearch.evaluation import evaluate
from DroneSwarmSearch.vector import SearchBatch, SwarmVectorEnv
from DroneSwarmSearch.wrappers import ActionMask

LEFT, RIGHT, UP, DOWN, SEARCH, IDLE = map(int, Action)


def search(**changes: Any) -> Scenario:
    persons = [Person(Drift((2, 2), vector=(0.2, 0.1), diffusion=0.2), 0.6) for _ in range(2)]
    values = {"n_drones": 3, "timestep_limit": 60, "persons": persons, **changes}
    return Scenario(5, **values)


# Cells of three drones on a grid of 5 x 5, their actions, and where they are afterwards.
CASES = {
    "the border": ("block", [0, 1, 2], [UP, IDLE, UP], [0, 1, 2]),
    "a drone in the way": ("block", [0, 1, 7], [RIGHT, IDLE, UP], [0, 1, 2]),
    "the first of two": ("block", [5, 7, 1], [RIGHT, LEFT, IDLE], [6, 7, 1]),
    "following": ("block", [1, 0, 9], [RIGHT, RIGHT, IDLE], [2, 1, 9]),
    "followed by a lower number": ("block", [0, 1, 9], [RIGHT, RIGHT, IDLE], [0, 2, 9]),
    "an exchange": ("block", [0, 1, 9], [RIGHT, LEFT, IDLE], [0, 1, 9]),
    "passing, the border": ("pass", [0, 1, 2], [LEFT, UP, IDLE], [0, 1, 2]),
    "passing into a cell": ("pass", [0, 1, 6], [RIGHT, IDLE, UP], [1, 1, 1]),
    "passing, an exchange": ("pass", [0, 1, 9], [RIGHT, LEFT, IDLE], [1, 0, 9]),
}


@pytest.mark.parametrize(("crash", "cells", "actions", "expected"), CASES.values(), ids=CASES)
def test_drones_stay_or_share(crash, cells, actions, expected):
    scenario = search(crash=crash)
    positions = [(cell % 5, cell // 5) for cell in cells]
    batch = SearchBatch(2, scenario, drones_positions=positions)
    batch.reset(seeds=[0, 1])
    batch.step(np.tile(actions, (2, 1)))
    assert batch.cells.tolist() == [expected] * 2
    assert (batch.rewards == 1).all() and not batch.ended.any()
    env = DroneSwarmSearch(scenario=scenario)
    env.reset(seed=0, drones_positions=positions)
    _, rewards, _, _, _ = env.step(dict(zip(env.agents, actions, strict=True)))
    assert env.snapshot().cells == expected
    assert rewards["total_reward"] == 3 and len(env.agents) == 3


@pytest.mark.thorough
@pytest.mark.parametrize("crash", ["block", "pass"])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"bayesian_update": True},
        {"reward_scheme": RewardScheme.expected()},
        {"mission": "coverage", "bayesian_update": True},
        {"bayesian_update": True, "shared": True},
    ],
    ids=str,
)
def test_batches_are_the_same_bit_for_bit(crash, changes):
    changes = dict(changes)
    if changes.pop("shared", False):
        vectors = [(0.3, 0.0), (-0.3, 0.2)]
        drifts = [Drift((2, 2), vector=vector, diffusion=0.1) for vector in vectors]
        changes |= {"persons": [Person(drifts, 0.6), Person(drifts, 0.4)], "shared_drift": True}
    start = [(1, 2), (2, 2), (3, 2)]
    twins = Twins(6, {"scenario": search(crash=crash, **changes), "drones_positions": start})
    twins.reset(range(6))
    shared = 0
    rng = np.random.default_rng(0)
    for _ in range(80):
        twins.step(rng.choice([LEFT, RIGHT, UP, DOWN, *[SEARCH] * 4], size=(6, 3)))
        shared += sum(len(set(frame.drones)) < 3 for frame in twins.frames)
    assert (shared > 20) == (crash == "pass")
    assert max(twins.episodes) > 0


def test_several_searches_of_a_cell_count_each():
    """Three drones that search one cell find with 1 - (1 - q)³, the first ones more often."""
    person = Person(Drift((0, 0), vector=(0, 0), diffusion=0), 0.3)
    scenario = Scenario(2, n_drones=3, persons=person, crash="pass", bayesian_update=True)
    rows = 20_000
    batch = SearchBatch(rows, scenario, drones_positions=[(0, 0), (1, 0), (0, 1)])
    batch.reset(seeds=range(rows))
    batch.step(np.tile([IDLE, LEFT, UP], (rows, 1)))
    assert (batch.cells == 0).all()
    batch.step(np.full((rows, 3), SEARCH))
    assert batch.found.mean() == pytest.approx(1 - 0.7**3, abs=0.01)
    by_drone = (batch.rewards > 10_000).mean(axis=0)
    assert by_drone == pytest.approx([0.3, 0.21, 0.147], abs=0.01)
    assert batch.probability_of_success[0] == pytest.approx(1 - 0.7**3)


@pytest.mark.parametrize("crash", ["block", "pass"])
def test_random_drones_live_to_the_time_limit(crash):
    result = evaluate("random", search(crash=crash), episodes=50, progress=False)
    happened = {ending for ending, share in result.endings.items() if share}
    assert happened <= {rules.Ending.FOUND, rules.Ending.TIME_LIMIT}


def test_masks_follow_the_rule():
    cells = [0, 1, 6]
    ends = action_masks(cells, 5)
    assert np.array_equal(action_masks(cells, 5, crash="block"), ends)
    passing = action_masks(cells, 5, right_of_way=True, crash="pass")
    assert passing[0].tolist() == [False, True, False, True, True, True]
    assert passing[2].all()
    for crash in ("end", "block", "pass"):
        env = ActionMask(DroneSwarmSearch(scenario=search(crash=crash)))
        env.reset(seed=0, drones_positions=[(0, 0), (1, 0), (1, 1)])
        expected = action_masks(cells, 5, crash=crash)
        masks = [env.action_masks()[f"drone{drone}"] for drone in range(3)]
        assert np.array_equal(np.array(masks, bool), expected)
        swarms = SwarmVectorEnv(
            2, scenario=search(crash=crash), drones_positions=[(0, 0), (1, 0), (1, 1)]
        )
        swarms.reset(seed=0)
        assert np.array_equal(swarms.action_masks()[1].reshape(3, 6), expected)


@pytest.mark.parametrize(
    ("policy", "least"), [("greedy-matrix", 0.5), ("greedy-posterior", 0.5), ("sector-search", 0.1)]
)
@pytest.mark.parametrize("crash", ["block", "pass"])
def test_policies_find_under_each_rule(policy, least, crash):
    result = evaluate(policy, search(crash=crash), episodes=60, progress=False)
    assert result.success.value > least


def test_an_unknown_rule_is_refused():
    with pytest.raises(ValueError, match="crash must be one of 'end', 'block', 'pass', got 'stop'"):
        Scenario(crash="stop")
