"""The files of a leaderboard: the page in Markdown, the data, and the plots."""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation.board import EXPECTED_ORDER, Leaderboard
from DroneSwarmSearch.evaluation.results import save_csv
from DroneSwarmSearch.evaluation.statistics import ROUNDING, Estimate
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch, versions
from DroneSwarmSearch.evaluation.tables import markdown_table, percent, signed

__all__ = ["PLOTS", "Table", "markdown", "overview", "suite_table", "write"]

Table = list[list[str]]
"""Rows of cells; the first row is the heading."""

LINE = 98
"""Characters in a line of text."""

WIDE = 0.5
"""Percentage points. Narrower intervals are left out; figures with wider ones have no decimals."""

TRIVIAL = 0.9995
"""A bound from here on is printed as 100%."""

PLOTS = {
    "time": "Curves of the mean success of each policy over time, and the mean bound as a dashed "
    "line.",
    "success": "For every search, a row with the success of each policy, with an interval if it is "
    "not exact, and the bound as a bar.",
}
"""The plots by file name without theme and suffix, with their text alternatives."""


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
    write_text(text, markdown(board, command, PLOTS if plots else ()))
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
                "gap_to_bound": each.gap and each.gap.data,
                "restricted_mean_time_over_limit": each.time.data,
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
        "evaluations": [each.data for each in board.evaluations],
    }


def _draw(board: Leaderboard, out: Path) -> list[Path]:
    """Draw the plots; without Matplotlib, print a hint and draw none."""
    try:
        from DroneSwarmSearch.evaluation import plot_style, plots
    except ImportError as error:
        print(error, file=sys.stderr)
        return []
    draw = {"time": plots.success_over_time, "success": plots.success_by_search}
    return [
        path
        for name in PLOTS
        for path in plot_style.save(partial(draw[name], board.evaluations), out / name)
    ]


def markdown(board: Leaderboard, command: str, plots: Collection[str] = ()) -> str:
    """Return the page of a leaderboard.

    Args:
        board: the results.
        command: the command that made them.
        plots: the names in `PLOTS` whose files are in the folder of the page.
    """
    return "\n".join(_lines(board, command, plots)).rstrip() + "\n"


def _lines(board: Leaderboard, command: str, plots: Collection[str]) -> Iterator[str]:
    yield from ("# Leaderboard", "")
    yield from _paragraph(_introduction(board))
    yield from (*markdown_table(suite_table(board)), "")
    yield from _paragraph(f"{_legend(board)}{_bounds(board)}")
    yield from _plot("time", plots)
    yield from ("## Searches", "")
    yield from _paragraph("Success on each search, in percent; the best is in bold.")
    yield from (*markdown_table(overview(board)), "", *_plot("success", plots))
    for search in board.searches:
        yield from _item(f"**{search.name}**: {_description(search)}")
    yield ""
    yield from _comparisons(board)
    yield from ("## How it was made", "", "```sh", command, "```", "")
    yield from _paragraph(_method(board))


def _introduction(board: Leaderboard) -> str:
    """What was evaluated, and what the columns of the first table mean."""
    text = (
        f"{_count(len(board.policies), 'policy', 'policies')} on "
        f"{_count(len(board.searches), 'search', 'searches')} of suite {SUITE_VERSION}, all with "
        "equal weights. *Success* is the probability that every person is found within the time "
        "limit. "
    )
    if any(each.scenario.mission == "coverage" for each in board.searches):
        text += (
            "In coverage missions, where nobody is found, it is the probability of success (POS) "
            "of the searches made. "
        )
    if board.mean_bound is not None:
        text += "*Gap* is the distance to the bound, which no policy can exceed. "
    return (
        f"{text}*Time* is the restricted mean time to find: the mean step at which the last person "
        "is found, with failures counting as the time limit."
    )


def _legend(board: Leaderboard) -> str:
    """How exact and other figures look, and what they are, as far as the page has them."""
    methods = {each.method for each in board.evaluations}
    if methods == {"exact"}:
        return "All figures are exact: they have no sampling error."
    text = "Figures are estimates, with a tilde or a 95% confidence interval."
    if "exact" in methods:
        text = (
            "Figures are exact (no sampling error), except estimates, which have a tilde or a 95% "
            "confidence interval."
        )
    if "conditional" in methods:
        text += (
            " Estimates are means over sampled paths of the probability of success given the path "
            "(conditional Monte Carlo)."
        )
    return text


def _bounds(board: Leaderboard) -> str:
    """How far the best policies are from the bounds, and whether any policy exceeds them."""
    if board.mean_bound is None:
        return ""
    shares = [board.best_known(name).share_of_bound for name in board.bounds]
    ratios = [each.value for each in shares if each is not None]
    mean = ""
    if ratios:
        mean = (
            " The optimum lies between the best policy and the bound: on average, the best policy "
            f"of a search reaches {100 * fmean(ratios):.1f}% of the bound."
        )
    trivial = [name for name, bound in board.bounds.items() if bound.by_limit >= TRIVIAL]
    no_limit = f" The bound is trivial on {', '.join(trivial)}: 100%." if trivial else ""
    together = 1.0 - sum(1.0 - bound.confidence for bound in board.bounds.values())
    sure = "The bounds are exact."
    if together < 1.0:
        sure = f"All bounds hold simultaneously with at least {100 * together:.4g}% confidence."
    above = [f"{each.policy} on {each.search.name}" for each in board.above_bound]
    holds = "No exact value and no interval lies above a bound."
    if above:
        holds = f"Above the bound: {', '.join(above)}."
    return f"{mean}{no_limit} {sure} {holds}"


def suite_table(board: Leaderboard) -> Table:
    """A table of the summaries: a row for each policy, the best first, and one for the bound."""
    bounded = board.mean_bound is not None
    rows = [["policy", "success, %", *["gap, points"] * bounded, "time, % of limit"]]
    for each in sorted(board.summaries, key=lambda each: -each.success.value):
        gap = [] if each.gap is None else [_short(each.gap)]
        success = _short(each.success) if _is_narrow(each.success) else percent(each.success)
        rows.append([each.policy, success, *gap, _short(each.time)])
    if board.mean_bound is not None:
        rows.append(["bound", _percent(board.mean_bound), "", ""])
    return rows


def overview(board: Leaderboard, best: str = "**{}**") -> Table:
    """A table of success in percent: a row for each search, a column for each policy.

    Args:
        board: the results.
        best: the format for the best policy of each search.
    """
    bounded = board.mean_bound is not None
    rows = [["search", *["bound"] * bounded, *board.policies]]
    for search in board.searches:
        figures = [board.by_name[name, search.name].success for name in board.policies]
        most = max(each.value for each in figures)
        row = [search.name]
        if bounded:
            row.append(_percent(board.bounds[search.name].by_limit))
        for each in figures:
            cell = _short(each)
            row.append(best.format(cell) if abs(each.value - most) < ROUNDING else cell)
        rows.append(row)
    return rows


def _description(search: NamedSearch) -> str:
    """The first sentence about a search, and its size."""
    first = search.reason.split(". ")[0].rstrip(".")
    size, drones = search.scenario.grid_size, search.scenario.n_drones
    steps = f"{search.scenario.timestep_limit:,} steps"
    return f"{first} ({size} x {size} cells, {_count(drones, 'drone', 'drones')}, {steps})."


def _comparisons(board: Leaderboard) -> Iterator[str]:
    """Whether the policies are in the expected order."""
    if not board.comparisons:
        return
    rows = [["policy", "compared with", "success, points", "time, points"]]
    for each in board.comparisons:
        differences = [
            _short(difference, "+") if _is_narrow(difference) else signed(difference.scaled(100.0))
            for difference in (each.success, each.time)
        ]
        rows.append([each.first, each.second, *differences])
    groups = [[name for name in group if name in board.policies] for group in EXPECTED_ORDER]
    groups = [group for group in groups if group]
    expected = ""
    if len(groups) > 1:
        expected = (
            f"The expected order is {'; '.join(', '.join(group) for group in groups)}: a "
            "policy that uses more information should do better, although no theorem guarantees it "
            f"for drones that must fly between cells. {_exceptions(board)} "
        )
    ranked = {name for group in groups for name in group}
    others = [name for name in board.policies if name not in ranked]
    unranked = f"{', '.join(others)}: not ranked in advance. " if others else ""
    yield from ("## Pairwise comparisons", "")
    yield from _paragraph(
        f"{expected}{unranked}Differences, policy minus compared policy, are means over the "
        "searches; below 0 in time, the policy is faster."
    )
    yield from (*markdown_table(rows, words=2), "")


def _exceptions(board: Leaderboard) -> str:
    """Which comparisons contradict the expected order."""
    ranked = {name for group in EXPECTED_ORDER for name in group}
    expected = [each for each in board.comparisons if each.first in ranked]
    against = [
        f"{each.first} is {each.verdict} than {each.second}"
        for each in expected
        if each.success.high < -ROUNDING
    ]
    clear = sum(each.success.low > ROUNDING for each in expected)
    text = (
        f"{clear} of {_count(len(expected), 'pair', 'pairs')} "
        f"{'is' if clear == 1 else 'are'} in this order"
    )
    return f"{text}; {', '.join(against)}." if against else f"{text}."


def _method(board: Leaderboard) -> str:
    """Versions, seeds, calibration, and where to find the other figures."""
    first = board.evaluations[0]
    episodes = len(first.episodes)
    text = (
        f"DroneSwarmSearch {DroneSwarmSearch.__version__} and NumPy {np.__version__}; "
        f"{episodes:,} episodes of each search, with the seeds {first.seed:,} to "
        f"{first.seed + episodes - 1:,} for all policies. "
    )
    held, total = board.calibration
    if total:
        text += (
            f"Of the 95% intervals of the sampled success rates, {held} of {total} contain the "
            "exact success; about 95% are expected to. "
        )
    return (
        f"{text}[leaderboard.csv](leaderboard.csv) has the figures of each policy on each search, "
        "with times, returns, intervals and endings. `evaluate --list` describes the searches, "
        "and `leaderboard --add=module:callable` adds your own policy."
    )


def _paragraph(text: str) -> list[str]:
    return [*textwrap.wrap(text, LINE, break_on_hyphens=False), ""]


def _item(text: str) -> list[str]:
    """A bullet point."""
    first, *others = textwrap.wrap(text, LINE - 2, break_on_hyphens=False)
    return [f"- {first}", *(f"  {line}" for line in others)]


def _plot(name: str, plots: Collection[str]) -> list[str]:
    return [f"![{PLOTS[name]}]({name}-light.svg)", ""] if name in plots else []


def _count(count: int, one: str, several: str) -> str:
    return f"{count:,} {one if count == 1 else several}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def _short(share: Estimate, sign: str = "") -> str:
    """A share in percent; an estimate without the digits that its interval does not support."""
    value, low, high = share.scaled(100.0)
    if share.is_exact:
        return f"{value:{sign}.1f}"
    return f"~{value:{sign}.{int(high - low < WIDE)}f}"


def _is_narrow(share: Estimate) -> bool:
    """Whether a reader needs no interval: it is narrow, and its ends have the same sign."""
    return share.is_exact or (100 * (share.high - share.low) < WIDE and share.low * share.high > 0)
