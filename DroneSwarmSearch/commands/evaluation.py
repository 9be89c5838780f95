"""The commands that evaluate, record and export, and how errors of commands are reported."""

from __future__ import annotations

import argparse
import inspect
import sys
import textwrap
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from DroneSwarmSearch import policies
from DroneSwarmSearch._internal.text import plural
from DroneSwarmSearch.commands.options import as_typed
from DroneSwarmSearch.commands.searches import check_drone, named_search
from DroneSwarmSearch.core.named_search import NamedSearch
from DroneSwarmSearch.core.rules import Ending
from DroneSwarmSearch.evaluation import board, exporting, recording
from DroneSwarmSearch.evaluation.parallel import Workers
from DroneSwarmSearch.evaluation.results import Evaluation, csv_text, save_csv
from DroneSwarmSearch.evaluation.run import bounds_of, check_names
from DroneSwarmSearch.evaluation.run_folder import RunFolder, file_name
from DroneSwarmSearch.evaluation.suite import SUITE, SUITE_VERSION
from DroneSwarmSearch.evaluation.text_tables import figure, percent, print_table
from DroneSwarmSearch.layouts import LAYOUTS
from DroneSwarmSearch.layouts.view import FORMS, View
from DroneSwarmSearch.rendering.text import WIDTH

# exit codes; 130 is the shells' code for Ctrl-C
FAILED = 1
INTERRUPTED = 130
PACKAGE = Path(__file__).parents[1]


def run(options: argparse.Namespace) -> int:
    """Run a command and return its exit code; errors that this package raises take one line."""
    code = FAILED
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = lambda text, *_, **__: print(f"warning: {text}", file=sys.stderr)
            options.function(options)
        return 0
    except KeyboardInterrupt:
        reason = "interrupted"
        code = INTERRUPTED
    except BrokenPipeError:
        return FAILED  # the reader of stdout has gone
    except ImportError as error:
        reason = as_typed(str(error), options)
    except OSError as error:
        reason = f"{error.filename or 'cannot write the output'}: {error.strerror}"
    except (TypeError, ValueError) as error:
        *_, (innermost, _) = traceback.walk_tb(error.__traceback__)
        if not Path(innermost.f_code.co_filename).is_relative_to(PACKAGE):
            raise
        options.parser.error(as_typed(str(error), options))
    if "workers" in options and options.out is not None and options.out.exists():
        reason += f"; finished results are kept in {options.out}, and the same command resumes"
    print(reason, file=sys.stderr)
    return code


def evaluate(options: argparse.Namespace) -> None:
    """Evaluate a policy, and print a table."""
    if options.list:
        if options.policy is not None:
            raise ValueError("--list cannot be given together with a policy or searches")
        _print_suite()
        return
    if options.policy is None or not options.searches:
        raise ValueError("POLICY and SEARCH are needed; `evaluate --list` lists them")
    found = _board(options, [options.policy])
    if options.csv:
        print(csv_text(found.evaluations), end="")
    else:
        _print_evaluations(found.evaluations, options)
    if options.out is not None:
        path = options.out / f"{file_name(found.evaluations[0].policy)}.csv"
        save_csv(path, found.evaluations)
        print(f"written to {path}", file=sys.stderr)


def leaderboard(options: argparse.Namespace) -> None:
    """Compare policies: tables, plots, a CSV file."""
    found = _board(options, options.add)
    for title, (headers, *rows) in (
        ("Success in %; the best policy of each search has a star", found.search_table),
        ("All searches; with 95% intervals, or exact", found.summary_table),
    ):
        print(f"\n{title}\n")
        print_table(headers, rows, words=1)
    files = found.write(options.out)
    print(f"\nwritten to {options.out}:")
    print(textwrap.fill(", ".join(path.name for path in files), WIDTH, break_on_hyphens=False))


def bound(options: argparse.Namespace) -> None:
    """Print upper bounds on success."""
    searches = _searches(options)
    bounds = bounds_of(searches, RunFolder(options.out), Workers(options.workers, options.ray))
    parts = (0.25, 0.5, 0.75, 1.0)
    rows = []
    for search in searches:
        limit = search.scenario.timestep_limit
        bound = bounds[search.name]
        by_time = [f"{100 * bound.by_time[round(part * limit)]:.2f}" for part in parts]
        confidence = "exact" if bound.confidence == 1.0 else f"{bound.confidence:.6g}"
        rows.append([search.name, str(limit), *by_time, f"{100 * bound.gap:.2f}", confidence])
    headers = ["search", "steps", *(f"by {part:.0%}, %" for part in parts)]
    print_table([*headers, "duality gap, %", "confidence"], rows, words=1)


def record(options: argparse.Namespace) -> None:
    """Record a video."""
    search = named_search(options.search)
    check_drone(options.drone, search)
    video = recording.record(
        options.policy,
        search,
        options.out,
        seed=options.seed,
        view=view_from(options),
        fps=options.fps,
        palette=options.palette,
        drone=options.drone,
    )
    print(f"{options.out}: {options.policy} searching {search.name}\n{video.last.outcome}")


def export(options: argparse.Namespace) -> None:
    """Write episodes as JSON."""
    search = named_search(options.search)
    data = exporting.export(
        options.policies, search, options.out, seeds=options.seeds, view=view_from(options)
    )
    count = plural(len(data["episodes"]), "episode")
    print(f"{options.out}: {count} of {search.name}")


def add_view(parser: argparse.ArgumentParser) -> None:
    """The options of a `View`."""
    add = parser.add_argument_group("what policies see, if they do not state it").add_argument
    posterior = "the posterior, not the prior"
    add("--posterior", action="store_true", default=None, help=posterior)
    add("--view", choices=FORMS, help="the form of observations and actions (default: swarm)")
    add("--observation", choices=LAYOUTS, default="dict", help="the layout (default: dict)")
    add("--action-mask", action="store_true", help="also show it masks of valid actions")
    add("--right-of-way", action="store_true", help="these masks prevent all collisions")


def view_from(options: argparse.Namespace) -> View:
    """The `View` of these options."""
    return View(
        form=options.view,
        observation=options.observation,
        action_mask=options.action_mask,
        right_of_way=options.right_of_way,
        bayesian_update=options.posterior,
    )


def _board(options: argparse.Namespace, added: Sequence[object]) -> board.Leaderboard:
    """Evaluate packaged policies and added ones; the options of the view apply to the latter."""
    return board.leaderboard(
        options.policies,
        _searches(options),
        added=added,
        submissions=options.submissions,
        view=view_from(options),
        deterministic=options.deterministic,
        episodes=options.episodes,
        seed=options.seed,
        workers=options.workers,
        ray=options.ray,
        out=options.out,
        bounds=options.bound,
    )


def _searches(options: argparse.Namespace) -> list[NamedSearch]:
    """The searches of the suite or of files, with another mission if one is given."""
    every = [name for text in options.searches for name in (SUITE if text == "all" else [text])]
    found = [named_search(name) for name in dict.fromkeys(every)]
    check_names("searches", found)
    mission = getattr(options, "mission", None)
    if mission is not None:
        found = [
            replace(search, scenario=search.scenario.replace(mission=mission)) for search in found
        ]
    return found


def _print_suite() -> None:
    print("policies:\n")
    for name, make in policies.POLICIES.items():
        summary = (inspect.getdoc(make) or "").split("\n")[0]
        print(textwrap.fill(f"  {name:<17} {summary}", WIDTH, subsequent_indent=" " * 20))
    print(f"\nsearches of suite {SUITE_VERSION}:\n")
    width = max(map(len, SUITE))
    indent = " " * (width + 3)
    for name, search in SUITE.items():
        outline = f"  {name:<{width}} {search.outline}"
        print(textwrap.fill(outline, WIDTH, subsequent_indent=indent))
        print(textwrap.fill(search.reason, WIDTH, initial_indent=indent, subsequent_indent=indent))


def _print_evaluations(evaluations: Sequence[Evaluation], options: argparse.Namespace) -> None:
    for is_coverage in (False, True):
        mine = [result for result in evaluations if result.is_coverage == is_coverage]
        alive = any(result.success_alive for result in mine)
        rows = [_columns(result, options.bound, alive) for result in mine]
        if rows:
            print_table([*rows[0]], [[*row.values()] for row in rows])
            print()
    updates = {result.search.scenario.bayesian_update for result in evaluations}
    shown = " or ".join(("prior", "posterior")[update] for update in sorted(updates))
    print(
        f"{options.episodes} episodes of each search, seeds from {options.seed}, suite "
        f"{SUITE_VERSION}, {shown} shown.\nFigures without an interval are exact, except returns, "
        "which are means; the\nothers have 95% intervals. See `evaluate --help`."
    )


def _columns(result: Evaluation, bound: bool, alive: bool) -> dict[str, str]:
    columns = {"policy": result.policy, "search": result.search.name}
    columns["POS, %" if result.is_coverage else "success, %"] = percent(result.success)
    if alive:
        columns["alive, %"] = percent(result.success_alive)
    columns["time, steps"] = figure(result.time)
    if result.is_coverage:
        columns["coverage, %"] = percent(result.coverage_rate)
        columns["repetition, %"] = percent(result.repetition_rate)
    else:
        columns["return"] = f"{result.mean_return:,.0f}"
    columns["crashes"] = str(result.endings[Ending.COLLISION] + result.endings[Ending.LEFT_GRID])
    if bound:
        columns["bound, %"] = "-" if result.bound is None else f"{100 * result.bound.by_limit:.1f}"
        columns["share of it, %"] = percent(result.share_of_bound)
    return columns
