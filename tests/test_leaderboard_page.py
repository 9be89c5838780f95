"""The figures of the published pages are those of the CSV file."""

import csv
import math
import re
from pathlib import Path
from statistics import fmean

import pytest
from helpers import tables_of

FOLDER = Path(__file__).parents[1] / "docs" / "leaderboard"
TEXT = (FOLDER / "leaderboard.md").read_text("utf-8")
PROBLEMS = (FOLDER.parent / "open-problems.md").read_text("utf-8")
SUBMITTED = " †"
Row = dict[str, str]


def rows() -> dict[tuple[str, str], Row]:
    with (FOLDER / "leaderboard.csv").open(encoding="utf-8", newline="") as file:
        return {(row["policy"], row["search"]): row for row in csv.DictReader(file)}


def submissions() -> list[Row]:
    with (FOLDER / "submissions.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def shown(value: float, row: Row) -> str:
    return f"{'~' * (row['method'] != 'exact')}{100 * value:.1f}"


def test_the_table_of_policies_has_the_means_the_best_first():
    summary, *_ = tables_of(TEXT)
    successes = []
    for policy, *figures, decision in summary[1:-1]:
        mine = [row for (name, _), row in rows().items() if name == policy.removesuffix(SUBMITTED)]
        success = fmean(float(row["success"]) for row in mine)
        gap = fmean(float(row["bound"]) for row in mine) - success
        time = fmean(
            float(row["restricted_mean_time"]) / float(row["timestep_limit"]) for row in mine
        )
        assert figures == [f"{100 * each:.1f}" for each in (success, gap, time)]
        widths = [float(row["success_high"]) - float(row["success_low"]) for row in mine]
        assert math.hypot(*widths) / len(mine) / 2 < 0.001
        assert float(decision) > 0.0
        successes.append(success)
    assert successes == sorted(successes, reverse=True)
    bounds = {search: float(row["bound"]) for (_, search), row in rows().items()}
    assert summary[-1] == ["bound", f"{100 * fmean(bounds.values()):.1f}", "", "", ""]


def test_the_tables_of_searches_have_every_success():
    best: dict[str, float] = {}
    for (_, search), row in rows().items():
        best[search] = max(best.get(search, 0.0), float(row["success"]))
    found = []
    for table in tables_of(TEXT)[1:]:
        policies = [name.removesuffix(SUBMITTED) for name in table[0][2:]]
        for search, bound, *figures in table[1:]:
            for policy, figure in zip(policies, figures, strict=True):
                row = rows()[policy, search]
                value = float(row["success"])
                expected = shown(value, row)
                assert figure == (f"**{expected}**" if value == best[search] else expected)
                assert bound == f"{100 * float(row['bound']):.1f}"
                found.append((policy, search))
    assert sorted(found) == sorted(rows())


def test_submissions_are_marked_and_have_the_success_that_they_claim():
    summary, *searches = tables_of(TEXT)
    for names in ([row[0] for row in summary], [name for table in searches for name in table[0]]):
        marked = [name.removesuffix(SUBMITTED) for name in names if name.endswith(SUBMITTED)]
        assert sorted(marked) == sorted(row["name"] for row in submissions())
    for each in submissions():
        found = fmean(
            float(row["success"]) for (name, _), row in rows().items() if name == each["name"]
        )
        assert float(each["success"]) == round(100 * found, 1)
        assert (
            f"† **{each['name']}**: submitted by {each['authors']}, `{each['reference']}`" in TEXT
        )


def test_open_problems_are_the_gaps_to_the_bounds_the_largest_first():
    gaps, *_ = tables_of(PROBLEMS)
    submitted = {row["name"] for row in submissions()}
    expected = []
    for search in {search for _, search in rows()}:
        mine = [row for (name, of), row in rows().items() if of == search and name not in submitted]
        found = {row["policy"]: 100 * float(row["success"]) for row in mine}
        bound = 100 * float(mine[0]["bound"])
        plan = found.pop("planner")
        lead = plan - max(found.values())
        assert lead > 0.0
        figures = [f"{each:.1f}" for each in (plan, bound, bound - plan)]
        expected.append((bound - plan, [search, *figures, f"{lead:+.1f}"]))
    assert gaps[1:] == [row for _, row in sorted(expected, reverse=True)]


def test_the_text_states_the_share_and_the_confidence_of_the_bounds():
    by_search: dict[str, list[Row]] = {}
    for (_, search), row in rows().items():
        by_search.setdefault(search, []).append(row)
    share = fmean(max(float(row["share_of_bound"]) for row in each) for each in by_search.values())
    risk = sum(1.0 - float(each[0]["bound_confidence"]) for each in by_search.values())
    words = " ".join(TEXT.split())
    assert f"reaches {100 * share:.1f}% of the bound" in words
    assert f"at least {100 * (1 - risk):.4g}% confidence" in words
    above = [row for row in rows().values() if float(row["success_low"]) > float(row["bound"])]
    assert not above


@pytest.mark.pictures
def test_the_plots_exist():
    names = re.findall(r"\((\w+-light\.svg)\)", TEXT)
    assert names == ["time-light.svg", "success-light.svg"]
    assert all((FOLDER / name).exists() for name in names)
