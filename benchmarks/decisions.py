r"""Measure the time in which policies decide, on the searches of the suite.

    python benchmarks/decisions.py --submissions docs/leaderboard/submissions.csv \
        --csv docs/leaderboard/decisions.csv
    python benchmarks/decisions.py --policies examples/evaluate_your_own.py:ScentNetwork

It prints two means over the searches: the processing time per decision in milliseconds, and that of
the longest step in seconds, which is usually the first, with the first plan. A decision is the
action of one drone in one step. The episodes are those of the coverage mission, which go on until
the time limit, or until less than 1% is left to find.
"""

from __future__ import annotations

import argparse
import csv
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from csv_rows import rows_of

from DroneSwarmSearch.evaluation import SUITE, NamedSearch
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import play
from DroneSwarmSearch.evaluation.stage import view_of
from DroneSwarmSearch.policies import POLICIES


def measure(spec: PolicySpec, search: NamedSearch) -> tuple[float, float]:
    """The seconds for a decision, and for all decisions of the longest step."""
    search = replace(search, scenario=search.scenario.replace(mission="coverage"))
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


def keep(path: Path, name: str, milliseconds: float) -> None:
    """Write a policy's figure into a CSV file, in place of an earlier one."""
    figures = {row["policy"]: row["milliseconds"] for row in rows_of(path)}
    figures[name] = f"{milliseconds:.3g}"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["policy", "milliseconds"])
        writer.writerows(figures.items())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--policies", nargs="+", default=[*POLICIES])
    parser.add_argument("--searches", nargs="+", choices=SUITE, default=[*SUITE])
    parser.add_argument("--submissions", type=Path, help="a file of policies, see `leaderboard`")
    parser.add_argument("--csv", type=Path, help="a file of earlier figures, to take their place")
    options = parser.parse_args()
    if options.csv is not None and set(options.searches) != {*SUITE}:
        parser.error("--csv: figures are kept of all searches only, got --searches")
    specs = [PolicySpec.of(name) for name in options.policies]
    if options.submissions is not None:
        if not options.submissions.is_file():
            parser.error(f"--submissions: must be a file, got {options.submissions}")
        rows = rows_of(options.submissions)
        specs += [PolicySpec.of(row["policy"], row["name"]) for row in rows]
    print(f"{'policy':30} {'ms/decision':>12} {'longest step, s':>16}")
    for spec in specs:
        measured = [measure(spec, SUITE[search]) for search in options.searches]
        mean, longest = np.mean(measured, axis=0)
        print(f"{spec.name:30} {1000 * mean:12.2f} {longest:16.3f}", flush=True)
        if options.csv is not None:
            keep(options.csv, spec.name, 1000 * mean)


if __name__ == "__main__":
    main()
