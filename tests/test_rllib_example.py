"""The example for Ray RLlib, run as users run it: in processes of its own."""

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
FEW = ("--num-envs-per-env-runner", 2)  # so that episodes end in a short run
NAME, CHECKPOINT = "rllib-ppo", "checkpoint/algorithm_state.pkl"


def test_it_trains_and_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    printed = python(EXAMPLE, "--short", "--out", folder, "--batch", 400)
    check_table(printed, NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 1_000
    first = rows(folder / "curve.csv")
    assert len(first) == 3
    printed = python(
        EXAMPLE, "--short", "--out", folder, "--batch", 400, "--steps", 2_000, "--resume"
    )
    check_table(printed, NAME, 50)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 2_000
    both = rows(folder / "curve.csv")
    assert both[:3] == first
    assert 1_000 < int(both[3]["steps"]) - 400 <= int(both[2]["steps"]) + 20


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as on POSIX")
@pytest.mark.parametrize("moment", ["", ".checkpoint.new", "checkpoint", "curve.csv"])
def test_ctrl_c_says_what_is_there(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_rllib", folder, moment, "--episodes", 5, *FEW)
    assert (folder / "evaluation.csv").exists()


def test_remote_runners_play(tmp_path: Path) -> None:
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


def test_a_cluster_of_two_nodes_plays(tmp_path: Path) -> None:
    """Two nodes of one processor each, on this machine: each has room for one runner."""
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER, "utf-8")
    folder = tmp_path / "run"
    python(script, EXAMPLE, "--short", "--out", folder, "--num-env-runners", 2, *FEW)
    assert check_folder(folder, CHECKPOINT, NAME)[-1] >= 1_000


EPISODES = """
import runpy, sys
from pathlib import Path
import numpy as np, torch
from ray.rllib.core.columns import Columns
from DroneSwarmSearch import Action, training
from DroneSwarmSearch.vector import DroneVectorEnv

example = runpy.run_path(sys.argv[1])
parser = training.arguments("", steps=100, short=100)
options = parser.parse_args(["--out", sys.argv[2]])
options.num_env_runners, options.num_envs_per_env_runner, options.batch = 0, 1, 100
algorithm = example["algorithm"](options, seed=5)
runner = algorithm.env_runner

network = runner.module["drone"]
think = network.forward_exploration
shown, forced = [], None

def forward(batch, **kwargs):
    shown.append({key: array.numpy().copy() for key, array in batch[Columns.OBS].items()})
    if forced is not None:
        logits = torch.full((2, 6), -1e9)
        logits[:, forced] = 0.0
        return {Columns.ACTION_DIST_INPUTS: logits}
    return think(batch, **kwargs)

network.forward_exploration = forward
free = runner.sample(num_episodes=3)
forced = Action.IDLE
[idle] = runner.sample(num_episodes=1)
forced = Action.LEFT  # off the grid, whatever the mask says
[crashed] = runner.sample(num_episodes=1)

view = DroneVectorEnv(1, observation="flat", **training.TRAINING_TASK)
views, first = iter(shown), example["APART"] + 5
for episode in [*free, idle, crashed]:
    seen, _ = view.reset(seed=first if episode in (free[0], idle, crashed) else None)
    parts = [episode.agent_episodes[name] for name in ("drone0", "drone1")]
    for step in range(len(episode)):
        for place, part in enumerate(parts):
            assert part.get_observations(step)["observations"].tobytes() == seen[place].tobytes()
        network_saw = next(views)
        order = [0, 1] if np.array_equal(network_saw["observations"], seen) else [1, 0]
        masks = view.action_masks(right_of_way=True)
        assert network_saw["observations"].tobytes() == seen[order].tobytes()
        assert network_saw["action_mask"].tolist() == masks[order].tolist()
        assert training.masks_of_flat(seen, training.TRAINING_TASK).tolist() == masks.tolist()
        actions = [part.get_actions(step) for part in parts]
        seen, rewards, terminated, truncated, _ = view.step(np.array(actions))
        assert [part.get_rewards(step) for part in parts] == (rewards * example["SCALE"]).tolist()
    for place, part in enumerate(parts):
        assert part.get_observations(-1)["observations"].tobytes() == seen[place].tobytes()
        assert part.is_terminated == terminated[place]
    assert episode.is_terminated == terminated[0]
assert next(views, None) is None
assert (idle.is_terminated, len(idle)) == (True, 50)
assert (crashed.is_terminated, len(crashed)) == (True, 1)
assert runner.get_metrics()["ended"].peek() == 5
print("the same")
"""


def test_training_is_shown_what_evaluation_shows(tmp_path: Path) -> None:
    """Nothing between environment and network changes it, and every end is one."""
    script = tmp_path / "episodes.py"
    script.write_text(EPISODES, "utf-8")
    printed = python(script, EXAMPLE, tmp_path / "run")
    assert printed.splitlines()[-1] == "the same"


SEEDS = """
import runpy, sys
from ray.rllib.env.env_context import EnvContext

example = runpy.run_path(sys.argv[1])
envs = [example["SearchEnv"](EnvContext({}, worker_index=index)) for index in (1, 2)]
seas = []
for env in envs:
    env.reset(seed=2)  # which RLlib gives to the first's second slot and the second's first
    search = env.par_env.unwrapped
    cells = []
    while search.agents:
        env.step({"drone0": 5, "drone1": 5})
        cells.append(search.frame().persons)
    seas.append(cells)
assert seas[0] != seas[1]
print("different")
"""


def test_runners_search_different_seas(tmp_path: Path) -> None:
    script = tmp_path / "seeds.py"
    script.write_text(SEEDS, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "different"
