"""What the leaderboard's page states follows from the figures in its CSV file."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest
from helpers import tables_of

from DroneSwarmSearch.evaluation import leaderboard, page
from DroneSwarmSearch.evaluation.board import EXPECTED_ORDER

PUBLISHED = Path(__file__).parents[1] / "docs" / "leaderboard"

Row = dict[str, str]


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of a small leaderboard, with bounds."""
    out = tmp_path_factory.mktemp("board")
    names = ["greedy-posterior", "greedy-matrix", "parallel-sweep", "random", "ppo"]
    board = leaderboard(names, ["pond", "harbour"], episodes=60, bounds=False, progress=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "_draw", lambda board, out: [])
        page.write(with_bounds(board), out, "made by a test")
    return out


def with_bounds(board: Any) -> Any:
    """The same leaderboard with made-up bounds: one that is trivial, one that is tight."""
    import numpy as np
    from helpers import bound_by_time

    from DroneSwarmSearch.evaluation.board import Leaderboard

    limits = {"pond": 0.75, "harbour": 1.0}
    bounded = [
        each.with_bound(
            bound_by_time(
                np.full(each.limit + 1, limits[each.search.name]), gap=0.004, confidence=0.999
            )
        )
        for each in board.evaluations
    ]
    return Leaderboard(tuple(bounded), board.added, board.posterior)


def files_of(folder: Path) -> tuple[str, list[Row]]:
    with (folder / "leaderboard.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return (folder / "leaderboard.md").read_text("utf-8"), rows


@pytest.fixture(params=["small", "published"])
def files(request: pytest.FixtureRequest) -> tuple[str, list[Row]]:
    """The page, and the rows of the CSV file."""
    folder = request.getfixturevalue("small") if request.param == "small" else PUBLISHED
    return files_of(folder)


def table(text: str, section: str) -> list[list[str]]:
    """The table of a section of the page."""
    (part,) = re.findall(rf"^## {section}\n(.*?)(?=^## |\Z)", text, re.M | re.S)
    return tables_of(part)[0]


def paragraphs(text: str) -> str:
    return " ".join(text.split())


def names_in(rows: list[Row], key: str) -> list[str]:
    return list(dict.fromkeys(row[key] for row in rows))


def of(rows: list[Row], policy: str, search: str) -> Row:
    (row,) = [row for row in rows if (row["policy"], row["search"]) == (policy, search)]
    return row


def mean(rows: list[Row], policy: str, key: str = "success") -> float:
    return fmean(float(row[key]) for row in rows if row["policy"] == policy)


def shown(row: Row, key: str, factor: float) -> str:
    value = factor * float(row[key])
    if row["method"] == "exact":
        return f"{value:.1f}"
    width = factor * (float(row[f"{key}_high"]) - float(row[f"{key}_low"]))
    return f"~{value:.{int(width < 0.5)}f}"


@pytest.mark.parametrize(
    ("section", "key", "factor", "best_of"),
    [("Success", "success", 100.0, max), ("Time", "restricted_mean_time", 1.0, min)],
)
def test_every_figure_is_that_of_the_file(
    files: tuple[str, list[Row]], section: str, key: str, factor: float, best_of: Any
) -> None:
    text, rows = files
    heading, *lines = table(text, section)
    policies = names_in(rows, "policy")
    assert heading[1 : len(policies) + 1] == policies
    assert [line[0] for line in lines] == names_in(rows, "search")
    for line in lines:
        best = best_of(float(of(rows, policy, line[0])[key]) for policy in policies)
        for policy, cell in zip(policies, line[1:], strict=False):
            row = of(rows, policy, line[0])
            assert cell.strip("*") == shown(row, key, factor)
            assert cell.startswith("**") == (abs(float(row[key]) - best) < 1e-9)


def test_exact_and_sampled_policies_are_marked(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    assert {row["method"] for row in rows} <= {"exact", "conditional"}
    sampled = {row["policy"] for row in rows if row["method"] == "conditional"}
    assert sampled == {"random"} & {*names_in(rows, "policy")}
    for row in rows:
        has_no_interval = row["success_low"] == row["success_high"] == row["success"]
        assert has_no_interval == (row["method"] == "exact")
    for line in table(text, "All searches")[1:]:
        assert ("(" in line[1]) == (line[0] in sampled)
        assert float(line[1].split()[0]) == pytest.approx(100 * mean(rows, line[0]), abs=0.0501)


def test_the_order_is_that_of_the_means(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    pairs = table(text, "Pairwise comparisons")[1:]
    ranked = {name for group in EXPECTED_ORDER for name in group}
    for first, second, verdict, points, _ in pairs:
        difference = 100 * (mean(rows, first) - mean(rows, second))
        assert float(points.split()[0]) == pytest.approx(difference, abs=0.0501)
        assert ("more successful" in verdict) <= (difference > 0)
        assert ("less successful" in verdict) <= (difference < 0)
    expected = [pair for pair in pairs if pair[0] in ranked]
    clear = sum("more successful" in verdict for _, _, verdict, *_ in expected)
    words = paragraphs(text)
    assert re.search(rf"\b{clear} of {len(expected)} pairs? (is|are) in this order", words)
    for first, second, verdict, *_ in expected:
        is_exception = f"{first} is {verdict} than {second}" in words
        assert is_exception == ("less successful" in verdict)


def test_bounds_and_best_known_values(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    words, ratios, trivial = paragraphs(text), [], []
    for search, policy, best, bound, *_ in table(text, "Bounds")[1:]:
        here = [row for row in rows if row["search"] == search]
        largest = max(here, key=lambda row: float(row["success"]))
        assert (policy, best) == (largest["policy"], shown(largest, "success", 100.0))
        limit = float(largest["bound"])
        assert float(bound) == pytest.approx(100 * limit, abs=0.0501)
        ratios.append(float(largest["success"]) / limit)
        trivial += [search] * (limit >= 0.9995)
        for row in here:
            assert float(row["success_low"]) <= float(row["bound"]) + 1e-9
    assert f"The mean ratio is {100 * fmean(ratios):.1f}%." in words
    assert (f"The bound is trivial on {', '.join(trivial)}: 100%." in words) == bool(trivial)
    assert ("is trivial on" in words) == bool(trivial)
    assert "No exact value and no interval lies above a bound." in words


def test_calibration_is_counted(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    lines = table(text, "Calibration")[1:]
    held_by_all = total = 0
    for policy, forecast, found, held, deviation in lines:
        mine = [row for row in rows if row["policy"] == policy]
        holding = sum(
            float(row["sampled_success_low"])
            <= float(row["success"])
            <= float(row["sampled_success_high"])
            for row in mine
        )
        assert held == f"{holding} of {len(mine)}"
        assert float(forecast) == pytest.approx(100 * mean(rows, policy), abs=0.0501)
        share = 100 * mean(rows, policy, "sampled_success")
        assert float(found.split()[0]) == pytest.approx(share, abs=0.0501)
        off = {r["search"]: float(r["sampled_success"]) - float(r["success"]) for r in mine}
        largest = max(off, key=lambda search: abs(off[search]))
        assert deviation == f"{100 * off[largest]:+.1f} ({largest})"
        held_by_all, total = held_by_all + holding, total + len(mine)
    assert {line[0] for line in lines} == {r["policy"] for r in rows if r["method"] == "exact"}
    assert f"{held_by_all} of {total} intervals hold the forecast" in paragraphs(text)
