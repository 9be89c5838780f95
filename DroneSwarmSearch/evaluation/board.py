"""Leaderboards: evaluate policies on several searches, and summarise them."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from DroneSwarmSearch._internal.files import csv_rows
from DroneSwarmSearch.evaluation.parallel import Workers
from DroneSwarmSearch.evaluation.policy_spec import PolicySpec
from DroneSwarmSearch.evaluation.results import Evaluation, known_bounds, save_csv
from DroneSwarmSearch.evaluation.run import Case, check_names, evaluate_cases
from DroneSwarmSearch.evaluation.statistics import ROUNDING, Estimate, difference, mean_of
from DroneSwarmSearch.evaluation.suite import SUITE, as_named
from DroneSwarmSearch.evaluation.text_tables import figure, percent
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.policies import POLICIES

SUBMISSION = "name", "policy", "deterministic", "success", "authors", "reference"
TOLERANCE = 0.1  # points between a claimed success and the interval of the rerun


@dataclass(frozen=True, eq=False)
class Leaderboard:
    """Policies evaluated on searches, search by search; samples are of the same episodes."""

    evaluations: Sequence[Evaluation]

    @property
    def policies(self) -> dict[str, list[Evaluation]]:
        """The evaluations of each policy, the most successful first."""
        by_policy: dict[str, list[Evaluation]] = {}
        for result in self.evaluations:
            by_policy.setdefault(result.policy, []).append(result)
        mean = {
            name: fmean(result.success.value for result in by_policy[name]) for name in by_policy
        }
        return {name: by_policy[name] for name in sorted(mean, key=lambda name: -mean[name])}

    @property
    def summary_table(self) -> list[list[str]]:
        """A heading, a row for each policy, and one for the bound; searches weigh the same."""
        known = known_bounds(self.evaluations)
        bounds = [Estimate.exact(fmean(known.values()))] if known else []
        rows = [["policy", "success, %", *["gap, points" for _ in bounds], "time, % of limit"]]
        for policy, several in self.policies.items():
            success = mean_of(result.success for result in several)
            time = mean_of(result.time.scaled(1.0 / result.limit) for result in several)
            gaps = [percent(difference(bound, success)) for bound in bounds]
            rows.append([policy, percent(success), *gaps, percent(time)])
        return rows + [["bound", percent(bound), "", ""] for bound in bounds]

    @property
    def search_table(self) -> list[list[str]]:
        """A heading, and the success of each policy in a row for each search; * marks the best."""
        policies = self.policies
        bounds = known_bounds(self.evaluations)
        heading = ["search", *policies]
        if bounds:
            heading.insert(1, "bound")
        rows = [heading]
        for several in zip(*policies.values(), strict=True):
            search = several[0].search.name
            values = [result.success.value for result in several]
            best = max(values) - ROUNDING
            row = [search]
            if bounds:
                row.append(f"{100 * bounds[search]:.1f}")
            for value in values:
                mark = "*" if value > best else ""
                row.append(f"{100 * value:.1f}{mark}")
            rows.append(row)
        return rows

    def write(self, folder: Path) -> list[Path]:
        """Write leaderboard.csv, and plots if Matplotlib is installed; returns the files.

        Raises:
            StorageError: a file cannot be written.
        """
        table = folder / "leaderboard.csv"
        save_csv(table, self.evaluations)
        try:
            from DroneSwarmSearch.evaluation import plots
        except ImportError as error:
            print(error, file=sys.stderr)
            return [table]
        times = plots.save(plots.success_over_time, self.evaluations, folder / "time")
        shares = plots.save(plots.success_by_search, self.evaluations, folder / "success")
        return [table, *times, *shares]


def leaderboard(
    policies: Sequence[str] | None = None,
    searches: Sequence[object] | None = None,
    *,
    added: Sequence[object] = (),
    submissions: str | Path | None = None,
    view: View | str | None = None,
    deterministic: bool | None = None,
    episodes: int = 2000,
    seed: int = 0,
    workers: int = 1,
    ray: str | None = None,
    out: str | Path | None = None,
    bounds: bool = True,
    progress: bool = True,
) -> Leaderboard:
    """Evaluate policies on searches; samples are of the same episodes.

    Args:
        policies: names of policies of this package; None for all.
        searches: names of the suite or `NamedSearch` objects; None for the whole suite.
        added: further policies, in any form that `evaluate` takes.
        submissions: a CSV file of further policies, whose claims are checked. Its columns are
            "name"; "policy", as text for `evaluate`; "deterministic", "yes" if it is stated to be;
            "success", the claimed mean over the searches in percent, which the 95% interval of
            this run must contain, give or take 0.1; "authors" and "reference", for readers.
        view: what the added policies see. If they see the posterior, their returns depend on
            another matrix; success and time stay comparable.
        deterministic: whether the added policies are.
        episodes: of every policy on every search.
        seed: of the first episode.
        workers: see `evaluate`.
        ray: see `evaluate`.
        out: see `evaluate`.
        bounds: whether to compute the upper bound of every search.
        progress: see `evaluate`.

    Raises:
        ValueError: a name is used twice; a row of the submissions is incomplete, or what it claims
            differs from what was found, which `out` keeps; see also `evaluate`.
    """
    package = [PolicySpec.of(name) for name in (POLICIES if policies is None else policies)]
    own = [PolicySpec.of(policy) for policy in added]
    named = [as_named(search) for search in (SUITE if searches is None else searches)]
    rows = [] if submissions is None else _read_submissions(submissions)
    theirs = [PolicySpec.of(row["policy"], row["name"]) for row in rows]
    check_names("policies", [*own, *theirs, *package])
    check_names("searches", named)
    cases = []
    for search in named:
        cases += [Case.of(spec, search, view, deterministic) for spec in own]
        for spec, row in zip(theirs, rows, strict=True):
            cases.append(Case.of(spec, search, deterministic=row["deterministic"] == "yes" or None))
        cases += [Case.of(spec, search) for spec in package]
    evaluations = evaluate_cases(
        cases,
        episodes,
        seed,
        out,
        Workers(workers, ray, progress),
        bounded=named if bounds else [],
    )
    found = Leaderboard(evaluations)
    for row in rows:
        mean = mean_of(result.success for result in found.policies[row["name"]]).scaled(100.0)
        if not mean.low - TOLERANCE <= float(row["success"]) <= mean.high + TOLERANCE:
            raise ValueError(
                f"success of {row['name']} in submissions must be that of the rerun, "
                f"{figure(mean)}, within {TOLERANCE} points, got {row['success']}"
            )
    return found


def _read_submissions(path: str | Path) -> list[dict[str, str]]:
    rows = [row for _, row in csv_rows(Path(path), lacking=None)]
    for row in rows:
        known = (*row,) == SUBMISSION and None not in row.values()
        if not (known and re.fullmatch(r"\d+(\.\d*)?", row["success"])):
            columns = ", ".join(SUBMISSION)
            raise ValueError(
                f"submissions must have the columns {columns}, and a number as success, got "
                f"{row!r:.300}"
            )
    return rows
