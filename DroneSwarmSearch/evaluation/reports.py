"""Print and write the results of the commands."""

from __future__ import annotations

import inspect
import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from DroneSwarmSearch import policies
from DroneSwarmSearch.evaluation import page
from DroneSwarmSearch.evaluation.board import Leaderboard
from DroneSwarmSearch.evaluation.results import (
    Evaluation,
    bound_data,
    csv_text,
    save_csv,
    save_episodes,
    save_json,
)
from DroneSwarmSearch.evaluation.suite import SUITE, SUITE_VERSION, NamedSearch
from DroneSwarmSearch.evaluation.tables import figure, percent, print_table
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.rules import Ending

__all__ = [
    "print_bounds",
    "print_evaluations",
    "print_leaderboard",
    "print_suite",
    "write_evaluations",
]


def print_suite() -> None:
    """List the policies and the searches."""
    print("policies:\n")
    for name, make in policies.POLICIES.items():
        summary = (inspect.getdoc(make) or "").split("\n")[0]
        print(f"  {name:<17} {summary}".rstrip())
    print(f"\nsearches of suite {SUITE_VERSION}:\n")
    for name, each in SUITE.items():
        print(f"  {name:<11} {each.outline}\n              {each.reason}")


def print_evaluations(evaluations: Sequence[Evaluation], options: Namespace) -> None:
    """Print evaluations as a table, as JSON or as CSV, as the options say."""
    if options.json:
        print(json.dumps([each.data for each in evaluations], indent=1, allow_nan=False))
        return
    if options.csv:
        print(csv_text(evaluations), end="")
        return
    headers = ["policy", "search", "success, %", "time, steps", "return", "crashes"]
    rows = []
    for each in evaluations:
        crashes = each.endings[Ending.COLLISION] + each.endings[Ending.LEFT_GRID]
        rows.append(
            [
                *(each.policy, each.search.name, percent(each.success), figure(each.time)),
                *(f"{each.mean_return.value:,.0f}", str(crashes)),
            ]
        )
        if options.bound:
            bound = "-" if each.bound is None else f"{100 * each.bound.by_limit:.1f}"
            rows[-1] += [bound, percent(each.share_of_bound)]
    if options.bound:
        headers += ["bound, %", "share of it, %"]
    print_table(headers, rows)
    shown = "posterior" if options.posterior else "prior"
    print(
        f"\n{options.episodes} episodes of each search, seeds from {options.seed}, suite "
        f"{SUITE_VERSION}, {shown} shown; 95% intervals in\nparentheses. Success: every person "
        "found within the time limit. Time: until the last person is found,\nor the time limit. "
        "Crashes: episodes in which drones collided or left the grid."
    )


def write_evaluations(evaluations: Sequence[Evaluation], folder: Path) -> None:
    """Write the files of evaluations of one policy."""
    for each in evaluations:
        posterior = ".posterior" * each.search.scenario.bayesian_update
        name = f"{_file_name(each.policy)}.{each.search.name}{posterior}"
        save_json(folder / f"{name}.json", each)
        save_episodes(folder / f"{name}.episodes.csv", each)
    save_csv(folder / f"{_file_name(evaluations[0].policy)}.summary.csv", evaluations)
    print(f"written to {folder}", file=sys.stderr)


def _file_name(text: str) -> str:
    return "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in text).strip(".-")


def print_bounds(bounds: Sequence[tuple[NamedSearch, SuccessBound]], as_json: bool) -> None:
    """Print bounds as a table or as JSON."""
    if as_json:
        data = [{"search": each.name, **bound_data(bound)} for each, bound in bounds]
        print(json.dumps(data, indent=1, allow_nan=False))
        return
    parts = (0.25, 0.5, 0.75, 1.0)
    headers = ["search", "steps", *(f"by {part:.0%}, %" for part in parts)]
    headers += ["duality gap, %", "confidence"]
    rows = []
    for each, bound in bounds:
        limit = each.scenario.timestep_limit
        by_time = [f"{100 * bound.by_time[round(part * limit)]:.2f}" for part in parts]
        confidence = "exact" if bound.confidence == 1.0 else f"{bound.confidence:.6g}"
        rows.append([each.name, str(limit), *by_time, f"{100 * bound.gap:.2f}", confidence])
    print_table(headers, rows, words=1)


def print_leaderboard(board: Leaderboard) -> None:
    """Print the two main tables of a leaderboard."""
    for title, (headers, *rows) in (
        ("Success in %; the best policy of each search has a star", page.overview(board, "{}*")),
        ("All searches, with 95% intervals", page.suite_table(board)),
    ):
        print(f"\n{title}\n")
        print_table(headers, rows, words=1)
