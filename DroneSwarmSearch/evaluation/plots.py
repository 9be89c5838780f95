"""Plots of success."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean
from typing import Any

# First, since its error explains how to install Matplotlib.
from DroneSwarmSearch.evaluation.plot_style import LIGHT, WIDTH, Look, Theme

# isort: split

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from DroneSwarmSearch.evaluation.results import Evaluation

__all__ = ["success_by_search", "success_over_time"]

SHARES = np.linspace(0.0, 1.0, 101)
"""The shares of the time limit at which curves of different searches are averaged."""


def success_over_time(evaluations: Sequence[Evaluation], theme: Theme = LIGHT) -> Figure:
    """Plot the success over time, a curve for each policy: the mean over the searches.

    The dashed line is the mean bound at the time limit, if every search has one. The legend lists
    the policies by their success.

    Args:
        evaluations: of every policy on every search.
        theme: the colours.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations, theme)
    figure = Figure(figsize=(WIDTH, 3.3))
    axes = figure.add_subplot()
    lines = []
    bounds = [_bound_of(several) for several in searches.values()]
    known = [bound for bound in bounds if bound is not None]
    if len(known) == len(bounds):
        bound = axes.axhline(fmean(known), color=theme.ink, linestyle=(0, (3, 1.5)))
        bound.set_label(f"bound {100 * fmean(known):.1f}%")
        lines.append(bound)
    curves = {policy: np.mean(_curves(policy, evaluations), axis=0) for policy in looks}
    for place, policy in enumerate(sorted(curves, key=lambda each: -curves[each][-1])):
        label = f"{policy} {100 * curves[policy][-1]:.1f}%"
        colour = looks[policy].colour
        lines += axes.plot(SHARES, curves[policy], color=colour, label=label, zorder=3 - place / 99)
    axes.set(xlim=(0, 1), ylim=(0, 1), ylabel=_measure(evaluations, "found", "POS"))
    axes.set_xlabel("time, share of the limit")
    _in_percent(axes.xaxis, axes.yaxis)
    figure.legend(handles=lines, loc="outside right upper", handlelength=1.2, borderpad=0)
    return figure


def _curves(policy: str, evaluations: Iterable[Evaluation]) -> list[Any]:
    """A policy's success at the `SHARES` of the time limit, on each search."""
    return [
        each.success_by_time.value[np.floor(SHARES * each.limit + 1e-9).astype(int)]
        for each in evaluations
        if each.policy == policy
    ]


def success_by_search(evaluations: Sequence[Evaluation], theme: Theme = LIGHT) -> Figure:
    """Plot the success by the time limit in a row for each search, with its intervals.

    The bar of a row is the bound.

    Args:
        evaluations: of policies on searches, in the order of the rows.
        theme: the colours.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations, theme)
    height = max(0.32, 0.05 * len(looks))
    figure = Figure(figsize=(WIDTH, height * len(searches) + 1.6))
    axes = figure.add_subplot()
    offsets = np.linspace(-0.36, 0.36, len(looks)) if len(looks) > 1 else np.zeros(1)
    offset = dict(zip(looks, offsets.tolist(), strict=True))
    for row, several in enumerate(searches.values()):
        if row % 2 == 0:
            axes.axhspan(row - 0.5, row + 0.5, color=theme.stripe, linewidth=0, zorder=0)
        bound = _bound_of(several)
        if bound is not None:
            axes.vlines(bound, row - 0.46, row + 0.46, color=theme.ink, linewidth=1.8)
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
    axes.set_xlabel(_measure(evaluations, "every person found", "probability of success"))
    _in_percent(axes.xaxis)
    axes.set_yticks(range(len(searches)), list(searches))
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    entries = [
        Line2D([], [], color=colour, marker=marker, linestyle="none", label=policy)
        for policy, (colour, marker) in looks.items()
    ]
    if any(_bound_of(several) is not None for several in searches.values()):
        bar: dict[str, Any] = {"marker": "|", "markersize": 9, "markeredgewidth": 1.8}
        bar |= {"markeredgecolor": theme.ink, "linestyle": "none"}
        entries.append(Line2D([], [], **bar, label="bound"))
    figure.legend(
        handles=entries, loc="outside lower center", ncols=min(3, len(entries)), handletextpad=0.2
    )
    return figure


# Shared by the plots.


def _by_search(evaluations: Iterable[Evaluation]) -> dict[str, list[Evaluation]]:
    """The evaluations of each search, in order of first appearance."""
    searches: dict[str, list[Evaluation]] = {}
    for each in evaluations:
        searches.setdefault(each.search.name, []).append(each)
    if not searches:
        raise ValueError("evaluations must be at least one, got none")
    return searches


def _looks(evaluations: Iterable[Evaluation], theme: Theme) -> Mapping[str, Look]:
    """The look of each policy, in order of first appearance."""
    names = list(dict.fromkeys(each.policy for each in evaluations))
    others = [name for name in names if name not in theme.looks]
    spare = {name: theme.others[place % len(theme.others)] for place, name in enumerate(others)}
    return {name: theme.looks.get(name) or spare[name] for name in names}


def _bound_of(evaluations: Iterable[Evaluation]) -> float | None:
    """The bound of a search by its time limit, if one of its evaluations has it."""
    return next((each.bound.by_limit for each in evaluations if each.bound is not None), None)


def _measure(evaluations: Iterable[Evaluation], rescue: str, coverage: str) -> str:
    """What success is, depending on the missions."""
    missions = {each.search.scenario.mission for each in evaluations}
    names = [
        name
        for name, mission in ((rescue, "rescue"), (coverage, "coverage"))
        if mission in missions
    ]
    return ", or ".join(names)


def _in_percent(*axes: Axis) -> None:
    for each in axes:
        each.set_major_formatter(PercentFormatter(1.0, decimals=0))
