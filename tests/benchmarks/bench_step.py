"""How fast one environment is, as ratios taken in turns within one process.

    python tests/benchmarks/bench_step.py

prints, for several sizes, medians over interleaved rounds:

- floor: what building the five dicts of a step costs, with a shared matrix, nothing else;
- idle: steps in which nothing ends an episode before its limit, resets included;
- moves: the drones fly to and fro, likewise;
- random: random actions from drones spread over the grid, resets included;
- DSSE: the same random actions in DSSE 1.1.9, where `pip install DSSE==1.1.9` has been
  run; resets included. Its rules end episodes less often, so that it resets less.

Absolute figures swing with the machine; the ratios hold.
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

SIZES = ((7, 1), (20, 1), (20, 4), (50, 11), (100, 25))
IDLE = 5


def floor(grid_size: int, n: int) -> Callable[[int], object]:
    """The five dicts alone."""
    names = [f"drone{i}" for i in range(n)]
    positions = spread_cells(grid_size, n)
    matrix = np.zeros((grid_size, grid_size), np.float32)
    ones, no = dict.fromkeys(names, 1.0), dict.fromkeys(names, False)

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

    # The drones start at the border in a row: out and back, all alike, nobody meets.
    to_and_fro = [dict.fromkeys(names, 3), dict.fromkeys(names, 2)]
    runs = {
        "floor": floor(grid_size, n),
        "idle": steps_of_one(ours(), [dict.fromkeys(names, IDLE)]),
        "moves": steps_of_one(ours(), to_and_fro),
        "random": SINGLE.make(size, 1),
    }
    with contextlib.suppress(LeftOutError):
        runs["DSSE"] = DSSE.make(size, 1)
    return runs


def measure(runs: dict[str, Callable[[int], object]], rounds: int, steps: int) -> dict[str, float]:
    """Median microseconds a step of each case, taken in turns."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for run in runs.values():
        run(steps // 10)
    for _ in range(rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            run(steps)
            times[name].append((time.perf_counter() - begin) / steps * 1e6)
    return {name: statistics.median(of_run) for name, of_run in times.items()}


def report_steps(rounds: int, steps: int) -> None:
    print("microseconds a step and ratios (medians)")
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


def report_life(rounds: int) -> None:
    """What an environment costs to make, to reset and to leave."""

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
    print("\nmicroseconds at (50, 11), tables made")
    for name, task in tasks.items():
        times = []
        for _ in range(rounds * 100):
            begin = time.perf_counter()
            task()
            times.append((time.perf_counter() - begin) * 1e6)
        print(f"{name:>18} {statistics.median(times):8.1f}")


def report_memory(count: int) -> None:
    """Whether environments made and dropped leave memory where it was."""
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
    print(f"\n{count} environments made and dropped: peak memory + {peak() - before:.1f} MiB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="interleaved rounds (15)")
    parser.add_argument("--steps", type=int, default=2000, help="steps a round (2000)")
    options = parser.parse_args()
    report_steps(options.rounds, options.steps)
    report_life(options.rounds)
    report_memory(10_000)


if __name__ == "__main__":
    main()
