"""Run a leaderboard: evaluate policies on searches and write the results.

All workers share one list of jobs, the longest first. Finished work is stored, so that an
interrupted run resumes.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.files import write_text
from DroneSwarmSearch.evaluation import page
from DroneSwarmSearch.evaluation.board import Leaderboard, example_search, ranked_by_theory
from DroneSwarmSearch.evaluation.bounds import BoundTask
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.progress import Progress
from DroneSwarmSearch.evaluation.results import save_csv
from DroneSwarmSearch.evaluation.rollout import checked_view
from DroneSwarmSearch.evaluation.run import EvaluationTask, run_tasks
from DroneSwarmSearch.evaluation.store import Store, as_store
from DroneSwarmSearch.evaluation.suite import SUITE, NamedSearch, as_named, versions
from DroneSwarmSearch.policies import POLICIES

__all__ = ["Contest", "compute_intervals", "leaderboard", "write"]


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
        policies: names of policies of this package; None for all.
        searches: names of searches of the suite, or `NamedSearch` objects; None for the
            whole suite.
        added: further policies, in any form that `evaluate` takes.
        view: what the added policies see, see `evaluate`.
        observation: the layout of their observations, see `evaluate`.
        posterior: whether the added policies see the posterior instead of the prior. Their
            returns then depend on another matrix; success and time stay comparable.
        episodes: of every policy on every search.
        seed: of the first episode.
        workers: the number of processes; more than 1 needs joblib.
        ray: run on Ray instead: "local", "auto" or the address of a cluster.
        store: a folder, in which finished work is stored and looked up.
        bounds: whether to compute the upper bound of every search.
        progress: show a progress bar.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: an argument is out of range, or a name is unknown or used twice.
        ImportError: joblib or Ray is needed and not installed.
        StorageError: the store cannot be written; finished work is kept.
        WorkerCrashed: a worker process died; finished work is kept.
    """
    contest = Contest(
        policies,
        searches,
        added,
        view=view,
        observation=observation,
        posterior=posterior,
        episodes=episodes,
        seed=seed,
        store=as_store(store),
        bounds=bounds,
    )
    return contest.run(workers=workers, ray=ray, progress=progress)


class Contest:
    """The tasks of a leaderboard. The arguments are those of `leaderboard`."""

    def __init__(
        self,
        policies: Sequence[str] | None,
        searches: Sequence[object] | None,
        added: Sequence[object],
        *,
        view: str,
        observation: str,
        posterior: bool,
        bounds: bool,
        store: Store | None,
        **episodes: int,
    ) -> None:
        for name, values in (("policies", policies), ("searches", searches), ("added", added)):
            if values is not None and (isinstance(values, str) or not isinstance(values, Iterable)):
                raise TypeError(f"{name} must be a list, got {values!r}")
        view, observation = checked_view(view, observation)
        updated = checks.boolean("posterior", posterior) or None
        bounds = checks.boolean("bounds", bounds)
        names = ranked_by_theory([*POLICIES]) if policies is None else policies
        of_package = [PolicySpec.of(name) for name in names]
        of_user = [PolicySpec.of(each) for each in added]
        named = [as_named(each) for each in (SUITE if searches is None else searches)]
        _check_unique("policies", [each.name for each in (*of_user, *of_package)])
        _check_unique("searches", [each.name for each in named])
        shared: dict[str, Any] = {"store": store, **episodes}
        own: dict[str, Any] = {
            "view": view,
            "observation": observation,
            "bayesian_update": updated,
        }
        self._added = tuple(each.name for each in of_user)
        self._tasks = [
            EvaluationTask(each, search, **shared, **(own if each in of_user else {}))
            for search in named
            for each in (*of_user, *of_package)
        ]
        pair = _for_calibration(of_package, named)
        self._posterior = EvaluationTask(*pair, bayesian_update=True, **shared) if pair else None
        self._bounds = {each.name: BoundTask(each, store) for each in named if bounds}

    def run(self, *, workers: int, ray: str | None, progress: bool) -> Leaderboard:
        """Do the work that is left."""
        tasks: list[EvaluationTask | BoundTask] = [*self._bounds.values(), *self._tasks]
        if self._posterior is not None:
            tasks.append(self._posterior)
        tasks.sort(key=_expected_duration, reverse=True)
        run_tasks(tasks, "leaderboard", workers=workers, ray=ray, progress=progress)
        bounds = {name: each.bound for name, each in self._bounds.items()}
        return Leaderboard(
            tuple(
                each.evaluation().with_bound(bounds.get(each.search.name)) for each in self._tasks
            ),
            self._added,
            None if self._posterior is None else self._posterior.evaluation(),
        )


def _check_unique(what: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"{what} must be at least one, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{what} must all be different, got more than once: {', '.join(twice)}")


def _for_calibration(
    specs: Sequence[PolicySpec], searches: Sequence[NamedSearch]
) -> tuple[PolicySpec, NamedSearch] | None:
    """The policy and search that show the calibration of prior and posterior.

    With one person, the forecast probability of success is exact.
    """
    single = [each for each in searches if len(each.scenario.person_initial_position) == 1]
    if not single or not specs:
        return None
    by_name = {each.name: each for each in specs}
    return by_name.get("greedy-posterior", specs[0]), example_search(single)


def _expected_duration(task: EvaluationTask | BoundTask) -> tuple[bool, bool, int, int]:
    """A sort key for how long a task may take.

    Bounds and plans take longest. Next come searches with several persons: their episodes
    diverge when a person is found, so the batch can share less work between them.
    """
    scenario = task.search.scenario
    return (
        isinstance(task, BoundTask),
        isinstance(task, EvaluationTask) and task.spec.name == "planner",
        len(scenario.person_initial_position),
        scenario.grid_size**2 * scenario.timestep_limit * (scenario.n_drones + 1),
    )


def compute_intervals(board: Leaderboard) -> None:
    """Compute all intervals of a leaderboard, which caches them, with a progress bar."""
    searches = len(board.searches)
    tasks: list[tuple[object, str, int]] = [
        (each, name, 1) for each in board.evaluations for name in ("time", "mean_return")
    ]
    tasks.append((board, "comparisons", 2 * len(board.policies) * searches))
    done = 0
    with Progress("intervals", sum(weight for *_, weight in tasks)) as bar:
        for owner, name, weight in tasks:
            getattr(owner, name)
            done += weight
            bar(done)


# Files.


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
    write_text(text, page.markdown(board, command, {path.stem for path in plots}))
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
