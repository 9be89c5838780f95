"""The commands evaluate, leaderboard, bound, record and export; `cli` parses their arguments."""

from __future__ import annotations

import argparse
import contextlib
import inspect
import json
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from DroneSwarmSearch import policies
from DroneSwarmSearch._internal.console import printed_warnings
from DroneSwarmSearch._internal.files import StorageError
from DroneSwarmSearch.drift.persons import warn_of_mass_beyond
from DroneSwarmSearch.evaluation import board, exporting, recording, search_file
from DroneSwarmSearch.evaluation.bounds import bounds_of
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import (
    Evaluation,
    bound_data,
    csv_text,
    save_csv,
    save_episodes,
    save_json,
)
from DroneSwarmSearch.evaluation.run import (
    Case,
    Sampling,
    evaluate_cases,
    manifest,
    run_folder,
    searches_manifest,
)
from DroneSwarmSearch.evaluation.run_folder import file_name
from DroneSwarmSearch.evaluation.suite import SUITE, SUITE_VERSION, NamedSearch, search
from DroneSwarmSearch.evaluation.tables import figure, percent, print_table
from DroneSwarmSearch.evaluation.view import View
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.rendering.labels import outcome_in_brief
from DroneSwarmSearch.rules import Ending

__all__ = ["bound", "evaluate", "export", "leaderboard", "record"]

FAILED, INTERRUPTED = 1, 130
"""Exit codes; 130 is the shells' code for Ctrl-C."""


def evaluate(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Evaluate a policy on searches, print the results, and write them with --out."""
    if options.list:
        return _guarded(_print_suite)
    if options.policy is None or not options.searches:
        parser.error("POLICY and SEARCH are needed; `evaluate --list` lists them")
    with _refusing(parser):
        spec, view = PolicySpec.of(options.policy), _view(options)
        searches = _searches(options.searches, options.mission)
        cases = [Case.of(spec, each, view, options.deterministic) for each in searches]
        sampling = Sampling(options.episodes, options.seed)
        folder = run_folder(options.out, manifest(cases, sampling))
    _warn_of_small_grids(searches)

    def run() -> None:
        what = f"{spec.name} on {len(cases)} search{'es' * (len(cases) > 1)}"
        running = {"workers": options.workers, "ray": options.ray}
        bounds = bounds_of(searches, folder, **running) if options.bound else {}
        evaluations = [
            each.with_bound(bounds.get(each.search.name))
            for each in evaluate_cases(cases, sampling, folder, what, **running)
        ]
        _print_evaluations(evaluations, options)
        if options.out is not None:
            _write_evaluations(evaluations, options.out)

    return _guarded(run, options.out)


def leaderboard(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Run the leaderboard, print its tables, and write its files."""
    with _refusing(parser):
        searches = _searches(["all"] if options.searches is None else options.searches)
        prepared = board.prepared(
            options.policies,
            searches,
            added=options.add,
            view=_view(options),
            deterministic=options.deterministic,
            sampling=Sampling(options.episodes, options.seed),
            out=options.out,
            bounds=options.bound,
        )
    _warn_of_small_grids(searches)

    def run() -> None:
        found = prepared(workers=options.workers, ray=options.ray, progress=True)
        for title, (headers, *rows) in (
            ("Success in %; the best policy of each search has a star", found.search_table),
            ("All searches; with 95% intervals, or exact", found.summary_table),
        ):
            print(f"\n{title}\n")
            print_table(headers, rows, words=1)
        files = found.write(options.out)
        print(f"\nwritten to {options.out}: {', '.join(path.name for path in files)}")

    return _guarded(run, options.out)


def bound(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Compute bounds and print them."""
    with _refusing(parser):
        searches = _searches(options.searches, options.mission)
        folder = run_folder(options.out, searches_manifest(searches))
    _warn_of_small_grids(searches)

    def run() -> None:
        bounds = bounds_of(searches, folder, workers=options.workers, ray=options.ray)
        _print_bounds([(each, bounds[each.name]) for each in searches], options.json)

    return _guarded(run, options.out)


def _view(options: argparse.Namespace) -> View:
    return View(
        options.view,
        options.observation,
        options.action_mask,
        options.right_of_way,
        True if options.posterior else None,
    )


def record(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Record a video of one episode."""

    def write(search: NamedSearch) -> str:
        video = recording.record(
            options.policy,
            search,
            options.out,
            seed=options.seed,
            bayesian_update=True if options.posterior else None,
            fps=options.fps,
        )
        return f"{options.policy} searching {search.name}, {outcome_in_brief(video.last)}"

    return _write(parser, options, write)


def export(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Write episodes as JSON."""

    def write(search: NamedSearch) -> str:
        data = exporting.export(
            options.policies,
            search,
            options.out,
            seeds=options.seeds,
            bayesian_update=True if options.posterior else None,
        )
        episodes = data["episodes"]
        return f"{len(episodes)} episode{'s' * (len(episodes) > 1)} of {search.name}"

    return _write(parser, options, write)


def _write(
    parser: argparse.ArgumentParser,
    options: argparse.Namespace,
    write: Callable[[NamedSearch], str],
) -> int:
    """Write a file about one search; `write` returns a description of it, which is printed."""
    with _refusing(parser):
        search = _search(options.search)
    _warn_of_small_grids([search])
    try:
        content = write(search)
    except KeyboardInterrupt:
        print("\ninterrupted: no file was written", file=sys.stderr)
        return INTERRUPTED
    except (ImportError, OSError, TypeError, ValueError) as error:
        _report(parser, options.out, error)
    return _guarded(lambda: print(f"{options.out}: {content}"), None)


def _report(parser: argparse.ArgumentParser, path: str, error: Exception) -> NoReturn:
    """Report an error of the arguments or the file; raise one of the policy again."""
    for each in (error.__cause__ or error, error):  # the policy's OSError causes a StorageError
        frames = traceback.walk_tb(each.__traceback__)
        if any(frame.f_code is recording.play.__code__ for frame, _ in frames):
            raise each
    if isinstance(error, OSError):
        parser.exit(FAILED, f"cannot write {path}: {error.strerror or error}\n")
    parser.error(re.sub("^path must ", "argument --out: must ", str(error)))


def _search(name: str) -> NamedSearch:
    """A search of the suite or of a file."""
    if name.endswith(search_file.SUFFIX):
        return search_file.search_from_file(Path(name))
    return search(name)


def _searches(names: Sequence[str], mission: str | None = None) -> list[NamedSearch]:
    """The searches of the suite or of files, with another mission if one is given.

    Raises:
        ValueError: a name is unknown, a file does not hold a search, or two have the same name.
    """
    every = [name for each in names for name in (SUITE if each == "all" else [each])]
    found = [_search(name) for name in dict.fromkeys(every)]
    if len({each.name for each in found}) < len(found):
        all_names = ", ".join(each.name for each in found)
        raise ValueError(f"searches must have different names, got {all_names}")
    if mission is not None:
        found = [replace(each, scenario=each.scenario.replace(mission=mission)) for each in found]
    return found


def _warn_of_small_grids(searches: Sequence[NamedSearch]) -> None:
    """Print a warning for every search at sea whose persons may drift beyond the grid.

    Elsewhere the border is a part of the search: persons given by a cell and a vector stop there.
    """
    for each in searches:
        scenario = each.scenario
        if scenario.persons is not None:
            with printed_warnings(f"{each.name}: "):
                warn_of_mass_beyond(
                    scenario.persons, scenario.grid_size, scenario.timestep_limit, stacklevel=1
                )


# What the commands print and write.


def _print_suite() -> None:
    """List the policies and the searches."""
    print("policies:\n")
    for name, make in policies.POLICIES.items():
        summary = (inspect.getdoc(make) or "").split("\n")[0]
        print(f"  {name:<17} {summary}".rstrip())
    print(f"\nsearches of suite {SUITE_VERSION}:\n")
    width = max(map(len, SUITE))
    for name, each in SUITE.items():
        print(f"  {name:<{width}} {each.outline}\n  {'':<{width}} {each.reason}")


def _print_evaluations(evaluations: Sequence[Evaluation], options: argparse.Namespace) -> None:
    """Print evaluations as a table, as JSON or as CSV, as the options select."""
    if options.json:
        print(json.dumps([each.data for each in evaluations], indent=1, allow_nan=False))
        return
    if options.csv:
        print(csv_text(evaluations), end="")
        return
    rescues = [each for each in evaluations if each.coverage is None]
    coverages = [each for each in evaluations if each.coverage is not None]
    for several in filter(None, (rescues, coverages)):
        print_table(*_table(several, options.bound))
        print()
    shown = "posterior" if options.posterior else "prior"
    print(
        f"{options.episodes} episodes of each search, seeds from {options.seed}, suite "
        f"{SUITE_VERSION}, {shown} shown. Figures without an interval are exact,\n"
        "except returns, which are means; the others have 95% intervals. See `evaluate --help`."
    )


def _table(evaluations: Sequence[Evaluation], bound: bool) -> tuple[list[str], list[list[str]]]:
    """The headers and rows of evaluations of one mission, with or without the bound."""
    is_rescue = evaluations[0].coverage is None
    headers = ["policy", "search", "success, %" if is_rescue else "POS, %", "time, steps"]
    headers += ["return"] if is_rescue else ["coverage, %", "repetition, %"]
    headers += ["crashes", *["bound, %", "share of it, %"] * bound]
    rows = []
    for each in evaluations:
        crashes = each.endings[Ending.COLLISION] + each.endings[Ending.LEFT_GRID]
        row = [each.policy, each.search.name, percent(each.success), figure(each.time)]
        if is_rescue:
            row.append(f"{each.mean_return.value:,.0f}")
        else:
            row += [percent(each.coverage_rate), percent(each.repetition_rate)]
        row.append(str(crashes))
        if bound:
            limit = "-" if each.bound is None else f"{100 * each.bound.by_limit:.1f}"
            row += [limit, percent(each.share_of_bound)]
        rows.append(row)
    return headers, rows


def _write_evaluations(evaluations: Sequence[Evaluation], folder: Path) -> None:
    """Write the files of evaluations of one policy."""
    for each in evaluations:
        coverage = ".coverage" * (each.coverage is not None)
        posterior = ".posterior" * each.search.scenario.bayesian_update
        name = f"{file_name(each.policy)}.{file_name(each.search.name)}{coverage}{posterior}"
        save_json(folder / f"{name}.json", each)
        save_episodes(folder / f"{name}.episodes.csv", each)
    save_csv(folder / f"{file_name(evaluations[0].policy)}.summary.csv", evaluations)
    print(f"written to {folder}", file=sys.stderr)


def _print_bounds(bounds: Sequence[tuple[NamedSearch, SuccessBound]], as_json: bool) -> None:
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


# Errors.


@contextlib.contextmanager
def _refusing(parser: argparse.ArgumentParser) -> Iterator[None]:
    """Report wrong arguments and exit with code 2, or a folder that cannot be used with code 1."""
    try:
        yield
    except StorageError as error:
        parser.exit(FAILED, f"{error.filename}: {error.strerror}\n")
    except (TypeError, ValueError) as error:
        parser.error(str(error))


def _guarded(command: Callable[[], None], out: Path | None = None) -> int:
    """Run a command, report what stopped it, and return the exit code.

    Args:
        command: the work, after its arguments have been checked.
        out: where finished results are kept, if anywhere.
    """
    reason, code = "interrupted", FAILED
    try:
        command()
        return 0
    except KeyboardInterrupt:
        code = INTERRUPTED
    except StorageError as error:
        reason = f"{error.filename}: {error.strerror}"
    except BrokenPipeError:
        return FAILED  # the reader of stdout has gone
    except ImportError as error:
        reason = str(error)
    except Exception as error:
        reason = _described(error)
    if out is not None:
        reason += f"; finished results are kept in {out}, and the same command resumes"
    print(reason, file=sys.stderr)
    return code


def _described(error: Exception) -> str:
    """An error in one line if `evaluation` raised it, otherwise with its traceback."""
    innermost = Path(traceback.extract_tb(error.__traceback__)[-1].filename)
    is_ours = innermost.is_relative_to(Path(__file__).parent) and error.__cause__ is None
    if is_ours and isinstance(error, (OSError, TypeError, ValueError)):
        return f"{type(error).__name__}: {error}"
    return "".join(traceback.format_exception(error)).rstrip()
