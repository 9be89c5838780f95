"""The parts of the example that trains the policy "imitation"."""

from typing import Any

import numpy as np
import pytest
from trainer_examples import module

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.policies import Network
from DroneSwarmSearch.policies.arrivals import INPUTS

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def example():
    return module("train_imitation")


ExpectedSearches: Any = module("expected_searches").ExpectedSearches
STARTS = [(0, 0), (4, 7), (8, 1)]


def scenario() -> Scenario:
    person = Person([Drift((4, 4), vector=(0.3, -0.2), diffusion=0.3)], 0.7)
    return Scenario(grid_size=9, n_drones=3, timestep_limit=20, persons=[person])


def batch(count: int = 2) -> Any:
    return ExpectedSearches([scenario()] * count, [STARTS] * count)


def test_the_untrained_agent_is_greedy(example):
    """It goes where the best cell on arrival is, and searches where no better one is left."""
    torch.manual_seed(0)
    logits = example.Agent()(torch.from_numpy(batch().inputs().reshape(-1, INPUTS)))
    best = logits.detach().numpy().argmax(axis=1).reshape(2, 3)
    assert set(best[:, 0]) <= {Action.RIGHT, Action.DOWN}
    assert set(best[:, 1]) == {Action.UP}
    assert set(best[:, 2]) <= {Action.LEFT, Action.DOWN}


def test_the_package_runs_the_trained_network(example, tmp_path):
    torch.manual_seed(3)
    agent = example.Agent()
    obs = torch.rand(7, INPUTS)
    for parameter in agent.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    agent.network().save(tmp_path / "weights.npz")
    logits = Network.load(tmp_path / "weights.npz")(obs.numpy())
    assert np.allclose(logits, agent(obs).detach().numpy(), atol=1e-4)


def test_improved_paths_are_flown_and_find_more(example):
    """From a later step on, after which the paths differ; before, they are those flown."""
    torch.manual_seed(0)
    flown = batch(1)
    cells, actions = example.fly(example.Agent(), flown, np.random.default_rng(0), 5)
    found = flown.found.copy()
    paths = example.improve(scenario(), cells[:, 0], actions[:, 0], 5, np.random.default_rng(1))
    assert np.array_equal(paths[0][:6], cells[:6, 0]) and not np.array_equal(paths[0], cells[:, 0])
    again = batch(1)
    samples = example.watch(again, *(each[:, None] for each in paths), 5, 1)
    assert np.array_equal(again.cells[0], paths[0][-1]) and again.found > found + 0.001
    assert samples["inputs"].shape == (len(samples["right"]), INPUTS)
    assert (samples["right"] & samples["allowed"]).any(axis=1).all()


def test_moves_that_lead_to_the_next_search_in_any_order_are_right(example):
    cells = np.array([0, 1, 10, 11, 11, 12, 13])  # on 9 x 9 cells; searches cell 11 = (2, 1)
    actions = np.array(
        [Action.RIGHT, Action.DOWN, Action.RIGHT, Action.SEARCH, Action.RIGHT, Action.RIGHT]
    )
    right = example.right_actions(cells, actions, 9)
    sets = [{Action(action) for action in np.flatnonzero(step)} for step in right]
    either = {Action.RIGHT, Action.DOWN}
    assert sets == [either, either, {Action.RIGHT}, {Action.SEARCH}, set(), set()]
