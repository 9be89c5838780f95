"""The parts of the example that trains the policy "ppo"."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from trainer_examples import module

from DroneSwarmSearch import Action, Drift, Person, Scenario
from DroneSwarmSearch.policies.arrivals import INPUTS
from DroneSwarmSearch.policies.ppo import Network

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module("train_ppo")


ExpectedSearches: Any = module("expected_searches").ExpectedSearches


def searches_of(limit: int = 20, detection: float = 0.7, count: int = 6) -> Any:
    person = Person([Drift((4, 4), vector=(0.3, -0.2), diffusion=0.3)], detection)
    scenario = Scenario(grid_size=9, n_drones=3, timestep_limit=limit, persons=[person])
    return ExpectedSearches([scenario] * count, [[(0, 0), (4, 7), (8, 1)]] * count)


def test_the_untrained_agent_is_greedy(example: ModuleType) -> None:
    """It goes where the best cell on arrival is, and searches where no better one is left."""
    torch.manual_seed(0)
    agent, batch = example.Agent(), searches_of()
    logits = agent.get_logits(torch.from_numpy(batch.inputs().reshape(-1, INPUTS)))
    best = logits.detach().numpy().argmax(axis=1).reshape(6, 3)
    assert set(best[:, 0]) <= {Action.RIGHT, Action.DOWN}
    assert set(best[:, 1]) == {Action.UP}
    assert set(best[:, 2]) <= {Action.LEFT, Action.DOWN}


def test_advantages_are_sums_of_rewards_without_a_critic_and_a_discount(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(example, "GAMMA", 1.0)
    monkeypatch.setattr(example, "GAE_LAMBDA", 1.0)
    monkeypatch.setattr(example, "TEAM", 0.5)
    rng = np.random.default_rng(0)
    steps = [
        {"rewards": rng.random(4), "values": np.zeros(4), "unfound": np.full(4, 0.5)}
        for _ in range(7)
    ]
    data = example.with_advantages(steps, np.ones(4), 2)
    rewards = np.array([each["rewards"] for each in steps])
    expected = rewards[::-1].cumsum(axis=0)[::-1] + 1.0
    teammates = expected[:, [1, 0, 3, 2]]
    assert np.allclose(data["advantages"], (expected + 0.5 * teammates).reshape(-1))
    assert np.allclose(data["returns"], expected.reshape(-1) / 0.5)


def test_batches_that_end_are_replaced(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(example, "NUM_STEPS", 5)
    monkeypatch.setattr(example, "new_batch", lambda rng: searches_of(limit=9, count=2))
    torch.manual_seed(0)
    batches, rng = [searches_of(limit=3)], np.random.default_rng(0)
    data, ended, count = example.rollout(example.Agent(), batches, rng)
    assert [batch.step for batch in ended] == [3] and batches[0].step == 2
    assert count == 3 * 6 + 2 * 2
    assert {len(each) for each in data.values()} == {3 * count}
    assert all(bool(torch.isfinite(each.float()).all()) for each in data.values())


def test_the_package_runs_the_trained_network(example: ModuleType, tmp_path: Path) -> None:
    torch.manual_seed(3)
    agent = example.Agent()
    for parameter in agent.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    obs = torch.rand(7, INPUTS)
    agent.network().save(tmp_path / "weights.npz")
    logits = Network.load(tmp_path / "weights.npz")(obs.numpy())
    assert np.allclose(logits, agent.get_logits(obs).detach().numpy(), atol=1e-4)


def test_updates_make_rewarded_actions_more_likely(example: ModuleType) -> None:
    torch.manual_seed(4)
    agent = example.Agent()
    optimizer = torch.optim.Adam(agent.parameters())
    obs = torch.rand(400, INPUTS)
    actions = torch.arange(400) % example.NUM_ACTIONS

    def logprobs() -> Any:
        with torch.no_grad():
            return agent.get_logits(obs).log_softmax(dim=1).gather(1, actions[:, None])[:, 0]

    first = before = logprobs()
    data = {
        "obs": obs,
        "actions": actions,
        "masks": torch.ones(400, example.NUM_ACTIONS, dtype=torch.bool),
        "advantages": (actions == Action.SEARCH).float(),
        "returns": torch.zeros(400),
        "unfound": torch.ones(400),
    }
    example.update(agent, optimizer, {**data, "logprobs": before}, 1.0, only_critic=True)
    assert torch.equal(logprobs(), before)
    for _ in range(5):
        example.update(agent, optimizer, {**data, "logprobs": logprobs()}, 1.0)
    more_likely = logprobs() > first
    assert more_likely[actions == Action.SEARCH].all()
