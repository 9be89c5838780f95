"""The RLlib example on a cluster, and what its network gets."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from trainer_examples import EXAMPLES, python, rows

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        any(importlib.util.find_spec(name) is None for name in ("ray", "torch", "lz4")),
        reason="ray[rllib] is not installed",
    ),
]

EXAMPLE = EXAMPLES / "train_rllib.py"


CLUSTER = """
import subprocess, sys
from ray.cluster_utils import Cluster

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
cluster.add_node(num_cpus=1)
subprocess.run([sys.executable, *sys.argv[1:], "--address", cluster.address], check=True)
cluster.shutdown()
"""


def test_it_trains_on_a_cluster_of_two_nodes(tmp_path: Path) -> None:
    """Both nodes are on this machine and have one CPU each, enough for one runner."""
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER, "utf-8")
    folder = tmp_path / "run"
    short = ("--steps", 2_000, "--episodes", 20, "--num-env-runners", 2, "--num-envs", 2)
    python(script, EXAMPLE, "--out", folder, *short)
    assert rows(folder / "evaluation.csv")[0]["policy"] == "rllib-ppo"


EPISODES = """
import argparse, runpy, sys
import numpy as np, torch
from ray.rllib.core.columns import Columns
from ray.rllib.core import DEFAULT_MODULE_ID
from DroneSwarmSearch import Action
from DroneSwarmSearch.adapters import rllib

example = runpy.run_path(sys.argv[1])
options = argparse.Namespace(steps=100, num_env_runners=0, num_envs=1, batch=100, seed=5)
runner = example["build_algorithm"](options).env_runner

module = runner.module
original = module.forward_exploration
inputs, forced = [], None

def forward(batch, **kwargs):
    inputs.append({key: array.numpy().copy() for key, array in batch[Columns.OBS].items()})
    if forced is not None:
        logits = torch.full((2, 6), -1e9)
        logits[:, forced] = 0.0
        return {Columns.ACTION_DIST_INPUTS: logits}
    return original(batch, **kwargs)

module.forward_exploration = forward
played = runner.sample(num_episodes=6)
forced = Action.IDLE
idle = runner.sample(num_episodes=2)
forced = Action.LEFT  # off the grid, despite the mask
crashed = runner.sample(num_episodes=2)

envs = rllib.DroneBatch({**example["ENV_CONFIG"], "num_envs": 2})
inputs = iter(inputs)
for first in (*played[::2], idle[0], crashed[0]):
    episodes = [*played, *idle, *crashed]
    place = next(i for i, each in enumerate(episodes) if each is first)
    agents = episodes[place : place + 2]
    seeded = first in (played[0], idle[0], crashed[0])
    observations, _ = envs.reset(seed=5 if seeded else None)
    if not seeded:
        next(inputs)  # the step in which the next episode begins
    for step in range(len(first)):
        batch = next(inputs)
        for key, array in observations.items():
            assert np.array_equal(batch[key], array)
            for k, agent in enumerate(agents):
                assert np.array_equal(agent.get_observations(step)[key], array[k])
        actions = np.array([agent.get_actions(step) for agent in agents])
        observations, rewards, terminated, _, infos = envs.step(actions)
        assert [agent.get_rewards(step) for agent in agents] == rewards.tolist()
    for agent, done, success in zip(agents, terminated, infos["is_success"]):
        assert agent.is_terminated == done and agent.get_infos(-1)["is_success"] == success
assert next(inputs, None) is None
assert (idle[0].is_terminated, len(idle[0])) == (True, 50)
assert (crashed[0].is_terminated, len(crashed[0])) == (True, 1)
ended = [*played, *idle, *crashed]
rate = runner.get_metrics()["success_rate"].peek()
assert abs(rate - np.mean([each.get_infos(-1)["is_success"] for each in ended])) < 1e-9
print("equal")
"""


def test_the_network_gets_the_observations_masks_and_rewards_of_the_environment(
    tmp_path: Path,
) -> None:
    script = tmp_path / "episodes.py"
    script.write_text(EPISODES, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "equal"
