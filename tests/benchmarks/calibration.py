"""How far the matrix is from where the person is, here and in the packages before.

    python tests/benchmarks/calibration.py

plays 10,000 seeded episodes of each setting in which nobody searches: a grid of 40 by 40,
the person in the middle, 60 steps. At every step it compares the share of episodes in which
the person is in each cell with the matrix that the drones were shown: the total variation
between the two, half the sum of the absolute differences. Frequencies of a finite number of
episodes are never equal to their forecast, so that a true matrix has a distance as well, the
floor: its mean is known exactly (`floor`), and it is printed beside.

BenchmarkCases are measured where they are installed, each through its own constructor, `reset`,
`step` and the person's position: this package, DSSE 1.1.9 (`pip install DSSE==1.1.9`) and the
2023 package, whose import path this package answers to as well, so that it needs an environment
of its own. `--csv` keeps the figures, and those of other cases that the file holds;
`--behind 1` compares with the matrix of the step before, should somebody's matrix be ahead.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import importlib
import io
import math
import random
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SIZE, START = 40, (20, 20)
EPISODES, STEPS = 10_000, 60
DRIFTS = ((0.0, 0.0), (0.5, 0.5), (0.3, -0.2), (1.0, 1.0))
CONSTANTS = (3.0, 10.0)
COLUMNS = ("package", "drift_x", "drift_y", "constant", "step", "episodes", "distance", "floor")
SHOWN = (10, 20, 40, 60)
"""Steps whose distances are printed."""


class LeftOutError(Exception):
    """A case is not installed."""


class Setting(NamedTuple):
    """What is asked of a package; a constant of None is its default."""

    drift: tuple[float, float]
    constant: float | None


class Seen(NamedTuple):
    """What episodes showed, by completed steps, from 0 on.

    Attributes:
        matrix: the mean of the matrices shown, shape (steps + 1, N, N), indexed [t, y, x].
        counts: the episodes in which the person was in each cell, likewise.
        outside: the episodes in which the person was outside of the grid, shape (steps + 1,).
    """

    matrix: Floats
    counts: Floats
    outside: Floats


def ours(setting: Setting, episodes: int, steps: int) -> Seen:
    """This package, all episodes at once; they are those of the single environment."""
    from DroneSwarmSearch.vector import SwarmVectorEnv

    envs = SwarmVectorEnv(
        episodes,
        write_matrices=False,
        grid_size=SIZE,
        vector=setting.drift,
        person_initial_position=START,
        disperse_constant=10 if setting.constant is None else setting.constant,
        timestep_limit=steps + 1,
    )
    envs.reset(seed=0)
    idle = np.full((episodes, 1), 5)
    seen = nothing_yet(steps)
    for step in range(steps + 1):
        cells = envs.batch.person_cells[:, 0]
        seen.counts[step] = np.bincount(cells, minlength=SIZE**2).reshape(SIZE, SIZE)
        seen.matrix[step] = envs.batch.matrices_of(np.array([0]))[0]
        envs.step(idle)
    return seen


def dsse(setting: Setting, episodes: int, steps: int) -> Seen:
    """DSSE, with its own dispersion.

    Its vector is in metres per second, and moves its matrix by v |v| times the seconds of a
    step, 13, over a cell's 130 metres: it is asked for the vector that moves it as here.
    """
    module = installed("DSSE")
    length = math.hypot(*setting.drift)
    factor = math.sqrt(10 / length) if length else 0.0
    with contextlib.redirect_stdout(io.StringIO()):
        env = module.DroneSwarmSearch(
            grid_size=SIZE,
            vector=(factor * setting.drift[0], factor * setting.drift[1]),
            person_initial_position=START,
            timestep_limit=steps + 1,
        )
    stays = {"drone0": 0}  # off the grid's left edge, which it forbids and which ends nothing

    def episode() -> Iterator[tuple[Floats, tuple[int, int]]]:
        observations, _ = env.reset()
        yield observations["drone0"][1], next(iter(env.get_persons())).get_position()
        for _ in range(steps):
            observations, *_ = env.step(stays)
            yield observations["drone0"][1], next(iter(env.get_persons())).get_position()

    return one_by_one(episode, episodes, steps)


def package_of_2023(setting: Setting, episodes: int, steps: int) -> Seen:
    """The 2023 package."""
    module = installed("DroneSwarmSearchEnvironment.env")
    if hasattr(module.DroneSwarmSearch, "scenario"):
        raise LeftOutError("this package answers to its import path; use another environment")
    env = module.DroneSwarmSearch(
        grid_size=SIZE,
        vector=setting.drift,
        person_initial_position=list(START),
        disperse_constant=10 if setting.constant is None else setting.constant,
        timestep_limit=steps + 1,
    )

    def episode() -> Iterator[tuple[Floats, tuple[int, int]]]:
        observations = env.reset()
        yield observations["drone0"]["observation"][1], (env.person_x, env.person_y)
        for _ in range(steps):
            observations, *_ = env.step({"drone0": 5})
            yield observations["drone0"]["observation"][1], (env.person_x, env.person_y)

    return one_by_one(episode, episodes, steps)


BenchmarkCase = Callable[[Setting, int, int], Seen]

CONTESTANTS: dict[str, tuple[BenchmarkCase, list[Setting]]] = {
    "DroneSwarmSearch": (ours, [Setting(v, c) for v in DRIFTS for c in CONSTANTS]),
    "DSSE 1.1.9": (dsse, [Setting(v, None) for v in DRIFTS]),
    "2023 package": (package_of_2023, [Setting(v, c) for v in DRIFTS for c in CONSTANTS]),
}


def installed(name: str) -> Any:
    """A module, silently.

    Raises:
        LeftOutError: it cannot be imported.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return importlib.import_module(name)
    except ImportError as error:
        raise LeftOutError(f"not installed ({error})") from error


def nothing_yet(steps: int) -> Seen:
    """What no episode has shown, to be filled in."""
    shape = (steps + 1, SIZE, SIZE)
    return Seen(np.zeros(shape), np.zeros(shape), np.zeros(steps + 1))


def one_by_one(
    episode: Callable[[], Iterator[tuple[Floats, tuple[int, int]]]], episodes: int, steps: int
) -> Seen:
    """Episodes of an environment that draws from the global generators."""
    seen = nothing_yet(steps)
    for seed in range(episodes):
        random.seed(seed)
        np.random.seed(seed)
        for step, (matrix, (x, y)) in enumerate(episode()):
            seen.matrix[step] += matrix
            if 0 <= x < SIZE and 0 <= y < SIZE:
                seen.counts[step, y, x] += 1
            else:
                seen.outside[step] += 1
    np.divide(seen.matrix, episodes, out=seen.matrix)
    return seen


def distances(seen: Seen) -> Floats:
    """The total variation between frequencies and matrix at every step: shape (steps + 1,)."""
    episodes = seen.counts[0].sum() + seen.outside[0]
    inside = np.abs(seen.counts / episodes - seen.matrix).sum(axis=(1, 2))
    total: Floats = (inside + seen.outside / episodes) / 2
    return total


def floor(matrix: Floats, episodes: int) -> float:
    """The mean distance of so many true samples of a matrix.

    The count of a cell is binomial, and its mean absolute deviation is de Moivre's:
    2 k C(n, k) p^k (1 - p)^(n - k + 1) with k the first whole number above n p.
    """
    n = episodes
    total = 0.0
    for p in matrix.reshape(-1).tolist():
        if 0.0 < p < 1.0:
            k = math.floor(n * p) + 1
            ways = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
            chance = math.exp(ways + k * math.log(p) + (n - k) * math.log1p(-p))
            total += 2 * k * (1 - p) * chance
    return total / n / 2


def measure(
    name: str, episodes: int, steps: int, settings: int | None, behind: int
) -> list[dict[str, Any]]:
    """The rows of a case's settings, or of the first of them, as `COLUMNS` names them."""
    play, asked = CONTESTANTS[name]
    rows = []
    for setting in asked[:settings]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # DSSE divides by a drift of 0
            seen = play(setting, episodes, steps)
        earlier = np.maximum(np.arange(steps + 1) - behind, 0)
        seen = seen._replace(matrix=seen.matrix[earlier])
        far = distances(seen)
        for step in range(steps + 1):
            near = floor(seen.matrix[step], episodes)
            values = (
                *(name, *setting.drift, "" if setting.constant is None else setting.constant),
                *(step, episodes, f"{far[step]:.4f}", f"{near:.4f}"),
            )
            rows.append(dict(zip(COLUMNS, values, strict=True)))
        print(line(name, setting, rows[-steps - 1 :]), flush=True)
    return rows


def line(name: str, setting: Setting, rows: list[dict[str, Any]]) -> str:
    """A setting in words: distances at a few steps, the floor in brackets."""
    drift = "({:g}, {:g})".format(*setting.drift)
    constant = "-" if setting.constant is None else f"{setting.constant:g}"
    figures = [f"{r['distance']} ({r['floor']})" for r in rows if r["step"] in SHOWN]
    return f"{name:18}{drift:14}{constant:>4}   " + "   ".join(figures)


def keep(path: Path, rows: list[dict[str, Any]]) -> None:
    """Put cases' rows into a file, in place of those that it has of them."""
    if path.exists():
        new = {row["package"] for row in rows}
        with path.open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["package"] not in new] + rows
    order = list(CONTESTANTS)
    rows.sort(key=lambda row: order.index(row["package"]))  # stable
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main(arguments: list[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="How far the matrix is from where the person is.")
    parser.add_argument("--only", nargs="+", choices=CONTESTANTS, default=list(CONTESTANTS))
    parser.add_argument("--episodes", type=int, default=EPISODES)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--settings", type=int, help="measure the first so many alone")
    parser.add_argument("--behind", type=int, default=0, help="steps; how old the matrix is")
    parser.add_argument("--csv", type=Path, help="a file that keeps the figures")
    chosen = parser.parse_args(arguments)
    print(f"distance (floor) after {', '.join(map(str, SHOWN))} steps; {chosen.episodes} episodes")
    rows = []
    for name in chosen.only:
        try:
            rows += measure(name, chosen.episodes, chosen.steps, chosen.settings, chosen.behind)
        except LeftOutError as reason:
            print(f"{name:18}left out: {reason}")
    if chosen.csv and rows:
        keep(chosen.csv, rows)


if __name__ == "__main__":
    main()
