"""Make the figures of the documentation, in a light and a dark theme.

    python docs/make_figures.py

writes `docs/figures/<name>-light.svg` and `<name>-dark.svg` for every function registered with
`figure`, or for the names given as arguments. The output is reproducible with the same version
of matplotlib. `calibration`, `opendrift` and `speed` plot the measurements written by

    python benchmarks/calibration.py --csv docs/figures/calibration.csv
    python examples/compare_with_opendrift.py --tracks 100000 --csv docs/figures/opendrift.csv
    python benchmarks/bench_vector.py --json docs/figures/bench.json

and `tracks` the outcome of `python docs/make_tracks.py --compare docs/figures/tracks.json`.
`radio` plots `python examples/finds_that_teach.py --csv docs/figures/radio.csv`, see its page.
`learning` plots the curves of the training examples, `docs/training/<example>-<seed>.csv`, with the
baselines of `own_loop.csv`, see benchmarks/own_loop.py, and `results` the table of the
leaderboard. All other figures are computed here, within seconds.

To add a figure, write a function that takes a `Theme` and a `Sampling`, returns a matplotlib
`Figure`, and is decorated with the figure's name. Figures are 576 pixels wide, so that their
text stays legible on a phone.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import re
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from cycler import cycler
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import EngFormatter, MaxNLocator, PercentFormatter
from numpy.typing import NDArray

from DroneSwarmSearch import Action, Drift, DroneSwarmSearch, Person, Scenario
from DroneSwarmSearch.drift import ProbabilityMatrix, dispersion_rate
from DroneSwarmSearch.drift.axes import Axes as DriftAxes
from DroneSwarmSearch.drift.axes import distribution
from DroneSwarmSearch.drift.belief import Belief
from DroneSwarmSearch.drift.models import drift_model
from DroneSwarmSearch.evaluation import evaluate, plots, search
from DroneSwarmSearch.incident import Incident, flights
from DroneSwarmSearch.incident import plan as plan_flights
from DroneSwarmSearch.policies import POLICIES, GreedyPolicy
from DroneSwarmSearch.policies.datum import Datum
from DroneSwarmSearch.rendering import palette
from DroneSwarmSearch.rendering.palette import drone_colour
from DroneSwarmSearch.training import TASKS, TRAINING_TASK
from DroneSwarmSearch.training.curve import moving_mean, read_columns
from DroneSwarmSearch.vector import SwarmVectorEnv

FIGURES = Path(__file__).parent / "figures"
TRAINING = Path(__file__).parent / "training"
BENCHMARK = Path(__file__).parent / "benchmark"
LEADERBOARD = Path(__file__).parent / "leaderboard" / "leaderboard.csv"

Floats = NDArray[np.float64]

WIDTH = 6.0
"""Width of every figure in inches of 96 pixels; a column of the page has about 700 pixels."""


class Theme(NamedTuple):
    """The colours of a theme.

    Attributes:
        name: suffix of the file names.
        ground: background, that of the page.
        ink: text and emphasis.
        grey: axes and peers.
        faint: grid lines.
        heat: colour map of probabilities, from zero to the maximum.
        series: lines, distinguishable with any common colour vision.
        track: paths drawn over probabilities.
    """

    name: str
    ground: str
    ink: str
    grey: str
    faint: str
    heat: tuple[str, ...]
    series: tuple[str, ...]
    track: str

    @property
    def probabilities(self) -> LinearSegmentedColormap:
        """The colour map of probabilities."""
        return LinearSegmentedColormap.from_list(f"heat-{self.name}", self.heat)


# Series from M. Okabe and K. Ito, Color universal design, 2008; lighter on the dark ground.
THEMES = (
    Theme(
        name="light",
        ground="#ffffff",
        ink="#18202c",
        grey="#6b7280",
        faint="#e3e6eb",
        heat=("#ffffff", "#d3e5f3", "#86b8dd", "#3a7fbd", "#143c70"),
        series=("#0072b2", "#d55e00", "#00805f", "#a8518a", "#8a6d00"),
        track="#c24e00",
    ),
    Theme(
        name="dark",
        ground="#131416",
        ink="#e8eaed",
        grey="#9aa2ae",
        faint="#2d3138",
        heat=("#131416", "#173452", "#1f6597", "#4da9d6", "#dff4ff"),
        series=("#56b4e9", "#ff8f4d", "#35c79b", "#e08fc4", "#e0c050"),
        track="#ffa45c",
    ),
)


class Sampling(NamedTuple):
    """Sample sizes.

    Attributes:
        episodes: number of episodes that a figure simulates.
    """

    episodes: int


DECIMALS = re.compile(rb"(\.\d\d)\d+")  # of a number, the first two

# Further kinds of files, for papers and slides.
PRINTED = {"benchmark": ("png", "pdf"), "benchmark-profiles": ("png", "pdf")}

FULL = Sampling(4000)
SHORT = Sampling(50)

Drawing = Callable[[Theme, Sampling], Figure]
REGISTRY: dict[str, Drawing] = {}


def figure(name: str) -> Callable[[Drawing], Drawing]:
    """Register the function that draws a figure."""

    def register(draw: Drawing) -> Drawing:
        REGISTRY[name] = draw
        return draw

    return register


def style_of(theme: Theme) -> dict[str, Any]:
    """Return Matplotlib's settings for a theme."""
    return {
        "font.family": "DejaVu Sans",  # ships with matplotlib
        "font.size": 9.5,
        "axes.prop_cycle": cycler(color=theme.series),
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.titlecolor": theme.ink,
        "axes.labelcolor": theme.ink,
        "axes.edgecolor": theme.grey,
        "axes.facecolor": theme.ground,
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.axisbelow": True,
        "grid.color": theme.faint,
        "grid.linewidth": 0.8,
        "xtick.color": theme.grey,
        "ytick.color": theme.grey,
        "xtick.labelcolor": theme.ink,
        "ytick.labelcolor": theme.ink,
        "xtick.labelsize": 8.5,
        "ytick.labelsize": 8.5,
        "xtick.major.size": 3,
        "ytick.major.size": 3,
        "figure.facecolor": theme.ground,
        "savefig.facecolor": theme.ground,
        "legend.frameon": False,
        "legend.fontsize": 8.5,
        "lines.linewidth": 1.6,
        "lines.solid_capstyle": "round",
        "text.color": theme.ink,
        "svg.fonttype": "path",  # the same on every machine
        "svg.hashsalt": "DroneSwarmSearch",
    }


def mark_drone(axes: Axes, at: Floats, drone: int) -> Floats:
    """Draw a drone as in the other pictures, a numbered disc; return its colour."""
    colours = drone_colour(drone), palette.INK, palette.readable_on(drone_colour(drone))
    colour, ink, number = (np.array(each) / 255 for each in colours)
    axes.plot(*at, "o", markersize=11, markerfacecolor=colour, markeredgecolor=ink, zorder=5)
    text: dict[str, Any] = {"ha": "center", "va": "center_baseline", "fontsize": 8, "zorder": 6}
    axes.text(*at, f"{drone}", color=number, **text)
    return colour


def heat_map(axes: Axes, matrix: Floats, theme: Theme, *, most: float | None = None) -> None:
    """Draw a matrix of probabilities, with row 0 at the top."""
    axes.imshow(
        matrix,
        cmap=theme.probabilities,
        vmin=0.0,
        vmax=matrix.max() if most is None else most,
        interpolation="none",  # one pixel per cell in the file
        origin="upper",
    )
    axes.spines[["top", "right"]].set_visible(True)
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))


def name_axes(panels: NDArray[Any]) -> None:
    """Label the axes of a grid of maps."""
    for axes in panels[-1]:
        axes.set_xlabel("x")
    for axes in panels[:, 0]:
        axes.set_ylabel("y")


def marginal_cdf(forecast: ProbabilityMatrix, step: int) -> Floats:
    """Return the distribution function F of the column at a step, shape (N,)."""
    return np.cumsum(forecast.marginals(step)[0])


def target_cdf(forecast: ProbabilityMatrix, step: int) -> Floats:
    """Return the Gaussian's distribution function G of the column at a step, shape (N,)."""
    axes = DriftAxes.of(forecast.known.drifts)
    return distribution(forecast.grid_size, axes, np.array(float(step)))[:, 0]


def known(start: tuple[int, int], vector: tuple[float, float], constant: float = 10) -> Drift:
    """Return the drift that the parameters of the 2023 package describe."""
    return Drift(start, vector=vector, diffusion=dispersion_rate(constant))


@figure("gaussian")
def gaussian(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the matrix at several steps, with the path of its centre."""
    x, y = (8, 10)
    u, v = (0.5, 0.25)
    forecast = ProbabilityMatrix(40, known((x, y), (u, v)))
    chart = Figure(figsize=(WIDTH, 6.1), layout="constrained")
    panels = chart.subplots(2, 2, sharex=True, sharey=True)
    for axes, step in zip(panels.flat, (2, 12, 36, 70), strict=True):
        heat_map(axes, forecast.exact(step), theme)
        end = min(x + u * step, 39.0), min(y + v * step, 39.0)
        if step > 2:
            arrow = {"arrowstyle": "-|>", "color": theme.track, "linewidth": 1.5, "shrinkB": 0}
            axes.annotate("", end, (x, y), arrowprops={**arrow, "shrinkA": 3})
        axes.plot(x, y, "o", color=theme.track, markersize=4.5)
        if step <= 12:
            corner = x - step - 0.5, y - step - 0.5
            side = 2 * step + 1
            box = Rectangle(
                corner, side, side, fill=False, edgecolor=theme.grey, linestyle=(0, (3, 2))
            )
            axes.add_patch(box)
        axes.set(xlim=(-0.5, 39.5), ylim=(39.5, -0.5))
        axes.set_title(f"step {step}")
        most = forecast.exact(step).max()
        axes.set_title(f"max {most:.2g}", loc="right", color=theme.grey, fontsize=8.5)
    name_axes(panels)
    return chart


@figure("clip")
def clip(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the Gaussian, the reachable band and the clipped forecast."""
    forecast = ProbabilityMatrix(40, known((12, 12), (0.6, 0.0)))
    chart = Figure(figsize=(WIDTH, 6.0), layout="constrained")
    panels = chart.subplots(2, 2)
    edges = np.arange(-0.5, 40)
    for axes, step in zip(panels.flat[:3], (1, 3, 12), strict=True):
        before = np.concatenate(([0.0], marginal_cdf(forecast, step - 1), [1.0]))
        axes.fill_between(
            edges,
            np.append(before[:-2], before[-3]),
            np.append(before[2:], before[-1]),
            step="post",
            color=theme.series[0],
            alpha=0.22,
            linewidth=0,
            label="reachable",
        )
        axes.stairs(
            target_cdf(forecast, step),
            edges,
            color=theme.series[1],
            linewidth=4.0,
            label="G, the Gaussian",
        )
        axes.stairs(
            marginal_cdf(forecast, step),
            edges,
            color=theme.series[0],
            linewidth=1.7,
            label="F, the forecast",
        )
        middle = 12 + 0.6 * step
        axes.set(xlim=(middle - 6.5, middle + 6.5), ylim=(-0.02, 1.02), xlabel="x")
        axes.set_title(f"step {step}")
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        axes.grid(axis="y")
    panels[0, 0].set_ylabel("P(column ≤ x)")
    panels[1, 0].set_ylabel("P(column ≤ x)")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside upper left", ncols=3, columnspacing=1.4)
    axes = panels[1, 1]
    for drift in (0.5, 0.8, 0.9, 1.0):
        long = ProbabilityMatrix(200, known((10, 10), (drift, 0.0)))
        steps = np.arange(1, 61)
        distance = [
            np.abs(np.diff(marginal_cdf(long, t) - target_cdf(long, t), prepend=0.0)).sum() / 2
            for t in steps
        ]
        axes.plot(steps, distance, color=theme.series[0], linewidth=1.4)
        axes.annotate(
            f"{drift:g}",
            (16, distance[15]),
            (0, 5 if drift < 1.0 else -13),
            textcoords="offset points",
            fontsize=8.5,
        )
    axes.set(xlim=(0, 60), ylim=(0, 0.52), xlabel="step")
    axes.set_title("distance of F and G, by drift")
    axes.grid(axis="y")
    return chart


@cache
def walks(count: int) -> tuple[ProbabilityMatrix, NDArray[np.int64]]:
    """Return a forecast, and the columns of persons that follow it, shape (steps + 1, count)."""
    forecast = ProbabilityMatrix(40, known((12, 20), (0.3, 0.0)))
    envs = SwarmVectorEnv(count, grid_size=40, persons=[Person(forecast.known)])
    envs.reset(seed=4)
    columns = []
    for _ in range(41):
        columns.append(envs.batch.person_cells[:, 0] % 40)
        envs.step(np.full((count, 1), int(Action.IDLE)))
    return forecast, np.array(columns)


@figure("person")
def person(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the moves of a person along x at one step, and some paths."""
    forecast, columns = walks(6)
    at = 20
    chart = Figure(figsize=(WIDTH, 7.0), layout="constrained")
    forecast_axes, moves, tracks = chart.subplots(3, 1, sharex=True, height_ratios=(0.8, 1.1, 2.4))
    edges = np.arange(-0.5, 40)
    probability = forecast.marginals(at)[0]
    forecast_axes.stairs(probability, edges, fill=True, color=theme.series[0], alpha=0.75)
    forecast_axes.set_ylabel("probability")
    forecast_axes.set_title(f"distribution of the person at step {at}")
    (right,), (left,), _, _ = forecast.moves(at)
    shown = probability > 1e-4
    bottom = np.zeros(40)
    moves_of = {"left": (left, 1), "stay": (1 - left - right, None), "right": (right, 0)}
    for name, (share, series) in moves_of.items():
        colour = theme.faint if series is None else theme.series[series]
        top = bottom + np.where(shown, share, 0.0)
        moves.stairs(top, edges, baseline=bottom, fill=True, color=colour, label=name)
        bottom = top
    moves.set_ylabel("probability")
    moves.set_title("its next move")
    middle = (bottom > 0).nonzero()[0]
    centre = int(middle.mean())
    heights = left[centre] / 2, (1 + left[centre] - right[centre]) / 2, 1 - right[centre] / 2
    for name, height in zip(moves_of, heights, strict=True):
        colour = theme.ink if name == "stay" else theme.ground
        moves.text(centre, height, name, ha="center", va="center", color=colour, fontsize=8.5)
    matrix = np.array([forecast.marginals(step)[0] for step in range(41)])
    tracks.imshow(
        matrix,
        cmap=theme.probabilities,
        vmin=0.0,
        vmax=0.3,
        interpolation="none",
        aspect="auto",
        extent=(-0.5, 39.5, 40.5, -0.5),
    )
    steps = np.arange(41)
    for track, column in enumerate(columns.T):
        first = track == 0
        tracks.plot(
            column,
            steps,
            color=theme.track,
            linewidth=2.2 if first else 1.1,
            alpha=1.0 if first else 0.7,
        )
    tracks.axhline(at, color=theme.grey, linewidth=1.0, linestyle=(0, (3, 2)))
    tracks.set(xlim=(5.5, 34.5), ylim=(40.5, -0.5), xlabel="x", ylabel="step")
    tracks.set_title("paths of six persons")
    for axes in (forecast_axes, moves):
        axes.grid(axis="y")
    return chart


Moves = tuple[Floats, Floats]
"""The probabilities of moves right and left from each column, shape (N,)."""


def moves_of_forecast(forecast: ProbabilityMatrix, step: int) -> Moves:
    """Return the moves of the person's only hypothesis along x."""
    (right,), (left,), _, _ = forecast.moves(step)
    return right, left


def moves_with_a_quarter(forecast: ProbabilityMatrix, step: int) -> Moves:
    """Return moves with the same forecasts but an exchange of a quarter of what stays."""
    before = marginal_cdf(forecast, step)
    after = marginal_cdf(forecast, step + 1)
    probability = np.diff(before, prepend=0.0)
    net = before - after
    net[-1] = 0.0
    right = np.maximum(net, 0.0)
    left = np.append(0.0, np.maximum(-net, 0.0)[:-1])
    stay = probability - right - left
    exchange = np.minimum(stay[:-1], stay[1:]) / 4
    right[:-1] += exchange
    left[1:] += exchange
    occupied = np.where(probability > 0, probability, 1.0)
    return right / occupied, left / occupied


def one_step(mass: Floats, moves: Moves) -> Floats:
    """Return a distribution of the column one step later."""
    right, left = moves
    after = mass * (1 - right - left)
    after[1:] += (mass * right)[:-1]
    after[:-1] += (mass * left)[1:]
    return after


EXCHANGES: dict[str, tuple[Callable[[ProbabilityMatrix, int], Moves], int]] = {
    "a quarter of what stays": (moves_with_a_quarter, 1),
    "half the diffusion": (moves_of_forecast, 0),
}
"""Two exchanges with the same forecasts, and the colours of their lines."""


@figure("memory")
def memory(theme: Theme, sampling: Sampling) -> Figure:
    """Draw how long a person remembers a position, with two exchanges."""
    rate = dispersion_rate(1)
    forecast = ProbabilityMatrix(81, known((40, 40), (0.0, 0.0), 1))
    columns = np.arange(81.0)
    chart = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    covariance, variance = chart.subplots(1, 2)
    covariance.axhline(1.0, color=theme.ink, linewidth=2.5, alpha=0.35)
    ahead = np.arange(41)
    variance.plot(ahead, rate * ahead, color=theme.ink, linewidth=2.5, alpha=0.35)
    for name, (moves, series) in EXCHANGES.items():
        colour = theme.series[series]
        # The columns at step 20, and the joint moment with the column at later steps.
        weighted = forecast.marginals(20)[0] * (columns - 40)
        moments = [weighted @ columns]
        known_cell = np.zeros(81)
        known_cell[40] = 1.0
        variances = [0.0]
        for step in range(20, 60):
            weighted = one_step(weighted, moves(forecast, step))
            moments.append(weighted @ columns)
            known_cell = one_step(known_cell, moves(forecast, step + 20))
            variances.append(known_cell @ (columns - 40) ** 2)
        covariance.plot(20 + ahead, np.array(moments) / (20 * rate), color=colour, label=name)
        variance.plot(ahead, variances, color=colour)
    covariance.set(xlim=(20, 60), ylim=(0, 1.15), xlabel="later step")
    covariance.set_title("covariance with x at step 20")
    variance.set(xlim=(0, 40), ylim=(0, None), xlabel="steps later")
    variance.set_title("variance after a known cell")
    for axes in (covariance, variance):
        axes.grid()
    covariance.plot([], [], color=theme.ink, linewidth=2.5, alpha=0.35, label="Brownian motion")
    handles, labels = covariance.get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside upper left", ncols=3, columnspacing=1.2)
    return chart


class Miss(NamedTuple):
    """An episode in which nobody is found.

    Attributes:
        actions: shape (steps, drones).
        positions: the drones' cells (x, y) before each step, shape (steps + 1, drones, 2).
        matrices: the posteriors observed before each step, shape (steps + 1, N, N).
        prior: the forecasts, of the same shape.
        kept: the kept fraction of each step, shape (steps,).
    """

    actions: NDArray[np.int64]
    positions: NDArray[np.int64]
    matrices: Floats
    prior: Floats
    kept: Floats


SCENE: dict[str, Any] = {
    "grid_size": 24,
    "n_drones": 3,
    "vector": (0.15, 0.1),
    "person_initial_position": (8, 9),
    "disperse_constant": 10,
    "timestep_limit": 60,
    "bayesian_update": True,
}
START_CELLS = [(0, 4), (0, 10), (0, 16)]
"""The drones' start cells in `SCENE`."""


@cache
def miss(detection: float) -> Miss:
    """Return the first episode in `SCENE` in which the greedy policy finds nobody."""
    env = DroneSwarmSearch(**SCENE, probability_of_detection=detection)
    policy = GreedyPolicy(env.scenario)
    for seed in range(1000):
        observations, _ = env.reset(seed=seed, drones_positions=START_CELLS)
        policy.reset()
        forecast = env.scenario.forecasts()[0]
        belief = Belief(forecast, detection, forecast.joint(0))
        chosen = []
        kept = []
        positions = [env.frame().drones]
        matrices = [env.frame().matrix]
        for step in range(SCENE["timestep_limit"]):
            actions = policy(observations)
            chosen.append(list(actions.values()))
            searched = [
                y * env.grid_size + x
                for (x, y), action in zip(positions[-1], chosen[-1], strict=True)
                if action == Action.SEARCH
            ]
            before = belief.failure
            belief = belief.after_search(searched)
            kept.append(belief.failure / before)
            belief = belief.after_drift(step)
            observations, *_ = env.step(actions)
            positions.append(env.frame().drones)
            matrices.append(env.frame().matrix)
            if env.frame().ending is not None:
                break
        if not all(env.frame().found):
            break
    prior = np.array([forecast.exact(step) for step in range(len(matrices))])
    return Miss(
        np.array(chosen), np.array(positions), np.array(matrices, float), prior, np.array(kept)
    )


@figure("belief")
def belief(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the forecast and the posterior at two steps of one episode."""
    search = miss(0.8)
    chart = Figure(figsize=(WIDTH, 6.3), layout="constrained")
    panels = chart.subplots(2, 2, sharex=True, sharey=True)
    for row, step in zip(panels, (14, 40), strict=True):
        most = max(search.prior[step].max(), search.matrices[step].max())
        for axes, matrix in zip(row, (search.prior[step], search.matrices[step]), strict=True):
            heat_map(axes, matrix, theme, most=most)
            axes.set(xlim=(-0.5, 23.5), ylim=(23.5, -0.5))
        for drone in range(3):
            path = search.positions[: step + 1, drone]
            colour = mark_drone(row[1], path[-1], drone)
            row[1].plot(*path.T, color=colour, linewidth=1.2)
            searched = search.actions[:step, drone] == Action.SEARCH
            row[1].plot(*path[:-1][searched].T, ".", color=colour, markersize=4)
        row[0].set_title(f"step {step}: forecast")
        searches = int((search.actions[:step] == Action.SEARCH).sum())
        row[1].set_title(f"posterior after {searches} searches")
    name_axes(panels)
    return chart


@cache
def shares_not_found(detection: float, episodes: int) -> Floats:
    """Return the fraction of episodes in which the actions of `miss` find nobody, by step."""
    search = miss(detection)
    steps = len(search.actions)
    scene = {**SCENE, "timestep_limit": steps + 1}  # only a find ends an episode
    envs = SwarmVectorEnv(
        episodes, **scene, probability_of_detection=detection, drones_positions=START_CELLS
    )
    envs.reset(seed=0)
    missing = np.ones(episodes, bool)
    shares = [1.0]
    for actions in search.actions:
        envs.step(np.tile(actions, (episodes, 1)))
        missing &= ~envs.batch.found  # later episodes of the sub-environment do not count
        shares.append(missing.mean())
    return np.array(shares)


@figure("survival")
def survival(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the product of the kept fractions, and the measured fraction of episodes."""
    chart = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = chart.subplots()
    for series, detection in enumerate((0.4, 0.8)):
        forecast = np.concatenate(([1.0], np.cumprod(miss(detection).kept)))
        shares = shares_not_found(detection, sampling.episodes)
        colour = theme.series[series]
        steps = np.arange(len(forecast))
        axes.plot(steps, forecast, color=colour)
        spread = 1.96 * np.sqrt(shares * (1 - shares) / sampling.episodes)
        some = steps[4::4]
        axes.errorbar(
            some,
            shares[some],
            spread[some],
            fmt="o",
            color=colour,
            markersize=4.5,
            markerfacecolor=theme.ground,
            markeredgewidth=1.3,
            elinewidth=1.0,
        )
        axes.annotate(
            f"POD {detection:g}",
            (steps[-1], forecast[-1]),
            (6, 0),
            textcoords="offset points",
            va="center",
            color=colour,
        )
    axes.plot([], [], color=theme.ink, label="product of the kept fractions")
    axes.plot(
        [],
        [],
        "o",
        color=theme.ink,
        markersize=4.5,
        markerfacecolor=theme.ground,
        markeredgewidth=1.3,
        label=f"fraction of {sampling.episodes:,} episodes",
    )
    axes.legend(loc="upper right", borderaxespad=0.1)
    axes.set(xlim=(0, 67), ylim=(0, 1.02), xlabel="step", ylabel="not found")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid()
    return chart


BATCHED = {
    "without matrices": ("batch, without matrices", 20, 4),
    "with matrices": ("batch, matrices", 20, 4),
    "posterior": ("batch, posterior", 20, 4),
    "JaxMARL coin_game": ("JaxMARL coin_game", 20, 2),
}
ONE_BY_ONE = {"one environment": ("one environment", 20, 4), "DSSE": ("DSSE", 20, 4)}
"""The cases of `bench.json` that are drawn, by label: name there, grid size, drones."""


@figure("speed")
def speed(theme: Theme, sampling: Sampling) -> Figure:
    """Draw environment steps per second over the number of searches, from `bench.json`."""
    measured = json.loads((FIGURES / "bench.json").read_text("utf-8"))
    rates = {
        (run["name"], size["grid_size"], size["n_drones"], run["num_envs"]): run
        for size in measured["sizes"]
        for run in size["steps_per_second"]
    }
    counts = measured["parameters"]["num_envs"]
    peers = {"DSSE", "JaxMARL coin_game"}
    colours = iter(theme.series)
    chart = Figure(figsize=(WIDTH, 4.0), layout="constrained")
    axes = chart.subplots()
    label_style = {"fontsize": 8.5, "textcoords": "offset points", "va": "center"}
    for label, spec in BATCHED.items():
        runs = [rates[(*spec, count)] for count in counts]
        median, lower, upper = ([run[key] for run in runs] for key in ("median", "lower", "upper"))
        colour = theme.grey if label in peers else next(colours)
        axes.plot(counts, median, "o-", color=colour, markersize=3.5)
        axes.fill_between(counts, lower, upper, color=colour, alpha=0.3, linewidth=0)
        axes.annotate(label, (counts[-1], median[-1]), (8, 0), color=colour, **label_style)
    for label, spec in ONE_BY_ONE.items():
        rate = rates[(*spec, None)]["median"]
        colour = theme.grey if label in peers else next(colours)
        axes.axhline(rate, color=colour, linestyle=(0, (4, 2)), linewidth=1.2)
        axes.annotate(label, (counts[-1], rate), (8, 6), color=colour, **label_style)
    axes.set(xscale="log", yscale="log", xlim=(0.8, counts[-1] * 12))
    axes.set(xlabel="searches in the batch", ylabel="environment steps per second")
    axes.set_xticks(counts, [f"{count:,}" for count in counts])
    axes.minorticks_off()
    axes.grid()
    return chart


Measured = dict[tuple[str, float, float, str], Floats]


def measured() -> Measured:
    """Return distances and floors of `calibration.csv`, (steps + 1, 2), by package and setting."""
    rows: dict[tuple[str, float, float, str], list[tuple[float, float]]] = {}
    for row in rows_of(FIGURES / "calibration.csv"):
        key = row["package"], float(row["drift_x"]), float(row["drift_y"]), row["constant"]
        rows.setdefault(key, []).append((float(row["distance"]), float(row["floor"])))
    return {key: np.array(values) for key, values in rows.items()}


def code_block(page: str, part: str) -> str:
    """Return the only Python block of a page that contains a string."""
    text = (Path(__file__).parent / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    (block,) = (block for block in blocks if part in block)
    return block


@figure("success")
def success(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the tutorial's plot by executing its code block."""
    block = code_block("tutorial.md", 'savefig("success.png"')
    if sampling is SHORT:
        block = re.sub(r"episodes=\d+", f"episodes={sampling.episodes}", block)
    names: dict[str, Any] = {}
    with TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        block = block.replace("success.png", (Path(folder) / "success.png").as_posix())
        exec(compile(block, "tutorial.md", "exec"), names)
    chart: Figure = names["figure"]
    plt.close(chart)
    return chart


@figure("incident")
def incident(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the maps before and after a plan, in kilometres from the last known position."""
    raft = Incident(
        position=(54.18, 7.85),
        time="2026-03-01T05:30Z",
        object_class="LIFE-RAFT-SB-6",
        wind="300 20kn",
        current="160 0.5kn",
    )
    plan = plan_flights(raft)
    known = raft.plane.metres(*raft.position)
    chart = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    maps = chart.subplots(1, 2, sharex=True, sharey=True)
    times = plan.on_scene, plan.landed
    for axes, time in zip(maps, times, strict=True):
        matrix, low, high = plan.density(time)
        left, bottom = (low - known) / 1000
        right, top = (high - known) / 1000
        heat_map(axes, matrix, theme)
        axes.images[0].set_extent((left, right, bottom, top))
        land = plan.land(low, high)
        assert land is not None
        for outline, *_ in land.polygons(low, high):
            shore = (outline - known).T / 1000
            axes.fill(*shore, facecolor=theme.faint, edgecolor=theme.grey, linewidth=0.6)
        axes.plot(0, 0, "+", color=theme.ink, markersize=8, markeredgewidth=1.6)
        axes.set(xlabel="km east", title=f"{time:%H:%M}")
    maps[0].set_ylabel("km north")
    for flight in plan.flights:
        east, north = (flights.track(flight, raft.plane) - known).T / 1000
        maps[1].plot(east, north, color=theme.track, linewidth=0.8, alpha=0.8)
    maps[1].set(xlim=(left, right), ylim=(bottom, top))
    success = f"POS {plan.probability_of_success:.0%}"
    maps[1].set_title(success, loc="right", color=theme.grey, fontsize=8.5)
    return chart


METHODS = {
    "bound": "bound of any policy",
    "planner": "planner",
    "rollout": "planner",
    "imitation": "network",
    "greedy-forecast": "greedy",
    "greedy-posterior": "greedy",
    "greedy-matrix": "greedy",
    "random": "random",
}
"""The methods of the rows of `results`; all others are search patterns."""


def suite_results() -> dict[str, Floats]:
    """The success of every policy with rows on each search of the suite, and the "bound"."""
    found: dict[str, dict[str, float]] = {name: {} for name in ("bound", *POLICIES)}
    for row in rows_of(LEADERBOARD):
        if row["policy"] in found:
            found[row["policy"]][row["search"]] = float(row["success"])
            found["bound"][row["search"]] = float(row["bound"])
    return {name: np.array([*values.values()]) for name, values in found.items() if values}


@figure("results")
def results(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the mean success of every policy, that on each search, and the bound."""
    found = suite_results()
    means = {name: float(values.mean()) for name, values in found.items()}
    order = sorted(means, key=means.__getitem__)
    methods = {name: METHODS.get(name, "search pattern") for name in reversed(order)}
    inks = (theme.ink, *theme.series[:4], theme.grey)
    colours = dict(zip(dict.fromkeys(methods.values()), inks, strict=True))
    chart = Figure(figsize=(WIDTH, 3.7), layout="constrained")
    axes = chart.subplots()
    for place, name in enumerate(order):
        colour = colours[methods[name]]
        values = found[name]
        axes.barh(place, means[name], height=0.62, color=colour, alpha=0.25, linewidth=0)
        axes.plot((means[name],) * 2, (place - 0.31, place + 0.31), color=colour, linewidth=2.2)
        axes.plot(values, [place] * len(values), "o", color=colour, markersize=3.2, alpha=0.75)
    axes.set(xlim=(0, 1.01), ylim=(-0.6, len(order) - 0.4))
    axes.set_yticks(range(len(order)), [f"{name}  {means[name]:.0%}" for name in order])
    axes.tick_params(axis="y", length=0)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(axis="x")
    handles = [
        Rectangle((0, 0), 1, 1, color=colour, alpha=0.6, label=method, linewidth=0)
        for method, colour in colours.items()
    ]
    chart.legend(
        handles=handles, loc="outside lower center", ncols=6, columnspacing=0.9, handlelength=1.0
    )
    return chart


@figure("calibration")
def calibration(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the distance between matrix and person in this package and its predecessors."""
    chart = Figure(figsize=(WIDTH, 6.0), layout="constrained")
    panels = chart.subplots(2, 2, sharex=True, sharey=True)
    figures = measured()
    drifts = list(dict.fromkeys(key[1:3] for key in figures))
    styles = {
        "DSSE 1.1.9": ("", 1, "-"),
        "2023 package": ("10.0", 2, (0, (5, 1.5))),
        "DroneSwarmSearch": ("10.0", 0, "-"),
    }
    for axes, drift in zip(panels.flat, drifts, strict=True):
        for name, (constant, series, dashes) in styles.items():
            values = figures.get((name, *drift, constant))
            if values is None:
                continue
            colour = theme.series[series]
            ours = name == "DroneSwarmSearch"
            axes.plot(
                values[:, 0],
                color=colour,
                linestyle=dashes,
                linewidth=2.0 if ours else 1.6,
                label="this package" if ours else name,
            )
            if ours:
                label = "floor"
                axes.plot(values[:, 1], color=theme.ink, linestyle=":", linewidth=1.3, label=label)
        axes.set(xlim=(0, 60), ylim=(0, 1))
        axes.set_title("drift ({:g}, {:g})".format(*drift))
        axes.grid()
    chart.supxlabel("step", fontsize=9.5)
    chart.supylabel("total variation between matrix and person", fontsize=9.5)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    chart.legend(handles, labels, loc="outside upper left", ncols=2, columnspacing=1.4)
    return chart


SHOWN = {
    "FISHING-VESSEL-1": "fishing vessel",
    "PIW-1": "person in water",
    "SKIFF-4": "skiff",
    "PIW-3": "life jacket",
}
"""The classes of `opendrift.csv` whose spread is drawn, with their labels."""


@figure("opendrift")
def opendrift(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the spread of the map and of OpenDrift's objects, and forecast and success of plans."""
    rows = rows_of(FIGURES / "opendrift.csv")
    chart = Figure(figsize=(WIDTH, 3.9), layout="constrained")
    spread, success = chart.subplots(1, 2, width_ratios=(1.25, 1))
    for colour, (name, label) in zip(theme.series, SHOWN.items(), strict=False):
        points = [
            [float(row[column]) for column in ("hours", "map", "opendrift")]
            for row in rows
            if (row["quantity"], row["object_class"]) == ("spread", name)
            and float(row["wind_east"]) == 0.0
        ]
        hours, ours, theirs = np.array(points).T
        spread.plot(hours, ours / 1000, color=colour)
        spread.plot(hours, theirs / 1000, "o", color=colour, markersize=4.5)
        spread.annotate(
            label,
            (hours[-1], ours[-1] / 1000),
            (7, 0),
            textcoords="offset points",
            va="center",
            color=colour,
            fontsize=8.5,
        )
    hours = np.linspace(0.5, 6, 50)
    alone = np.sqrt(2 * (250**2 + 2 * 10 * 3600 * hours)) / 1000
    spread.plot(hours, alone, color=theme.grey, linestyle=(0, (4, 2)), linewidth=1.2)
    spread.set(xlim=(0, 10), ylim=(0, None), xlabel="hours", ylabel="km")
    spread.set_xticks((0, 1, 3, 6))
    spread.set_title("spread: map (lines), OpenDrift (dots)")
    plans = [row for row in rows if row["quantity"] == "success"]
    for place, row in enumerate(reversed(plans)):
        forecast = float(row["map"])
        found = float(row["opendrift"])
        success.plot((found, forecast), (place, place), color=theme.grey, linewidth=1.2)
        success.plot(forecast, place, "|", color=theme.series[0], markersize=13, markeredgewidth=2)
        success.plot(found, place, "o", color=theme.series[0], markersize=5)
    success.set(xlim=(0, 1), ylim=(-0.6, len(plans) - 0.4))
    success.set_yticks(range(len(plans)), [row["object_class"] for row in reversed(plans)])
    success.tick_params(axis="y", length=0)
    success.xaxis.set_major_formatter(PercentFormatter(1.0))
    success.set_title("forecast (lines), found (dots)")
    for axes in (spread, success):
        axes.grid(axis="x" if axes is success else "both")
    return chart


@figure("tracks")
def tracks(theme: Theme, sampling: Sampling) -> Figure:
    """Draw maps from tracks and of constant drift, with forecast and success of the planner."""
    scenes = json.loads((FIGURES / "tracks.json").read_text("utf-8"))
    chart = Figure(figsize=(WIDTH, 4.5), layout="constrained")
    panels = chart.subplots(2, len(scenes), sharex=True, sharey=True)
    for column, (name, scene) in zip(panels.T, scenes.items(), strict=True):
        scenario = search(name).scenario
        step = scenario.timestep_limit
        (tracked,) = scenario.persons_to_find
        constant = Person.from_dict(scene["constant"])
        persons = {"tracks": tracked, "constant": constant}
        for axes, (drift, person) in zip(column, persons.items(), strict=True):
            forecast = drift_model(person.drift, scenario.grid_size)
            matrix = forecast.map(forecast.joint(step))
            heat_map(axes, matrix, theme, most=float(np.quantile(matrix, 0.998)))
            axes.plot(*np.array(search(name).drones).T, ".", color=theme.track, markersize=4)
            shown = scene["results"]["planner"][drift]
            axes.set_xlabel(f"forecast {shown['forecast']:.0%}, found {shown['found']:.0%}")
            axes.set(xticks=(), yticks=())
        column[0].set_title(name)
    for axes, label in zip(panels[:, 0], ("drift as in the tracks", "constant drift"), strict=True):
        axes.set_ylabel(label)
    return chart


PATTERNS = "parallel-sweep", "creeping-line", "expanding-square", "sector-search"


@figure("patterns")
def patterns(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the tracks of every search pattern around a datum, for one drone and for two."""
    datum = Datum(mean=(12.0, 8.0), deviation=(4.5, 2.5), effort=1000.0)
    chart = Figure(figsize=(WIDTH, 7.9), layout="constrained")
    panels = chart.subplots(len(PATTERNS), 2)
    for name, row in zip(PATTERNS, panels, strict=True):
        for drones, axes in zip((1, 2), row, strict=True):
            policy = POLICIES[name](Scenario(grid_size=25, n_drones=drones))
            for drone, (route, *_) in enumerate(policy.routes(datum, 0)):
                track = np.array(route)
                colour = mark_drone(axes, track[0], drone)
                axes.plot(*track.T, color=colour, linewidth=1.5)
            axes.plot(*datum.mean, "+", color=theme.ink, markersize=11, markeredgewidth=2)
            axes.set(xlim=(-0.5, 24.5), ylim=(16.5, -0.5), aspect="equal")
            axes.set(xticks=(), yticks=())
            axes.spines[["top", "right"]].set_visible(True)
            axes.set_title(name.replace("-", " ") if drones == 1 else "two drones", fontsize=11)
    return chart


EXAMPLES = {
    "sb3": "Stable-Baselines3",
    "rllib": "RLlib",
    "torchrl": "TorchRL",
    "benchmarl": "BenchMARL",
    "own_loop": "your own loop",
}
"""The training examples and their names in the figure."""

YARDSTICKS = "greedy-forecast", "greedy-posterior", "greedy-matrix", "random"


@cache
def yardsticks() -> dict[str, float]:
    """The success of baselines on the task of the training examples."""
    task = Scenario(**TRAINING_TASK)
    return {
        name: evaluate(name, task, episodes=200, progress=False).success.value
        for name in YARDSTICKS
    }


def show_success_over_steps(panels: Iterable[Axes]) -> None:
    """Scale the axes of learning curves, which share that of the success."""
    for axes in panels:
        axes.set_xlim(0)
        axes.set_ylim(0, 0.9)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.grid()


@figure("learning")
def learning(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the learning curves of the training examples, three seeds each, and baselines."""
    chart = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    panels = chart.subplots(2, 3, sharey=True)
    colours = dict(zip(YARDSTICKS, (*theme.series[3:0:-1], theme.grey), strict=True))
    own_loop = rows_of(TRAINING / "own_loop.csv")
    random_searches = {row["policy"]: float(row["success"]) for row in own_loop}
    *plotted, beside = panels.flat  # the legend takes the last panel
    for axes, (example, title) in zip(plotted, EXAMPLES.items(), strict=True):
        axes.set_title(title)
        levels = random_searches if example == "own_loop" else yardsticks()
        for name, colour in colours.items():
            if (level := levels.get(name)) is not None:
                axes.axhline(level, color=colour, linestyle=(0, (4, 2)), linewidth=1.2)
        for path in sorted(TRAINING.glob(f"{example}-*.csv")):
            columns = read_columns(path)
            known = ~np.isnan(columns["found"])
            steps = columns["steps"][known]
            found = moving_mean(columns["found"][known])
            axes.plot(steps, found, color=theme.series[0], linewidth=1.1, alpha=0.8)
    show_success_over_steps(plotted)
    for axes in plotted[-3:]:
        axes.set_xlabel("environment steps")
    lines = [Line2D([], [], color=theme.series[0], label="each seed")]
    lines += [
        Line2D([], [], color=colour, linestyle=(0, (4, 2)), linewidth=1.2, label=name)
        for name, colour in colours.items()
    ]
    beside.axis("off")
    beside.legend(handles=lines, loc="center", handlelength=1.5)
    return chart


RADIO_LINES = "rollout", "greedy-matrix", "greedy-posterior"


@figure("radio")
def radio(theme: Theme, sampling: Sampling) -> Figure:
    """Draw the persons found against the radio range, and what is found without one and with all.

    From `python examples/finds_that_teach.py --csv docs/figures/radio.csv`, with its options.
    """
    rows = {(row["policy"], row["knows"]): row for row in rows_of(FIGURES / "radio.csv")}
    ranges = ["0", "2", "4", "8", "all"]
    keys = [*(f"hears {reach} cells" for reach in ranges[:-1]), "hears all"]
    chart = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = chart.subplots()
    for number, policy in enumerate(RADIO_LINES):
        points = [rows[policy, key] for key in keys]
        axes.errorbar(
            range(len(ranges)),
            [float(point["share"]) for point in points],
            [float(point["error"]) for point in points],
            color=theme.series[number],
            marker="o",
            markersize=4,
            linewidth=1.4,
            capsize=2,
            label=policy,
        )
    levels = {
        "greedy-posterior, the drift is known": rows["greedy-posterior", "the drift is known"],
        "greedy-posterior, finds teach nothing": rows["greedy-posterior", "finds teach nothing"],
    }
    for style_of, (name, row) in zip(("-.", ":"), levels.items(), strict=True):
        axes.axhline(float(row["share"]), color=theme.grey, linestyle=style_of, label=name)
    axes.set_xticks(range(len(ranges)), ranges)
    axes.set_xlabel("radio range in cells")
    axes.set_ylabel("persons found")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_ylim(0.0, 1.0)
    axes.grid(axis="y")
    chart.legend(loc="outside upper center", ncols=2, fontsize=8)
    return chart


ALL_KNOWN = "planner, all known"
PROFILED = {"greedy-posterior": ":", "imitation": "-."}


class Benchmarked(NamedTuple):
    """The results of the benchmark.

    Attributes:
        found: the success of all runs by policy and task.
        packaged: policies of the package, in the order of their mean success, the best first.
        learners: algorithms, in the same order.
    """

    found: dict[str, dict[str, list[float]]]
    packaged: list[str]
    learners: list[str]


def benchmarked() -> Benchmarked:
    """Read the results of the benchmark."""
    rows = rows_of(BENCHMARK / "results.csv")
    found: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        runs = found.setdefault(row["algorithm"], {}).setdefault(row["task"], [])
        runs.append(float(row["success"]))

    def mean_success(name: str) -> float:
        return float(np.mean([np.mean(runs) for runs in found[name].values()]))

    ranked = sorted(found, key=mean_success, reverse=True)
    with_seeds = {row["algorithm"] for row in rows if row["seed"]}
    return Benchmarked(
        found=found,
        packaged=[name for name in ranked if name not in with_seeds and name != ALL_KNOWN],
        learners=[name for name in ranked if name in with_seeds],
    )


@figure("benchmark")
def benchmark(theme: Theme, sampling: Sampling) -> Figure:
    """Draw what each policy of the benchmark reaches on each task, all its seeds, and their mean.

    From `python benchmarks/algorithms.py`.
    """
    found, packaged, learners = benchmarked()
    policies = [*learners[::-1], *packaged[::-1]]  # from below
    chart = Figure(figsize=(WIDTH, 1.3 + 0.22 * len(policies)), layout="constrained")
    panels = chart.subplots(1, len(TASKS), sharey=True)
    for axes, task in zip(panels, TASKS, strict=True):
        axes.set_title(task)
        (best,) = found[ALL_KNOWN][task]
        axes.axvline(best, color=theme.grey, linestyle="-.", linewidth=1.2)
        for number, name in enumerate(policies):
            runs = found[name][task]
            colour = theme.series[1] if name in learners else theme.series[0]
            axes.plot(runs, [number] * len(runs), "o", color=colour, markersize=3, alpha=0.5)
            axes.plot([np.mean(runs)], [number], "o", color=colour, markersize=5)
        axes.set_xlim(0.0, 1.1 * best)
        axes.set_ylim(-0.6, len(policies) - 0.4)
        axes.xaxis.set_major_locator(MaxNLocator(3))
        axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        axes.grid(axis="x")
    panels[0].set_yticks(range(len(policies)), policies)
    kinds = {"of the package": theme.series[0], "trained on the task": theme.series[1]}
    handles = [
        Line2D([], [], color=colour, marker="o", markersize=5, linestyle="none", label=label)
        for label, colour in kinds.items()
    ]
    handles.append(Line2D([], [], color=theme.grey, linestyle="-.", linewidth=1.2, label=ALL_KNOWN))
    chart.legend(handles=handles, loc="outside lower center", ncols=3)
    return chart


@figure("benchmark-profiles")
def benchmark_profiles(theme: Theme, sampling: Sampling) -> Figure:
    """Draw in what share of its runs each algorithm of the benchmark exceeds a score.

    The performance profiles of R. Agarwal et al., NeurIPS 2021, a panel for each task. Policies
    that are not trained on the tasks are vertical lines.
    """
    found, _, learners = benchmarked()
    chart = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    panels = chart.subplots(2, 2, sharey=True)
    lines: dict[str, Line2D] = {}
    for axes, task in zip(panels.flat, TASKS, strict=True):
        axes.set_title(task)
        least = np.mean(found["random"][task])
        most = np.mean(found[ALL_KNOWN][task])
        score_of = {
            name: np.sort(np.array(runs[task]) - least) / (most - least)
            for name, runs in found.items()
        }
        for number, name in enumerate(learners):
            scores = score_of[name]
            # All runs exceed a score below the worst, none the best.
            x = np.concatenate([[0.0], scores])
            shares = np.linspace(1.0, 0.0, len(x))
            colour = theme.series[number % len(theme.series)]
            (lines[name],) = axes.step(
                x,
                shares,
                where="post",
                color=colour,
                linestyle=("-", "--")[number % 2],
                linewidth=1.4,
            )
        for name, look in PROFILED.items():
            lines[name] = axes.axvline(
                score_of[name].mean(), color=theme.grey, linestyle=look, linewidth=1.4
            )
        axes.set_xlim(0.15, 1.0)
        axes.set_ylim(0.0, 1.02)
        axes.grid()
    for axes in panels[-1]:
        axes.set_xlabel("score")
    for axes in panels[:, 0]:
        axes.set_ylabel("share of runs above it")
    chart.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=5)
    return chart


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def svg(name: str, theme: Theme, sampling: Sampling = FULL, kind: str = "svg") -> bytes:
    """Return the content of a figure's file."""
    plt.switch_backend("agg")  # no window
    with style.context(["default", style_of(theme)]):
        content = plots.encoded(REGISTRY[name](theme, sampling), kind)
    if kind == "svg":  # a hundredth of a point is exact enough for paths
        content = re.sub(rb' d="[^"]*"', lambda path: DECIMALS.sub(rb"\1", path[0]), content)
    return content


def make(names: list[str], folder: Path, sampling: Sampling = FULL) -> list[Path]:
    """Write figures in both themes, and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name in names:
        for theme in THEMES:
            path = folder / f"{name}-{theme.name}.svg"
            path.write_bytes(svg(name, theme, sampling))
            written.append(path)
        for kind in PRINTED.get(name, ()):
            path = folder / f"{name}.{kind}"
            path.write_bytes(svg(name, THEMES[0], sampling, kind))
            written.append(path)
    return written


def main(arguments: list[str] | None = None) -> None:
    """Make the figures and print their sizes."""
    parser = argparse.ArgumentParser(description="Make the figures of the documentation.")
    parser.add_argument("names", nargs="*", metavar="name", help=f"of {', '.join(REGISTRY)}")
    parser.add_argument("--into", type=Path, default=FIGURES, help="output folder")
    parser.add_argument("--short", action="store_true", help="few episodes, for a quick trial")
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.names) - set(REGISTRY):
        parser.error(f"no figure is called {', '.join(sorted(unknown))}")
    sampling = SHORT if chosen.short else FULL
    for path in make(chosen.names or list(REGISTRY), chosen.into, sampling):
        print(f"{path.name:28}{path.stat().st_size / 1000:7.1f} kB")


if __name__ == "__main__":
    main()
