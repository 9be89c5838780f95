"""What a find is worth, and a radio: persons of one wreck, who drift alike in an unknown sea.

    python examples/finds_that_teach.py

Six persons drift by one of nineteen hypotheses (`wreck-together.json`). Greedy drones search for
them: first as if each person drifted on their own, so that finds teach nothing; then with the exact
posterior; and at last with the true drift, which nobody knows. Takes about three minutes.

    python examples/finds_that_teach.py --policies greedy-posterior rollout --radio 0 2 4 8

instead measures policies whose drones hear each other within some cells. With --csv FILE, rows are
written to a file as they are finished, and those in it are not measured again.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from DroneSwarmSearch import Scenario
from DroneSwarmSearch.core import NamedSearch
from DroneSwarmSearch.evaluation import suite
from DroneSwarmSearch.evaluation.rollout import roll_out
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.policies import PlannerPolicy, make

WRECK = Path(__file__).with_name("wreck-together.json")
AT_ONCE = 20  # episodes played together
SECONDS = 3.0  # for a plan with the drift known


class Row(NamedTuple):
    """What a policy finds.

    Attributes:
        policy: its name.
        knows: what its drones know: "hears all", "hears nobody", "hears 4 cells" and so on.
        share: the mean share of the persons that it finds.
        error: the standard error of this mean.
        episodes: how many were played.
    """

    policy: str
    knows: str
    share: float
    error: float
    episodes: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--episodes", type=int, default=60, help="for each row (60)")
    add("--policies", nargs="+", help="policies to measure with radios")
    add("--radio", nargs="+", default=[], help="their ranges in cells, or all")
    add("--planner", action="store_true", help="also plan with the drift known (20 minutes)")
    add("--csv", type=Path, help="a file for the rows")
    options = parser.parse_args()
    wreck = suite.search(str(WRECK))
    done = read(options.csv)
    for row in rows(wreck, options, done):
        print(
            f"{row.policy:>17}, {row.knows:<22} {row.share:6.1%} of the persons, ± {row.error:.1%}",
            flush=True,
        )
        if options.csv is not None:
            write(options.csv, row)


def rows(
    wreck: NamedSearch, options: argparse.Namespace, done: set[tuple[str, str]]
) -> Iterator[Row]:
    """The rows that are not done."""
    seeds = range(options.episodes)
    if options.policies is None:
        greedy = "greedy-posterior"
        apart = wreck.scenario.replace(shared_drift=False)
        if (greedy, "finds teach nothing") not in done:
            found = shares(greedy, wreck, wreck.scenario, seeds, believed=apart)
            yield row_of(greedy, "finds teach nothing", found)
        if (greedy, "hears all") not in done:
            yield row_of(greedy, "hears all", shares(greedy, wreck, wreck.scenario, seeds))
        for name in (greedy, *["planner"] * options.planner):
            if (name, "the drift is known") not in done:
                yield row_of(name, "the drift is known", with_the_drift_known(name, wreck, seeds))
        return
    for radio in options.radio or ["all"]:
        reach = None if radio == "all" else float(radio)
        knows = "hears all" if reach is None else f"hears {reach:g} cells"
        for name in options.policies:
            if (name, knows) not in done:
                scenario = wreck.scenario.replace(radio_range=reach)
                yield row_of(name, knows, shares(name, wreck, scenario, seeds))


def row_of(policy: str, knows: str, found: list[float]) -> Row:
    """The mean of some episodes, and its standard error."""
    error = float(np.std(found) / np.sqrt(len(found)))
    return Row(policy, knows, float(np.mean(found)), error, len(found))


def shares(
    name: str,
    wreck: NamedSearch,
    scenario: Scenario,
    seeds: range,
    believed: Scenario | None = None,
) -> list[float]:
    """The share of the persons that a policy finds in each episode.

    `believed`, by default the same, is the scenario that the policy believes in.
    """
    believed = believed or scenario
    policy = PlannerPolicy(believed, seconds=SECONDS) if name == "planner" else make(name, believed)
    search = NamedSearch(wreck.name, wreck.reason, scenario, wreck.drones)
    found: list[float] = []
    for first in range(seeds.start, seeds.stop, AT_ONCE):
        some = range(first, min(first + AT_ONCE, seeds.stop))
        episodes = roll_out(policy, search, some, View("swarm"), wants_curves=False)
        found += (episodes.found_at > 0).mean(axis=1).tolist()
    return found


def with_the_drift_known(name: str, wreck: NamedSearch, seeds: range) -> list[float]:
    """The same with each hypothesis in turn, which the policy knows; all have equal weights."""
    cases = wreck.scenario.by_hypothesis()
    each = -(-len(seeds) // len(cases))
    found: list[float] = []
    for number, (_, scenario) in enumerate(cases):
        found += shares(name, wreck, scenario, range(number * each, (number + 1) * each))
    return found


def read(path: Path | None) -> set[tuple[str, str]]:
    """Which rows a file has: policies, and what they know."""
    if path is None or not path.exists():
        return set()
    with path.open(newline="", encoding="utf-8") as file:
        return {(row["policy"], row["knows"]) for row in csv.DictReader(file)}


def write(path: Path, row: Row) -> None:
    """Add a row to a file."""
    is_new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(Row._fields)
        rounded = (round(value, 4) if isinstance(value, float) else value for value in row)
        writer.writerow(rounded)


if __name__ == "__main__":
    main()
