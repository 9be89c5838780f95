"""Searches of the literature whose best plans are published: the planner, and exact plans.

    python benchmarks/optima.py run                      # what is missing, search after search
    python benchmarks/optima.py run --searches eagle royset-9-10-3 --seconds 60
    python benchmarks/optima.py report                   # the table of the page

Each search is posed as a `Scenario`. The planner works for `--work` seconds, the exact method for
at most `--seconds`, and the bound `success_bound` as by default. A row is written after each
search, so an interruption loses no more than the one under way. Needs the extra "optimum".

Eagle's searcher: J. N. Eagle, The optimal search for a moving target when the search path is
constrained, Operations Research 32:1107 (1984), table I. Royset and Sato's family: J. O. Royset,
H. Sato, Naval Research Logistics 57:422 (2010), as solved by M. Lejeune, J. O. Royset and W. Ma
with Gurobi 9.1.2 in at most 900 seconds.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from csv_rows import rows_of
from markdown_tables import markdown, with_table
from numpy.typing import NDArray

from DroneSwarmSearch import MarkovDrift, Person, Scenario
from DroneSwarmSearch.planning import optimum, plan_paths, success_bound

FOLDER = Path(__file__).parents[1] / "docs/benchmark"
RESULTS = FOLDER / "optima.csv"
PAGE = FOLDER / "optima.md"
COLUMNS = (
    "search",
    "work",
    "planner",
    "planner_seconds",
    "best",
    "bound",
    "seconds",
    "nodes",
    "success_bound",
    "success_bound_seconds",
)
PROVEN = 5e-6  # the difference up to which a plan counts as the best


class Published(NamedTuple):
    """The probability of not finding the target, and Gurobi's time or gap; "" if not known."""

    missed: float
    gurobi: str = ""


ROYSET: dict[tuple[int, int, int], Published] = {  # side, steps, searchers
    (9, 7, 3): Published(0.80732, ".08 s"),
    (9, 8, 3): Published(0.68737, ".3 s"),
    (9, 9, 3): Published(0.58056, ".8 s"),
    (9, 10, 3): Published(0.51546, "8.9 s"),
    (9, 11, 3): Published(0.47121, "275 s"),
    (9, 12, 3): Published(0.43798, "gap 17%"),
    (9, 13, 3): Published(0.41277, "gap 32%"),
    (9, 14, 3): Published(0.39066, "81 s"),
    (9, 15, 3): Published(0.37227, "157 s"),
    (9, 7, 15): Published(0.80015, "1.7 s"),
    (9, 8, 15): Published(0.66945, "96 s"),
    (9, 9, 15): Published(0.56504, "gap 5.9%"),
    (9, 10, 15): Published(0.49720, "gap 20%"),
    (9, 11, 15): Published(0.44950, "gap 36%"),
    (9, 12, 15): Published(0.41231, "gap 51%"),
    (9, 13, 15): Published(0.38117, "gap 70%"),
    (9, 14, 15): Published(0.35662, "gap 87%"),
    (9, 15, 15): Published(0.33590, "gap 110%"),
    (9, 10, 1): Published(0.66445),
    (9, 10, 2): Published(0.54525),
    (9, 10, 4): Published(0.50748),
    (9, 10, 5): Published(0.50360, "gap 3.4%"),
    (9, 10, 10): Published(0.49821, "gap 15%"),
    (5, 10, 3): Published(0.22437, "gap 83%"),
    (7, 10, 3): Published(0.37086, "gap 15%"),
    (11, 10, 3): Published(0.71112),
    (13, 10, 3): Published(0.90275),
    (15, 10, 3): Published(0.98642),
}
EAGLE = {(0, 0): 0.7786, (1, 0): 0.8631, (1, 1): 0.8631, (2, 1): 1.0}  # found, by start


def random_steps(side: int, stays: float) -> NDArray[np.float64]:
    """A target that stays with a probability, and else moves to any side neighbour: (N², N²)."""
    moves = np.zeros((side**2, side**2))
    for y, x in np.ndindex(side, side):
        neighbours = [
            (y + dy) * side + x + dx
            for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0))
            if 0 <= y + dy < side and 0 <= x + dx < side
        ]
        moves[y * side + x, y * side + x] = stays
        moves[y * side + x, neighbours] = (1.0 - stays) / len(neighbours)
    return moves


def eagle() -> Scenario:
    """Eagle's search: nine cells, ten certain looks, and a target that starts in a corner."""
    target = Person(MarkovDrift((2, 2), random_steps(3, 0.4)))
    return Scenario(
        3,
        n_drones=1,
        timestep_limit=10,
        persons=[target],
        search_in_flight=True,
        crash="pass",
    )


def royset(side: int, steps: int, searchers: int) -> Scenario:
    """A search of Royset and Sato's family.

    The target starts in the middle. All searchers together miss it with .4 cubed in a look.
    """
    middle = side // 2
    rate = -3.0 * math.log(0.4) / searchers
    drift = MarkovDrift((middle, middle), random_steps(side, 0.6))
    return Scenario(
        side,
        n_drones=searchers,
        timestep_limit=steps,
        persons=[Person(drift, probability_of_detection=1.0 - math.exp(-rate))],
        search_in_flight=True,
        crash="pass",
    )


class Posed(NamedTuple):
    """A search, its drones' cells, and what is published."""

    scenario: Scenario
    starts: list[tuple[int, int]]
    published: Published


def searches() -> dict[str, Posed]:
    """All searches by name."""
    found = {
        f"eagle-{x}-{y}": Posed(eagle(), [(x, y)], Published(1.0 - success))
        for (x, y), success in EAGLE.items()
    }
    for key, published in ROYSET.items():
        side, steps, searchers = key
        name = f"royset-{side}-{steps}-{searchers}"
        found[name] = Posed(royset(*key), [(0, 0)] * searchers, published)
    return found


def run(name: str, posed: Posed, work: float, seconds: float) -> dict[str, Any]:
    """The row of a search; values are probabilities of not finding the target."""
    begin = time.process_time()
    plan = plan_paths(posed.scenario, posed.starts, seconds=work)
    planned = time.process_time()
    best = optimum(posed.scenario, posed.starts, seconds=seconds)
    proven = time.process_time()
    success = max(best.success, float(plan.by_time[-1]))
    most = success_bound(posed.scenario, posed.starts).by_limit
    return {
        "search": name,
        "work": f"{work:g}",
        "planner": f"{1.0 - plan.by_time[-1]:.6f}",
        "planner_seconds": f"{planned - begin:.1f}",
        "best": f"{1.0 - success:.6f}",
        "bound": f"{1.0 - best.bound:.6f}",
        "seconds": f"{proven - planned:.1f}",
        "nodes": best.nodes,
        "success_bound": f"{1.0 - most:.6f}",
        "success_bound_seconds": f"{time.process_time() - proven:.1f}",
    }


def read_rows() -> dict[str, dict[str, str]]:
    """The rows that have been written, by search."""
    return {row["search"]: row for row in rows_of(RESULTS)}


def write_rows(rows: dict[str, Any]) -> None:
    """Write all rows, in the order of the searches."""
    with RESULTS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[name] for name in searches() if name in rows)


def table() -> str:
    """The table of the page in Markdown."""
    heads = (
        "search",
        "published",
        "Gurobi",
        "planner",
        "with work, s",
        "best",
        "bound",
        "gap",
        "CPU, s",
        "nodes",
        "success_bound",
        "CPU, s",
    )
    lines = [heads]
    rows = read_rows()
    for name, posed in searches().items():
        if name not in rows:
            continue
        row = rows[name]
        best = float(row["best"])
        bound = float(row["bound"])
        relaxed = float(row["success_bound"])
        gap = (best - max(bound, relaxed)) / best if best > 0 else 0.0
        cells = (
            name,
            f"{posed.published.missed:.5f}",
            posed.published.gurobi,
            f"{float(row['planner']):.5f}",
            row["work"],
            f"{best:.5f}",
            f"{bound:.5f}",
            "proven" if best - bound <= PROVEN else f"{gap:.1%}",
            row["seconds"],
            row["nodes"],
            f"{relaxed:.5f}",
            row["success_bound_seconds"],
        )
        lines.append(cells)
    return markdown(lines)


def page() -> str:
    """The page with the table as it should be."""
    return with_table(PAGE, "python benchmarks/optima.py report", table())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    runs = commands.add_parser("run", help="plan the searches that have no row")
    runs.add_argument("--searches", nargs="+", help="whose names begin like this (all)")
    runs.add_argument("--work", type=float, default=5.0, help="of the planner, seconds (5)")
    runs.add_argument("--seconds", type=float, default=900.0, help="for the exact method (900)")
    commands.add_parser("report", help="write the table of the page")
    options = parser.parse_args()
    if options.command == "report":
        PAGE.write_text(page(), "utf-8")
        return
    for prefix in options.searches or ():
        if not any(name.startswith(prefix) for name in searches()):
            runs.error(f"--searches: no search begins like {prefix}")
    for name, posed in searches().items():
        wanted = options.searches is None or name.startswith(tuple(options.searches))
        if wanted and name not in read_rows():
            row = run(name, posed, options.work, options.seconds)
            write_rows({**read_rows(), name: row})
            print(*row.values(), flush=True)


if __name__ == "__main__":
    main()
