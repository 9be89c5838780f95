"""The benchmark: `python -m DroneSwarmSearch bench`.

`cases` and `peers` say what is measured, `groups` what is compared with what,
`turns` and `memory` measure, `report` tells.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch.bench import groups, memory, report
from DroneSwarmSearch.bench.cases import (
    TIMESTEP_LIMIT,
    BenchmarkCase,
    LeftOutError,
    Run,
    Size,
)
from DroneSwarmSearch.bench.groups import GROUPS, Ratio
from DroneSwarmSearch.bench.peers import COIN_GAME_SIZE
from DroneSwarmSearch.bench.turns import Spread, take_turns

__all__ = ["main"]

PROGRAM = "python -m DroneSwarmSearch bench"

DESCRIPTION = """\
Measures speed, as ratios between cases taken in turns within one process, and
memory. Absolute figures swing with the machine; the ratios hold.
"""

EPILOG = """\
groups: batch (the engine, by index and with matrices, and one environment), posterior,
forecasts (a drift for each row, or for each episode), views (Gymnasium's vector environments),
peers (DSSE, JaxMARL's coin_game, where they are installed), memory.
"""

SIZES = [Size(7, 1), Size(20, 4), Size(50, 11)]
MEMORY_SIZE = Size(20, 4)

USUAL: dict[str, Any] = {"num_envs": [1, 8, 64, 1024, 8192], "rounds": 9, "seconds": 0.2}
SHORT: dict[str, Any] = {"num_envs": [1, 8], "rounds": 3, "seconds": 0.002}
WARM_UP, WARM_UP_SHORT = TIMESTEP_LIMIT, 5
"""Steps: by default as many as an episode has at most."""

MEMORY_ROWS, MEMORY_ROWS_SHORT = 100_000, 1000
MEMORY_STEPS, MEMORY_STEPS_SHORT = (100, 300), (10, 30)

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

Competitor = tuple[BenchmarkCase, int | None]
"""A case and the number of searches; None where that makes no difference."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmark.

    Args:
        argv: the command line's arguments; those of the process if None.

    Returns:
        The exit code: 0, or 130 after Ctrl-C.

    Raises:
        SystemExit: help was asked for (code 0), or an option cannot be met (code 2).
    """
    given = list(sys.argv[1:] if argv is None else argv)
    parser = _parser()
    options = parser.parse_args(given)
    for name, value in (SHORT if options.short else USUAL).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    progress = report.Progress()
    try:
        told = _run(options, shlex.join([*PROGRAM.split(), *given]), progress)
    except KeyboardInterrupt:
        progress("")
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has gone; what Python still holds of it must not fail too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    if options.json is not None:
        options.json.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return 0


# The command line.


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=PROGRAM, description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument(
        "--only", nargs="+", metavar="GROUP", choices=list(GROUPS), help="groups to measure (all)"
    )
    parser.add_argument(
        "--sizes",
        nargs="+",
        metavar="SIZE",
        type=_size,
        default=SIZES,
        help=f"cells along a side and drones ({' '.join(map(str, SIZES))})",
    )
    parser.add_argument(
        "--num-envs",
        nargs="+",
        metavar="E",
        type=_count,
        help=f"searches in a batch ({' '.join(map(str, USUAL['num_envs']))})",
    )
    parser.add_argument(
        "--rounds", metavar="N", type=_count, help=f"turns of each case ({USUAL['rounds']})"
    )
    parser.add_argument("--seconds", type=_seconds, help=f"for a turn, about ({USUAL['seconds']})")
    parser.add_argument(
        "--json", metavar="FILE", type=_writable, help="write all figures to a file"
    )
    parser.add_argument(
        "--short",
        action="store_true",
        help="see in seconds that everything runs; the figures are then worth little",
    )
    return parser


def _size(text: str) -> Size:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    size = Size(*map(int, match.groups())) if match else Size(0, 0)
    if size.grid_size < 2 or not 1 <= size.n_drones <= size.grid_size**2:
        raise argparse.ArgumentTypeError(
            f"must be cells along a side and drones that fit, such as 20x4, got {text!r}"
        )
    return size


def _count(text: str) -> int:
    if not re.fullmatch(r"\d+", text) or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be an integer of at least 1, got {text!r}")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number above 0, got {text!r}")
    return seconds


def _writable(text: str) -> Path:
    """A file that can be written, which is better known before the measurements."""
    path = Path(text)
    existed = path.exists()
    try:
        with path.open("ab"):
            pass
    except OSError as error:
        raise argparse.ArgumentTypeError(f"cannot write {text}: {error.strerror}") from None
    if not existed:
        path.unlink()
    return path


# The measurements.


def _run(options: argparse.Namespace, command: str, progress: report.Progress) -> dict[str, Any]:
    """Measure what the options ask for, and tell it; returns it as data."""
    chosen = [name for name in GROUPS if options.only is None or name in options.only]
    parameters = {
        "groups": chosen,
        "sizes": [str(size) for size in options.sizes],
        "num_envs": options.num_envs,
        "rounds": options.rounds,
        "seconds": options.seconds,
        "warm_up_steps": WARM_UP_SHORT if options.short else WARM_UP,
        "timestep_limit": TIMESTEP_LIMIT,
    }
    around = report.surroundings()
    print(report.heading(command, around, parameters), flush=True)
    told = {"command": command, **around, "parameters": parameters, "sizes": [], "memory": None}
    common = [ratio for name in chosen for ratio in GROUPS[name]]
    comparisons = [(size, common) for size in options.sizes] if common else []
    if groups.PEERS in chosen:
        comparisons.append((COIN_GAME_SIZE, list(groups.COIN_GAME_RATIOS)))
    for size, ratios in comparisons:
        told["sizes"].append(_compare(size, ratios, parameters, progress))
    if groups.MEMORY in chosen:
        told["memory"] = _measure_memory(options.short, progress)
    return told


def _compare(
    size: Size, ratios: Sequence[Ratio], parameters: dict[str, Any], progress: report.Progress
) -> dict[str, Any]:
    """Measure a size, and tell it; returns it as data."""
    runs, left_out = _prepared(size, ratios, parameters["num_envs"], progress)
    rates = take_turns(
        runs,
        rounds=parameters["rounds"],
        seconds=parameters["seconds"],
        warm_up=parameters["warm_up_steps"],
        tell=_teller(size, runs, parameters["rounds"], progress),
    )
    speeds = [((c.name, num_envs), figures) for (c, num_envs), figures in rates.items()]
    compared = [
        ((str(ratio), num_envs), [a / b for a, b in zip(rates[of], rates[to], strict=True)])
        for ratio, num_envs, of, to in _pairs(ratios, parameters["num_envs"])
        if of in rates and to in rates
    ]
    progress("")
    print(
        report.size_text(
            size,
            [(*key, Spread.of(figures)) for key, figures in speeds],
            [(*key, Spread.of(figures)) for key, figures in compared],
            left_out,
        ),
        flush=True,
    )
    return {
        "grid_size": size.grid_size,
        "n_drones": size.n_drones,
        "steps_per_second": _as_data(speeds),
        "ratios": _as_data(compared),
        "left_out": left_out,
    }


def _prepared(
    size: Size, ratios: Sequence[Ratio], counts: Sequence[int], progress: report.Progress
) -> tuple[dict[Competitor, Run], list[str]]:
    """All that the ratios need, and what of it is left out."""
    cases = dict.fromkeys(each for ratio in ratios for each in ratio)
    wanted = dict.fromkeys(_competitor(each, n) for each in cases for n in counts)
    runs: dict[Competitor, Run] = {}
    left_out: dict[str, None] = {}
    for case, num_envs in wanted:
        progress(f"{size}: preparing {_named(case, num_envs)}")
        try:
            runs[case, num_envs] = case.make(size, num_envs or 1)
        except LeftOutError as error:
            left_out[f"{case.name}, {error}"] = None
    compared = {
        each
        for _, _, of, to in _pairs(ratios, counts)
        if {of, to} <= runs.keys()
        for each in (of, to)
    }
    return {key: run for key, run in runs.items() if key in compared}, list(left_out)


def _pairs(
    ratios: Sequence[Ratio], counts: Sequence[int]
) -> Iterator[tuple[Ratio, int, Competitor, Competitor]]:
    """Every ratio for every number of searches, and who is compared with whom."""
    for ratio in ratios:
        for num_envs in counts:
            of, to = (_competitor(each, num_envs) for each in ratio)
            yield ratio, num_envs, of, to


def _competitor(case: BenchmarkCase, num_envs: int) -> Competitor:
    return case, num_envs if case.batched else None


def _named(case: BenchmarkCase, num_envs: int | None) -> str:
    if num_envs is None:
        return case.name
    return f"{case.name}, {num_envs} search{'' if num_envs == 1 else 'es'}"


def _teller(
    size: Size, runs: dict[Competitor, Run], rounds: int, progress: report.Progress
) -> Callable[[Competitor, int], None]:
    """Shows how far the measurement of a size has come."""
    turns = len(runs) * (rounds + 1)
    turn = 0

    def tell(competitor: Competitor, number: int) -> None:
        nonlocal turn
        turn += 1
        what = f"round {number} of {rounds}" if number else "warming up"
        progress(f"{size}: {turn * 100 // turns} %, {what}, {_named(*competitor)}")

    return tell


def _as_data(figures: Iterable[tuple[tuple[str, int | None], list[float]]]) -> list[dict[str, Any]]:
    return [
        {"name": name, "num_envs": num_envs, **Spread.of(each)._asdict(), "rounds": each}
        for (name, num_envs), each in figures
    ]


def _measure_memory(short: bool, progress: report.Progress) -> memory.Figures | None:
    """Measure memory, and tell it; returns it as data."""
    rows, steps = MEMORY_ROWS, MEMORY_STEPS
    if short:
        rows, steps = MEMORY_ROWS_SHORT, MEMORY_STEPS_SHORT
    progress(f"memory of {rows} searches")
    try:
        figures = memory.measure(MEMORY_SIZE, rows, steps)
    except LeftOutError as error:
        progress("")
        print(f"\n{report.left_out_text(f'memory, {error}')}")
        return None
    progress("")
    print(report.memory_text(figures), flush=True)
    return figures
