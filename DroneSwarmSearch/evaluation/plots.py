"""Plots of success and calibration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

# First, since its error explains how to install Matplotlib.
from DroneSwarmSearch.evaluation.plot_style import (
    DOUBLE,
    GREY,
    INK,
    LOOKS,
    OTHERS,
    SINGLE,
    Look,
    styled,
)

# isort: split

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, NullLocator, PercentFormatter

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.episodes import Reliability
from DroneSwarmSearch.evaluation.results import Evaluation
from DroneSwarmSearch.evaluation.statistics import wilson
from DroneSwarmSearch.evaluation.suite import NamedSearch
from DroneSwarmSearch.planning.bound import SuccessBound

__all__ = ["reliability", "success_by_search", "success_over_time", "suite_over_time"]

BOUND: dict[str, Any] = {"color": INK, "linewidth": 1.6, "linestyle": (0, (3, 1.5))}
BOUND_LABEL = "bound: no policy can exceed it"

LEGEND_COLUMNS = 5


@styled
def success_over_time(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot the success within each step, a curve for each policy, on one search.

    The shaded bands are the intervals of `Evaluation.success_by_time`. The dashed line is the
    bound, if an evaluation has it. The legend lists the policies by their success.

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
    axes.set(xlabel="step", ylabel=_measure(several, "found", "POS"))
    ends = {line: float(np.asarray(line.get_ydata())[-1]) for line in axes.lines}
    lines = sorted(ends, key=ends.__getitem__, reverse=True)
    labels = [f"{line.get_label()} {100 * ends[line]:.1f}%" for line in lines]
    figure.legend(lines, labels, loc="outside right upper")
    return figure


@styled
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
            axes.set_ylabel(_measure(evaluations, "found", "POS"))
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


@styled
def success_by_search(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot the success by the time limit in a row for each search, with its intervals.

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
            axes.vlines(bound.by_limit, row - 0.46, row + 0.46, color=INK, linewidth=1.8)
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
    measure = _measure(evaluations, "every person found", "probability of success")
    axes.set_xlabel(f"{measure} by the time limit")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_yticks(range(len(searches)), list(searches))
    axes.grid(axis="y", visible=False)
    _legend_below(figure, looks, evaluations, dots=True)
    return figure


@styled
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


def _bound_of(evaluations: Iterable[Evaluation]) -> SuccessBound | None:
    """The bound of a search, if one of its evaluations has it."""
    return next((each.bound for each in evaluations if each.bound is not None), None)


def _measure(evaluations: Iterable[Evaluation], rescue: str, coverage: str) -> str:
    """What success is, depending on the missions."""
    missions = {each.search.scenario.mission for each in evaluations}
    names = [
        name
        for name, mission in ((rescue, "rescue"), (coverage, "coverage"))
        if mission in missions
    ]
    return ", or ".join(names)


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
