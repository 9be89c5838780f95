"""Figures of evaluations, fit for a paper: readable at column width, in print and to all eyes.

A policy has the same colour and marker in every figure. The colours are those of M. Okabe
and K. Ito, Color universal design, 2008, which people with any common colour vision tell
apart; yellow, too faint for lines on white, is darkened. Needs the packages of the extra
"evaluation".
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation.files import write_bytes
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.record import frames
from DroneSwarmSearch.evaluation.results import Bound, Evaluation
from DroneSwarmSearch.evaluation.statistics import Estimate, Reliability, wilson
from DroneSwarmSearch.evaluation.suite import NamedSearch, as_named
from DroneSwarmSearch.rendering.frame import Frame
from DroneSwarmSearch.rendering.labels import outcome_in_brief

try:
    from matplotlib import style
    from matplotlib.axes import Axes
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator, PercentFormatter
    from PIL import Image  # matplotlib needs it, too
except ImportError as error:
    raise ImportError(
        "figures need the package matplotlib: "
        'pip install "DroneSwarmSearchEnvironment[evaluation]"',
        name=error.name,
    ) from error

if TYPE_CHECKING:
    from matplotlib.image import AxesImage

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
"""Widths of one column and of two, in inches (IEEE's; other journals' are much the same)."""

DPI = 200
COLOURS = 256

INK, GREY, FAINT, BAND = "#18202c", "#70788a", "#e3e6eb", "#f5f6f8"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # ships with matplotlib
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "lines.solid_capstyle": "round",
    "text.color": INK,
    "svg.hashsalt": "DroneSwarmSearch",  # the same figure, the same file
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
"""For policies of one's own, in the order in which they come."""

TRACKS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b3fa0", "#8f7f00")

SEA = LinearSegmentedColormap.from_list("sea", ["#ffffff", "#dbe6f1", "#a3bddb", "#5b86b8"])
"""For probabilities: pale, so that tracks stand out."""

BOUND = "bound"
BOUND_DASHES = (0, (3, 1.5))

PANEL_HEIGHT = 1.4
"""Of small multiples, in inches, with title and axis."""

LEGEND_PANELS, LEGEND_COLUMNS = 2, 5
"""So many places of panels left over make room for the legend; else it goes below."""


def _styled(make: Callable[P, T]) -> Callable[P, T]:
    """Draw in the style of this module, whatever the user's own settings."""

    @wraps(make)
    def styled(*args: P.args, **kwargs: P.kwargs) -> T:
        with style.context(["default", STYLE]):
            return make(*args, **kwargs)

    return styled


@_styled
def save(figure: Figure, path: str | os.PathLike[str]) -> tuple[Path, Path]:
    """Write a figure as PNG of 200 dots per inch and as SVG.

    Args:
        figure: as the functions of this module make it.
        path: without suffix.

    Returns:
        The two files.

    Raises:
        StorageError: a file cannot be written.
    """
    pixels, drawing, picture = io.BytesIO(), io.BytesIO(), io.BytesIO()
    figure.savefig(pixels, format="png", dpi=DPI)
    figure.savefig(drawing, format="svg", metadata={"Date": None})
    # A palette makes a third of it, and no difference that can be seen.
    with Image.open(pixels) as image:
        few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(picture, "PNG", dpi=(DPI, DPI), optimize=True)
    written = Path(f"{os.fspath(path)}.png"), Path(f"{os.fspath(path)}.svg")
    for target, data in zip(written, (picture, drawing), strict=True):
        write_bytes(target, data.getvalue())
    return written


# Success over time.


@_styled
def success_over_time(evaluations: Sequence[Evaluation]) -> Figure:
    """The share of successes by each step, a curve for each policy, all on one search.

    Shaded is Wilson's interval; the bold dashed line is the bound that no policy can
    exceed, if an evaluation has one. Every curve is named at its end.

    Args:
        evaluations: of different policies on one search.

    Raises:
        ValueError: there is none, or they are of several searches.
    """
    (search, several), *others = _by_search(evaluations).items()
    if others:
        raise ValueError(
            f"evaluations must be of one search, got {', '.join([search, *(n for n, _ in others)])}"
        )
    figure = Figure(figsize=(SINGLE, 2.5), layout="constrained")
    axes = figure.add_subplot()
    _draw_curves(axes, several, _looks(evaluations))
    axes.set_title(search)
    axes.set_title(_size_of(several[0].search), loc="right", color=GREY, fontweight="normal")
    axes.set(xlabel="step", ylabel="found")
    _name_curves(axes, several, _looks(evaluations))
    return figure


@_styled
def suite_over_time(evaluations: Sequence[Evaluation], *, columns: int = 4) -> Figure:
    """The curves of `success_over_time`, a small panel for each search.

    Args:
        evaluations: of policies on searches, in any order; searches are shown in the order
            in which they come first.
        columns: panels in a row.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations)
    across = min(checks.integer("columns", columns, 1), len(searches))
    down = math.ceil(len(searches) / across)
    empty = down * across - len(searches)
    beside = empty >= LEGEND_PANELS
    height = PANEL_HEIGHT * down + (0.25 if beside else 0.75)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharey=True).reshape(-1)
    for place, (axes, (name, several)) in enumerate(zip(panels, searches.items(), strict=False)):
        _draw_curves(axes, several, looks, fine=True)
        axes.set_title(name, fontsize=7.5)
        size = _size_of(several[0].search)
        axes.set_title(size, loc="right", color=GREY, fontweight="normal", fontsize=5.6)
        axes.tick_params(labelleft=place % across == 0)
        if place + across >= len(searches):
            axes.set_xlabel("step")
        if place % across == 0:
            axes.set_ylabel("found")
    for axes in panels[len(searches) + beside :]:
        axes.remove()
    entries = _legend_entries(looks, any(each.bound is not None for each in evaluations))
    if beside:
        axes = panels[len(searches)]
        axes.axis("off")
        legend = axes.legend(handles=entries, loc="center left", ncols=2, fontsize=7)
        legend.set_in_layout(False)
    else:
        _legend_below(figure, entries)
    return figure


def _draw_curves(
    axes: Axes, evaluations: Sequence[Evaluation], looks: Mapping[str, Look], *, fine: bool = False
) -> None:
    """Curves with bands, and the bound; the first policy lies on top."""
    bound = _bound_of(evaluations)
    limit = evaluations[0].limit
    if bound is not None:
        steps = np.arange(len(bound.by_time))
        width = 1.4 if fine else 1.8
        axes.plot(steps, bound.by_time, color=INK, linewidth=width, linestyle=BOUND_DASHES)
    for depth, each in enumerate(evaluations):
        look, curve = looks[each.policy], each.success_by_time
        steps = np.arange(len(curve.value))
        top = 3.0 - depth / 100
        axes.fill_between(
            steps, curve.low, curve.high, color=look.colour, alpha=0.18, linewidth=0, zorder=top
        )
        width = 1.0 if fine else 1.3
        axes.plot(steps, curve.value, color=look.colour, linewidth=width, zorder=top)
    axes.set(xlim=(0, limit), ylim=(0, 1.02))
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1.0])
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xticks(_steps_to_mark(limit))


def _steps_to_mark(limit: int) -> list[int]:
    """Some steps evenly spread from 0 to the limit, if it can be divided so."""
    parts = next((parts for parts in (4, 3, 5, 2) if limit % parts == 0), 1)
    return list(range(0, limit + 1, limit // parts))


def _name_curves(axes: Axes, evaluations: Sequence[Evaluation], looks: Mapping[str, Look]) -> None:
    """Each curve's name and last value beside its end, moved apart where they would meet."""
    ends = [(each.policy, each.success.value, looks[each.policy].colour) for each in evaluations]
    bound = _bound_of(evaluations)
    if bound is not None:
        ends.append((BOUND, float(bound.by_time[-1]), INK))
    places = _apart([value for _, value, _ in ends], 0.068, 0.0, 1.02)
    for (name, value, colour), place in zip(ends, places, strict=True):
        axes.annotate(
            f"{name} {_percent(value)}",
            (1.0, value),
            (1.07, place),
            xycoords=axes.get_yaxis_transform(),
            textcoords=axes.get_yaxis_transform(),
            color=colour,
            fontsize=6.5,
            fontweight="bold" if name == BOUND else "normal",
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.5,
                "shrinkA": 0,
                "shrinkB": 0,
                "relpos": (0.0, 0.5),
            },
        )


def _apart(values: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Places as near to some values as may be, in their order and no nearer than a gap.

    Args:
        values: of any order.
        gap: least distance; smaller if there is not room enough.
        low: least place.
        high: greatest place.
    """
    count = len(values)
    gap = min(gap, (high - low) / max(count - 1, 1))
    order = sorted(range(count), key=values.__getitem__)
    # Less their number times the gap, places need only rise; the nearest that do (in the
    # mean square) are found by pooling neighbours that fall.
    pools: list[tuple[float, int]] = []
    for rank, index in enumerate(order):
        total, size = values[index] - rank * gap, 1
        while pools and pools[-1][0] / pools[-1][1] >= total / size:
            more, number = pools.pop()
            total, size = total + more, size + number
        pools.append((total, size))
    places = [0.0] * count
    rank = 0
    for total, size in pools:
        for _ in range(size):
            level = min(max(total / size, low), high - (count - 1) * gap)
            places[order[rank]] = level + rank * gap
            rank += 1
    return places


# Success by the limit.


@_styled
def success_by_search(evaluations: Sequence[Evaluation]) -> Figure:
    """The success by the limit, a row for each search: dots with Wilson's intervals.

    The bound that no policy can exceed is the black bar in each row.

    Args:
        evaluations: of policies on searches; searches are shown in the order in which they
            come first, from above, and so are the policies within each.

    Raises:
        ValueError: there is no evaluation.
    """
    searches, looks = _by_search(evaluations), _looks(evaluations)
    height = max(0.36, 0.062 * len(looks))
    figure = Figure(figsize=(DOUBLE, height * len(searches) + 0.85), layout="constrained")
    axes = figure.add_subplot()
    offsets = np.linspace(-0.36, 0.36, len(looks)) if len(looks) > 1 else np.zeros(1)
    level = dict(zip(looks, offsets.tolist(), strict=True))
    for row, several in enumerate(searches.values()):
        if row % 2 == 0:
            axes.axhspan(row - 0.5, row + 0.5, color=BAND, linewidth=0, zorder=0)
        bound = _bound_of(several)
        if bound is not None:
            axes.vlines(bound.by_time[-1], row - 0.46, row + 0.46, color=INK, linewidth=1.8)
        for each in several:
            look, success = looks[each.policy], each.success
            at = row + level[each.policy]
            axes.hlines(at, success.low, success.high, color=look.colour, linewidth=0.9, zorder=3)
            axes.plot(success.value, at, look.marker, **_marker(look.colour), zorder=4)
    axes.set(xlim=(-0.01, 1.01), ylim=(len(searches) - 0.5, -0.5))
    axes.set_xlabel("everybody found by the limit")
    axes.set_xticks(np.linspace(0, 1, 11))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_yticks(range(len(searches)), list(searches))
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)
    bounded = any(each.bound is not None for each in evaluations)
    _legend_below(figure, _legend_entries(looks, bounded, dots=True))
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
    """One episode as maps: the prior on the left, the posterior on the right.

    Over both: every drone's track from its start, the cells it searched, and where each
    person was and went, which no drone is told.

    Args:
        policy: as for `evaluate`; a callable is shown one search, in PettingZoo's form.
        search: a name of the suite, a `NamedSearch`, or a `Scenario`.
        seed: of the episode, an integer >= 0.
        step: the step to show; without it, or beyond the end, the last.
        name: the policy's name in the picture; without it, the one that it has.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or a name unknown.
    """
    spec, where = PolicySpec.of(policy, name), as_named(search)
    last = None if step is None else checks.integer("step", step, 0)
    pairs = []
    for pair in frames(spec, where, seed=seed):
        pairs.append(pair)
        if pair[1].step == last:
            break
    now = pairs[-1][1]
    figure = Figure(figsize=(DOUBLE, 3.75), layout="constrained")
    how = f", step {now.step} of {now.timestep_limit}"
    if now.ending is not None:
        how = f": {outcome_in_brief(now)}"
    figure.suptitle(
        f"{spec.name} searching {where.name}, seed {seed}{how}",
        x=0.01,
        ha="left",
        fontsize=8.5,
        fontweight="bold",
    )
    panels = figure.subplots(1, 2)
    titles = ("prior: the drift alone", "posterior: given the searches made")
    for axes, frame, title in zip(panels, pairs[-1], titles, strict=True):
        image = _draw_matrix(axes, frame)
        axes.set_title(title, fontweight="normal")
        bar = figure.colorbar(image, cax=axes.inset_axes((1.03, 0.0, 0.035, 1.0)))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        bar.ax.yaxis.set_major_locator(MaxNLocator(5))
        bar.outline.set_visible(False)
        _draw_tracks(axes, [after for _, after in pairs])
    panels[0].set_ylabel("y")
    _track_legend(figure)
    return figure


def _draw_matrix(axes: Axes, frame: Frame) -> AxesImage:
    """The matrix with coordinates as everywhere else: y grows downward."""
    image = axes.imshow(frame.matrix, cmap=SEA, vmin=0.0, interpolation="nearest")
    axes.grid(visible=False)
    axes.set_xlabel("x")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, integer=True))
        axis.set_minor_locator(NullLocator())
    for spine in axes.spines.values():
        spine.set_visible(True)
    return image


def _draw_tracks(axes: Axes, past: Sequence[Frame]) -> None:
    """What the drones did up to now, and the persons."""
    halo = [withStroke(linewidth=1.7, foreground="white")]
    cell = 72 * 2.75 / past[0].grid_size  # points across, near enough
    dot = min(max(0.55 * cell, 2.4), 5.0)
    for drone in range(len(past[0].drones)):
        colour = TRACKS[drone % len(TRACKS)]
        x, y = np.array([frame.drones[drone] for frame in past]).T
        axes.plot(x, y, color=colour, linewidth=0.9, path_effects=halo, zorder=3)
        axes.plot(x[0], y[0], "o", **_marker(colour, size=4.5, hollow=True), zorder=5)
        looked = [frame.drones[drone] for frame in past if frame.searching[drone]]
        if looked:
            axes.plot(*zip(*looked, strict=True), "o", **_marker(colour, size=dot), zorder=4)
        axes.plot(x[-1], y[-1], "X", **_marker(colour, size=6.0), zorder=6)
    for person in range(len(past[0].persons)):
        x, y = np.array([frame.persons[person] for frame in past]).T
        axes.plot(x, y, color=INK, linewidth=0.8, linestyle=(0, (1, 1)), zorder=4)
        axes.plot(x[-1], y[-1], "*", **_marker(INK, size=8.0), zorder=7)


def _track_legend(figure: Figure) -> None:
    grey = "#555d6b"
    entries = [
        Line2D([], [], color=grey, linewidth=0.9, label="drone's track"),
        Line2D([], [], **_marker(grey, size=4.5, hollow=True), marker="o", label="start"),
        Line2D([], [], **_marker(grey, size=3.5), marker="o", label="searched"),
        Line2D([], [], **_marker(grey, size=6.0), marker="X", label="drone"),
        Line2D([], [], color=INK, linewidth=0.8, linestyle=(0, (1, 1)), label="person's track"),
        Line2D([], [], **_marker(INK, size=8.0), marker="*", label="person"),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=len(entries))


# Calibration.


@_styled
def reliability(tables: Mapping[str, Reliability]) -> Figure:
    """The chance that the matrix gave a search against the share of searches that found.

    A calibrated matrix lies on the diagonal. Both axes are logarithmic, since chances of
    single cells are small; bars are Wilson's intervals. Where no search of a bin found
    anybody, a triangle points down from the interval's upper end.

    Args:
        tables: what to call each, and the table; those with no search are left out.

    Raises:
        ValueError: no table holds a search.
    """
    shown = {name: table for name, table in tables.items() if table.searches.any()}
    if not shown:
        raise ValueError(f"tables must hold at least one search, got {sorted(tables)}")
    figure = Figure(figsize=(SINGLE, 3.3), layout="constrained")
    axes = figure.add_subplot()
    axes.axline((1e-3, 1e-3), (1.0, 1.0), color=GREY, linewidth=0.8, zorder=1)
    looks = [LOOKS["planner"], LOOKS["greedy-posterior"], *OTHERS]
    shares: list[float] = []
    for place, (name, table) in enumerate(shown.items()):
        look = looks[place % len(looks)]
        label = f"{name} (mean error {100 * table.expected_error:.2f}%)"
        axes.plot([], [], look.marker, **_marker(look.colour, size=5.0), label=label)
        shares += _draw_reliability(axes, table, look)
    ends = [10.0 ** math.floor(math.log10(min(shares))), 10.0 ** math.ceil(math.log10(max(shares)))]
    axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends)
    axes.set(xlabel="chance that the matrix shown promised", ylabel="share of searches that found")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        axis.set_minor_locator(NullLocator())
    axes.set_aspect("equal")
    axes.legend(loc="upper left", handletextpad=0.3, borderaxespad=0.2, fontsize=6.5)
    return figure


def _draw_reliability(axes: Axes, table: Reliability, look: Look) -> list[float]:
    """The points of a table; returns the shares that the axes must show."""
    points: list[float] = []
    paired: list[tuple[float, float]] = []
    for searches, promised, found in zip(
        table.searches.tolist(), table.promised.tolist(), table.found.tolist(), strict=True
    ):
        if not searches or promised <= 0.0:
            continue
        mean = promised / searches
        share = Estimate(*(float(end) for end in wilson(min(found, searches), searches)))
        if found:
            axes.vlines(mean, share.low, share.high, color=look.colour, linewidth=0.9, zorder=3)
            axes.plot(mean, share.value, look.marker, **_marker(look.colour, size=5.0), zorder=4)
            paired.append((mean, share.value))
            points += [mean, share.value]
        else:
            axes.plot(
                mean, share.high, "v", **_marker(look.colour, size=4.5, hollow=True), zorder=3
            )
            points += [mean, share.high]
    if len(paired) > 1:
        axes.plot(*zip(*paired, strict=True), color=look.colour, linewidth=0.7, zorder=2)
    return points


# What the figures share.


def _by_search(evaluations: Iterable[Evaluation]) -> dict[str, list[Evaluation]]:
    """The evaluations of each search, in the order in which the searches come first."""
    searches: dict[str, list[Evaluation]] = {}
    for each in evaluations:
        searches.setdefault(each.search.name, []).append(each)
    if not searches:
        raise ValueError("evaluations must be at least one, got none")
    return searches


def _looks(evaluations: Iterable[Evaluation]) -> dict[str, Look]:
    """How each policy is drawn, in the order in which they come first."""
    looks: dict[str, Look] = {}
    strangers = 0
    for each in evaluations:
        if each.policy in looks:
            continue
        if each.policy in LOOKS:
            looks[each.policy] = LOOKS[each.policy]
        else:
            looks[each.policy] = OTHERS[strangers % len(OTHERS)]
            strangers += 1
    return looks


def _bound_of(evaluations: Iterable[Evaluation]) -> Bound | None:
    """The bound of a search, if any of its evaluations has it."""
    return next((each.bound for each in evaluations if each.bound is not None), None)


def _size_of(search: NamedSearch) -> str:
    """Grid and drones in few words."""
    size, drones = search.scenario.grid_size, search.scenario.n_drones
    return f"{size} × {size}, {drones} drone{'' if drones == 1 else 's'}"  # noqa: RUF001


def _percent(share: float) -> str:
    return f"{100 * share:.1f}%"


def _marker(colour: str, *, size: float = 3.6, hollow: bool = False) -> dict[str, Any]:
    """A marker alone: filled with a white rim, or a white one with a coloured rim."""
    return {
        "linestyle": "none",
        "markersize": size,
        "markerfacecolor": "white" if hollow else colour,
        "markeredgecolor": colour if hollow else "white",
        "markeredgewidth": 0.9 if hollow else 0.4,
    }


def _legend_entries(
    looks: Mapping[str, Look], bounded: bool, *, dots: bool = False
) -> list[Line2D]:
    """A line, or a dot, for each policy, and for the bound if there is one."""
    entries = []
    for name, look in looks.items():
        drawn: dict[str, Any] = {"color": look.colour, "linewidth": 1.6}
        if dots:
            drawn = {**_marker(look.colour, size=4.5), "marker": look.marker}
        entries.append(Line2D([], [], **drawn, label=name))
    if bounded:
        drawn = {"color": INK, "linewidth": 1.6, "linestyle": BOUND_DASHES}
        if dots:
            drawn |= {"linestyle": "none", "marker": "|", "markersize": 8, "markeredgewidth": 1.8}
        entries.append(Line2D([], [], **drawn, label=f"{BOUND}: no policy can exceed it"))
    return entries


def _legend_below(figure: Figure, entries: list[Line2D]) -> None:
    columns = min(LEGEND_COLUMNS, len(entries))
    figure.legend(handles=entries, loc="outside lower center", ncols=columns, fontsize=7)
