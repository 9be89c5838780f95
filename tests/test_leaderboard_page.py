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
    return Leaderboard(tuple(bounded), board.added)


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
    (part,) = re.findall(rf"^#+ {section}\n(.*?)(?=^## |\Z)", text, re.M | re.S)
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


def shown(row: Row) -> str:
    value = 100 * float(row["success"])
    if row["method"] == "exact":
        return f"{value:.1f}"
    width = 100 * (float(row["success_high"]) - float(row["success_low"]))
    return f"~{value:.{int(width < 0.5)}f}"


def test_every_figure_is_that_of_the_file(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    heading, *lines = table(text, "Searches")
    policies = names_in(rows, "policy")
    assert heading == ["search", "bound", *policies]
    assert [line[0] for line in lines] == names_in(rows, "search")
    for search, bound, *cells in lines:
        best = max(float(of(rows, policy, search)["success"]) for policy in policies)
        for policy, cell in zip(policies, cells, strict=True):
            row = of(rows, policy, search)
            assert cell.strip("*") == shown(row)
            assert cell.startswith("**") == (abs(float(row["success"]) - best) < 1e-9)
            assert float(bound) == pytest.approx(100 * float(row["bound"]), abs=0.0501)
            assert float(row["success_low"]) <= float(row["bound"]) + 1e-9


def test_the_first_table_has_the_means(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    heading, *lines, bound = table(text, "Leaderboard")
    assert heading == ["policy", "success, %", "gap, points", "time, % of limit"]
    names = [line[0] for line in lines]
    assert names == sorted(names_in(rows, "policy"), key=lambda name: -mean(rows, name))
    for policy, *cells in lines:
        mine = [row for row in rows if row["policy"] == policy]
        times = [float(r["restricted_mean_time"]) / int(r["timestep_limit"]) for r in mine]
        gaps = [float(row["bound"]) - float(row["success"]) for row in mine]
        means = mean(rows, policy), fmean(gaps), fmean(times)
        for cell, mean_value in zip(cells, means, strict=True):
            figure = cell.split()[0].strip("~")
            rounding = 0.0501 if "." in figure else 0.501
            assert float(figure) == pytest.approx(100 * mean_value, abs=rounding)
    assert float(bound[1]) == pytest.approx(100 * mean(rows, policy, "bound"), abs=0.0501)


def test_exact_and_sampled_policies_are_marked(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    assert {row["method"] for row in rows} <= {"exact", "conditional"}
    sampled = {row["policy"] for row in rows if row["method"] == "conditional"}
    assert sampled == {"random"} & {*names_in(rows, "policy")}
    for row in rows:
        has_no_interval = row["success_low"] == row["success_high"] == row["success"]
        assert has_no_interval == (row["method"] == "exact")
    for policy, *cells in table(text, "Leaderboard")[1:]:
        for cell in cells:
            assert bool(re.search(r"~|\(", cell)) == (policy in sampled)


def test_the_order_is_that_of_the_means(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    pairs = table(text, "Pairwise comparisons")[1:]
    ranked = {name for group in EXPECTED_ORDER for name in group}
    clear = total = 0
    for first, second, points, _ in pairs:
        difference = 100 * (mean(rows, first) - mean(rows, second))
        assert float(points.split()[0].strip("~")) == pytest.approx(difference, abs=0.0501)
        total += first in ranked
        clear += first in ranked and difference > 0
        is_exception = f"{first} is less successful" in paragraphs(text)
        assert not is_exception or difference < 0
    assert re.search(rf"\b{clear} of {total} pairs? (is|are) in this order", paragraphs(text))


def test_bounds_and_best_known_values(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    words, ratios, trivial, confidences = paragraphs(text), [], [], []
    for search in names_in(rows, "search"):
        here = [row for row in rows if row["search"] == search]
        limit = float(here[0]["bound"])
        ratios.append(max(float(row["success"]) for row in here) / limit)
        trivial += [search] * (limit >= 0.9995)
        confidences.append(float(here[0]["bound_confidence"]))
        assert 0.0 <= float(here[0]["bound_gap"]) < limit
    assert f"the best policy of a search reaches {100 * fmean(ratios):.1f}% of the bound" in words
    assert (f"The bound is trivial on {', '.join(trivial)}: 100%." in words) == bool(trivial)
    assert ("is trivial on" in words) == bool(trivial)
    together = 1.0 - sum(1.0 - each for each in confidences)
    assert (
        f"All bounds hold simultaneously with at least {100 * together:.4g}% confidence." in words
    )
    assert "No exact value and no interval lies above a bound." in words


def test_calibration_is_counted(files: tuple[str, list[Row]]) -> None:
    text, rows = files
    holds = [
        float(row["sampled_success_low"])
        <= float(row["success"])
        <= float(row["sampled_success_high"])
        for row in rows
        if row["method"] == "exact"
    ]
    assert f"{sum(holds)} of {len(holds)} contain the exact success" in paragraphs(text)


def test_the_published_page_is_short_and_has_its_plots() -> None:
    text, _ = files_of(PUBLISHED)
    assert len(text.split()) < 1450
    plots = re.findall(r"!\[[^\]]{40,}\]\((\S+)\)", text)
    assert plots == [f"{name}-light.svg" for name in page.PLOTS]
    if not list(PUBLISHED.glob("*.svg")):
        pytest.skip("the sdist leaves out the pictures")
    for name in page.PLOTS:
        for theme in ("light", "dark"):
            assert 5_000 < (PUBLISHED / f"{name}-{theme}.svg").stat().st_size < 150_000
