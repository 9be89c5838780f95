"""The RLlib example on a cluster."""

import importlib.util

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


def test_it_trains_on_a_cluster_of_two_nodes(tmp_path):
    """Both nodes are on this machine and have one CPU each, enough for one runner."""
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER, "utf-8")
    folder = tmp_path / "run"
    short = ("--steps", 2_000, "--episodes", 20, "--num-env-runners", 2, "--num-envs", 2)
    python(script, EXAMPLE, "--out", folder, *short)
    assert rows(folder / "evaluation.csv")[0]["policy"] == "rllib-ppo"
