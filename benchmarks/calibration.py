"""How far the matrix is from the person's true distribution, here and in earlier packages.

    python benchmarks/calibration.py

plays 10,000 seeded episodes per setting without searches (see "Calibration" in docs/model.md), and
prints the distance at some steps, with its floor in parentheses. Each package is measured where it
is installed: this one, DSSE 1.1.9 (`pip install DSSE==1.1.9`) and the 2023 package, which needs a
separate environment, because this package provides its import path, too. `--csv` saves the rows,
and keeps those of other packages in the file.
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
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Cell = tuple[int, int]

SIZE = 40
START = (20, 20)
EPISODES = 10_000
STEPS = 60
DRIFTS = ((0.0, 0.0), (0.5, 0.5), (0.3, -0.2), (1.0, 1.0))
CONSTANTS = (3.0, 10.0)
COLUMNS = ("package", "drift_x", "drift_y", "constant", "step", "episodes", "distance", "floor")
PRINTED_STEPS = (10, 20, 40, 60)


class LeftOutError(Exception):
    """A package cannot be measured; the message gives the reason."""


class Setting(NamedTuple):
    drift: tuple[float, float]
    constant: float | None  # None where the package has none


class Seen(NamedTuple):
    """What the episodes showed at every step, from 0 on.

    The mean of the matrices and the number of persons in each cell, (steps + 1, N, N), indexed
    [t, y, x]; and the number outside the grid, (steps + 1,).
    """

    matrix: Floats
    counts: Floats
    outside: Floats


def ours(setting: Setting, episodes: int, steps: int) -> Seen:
    """This package: all episodes in one batch, equal to those of single environments."""
    from DroneSwarmSearch.vector import SwarmVectorEnv

    envs = SwarmVectorEnv(
        episodes,
        grid_size=SIZE,
        vector=setting.drift,
        person_initial_position=START,
        disperse_constant=setting.constant,
        timestep_limit=steps + 1,
    )
    envs.reset(seed=0)
    idle = np.full((episodes, 1), 5)
    seen = empty(steps)
    for step in range(steps + 1):
        cells = envs.batch.person_cells[:, 0]
        seen.counts[step] = np.bincount(cells, minlength=SIZE**2).reshape(SIZE, SIZE)
        seen.matrix[step] = envs.batch.matrices_of(np.array([0]))[0]
        envs.step(idle)
    return seen


def dsse(setting: Setting, episodes: int, steps: int) -> Seen:
    """DSSE, with its own dispersion.

    Its vector is in metres per second, and its matrix moves by v |v| times 13 s per step over
    130 m per cell. The vector is scaled so that the matrix moves as far as here.
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

    def episode() -> Iterator[tuple[Floats, Cell]]:
        observations, _ = env.reset()
        while True:
            yield observations["drone0"][1], next(iter(env.get_persons())).get_position()
            observations, *_ = env.step({"drone0": 0})  # a move off the grid, which DSSE ignores

    return one_by_one(episode, episodes, steps)


def package_of_2023(setting: Setting, episodes: int, steps: int) -> Seen:
    module = installed("DroneSwarmSearchEnvironment.env")
    if hasattr(module.DroneSwarmSearch, "scenario"):
        raise LeftOutError("this package provides its import path; use another environment")
    env = module.DroneSwarmSearch(
        grid_size=SIZE,
        vector=setting.drift,
        person_initial_position=list(START),
        disperse_constant=setting.constant,
        timestep_limit=steps + 1,
    )

    def episode() -> Iterator[tuple[Floats, Cell]]:
        observations = env.reset()
        while True:
            yield observations["drone0"]["observation"][1], (env.person_x, env.person_y)
            observations, *_ = env.step({"drone0": 5})

    return one_by_one(episode, episodes, steps)


Play = Callable[[Setting, int, int], Seen]

PACKAGES: dict[str, tuple[Play, list[Setting]]] = {
    "DroneSwarmSearch": (ours, [Setting(v, c) for v in DRIFTS for c in CONSTANTS]),
    "DSSE 1.1.9": (dsse, [Setting(v, None) for v in DRIFTS]),
    "2023 package": (package_of_2023, [Setting(v, c) for v in DRIFTS for c in CONSTANTS]),
}


def installed(name: str) -> Any:
    """Import a module without its output."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return importlib.import_module(name)
    except ImportError as error:
        raise LeftOutError(f"not installed ({error})") from error


def empty(steps: int) -> Seen:
    shape = (steps + 1, SIZE, SIZE)
    return Seen(np.zeros(shape), np.zeros(shape), np.zeros(steps + 1))


def one_by_one(
    episode: Callable[[], Iterator[tuple[Floats, Cell]]], episodes: int, steps: int
) -> Seen:
    """Play the episodes of an environment that uses the global random generators."""
    seen = empty(steps)
    for seed in range(episodes):
        random.seed(seed)
        np.random.seed(seed)
        for step, (matrix, (x, y)) in enumerate(islice(episode(), steps + 1)):
            seen.matrix[step] += matrix
            if 0 <= x < SIZE and 0 <= y < SIZE:
                seen.counts[step, y, x] += 1
            else:
                seen.outside[step] += 1
    np.divide(seen.matrix, episodes, out=seen.matrix)
    return seen


def distances(seen: Seen) -> Floats:
    """Total variation between frequencies and matrix at every step, shape (steps + 1,)."""
    episodes = seen.counts[0].sum() + seen.outside[0]
    inside = np.abs(seen.counts / episodes - seen.matrix).sum(axis=(1, 2))
    total: Floats = (inside + seen.outside / episodes) / 2
    return total


def floor(matrix: Floats, episodes: int) -> float:
    """The mean distance of samples of this size from the distribution that they come from.

    A cell's count is binomial. Its mean absolute deviation is 2 k C(n, k) p^k (1-p)^(n-k+1)
    with k = floor(n p) + 1 (de Moivre).
    """
    n = episodes
    total = 0.0
    for p in matrix.reshape(-1).tolist():
        if 0.0 < p < 1.0:
            k = math.floor(n * p) + 1
            log_binomial = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
            total += 2 * k * math.exp(log_binomial + k * math.log(p) + (n - k + 1) * math.log1p(-p))
    return total / n / 2


def measure(name: str, episodes: int, steps: int) -> list[dict[str, Any]]:
    """Measure a package; returns rows with `COLUMNS`."""
    play, settings = PACKAGES[name]
    rows = []
    for setting in settings:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # DSSE divides by a drift of 0
            seen = play(setting, episodes, steps)
        measured = distances(seen)
        constant = "" if setting.constant is None else setting.constant
        shown = []
        for step in range(steps + 1):
            distance = f"{measured[step]:.4f}"
            lowest = f"{floor(seen.matrix[step], episodes):.4f}"
            values = (name, *setting.drift, constant, step, episodes, distance, lowest)
            rows.append(dict(zip(COLUMNS, values, strict=True)))
            shown += [f"{distance} ({lowest})"] if step in PRINTED_STEPS else []
        drift = "({:g}, {:g})".format(*setting.drift)
        print(f"{name:18}{drift:14}{constant or '-':>4}   " + "   ".join(shown), flush=True)
    return rows


def keep(path: Path, rows: list[dict[str, Any]]) -> None:
    """Save rows in a file; keeps its rows of other packages."""
    if path.exists():
        new = {row["package"] for row in rows}
        with path.open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["package"] not in new] + rows
    order = list(PACKAGES)
    rows.sort(key=lambda row: order.index(row["package"]))  # stable
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=PACKAGES, default=list(PACKAGES))
    parser.add_argument("--episodes", type=int, default=EPISODES, help=f"per setting ({EPISODES})")
    parser.add_argument("--steps", type=int, default=STEPS, help=f"per episode ({STEPS})")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="save the rows")
    options = parser.parse_args(arguments)
    print(f"distance (floor) after {', '.join(map(str, PRINTED_STEPS))} steps")
    rows = []
    for name in options.only:
        try:
            rows += measure(name, options.episodes, options.steps)
        except LeftOutError as reason:
            print(f"{name:18}skipped: {reason}")
    if options.csv and rows:
        keep(options.csv, rows)


if __name__ == "__main__":
    main()
