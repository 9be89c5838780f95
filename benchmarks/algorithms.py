"""What standard algorithms reach on the tasks of the benchmark: train, evaluate, report.

    python benchmarks/algorithms.py train                       # what is missing, run after run
    python benchmarks/algorithms.py train --algorithms qmix --tasks small --seeds 0
    python benchmarks/algorithms.py baselines
    python benchmarks/algorithms.py report                      # the table

Training is that of examples/train_benchmarl.py. Results and curves are rows of CSV files, which are
written after each run, so an interruption loses no more than the run under way.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from DroneSwarmSearch.evaluation import NamedSearch, evaluate
from DroneSwarmSearch.policies import PlannerPolicy
from DroneSwarmSearch.training import TASKS

ROOT = Path(__file__).parents[1]
RESULTS, CURVES = (ROOT / f"docs/benchmark/{name}.csv" for name in ("results", "curves"))
PAGE = ROOT / "docs/benchmark/index.md"
BEGIN = "<!-- table: python benchmarks/algorithms.py report -->\n"
END = "<!-- /table -->\n"
ALGORITHMS = ("ippo", "mappo", "iql", "vdn", "qmix")
BASELINES = ("random", "greedy-matrix", "greedy-posterior", "imitation", "planner")
# of a training; seconds of work for a plan
STEPS = 400_000
PLANNING = 1.0
KEY = ("algorithm", "task", "seed")
POINTS = 40  # of a curve


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file; none if there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def append(path: Path, rows: list[dict[str, object]]) -> None:
    """Add rows to a CSV file."""
    path.parent.mkdir(exist_ok=True)
    is_new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        if is_new:
            writer.writeheader()
        writer.writerows(rows)


def train(algorithm: str, task: str, seed: int) -> None:
    """Train once, as the command on the page does, and keep the result and the curve."""
    key = dict(zip(KEY, (algorithm, task, seed), strict=True))
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        options = [f"--{name}={value}" for name, value in key.items()]
        command = [sys.executable, str(ROOT / "examples/train_benchmarl.py"), *options]
        before = os.times()
        subprocess.run([*command, f"--out={folder}", f"--steps={STEPS}"], check=True)
        after = os.times()
        cpu = sum(after[2:4]) - sum(before[2:4])
        [trained] = [
            row for row in rows_of(folder / "evaluation.csv") if row["policy"].startswith("bench")
        ]
        curve = rows_of(folder / "curve.csv")
    success = f"{float(trained['success']):.5f}"
    append(RESULTS, [{**key, "steps": STEPS, "success": success, "cpu_seconds": round(cpu)}])
    portions = np.array_split(np.arange(len(curve)), POINTS)
    found = np.array([float(row["found"]) for row in curve])
    append(
        CURVES,
        [
            {**key, "steps": curve[which[-1]]["steps"], "found": f"{found[which].mean():.4f}"}
            for which in portions
        ],
    )


def baseline(name: str, task: str) -> None:
    """Evaluate a packaged policy on the held-out searches.

    Imitation and the planner may know each search, so they are made for each; their figures are
    exact, as those of the greedy policies are.
    """
    before = time.process_time()
    if name in ("imitation", "planner"):
        searches = TASKS[task].held_out()
        seconds = PLANNING if len(searches) > 1 else None
        success = float(np.mean([known(name, search, seconds) for search in searches]))
    else:
        success = TASKS[task].evaluate(name).success.value
    cpu = time.process_time() - before
    key = dict(zip(KEY, (name, task, ""), strict=True))
    row = {**key, "steps": "", "success": f"{success:.5f}", "cpu_seconds": round(cpu)}
    append(RESULTS, [row])


def known(name: str, search: NamedSearch, seconds: float | None) -> float:
    """The success of a policy that is made for a held-out search; None: of its usual work."""
    policy: object = name
    if name == "planner" and seconds is not None:
        policy = PlannerPolicy(search.scenario, seconds=seconds)
    return evaluate(policy, search, episodes=1, name=name).success.value


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of the middle half along the last axis; of fewer than four values, of them all."""
    cut = values.shape[-1] // 4
    count = values.shape[-1]
    middle: NDArray[np.float64] = np.sort(values, axis=-1)[..., cut : count - cut].mean(axis=-1)
    return middle


def interval(strata: list[NDArray[np.float64]]) -> tuple[float, float, float]:
    """The interquartile mean of all runs, with its 95% stratified bootstrap interval.

    R. Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS
    2021. A stratum has the runs on one task, which are drawn again with replacement.
    """
    rng = np.random.default_rng(0)
    drawn = [rng.choice(runs, (20_000, len(runs))) for runs in strata]
    low, high = np.percentile(interquartile_mean(np.hstack(drawn)), (2.5, 97.5))
    return float(interquartile_mean(np.concatenate(strata))), float(low), float(high)


def cell(strata: list[NDArray[np.float64]]) -> str:
    """The figures in percent; without an interval if no policy was trained."""
    mean, low, high = (f"{100 * value:.1f}" for value in interval(strata))
    return mean if max(map(len, strata)) == 1 else f"{mean} ({low} to {high})"


def table() -> str:
    """The table of the page in Markdown: a row for each policy."""
    rows = rows_of(RESULTS)
    names = list(TASKS)

    def column(policy: str, task: str, name: str = "success") -> NDArray[np.float64]:
        mine = [row[name] for row in rows if (row["algorithm"], row["task"]) == (policy, task)]
        return np.array(mine, np.float64)

    heads = ["policy", *names, "score", "CPU, minutes"]
    lines = [heads, ["---", *["---:"] * (len(heads) - 1)]]
    low, high = ([column(each, name) for name in names] for each in ("random", "planner"))
    for policy in (*BASELINES, *ALGORITHMS):
        runs = [column(policy, name) for name in names]
        shown = policy.upper() if policy in ALGORITHMS else f"`{policy}`"
        cells = [shown, *(cell([values]) if len(values) else "" for values in runs), ""]
        if all(map(len, [*runs, *low, *high])):
            ends = zip(runs, low, high, strict=True)
            cells[-1] = cell([(values - least) / (most - least) for values, least, most in ends])
        times = [column(policy, name, "cpu_seconds").max(initial=0) for name in names]
        minutes = ", ".join(str(math.ceil(time / 60)) for time in times if time)
        lines.append([*cells, minutes if policy in ALGORITHMS else ""])
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def page() -> str:
    """The page with the table as it should be."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + table() + END + rest.partition(END)[2]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["train", "baselines", "report"])
    parser.add_argument("--algorithms", nargs="+", choices=ALGORITHMS, default=ALGORITHMS)
    parser.add_argument("--tasks", nargs="+", choices=list(TASKS), default=list(TASKS))
    parser.add_argument("--seeds", nargs="+", type=int, default=range(5))
    options = parser.parse_args()
    done = {tuple(row[name] for name in KEY) for row in rows_of(RESULTS)}
    if options.what == "train":
        runs = itertools.product(options.tasks, options.seeds, options.algorithms)
        for task, seed, algorithm in runs:
            if (algorithm, task, str(seed)) not in done:
                train(algorithm, task, seed)
    elif options.what == "baselines":
        for task, name in itertools.product(options.tasks, BASELINES):
            if (name, task, "") not in done:
                baseline(name, task)
    else:
        PAGE.write_text(page(), "utf-8")


if __name__ == "__main__":
    main()
