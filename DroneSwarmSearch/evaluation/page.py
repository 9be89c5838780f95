"""The files of a leaderboard: the page in Markdown, the data, and the plots."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation.board import (
    Leaderboard,
    PolicySummary,
    example_search,
    ranked_by_theory,
)
from DroneSwarmSearch.evaluation.results import Evaluation, save_csv
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch, versions
from DroneSwarmSearch.evaluation.tables import figure, markdown_table, percent, signed
from DroneSwarmSearch.policies import POLICIES

__all__ = ["PLOTS", "Table", "markdown", "overview", "suite_table", "write"]

Table = list[list[str]]
"""Rows of cells; the first row is the heading."""

WIDTH = 98
"""Characters in a line of text."""

PLOTS = {
    "success": "For every search, a row with the success of each policy, its interval, and the "
    "bound as a black bar.",
    "curves": "For every search, a panel with the success of each policy over time, and the bound "
    "as a dashed line above the curves.",
    "one-search": "The success of each policy over time on one search.",
    "episode": "Two maps of one episode, the prior and the posterior, with the drones' tracks.",
    "reliability": "A reliability diagram of the prior and the posterior: the points of the "
    "posterior lie on the diagonal.",
}
"""The plots by file name without suffix, with their text alternatives."""

NOTES = {
    "ppo": "The network `ppo` was trained with an earlier drift model, in which persons wandered "
    "more between neighbouring cells, and only on searches from a known cell. It searches the same "
    "cells too often."
}
"""What readers should know of the package's policies, by name."""


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
                "success": each.success._asdict(),
                "restricted_mean_time_over_limit": each.time._asdict(),
                "share_of_bound": each.share_of_bound and each.share_of_bound._asdict(),
            }
            for each in board.summaries
        ],
        "comparisons": [
            {
                "first": each.first,
                "second": each.second,
                "success": each.success._asdict(),
                "restricted_mean_time_over_limit": each.time._asdict(),
                "verdict": each.verdict,
            }
            for each in board.comparisons
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
    of_package = [name for name in ranked_by_theory(board.policies) if name in POLICIES]
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
        f"{_count(len(board.searches), 'search', 'searches')} of suite {SUITE_VERSION}, "
        f"{episodes:,} episodes each with the seeds {first.seed:,} to "
        f"{first.seed + episodes - 1:,}. All policies use common random numbers. Made with "
        f"DroneSwarmSearch {DroneSwarmSearch.__version__} and NumPy {np.__version__} by"
    )
    yield from ("```sh", command, "```", "", "## Success", "")
    coverage = ""
    if _has_coverage(board):
        coverage = "In coverage missions, the mean probability of success of the searches made. "
    yield from _paragraph(
        "The share of episodes, in percent, in which every person was found within the time limit. "
        f"{coverage}The best policy of each search is in bold."
    )
    yield from (*markdown_table(overview(board)), "", *_plot("success", plots))
    yield from ("## All searches", "")
    yield from _paragraph(
        "Means over the searches with equal weights, with 95% confidence intervals. Time is the "
        "restricted mean time to find divided by the time limit; lower is better."
    )
    yield from (*markdown_table(suite_table(board)), "")
    for policy in board.policies:
        if policy in NOTES and policy not in board.added:
            yield from _paragraph(NOTES[policy])
    yield from _comparisons(board)
    yield from _bounds(board)
    yield from ("## Success over time", "", *_plot("curves", plots), *_plot("one-search", plots))
    yield from ("## Individual searches", "")
    for search in board.searches:
        yield from _search(board, search)
    if "episode" in plots:
        yield from ("## One episode", "", *_plot("episode", plots))
    if "reliability" in plots and board.posterior is not None:
        yield from ("## Calibration", "")
        yield from _paragraph(
            f"The searches of {board.posterior.policy} on {board.posterior.search.name}, binned by "
            "their forecast probability of success (POS). The posterior is calibrated. The prior "
            "ignores earlier searches: its forecasts are too high where drones search again, and "
            "too low elsewhere."
        )
        yield from _plot("reliability", plots)
    yield from _definitions(board)


def overview(board: Leaderboard, best: str = "**{}**") -> Table:
    """A table of success in percent: a row for each search, a column for each policy.

    Args:
        board: the results.
        best: the format for the best policy of each search.
    """
    rows = [["search", *board.policies, *["bound"] * bool(board.bounds)]]
    for search in board.searches:
        shares = [
            _percent(board.by_name[name, search.name].success.value) for name in board.policies
        ]
        most = max(shares, key=float)
        row = [search.name, *(best.format(each) if each == most else each for each in shares)]
        bounds = [board.bounds[search.name]] if board.bounds else []
        rows.append([*row, *(_percent(bound.by_limit) for bound in bounds)])
    return rows


def suite_table(board: Leaderboard) -> Table:
    """A table of the summaries in percent: a row for each policy."""
    return _results("time, % of limit", [(each, percent(each.time)) for each in board.summaries])


def _results(time: str, entries: list[tuple[PolicySummary | Evaluation, str]]) -> Table:
    """A table with a row for each policy, from its results and its time as text."""
    bounded = all(each.share_of_bound is not None for each, _ in entries)
    rows = [["policy", "success, %", time, *["share of bound, %"] * bounded]]
    for each, shown in entries:
        share = [percent(each.share_of_bound)] * bounded
        rows.append([each.policy, percent(each.success), shown, *share])
    return rows


def _comparisons(board: Leaderboard) -> Iterator[str]:
    """Whether the policies are in the order that theory predicts."""
    if not board.comparisons:
        return
    rows = [["policy", "compared with", "verdict", "success, points", "time, points"]]
    for each in board.comparisons:
        row = [each.first, each.second, each.verdict]
        row += [signed(each.success.scaled(100)), signed(each.time.scaled(100))]
        rows.append(row)
    yield from ("## Pairwise comparisons", "")
    yield from _paragraph(
        "Search theory predicts the order planner, greedy-posterior, greedy-matrix and the "
        "patterns, random. It makes no prediction for trained networks. The table shows paired "
        "differences (policy minus compared policy) in percentage points, with 95% confidence "
        "intervals. A negative difference in time means that the policy is faster."
    )
    yield from (*markdown_table(rows, words=3), "")


def _bounds(board: Leaderboard) -> Iterator[str]:
    """The bounds, and whether any policy exceeds them."""
    if not board.bounds:
        return
    rows = [["search", "bound, %", "duality gap, points", "confidence, %"]]
    for name, bound in board.bounds.items():
        sure = "exact" if bound.confidence >= 1.0 else f"{100 * bound.confidence:.4g}"
        rows.append([name, _percent(bound.by_limit), f"{100 * bound.gap:.2f}", sure])
    above = [f"{each.policy} on {each.search.name}" for each in board.above_bound]
    holds = "No policy's interval lies above the bound of any search."
    if above:
        holds = f"Intervals above the bound: {', '.join(above)}."
    yield from ("## Bounds", "")
    yield from _paragraph(
        "No policy can exceed these probabilities of success. The bound includes the duality gap "
        f"of its relaxation and the sampling error. {holds}"
    )
    yield from (*markdown_table(rows), "")


def _search(board: Leaderboard, search: NamedSearch) -> Iterator[str]:
    """One search: its reason, its parameters and the results of all policies."""
    yield from (f"### {search.name}", "", *_paragraph(search.reason))
    yield from _paragraph(f"{search.outline}.")
    evaluations = [board.by_name[policy, search.name] for policy in board.policies]
    rows = _results("time to find, steps", [(each, figure(each.time)) for each in evaluations])
    yield from (*markdown_table(rows), "")


def _definitions(board: Leaderboard) -> Iterator[str]:
    yield from ("## Definitions", "")
    entries = [
        "**success**: the share of episodes in which every person was found within the time limit, "
        "with Wilson's score interval (1927).",
        "**time to find**: mean step at which the last person was found, counting failed episodes "
        "as the time limit (restricted mean survival time; Royston and Parmar, 2013), with a "
        "bootstrap interval (Efron, 1979). It distinguishes policies that succeed equally often.",
        "**differences**: taken episode by episode, with Newcombe's interval for paired shares "
        "(1998) and a bootstrap interval for times. They are more precise than two separate "
        "intervals suggest.",
        "**all searches**: the intervals of the searches, combined by the square root of "
        "the sum of squares (MOVER; Zou and Donner, 2008).",
        "Add your own policy: `python -m DroneSwarmSearch leaderboard --add module:callable`.",
    ]
    if _has_coverage(board):
        entries.insert(
            2,
            "**coverage missions**: nobody is found. Success is the mean probability of success "
            "(POS) of the searches made, and time the expected time to find or the time limit, "
            "both with bootstrap intervals.",
        )
    if board.bounds:
        share = (
            "**share of bound**: success divided by the bound. The bound is that of a relaxed "
            "problem, so even an optimal policy may stay below 100%."
        )
        entries.insert(2, share)
    for entry in entries:
        first, *others = textwrap.wrap(entry, WIDTH - 2, break_on_hyphens=False)
        yield from (f"- {first}", *(f"  {line}" for line in others))


def _has_coverage(board: Leaderboard) -> bool:
    return any(each.scenario.mission == "coverage" for each in board.searches)


def _paragraph(text: str) -> list[str]:
    return [*textwrap.wrap(text, WIDTH, break_on_hyphens=False), ""]


def _plot(name: str, plots: Collection[str]) -> list[str]:
    return [f"![{PLOTS[name]}]({name}.png)", ""] if name in plots else []


def _count(count: int, one: str, several: str) -> str:
    return f"{count:,} {one if count == 1 else several}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"
