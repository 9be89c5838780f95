"""Plots of evaluations at the widths of a journal's columns.

A policy has the same colour and marker in every plot. The colours are those of M. Okabe and K.
Ito, Color universal design, 2008, which are distinct for all common forms of colour vision, with
a darker yellow. Needs the packages of the extra "evaluation".
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import write_bytes
from DroneSwarmSearch.evaluation.calibration import Reliability
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.recording import frames
from DroneSwarmSearch.evaluation.results import Bound, Evaluation
from DroneSwarmSearch.evaluation.statistics import wilson
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief

try:
    from matplotlib import style
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator, NullLocator, PercentFormatter
    from PIL import Image  # matplotlib depends on it
except ImportError as error:
    raise ImportError(
        'plots need the package matplotlib: pip install "DroneSwarmSearchEnvironment[evaluation]"',
        name=error.name,
    ) from error

__all__ = [
    "episode",
    "reliability",
    "save",
    "success_by_search",
    "success_over_time",
    "suite_over_time",
]

P = ParamSpec("P")
T = TypeVar("T")

SINGLE, DOUBLE = 3.5, 7.16
"""The widths of one and two columns in inches (IEEE)."""

DPI = 200
INK, GREY = "#18202c", "#70788a"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # part of matplotlib
    "font.size": 7.5,
    "axes.titlesize": 7.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6eb",
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "legend.frameon": False,
    "legend.fontsize": 7,
    "lines.linewidth": 1.2,
    "lines.markersize": 4,
    "lines.markeredgecolor": "white",
    "lines.markeredgewidth": 0.4,
    "errorbar.capsize": 0,
    "image.cmap": "Blues",
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "DroneSwarmSearch",  # equal plots make equal files
}


class Look(NamedTuple):
    """How a policy is drawn."""

    colour: str
    marker: str


LOOKS = {
    "planner": Look("#d55e00", "D"),
    "ppo": Look("#5b3fa0", "h"),
    "greedy-posterior": Look("#0072b2", "o"),
    "greedy-matrix": Look("#56b4e9", "s"),
    "parallel-sweep": Look("#009e73", "^"),
    "creeping-line": Look("#e69f00", "v"),
    "expanding-square": Look("#cc79a7", "p"),
    "sector-search": Look("#8f7f00", "X"),
    "random": Look("#9aa0a8", "P"),
}

OTHERS = (Look("#b3243c", "H"), Look("#8c4a2f", "<"), Look("#000000", "d"), Look("#3d6b35", ">"))
"""For other policies, in their order."""

TRACKS = [look.colour for look in LOOKS.values()]

BOUND: dict[str, Any] = {"color": INK, "linewidth": 1.6, "linestyle": (0, (3, 1.5))}
BOUND_LABEL = "bound: no policy can exceed it"

LEGEND_COLUMNS = 5


def _styled(make: Callable[P, T]) -> Callable[P, T]:
    """Draw in the style of this module, whatever the user's settings."""

    @wraps(make)
    def styled(*args: P.args, **kwargs: P.kwargs) -> T:
        with style.context(["default", STYLE]):
            return make(*args, **kwargs)

    return styled


@_styled
def save(figure: Figure, path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write a figure as PNG and as SVG.

    Args:
        figure: from a function of this module.
        path: without suffix.

    Returns:
        The two files.

    Raises:
        StorageError: a file cannot be written.
    """
    pixels, drawing, picture = io.BytesIO(), io.BytesIO(), io.BytesIO()
    figure.savefig(pixels, format="png", dpi=DPI)
    figure.savefig(drawing, format="svg", metadata={"Date": None})
    with Image.open(pixels) as image:  # a palette reduces the file to a third
        image.convert("RGB").quantize(256).save(picture, "PNG", dpi=(DPI, DPI), optimize=True)
    written = Path(f"{os.fspath(path)}.png"), Path(f"{os.fspath(path)}.svg")
    for target, data in zip(written, (picture, drawing), strict=True):
        write_bytes(target, data.getvalue())
    return written


# Success.


@_styled
def success_over_time(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot the share of successes within each step, a curve for each policy, on one search.

    The shaded bands are Wilson's intervals. The dashed line is the bound, if an evaluation has
    it. The legend lists the policies by their success.

    Args:
        evaluations: of different policies on one search.

    Raises:
        ValueError: there is no evaluation, or they are of several searches.
    """
    (search, several), *others = _by_search(evaluations).items()
    if others:
        names = ", ".join([search, *(name for name, _ in others)])
        raise ValueError(f"evaluations must be of one search, got {names}")
    figure = Figure(figsize=(DOUBLE * 0.7, 2.5))
    axes = figure.add_subplot()
    _draw_curves(axes, several, _looks(several))
    axes.set_title(f"{search}: {_size_of(several[0].search)}")
    axes.set(xlabel="step", ylabel="found")
    entries = sorted(
        ((line, name, float(line.get_ydata()[-1])) for name, line in _labelled(axes).items()),
        key=lambda entry: -entry[2],
    )
    figure.legend(
        [line for line, *_ in entries],
        [f"{name} {100 * share:.1f}%" for _, name, share in entries],
        loc="outside right upper",
    )
    return figure


@_styled
def suite_over_time(evaluations: Sequence[Evaluation], *, columns: int = 4) -> Figure:
    """Plot the curves of `success_over_time` in a small panel for each search.

    Args:
        evaluations: of policies on searches; the panels have the order of the searches.
        columns: panels in a row.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations)
    across = min(checks.integer("columns", columns, 1), len(searches))
    down = math.ceil(len(searches) / across)
    figure = Figure(figsize=(DOUBLE, 1.4 * down + 0.75))
    panels = figure.subplots(down, across, squeeze=False, sharey=True).reshape(-1)
    for place, (axes, (name, several)) in enumerate(zip(panels, searches.items(), strict=False)):
        _draw_curves(axes, several, looks)
        axes.set_title(name)
        axes.tick_params(labelleft=place % across == 0)
        if place % across == 0:
            axes.set_ylabel("found")
        if place + across >= len(searches):
            axes.set_xlabel("step")
    for axes in panels[len(searches) :]:
        axes.remove()
    _legend_below(figure, looks, evaluations)
    return figure


def _draw_curves(axes: Axes, evaluations: Sequence[Evaluation], looks: Mapping[str, Look]) -> None:
    """Draw the curves with their bands, and the bound; the first policy is on top."""
    bound, limit = _bound_of(evaluations), evaluations[0].limit
    if bound is not None:
        axes.plot(bound.by_time, **BOUND, label="bound")
    for depth, each in enumerate(evaluations):
        colour, curve = looks[each.policy].colour, each.success_by_time
        steps, top = np.arange(limit + 1), 3.0 - depth / 100
        axes.fill_between(steps, curve.low, curve.high, color=colour, alpha=0.18, lw=0, zorder=top)
        axes.plot(steps, curve.value, color=colour, zorder=top, label=each.policy)
    axes.set(xlim=(0, limit), ylim=(0, 1.02))
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))


def _labelled(axes: Axes) -> dict[str, Any]:
    lines, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, lines, strict=True))


@_styled
def success_by_search(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot the success by the time limit in a row for each search, with Wilson's intervals.

    The black bar of a row is the bound.

    Args:
        evaluations: of policies on searches, in the order of the rows.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations)
    height = max(0.36, 0.062 * len(looks))
    figure = Figure(figsize=(DOUBLE, height * len(searches) + 0.85))
    axes = figure.add_subplot()
    offsets = np.linspace(-0.36, 0.36, len(looks)) if len(looks) > 1 else np.zeros(1)
    offset = dict(zip(looks, offsets.tolist(), strict=True))
    for row, several in enumerate(searches.values()):
        if row % 2 == 0:
            axes.axhspan(row - 0.5, row + 0.5, color="#f5f6f8", linewidth=0, zorder=0)
        bound = _bound_of(several)
        if bound is not None:
            axes.vlines(bound.by_time[-1], row - 0.46, row + 0.46, color=INK, linewidth=1.8)
        for each in several:
            colour, marker = looks[each.policy]
            value, low, high = each.success
            axes.errorbar(
                value,
                row + offset[each.policy],
                xerr=[[value - low], [high - value]],
                fmt=marker,
                color=colour,
                elinewidth=0.9,
            )
    axes.set(xlim=(-0.01, 1.01), ylim=(len(searches) - 0.5, -0.5))
    axes.set_xlabel("every person found by the time limit")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_yticks(range(len(searches)), list(searches))
    axes.grid(axis="y", visible=False)
    _legend_below(figure, looks, evaluations, dots=True)
    return figure


# One episode.


@_styled
def episode(
    policy: object,
    search: object,
    *,
    seed: int = 0,
    step: int | None = None,
    name: str | None = None,
) -> Figure:
    """Draw one episode as two maps: the prior on the left, the posterior on the right.

    Both show every drone's track, the cells it searched, and the track of each person, which
    the drones do not see.

    Args:
        policy: as for `evaluate`; a callable sees one search, as `DroneSwarmSearch` shows it.
        search: the name of a search of the suite, a `NamedSearch`, or a `Scenario`.
        seed: of the episode, an integer >= 0.
        step: the step to show; None, or a step after the end, shows the last.
        name: the policy's name in the picture.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown.
    """
    spec, where = PolicySpec.of(policy, name), as_named(search)
    last = None if step is None else checks.integer("step", step, 0)
    pairs = []
    for pair in frames(spec, where, seed=seed):
        pairs.append(pair)
        if pair[1].step == last:
            break
    now = pairs[-1][1]
    state = f", step {now.step} of {now.timestep_limit}"
    if now.ending is not None:
        state = f": {outcome_in_brief(now)}"
    figure = Figure(figsize=(DOUBLE, 3.75))
    figure.suptitle(f"{spec.name} searching {where.name}, seed {seed}{state}", fontweight="bold")
    panels = figure.subplots(1, 2)
    for axes, frame, title in zip(panels, pairs[-1], ("prior", "posterior"), strict=True):
        image = axes.imshow(frame.matrix, vmin=0.0, alpha=0.6)  # pale, so that tracks stand out
        figure.colorbar(image, ax=axes, format=PercentFormatter(1.0), shrink=0.8)
        axes.set(title=title, xlabel="x", ylabel="y")
        axes.grid(visible=False)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(6, integer=True))
        _draw_tracks(axes, [posterior for _, posterior in pairs])
    _track_legend(figure)
    return figure


MARKERS: dict[str, dict[str, Any]] = {
    "start": {"marker": "o", "fillstyle": "none", "markeredgewidth": 0.9},
    "searched": {"marker": "o", "markersize": 3},
    "drone": {"marker": "X", "markersize": 6},
    "person": {"marker": "*", "markersize": 8},
}
PERSON_TRACK: dict[str, Any] = {"color": INK, "linewidth": 0.8, "linestyle": ":"}


def _marker(kind: str, colour: str) -> dict[str, Any]:
    """How to draw markers of one colour; those of the start are hollow."""
    edge = "markeredgecolor" if kind == "start" else "color"
    return {"linestyle": "none", **MARKERS[kind], edge: colour}


def _draw_tracks(axes: Axes, past: Sequence[Frame]) -> None:
    """Draw what the drones did until now, and the persons."""
    for drone in range(len(past[0].drones)):
        colour = TRACKS[drone % len(TRACKS)]
        track = np.array([frame.drones[drone] for frame in past])
        searched = track[[frame.searching[drone] for frame in past]]
        axes.plot(*track.T, color=colour, linewidth=0.9)
        axes.plot(*track[:1].T, **_marker("start", colour))
        axes.plot(*searched.T, **_marker("searched", colour))
        axes.plot(*track[-1:].T, **_marker("drone", colour))
    for person in range(len(past[0].persons)):
        track = np.array([frame.persons[person] for frame in past])
        axes.plot(*track.T, **PERSON_TRACK)
        axes.plot(*track[-1:].T, **_marker("person", INK))


def _track_legend(figure: Figure) -> None:
    entries = [Line2D([], [], color=GREY, linewidth=0.9, label="drone's track")]
    entries += [Line2D([], [], **_marker(kind, GREY), label=kind) for kind in MARKERS]
    entries.append(Line2D([], [], **PERSON_TRACK, label="person's track"))
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries))


# Calibration.


@_styled
def reliability(tables: Mapping[str, Reliability]) -> Figure:
    """Draw a reliability diagram: forecast probability of success against the outcomes.

    The points of a calibrated matrix lie on the diagonal. Bars are Wilson's intervals. A
    triangle marks the upper end of the interval of a bin in which nobody was found.

    Args:
        tables: names and tables; those without searches are left out.

    Raises:
        ValueError: no table has a search.
    """
    shown = {name: table for name, table in tables.items() if table.searches.any()}
    if not shown:
        raise ValueError(f"tables must hold at least one search, got {sorted(tables)}")
    figure = Figure(figsize=(SINGLE, 3.3))
    axes = figure.add_subplot()
    axes.axline((1e-3, 1e-3), (1.0, 1.0), color=GREY, linewidth=0.8)
    looks = [LOOKS["planner"], LOOKS["greedy-posterior"], *OTHERS]
    shares: list[float] = []
    for place, (name, table) in enumerate(shown.items()):
        label = f"{name} (mean error {100 * table.expected_error:.2f}%)"
        shares += _draw_reliability(axes, table, looks[place % len(looks)], label)
    ends = [10.0 ** math.floor(math.log10(min(shares))), 10.0 ** math.ceil(math.log10(max(shares)))]
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends, aspect="equal")
    axes.set(xlabel="forecast probability of success", ylabel="share of searches that found")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(lambda share, _: f"{100 * share:g}%")
        axis.set_minor_locator(NullLocator())
    axes.legend(loc="upper left")
    return figure


def _draw_reliability(axes: Axes, table: Reliability, look: Look, label: str) -> list[float]:
    """Draw the points of a table; returns the shares that the axes must show."""
    used = (table.searches > 0) & (table.forecast > 0.0)
    forecasts = table.mean_forecast[used]
    searches, found = table.searches[used].tolist(), table.found[used].tolist()
    bands = [wilson(min(one, all_), all_) for one, all_ in zip(found, searches, strict=True)]
    value, low, high = np.array(bands).T if bands else np.empty((3, 0))
    hit = value > 0.0
    axes.errorbar(
        forecasts[hit],
        value[hit],
        yerr=[(value - low)[hit], (high - value)[hit]],
        fmt=look.marker + "-",
        color=look.colour,
        linewidth=0.7,
        elinewidth=0.9,
        label=label,
    )
    axes.plot(forecasts[~hit], high[~hit], "v", markeredgecolor=look.colour, fillstyle="none")
    return [*forecasts.tolist(), *value[hit].tolist(), *high[~hit].tolist()]


# Shared by several plots.


def _by_search(evaluations: Iterable[Evaluation]) -> dict[str, list[Evaluation]]:
    """The evaluations of each search, in order of first appearance."""
    searches: dict[str, list[Evaluation]] = {}
    for each in evaluations:
        searches.setdefault(each.search.name, []).append(each)
    if not searches:
        raise ValueError("evaluations must be at least one, got none")
    return searches


def _looks(evaluations: Iterable[Evaluation]) -> dict[str, Look]:
    """The look of each policy, in order of first appearance."""
    names = list(dict.fromkeys(each.policy for each in evaluations))
    others = [name for name in names if name not in LOOKS]
    spare = {name: OTHERS[place % len(OTHERS)] for place, name in enumerate(others)}
    return {name: LOOKS.get(name) or spare[name] for name in names}


def _bound_of(evaluations: Iterable[Evaluation]) -> Bound | None:
    """The bound of a search, if one of its evaluations has it."""
    return next((each.bound for each in evaluations if each.bound is not None), None)


def _size_of(search: NamedSearch) -> str:
    size, drones = search.scenario.grid_size, search.scenario.n_drones
    return f"{size} × {size} cells, {drones} drone{'' if drones == 1 else 's'}"  # noqa: RUF001


def _legend_below(
    figure: Figure,
    looks: Mapping[str, Look],
    evaluations: Iterable[Evaluation],
    *,
    dots: bool = False,
) -> None:
    """Add a legend with a line or a dot for each policy, and for the bound if there is one."""
    entries = []
    for name, (colour, marker) in looks.items():
        look: dict[str, Any] = {"marker": marker, "linestyle": "none"} if dots else {}
        entries.append(Line2D([], [], color=colour, **look, label=name))
    if _bound_of(evaluations) is not None:
        look = BOUND
        if dots:
            bar = {"linestyle": "none", "marker": "|", "markersize": 8, "markeredgecolor": INK}
            look = {**BOUND, **bar, "markeredgewidth": 1.8}
        entries.append(Line2D([], [], **look, label=BOUND_LABEL))
    columns = min(LEGEND_COLUMNS, len(entries))
    figure.legend(handles=entries, loc="outside lower center", ncols=columns)
