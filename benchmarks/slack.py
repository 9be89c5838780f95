"""How much of the gap between the planner and the bound is slack, where the best plan is known.

    python benchmarks/slack.py                           # a table in Markdown
    python benchmarks/slack.py --searches fog --size 6 --seconds 600

The searches are small relatives of those of the suite with one person: the same drones, at most
three, the same detection and hypotheses, on a grid of fewer cells and with fewer steps, so that the
likely area, the drift and the searched part of the grid are as large in relation to it. Drones may
share cells. `optimum` proves the best plan, or bounds it. Needs the extra "optimum".
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from markdown_tables import markdown

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.evaluation import search
from DroneSwarmSearch.planning import optimum, plan_paths, success_bound

NAMES = (
    "pond",
    "classic",
    "harbour",
    "fog",
    "man-overboard",
    "gale",
    "channel",
    "two-positions",
    "night",
    "overdue",
)
MOST_DRONES = 3
FEWEST_STEPS = 8
MOST_STEPS = 14
WORK = 2.0  # seconds, of the planner


def relative(of: NamedSearch, size: int) -> tuple[Scenario, list[tuple[int, int]]]:
    """A small relative of a search, and its drones' cells."""
    whole = of.scenario
    shrink = size / whole.grid_size
    drones = min(whole.n_drones, MOST_DRONES)
    looks = whole.n_drones * whole.timestep_limit * shrink**2
    steps = min(max(round(looks / drones), FEWEST_STEPS), MOST_STEPS)
    pace = whole.timestep_limit / steps * shrink  # of the drift
    (person,) = whole.persons_to_find
    drifts = [_shrunk(drift, shrink, pace) for drift in person.drift.drifts]
    scenario = Scenario(
        size,
        n_drones=drones,
        timestep_limit=steps,
        persons=[Person(drifts, person.probability_of_detection)],
        crash="pass",
    )
    return scenario, [(int(x * shrink), int(y * shrink)) for x, y in of.drones[:drones]]


def _shrunk(drift: Drift, shrink: float, pace: float) -> Drift:
    """A drift on a smaller grid, whose speeds are multiplied by `pace`."""
    is_known = not any(drift.start_sd) and not drift.adrift
    start = [x * shrink for x in drift.start]
    return replace(
        drift,
        start=tuple(map(int, start) if is_known else start),
        start_sd=tuple(sd * shrink for sd in drift.start_sd),
        vector=tuple(speed * pace for speed in drift.vector),
        vector_sd=tuple(sd * pace for sd in drift.vector_sd),
        diffusion=drift.diffusion * pace * shrink,
        adrift=round(drift.adrift * shrink / pace),
    )


def row(name: str, size: int, seconds: float) -> list[str]:
    """The row of a search: successes in percent, and CPU seconds."""
    scenario, starts = relative(search(name), size)

    def timed(call: Callable[[], Any]) -> tuple[Any, float]:
        before = time.process_time()
        return call(), time.process_time() - before

    plan, _ = timed(lambda: plan_paths(scenario, starts, seconds=WORK))
    bound, bounding = timed(lambda: success_bound(scenario, starts).by_limit)
    best, proving = timed(lambda: optimum(scenario, starts, seconds=seconds))
    planned = float(plan.by_time[-1])
    at_most = min(best.bound, bound)
    values = (planned, max(planned, best.success), at_most, bound, bound - at_most)
    return [
        name,
        str(scenario.n_drones),
        str(scenario.timestep_limit),
        *(f"{100 * value:.2f}" for value in values),
        f"{bounding:.0f}, {proving:.0f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--searches", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--size", type=int, default=7, help="cells along a side (7)")
    parser.add_argument("--seconds", type=float, default=100.0, help="for the exact method (100)")
    options = parser.parse_args()
    heads = (
        "search",
        "drones",
        "steps",
        "planner",
        "best plan",
        "optimum at most",
        "bound",
        "slack at least",
        "CPU of bound and proof, s",
    )
    rows = [row(name, options.size, options.seconds) for name in options.searches]
    print(markdown([heads, *rows]))


if __name__ == "__main__":
    main()
