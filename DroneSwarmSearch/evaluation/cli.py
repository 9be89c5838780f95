"""The commands `evaluate` and `bound` of `python -m DroneSwarmSearch`."""

from __future__ import annotations

import argparse
import inspect
import json
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from DroneSwarmSearch import policies
from DroneSwarmSearch.evaluation import workers as work
from DroneSwarmSearch.evaluation.bounds import BoundOf
from DroneSwarmSearch.evaluation.files import StorageError, Store
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.results import (
    Evaluation,
    csv_text,
    save_csv,
    save_episodes,
    save_json,
)
from DroneSwarmSearch.evaluation.run import EvaluationTask
from DroneSwarmSearch.evaluation.suite import SUITE, SUITE_VERSION, NamedSearch, search
from DroneSwarmSearch.evaluation.tables import figure, percent, print_table
from DroneSwarmSearch.evaluation.workers import WorkerCrashed
from DroneSwarmSearch.wrappers.layouts import LAYOUTS

__all__ = ["bound_main", "evaluate_main", "guarded"]

FAILED, INTERRUPTED = 1, 130
"""Exit codes: something went wrong; Ctrl-C, as shells have it."""

PORTIONS = "portions"
"""The folder in a results' folder where finished work is kept."""

EVALUATE = """\
Let a policy play searches of the suite, and tell how well it did: the share of searches in
which everybody was found by the limit, the restricted mean time to find (the limit where
not everybody was found) and the mean return of the team, each with its 95 % interval.
Every policy meets the same seas for the same seed.
"""

EVALUATE_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch evaluate --list
  python -m DroneSwarmSearch evaluate greedy-posterior classic open-sea --bound
  python -m DroneSwarmSearch evaluate planner all --workers 2 --out results
  python -m DroneSwarmSearch evaluate my_network.py:policy classic --posterior
  python -m DroneSwarmSearch evaluate my_network.py:policy classic --view drone --observation flat

A policy of your own is a callable from observations to actions, or a class that is called
with the search's Scenario first. It sees what --view and --observation say: "swarm" and
"drone" are what SwarmVectorEnv and DroneVectorEnv show, "parallel" is PettingZoo's form.
The file or module is executed, with all that it imports: name only code that you trust.

With --out, finished work is kept in DIR/portions: after an interruption the same command
goes on where it stopped. Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.
"""

BOUND = """\
Work out what no policy can exceed on searches of the suite: a certified upper limit on the
chance that everybody is found, by the limit and by each time before.
"""

BOUND_EXAMPLES = """\
examples:
  python -m DroneSwarmSearch bound pond lagoon
  python -m DroneSwarmSearch bound all --workers 2 --json > bounds.json
"""


def evaluate_main(argv: Sequence[str]) -> int:
    """Run the command `evaluate`.

    Args:
        argv: the arguments behind the command's name.

    Returns:
        The exit code: 0, 1 if something went wrong, or 130 after Ctrl-C.

    Raises:
        SystemExit: help was asked for (code 0), or an argument cannot be met (code 2).
    """
    parser = _evaluate_parser()
    options = parser.parse_args(argv)
    if options.list:
        return guarded(_list, None)
    if options.policy is None or not options.searches:
        parser.error("POLICY and SEARCH are needed; `evaluate --list` shows those there are")
    store = options.out and Store(options.out / PORTIONS)
    try:
        spec = PolicySpec.of(options.policy)
        cells = [
            EvaluationTask(
                spec,
                each,
                episodes=options.episodes,
                seed=options.seed,
                bayesian_update=True if options.posterior else None,
                view=options.view,
                observation=options.observation,
                store=store,
            )
            for each in _searches(options.searches)
        ]
    except (TypeError, ValueError) as error:
        _refuse(parser, error)
    bounds = [BoundOf(cell.search, store) for cell in cells] if options.bound else []
    return guarded(lambda: _evaluate(cells, bounds, options), store)


def bound_main(argv: Sequence[str]) -> int:
    """Run the command `bound`; as `evaluate_main`."""
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch bound",
        description=BOUND,
        epilog=BOUND_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("searches", metavar="SEARCH", nargs="+", help="of the suite, or all")
    _add_work(parser)
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")
    options = parser.parse_args(argv)
    store = options.out and Store(options.out / PORTIONS)
    try:
        bounds = [BoundOf(each, store) for each in _searches(options.searches)]
    except (TypeError, ValueError) as error:
        _refuse(parser, error)
    return guarded(lambda: _bound(bounds, options), store)


def guarded(command: Callable[[], None], store: Store | None) -> int:
    """Run a command and tell what stopped it, if anything did.

    Args:
        command: does the work, once its arguments are checked.
        store: where finished work is kept, if anywhere.

    Returns:
        The exit code.
    """
    try:
        command()
    except KeyboardInterrupt:
        return _stopped("interrupted", store, INTERRUPTED)
    except StorageError as error:
        why = f"{error.filename}: {error.strerror}: the same command goes on from there"
        return _stopped(why, None)
    except (WorkerCrashed, ImportError) as error:
        return _stopped(str(error), store)
    except BrokenPipeError:
        # Whoever read the output has gone; what Python still holds of it must not fail too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as error:
        return _stopped(_account(error), store)
    return 0


def _account(error: Exception) -> str:
    """What is told of an error: where it came from, too, if that is not for sure here."""
    innermost = traceback.extract_tb(error.__traceback__)[-1].filename
    ours = Path(innermost).is_relative_to(Path(__file__).parent)
    if ours and error.__cause__ is None and isinstance(error, (OSError, TypeError, ValueError)):
        return f"{type(error).__name__}: {error}"
    return "".join(traceback.format_exception(error)).rstrip()


def _stopped(why: str, store: Store | None, code: int = FAILED) -> int:
    kept = ""
    if store is not None and len(store):
        kept = f"; what was finished is kept in {store.directory}: the same command goes on there"
    print(f"{why}{kept}", file=sys.stderr)
    return code


def _refuse(parser: argparse.ArgumentParser, error: Exception) -> NoReturn:
    parser.error(str(error))


# Arguments.


def _evaluate_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch evaluate",
        description=EVALUATE,
        epilog=EVALUATE_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "policy",
        metavar="POLICY",
        nargs="?",
        help="of the registry, or your own: weights.npz of examples/train_ppo.py,"
        " module:attribute or file.py:attribute, whose code is executed; all of these also"
        " after name=",
    )
    parser.add_argument(
        "searches", metavar="SEARCH", nargs="*", help="of the suite; all stands for all of them"
    )
    parser.add_argument(
        "--list", action="store_true", help="show the policies and the searches there are"
    )
    parser.add_argument(
        "--episodes", metavar="N", type=int, default=2000, help="of each search (2000)"
    )
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="of the first episode (0)")
    parser.add_argument(
        "--posterior",
        action="store_true",
        help="show the drones the posterior given their searches, not the drift alone",
    )
    parser.add_argument(
        "--view", default="swarm", help="what a policy is shown: swarm, drone or parallel (swarm)"
    )
    parser.add_argument(
        "--observation",
        default="dict",
        help=f"in which layout: {', '.join(LAYOUTS)} (dict)",
    )
    parser.add_argument(
        "--bound", action="store_true", help="also tell the upper bound, and the share reached"
    )
    _add_work(parser)
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print all figures as JSON")
    output.add_argument("--csv", action="store_true", help="print the main figures as CSV")
    return parser


def _add_work(parser: argparse.ArgumentParser) -> None:
    """The options of whatever takes long."""
    parser.add_argument("--workers", metavar="N", type=_count, default=1, help="processes (1)")
    parser.add_argument(
        "--ray",
        metavar="ADDRESS",
        nargs="?",
        const="local",
        help="work on Ray: on this machine, or on the cluster at an address",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        help="write the results there, and go on from what is there",
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be an integer of at least 1, got {text!r}")
    return int(text)


def _searches(names: Sequence[str]) -> list[NamedSearch]:
    wanted = SUITE if "all" in names else dict.fromkeys(names)
    return [search(name) for name in wanted]


# The commands.


def _list() -> None:
    """Show the policies and the searches."""
    print("policies:\n")
    for name, make in policies.POLICIES.items():
        told = (inspect.getdoc(make) or "").split("\n")[0]
        print(f"  {name:<17} {told}".rstrip())
    print(f"\nsearches of suite {SUITE_VERSION}:\n")
    for name, each in SUITE.items():
        print(f"  {name:<11} {_outline(each)}\n              {each.reason}")


def _outline(each: NamedSearch) -> str:
    """A search in a line."""
    scenario = each.scenario
    n, persons = scenario.n_drones, len(scenario.person_initial_position)
    x, y = scenario.vector
    pod = " ".join(f"{chance:g}" for chance in dict.fromkeys(scenario.detections))
    return (
        f"{scenario.grid_size} x {scenario.grid_size} cells, {n} drone{'s' * (n > 1)}, "
        f"{persons} person{'s' * (persons > 1)}, drift ({x:g}, {y:g}), "
        f"disperse constant {scenario.disperse_constant:g}, POD {pod}, "
        f"{scenario.timestep_limit} steps"
    )


def _evaluate(cells: list[EvaluationTask], bounds: list[BoundOf], options: Any) -> None:
    jobs = [job for each in bounds for job in each.jobs()]
    jobs += [job for cell in cells for job in cell.jobs()]
    total = sum(cell.episodes for cell in cells) + BoundOf.WEIGHT * len(bounds)
    what = f"{cells[0].spec.name} on {len(cells)} search{'es' * (len(cells) > 1)}"
    try:
        with Progress(what, total) as bar:
            work.run(jobs, workers=options.workers, ray=options.ray, progress=bar)
    finally:  # what is finished is told, whatever stopped the rest
        known = {each.search.name: each.bound for each in bounds}
        finished = [
            cell.evaluation().with_bound(known.get(cell.search.name))
            for cell in cells
            if cell.is_done
        ]
        _tell(finished, options)
    if options.out is not None:
        _write(finished, options.out)


def _tell(evaluations: list[Evaluation], options: Any) -> None:
    """Print results."""
    if not evaluations:
        return
    if options.json:
        print(json.dumps([each.data for each in evaluations], indent=1, allow_nan=False))
        return
    if options.csv:
        print(csv_text(evaluations), end="")
        return
    headers = ["policy", "search", "success, %", "time, steps", "return", "crashes"]
    rows = []
    for each in evaluations:
        crashes = len(each.episodes) - sum(
            count
            for ending, count in each.endings.items()
            if ending.name in ("FOUND", "TIME_LIMIT")
        )
        rows.append(
            [
                each.policy,
                each.search.name,
                percent(each.success),
                figure(each.time),
                f"{each.mean_return.value:,.0f}",
                str(crashes),
            ]
        )
        if options.bound:
            limit = "-" if each.bound is None else f"{100 * each.bound.by_time[-1]:.1f}"
            rows[-1] += [limit, percent(each.share_of_bound)]
    if options.bound:
        headers += ["bound, %", "share of it, %"]
    print_table(headers, rows)
    print(
        f"\n{options.episodes} episodes of each search, seeds from {options.seed}, suite "
        f"{SUITE_VERSION}; in brackets 95 % intervals.\nSuccess: everybody found by the limit. "
        "Time: to find everybody, the limit where not all\nwere found. Mishaps: drones that "
        "collided or left the grid. Shown: the "
        f"{'posterior' if options.posterior else 'drift alone'}."
    )


def _write(evaluations: list[Evaluation], folder: Path) -> None:
    """Write the files of results."""
    for each in evaluations:
        posterior = ".posterior" * each.search.scenario.bayesian_update
        name = f"{_file_name(each.policy)}.{each.search.name}{posterior}"
        save_json(folder / f"{name}.json", each)
        save_episodes(folder / f"{name}.episodes.csv", each)
    save_csv(folder / f"{_file_name(evaluations[0].policy)}.summary.csv", evaluations)
    print(f"written to {folder}", file=sys.stderr)


def _file_name(text: str) -> str:
    return "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in text).strip(".-")


def _bound(bounds: list[BoundOf], options: Any) -> None:
    jobs = [job for each in bounds for job in each.jobs()]
    what = f"bound{'s' * (len(bounds) > 1)} of {len(bounds)} search{'es' * (len(bounds) > 1)}"
    try:
        with Progress(what, BoundOf.WEIGHT * len(bounds)) as bar:
            work.run(jobs, workers=options.workers, ray=options.ray, progress=bar)
    finally:
        done = [(each.search, each.bound) for each in bounds if each.bound is not None]
        if done and options.json:
            told = [
                {
                    "search": each.name,
                    "by_time": bound.by_time.tolist(),
                    "relaxed": bound.relaxed,
                    "gap": bound.gap,
                    "confidence": bound.confidence,
                }
                for each, bound in done
            ]
            print(json.dumps(told, indent=1, allow_nan=False))
        elif done:
            _tell_bounds(done)


def _tell_bounds(bounds: list[tuple[NamedSearch, Any]]) -> None:
    parts = (0.25, 0.5, 0.75, 1.0)
    headers = ["search", "steps", *(f"by {part:.0%}, %" for part in parts)]
    headers += ["duality gap, %", "confidence"]
    rows = []
    for each, bound in bounds:
        limit = each.scenario.timestep_limit
        by_time = [f"{100 * bound.by_time[round(part * limit)]:.2f}" for part in parts]
        certain = "exact" if bound.confidence == 1.0 else f"{bound.confidence:.6g}"
        rows.append([each.name, str(limit), *by_time, f"{100 * bound.gap:.2f}", certain])
    print_table(headers, rows, words=1)
