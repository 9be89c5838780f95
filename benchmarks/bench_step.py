"""The speed of one environment, as ratios measured in turns in one process.

    python benchmarks/bench_step.py

prints, for several sizes, minima over interleaved rounds:

- floor: building the five dicts of a step with a shared matrix, and nothing else;
- idle: steps of idle drones, including resets at the time limit;
- moves: drones move back and forth, including resets;
- random: random actions from drones spread over the grid, including resets;
- DSSE: the same random actions in DSSE 1.1.9, if it is installed (`pip install DSSE==1.1.9`).
  Its rules end episodes less often, so it resets less often.

A second table compares the environment with and without posteriors (`bayesian_update`), and
alone and in the README's stack of wrappers, for random actions and for drones that search in
every step. The README's environment has posteriors.

Absolute figures depend on the machine; the ratios are stable.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from cases import SINGLE, LeftOutError, Size, spread_cells, steps_of_one
from peers import DSSE

from DroneSwarmSearch import DroneSwarmSearch
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

SIZES = ((7, 1), (20, 1), (20, 4), (50, 11), (100, 25))
SEARCH = 4
IDLE = 5


def floor(grid_size: int, n: int) -> Callable[[int], object]:
    """Build the five dicts of a step."""
    names = [f"drone{i}" for i in range(n)]
    positions = spread_cells(grid_size, n)
    matrix = np.zeros((grid_size, grid_size), np.float32)
    ones = dict.fromkeys(names, 1.0)
    no = dict.fromkeys(names, False)

    def step() -> tuple[dict[str, Any], ...]:
        observations = {
            name: {"observation": (position, matrix)}
            for name, position in zip(names, positions, strict=False)
        }
        infos = {name: {"Found": False} for name in names}
        return observations, ones.copy(), no.copy(), no.copy(), infos

    def run(steps: int) -> None:
        for _ in range(steps):
            step()

    return run


def cases(grid_size: int, n: int) -> dict[str, Callable[[int], object]]:
    names = [f"drone{i}" for i in range(n)]
    middle = (grid_size // 2, grid_size // 2)
    size = Size(grid_size, n)

    def ours() -> DroneSwarmSearch:
        return DroneSwarmSearch(grid_size=grid_size, n_drones=n, person_initial_position=middle)

    # The drones start in a row at the border and move in parallel.
    back_and_forth = [dict.fromkeys(names, 3), dict.fromkeys(names, 2)]
    runs = {
        "floor": floor(grid_size, n),
        "idle": steps_of_one(ours(), [dict.fromkeys(names, IDLE)]),
        "moves": steps_of_one(ours(), back_and_forth),
        "random": SINGLE.make(size, 1),
    }
    with contextlib.suppress(LeftOutError):
        runs["DSSE"] = DSSE.make(size, 1)
    return runs


def measure(runs: dict[Any, Callable[[int], object]], rounds: int, steps: int) -> dict[Any, float]:
    """The least microseconds per step of each case, measured in turns."""
    times: dict[Any, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(steps // 10)
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.perf_counter()
            run(steps)
            times[name].append((time.perf_counter() - start) / steps * 1e6)
    return {name: min(of_run) for name, of_run in times.items()}


def report_steps(rounds: int, steps: int) -> None:
    print("microseconds per step and ratios (minima)")
    print(
        f"{'grid, drones':>13} {'floor':>7} {'idle':>7} {'moves':>7} {'random':>7} {'DSSE':>7}"
        f" | {'idle/floor':>10} {'moves/floor':>11} {'DSSE/random':>11} {'DSSE/idle':>9}"
    )
    for grid_size, n in SIZES:
        figures = measure(cases(grid_size, n), rounds, steps)
        peer = figures.get("DSSE", float("nan"))
        print(
            f"{grid_size:>9}, {n:>2} "
            + " ".join(
                f"{figures.get(name, float('nan')):7.2f}"
                for name in ("floor", "idle", "moves", "random", "DSSE")
            )
            + f" | {figures['idle'] / figures['floor']:10.2f}"
            f" {figures['moves'] / figures['floor']:11.2f}"
            f" {peer / figures['random']:11.1f} {peer / figures['idle']:9.1f}"
        )


def report_wrappers(rounds: int, steps: int) -> None:
    print("\nmicroseconds per step with posteriors and in the README's stack of wrappers (minima)")
    print(
        f"{'grid, drones':>13} {'actions':>7} {'drift':>7} {'stack':>7} {'poster.':>7} {'stack':>7}"
        f" | {'posterior/drift':>15} {'stack speed':>12} {'with posteriors':>15}"
    )
    for grid_size, n in ((7, 1), (20, 4), (50, 11)):
        names = [f"drone{i}" for i in range(n)]
        drawn = np.random.default_rng(0).integers(0, 6, (997, n)).tolist()
        for kind, actions in (
            ("random", [dict(zip(names, row, strict=True)) for row in drawn]),
            ("search", [dict.fromkeys(names, SEARCH)]),
        ):
            runs = {
                (posterior, stacked): steps_of_one(
                    environment(grid_size, n, posterior, stacked), actions
                )
                for posterior in (False, True)
                for stacked in (False, True)
            }
            figures = measure(runs, rounds, steps)
            drift, drift_stack, posterior, stack = figures.values()
            print(
                f"{grid_size:>9}, {n:>2}  {kind:>7} {drift:7.2f} {drift_stack:7.2f}"
                f" {posterior:7.2f} {stack:7.2f} | {posterior / drift:15.2f}"
                f" {drift / drift_stack:12.0%} {posterior / stack:15.0%}"
            )


def environment(grid_size: int, n: int, posterior: bool, stacked: bool) -> Any:
    """The environment, alone or in the README's stack of wrappers."""
    env = DroneSwarmSearch(
        grid_size=grid_size,
        n_drones=n,
        person_initial_position=(grid_size // 2, grid_size // 2),
        bayesian_update=posterior,
    )
    if not stacked:
        return env
    return ActionMask(FlatObservation(ScaledRewards(env)), right_of_way=True)


def report_life(rounds: int) -> None:
    """Print the time of constructors and resets."""

    def make() -> DroneSwarmSearch:
        return DroneSwarmSearch(grid_size=50, n_drones=11)

    env = make()
    env.reset(seed=0)
    tasks: dict[str, Callable[[], object]] = {
        "constructor": make,
        "reset()": env.reset,
        "reset(seed=1)": lambda: env.reset(seed=1),
        "reset(vector=...)": lambda: env.reset(vector=(-0.5, -0.5)),
    }
    print("\nmicroseconds at (50, 11), with cached tables")
    for name, task in tasks.items():
        times = []
        for _ in range(rounds * 100):
            start = time.perf_counter()
            task()
            times.append((time.perf_counter() - start) * 1e6)
        print(f"{name:>18} {statistics.median(times):8.1f}")


def report_memory(count: int) -> None:
    """Print how much memory grows while environments are created and deleted."""
    try:
        import resource
    except ImportError:
        return

    def live() -> None:
        env = DroneSwarmSearch(grid_size=20, n_drones=4, person_initial_position=(9, 9))
        env.reset(seed=1)
        for _ in range(3):
            env.step(dict.fromkeys(env.agents, IDLE))

    def peak() -> float:
        unit = 2**20 if sys.platform == "darwin" else 2**10
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit

    for _ in range(200):
        live()
    gc.collect()
    before = peak()
    for _ in range(count):
        live()
    print(f"\n{count} environments created and deleted: peak memory + {peak() - before:.1f} MiB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds (15)")
    parser.add_argument("--steps", type=int, default=2000, help="steps per round (2000)")
    parser.add_argument(
        "--environments", type=int, default=10_000, help="environments made for memory (10000)"
    )
    options = parser.parse_args()
    report_steps(options.rounds, options.steps)
    report_wrappers(options.rounds, options.steps)
    report_life(options.rounds)
    report_memory(options.environments)


if __name__ == "__main__":
    main()
