"""Write the tables of the leaderboard and of the open problems from the leaderboard's CSV files.

    python benchmarks/leaderboard_page.py

The files are leaderboard.csv, which the command `leaderboard` writes, submissions.csv, and
decisions.csv of benchmarks/decisions.py.
"""

from __future__ import annotations

import csv
from pathlib import Path
from statistics import fmean

from markdown_tables import markdown, with_table

FOLDER = Path(__file__).parents[1] / "docs/leaderboard"
PAGE = FOLDER / "leaderboard.md"
PROBLEMS = FOLDER.parent / "open-problems.md"
COMMAND = "python benchmarks/leaderboard_page.py"
SUBMITTED = " †"
Row = dict[str, str]


def rows_of(name: str) -> list[Row]:
    """The rows of a CSV file of the leaderboard."""
    with (FOLDER / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def by_policy() -> dict[str, dict[str, Row]]:
    """The row of each search, by policy; the most successful policy is the first."""
    found: dict[str, dict[str, Row]] = {}
    for row in rows_of("leaderboard.csv"):
        found.setdefault(row["policy"], {})[row["search"]] = row
    return dict(sorted(found.items(), key=lambda item: -mean(item[1], "success")))


def mean(rows: dict[str, Row], column: str) -> float:
    """The mean of a column over all searches."""
    return fmean(float(row[column]) for row in rows.values())


def headings(policies: dict[str, dict[str, Row]]) -> dict[str, str]:
    """The policies' names as they are shown: with a mark if they were submitted."""
    submitted = {row["name"] for row in rows_of("submissions.csv")}
    return {name: name + SUBMITTED * (name in submitted) for name in policies}


def table_of_policies() -> str:
    """A row for each policy, and one for the bound."""
    policies = by_policy()
    shown = headings(policies)
    milliseconds = {row["policy"]: float(row["milliseconds"]) for row in rows_of("decisions.csv")}
    lines = [["policy", "success, %", "gap, points", "time, % of limit", "decision, ms"]]
    for name, rows in policies.items():
        success = mean(rows, "success")
        bound = mean(rows, "bound")
        time = fmean(
            float(row["restricted_mean_time"]) / float(row["timestep_limit"])
            for row in rows.values()
        )
        figures = [f"{100 * value:.1f}" for value in (success, bound - success, time)]
        lines.append([shown[name], *figures, rounded(milliseconds[name])])
    return markdown([*lines, ["bound", f"{100 * bound:.1f}", "", "", ""]])


def rounded(value: float) -> str:
    """A number with one digit or more, and as many decimals as make them two."""
    if value < 1:
        return f"{value:.2f}"
    if value < 10:
        return f"{value:.1f}"
    return f"{value:.0f}"


def table_of_searches() -> str:
    """A row for each search with the success of all policies; the best is in bold."""
    policies = by_policy()
    lines = [["search", "bound", *headings(policies).values()]]
    for search, first in next(iter(policies.values())).items():
        successes = [float(rows[search]["success"]) for rows in policies.values()]
        cells = []
        for rows, success in zip(policies.values(), successes, strict=True):
            figure = f"{100 * success:.1f}"
            if rows[search]["method"] != "exact":
                figure = f"~{figure}"
            cells.append(f"**{figure}**" if success == max(successes) else figure)
        lines.append([search, f"{100 * float(first['bound']):.1f}", *cells])
    return markdown(lines)


def table_of_gaps() -> str:
    """A row for each search, the largest gap between the planner and the bound first."""
    submitted = {row["name"] for row in rows_of("submissions.csv")}
    others = {name: rows for name, rows in by_policy().items() if name not in submitted}
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


def main() -> None:
    for page, name, table in (
        (PAGE, "policies", table_of_policies()),
        (PAGE, "searches", table_of_searches()),
        (PROBLEMS, "gaps", table_of_gaps()),
    ):
        page.write_text(with_table(page, f"{COMMAND}, {name}", table), "utf-8")


if __name__ == "__main__":
    main()
