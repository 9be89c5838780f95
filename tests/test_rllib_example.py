"""The RLlib example: its environment and policy, and short runs as users run it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest
from trainer_examples import EXAMPLES, check_folder, check_table, interrupt, python, rows

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        any(importlib.util.find_spec(name) is None for name in ("ray", "torch", "lz4")),
        reason="ray[rllib] is not installed",
    ),
]

EXAMPLE = EXAMPLES / "train_rllib.py"
FEW = ("--num-envs", 2)  # so that episodes end during a short run
NAME, CHECKPOINT = "rllib-ppo", "checkpoint_*/algorithm_state.pkl"


def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = (EXAMPLE, "--short", "--out", folder, "--batch", 400, *FEW)
    check_table(python(*arguments, "--steps", 1_000), NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 1_000
    first = rows(folder / "curve.csv")
    assert len(first) == 3
    check_table(python(*arguments, "--steps", 2_000, "--resume"), NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 2_000
    curve = rows(folder / "curve.csv")
    assert curve[:3] == first
    assert 1_000 < int(curve[3]["steps"]) - 400 <= int(curve[2]["steps"]) + 64


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".new", "checkpoint_*", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_rllib", folder, moment, "--episodes", 5, *FEW)
    assert (folder / "evaluation.csv").exists()


def test_it_trains_with_remote_runners(tmp_path: Path) -> None:
    python(EXAMPLE, "--short", "--out", tmp_path, "--num-env-runners", 2, *FEW)
    assert check_folder(tmp_path, CHECKPOINT, NAME)[-1] >= 1_000


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
    python(script, EXAMPLE, "--short", "--out", folder, "--num-env-runners", 2, *FEW)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 1_000


EPISODES = """
import runpy, sys
import numpy as np, torch
from ray.rllib.core.columns import Columns
from ray.rllib.core import DEFAULT_MODULE_ID
from DroneSwarmSearch import Action, training
from DroneSwarmSearch.adapters import rllib

example = runpy.run_path(sys.argv[1])
parser = training.arguments("", steps=100, short=100)
options = parser.parse_args(["--out", sys.argv[2]])
options.num_env_runners, options.num_envs, options.batch = 0, 1, 100
runner = example["build_algorithm"](options, seed=5).env_runner

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
    assert python(script, EXAMPLE, tmp_path / "run").splitlines()[-1] == "equal"
