"""Plots of success, in a light and a dark style; they need the extra "evaluation"."""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import fmean

import numpy as np

from DroneSwarmSearch._internal.extras import import_matplotlib
from DroneSwarmSearch._internal.files import write_bytes
from DroneSwarmSearch._internal.text import without_formulas
from DroneSwarmSearch.evaluation.results import Evaluation, known_bounds
from DroneSwarmSearch.rendering.palette import style_sheet

import_matplotlib("plots need the package matplotlib", "evaluation")

from matplotlib import rcParams, style  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.ticker import PercentFormatter  # noqa: E402

WIDTH = 5.2  # the width of a plot in inches: narrow, so that its text is legible on a phone

# In the order of the colours of the styles, the same in every plot; others have those after.
POLICIES = (
    "planner",
    "imitation",
    "greedy-forecast",
    "greedy-posterior",
    "greedy-matrix",
    "parallel-sweep",
    "creeping-line",
    "expanding-square",
    "sector-search",
    "random",
)

MARKERS = "Dh>os^vpXPH<d8"
Draw = Callable[[Sequence[Evaluation]], Figure]
DPI = 200  # of raster files

SHARES = np.linspace(0.0, 1.0, 101)  # of the time limit, where curves of searches are averaged


def save(draw: Draw, evaluations: Sequence[Evaluation], path: Path) -> list[Path]:
    """Write a plot as `<path>-light.svg`, `<path>-dark.svg`, `<path>.png` and `<path>.pdf`.

    The last two are light, for papers and slides. The user's settings have no effect.
    """
    files = {
        f"{path.name}-light.svg": "light",
        f"{path.name}-dark.svg": "dark",
        f"{path.name}.png": "light",
        f"{path.name}.pdf": "light",
    }
    written = []
    for name, theme in files.items():
        sheets = [style_sheet("plots"), style_sheet(theme)]
        target = path.with_name(name)
        with style.context(["default", *sheets]):
            content = encoded(draw(evaluations), target.suffix[1:])
        write_bytes(target, content)
        written.append(target)
    return written


def encoded(figure: Figure, kind: str) -> bytes:
    """A figure as a file of the kind "svg", "png" or "pdf"; equal figures make equal files."""
    dates = {"svg": {"Date": None, "Creator": None}, "pdf": {"CreationDate": None}, "png": {}}
    content = io.BytesIO()
    figure.savefig(content, format=kind, dpi=DPI, metadata=dates[kind])
    return content.getvalue()


def success_over_time(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot each policy's mean success over time, and the mean bound if every search has one."""
    figure = Figure(figsize=(WIDTH, 3.3))
    axes = figure.add_subplot()
    bounds = known_bounds(evaluations)
    if len(bounds) == len({result.search.name for result in evaluations}):
        mean = fmean(bounds.values())
        ink = rcParams["text.color"]
        axes.axhline(mean, color=ink, linestyle=(0, (3, 1.5)), label=f"bound {100 * mean:.1f}%")
    looks = _looks(evaluations)
    curves = {}
    for policy in looks:
        several = [result for result in evaluations if result.policy == policy]
        steps = [np.floor(SHARES * result.limit + 1e-9).astype(int) for result in several]
        sampled = [result.success_by_time[at] for result, at in zip(several, steps, strict=True)]
        curves[policy] = np.mean(sampled, axis=0)
    for policy, curve in sorted(curves.items(), key=lambda item: -item[1][-1]):
        colour, _ = looks[policy]
        axes.plot(SHARES, curve, color=colour, label=_label(policy, curve[-1]))
    axes.set(xlim=(0, 1), ylim=(0, 1), ylabel=_measure(evaluations, "found", "POS"))
    axes.set_xlabel("time, share of the limit")
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    figure.legend(loc="outside right upper", handlelength=1.2, borderpad=0)
    return figure


def success_by_search(evaluations: Sequence[Evaluation]) -> Figure:
    """Plot the success by the time limit in a row for each search; its bar is the bound."""
    looks = _looks(evaluations)
    searches = list(dict.fromkeys(result.search.name for result in evaluations))
    height = max(0.32, 0.05 * len(looks))
    figure = Figure(figsize=(WIDTH, height * len(searches) + 1.6))
    axes = figure.add_subplot()
    for row in range(0, len(searches), 2):
        stripe = rcParams["grid.color"]
        axes.axhspan(row - 0.5, row + 0.5, color=stripe, alpha=0.4, linewidth=0, zorder=0)
    offsets = np.linspace(-0.36, 0.36, len(looks)) if len(looks) > 1 else np.zeros(1)
    offset = dict(zip(looks, offsets.tolist(), strict=True))
    for result in evaluations:
        row = searches.index(result.search.name)
        colour, marker = looks[result.policy]
        value, low, high = result.success
        error = [[value - low], [high - value]]
        height = row + offset[result.policy]
        axes.errorbar(value, height, xerr=error, fmt=marker, color=colour, elinewidth=0.9)
    ink = rcParams["text.color"]
    bounds = known_bounds(evaluations)
    for search, bound in bounds.items():
        row = searches.index(search)
        axes.vlines(bound, row - 0.46, row + 0.46, color=ink, linewidth=1.8)
    axes.set(xlim=(-0.01, 1.01), ylim=(len(searches) - 0.5, -0.5))
    axes.set_xlabel(_measure(evaluations, "every person found", "probability of success"))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_yticks(range(len(searches)), [*map(without_formulas, searches)])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    handles = []
    for policy, (colour, marker) in looks.items():
        label = without_formulas(policy)
        handles.append(Line2D([], [], color=colour, marker=marker, linestyle="none", label=label))
    if bounds:
        bar = Line2D([], [], linestyle="none", marker="|", markersize=9, label="bound")
        bar.set(markeredgecolor=ink, markeredgewidth=1.8)
        handles.append(bar)
    figure.legend(
        handles=handles, loc="outside lower center", ncols=min(3, len(handles)), handletextpad=0.2
    )
    return figure


def _label(policy: str, success: float) -> str:
    """What the legend says of a policy."""
    return f"{without_formulas(policy)} {100 * success:.1f}%"


def _looks(evaluations: Iterable[Evaluation]) -> dict[str, tuple[str, str]]:
    """The colour and the marker of each policy, in order of first appearance."""
    others = itertools.cycle(range(len(POLICIES), len(MARKERS)))
    looks = {}
    for name in dict.fromkeys(result.policy for result in evaluations):
        number = POLICIES.index(name) if name in POLICIES else next(others)
        looks[name] = f"C{number}", MARKERS[number]
    return looks


def _measure(evaluations: Iterable[Evaluation], rescue: str, coverage: str) -> str:
    missions = sorted({result.is_coverage for result in evaluations})
    return ", or ".join((rescue, coverage)[is_coverage] for is_coverage in missions)
