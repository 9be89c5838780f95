"""The parts of the training loop in one file."""

import pytest
from trainer_examples import module

from DroneSwarmSearch import Action

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def example():
    made = module("train_own_loop")
    made.SWARMS = 6
    return made


def test_rollouts_hold_masked_actions_and_expected_rewards(example):
    torch.manual_seed(0)
    envs = example.make_envs(6)
    agent = example.Agent()
    data = {}
    ended = []
    observations, _ = envs.reset(seed=0)
    total = 0.0
    for _ in range(3):  # an episode has 80 steps
        observations, some = example.rollout(envs, agent, data, observations)
        ended += some
        assert data["masks"].gather(2, data["actions"][..., None]).all()
        assert (data["rewards"][data["actions"] != Action.SEARCH] == 0).all()
        total += float(data["rewards"].sum())
    assert len(ended) == example.SWARMS * example.DRONES
    first = sum(ended) / example.DRONES  # success of the first episodes; others have begun
    assert 0 < first <= total < first + example.SWARMS


def test_returns_are_sums_of_rewards_until_the_end(example, monkeypatch):
    """Without a discount, and whatever the critic says."""
    monkeypatch.setattr(example, "GAMMA", 1.0)
    monkeypatch.setattr(example, "GAE_LAMBDA", 1.0)
    rewards = torch.rand(example.NUM_STEPS, 2)
    dones = torch.zeros(example.NUM_STEPS, 2).bool()
    dones[4, 0] = True
    data = {"rewards": rewards, "dones": dones, "values": torch.rand(example.NUM_STEPS, 2)}
    example.add_advantages(data, torch.tensor([5.0, 7.0]))
    expected = rewards.flip(0).cumsum(0).flip(0) + torch.tensor([5.0, 7.0])
    expected[:5, 0] = rewards[:5, 0].flip(0).cumsum(0).flip(0)
    assert torch.allclose(data["returns"], expected, atol=1e-5)
    assert float(data["advantages"].square().mean()) == pytest.approx(1.0, rel=1e-4)
