"""The one-file PPO example: its parts, and a short run as users run it."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from trainer_examples import check_folder, check_table, interrupt, module, rows, run

from DroneSwarmSearch import Action, Ending
from DroneSwarmSearch.evaluation import search
from DroneSwarmSearch.policies.ppo import Network, PPOPolicy
from DroneSwarmSearch.wrappers.crops import LENGTH

torch = pytest.importorskip("torch")

SEARCH = {"grid_size": 9, "n_drones": 3, "bayesian_update": True, "timestep_limit": 20}


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module("train_ppo")


@pytest.mark.slow
def test_it_trains_resumes_and_compares(tmp_path: Path, example: ModuleType) -> None:
    options = ("--short", "--out", tmp_path, "--episodes", 20)
    swarms = sum(parameters["num_swarms"] for _, parameters in example.BATCHES)
    steps_per_rollout = example.NUM_STEPS * swarms
    output = run("train_ppo", *options)
    check_table(output, "ppo", 20)
    steps = check_folder(tmp_path, "checkpoint.pt", "ppo")
    assert steps == [steps_per_rollout * (k + 1) for k in range(len(steps))]
    weights = tmp_path / "policy.npz"
    first = weights.read_bytes()
    run("train_ppo", *options, "--resume", "--steps", steps[-1] + 1)
    resumed = check_folder(tmp_path, "checkpoint.pt", "ppo")
    assert resumed == [*steps, steps[-1] + steps_per_rollout]
    assert weights.read_bytes() != first
    assert PPOPolicy(search("classic").scenario, weights)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".policy.*", ".checkpoint.*", "checkpoint.pt", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_ppo", folder, moment, "--steps", 20_000, "--episodes", 5)
    assert int(rows(folder / "curve.csv")[-1]["steps"]) >= 20_000
    assert (folder / "evaluation.csv").exists()


def searches_of(example: ModuleType, **changes: Any) -> Any:
    return example.Searches(5, **{**SEARCH, "num_swarms": 6, **changes})


def test_rewards_are_probabilities_of_success(example: ModuleType) -> None:
    """The number of finds is the sum of the rewards, within five standard deviations."""
    searches = searches_of(example, num_swarms=400, probability_of_detection=0.7)
    rng, statistics = np.random.default_rng(0), example.Statistics()
    expected, variance, found = 0.0, 0.0, 0
    for _ in range(40):
        logits = rng.normal(size=(searches.envs.num_envs, example.NUM_ACTIONS))
        logits[:, Action.SEARCH] += 1.0
        data = searches.step(logits.astype(np.float32), rng, statistics)
        rewards = data["rewards"][data["valid"]].astype(np.float64)
        assert (rewards[data["actions"][data["valid"]] != Action.SEARCH] == 0).all()
        expected += rewards.sum()
        variance += (rewards * (1 - rewards)).sum()
        found += int((searches.batch.endings == Ending.FOUND).sum())
    assert found > 100
    assert abs(found - expected) < 5 * np.sqrt(variance)


def test_drones_never_crash_in_training(example: ModuleType) -> None:
    searches = searches_of(example, grid_size=3)
    rng, statistics = np.random.default_rng(1), example.Statistics()
    logits = np.zeros((searches.envs.num_envs, example.NUM_ACTIONS), np.float32)
    for _ in range(100):
        searches.step(logits, rng, statistics)
        assert np.isin(searches.batch.endings, (0, Ending.FOUND, Ending.TIME_LIMIT)).all()
    assert len(statistics.found) > 15


def test_advantages_are_sums_of_rewards_without_a_critic_and_a_discount(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(example, "GAMMA", 1.0)
    monkeypatch.setattr(example, "GAE_LAMBDA", 1.0)
    monkeypatch.setattr(example, "NUM_STEPS", 30)
    torch.manual_seed(0)
    searches = searches_of(example)
    agent = example.Agent(searches.obs.shape[1])
    for parameter in agent.critic.parameters():
        parameter.data.zero_()
    steps: list[dict[str, np.ndarray]] = []
    step = searches.step

    def recorded(*arguments: Any) -> dict[str, np.ndarray]:
        steps.append(step(*arguments))
        return steps[-1]

    searches.step = recorded
    data = example.rollout(agent, [searches], np.random.default_rng(0), example.Statistics())
    rewards, dones, valid = (
        np.stack([step[key] for step in steps]) for key in ("rewards", "dones", "valid")
    )
    assert dones.any() and not valid.all()
    expected = np.zeros(rewards.shape)
    for drone in range(rewards.shape[1]):
        for start in range(len(steps)):
            ends = np.flatnonzero(dones[start:, drone])
            stop = start + int(ends[0]) + 1 if len(ends) else len(steps)
            expected[start, drone] = rewards[start:stop, drone].sum()
    assert data["valid"].tolist() == valid.reshape(-1).tolist()
    for key in ("advantages", "returns"):
        values = data[key].numpy().reshape(expected.shape)
        assert np.allclose(values[valid], expected[valid], atol=1e-6)


def test_the_package_runs_the_trained_network(example: ModuleType, tmp_path: Path) -> None:
    torch.manual_seed(3)
    agent = example.Agent(LENGTH)
    obs = torch.rand(7, LENGTH)
    agent.network().save(tmp_path / "weights.npz")
    logits = Network.load(tmp_path / "weights.npz")(obs.numpy())
    assert np.allclose(logits, agent.actor(obs).detach().numpy(), atol=1e-6)


def test_updates_make_rewarded_actions_more_likely(example: ModuleType) -> None:
    torch.manual_seed(4)
    agent = example.Agent(LENGTH)
    optimizer = torch.optim.Adam(agent.parameters())
    obs = torch.rand(400, LENGTH)
    actions = torch.arange(400) % example.NUM_ACTIONS

    def logprobs() -> Any:
        with torch.no_grad():
            return agent.actor(obs).log_softmax(dim=1).gather(1, actions[:, None])[:, 0]

    before = logprobs()
    data = {
        "obs": obs,
        "actions": actions,
        "masks": torch.ones(400, example.NUM_ACTIONS, dtype=torch.bool),
        "advantages": (actions == Action.SEARCH).float(),
        "returns": torch.zeros(400),
        "valid": torch.ones(400, dtype=torch.bool),
    }
    for _ in range(5):
        example.update(agent, optimizer, {**data, "logprobs": logprobs()}, 1.0)
    more_likely = logprobs() > before
    assert more_likely[actions == Action.SEARCH].all()
    assert not more_likely[actions != Action.SEARCH].any()


def test_the_sampler_draws_valid_searches(example: ModuleType) -> None:
    for size, others in example.BATCHES:
        parameters = {**size, **others, "num_swarms": 200}
        searches = example.Searches(0, sampler=example.sampler(**size), **parameters)
        drawn = searches.batch.parameters
        assert len(np.unique(drawn["vector"], axis=0)) == 200
        assert np.abs(drawn["vector"]).max() <= 0.5
        cells = drawn["drones_positions"]
        assert all(len(np.unique(swarm, axis=0)) == size["n_drones"] for swarm in cells)
        assert np.ptp(drawn["person_initial_position"], axis=0).min() > size["grid_size"] // 2
