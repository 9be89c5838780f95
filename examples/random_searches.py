"""Compare policies on random searches, on which none of them was trained.

    python examples/random_searches.py --searches 200 --policies imitation greedy-posterior

Grid, drones, start cells, drift, dispersion, probability of detection and time limit are drawn
for every search. The first policy is compared with each of the others on the same episodes. The
intervals are bootstrap intervals over searches. For your own policy, give file.py:attribute, or
imitation=weights.npz for weights from examples/train_imitation.py.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.evaluation import NamedSearch, View, evaluate
from DroneSwarmSearch.policies import ImitationPolicy

DEFAULT_POLICIES = [
    "imitation",
    "greedy-posterior",
    "greedy-matrix",
    "creeping-line",
    "parallel-sweep",
    "sector-search",
    "expanding-square",
    "random",
]

FIRST_SEED = 2_000_000  # of every search; training usually starts from small seeds


def random_search(rng: np.random.Generator, number: int) -> NamedSearch:
    grid_size = int(rng.choice([12, 18, 25, 35, 45]))
    n_drones = int(rng.choice([1, 2, 3, 5, 6]))
    scenario = Scenario(
        grid_size=grid_size,
        n_drones=n_drones,
        vector=rng.uniform(-0.6, 0.6, 2).round(3),
        person_initial_position=rng.integers(0, grid_size, 2),
        disperse_constant=float(np.exp(rng.uniform(0.0, np.log(20.0))).round(3)),
        timestep_limit=int(rng.integers(2 * grid_size, 4 * grid_size)),
        probability_of_detection=float(rng.choice([0.4, 0.7, 0.9, 1.0])),
    )
    cells = rng.permutation(grid_size**2)[:n_drones]
    drones = tuple((int(cell % grid_size), int(cell // grid_size)) for cell in cells)
    return NamedSearch(f"random-{number}", "A random search.", scenario, drones)


def policy_for(name: str, scenario: Scenario) -> Any:
    """A policy as `evaluate` takes it: a name, or an object for the scenario."""
    if name.startswith("imitation="):
        return ImitationPolicy(scenario, name.partition("=")[2])
    return name


def interval(values: NDArray[np.float64], rng: np.random.Generator) -> str:
    """The mean with its 95% percentile bootstrap interval."""
    means = rng.choice(values, (2000, len(values))).mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return f"{values.mean():.1f} ({low:.1f} to {high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--searches", type=int, default=100, help="number of searches (100)")
    parser.add_argument("--episodes", type=int, default=200, help="per search and policy (200)")
    parser.add_argument("--seed", type=int, default=0, help="of the random searches (0)")
    parser.add_argument("--policies", nargs="+", default=DEFAULT_POLICIES)
    parser.add_argument("--posterior", action="store_true", help="give all policies the posterior")
    options = parser.parse_args()

    rng = np.random.default_rng(options.seed)
    searches = [random_search(rng, number) for number in range(options.searches)]
    found: dict[str, NDArray[np.float64]] = {}
    first = options.policies[0]
    width = max(map(len, ["greedy-posterior", *options.policies]))
    row = f"{{:<{width}}}  {{:<20}}  {{:<20}}  {{:<22}}  {{}}".format
    print(row("policy", "success, %", "time, % of the limit", f"{first} ahead, points", "won:lost"))
    for name in options.policies:
        results = [
            evaluate(
                policy_for(name, search.scenario),
                search,
                episodes=options.episodes,
                seed=FIRST_SEED,
                view=View(bayesian_update=options.posterior),
                name=name,
            )
            for search in searches
        ]
        found[name] = np.array([100.0 * each.success.value for each in results])
        time = np.array([100.0 * each.time.value / each.limit for each in results])
        lead = found[first] - found[name]
        comparison = ("", "")
        if name != first:
            comparison = interval(lead, rng), f"{(lead > 0).sum()}:{(lead < 0).sum()}"
        print(row(name, interval(found[name], rng), interval(time, rng), *comparison), flush=True)
    print(f"{options.searches} searches, {options.episodes} episodes each; 95% intervals")


if __name__ == "__main__":
    main()
