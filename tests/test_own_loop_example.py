"""The parts of the training loop in one file."""

import pytest
from trainer_examples import module

from DroneSwarmSearch import Action

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def example():
    return module("train_own_loop")


SWARMS = 6


def test_rollouts_hold_masked_actions_and_expected_rewards(example):
    torch.manual_seed(0)
    envs = example.make_envs(SWARMS, example.RANDOM_SEARCHES)
    agent = example.Agent()
    data = {}
    ended = []
    observations, _ = envs.reset(seed=0)
    total = 0.0
    for _ in range(3):  # an episode has 80 steps
        observations, some = example.rollout(envs, agent, data, observations, 0.99)
        ended += some
        assert data["masks"].gather(2, data["actions"][..., None]).all()
        assert (data["rewards"][data["actions"] != Action.SEARCH] == 0).all()
        total += float(data["rewards"].sum())
    assert len(ended) == SWARMS * example.DRONES
    first = sum(ended) / example.DRONES  # success of the first episodes; others have begun
    assert 0 < first <= total < first + SWARMS


def test_the_success_with_several_persons_is_the_share_found(example):
    torch.manual_seed(0)
    envs = example.make_envs(SWARMS, example.TASKS["wreck"].training)
    observations, _ = envs.reset(seed=0)
    _, ended = example.rollout(envs, example.Agent(), {}, observations, 0.99)
    _, more = example.rollout(envs, example.Agent(), {}, observations, 0.99)
    shares = {round(6 * share, 6) for share in ended + more}
    assert shares <= {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0}
    assert len(ended + more) >= 4 * SWARMS


def test_returns_are_sums_of_rewards_until_the_end(example, monkeypatch):
    """Without a discount, and whatever the critic says."""
    monkeypatch.setattr(example, "GAE_LAMBDA", 1.0)
    rewards = torch.rand(example.NUM_STEPS, 2)
    dones = torch.zeros(example.NUM_STEPS, 2).bool()
    dones[4, 0] = True
    data = {"rewards": rewards, "dones": dones, "values": torch.rand(example.NUM_STEPS, 2)}
    example.add_advantages(data, torch.tensor([5.0, 7.0]), gamma=1.0)
    expected = rewards.flip(0).cumsum(0).flip(0) + torch.tensor([5.0, 7.0])
    expected[:5, 0] = rewards[:5, 0].flip(0).cumsum(0).flip(0)
    assert torch.allclose(data["returns"], expected, atol=1e-5)
    assert float(data["advantages"].square().mean()) == pytest.approx(1.0, rel=1e-4)
