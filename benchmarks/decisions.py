"""Measure the time in which policies decide, on the searches of the suite.

    python benchmarks/decisions.py
    python benchmarks/decisions.py --policies examples/evaluate_your_own.py:ScentNetwork

It prints two means over the searches: the processing time per decision in milliseconds, and that of
the longest step in seconds, which is usually the first, with the first plan. A decision is the
action of one drone in one step. The episodes are those of the coverage mission, which go on until
the time limit, or until less than 1% is left to find.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import Any

import numpy as np

from DroneSwarmSearch.evaluation import SUITE, NamedSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.evaluation.stage import view_of
from DroneSwarmSearch.policies import POLICIES


def measure(name: str, search: NamedSearch) -> tuple[float, float]:
    """The seconds for a decision, and for all decisions of the longest step."""
    search = replace(search, scenario=search.scenario.replace(mission="coverage"))
    spec = PolicySpec.of(name)
    took = []
    view = view_of(spec, search, None)
    search = search.with_posterior(view.bayesian_update)
    policy = spec.make(search.scenario)

    def timed(observations: Any) -> Any:
        started = time.process_time()
        actions = policy(observations)
        took.append(time.process_time() - started)
        return actions

    for _ in play(timed, search, 0, view):
        pass
    return np.mean(took) / search.scenario.n_drones, max(took)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--policies", nargs="+", default=[*POLICIES])
    parser.add_argument("--searches", nargs="+", choices=SUITE, default=[*SUITE])
    options = parser.parse_args()
    print(f"{'policy':30} {'ms/decision':>12} {'longest step, s':>16}")
    for name in options.policies:
        measured = [measure(name, SUITE[search]) for search in options.searches]
        mean, longest = np.mean(measured, axis=0)
        print(f"{name:30} {1000 * mean:12.2f} {longest:16.3f}", flush=True)


if __name__ == "__main__":
    main()
