"""The leaderboard as a page: Markdown that reads well as it is, on GitHub and in the docs."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

import DroneSwarmSearch
from DroneSwarmSearch.evaluation.statistics import Estimate
from DroneSwarmSearch.evaluation.suite import SUITE_VERSION, NamedSearch

if TYPE_CHECKING:
    from DroneSwarmSearch.evaluation.leaderboard import Leaderboard

__all__ = ["FIGURES", "Table", "markdown", "overview", "suite_table"]

Table = list[list[str]]
"""Rows of cells; the first row is the heading."""


FIGURES = {
    "success": "For every search a row with the share of episodes in which each policy found "
    "everybody by the limit, with intervals, and the bound as a black bar.",
    "curves": "For every search a panel with the share of episodes in which everybody was found, "
    "step by step, a curve for each policy, and the bound as a dashed line above them.",
    "one-search": "The curves of one search, each named at its end.",
    "episode": "Two maps of one episode, the prior and the posterior, with the drones' tracks.",
    "reliability": "What the matrix promised against what searches found, for the prior and "
    "the posterior: the posterior's points lie on the diagonal.",
}
"""The pictures, by file name without suffix, and what they show those who cannot see them."""


def markdown(board: Leaderboard, command: str, figures: Collection[str] = ()) -> str:
    """The leaderboard as a page.

    Args:
        board: the figures.
        command: what made it.
        figures: names of the pictures' files without suffix, of `FIGURES`, that lie beside
            the page.
    """
    first = board.evaluations[0]
    count, episodes = len(board.searches), len(first.episodes)
    lines = [
        "# Leaderboard",
        "",
        *_paragraph(
            f"{_number(len(board.policies), 'policy', 'policies')} on "
            f"{_number(count, 'search', 'searches')} of suite {SUITE_VERSION}, "
            f"{episodes:,} episodes each with the seeds {first.seed:,} to "
            f"{first.seed + episodes - 1:,}: every policy meets the same seas. Made with "
            f"DroneSwarmSearch {DroneSwarmSearch.__version__} and NumPy {np.__version__} by"
        ),
        "",
        "```sh",
        command,
        "```",
        "",
        "## Found by the limit",
        "",
        *_paragraph(
            "The share of episodes, in percent, in which everybody was found by the limit; the "
            "best of each search in bold."
        ),
        "",
        *_table_lines(overview(board)),
        "",
        *_picture("success", figures),
        "## All searches together",
        "",
        *_paragraph(
            "Means over the searches, each counting alike, with 95 % bootstrap intervals. Time "
            "is the restricted mean time to find, as a share of the search's limit: less is "
            "better."
        ),
        "",
        *_table_lines(suite_table(board)),
        "",
        *_order(board),
        *_bounds(board),
        "## Success over time",
        "",
        *_picture("curves", figures),
        *_picture("one-search", figures),
        "## Search by search",
        "",
        *(line for search in board.searches for line in _section(board, search)),
        *_pictures_of_one(board, figures),
        *_how_to_read(board),
    ]
    return "\n".join(lines).rstrip() + "\n"


def overview(board: Leaderboard, best: str = "**{}**") -> Table:
    """A row for each search, a column for each policy: success in percent.

    Args:
        board: the figures.
        best: how the best of each search are written.
    """
    bounded = board.bound_of(board.searches[0].name) is not None
    rows = [["search", *board.policies, *(["bound"] if bounded else [])]]
    for search in board.searches:
        told = [_points(board.cells[name, search.name].success.value) for name in board.policies]
        most = max(told, key=float)
        row = [search.name, *(best.format(each) if each == most else each for each in told)]
        bound = board.bound_of(search.name)
        rows.append(row + ([_points(float(bound.by_time[-1]))] if bound is not None else []))
    return rows


def suite_table(board: Leaderboard) -> Table:
    """A row for each policy: its figures on all searches together, in percent."""
    bounded = all(each.share_of_bound is not None for each in board.summaries)
    rows = [["policy", "found, %", "time, % of limit", *(["share of bound, %"] if bounded else [])]]
    for each in board.summaries:
        row = [each.policy, _interval(each.success, 100), _interval(each.time, 100)]
        if each.share_of_bound is not None and bounded:
            row.append(_interval(each.share_of_bound, 100))
        rows.append(row)
    return rows


def _order(board: Leaderboard) -> list[str]:
    """Whether the policies stand in the order that theory predicts."""
    if not board.comparisons:
        return []
    rows = [["policy", "against", "found, points", "time, points", "the first"]]
    for rung in board.comparisons:
        row = [rung.ahead, rung.behind]
        row += [_interval(rung.success, 100, signed=True), _interval(rung.time, 100, signed=True)]
        rows.append([*row, rung.verdict])
    return [
        "## In the order of search theory",
        "",
        *_paragraph(
            "Search theory predicts: planner before greedy-posterior, this before greedy-matrix "
            "and the patterns, and all of them before random. Of trained networks it says "
            "nothing, but whoever knows the posterior should be ahead of those who do not. "
            "Differences on the same seas, first less second, in percentage points, with paired "
            "95 % bootstrap intervals; below 0 in time, the first is faster."
        ),
        "",
        *_table_lines(rows),
        "",
    ]


def _bounds(board: Leaderboard) -> list[str]:
    """What the bounds are, and whether they hold."""
    found = {search.name: board.bound_of(search.name) for search in board.searches}
    rows = [["search", "bound, %", "duality gap, points", "confidence, %"]]
    for name, bound in found.items():
        if bound is not None:
            sure = "exact" if bound.confidence >= 1.0 else f"{100 * bound.confidence:.4g}"
            rows.append([name, _points(float(bound.by_time[-1])), f"{100 * bound.gap:.2f}", sure])
    if len(rows) == 1:
        return []
    beyond = [f"{each.policy} on {each.search.name}" for each in board.beyond]
    holds = "No policy exceeds the bound of any search beyond its interval."
    if beyond:
        holds = f"Beyond the bound by more than their interval: {', '.join(beyond)}."
    return [
        "## The bounds",
        "",
        *_paragraph(
            "No policy whatever, learned or not, can find everybody more often than this. The "
            f"bound contains the duality gap of its relaxation and the sampling error. {holds}"
        ),
        "",
        *_table_lines(rows),
        "",
    ]


def _section(board: Leaderboard, search: NamedSearch) -> Iterator[str]:
    """One search: why it is there, and everybody's figures."""
    scenario = search.scenario
    size = scenario.grid_size
    chances = ", ".join(f"{chance:g}" for chance in dict.fromkeys(scenario.detections))
    yield from (f"### {search.name}", "")
    yield from _paragraph(search.reason)
    facts = [
        f"{size} × {size} cells",  # noqa: RUF001
        _number(scenario.n_drones, "drone", "drones"),
        _number(len(scenario.person_initial_position), "person", "persons"),
        f"drift ({scenario.vector[0]:g}, {scenario.vector[1]:g})",
        f"disperse constant {scenario.disperse_constant:g}",
        f"probability of detection {chances}",
        f"limit {scenario.timestep_limit:,} steps",
    ]
    yield from ("", *_paragraph(f"{'; '.join(facts)}."), "")
    rows = [["policy", "found, %", "time to find, steps", "share of bound, %"]]
    for policy in board.policies:
        each = board.cells[policy, search.name]
        share = each.share_of_bound
        row = [policy, _interval(each.success, 100), _interval(each.time, 1)]
        rows.append([*row, "" if share is None else _interval(share, 100)])
    if not any(row[-1] for row in rows[1:]):
        rows = [row[:-1] for row in rows]
    yield from (*_table_lines(rows), "")


def _pictures_of_one(board: Leaderboard, figures: Collection[str]) -> list[str]:
    """One episode, and the calibration of the matrix, if they were drawn."""
    lines: list[str] = []
    if "episode" in figures:
        lines += ["## One episode", "", *_picture("episode", figures)]
    if "reliability" in figures:
        shown = board.posterior
        assert shown is not None
        lines += [
            "## What the matrix promises",
            "",
            *_paragraph(
                f"Searches of {shown.policy} on {shown.search.name}, by the chance that the matrix "
                "shown gave them. A posterior keeps its promises. A prior, which does not know "
                "of the searches made, promises too much where drones search again, and too "
                "little elsewhere."
            ),
            "",
            *_picture("reliability", figures),
        ]
    return lines


def _how_to_read(board: Leaderboard) -> list[str]:
    bound = (
        "**share of bound**: found, divided by the bound. The bound allows more than any flight "
        "can do, so that even the best policy may stay below 100 %."
    )
    lines = ["## How to read it", ""]
    for entry in (
        "**found**: the share of episodes in which everybody was found by the limit. Search by "
        "search with Wilson's score interval (1927), over all searches with a bootstrap "
        "interval (Efron, 1979), each search resampled by itself. All intervals are of 95 %.",
        "**time to find**: the mean of the step by which everybody was found, the limit standing "
        "for those not found (restricted mean survival time; Royston and Parmar, 2013). It "
        "tells policies apart that find as many, but sooner or later.",
        *([bound] if board.bound_of(board.searches[0].name) is not None else []),
        "**paired intervals**: the same episode of two policies has the same sea, so differences "
        "are taken episode by episode; they are surer than two intervals side by side suggest.",
        "Rows of one's own: `python -m DroneSwarmSearch leaderboard --add module:callable`.",
    ):
        wrapped = textwrap.wrap(entry, 96)
        lines += [f"- {wrapped[0]}", *(f"  {line}" for line in wrapped[1:])]
    return lines


def _table_lines(rows: Table) -> list[str]:
    """A table in Markdown, aligned as plain text: names to the left, figures to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = [_is_text([row[place] for row in rows[1:]]) for place in range(len(widths))]

    def line(cells: Sequence[str]) -> str:
        padded = (
            f"{cell:<{width}}" if to_left else f"{cell:>{width}}"
            for cell, width, to_left in zip(cells, widths, left, strict=True)
        )
        return f"| {' | '.join(padded)} |"

    rule = "|".join(
        f" {'-' * width} " if to_left else f" {'-' * (width - 1)}: "
        for width, to_left in zip(widths, left, strict=True)
    )
    return [line(rows[0]), f"|{rule}|", *map(line, rows[1:])]


def _is_text(column: Iterable[str]) -> bool:
    return not any(cell.lstrip("*+-\N{MINUS SIGN}")[:1].isdigit() for cell in column)


def _paragraph(text: str) -> list[str]:
    return textwrap.wrap(text, 98)


def _picture(name: str, figures: Collection[str]) -> list[str]:
    return [f"![{FIGURES[name]}]({name}.png)", ""] if name in figures else []


def _number(count: int, one: str, several: str) -> str:
    return f"{count:,} {one if count == 1 else several}"


def _points(share: float) -> str:
    return f"{100 * share:.1f}"


def _interval(figure: Estimate, factor: float, *, signed: bool = False) -> str:
    """A figure and its interval, with one decimal."""
    form = "+.1f" if signed else ".1f"
    value, low, high = (
        format(each + 0.0, form).replace("-", "\N{MINUS SIGN}") for each in figure.scaled(factor)
    )
    return f"{value} [{low}, {high}]"
