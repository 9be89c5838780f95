"""Write the tables of the leaderboard and of the open problems from the leaderboard's CSV files.

    python benchmarks/leaderboard_page.py

The files are leaderboard.csv, which the command `leaderboard` writes, submissions.csv, and
decisions.csv of benchmarks/decisions.py.
"""

from __future__ import annotations

from pathlib import Path
from statistics import fmean

from csv_rows import rows_of
from markdown_tables import markdown, with_table

FOLDER = Path(__file__).parents[1] / "docs/leaderboard"
PAGE = FOLDER / "leaderboard.md"
PROBLEMS = FOLDER.parent / "open-problems.md"
COMMAND = "python benchmarks/leaderboard_page.py"
SUBMITTED = " †"
Row = dict[str, str]
Policies = dict[str, dict[str, Row]]  # the row of each search, by policy


def by_policy() -> Policies:
    """All rows of the leaderboard; the most successful policy is the first."""
    found: Policies = {}
    for row in rows_of(FOLDER / "leaderboard.csv"):
        found.setdefault(row["policy"], {})[row["search"]] = row
    return dict(sorted(found.items(), key=lambda item: -mean(item[1], "success")))


def mean(rows: dict[str, Row], column: str) -> float:
    """The mean of a column over all searches."""
    return fmean(float(row[column]) for row in rows.values())


def shown(name: str, submitted: set[str]) -> str:
    """A policy's name, with a mark if it was submitted."""
    return name + SUBMITTED if name in submitted else name


def table_of_policies(policies: Policies, submitted: set[str]) -> str:
    """A row for each policy, and one for the bound."""
    measured = rows_of(FOLDER / "decisions.csv")
    milliseconds = {row["policy"]: float(row["milliseconds"]) for row in measured}
    lines = [["policy", "success, %", "gap, points", "time, % of limit", "decision, ms"]]
    for name, rows in policies.items():
        success = mean(rows, "success")
        bound = mean(rows, "bound")
        time = fmean(
            float(row["restricted_mean_time"]) / float(row["timestep_limit"])
            for row in rows.values()
        )
        figures = [f"{100 * value:.1f}" for value in (success, bound - success, time)]
        lines.append([shown(name, submitted), *figures, rounded(milliseconds[name])])
    return markdown([*lines, ["bound", f"{100 * bound:.1f}", "", "", ""]])


def rounded(value: float) -> str:
    """A number with one digit or more, and as many decimals as make them two."""
    if value < 1:
        return f"{value:.2f}"
    if value < 10:
        return f"{value:.1f}"
    return f"{value:.0f}"


def tables_of_searches(policies: Policies, submitted: set[str]) -> str:
    """A row for each search with the success of all policies, in two tables that fit the page.

    The best policy of each search is in bold.
    """
    best = {
        search: max(float(rows[search]["success"]) for rows in policies.values())
        for search in next(iter(policies.values()))
    }
    names = [*policies]
    half = (len(names) + 1) // 2
    tables = []
    for group in (names[:half], names[half:]):
        lines = [["search", "bound", *(shown(name, submitted) for name in group)]]
        for search, highest in best.items():
            of_search = [policies[name][search] for name in group]
            cells = [cell_of(row, highest) for row in of_search]
            lines.append([search, f"{100 * float(of_search[0]['bound']):.1f}", *cells])
        tables.append(markdown(lines))
    return "\n".join(tables)


def cell_of(row: Row, highest: float) -> str:
    """A success in percent, with a tilde if it is not exact, and in bold if it is the highest."""
    success = float(row["success"])
    figure = f"{100 * success:.1f}"
    if row["method"] != "exact":
        figure = f"~{figure}"
    return f"**{figure}**" if success == highest else figure


def table_of_gaps(policies: Policies, submitted: set[str]) -> str:
    """A row for each search, the largest gap between the planner and the bound first."""
    others = {name: rows for name, rows in policies.items() if name not in submitted}
    planned = others.pop("planner")
    found = []
    for search, row in planned.items():
        plan = 100 * float(row["success"])
        bound = 100 * float(row["bound"])
        lead = plan - max(100 * float(rows[search]["success"]) for rows in others.values())
        cells = [search, f"{plan:.1f}", f"{bound:.1f}", f"{bound - plan:.1f}", f"{lead:+.1f}"]
        found.append((bound - plan, cells))
    found.sort(reverse=True)
    head = ["search", "plan, %", "bound, %", "gap, points", "lead, points"]
    return markdown([head, *(cells for _, cells in found)])


def list_of_submissions(submissions: list[Row]) -> str:
    """Who submitted each policy that has a mark."""
    return "".join(
        f"-{SUBMITTED} **{row['name']}**: submitted by {row['authors']}, `{row['reference']}`.\n"
        for row in submissions
    )


def main() -> None:
    policies = by_policy()
    submissions = rows_of(FOLDER / "submissions.csv")
    submitted = {row["name"] for row in submissions}
    for page, name, make in (
        (PAGE, "policies", table_of_policies),
        (PAGE, "searches", tables_of_searches),
        (PROBLEMS, "gaps", table_of_gaps),
    ):
        table = make(policies, submitted)
        page.write_text(with_table(page, f"{COMMAND}, {name}", table), "utf-8")
    listed = list_of_submissions(submissions)
    PAGE.write_text(with_table(PAGE, f"{COMMAND}, submissions", listed), "utf-8")


if __name__ == "__main__":
    main()
