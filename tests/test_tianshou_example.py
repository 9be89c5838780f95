"""The Tianshou example: its transitions and masks, and short runs as users run it."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from trainer_examples import check_folder, check_table, interrupt, module, run

from DroneSwarmSearch import DroneSwarmSearch, training

pytest.importorskip("tianshou")

import torch
from tianshou.algorithm.multiagent.marl import MultiAgentOffPolicyAlgorithm
from tianshou.data import Batch, Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv

EXAMPLE = "train_tianshou"

pytestmark = pytest.mark.filterwarnings("default")  # from Tianshou


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module(EXAMPLE)


@pytest.mark.slow
def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    small = ("--num-envs", 4, "--episodes", 20, "--out", tmp_path)
    output = run(EXAMPLE, "--short", "--steps", 400, *small)
    check_table(output, "dqn", 20)
    trained = check_folder(tmp_path, "model.pt", "dqn")
    assert 400 <= trained[-1] < 410
    first = torch.load(tmp_path / "model.pt")
    output = run(EXAMPLE, "--resume", "--steps", 1000, *small)
    check_table(output, "dqn", 20)
    steps = check_folder(tmp_path, "model.pt", "dqn")
    assert steps[: len(trained)] == trained and 1000 <= steps[-1] < 1010
    second = torch.load(tmp_path / "model.pt")
    assert (first["steps"], second["steps"]) == (trained[-1], steps[-1])
    assert any(
        (first["dqn"][name] != second["dqn"][name]).any()
        for name in first["dqn"]
        if name.startswith("policy.")
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", "model.pt", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_tianshou", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()


def collect(example: ModuleType, steps: int) -> VectorReplayBuffer:
    """Transitions of random drones in one environment."""
    torch.manual_seed(0)
    np.random.seed(0)
    dqn = example.make_dqn()
    dqn.policy.set_eps_inference(1.0)
    agents = MultiAgentOffPolicyAlgorithm(algorithms=[dqn] * example.DRONES, env=example.make_env())
    envs = DummyVectorEnv([example.make_env])
    envs.seed(4)
    buffer = VectorReplayBuffer(1000, 1)
    collector = Collector(agents.policy, envs, buffer, exploration_noise=True)
    collector.reset()
    collector.collect(n_step=steps * example.DRONES)
    return buffer


def masks_in(buffer: VectorReplayBuffer, count: int) -> np.ndarray:
    return np.array([buffer.obs.mask[i] for i in range(count)], bool)


def test_rewards_over_one_transition_per_drone_are_the_environments(example: ModuleType) -> None:
    buffer = collect(example, 80)
    env = DroneSwarmSearch(**training.TRAINING_TASK)
    env.reset(seed=4)
    n = example.DRONES
    assert example.make_dqn().n_step % n == 0
    actions = buffer.act[: 80 * n].reshape(80, n)
    assert buffer.obs.agent_id[:n].tolist() == env.possible_agents
    ended = 0
    for step, chosen in enumerate(actions):
        if not env.agents:
            env.reset()
            ended += 1
        _, rewards, *_ = env.step(dict(zip(env.possible_agents, chosen.tolist(), strict=True)))
        for k, name in enumerate(env.possible_agents):
            indices = [step * n + k]
            while len(indices) < n and not buffer.done[indices[-1]]:
                indices.append(indices[-1] + 1)
            total = buffer.rew[indices, k].sum() / example.REWARD_SCALE
            assert total == pytest.approx(rewards[name], rel=1e-12)
            last = indices[-1]
            if not buffer.done[last] and last + 1 < 80 * n:  # the same drone is next
                assert buffer.obs.agent_id[last + 1] == name
                assert (buffer.obs_next.obs[last] == buffer.obs.obs[last + 1]).all()
    assert ended > 0


def test_random_drones_respect_the_masks(example: ModuleType) -> None:
    buffer = collect(example, 60)
    masks = masks_in(buffer, 120)
    assert masks[np.arange(120), buffer.act[:120].astype(int)].all()
    assert not masks.all()


def test_the_trained_policy_gets_the_masks_of_training(example: ModuleType) -> None:
    buffer = collect(example, 60)
    received = []

    class Policy:
        def eval(self) -> Policy:
            return self

        def __call__(self, batch: Batch) -> Batch:
            received.append(batch.obs.mask)
            return Batch(act=np.zeros(len(batch.obs.obs), int))

    dqn = type("DQN", (), {"policy": Policy()})()
    masks = masks_in(buffer, 120)
    shown = {"observation": buffer.obs.obs[:120], "action_mask": masks.astype(np.int8)}
    example.TrainedPolicy(dqn)(shown)
    assert (received[0] == masks).all()


def test_the_trained_policy_returns_an_allowed_action_per_drone(example: ModuleType) -> None:
    buffer = collect(example, 60)
    masks = masks_in(buffer, 120)
    shown = {"observation": buffer.obs.obs[:120], "action_mask": masks.astype(np.int8)}
    actions = example.TrainedPolicy(example.make_dqn())(shown)
    assert actions.shape == (120,) and actions.dtype.kind == "i"
    assert masks[np.arange(120), actions].all()
