"""Measure the speed of batches, and their memory.

    python benchmarks/bench_vector.py

Speeds are environment steps per second: one step of a swarm counts once, and resets are
included. The cases take turns within one process, because absolute figures vary with the
machine while ratios hold. Tables show medians over the rounds, with quartiles in parentheses.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import multiprocessing
import os
import platform
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cases
from cases import BenchmarkCase, LeftOutError, Size
from peers import COIN_GAME, COIN_GAME_SCAN, COIN_GAME_SIZE, DSSE
from timing import Run, Spread, take_turns

Ratio = tuple[BenchmarkCase, BenchmarkCase]
Competitor = tuple[BenchmarkCase, int | None]
"""A case and its number of searches; None if it does not depend on that."""

GROUPS: dict[str, tuple[Ratio, ...]] = {
    "batch": (
        (cases.ENGINE, cases.SINGLE),
        (cases.MATRICES, cases.SINGLE),
    ),
    "training": (
        (cases.TRAINING, cases.SINGLE_POSTERIOR),
        (cases.TRAINING_SAMPLER, cases.TRAINING),
    ),
    "posterior": ((cases.POSTERIOR, cases.SINGLE_POSTERIOR),),
    "radio": ((cases.RADIOS, cases.ALL_HEAR),),
    "forecasts": ((cases.SAMPLER, cases.MATRICES),),
    "situations": (
        (cases.TWO_HYPOTHESES, cases.ONE_HYPOTHESIS),
        (cases.TRACKS, cases.TWO_HYPOTHESES),
        (cases.CATALOGUE, cases.TWO_HYPOTHESES),
        (cases.CATALOGUE_ENGINE, cases.ONE_SITUATION_ENGINE),
    ),
    "views": (
        (cases.SWARM_ENV, cases.MATRICES),
        (cases.DRONE_ENV, cases.MATRICES),
    ),
    "peers": ((cases.TRAINING, DSSE), (cases.ENGINE, DSSE), (cases.MATRICES, DSSE)),
    "coin-game": ((cases.ENGINE, COIN_GAME), (cases.ENGINE, COIN_GAME_SCAN)),
    "memory": (),
}
"""The ratios of each group, measured at every size; coin_game has a separate size."""

SIZES = [Size(7, 1), Size(20, 4), Size(50, 11)]
COUNTS = [1, 8, 64, 1024, 8192]
ROUNDS = 9
SECONDS = 0.2
SHORT: dict[str, Any] = {"num_envs": [1, 8], "rounds": 3, "seconds": 0.002}
WARM_UP = cases.TIMESTEP_LIMIT
SHORT_WARM_UP = 5
MEMORY_SIZE = Size(20, 4)
MEMORY_SEARCHES = 100_000
MEMORY_STEPS = (100, 300)


def measure(size: Size, ratios: Sequence[Ratio], options: argparse.Namespace) -> dict[str, Any]:
    """Measure the ratios at one size; prints the result, and returns it as data."""
    print(f"\n{size.grid_size} x {size.grid_size} cells, {size.n_drones} drones", flush=True)
    runs, left_out = prepare(size, ratios, options.num_envs)
    for reason in left_out:
        print(f"skipped: {reason}")
    rates = take_turns(
        runs,
        rounds=options.rounds,
        seconds=options.seconds,
        warm_up=SHORT_WARM_UP if options.short else WARM_UP,
    )
    speeds = [entry(case.name, num_envs, figures) for (case, num_envs), figures in rates.items()]
    compared = [
        entry(f"{a.name} / {b.name}", n, [x / y for x, y in zip(rates[p], rates[q], strict=True)])
        for (a, b), n, p, q in pairs(ratios, options.num_envs)
        if p in rates and q in rates
    ]
    print_table("steps per second", speeds)
    print_table("ratio", compared)
    return {**size._asdict(), "steps_per_second": speeds, "ratios": compared, "left_out": left_out}


def prepare(
    size: Size, ratios: Sequence[Ratio], counts: Sequence[int]
) -> tuple[dict[Competitor, Run], list[str]]:
    """Prepare both sides of every ratio; returns them, and why others are skipped."""
    runs: dict[Competitor, Run] = {}
    reasons: dict[Competitor, str] = {}
    for _, n, *competitors in pairs(ratios, counts):
        for case, num_envs in competitors:
            if (case, num_envs) not in runs.keys() | reasons.keys():
                try:
                    runs[case, num_envs] = case.make(size, n)
                except LeftOutError as error:
                    reasons[case, num_envs] = f"{case.name}, {error}"
    complete = [{p, q} for *_, p, q in pairs(ratios, counts) if {p, q} <= runs.keys()]
    wanted = set().union(*complete)
    return {key: run for key, run in runs.items() if key in wanted}, list(
        dict.fromkeys(reasons.values())
    )


def pairs(
    ratios: Sequence[Ratio], counts: Sequence[int]
) -> Iterator[tuple[Ratio, int, Competitor, Competitor]]:
    """Every ratio at every number of searches, with the two cases that it compares."""
    for ratio in ratios:
        for n in counts:
            p, q = ((case, n if case.batched else None) for case in ratio)
            yield ratio, n, p, q


def entry(name: str, num_envs: int | None, figures: list[float]) -> dict[str, Any]:
    return {"name": name, "num_envs": num_envs, **Spread.of(figures)._asdict()}


def print_table(title: str, entries: list[dict[str, Any]]) -> None:
    """Print medians and quartiles; a case without a number of searches holds for any."""
    width = max((len(each["name"]) for each in entries), default=0)
    if entries:
        print(f"\n{title:<{width}} {'searches':>9} {'median':>12} (quartiles)")
    for each in entries:
        count = "any" if each["num_envs"] is None else f"{each['num_envs']:,}"
        median, lower, upper = (number(each[key]) for key in ("median", "lower", "upper"))
        print(f"{each['name']:<{width}} {count:>9} {median:>12} ({lower} to {upper})")
    sys.stdout.flush()


def number(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:#.3g}"


def memory(searches: int, steps: tuple[int, int]) -> dict[str, Any] | None:
    """Measure the peak memory of a batch without matrices in a separate process."""
    if not Path("/proc/self/status").exists():
        print("\nskipped: memory, which is read from /proc")
        return None
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        before, first, last = pool.apply(memory_peaks, (searches, steps))
    print(f"\nMemory of {searches:,} searches without matrices at {MEMORY_SIZE}, in MiB:")
    print(f"{before:,.0f} before the batch is made, {first:,.0f} at the peak of {steps[0]} steps,")
    print(f"{last - first:,.1f} more at the peak of {steps[1]} steps")
    peaks = {"peak_mib_before": before, "peak_mib": first, "growth_mib": last - first}
    return {**MEMORY_SIZE._asdict(), "num_envs": searches, "steps": list(steps), **peaks}


def memory_peaks(searches: int, steps: tuple[int, int]) -> list[float]:
    """The peak before the batch is made, and after each number of steps."""
    peaks = [peak_mib()]
    run = cases.ENGINE.make(MEMORY_SIZE, searches)
    for more in (steps[0], steps[1] - steps[0]):
        run(more)
        peaks.append(peak_mib())
    return peaks


def peak_mib() -> float:
    peak = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text("ascii", "replace"))
    assert peak is not None
    return int(peak[1]) / 2**10


def machine() -> dict[str, Any]:
    """The versions and processors that the results depend on."""
    versions = {"python": platform.python_version()}
    for name in ("DroneSwarmSearchEnvironment", "numpy", "gymnasium", "DSSE", "jax", "jaxmarl"):
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {"versions": versions, "cpus": os.cpu_count(), "system": platform.platform()}


def size_of(text: str) -> Size:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    size = Size(*map(int, match.groups())) if match else Size(0, 0)
    if size.grid_size < 2 or not 1 <= size.n_drones <= size.grid_size**2:
        raise argparse.ArgumentTypeError(f"must be CELLSxDRONES, such as 20x4, got {text!r}")
    return size


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=list(GROUPS))
    parser.add_argument("--sizes", nargs="+", type=size_of, default=SIZES, help="7x1 20x4 50x11")
    parser.add_argument(
        "--num-envs", nargs="+", type=int, default=COUNTS, help="searches in a batch"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"turns per case ({ROUNDS})")
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"per turn ({SECONDS})")
    parser.add_argument("--json", metavar="FILE", type=Path, help="save the figures")
    parser.add_argument("--short", action="store_true", help="try everything; figures are rough")
    if parser.parse_known_args(argv)[0].short:
        parser.set_defaults(**SHORT)
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> None:
    options = parse(argv)
    common = [ratio for name in options.only if name != "coin-game" for ratio in GROUPS[name]]
    results: dict[str, Any] = {
        "command": " ".join(["python benchmarks/bench_vector.py", *(argv or sys.argv[1:])]),
        **machine(),
        "parameters": {"num_envs": options.num_envs, "rounds": options.rounds},
        "sizes": [measure(size, common, options) for size in options.sizes if common],
    }
    if "coin-game" in options.only:
        results["sizes"].append(measure(COIN_GAME_SIZE, GROUPS["coin-game"], options))
    if "memory" in options.only:
        short = 1000, (10, 30)
        results["memory"] = memory(*(short if options.short else (MEMORY_SEARCHES, MEMORY_STEPS)))
    if options.json is not None:
        options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
