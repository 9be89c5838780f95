"""The one-file PPO, run as users run it, and its parts."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from trainer_examples import check_folder, check_table, interrupt, module, rows, run

from DroneSwarmSearch import Action
from DroneSwarmSearch.evaluation import search
from DroneSwarmSearch.policies.ppo import Network, PPOPolicy
from DroneSwarmSearch.rules import Ending
from DroneSwarmSearch.wrappers.crops import LENGTH

torch = pytest.importorskip("torch")

SEARCH = {"grid_size": 9, "n_drones": 3, "bayesian_update": True, "timestep_limit": 20}


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module("train_ppo")


@pytest.mark.slow
def test_it_trains_resumes_and_compares(tmp_path: Path, example: ModuleType) -> None:
    options = ("--short", "--out", tmp_path, "--episodes", 20)
    a_round = example.ROLLOUT * sum(others["num_swarms"] for _, others in example.FAMILY)
    output = run("train_ppo", *options)
    check_table(output, "ppo", 20)
    steps = check_folder(tmp_path, "checkpoint.pt", "ppo")
    assert steps == [a_round * (k + 1) for k in range(len(steps))]
    weights = tmp_path / "policy.npz"
    first = weights.read_bytes()
    run("train_ppo", *options, "--resume", "--steps", steps[-1] + 1)
    assert check_folder(tmp_path, "checkpoint.pt", "ppo") == [*steps, steps[-1] + a_round]
    assert weights.read_bytes() != first
    assert PPOPolicy(search("classic").scenario, weights)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as on POSIX")
@pytest.mark.parametrize("moment", ["", ".policy.*", ".checkpoint.*", "checkpoint.pt", "curve.csv"])
def test_ctrl_c_says_what_is_there(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_ppo", folder, moment, "--steps", 20_000, "--episodes", 5)
    assert int(rows(folder / "curve.csv")[-1]["steps"]) >= 20_000
    assert (folder / "evaluation.csv").exists()


def swarms_of(example: ModuleType, **changes: Any) -> Any:
    return example.Swarms(5, **{**SEARCH, "num_swarms": 6, **changes})


def test_rewards_are_the_chances_of_the_searches(example: ModuleType) -> None:
    """Over many steps as many persons are found as the chances say, within five deviations."""
    swarms = swarms_of(example, num_swarms=400, probability_of_detection=0.7)
    rng, tally = np.random.default_rng(0), example.Tally()
    chances, spread, found = 0.0, 0.0, 0
    for _ in range(40):
        scores = rng.normal(size=(swarms.env.num_envs, example.ACTIONS)).astype(np.float32)
        scores[:, Action.SEARCH] += 1.0
        data = swarms.step(scores, rng, tally)
        paid = data["rewards"][data["real"]].astype(np.float64)
        assert (paid[data["actions"][data["real"]] != Action.SEARCH] == 0).all()
        chances, spread = chances + paid.sum(), spread + (paid * (1 - paid)).sum()
        found += int((swarms.batch.endings == Ending.FOUND).sum())
    assert found > 100
    assert abs(found - chances) < 5 * np.sqrt(spread)


def test_drones_never_collide_nor_leave_while_they_learn(example: ModuleType) -> None:
    swarms = swarms_of(example, grid_size=3)
    rng, tally = np.random.default_rng(1), example.Tally()
    harmless = (0, Ending.FOUND, Ending.TIME_LIMIT)
    for _ in range(100):
        swarms.step(np.zeros((swarms.env.num_envs, example.ACTIONS), np.float32), rng, tally)
        assert np.isin(swarms.batch.endings, harmless).all()
    assert len(tally.found) > 15


def test_advantages_are_those_of_the_rewards_to_come(
    example: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a critic that knows nothing and no discount they are plain sums of rewards."""
    monkeypatch.setattr(example, "DISCOUNT", 1.0)
    monkeypatch.setattr(example, "TRACE", 1.0)
    monkeypatch.setattr(example, "ROLLOUT", 30)
    torch.manual_seed(0)
    swarms = swarms_of(example)
    agent = example.Agent(swarms.seen.shape[1])
    for parameter in agent.critic.parameters():
        parameter.data.zero_()
    steps: list[dict[str, np.ndarray]] = []
    step = swarms.step

    def noted(*arguments: Any) -> dict[str, np.ndarray]:
        steps.append(step(*arguments))
        return steps[-1]

    swarms.step = noted
    data = example.rollout(agent, [swarms], np.random.default_rng(0), example.Tally())
    rewards, over, real = (
        np.stack([step[key] for step in steps]) for key in ("rewards", "over", "real")
    )
    assert over.any() and not real.all()
    wanted = np.zeros(rewards.shape)
    for slot in range(rewards.shape[1]):
        for begin in range(len(steps)):
            ends = np.flatnonzero(over[begin:, slot])
            last = begin + int(ends[0]) + 1 if len(ends) else len(steps)
            wanted[begin, slot] = rewards[begin:last, slot].sum()
    assert data["real"].tolist() == real.reshape(-1).tolist()
    for key in ("advantages", "returns"):
        values = data[key].numpy().reshape(wanted.shape)
        assert np.allclose(values[real], wanted[real], atol=1e-6)


def test_the_package_runs_the_network_as_it_was_trained(
    example: ModuleType, tmp_path: Path
) -> None:
    torch.manual_seed(3)
    agent = example.Agent(LENGTH)
    seen = torch.rand(7, LENGTH)
    agent.network().save(tmp_path / "weights.npz")
    scores = Network.load(tmp_path / "weights.npz")(seen.numpy())
    assert np.allclose(scores, agent.actor(seen).detach().numpy(), atol=1e-6)


def test_updates_make_rewarded_actions_likelier(example: ModuleType) -> None:
    torch.manual_seed(4)
    agent = example.Agent(LENGTH)
    optimiser = torch.optim.Adam(agent.parameters())
    seen = torch.rand(400, LENGTH)
    actions = torch.arange(400) % example.ACTIONS
    masks = torch.ones(400, example.ACTIONS, dtype=torch.bool)

    def logarithms() -> Any:
        with torch.no_grad():
            scores = agent.actor(seen).log_softmax(dim=1)
        return scores.gather(1, actions[:, None])[:, 0]

    before = logarithms()
    data = {
        "seen": seen,
        "actions": actions,
        "masks": masks,
        "logarithms": before,
        "advantages": (actions == Action.SEARCH).float(),
        "returns": torch.zeros(400),
        "real": torch.ones(400, dtype=torch.bool),
    }
    for _ in range(5):
        example.update(agent, optimiser, {**data, "logarithms": logarithms()}, 1.0)
    more = logarithms() > before
    assert more[actions == Action.SEARCH].all()
    assert not more[actions != Action.SEARCH].any()


def test_the_sampler_draws_searches_within_the_limits(example: ModuleType) -> None:
    for size, others in example.FAMILY:
        parameters = {**size, **others, "num_swarms": 200}
        swarms = example.Swarms(0, sampler=example.sampler(**size), **parameters)
        drawn = swarms.batch.parameters
        assert len(np.unique(drawn["vector"], axis=0)) == 200
        assert np.abs(drawn["vector"]).max() <= 0.5
        cells = drawn["drones_positions"]
        assert all(len(np.unique(swarm, axis=0)) == size["n_drones"] for swarm in cells)
        assert np.ptp(drawn["person_initial_position"], axis=0).min() > size["grid_size"] // 2
