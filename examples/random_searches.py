"""Compare policies on searches drawn at random, which nobody was trained on.

    python examples/random_searches.py --searches 200 --policies ppo greedy-posterior greedy-matrix

Grid, drones, their places, drift, the person's start and straying, the chance of detection
and the time allowed are all drawn anew for every search. The first policy is compared with
each of the others on the same seas; the intervals are over searches, the units that were
drawn (paired percentile bootstrap). A trained network of one's own is given as
file.py:attribute, or as ppo=weights.npz if examples/train_ppo.py has made it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.statistics import bootstrap_mean
from DroneSwarmSearch.evaluation.tables import figure, print_table, signed
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.policies.ppo import PPOPolicy

USUAL = ["ppo", *(name for name in POLICIES if name not in ("ppo", "planner"))]
"""All but the planner, which takes seconds for each search."""

SEED = 2_000_000
"""Of the first episode of every search: training begins with small ones."""


def drawn(rng: np.random.Generator, number: int) -> NamedSearch:
    """A search in which everything is drawn."""
    size = int(rng.choice([12, 18, 25, 35, 45]))
    drones = int(rng.choice([1, 2, 3, 5, 6]))
    scenario = Scenario(
        grid_size=size,
        n_drones=drones,
        vector=rng.uniform(-0.6, 0.6, 2).round(3),
        person_initial_position=rng.integers(0, size, 2),
        disperse_constant=float(np.exp(rng.uniform(0.0, np.log(20.0))).round(3)),
        timestep_limit=int(rng.integers(2 * size, 4 * size)),
        probability_of_detection=float(rng.choice([0.4, 0.7, 0.9, 1.0])),
    )
    cells = rng.permutation(size**2)[:drones]
    places = tuple((int(cell % size), int(cell // size)) for cell in cells)
    return NamedSearch(f"drawn-{number}", "Drawn at random.", scenario, places)


def specs(names: list[str]) -> Iterator[tuple[str, Any]]:
    """Each policy's name, and what stands for it, perhaps after a call with the scenario."""
    for name in names:
        if name.startswith("ppo="):
            weights = name.partition("=")[2]
            yield name, partial(PPOPolicy, weights=weights)
        else:
            yield name, lambda scenario, name=name: name


def main() -> None:
    """Evaluate, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--searches", type=int, default=100, help="how many are drawn (100)")
    parser.add_argument("--episodes", type=int, default=200, help="of each (200)")
    parser.add_argument("--seed", type=int, default=0, help="of the drawing (0)")
    parser.add_argument("--policies", nargs="+", default=USUAL)
    parser.add_argument("--posterior", action="store_true", help="show the posterior to all")
    options = parser.parse_args()

    rng = np.random.default_rng(options.seed)
    searches = [drawn(rng, number) for number in range(options.searches)]
    shares: dict[str, list[float]] = {name: [] for name in options.policies}
    times: dict[str, list[float]] = {name: [] for name in options.policies}
    with Progress("evaluation", len(searches) * len(shares)) as bar:
        for number, search in enumerate(searches):
            for place, (name, made) in enumerate(specs(options.policies)):
                result = evaluate(
                    made(search.scenario),
                    search,
                    episodes=options.episodes,
                    seed=SEED,
                    bayesian_update=options.posterior,
                    name=name,
                    progress=False,
                )
                shares[name].append(100.0 * result.success.value)
                times[name].append(result.time.value / result.limit * 100.0)
                bar(number * len(shares) + place + 1)

    first = options.policies[0]
    rows = []
    for name in options.policies:
        ahead = np.array(shares[first]) - shares[name]
        wins = f"{int((ahead > 0).sum())}:{int((ahead < 0).sum())}"
        rows.append(
            [
                name,
                figure(bootstrap_mean(shares[name])),
                figure(bootstrap_mean(times[name])),
                "" if name == first else signed(bootstrap_mean(ahead)),
                "" if name == first else wins,
            ]
        )
    headers = ["policy", "found, %", "time, % of the limit", f"{first} ahead, points", "won:lost"]
    print_table(headers, rows, words=1)
    print(
        f"\n{options.searches} searches, {options.episodes} episodes each; in brackets 95 % "
        "intervals over searches."
    )


if __name__ == "__main__":
    main()
