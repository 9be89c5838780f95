"""Compare networks of examples/train_own_loop.py with greedy policies on new random searches.

    pip install "DroneSwarmSearchEnvironment[ppo]"
    python benchmarks/own_loop.py runs/first/checkpoint.pt --csv docs/training/own_loop.csv

The searches are drawn like those in training, with other seeds. Greedy policies are exact; a
network samples its actions and plays the coverage mission, as in training.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
import torch

from DroneSwarmSearch.evaluation import evaluate

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
import train_own_loop as example

BASELINES = "random", "greedy-matrix", "greedy-posterior", "greedy-forecast"


def success_of(agent: example.Agent, searches: int, episodes: int) -> list[float]:
    """A network's probability of success in each search and episode."""
    results: list[float] = []
    for _ in range(episodes):
        envs = example.make_envs(searches, example.RANDOM_SEARCHES)
        observations, _ = envs.reset(seed=example.TEST_SEED)
        success = np.full(envs.num_envs, np.nan)
        while np.isnan(success).any():
            observations, _, dones, _, infos = envs.step(agent.act(observations)["actions"].numpy())
            if (new := dones & np.isnan(success)).any():  # later episodes are other searches
                success[new] = infos["final_info"]["probability_of_success"][new]
        results += success.tolist()
    return results


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkpoints", nargs="*", type=Path, help="checkpoint.pt of runs")
    parser.add_argument("--searches", type=int, default=100, help="number of searches (100)")
    parser.add_argument("--episodes", type=int, default=20, help="of each network per search (20)")
    parser.add_argument("--csv", type=Path, help="write the success of the package's policies here")
    options = parser.parse_args()
    searches = example.random_searches(options.searches)
    rows = []

    def report(name: str, found: list[float]) -> float:
        mean = float(np.mean(found))
        print(f"{name:<40} {100 * mean:5.1f}%", flush=True)
        return round(mean, 4)

    for name in BASELINES:
        results = [evaluate(name, each, episodes=1, progress=False) for each in searches]
        success = report(name, [each.success.value for each in results])
        rows.append({"policy": name, "success": success})
    for path in options.checkpoints:
        agent = example.Agent()
        agent.load_state_dict(torch.load(path, weights_only=True)["agent"])
        torch.manual_seed(0)
        report(str(path), success_of(agent, options.searches, options.episodes))
    if options.csv:
        with options.csv.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, ["policy", "success"], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
