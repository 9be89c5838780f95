"""The files of a leaderboard: the page in Markdown, the data, and the plots."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation.board import (
    EXPECTED_ORDER,
    Leaderboard,
    example_search,
    in_expected_order,
)
from DroneSwarmSearch.evaluation.results import Evaluation, save_csv
from DroneSwarmSearch.evaluation.statistics import ROUNDING, Estimate, mean_of
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, versions
from DroneSwarmSearch.evaluation.tables import markdown_table, percent, signed
from DroneSwarmSearch.policies import POLICIES

__all__ = ["PLOTS", "Table", "markdown", "overview", "suite_table", "times", "write"]

Table = list[list[str]]
"""Rows of cells; the first row is the heading."""

WIDTH = 98
"""Characters in a line of text."""

WIDE = 0.5
"""Percentage points or steps; a figure with an interval of this width has no decimals."""

TRIVIAL = 0.9995
"""A bound from here on is printed as 100%."""

PLOTS = {
    "success": "For every search, a row with the success of each policy, with an interval if it is "
    "not exact, and the bound as a black bar.",
    "curves": "For every search, a panel with the success of each policy over time, and the bound "
    "as a dashed line above the curves.",
    "one-search": "The success of each policy over time on one search.",
    "episode": "Two maps of one episode, the prior and the posterior, with the drones' tracks.",
    "reliability": "A reliability diagram: the share of searches that found, against the forecast, "
    "for the prior and for the posterior, with the diagonal of perfect calibration.",
}
"""The plots by file name without suffix, with their text alternatives."""


def write(board: Leaderboard, out: Path, command: str) -> list[Path]:
    """Write `leaderboard.md`, `.csv` and `.json`, and plots if Matplotlib is installed.

    Args:
        board: the results.
        out: the folder, created if necessary.
        command: the command that made them, for the page.

    Returns:
        The files.

    Raises:
        StorageError: a file cannot be written.
    """
    text, table, data = (out / f"leaderboard{suffix}" for suffix in (".md", ".csv", ".json"))
    plots = _draw(board, out)
    write_text(text, markdown(board, command, {path.stem for path in plots}))
    save_csv(table, board.evaluations)
    write_text(data, json.dumps(_data(board, command), allow_nan=False) + "\n")
    return [text, table, data, *plots]


def _data(board: Leaderboard, command: str) -> dict[str, Any]:
    """Everything except the single episodes, as plain JSON data."""
    first = board.evaluations[0]
    return {
        **versions(),
        "command": command,
        "episodes": len(first.episodes),
        "seed": first.seed,
        "all_searches": [
            {
                "policy": each.policy,
                "success": each.success.data,
                "restricted_mean_time_over_limit": each.time.data,
                "share_of_bound": each.share_of_bound and each.share_of_bound.data,
            }
            for each in board.summaries
        ],
        "comparisons": [
            {
                "first": each.first,
                "second": each.second,
                "success": each.success.data,
                "restricted_mean_time_over_limit": each.time.data,
                "verdict": each.verdict,
            }
            for each in board.comparisons
        ],
        "calibrations": [
            {
                "policy": each.policy,
                "forecasts": dict(each.forecasts),
                "found": {name: share.data for name, share in each.found.items()},
                "intervals_holding": each.holding,
                "largest_deviation": dict([each.largest_deviation]),
            }
            for each in board.calibrations
        ],
        "evaluations": [each.data for each in board.evaluations],
    }


def _draw(board: Leaderboard, out: Path) -> list[Path]:
    """Draw the plots; without Matplotlib, print a hint and draw none."""
    try:
        from DroneSwarmSearch.evaluation import maps, plot_style, plots
    except ImportError as error:
        print(error, file=sys.stderr)
        return []
    example = example_search(board.searches)
    figures = {
        "success": plots.success_by_search(board.evaluations),
        "curves": plots.suite_over_time(board.evaluations),
    }
    if len(board.searches) > 1:
        here = [board.by_name[policy, example.name] for policy in board.policies]
        figures["one-search"] = plots.success_over_time(here)
    of_package = [name for name in in_expected_order(board.policies) if name in POLICIES]
    if of_package:
        figures["episode"] = maps.episode(of_package[0], example, seed=board.evaluations[0].seed)
    if board.posterior is not None:
        prior = board.by_name[board.posterior.policy, board.posterior.search.name]
        tables = {"prior": prior.reliability, "posterior": board.posterior.reliability}
        if any(table.searches.any() for table in tables.values()):
            figures["reliability"] = plots.reliability(tables)
    return [path for name in figures for path in plot_style.save(figures[name], out / name)]


def markdown(board: Leaderboard, command: str, plots: Collection[str] = ()) -> str:
    """Return the page of a leaderboard.

    Args:
        board: the results.
        command: the command that made them.
        plots: the names in `PLOTS` whose files are in the folder of the page.
    """
    return "\n".join(_lines(board, command, plots)).rstrip() + "\n"


def _lines(board: Leaderboard, command: str, plots: Collection[str]) -> Iterator[str]:
    first = board.evaluations[0]
    episodes = len(first.episodes)
    yield from ("# Leaderboard", "")
    yield from _paragraph(
        f"{_count(len(board.policies), 'policy', 'policies')} on "
        f"{_count(len(board.searches), 'search', 'searches')} of suite {SUITE_VERSION}. "
        f"{_legend(board)} Sampled figures are from {episodes:,} episodes with the seeds "
        f"{first.seed:,} to {first.seed + episodes - 1:,}, the same for all policies. Made with "
        f"DroneSwarmSearch {DroneSwarmSearch.__version__} and NumPy {np.__version__} by"
    )
    yield from ("```sh", command, "```", "", "## Success", "")
    coverage = ""
    if _has_coverage(board):
        coverage = (
            " In coverage missions nobody is found: success is then the probability of success "
            "(POS) of the searches made."
        )
    yield from _paragraph(
        "The probability, in percent, that every person is found within the time limit; the best "
        f"of each search is in bold.{coverage}"
    )
    yield from (*markdown_table(overview(board)), "", *_plot("success", plots))
    yield from ("## Time", "")
    yield from _paragraph(
        "The restricted mean time to find in steps: the mean step at which the last person is "
        "found, with failures counting as the time limit. It distinguishes policies that succeed "
        "equally often. The lowest is in bold."
    )
    yield from (*markdown_table(times(board)), "")
    yield from (*_plot("curves", plots), *_plot("one-search", plots))
    yield from ("## All searches", "")
    yield from _paragraph("Means over the searches with equal weights; of times, lower is better.")
    yield from (*markdown_table(suite_table(board)), "")
    yield from _comparisons(board)
    yield from _bounds(board)
    yield from _calibration(board, plots)
    yield from ("## Searches", "")
    for search in board.searches:
        yield from _item(f"**{search.name}**: {search.reason} {search.outline}.")
    yield ""
    if "episode" in plots:
        yield from ("## One episode", "", *_plot("episode", plots))
    yield "Add your own policy: `python -m DroneSwarmSearch leaderboard --add module:callable`."


def _legend(board: Leaderboard) -> str:
    """How exact and other figures look, and what they are, as far as the page has them."""
    methods = {each.method for each in board.evaluations}
    if methods == {"exact"}:
        return "Success and time are exact: they have no sampling error."
    text = "Success and time are estimates, with a tilde or a 95% confidence interval."
    if "exact" in methods:
        text = (
            "Success and time are exact, without sampling error, unless they are estimates, with a "
            "tilde or a 95% confidence interval."
        )
    if "conditional" in methods:
        text += (
            " Estimates are means over sampled paths of the probability of success given the path "
            "(conditional Monte Carlo)."
        )
    return text


def overview(board: Leaderboard, best: str = "**{}**") -> Table:
    """A table of success in percent: a row for each search, a column for each policy.

    Args:
        board: the results.
        best: the format for the best policy of each search.
    """
    rows = _by_search(board, lambda each: each.success.scaled(100.0), max, best)
    if board.bounds:
        rows[0].append("bound")
        for row in rows[1:]:
            row.append(_percent(board.bounds[row[0]].by_limit))
    return rows


def times(board: Leaderboard) -> Table:
    """A table of the restricted mean times in steps, in the form of `overview`."""
    rows = _by_search(board, lambda each: each.time, min, "**{}**")
    rows[0].append("limit")
    for row, search in zip(rows[1:], board.searches, strict=True):
        row.append(f"{search.scenario.timestep_limit:,}")
    return rows


def _by_search(
    board: Leaderboard,
    figure_of: Callable[[Evaluation], Estimate],
    best_of: Callable[[Iterable[float]], float],
    best: str,
) -> Table:
    """A figure of every policy, a column for each, on every search, a row for each."""
    rows = [["search", *board.policies]]
    for search in board.searches:
        figures = [figure_of(board.by_name[name, search.name]) for name in board.policies]
        most = best_of(each.value for each in figures)
        row = [
            best.format(_short(each)) if abs(each.value - most) < ROUNDING else _short(each)
            for each in figures
        ]
        rows.append([search.name, *row])
    return rows


def suite_table(board: Leaderboard) -> Table:
    """A table of the summaries in percent: a row for each policy."""
    bounded = all(each.share_of_bound is not None for each in board.summaries)
    rows = [["policy", "success, %", "time, % of limit", *["share of bound, %"] * bounded]]
    for each in board.summaries:
        share = [percent(each.share_of_bound)] * bounded
        rows.append([each.policy, percent(each.success), percent(each.time), *share])
    return rows


def _comparisons(board: Leaderboard) -> Iterator[str]:
    """Whether the policies are in the expected order."""
    if not board.comparisons:
        return
    rows = [["policy", "compared with", "verdict", "success, points", "time, points"]]
    for each in board.comparisons:
        row = [each.first, each.second, each.verdict]
        row += [signed(each.success.scaled(100)), signed(each.time.scaled(100))]
        rows.append(row)
    groups = [[name for name in group if name in board.policies] for group in EXPECTED_ORDER]
    order = "; ".join(", ".join(group) for group in groups if group)
    ranked = {name for group in groups for name in group}
    others = [name for name in board.policies if name not in ranked]
    expected = ""
    if len([group for group in groups if group]) > 1:
        expected = (
            f"The expected order is {order}: the more of what is known a policy uses, the better. "
            "No theorem guarantees it for drones that must fly between cells. "
            f"{_exceptions(board)} "
        )
    unranked = ""
    if others:
        unranked = f"{', '.join(others)}: not ranked in advance. "
    yield from ("## Pairwise comparisons", "")
    yield from _paragraph(
        f"{expected}{unranked}Differences (policy minus compared policy) are means over the "
        "searches, in percentage points; below 0 in time, the policy is faster."
    )
    yield from (*markdown_table(rows, words=3), "")


def _exceptions(board: Leaderboard) -> str:
    """Which comparisons contradict the expected order, and where single searches do."""
    ranked = {name for group in EXPECTED_ORDER for name in group}
    expected = [each for each in board.comparisons if each.first in ranked]
    against = [
        f"{each.first} is {each.verdict} than {each.second}"
        for each in expected
        if each.success.high < -ROUNDING
    ]
    clear = sum(each.success.low > ROUNDING for each in expected)
    text = (
        f"In the mean over all searches, {clear} of {_count(len(expected), 'pair', 'pairs')} "
        f"{'is' if clear == 1 else 'are'} in this order"
    )
    return f"{text}; {', '.join(against)}." if against else f"{text}."


def _bounds(board: Leaderboard) -> Iterator[str]:
    """The bounds beside the best known success, and whether any policy exceeds them."""
    if not board.bounds:
        return
    rows = [
        ["search", "best policy", "best known, %", "bound, %", "their ratio, %"]
        + ["duality gap, points", "confidence, %"]
    ]
    ratios = []
    for name, bound in board.bounds.items():
        sure = "exact" if bound.confidence >= 1.0 else f"{100 * bound.confidence:.4g}"
        best = board.best_known(name)
        share = best.share_of_bound
        ratios += [] if share is None else [share.value]
        shown = ["-" if share is None else _short(share.scaled(100.0))]
        rows.append([name, best.policy, _short(best.success.scaled(100.0))])
        rows[-1] += [_percent(bound.by_limit), *shown, f"{100 * bound.gap:.2f}", sure]
    above = [f"{each.policy} on {each.search.name}" for each in board.above_bound]
    holds = "No exact value and no interval lies above a bound."
    if above:
        holds = f"Above the bound: {', '.join(above)}."
    trivial = [name for name, bound in board.bounds.items() if bound.by_limit >= TRIVIAL]
    no_limit = ""
    if trivial:
        no_limit = f" The bound is trivial on {', '.join(trivial)}: 100%."
    together = 1.0 - sum(1.0 - bound.confidence for bound in board.bounds.values())
    sure = "exact" if together >= 1.0 else f"valid together with at least {100 * together:.4g}%"
    sure += "" if together >= 1.0 else " confidence"
    mean = f" The mean ratio is {100 * fmean(ratios):.1f}%." if ratios else ""
    yield from ("## Bounds", "")
    yield from _paragraph(
        "The optimal success lies between the best known and the bound, which belongs to a relaxed "
        f"problem and includes its duality gap and sampling error.{mean}{no_limit} The bounds "
        f"are {sure}. {holds}"
    )
    yield from (*markdown_table(rows, words=2), "")


def _calibration(board: Leaderboard, plots: Collection[str]) -> Iterator[str]:
    """Forecasts of success against the shares found, and those of single searches."""
    shows_plot = "reliability" in plots and board.posterior is not None
    if not (board.calibrations or shows_plot):
        return
    yield from ("## Calibration", "")
    if board.calibrations:
        yield from _success_forecasts(board)
    if shows_plot:
        assert board.posterior is not None
        prior = board.by_name[board.posterior.policy, board.posterior.search.name]
        errors = [100 * each.reliability.expected_error for each in (board.posterior, prior)]
        yield from _paragraph(
            f"The single searches of {board.posterior.policy} on {board.posterior.search.name}, "
            "binned by their forecast: the expected calibration error is "
            f"{errors[0]:.2f} points with the posterior and {errors[1]:.2f} with the prior, which "
            "ignores earlier searches."
        )
        yield from _plot("reliability", plots)


def _success_forecasts(board: Leaderboard) -> Iterator[str]:
    """The forecast success of every policy against the share that it found."""
    rows = [
        ["policy", "forecast, %", "found, %", "intervals that hold", "largest deviation, points"]
    ]
    for each in board.calibrations:
        name, deviation = each.largest_deviation
        forecast = fmean(each.forecasts.values())
        found = mean_of(each.found.values())
        rows.append([each.policy, _percent(forecast), percent(found)])
        rows[-1].append(f"{each.holding} of {len(each.found)}")
        rows[-1].append(f"{100 * deviation:+.1f} ({name})")
    held = sum(each.holding for each in board.calibrations)
    total = sum(len(each.found) for each in board.calibrations)
    several = ""
    if any(len(each.scenario.situation) > 1 for each in board.searches):
        several = (
            " With two persons, the forecast is the probability that both are found, over every "
            "order and time of the first find. The planner also forecasts the find of each person "
            "under its present plan; that is no forecast of finding both, since it replans after a "
            "find."
        )
    yield from _paragraph(
        "A policy's forecast probability of success is its exact success, computed from its own "
        "posteriors; what it found is the share of sampled episodes. "
        f"{held} of {_count(total, 'interval holds', 'intervals hold')} the forecast; of 95% "
        "intervals, about one in twenty should miss. All policies play the same episodes, so "
        f"misses come together.{several}"
    )
    yield from (*markdown_table(rows), "")


def _has_coverage(board: Leaderboard) -> bool:
    return any(each.scenario.mission == "coverage" for each in board.searches)


def _paragraph(text: str) -> list[str]:
    return [*textwrap.wrap(text, WIDTH, break_on_hyphens=False), ""]


def _item(text: str) -> list[str]:
    """A bullet point."""
    first, *others = textwrap.wrap(text, WIDTH - 2, break_on_hyphens=False)
    return [f"- {first}", *(f"  {line}" for line in others)]


def _plot(name: str, plots: Collection[str]) -> list[str]:
    return [f"![{PLOTS[name]}]({name}.png)", ""] if name in plots else []


def _count(count: int, one: str, several: str) -> str:
    return f"{count:,} {one if count == 1 else several}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def _short(estimate: Estimate) -> str:
    """An exact figure; or another one without the digits that its interval does not support."""
    if estimate.is_exact:
        return f"{estimate.value:.1f}"
    return f"~{estimate.value:.{int(estimate.high - estimate.low < WIDE)}f}"
