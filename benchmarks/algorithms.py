"""What algorithms reach on the tasks of the benchmark: tune, train, evaluate, report.

    python benchmarks/algorithms.py tune                        # what is missing, run after run
    python benchmarks/algorithms.py train
    python benchmarks/algorithms.py train --algorithms qmix --tasks drift --seeds 0
    python benchmarks/algorithms.py baselines
    python benchmarks/algorithms.py report                      # the table

Training is that of examples/train_benchmarl.py and, for ppo, examples/train_own_loop.py. Results
and curves are rows of CSV files, which are written after each run (those of the yardstick after ten
searches), so an interruption loses no more than the run under way. Several processes may work on
different tasks at the same time.
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
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from csv_rows import rows_of
from markdown_tables import markdown, with_table
from numpy.typing import NDArray

from DroneSwarmSearch.training import TASKS

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs/benchmark"
RESULTS = FOLDER / "results.csv"
CURVES = FOLDER / "curves.csv"
TUNING = FOLDER / "tuning.csv"
PLANS = FOLDER / "yardstick.csv"
PAGE = FOLDER / "index.md"
ALGORITHMS = ("ippo", "ippo-gru", "mappo", "iql", "vdn", "qmix", "ppo")
NAMES = {"ippo-gru": "IPPO with a GRU", "ppo": "PPO, own loop"}
YARDSTICK = "planner, all known"
BASELINES = (
    "random",
    "greedy-matrix",
    "greedy-posterior",
    "greedy-forecast",
    "rollout",
    "imitation",
)
SLOW = 1  # rounds of policies that are made for each search
PORTION = 10  # searches of the yardstick that are planned before they are written
STEPS = 250_000  # of the environments; a run takes minutes on one CPU
FEWER_STEPS = {"fleet": 100_000}  # twelve drones learn from each
KEY = ("algorithm", "task", "seed")
POINTS = 40  # of a curve

# Tuning: settings near the first one are tried on two tasks, with a seed that no result has.
TUNED_ON = ("drift", "wreck")
TUNING_SEED = 100
TUNING_STEPS = 200_000
LAST = 0.1  # the part of the curve whose mean success is compared
Setting = Mapping[str, float]
OWN_LOOP: Setting = {"lr": 3e-3, "entropy": 0.003, "gamma": 0.99, "swarms": 100}
POLICY_GRADIENT: Setting = {"lr": 1.5e-3, "exploration": 0.001, "gamma": 0.99, "swarms": 100}
VALUES: Setting = {"lr": 5e-4, "exploration": 0.02, "gamma": 0.99, "swarms": 100}
FIRST = {
    "ippo": POLICY_GRADIENT,
    "ippo-gru": POLICY_GRADIENT,
    "mappo": POLICY_GRADIENT,
    "iql": VALUES,
    "vdn": VALUES,
    "qmix": VALUES,
    "ppo": OWN_LOOP,
}

# The best of the candidates in the mean of both tasks, see tuning.csv.
TUNED: Mapping[str, Setting] = {
    "ippo": {**POLICY_GRADIENT, "gamma": 0.95},
    "ippo-gru": {**POLICY_GRADIENT, "gamma": 0.95},
    "mappo": {**POLICY_GRADIENT, "gamma": 0.95},
    "iql": {**VALUES, "lr": 1e-3},
    "vdn": {**VALUES, "gamma": 0.95},
    "qmix": {**VALUES, "gamma": 0.95},
    "ppo": {**OWN_LOOP, "entropy": 0.015},
}


def candidates(algorithm: str) -> Iterator[Setting]:
    """The eight settings that are tried: the first one, and others that differ from it in one."""
    first = FIRST[algorithm]
    exploration = "entropy" if algorithm == "ppo" else "exploration"
    yield first
    for name, factors in (("lr", (0.5, 2.0)), (exploration, (0.2, 5.0))):
        for factor in factors:
            yield {**first, name: first[name] * factor}
    yield {**first, "gamma": 0.95}
    yield {**first, "gamma": 1.0}
    yield {**first, "swarms": 50}


def append(path: Path, rows: list[dict[str, object]]) -> None:
    """Add rows to a CSV file."""
    path.parent.mkdir(exist_ok=True)
    is_new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        if is_new:
            writer.writeheader()
        writer.writerows(rows)


def tune(algorithm: str, task: str, number: int) -> None:
    """Try a setting, and keep its success at the end of the training."""
    setting = list(candidates(algorithm))[number]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        cpu = run(algorithm, task, TUNING_SEED, folder, TUNING_STEPS, setting)
        curve = [float(row["found"]) for row in rows_of(folder / "curve.csv")]
    last = curve[-math.ceil(LAST * len(curve)) :]
    key = {"algorithm": algorithm, "task": task, "setting": number}
    values = {name: f"{value:g}" for name, value in setting.items()}
    if "entropy" in values:
        values["exploration"] = values.pop("entropy")
    order = {name: values[name] for name in ("lr", "exploration", "gamma", "swarms")}
    success = f"{np.mean(last):.4f}"
    append(TUNING, [{**key, **order, "success": success, "cpu_seconds": round(cpu)}])


def run(algorithm: str, task: str, seed: int, folder: Path, steps: int, setting: Setting) -> float:
    """Train with the script of the page; returns the CPU seconds."""
    command = [sys.executable, str(ROOT / "examples" / script(algorithm))]
    if algorithm != "ppo":
        command.append(f"--algorithm={algorithm}")
    options = {"task": task, "seed": seed, "out": folder, "steps": steps, **setting}
    command += [f"--{name}={value}" for name, value in options.items()]
    before = os.times()
    subprocess.run([*command, "--no-comparison"], check=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def script(algorithm: str) -> str:
    """The script that trains an algorithm."""
    return "train_own_loop.py" if algorithm == "ppo" else "train_benchmarl.py"


def train(algorithm: str, task: str, seed: int) -> None:
    """Train once, as the command on the page does, and keep the result and the curve."""
    key = dict(zip(KEY, (algorithm, task, seed), strict=True))
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        steps = FEWER_STEPS.get(task, STEPS)
        cpu = run(algorithm, task, seed, folder, steps, TUNED[algorithm])
        weights = folder / ("checkpoint.pt" if algorithm == "ppo" else "policy.pt")
        policy = f"{ROOT / 'examples' / script(algorithm)}:Trained:{weights}"
        sys.path.insert(0, str(ROOT / "examples"))
        success = TASKS[task].evaluate(policy).success.value
        curve = rows_of(folder / "curve.csv")
    row = {**key, "steps": steps, "success": f"{success:.5f}", "cpu_seconds": round(cpu)}
    append(RESULTS, [row])
    portions = np.array_split(np.arange(len(curve)), POINTS)
    found = np.array([float(row["found"]) for row in curve])
    append(
        CURVES,
        [
            {**key, "steps": curve[which[-1]]["steps"], "found": f"{found[which].mean():.4f}"}
            for which in portions
            if len(which)
        ],
    )


def yardstick(task: str) -> float:
    """The mean success of the yardstick, whose plans are kept search by search."""
    # The searches of radio are those of wreck, and drones that know all need no radio.
    task = {"radio": "wreck"}.get(task, task)

    def planned() -> dict[int, float]:
        mine = [row for row in rows_of(PLANS) if row["task"] == task]
        return {int(row["search"]): float(row["success"]) for row in mine}

    done = planned()
    missing = [number for number in range(len(TASKS[task].held_out())) if number not in done]
    for first in range(0, len(missing), PORTION):
        numbers = missing[first : first + PORTION]
        found = TASKS[task].yardstick(numbers)
        rows = [
            {"task": task, "search": number, "success": f"{success:.5f}"}
            for number, success in zip(numbers, found, strict=True)
        ]
        append(PLANS, rows)
    return float(np.mean(list(planned().values())))


def baseline(name: str, task: str) -> None:
    """Evaluate a packaged policy, or the yardstick, on the held-out searches."""
    before = time.process_time()
    if name == YARDSTICK:
        success = yardstick(task)
    else:
        rounds = None if name in ("random", "greedy-matrix") else SLOW
        success = TASKS[task].evaluate(name, rounds=rounds).success.value
    cpu = time.process_time() - before
    key = dict(zip(KEY, (name, task, ""), strict=True))
    row = {**key, "steps": "", "success": f"{success:.5f}", "cpu_seconds": round(cpu)}
    append(RESULTS, [row])


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
    return mean if max(map(len, strata)) == 1 else f"{mean} ({low}\N{EN DASH}{high})"


def table() -> str:
    """The table of the page in Markdown: a row for each policy."""
    rows = rows_of(RESULTS)
    names = list(TASKS)

    def column(policy: str, task: str, name: str = "success") -> NDArray[np.float64]:
        mine = [row[name] for row in rows if (row["algorithm"], row["task"]) == (policy, task)]
        return np.array(mine, np.float64)

    lines = [["policy", *names, "score", "CPU, minutes"]]
    low, high = ([column(each, name) for name in names] for each in ("random", YARDSTICK))
    for policy in (*BASELINES, YARDSTICK, *ALGORITHMS):
        runs = [column(policy, name) for name in names]
        if not any(map(len, runs)):
            continue
        shown = NAMES.get(policy, policy.upper()) if policy in ALGORITHMS else f"`{policy}`"
        cells = [shown, *(cell([values]) if len(values) else "" for values in runs), ""]
        if all(map(len, [*runs, *low, *high])):
            ends = zip(runs, low, high, strict=True)
            cells[-1] = cell([(values - least) / (most - least) for values, least, most in ends])
        times = [column(policy, name, "cpu_seconds").max(initial=0) for name in names]
        minutes = ", ".join(str(math.ceil(time / 60)) for time in times if time)
        lines.append([*cells, minutes if policy in ALGORITHMS else ""])
    return markdown(lines)


def page() -> str:
    """The page with the table as it should be."""
    return with_table(PAGE, "python benchmarks/algorithms.py report", table())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    tuning = commands.add_parser("tune", help="try settings")
    training = commands.add_parser("train", help="train with the best setting, and evaluate")
    flying = commands.add_parser("baselines", help="evaluate policies that need no training")
    commands.add_parser("report", help="write the table of the page")
    for each in (tuning, training):
        each.add_argument("--algorithms", nargs="+", choices=ALGORITHMS, default=ALGORITHMS)
    for each, tasks in ((tuning, TUNED_ON), (training, TASKS), (flying, TASKS)):
        each.add_argument("--tasks", nargs="+", choices=tuple(tasks), default=tuple(tasks))
    training.add_argument("--seeds", nargs="+", type=int, default=range(5), help="0 1 2 3 4")
    names = (*BASELINES, YARDSTICK)
    flying.add_argument("--policies", nargs="+", choices=names, default=names)
    options = parser.parse_args()
    done = {tuple(row[name] for name in KEY) for row in rows_of(RESULTS)}
    if options.command == "tune":
        tried = {(row["algorithm"], row["task"], row["setting"]) for row in rows_of(TUNING)}
        for number, task, name in itertools.product(range(8), options.tasks, options.algorithms):
            if (name, task, str(number)) not in tried:
                tune(name, task, number)
    elif options.command == "train":
        for seed, task, name in itertools.product(options.seeds, options.tasks, options.algorithms):
            if (name, task, str(seed)) not in done:
                train(name, task, seed)
    elif options.command == "baselines":
        for task, name in itertools.product(options.tasks, options.policies):
            if (name, task, "") not in done:
                baseline(name, task)
    else:
        PAGE.write_text(page(), "utf-8")


if __name__ == "__main__":
    main()
