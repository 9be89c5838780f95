"""The figures of the published page are those of its CSV file."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from statistics import fmean

import pytest
from helpers import tables_of

FOLDER = Path(__file__).parents[1] / "docs" / "leaderboard"
TEXT = (FOLDER / "leaderboard.md").read_text("utf-8")
Row = dict[str, str]


def rows() -> dict[tuple[str, str], Row]:
    with (FOLDER / "leaderboard.csv").open(encoding="utf-8", newline="") as file:
        return {(row["policy"], row["search"]): row for row in csv.DictReader(file)}


def shown(value: float, row: Row) -> str:
    return f"{'~' * (row['method'] != 'exact')}{100 * value:.1f}"


def test_the_table_of_policies_has_the_means_the_best_first() -> None:
    summary, _ = tables_of(TEXT)
    successes = []
    for policy, *figures in summary[1:-1]:
        mine = [row for (name, _), row in rows().items() if name == policy]
        success = fmean(float(row["success"]) for row in mine)
        gap = fmean(float(row["bound"]) for row in mine) - success
        time = fmean(
            float(row["restricted_mean_time"]) / float(row["timestep_limit"]) for row in mine
        )
        assert figures == [f"{100 * each:.1f}" for each in (success, gap, time)]
        width = fmean(float(row["success_high"]) - float(row["success_low"]) for row in mine)
        assert width / 2 < 0.001
        successes.append(success)
    assert successes == sorted(successes, reverse=True)
    bounds = {search: float(row["bound"]) for (_, search), row in rows().items()}
    assert summary[-1] == ["bound", f"{100 * fmean(bounds.values()):.1f}", "", ""]


def test_the_table_of_searches_has_every_success() -> None:
    _, searches = tables_of(TEXT)
    policies = searches[0][2:]
    assert {(name, line[0]) for name in policies for line in searches[1:]} == {*rows()}
    for search, bound, *figures in searches[1:]:
        mine = [rows()[policy, search] for policy in policies]
        assert bound == f"{100 * float(mine[0]['bound']):.1f}"
        best = max(float(row["success"]) for row in mine)
        for figure, row in zip(figures, mine, strict=True):
            value = float(row["success"])
            assert figure == (f"**{shown(value, row)}**" if value == best else shown(value, row))


def test_the_text_states_the_share_and_the_confidence_of_the_bounds() -> None:
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
def test_the_plots_exist() -> None:
    names = re.findall(r"\((\w+-light\.svg)\)", TEXT)
    assert names == ["time-light.svg", "success-light.svg"]
    assert all((FOLDER / name).exists() for name in names)
