"""Compare policies on families of random searches, exactly.

    python benchmarks/families.py --searches 20 --policies greedy-forecast imitation planner
    python benchmarks/families.py --policies greedy-forecast alone=runs/seed1/policy.npz

alone=weights.npz is a network that acts without simulating the search first.

Each family varies one thing: many drones, a low probability of detection, a strong drift, two
persons, or a long time limit. Every search is a coverage mission, which ends at the time limit, or
with less than 1% left to find. Its probability of success has no sampling error: until this end, it
is that of a rescue with one person, and the mean over persons with two. Brackets are 95% bootstrap
intervals over searches.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.policies import ImitationPolicy

FAMILIES = ("ordinary", "swarms", "low-detection", "strong-drift", "two-persons", "long")


def draw_person(rng: np.random.Generator, size: int, speed: float, detection: float) -> Person:
    """A person in a known cell, or one that is uncertain, possibly with two hypotheses."""
    known = rng.random() < 0.5
    drifts = []
    for _ in range(1 if known else int(rng.integers(1, 3))):
        angle = rng.uniform(0.0, 2 * np.pi)
        drifts.append(
            Drift(
                (int(rng.integers(0, size)), int(rng.integers(0, size))),
                start_sd=0.0 if known else float(rng.uniform(0.5, 4.0)),
                vector=(speed * np.cos(angle), speed * np.sin(angle)),
                vector_sd=0.0 if known else float(rng.uniform(0.0, 0.05)),
                diffusion=float(rng.uniform(0.02, 0.5)),
            )
        )
    return Person(drifts, detection)


def draw_search(rng: np.random.Generator, family: str, number: int) -> NamedSearch:
    """A search of a family; drones start in a row or anywhere."""
    size = int(rng.integers(15, 41))
    n_drones = int(rng.integers(1, 9))
    speed = float(rng.uniform(0.0, 0.6))
    detection = float(rng.choice([0.6, 0.8, 1.0]))
    persons = 1
    limit = int(rng.integers(2 * size, 4 * size))
    if family == "swarms":
        size = int(rng.integers(30, 51))
        n_drones = int(rng.integers(9, 17))
        limit = int(rng.integers(size, 2 * size))
    elif family == "low-detection":
        detection = 0.4
    elif family == "strong-drift":
        speed = float(rng.uniform(0.8, 1.5))
    elif family == "two-persons":
        persons = 2
    elif family == "long":
        size = int(rng.integers(30, 46))
        n_drones = int(rng.integers(1, 4))
        limit = int(rng.integers(200, 501))
    scenario = Scenario(
        grid_size=size,
        n_drones=n_drones,
        timestep_limit=limit,
        persons=[draw_person(rng, size, speed, detection) for _ in range(persons)],
        mission="coverage",
        bayesian_update=True,
    )
    first = int(rng.integers(0, size**2 - n_drones))
    anywhere = rng.random() < 0.5
    cells = rng.permutation(size**2)[:n_drones] if anywhere else first + np.arange(n_drones)
    drones = tuple((int(cell % size), int(cell // size)) for cell in cells)
    return NamedSearch(f"{family}-{number}", "A random search.", scenario, drones)


def policy_for(name: str, scenario: Scenario) -> Any:
    """A policy as `evaluate` takes it: a name, or an object for the scenario."""
    kind, _, path = name.partition("=")
    return ImitationPolicy(scenario, path, samples=None) if kind == "alone" else name


def interval(values: NDArray[np.float64], rng: np.random.Generator) -> str:
    """The mean with its 95% percentile bootstrap interval, in percent."""
    means = rng.choice(values, (2000, len(values))).mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return f"{100 * values.mean():+6.1f} ({100 * low:+.1f} to {100 * high:+.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--searches", type=int, default=20, help="searches per family (20)")
    parser.add_argument("--seed", type=int, default=0, help="of the searches (0)")
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--policies", nargs="+", default=["greedy-forecast", "imitation"])
    parser.add_argument("--csv", type=Path, help="a file for the success in every search")
    options = parser.parse_args()

    rows = []
    for family in options.families:
        rng = np.random.default_rng([options.seed, FAMILIES.index(family)])
        searches = [draw_search(rng, family, number) for number in range(options.searches)]
        first: NDArray[np.float64] | None = None
        for name in options.policies:
            started = time.process_time()
            results = [
                evaluate(policy_for(name, search.scenario), search, episodes=1, name=name)
                for search in searches
            ]
            found = np.array([result.success.value for result in results])
            seconds = time.process_time() - started
            first = found if first is None else first
            lead = "" if found is first else interval(found - first, rng)
            print(
                f"{family:14} {name:30} {100 * found.mean():5.1f}  {lead:26} {seconds:5.0f} s",
                flush=True,
            )
            rows += [
                {"family": family, "search": search.name, "policy": name, "success": value}
                for search, value in zip(searches, found.tolist(), strict=True)
            ]
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
