"""The leaderboard: every policy on every search of the suite, with intervals and bounds.

The work is a list of jobs, the longest first, shared out to all workers, so that they are
busy to the end. What is finished is kept in a store: a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import DroneSwarmSearch
from DroneSwarmSearch._internal import checks
from DroneSwarmSearch.evaluation import page
from DroneSwarmSearch.evaluation import workers as work
from DroneSwarmSearch.evaluation.bounds import BoundOf
from DroneSwarmSearch.evaluation.cli import PORTIONS, guarded
from DroneSwarmSearch.evaluation.episodes import checked_view
from DroneSwarmSearch.evaluation.files import Store, write_text
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.results import Bound, Evaluation, save_csv
from DroneSwarmSearch.evaluation.run import EvaluationTask
from DroneSwarmSearch.evaluation.statistics import Estimate, bootstrap_mean
from DroneSwarmSearch.evaluation.suite import SUITE, SUITE_VERSION, NamedSearch, as_named
from DroneSwarmSearch.evaluation.tables import print_table
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.wrappers.layouts import LAYOUTS

__all__ = ["Leaderboard", "PairwiseComparison", "PolicySummary", "leaderboard", "main"]

Floats = NDArray[np.float64]

THEORY: tuple[tuple[str, ...], ...] = (
    ("planner",),
    ("ppo", "greedy-posterior"),
    ("greedy-matrix", "parallel-sweep", "creeping-line", "expanding-square", "sector-search"),
    ("random",),
)
"""Who should be ahead of whom, from the first to the last; within a group nothing is said.

A plan made with the person's forecast is an optimal policy's form, one look ahead with the right
belief is its heuristic, which a network may better or fall short of, effort that ignores what
was searched is worth less, and effort that ignores where the person may be is worth least
(Stone, Theory of Optimal Search, 1975; Brown, Operations Research 28:1275, 1980)."""

ILLUSTRATED = "classic"
"""The search of the figures that show only one, if it is among those evaluated."""


@dataclass(frozen=True)
class PolicySummary:
    """A policy on all searches together, each counting alike.

    Attributes:
        policy: its name.
        success: the mean share of successes.
        time: the mean of the restricted mean times, each as a share of the search's limit.
        share_of_bound: the mean share of the bound; None without bounds.
    """

    policy: str
    success: Estimate
    time: Estimate
    share_of_bound: Estimate | None


@dataclass(frozen=True)
class PairwiseComparison:
    """Two policies on the same seas, the one that theory puts ahead first.

    Attributes:
        ahead: the first policy's name.
        behind: the second's.
        success: the mean difference in the share of successes, first less second.
        time: the mean difference in time, as shares of the limits, first less second.
    """

    ahead: str
    behind: str
    success: Estimate
    time: Estimate

    @property
    def verdict(self) -> str:
        """What the intervals say of it."""
        more, sooner = self.success.low > 0.0, self.time.high < 0.0
        if more:
            return "finds more, and sooner" if sooner else "finds more"
        if self.success.high < 0.0:
            return "finds less"
        if sooner:
            return "finds as many, sooner"
        return "finds as many, later" if self.time.low > 0.0 else "not told apart"


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Policies evaluated on searches, all in the same episodes.

    Attributes:
        evaluations: of every policy on every search, search by search.
        added: names of the policies that are not of the registry.
        posterior: of a policy on a search, shown the posterior in place of the prior: for
            the comparison of the two matrices.
    """

    evaluations: tuple[Evaluation, ...]
    added: tuple[str, ...] = ()
    posterior: Evaluation | None = None

    @cached_property
    def policies(self) -> tuple[str, ...]:
        """Their names, in the order of the rows."""
        return tuple(dict.fromkeys(each.policy for each in self.evaluations))

    @cached_property
    def searches(self) -> tuple[NamedSearch, ...]:
        """The searches, in the suite's order."""
        return tuple({each.search.name: each.search for each in self.evaluations}.values())

    @cached_property
    def cells(self) -> Mapping[tuple[str, str], Evaluation]:
        """The evaluations by policy and search."""
        return {(each.policy, each.search.name): each for each in self.evaluations}

    def of_policy(self, policy: str) -> tuple[Evaluation, ...]:
        """A policy's evaluations, in the order of the searches."""
        return tuple(self.cells[policy, search.name] for search in self.searches)

    def bound_of(self, search: str) -> Bound | None:
        """A search's bound, if it was worked out."""
        return self.cells[self.policies[0], search].bound

    @cached_property
    def summaries(self) -> tuple[PolicySummary, ...]:
        """Every policy on all searches together."""
        return tuple(self._standing(policy) for policy in self.policies)

    @cached_property
    def comparisons(self) -> tuple[PairwiseComparison, ...]:
        """Every policy against those that theory puts next below it.

        Those added stand against the first of its order that was evaluated.
        """
        ranks = [[name for name in rank if name in self.policies] for rank in THEORY]
        ranks = [rank for rank in ranks if rank]
        pairs = [(name, ranks[0][0]) for name in self.added if ranks]
        for above, below in pairwise(ranks):
            pairs += [(ahead, behind) for ahead in above for behind in below]
        return tuple(self._rung(*pair) for pair in pairs)

    @property
    def beyond(self) -> tuple[Evaluation, ...]:
        """Those whose success exceeds the bound by more than its interval: none should."""
        return tuple(
            each
            for each in self.evaluations
            if each.bound is not None and each.success.low > each.bound.by_time[-1]
        )

    def _standing(self, policy: str) -> PolicySummary:
        several = self.of_policy(policy)
        bounds = [each.bound for each in several]
        share = None
        if all(bound is not None and bound.by_time[-1] > 0.0 for bound in bounds):
            share = bootstrap_mean(
                *(
                    _found(each) / bound.by_time[-1]
                    for each, bound in zip(several, bounds, strict=True)
                    if bound is not None
                )
            )
        return PolicySummary(
            policy,
            bootstrap_mean(*map(_found, several)),
            bootstrap_mean(*map(_lateness, several)),
            share,
        )

    def _rung(self, ahead: str, behind: str) -> PairwiseComparison:
        pairs = list(zip(self.of_policy(ahead), self.of_policy(behind), strict=True))
        return PairwiseComparison(
            ahead,
            behind,
            bootstrap_mean(*(_found(one) - _found(other) for one, other in pairs)),
            bootstrap_mean(*(_lateness(one) - _lateness(other) for one, other in pairs)),
        )


def _found(evaluation: Evaluation) -> Floats:
    """1 for every success, 0 for the other episodes."""
    return (evaluation.found_by > 0).astype(np.float64)


def _lateness(evaluation: Evaluation) -> Floats:
    """The restricted times as shares of the limit."""
    return evaluation.times / evaluation.limit


def leaderboard(
    policies: Sequence[str] | None = None,
    searches: Sequence[object] | None = None,
    *,
    added: Sequence[object] = (),
    view: str = "swarm",
    observation: str = "dict",
    posterior: bool = False,
    episodes: int = 2000,
    seed: int = 0,
    workers: int = 1,
    ray: str | None = None,
    store: Store | str | Path | None = None,
    bounds: bool = True,
    progress: bool = True,
) -> Leaderboard:
    """Evaluate policies on searches, all in the same episodes.

    Args:
        policies: names of the registry; all of them without it.
        searches: names of the suite, or of the type `NamedSearch`; the whole suite without it.
        added: further policies, in any form that `evaluate` takes.
        view: how the added policies are shown the searches, see `evaluate`.
        observation: in which layout, see `evaluate`.
        posterior: show the added policies the posterior, not the drift alone. Their returns
            then follow another matrix; whom they find, and when, stays comparable.
        episodes: of every policy on every search.
        seed: of the first episode.
        workers: processes to work in.
        ray: work on Ray instead: "local", or a cluster's address.
        store: where finished work is kept and looked for.
        bounds: whether to work out every search's bound.
        progress: show a progress bar.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of its limits, or a name unknown, or used twice.
        ImportError: `ray` is given and Ray is not installed.
        StorageError: the store cannot be written; what was finished before is kept.
        WorkerCrashed: a worker ended in mid-work; what was finished before is kept.
    """
    contest = _Contest(
        policies,
        searches,
        added,
        view=view,
        observation=observation,
        posterior=posterior,
        episodes=episodes,
        seed=seed,
        store=store if store is None or isinstance(store, Store) else Store(store),
        bounds=bounds,
    )
    return contest.run(workers=workers, ray=ray, progress=progress)


class _Contest:
    """All that is to be done for a leaderboard; the arguments are `leaderboard`'s."""

    def __init__(
        self,
        policies: Sequence[str] | None,
        searches: Sequence[object] | None,
        added: Sequence[object],
        *,
        view: str,
        observation: str,
        posterior: bool,
        episodes: int,
        seed: int,
        store: Store | None,
        bounds: bool,
    ) -> None:
        for what, names in (("policies", policies), ("searches", searches), ("added", added)):
            if names is not None and (isinstance(names, str) or not isinstance(names, Iterable)):
                raise TypeError(f"{what} must be a list, got {names!r}")
        view, observation = checked_view(view, observation)
        posterior = checks.boolean("posterior", posterior)
        bounds = checks.boolean("bounds", bounds)
        usual = [PolicySpec.of(name) for name in (_ranked() if policies is None else policies)]
        strangers = [PolicySpec.of(each) for each in added]
        named = [as_named(each) for each in (SUITE if searches is None else searches)]
        _all_different("policies", [each.name for each in (*strangers, *usual)])
        _all_different("searches", [each.name for each in named])

        def cell(spec: PolicySpec, search: NamedSearch, updated: bool | None) -> EvaluationTask:
            mine = spec in strangers
            return EvaluationTask(
                spec,
                search,
                episodes=episodes,
                seed=seed,
                bayesian_update=True if mine and posterior else updated,
                view=view if mine else "swarm",
                observation=observation if mine else "dict",
                store=store,
            )

        everybody = (*strangers, *usual)
        self._added = tuple(each.name for each in strangers)
        self._cells = [cell(each, search, None) for search in named for each in everybody]
        compared = _compared(usual, named)
        self._posterior = cell(*compared, True) if compared else None
        self._bounds = {each.name: BoundOf(each, store) for each in named if bounds}

    def run(self, *, workers: int, ray: str | None, progress: bool) -> Leaderboard:
        """Do what is left to do."""
        cells = [*self._cells, *([self._posterior] if self._posterior else [])]
        total = sum(each.episodes for each in cells) + BoundOf.WEIGHT * len(self._bounds)
        wanted: list[EvaluationTask | BoundOf] = [*self._bounds.values(), *cells]
        wanted.sort(key=_length, reverse=True)
        jobs = [job for each in wanted for job in each.jobs()]
        with Progress("leaderboard", total, progress) as bar:
            work.run(jobs, workers=workers, ray=ray, progress=bar)
        bounds = {name: each.bound for name, each in self._bounds.items()}
        return Leaderboard(
            tuple(
                each.evaluation().with_bound(bounds.get(each.search.name)) for each in self._cells
            ),
            self._added,
            self._posterior.evaluation() if self._posterior else None,
        )


def _ranked() -> list[str]:
    """The policies there are, those first that theory puts first."""
    ranked = [name for rank in THEORY for name in rank if name in POLICIES]
    return [*ranked, *(name for name in POLICIES if name not in ranked)]


def _all_different(what: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"{what} must be at least one, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{what} must all be different, got more than once: {', '.join(twice)}")


def _compared(
    specs: Sequence[PolicySpec], searches: Sequence[NamedSearch]
) -> tuple[PolicySpec, NamedSearch] | None:
    """Whose searches show what a prior and a posterior promise: with one person that is exact."""
    single = [each for each in searches if len(each.scenario.person_initial_position) == 1]
    if not single or not specs:
        return None
    by_name = {each.name: each for each in specs}
    return by_name.get("greedy-posterior", specs[0]), _illustrated(single)


def _illustrated(searches: Sequence[NamedSearch]) -> NamedSearch:
    return next((each for each in searches if each.name == ILLUSTRATED), searches[0])


def _length(work: EvaluationTask | BoundOf) -> tuple[bool, bool, int, int]:
    """For sorting: how long a bound or a cell may take.

    Bounds and planning take longest. Then comes what cannot be shared: with several persons
    finds are news, so that episodes part, with one the drones mostly fly the same in all.
    """
    scenario = work.search.scenario
    return (
        isinstance(work, BoundOf),
        isinstance(work, EvaluationTask) and work.spec.name == "planner",
        len(scenario.person_initial_position),
        scenario.grid_size**2 * scenario.timestep_limit * (scenario.n_drones + 1),
    )


def fit(board: Leaderboard) -> None:
    """Work out all intervals now, under a progress bar: they are kept in the objects.

    Resampling takes about a minute for the whole suite.
    """
    searches = len(board.searches)
    tasks: list[tuple[object, str, int]] = [
        (each, figure, 1) for each in board.evaluations for figure in ("time", "mean_return")
    ]
    tasks += [
        (board, "summaries", 3 * len(board.policies) * searches),
        (board, "comparisons", 4 * len(board.policies) * searches),
    ]
    done = 0
    with Progress("intervals", sum(weight for *_, weight in tasks)) as bar:
        for owner, figure, weight in tasks:
            getattr(owner, figure)
            done += weight
            bar(done)


# Files.


def write(board: Leaderboard, out: Path, command: str) -> list[Path]:
    """Write `leaderboard.md`, `.csv` and `.json`, and the figures where matplotlib is installed.

    Args:
        board: the figures.
        out: the folder, made if need be.
        command: what made it, for the page.

    Returns:
        The files.

    Raises:
        StorageError: a file cannot be written.
    """
    text, table, data = (out / f"leaderboard{suffix}" for suffix in (".md", ".csv", ".json"))
    pictures = _draw(board, out)
    write_text(text, page.markdown(board, command, {path.stem for path in pictures}))
    save_csv(table, board.evaluations)
    write_text(data, dumps(_data(board, command), allow_nan=False) + "\n")
    return [text, table, data, *pictures]


def _data(board: Leaderboard, command: str) -> dict[str, Any]:
    """Everything but the single episodes, as plain data for JSON."""
    first = board.evaluations[0]
    return {
        "package": DroneSwarmSearch.__version__,
        "numpy": np.__version__,
        "suite": SUITE_VERSION,
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
        "order": [
            {
                "first": each.ahead,
                "second": each.behind,
                "success": each.success._asdict(),
                "restricted_mean_time_over_limit": each.time._asdict(),
                "verdict": each.verdict,
            }
            for each in board.comparisons
        ],
        "evaluations": [each.data for each in board.evaluations],
    }


def _draw(board: Leaderboard, out: Path) -> list[Path]:
    """Draw the figures; none, with a hint, where matplotlib is missing."""
    try:
        from DroneSwarmSearch.evaluation import plots
    except ImportError as error:
        print(error, file=sys.stderr)
        return []
    shown = _illustrated(board.searches)
    figures = {
        "success": plots.success_by_search(board.evaluations),
        "curves": plots.suite_over_time(board.evaluations),
    }
    if len(board.searches) > 1:
        here = [board.cells[policy, shown.name] for policy in board.policies]
        figures["one-search"] = plots.success_over_time(here)
    flyers = [name for rank in THEORY for name in rank if name in board.policies]
    if flyers:
        seed = board.evaluations[0].seed
        figures["episode"] = plots.episode(flyers[0], shown, seed=seed)
    if board.posterior is not None:
        prior = board.cells[board.posterior.policy, board.posterior.search.name]
        tables = {"prior": prior.reliability, "posterior": board.posterior.reliability}
        if any(table.searches.any() for table in tables.values()):
            figures["reliability"] = plots.reliability(tables)
    return [path for name in figures for path in plots.save(figures[name], out / name)]


# The command line.

EPILOG = """\
examples:
  python -m DroneSwarmSearch leaderboard
  python -m DroneSwarmSearch leaderboard --episodes 200 --searches pond fog --workers 2
  python -m DroneSwarmSearch leaderboard --add my_policies.py:MyPolicy --out mine

What is finished is kept in DIR/portions: after an interruption the same command goes on
where it stopped. Exit codes: 0 done, 1 failed, 2 wrong arguments, 130 interrupted.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `python -m DroneSwarmSearch leaderboard`.

    Args:
        argv: the arguments after the command's name; those of the process if None.

    Returns:
        The exit code: 0; 1 if something went wrong; 130 after Ctrl-C.

    Raises:
        SystemExit: help was asked for (code 0), or an option cannot be met (code 2).
    """
    given = list(sys.argv[1:] if argv is None else argv)
    parser = _parser()
    options = parser.parse_args(given)
    store = Store(options.out / PORTIONS)
    try:
        checks.integer("workers", options.workers, 1)
        contest = _Contest(
            options.policies,
            options.searches,
            options.add,
            view=options.view,
            observation=options.observation,
            posterior=options.posterior,
            episodes=options.episodes,
            seed=options.seed,
            store=store,
            bounds=options.bound,
        )
    except (TypeError, ValueError) as error:
        parser.error(str(error))
    command = shlex.join(["python", "-m", "DroneSwarmSearch", "leaderboard", *given])

    def work_out() -> None:
        board = contest.run(workers=options.workers, ray=options.ray, progress=True)
        fit(board)
        show(board)
        files = write(board, options.out, command)
        print(f"\nwritten to {options.out}: {', '.join(path.name for path in files)}")

    return guarded(work_out, store)


def show(board: Leaderboard) -> None:
    """Print the two main tables."""
    for title, (headers, *rows) in (
        ("Found by the limit, %; the best of each search with a star", page.overview(board, "{}*")),
        ("All searches together, with 95 % intervals", page.suite_table(board)),
    ):
        print(f"\n{title}\n")
        print_table(headers, rows, words=1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m DroneSwarmSearch leaderboard",
        description="Evaluate every policy on every search of the suite, in the same episodes,"
        " and write tables and figures.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = parser.add_argument_group("what is evaluated")
    what.add_argument(
        "--episodes", metavar="N", type=int, default=2000, help="of each cell (default: 2000)"
    )
    what.add_argument(
        "--searches", metavar="NAME", nargs="+", help="of the suite (default: all of it)"
    )
    what.add_argument(
        "--policies",
        metavar="NAME",
        nargs="+",
        help=f"of {', '.join(POLICIES)} (default: all of them)",
    )
    what.add_argument(
        "--add",
        metavar="WHERE",
        action="append",
        default=[],
        help="a policy of your own as a row: weights.npz of examples/train_ppo.py,"
        " module:attribute or file.py:attribute, whose code is executed; each also after"
        " name=; may be given several times",
    )
    what.add_argument(
        "--view",
        choices=("swarm", "drone", "parallel"),
        default="swarm",
        help="how policies of your own are shown the searches (default: swarm)",
    )
    what.add_argument(
        "--observation",
        choices=tuple(LAYOUTS),
        default="dict",
        help="in which layout (default: dict)",
    )
    what.add_argument(
        "--posterior", action="store_true", help="show policies of your own the posterior"
    )
    what.add_argument(
        "--seed", metavar="N", type=int, default=0, help="of the first episode (default: 0)"
    )
    what.add_argument(
        "--no-bound", dest="bound", action="store_false", help="leave the bounds out: much faster"
    )
    how = parser.add_argument_group("how")
    cores = os.cpu_count() or 1
    how.add_argument(
        "--workers",
        metavar="N",
        type=int,
        default=cores,
        help="processes; no figure depends on it (default: one for each core)",
    )
    how.add_argument(
        "--ray",
        metavar="ADDRESS",
        nargs="?",
        const="local",
        help="work on Ray: on this machine, or on the cluster at ADDRESS",
    )
    how.add_argument(
        "--out",
        metavar="DIR",
        type=Path,
        default=Path("leaderboard"),
        help="folder for tables, figures and finished work (default: leaderboard)",
    )
    return parser
