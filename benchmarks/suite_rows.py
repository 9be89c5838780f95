"""Train IPPO and MAPPO for the leaderboard of the suite, and keep the networks of their drones.

    python benchmarks/suite_rows.py ippo mappo

Training is that of examples/train_benchmarl.py, with the settings tuned for the benchmark, on the
random searches of examples/train_own_loop.py: none of them is in the suite. The weights are for
docs/leaderboard/perceptron.py, which needs NumPy only. Needs the extra "benchmarl".
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from algorithms import TUNED

from DroneSwarmSearch.training import Task

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs/leaderboard"
sys.path.insert(0, str(ROOT / "examples"))
from train_benchmarl import Setting, make_experiment  # noqa: E402
from train_own_loop import RANDOM_SEARCHES, sampler  # noqa: E402

STEPS = 500_000  # of the environments
SEED = 0


def train(name: str) -> None:
    """Train once, and write the drones' network."""
    parameters = {key: value for key, value in RANDOM_SEARCHES.items() if key != "sampler"}
    task = Task(parameters, sampler)
    setting = Setting(**TUNED[name])
    with tempfile.TemporaryDirectory() as folder:
        experiment = make_experiment(Path(folder), SEED, STEPS, task, name, setting)
        experiment.run()
    # A network that all drones share: a weight and a bias for each layer, in order.
    values = [value.detach().numpy() for value in experiment.policy.parameters()]
    arrays = {}
    for number, (weights, biases) in enumerate(zip(values[::2], values[1::2], strict=True)):
        arrays[f"weights{number}"] = weights.T
        arrays[f"biases{number}"] = biases
    np.savez_compressed(FOLDER / f"{name}.npz", **arrays)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("algorithms", nargs="+", choices=("ippo", "mappo"))
    torch.set_num_threads(1)
    for name in parser.parse_args().algorithms:
        train(name)


if __name__ == "__main__":
    main()
