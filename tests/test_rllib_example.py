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
FEW = ("--num-envs-per-env-runner", 2)  # so that episodes end during a short run
NAME, CHECKPOINT = "rllib-ppo", "checkpoint_*/algorithm_state.pkl"


def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = (EXAMPLE, "--short", "--out", folder, "--batch", 400)
    check_table(python(*arguments), NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 1_000
    first = rows(folder / "curve.csv")
    assert len(first) == 3
    check_table(python(*arguments, "--steps", 2_000, "--resume"), NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 2_000
    curve = rows(folder / "curve.csv")
    assert curve[:3] == first
    assert 1_000 < int(curve[3]["steps"]) - 400 <= int(curve[2]["steps"]) + 20


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
from DroneSwarmSearch import Action, training
from DroneSwarmSearch.vector import DroneVectorEnv

example = runpy.run_path(sys.argv[1])
parser = training.arguments("", steps=100, short=100)
options = parser.parse_args(["--out", sys.argv[2]])
options.num_env_runners, options.num_envs_per_env_runner, options.batch = 0, 1, 100
runner = example["build_algorithm"](options, seed=5).env_runner

module = runner.module["drone"]
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
free = runner.sample(num_episodes=3)
forced = Action.IDLE
[idle] = runner.sample(num_episodes=1)
forced = Action.LEFT  # off the grid, despite the mask
[crashed] = runner.sample(num_episodes=1)

envs = DroneVectorEnv(1, observation="flat", **training.TRAINING_TASK)
inputs, first_seed = iter(inputs), example["SEED_STRIDE"] + 5
for episode in [*free, idle, crashed]:
    seeded = episode in (free[0], idle, crashed)
    observations, _ = envs.reset(seed=first_seed if seeded else None)
    agents = [episode.agent_episodes[name] for name in ("drone0", "drone1")]
    for step in range(len(episode)):
        for agent, expected in zip(agents, observations):
            shown = agent.get_observations(step)["observations"]
            assert shown.tobytes() == expected.tobytes()
        batch = next(inputs)
        order = [0, 1] if np.array_equal(batch["observations"], observations) else [1, 0]
        masks = envs.action_masks(right_of_way=True)
        assert batch["observations"].tobytes() == observations[order].tobytes()
        assert batch["action_mask"].tolist() == masks[order].tolist()
        actions = np.array([agent.get_actions(step) for agent in agents])
        observations, rewards, terminated, truncated, _ = envs.step(actions)
        paid = [agent.get_rewards(step) for agent in agents]
        assert paid == (rewards * example["REWARD_SCALE"]).tolist()
    for agent, expected, done in zip(agents, observations, terminated):
        assert agent.get_observations(-1)["observations"].tobytes() == expected.tobytes()
        assert agent.is_terminated == done
    assert episode.is_terminated == terminated[0]
assert next(inputs, None) is None
assert (idle.is_terminated, len(idle)) == (True, 50)
assert (crashed.is_terminated, len(crashed)) == (True, 1)
assert runner.get_metrics()["episodes"].peek() == 5
print("equal")
"""


def test_the_network_gets_the_observations_masks_and_rewards_of_the_environment(
    tmp_path: Path,
) -> None:
    script = tmp_path / "episodes.py"
    script.write_text(EPISODES, "utf-8")
    assert python(script, EXAMPLE, tmp_path / "run").splitlines()[-1] == "equal"


SEEDS = """
import runpy, sys
from ray.rllib.env.env_context import EnvContext

example = runpy.run_path(sys.argv[1])
envs = [example["SearchEnv"](EnvContext({}, worker_index=index)) for index in (1, 2)]
trajectories = []
for env in envs:
    env.reset(seed=2)  # as RLlib seeds the first runner's second environment and vice versa
    search = env.par_env.unwrapped
    cells = []
    while search.agents:
        env.step({"drone0": 5, "drone1": 5})
        cells.append(search.frame().persons)
    trajectories.append(cells)
assert trajectories[0] != trajectories[1]
print("different")
"""


def test_runners_play_different_episodes(tmp_path: Path) -> None:
    script = tmp_path / "seeds.py"
    script.write_text(SEEDS, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "different"
