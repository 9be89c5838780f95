"""The example for Tianshou, run as users run it, and what its choice of algorithm rests on."""

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

pytestmark = pytest.mark.filterwarnings("default")  # Tianshou's own


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module(EXAMPLE)


@pytest.mark.slow
def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    small = ("--num-envs", 4, "--episodes", 20, "--out", tmp_path)
    output = run(EXAMPLE, "--short", "--steps", 400, *small)
    check_table(output, "dqn", 20)
    begun = check_folder(tmp_path, "model.pt", "dqn")
    assert 400 <= begun[-1] < 410
    first = torch.load(tmp_path / "model.pt")
    output = run(EXAMPLE, "--resume", "--steps", 1000, *small)
    check_table(output, "dqn", 20)
    steps = check_folder(tmp_path, "model.pt", "dqn")
    assert steps[: len(begun)] == begun and 1000 <= steps[-1] < 1010
    second = torch.load(tmp_path / "model.pt")
    assert (first["steps"], second["steps"]) == (begun[-1], steps[-1])
    assert any(
        (first["dqn"][name] != second["dqn"][name]).any()
        for name in first["dqn"]
        if name.startswith("policy.")
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as on POSIX")
@pytest.mark.parametrize("moment", ["", "model.pt", "curve.csv"])
def test_ctrl_c_says_what_is_there(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_tianshou", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()


def collected(example: ModuleType, steps: int) -> tuple[VectorReplayBuffer, Collector]:
    """Transitions of random drones in one search."""
    torch.manual_seed(0)
    np.random.seed(0)
    dqn = example.learner()
    dqn.policy.set_eps_inference(1.0)
    swarm = MultiAgentOffPolicyAlgorithm(algorithms=[dqn] * example.DRONES, env=example.search())
    envs = DummyVectorEnv([example.search])
    envs.seed(4)
    buffer = VectorReplayBuffer(1000, 1)
    collector = Collector(swarm.policy, envs, buffer, exploration_noise=True)
    collector.reset()
    collector.collect(n_step=steps * example.DRONES)
    return buffer, collector


def test_a_return_over_a_turn_of_every_drone_is_the_environments(example: ModuleType) -> None:
    """The rewards of each drone, added up over as many choices as there are drones."""
    buffer, _ = collected(example, 80)
    env = DroneSwarmSearch(**training.TRAINING_TASK)
    env.reset(seed=4)
    n = example.DRONES
    assert example.learner().n_step % n == 0
    actions = buffer.act[: 80 * n].reshape(80, n)
    assert buffer.obs.agent_id[:n].tolist() == env.possible_agents
    ended = 0
    for step, chosen in enumerate(actions):
        if not env.agents:
            env.reset()
            ended += 1
        _, rewards, *_ = env.step(dict(zip(env.possible_agents, chosen.tolist(), strict=True)))
        for k, name in enumerate(env.possible_agents):
            turns = [step * n + k]
            while len(turns) < n and not buffer.done[turns[-1]]:
                turns.append(turns[-1] + 1)
            paid = buffer.rew[turns, k].sum() / example.SCALE
            assert paid == pytest.approx(rewards[name], rel=1e-12)
            last = turns[-1]
            if not buffer.done[last] and last + 1 < 80 * n:  # then it is the same drone's turn
                assert buffer.obs.agent_id[last + 1] == name
                assert (buffer.obs_next.obs[last] == buffer.obs.obs[last + 1]).all()
    assert ended > 0


def test_random_drones_keep_to_the_masks(example: ModuleType) -> None:
    buffer, _ = collected(example, 60)
    masks = np.array([buffer.obs.mask[i] for i in range(120)], bool)
    assert masks[np.arange(120), buffer.act[:120].astype(int)].all()
    assert not masks.all()


def test_masks_read_from_observations_are_those_of_training(example: ModuleType) -> None:
    buffer, _ = collected(example, 60)
    asked = []

    class Policy:
        def eval(self) -> Policy:
            return self

        def __call__(self, batch: Batch) -> Batch:
            asked.append(batch.obs.mask)
            return Batch(act=np.zeros(len(batch.obs.obs), int))

    learner = type("Learner", (), {"policy": Policy()})()
    example.Trained(learner)(buffer.obs.obs[:120])
    assert (asked[0] == np.array([buffer.obs.mask[i] for i in range(120)], bool)).all()


def test_the_policy_returns_allowed_actions_for_every_drone(example: ModuleType) -> None:
    buffer, _ = collected(example, 60)
    actions = example.Trained(example.learner())(buffer.obs.obs[:120])
    assert actions.shape == (120,) and actions.dtype.kind == "i"
    assert np.array([buffer.obs.mask[i] for i in range(120)], bool)[np.arange(120), actions].all()
