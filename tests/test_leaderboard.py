"""The leaderboard: summaries, comparisons, page, files and command."""

from __future__ import annotations

import csv
import json
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import bound_by_time, tables_of

from DroneSwarmSearch import Action
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.evaluation import (
    SUITE,
    Episodes,
    Estimate,
    Evaluation,
    StorageError,
    bounds,
    leaderboard,
    page,
    run,
)
from DroneSwarmSearch.evaluation.board import EXPECTED_ORDER, Leaderboard, PairwiseComparison
from DroneSwarmSearch.evaluation.episodes import Reliability
from DroneSwarmSearch.evaluation.statistics import ExactValue
from DroneSwarmSearch.evaluation.store import Store
from DroneSwarmSearch.planning import SuccessBound
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.scenario import Cell, Scenario

SHORT = ["--episodes", "30", "--searches", "pond", "harbour", "--workers", "1"]
FEW = ["--policies", "greedy-matrix", "random"]

IDLER = """\
import numpy as np

def idle(observations):
    return np.full(observations["positions"].shape[:2], 5)
"""


@pytest.fixture(autouse=True)
def _quick_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the slow bounds: all persons may be found from step 10 on."""

    def quick(scenario: Scenario, drones: object, *, report: object) -> SuccessBound:
        by_time = (np.arange(scenario.timestep_limit + 1) >= 10) * 0.875
        return bound_by_time(by_time, gap=0.004, confidence=0.9999)

    monkeypatch.setattr(bounds, "success_bound", quick)


@pytest.fixture
def _no_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the plots, which take longest."""
    monkeypatch.setattr(page, "_draw", lambda board, out: [])


@pytest.fixture
def idler(tmp_path: Path) -> str:
    """A policy in a file."""
    (tmp_path / "idler.py").write_text(IDLER, "utf-8")
    return f"{tmp_path / 'idler.py'}:idle"


def made_up(
    policy: str,
    search: str,
    successes: int,
    *,
    step: int = 10,
    bound: float | None = None,
    exact: float | None = None,
) -> Evaluation:
    """100 episodes, of which the first succeed in one step; with an exact success from there on."""
    where = SUITE[search]
    limit = where.scenario.timestep_limit
    found = np.zeros((100, len(where.scenario.situation)), np.int64)
    found[:successes] = step
    endings = np.where(found[:, 0] > 0, 1, 4)
    episodes = Episodes(found, endings, np.full(100, limit), np.zeros(100), Reliability.empty())
    known = None
    if bound is not None:
        known = bound_by_time(np.full(limit + 1, bound), gap=0.001, confidence=1.0)
    curve = None if exact is None else (np.arange(limit + 1) >= step) * exact
    return Evaluation(policy, where, 0, "swarm", "dict", episodes, known, curve)


class TestFigures:
    def test_searches_have_equal_weight_and_times_are_relative_to_the_limit(self) -> None:
        board = Leaderboard(
            (
                made_up("planner", "pond", 80, step=10, bound=1.0),
                made_up("planner", "night", 40, step=50, bound=0.5),
            )
        )
        (summary,) = board.summaries
        assert summary.success.value == pytest.approx((0.8 + 0.4) / 2)
        pond, night = (SUITE[name].scenario.timestep_limit for name in ("pond", "night"))
        times = 0.8 * 10 / pond + 0.2, 0.4 * 50 / night + 0.6
        assert summary.time.value == pytest.approx(sum(times) / 2)
        assert summary.gap is not None
        assert summary.gap.value == pytest.approx((1.0 + 0.5) / 2 - (0.8 + 0.4) / 2)
        assert summary.gap.high - summary.gap.value == pytest.approx(
            summary.success.value - summary.success.low
        )
        assert summary.success.low < summary.success.value < summary.success.high

    def test_differences_are_paired(self) -> None:
        # The first policy succeeds wherever the second does.
        board = Leaderboard(
            (made_up("planner", "pond", 52), made_up("greedy-posterior", "pond", 42))
        )
        (pair,) = board.comparisons
        assert (pair.first, pair.second) == ("planner", "greedy-posterior")
        assert pair.success.value == pytest.approx(0.1)
        apart = board.summaries[0].success.high - board.summaries[0].success.low
        assert pair.success.high - pair.success.low < 0.75 * apart
        assert pair.verdict == "more successful, faster"

    def test_policies_are_compared_with_those_expected_next(self) -> None:
        names = ["mine", "planner", "greedy-matrix", "sector-search", "random", "ppo"]
        board = Leaderboard(tuple(made_up(name, "pond", 50) for name in names), ("mine",))
        assert [(pair.first, pair.second) for pair in board.comparisons] == [
            ("mine", "planner"),
            ("mine", "greedy-matrix"),
            ("ppo", "planner"),
            ("ppo", "greedy-matrix"),
            ("planner", "greedy-matrix"),
            ("planner", "sector-search"),
            ("greedy-matrix", "random"),
            ("sector-search", "random"),
        ]
        ranked = [name for group in EXPECTED_ORDER for name in group]
        assert len({*ranked}) == len(ranked)
        assert {*POLICIES} - {*ranked} == {"ppo"}

    def test_exact_values_are_compared_without_intervals(self) -> None:
        board = Leaderboard(
            (
                made_up("planner", "pond", 52, exact=0.5),
                made_up("greedy-posterior", "pond", 60, exact=0.4),
                made_up("greedy-matrix", "pond", 60, exact=0.4 + 1e-11),
                made_up("random", "pond", 10),
            )
        )
        first, second, third = board.comparisons
        assert first.success == ExactValue.of(0.5 - 0.4)
        assert first.verdict == "more successful, faster"
        assert second.verdict == "equal"
        matrix, random = (board.by_name[name, "pond"] for name in ("greedy-matrix", "random"))
        assert not third.success.is_exact
        assert third.success.low == pytest.approx(matrix.success.value - random.success.high)
        best = board.best_known("pond")
        assert (best.policy, best.success.value) == ("planner", 0.5)
        planner, *_, last = board.summaries
        assert planner.success.is_exact
        assert not last.success.is_exact

    def test_calibration_counts_the_intervals_of_exact_policies(self) -> None:
        board = Leaderboard(
            (
                made_up("planner", "pond", 52, exact=0.5),
                made_up("random", "pond", 10),
                made_up("planner", "fog", 80, exact=0.6),  # outside the interval
                made_up("random", "fog", 10),
                made_up("planner", "night", 0, exact=0.0),
                made_up("random", "night", 10),
            )
        )
        assert board.calibration == (2, 3)

    def test_one_interval_in_twenty_misses_a_true_forecast(self) -> None:
        """By the binomial distribution, without an evaluation."""
        rng = np.random.default_rng(0)
        truths = rng.uniform(0.05, 0.95, 2000)
        counts = rng.binomial(100, truths).tolist()
        made = [
            made_up("planner", "pond", count, exact=truth)
            for count, truth in zip(counts, truths.tolist(), strict=True)
        ]
        holding, total = Leaderboard(tuple(made)).calibration
        assert total == 2000
        assert 1860 <= holding <= 1940

    @pytest.mark.parametrize(
        ("success", "time", "verdict"),
        [
            ((0.1, 0.05, 0.2), (-0.1, -0.2, -0.05), "more successful, faster"),
            ((0.1, 0.05, 0.2), (0.0, -0.1, 0.1), "more successful"),
            ((0.0, -0.1, 0.1), (-0.1, -0.2, -0.05), "faster"),
            ((0.0, -0.1, 0.1), (0.1, 0.05, 0.2), "slower"),
            ((0.0, -0.1, 0.1), (0.0, -0.1, 0.1), "not clearly different"),
            ((-0.1, -0.2, -0.05), (-0.1, -0.2, -0.05), "less successful, faster"),
        ],
    )
    def test_verdicts_follow_from_the_intervals(
        self, success: tuple[float, ...], time: tuple[float, ...], verdict: str
    ) -> None:
        assert PairwiseComparison("a", "b", Estimate(*success), Estimate(*time)).verdict == verdict

    def test_policies_above_the_bound_are_named(self) -> None:
        within = made_up("planner", "pond", 80, bound=0.75)
        above = made_up("random", "pond", 80, bound=0.5)
        board = Leaderboard((within, above))
        assert board.above_bound == (above,)
        text = " ".join(page.markdown(board, "command").split())
        assert "Above the bound: random on pond." in text


class TestPage:
    def test_tables_hold_the_results(self) -> None:
        board = Leaderboard(
            (
                made_up("planner", "pond", 80, bound=0.9),
                made_up("random", "pond", 20, bound=0.9),
                made_up("planner", "fog", 50, bound=0.8),
                made_up("random", "fog", 50, bound=0.8),
            )
        )
        text = page.markdown(board, "python -m something")
        suite, overview, order = tables_of(text)
        assert suite[0] == ["policy", "success, %", "gap, points", "time, % of limit"]
        assert [row[0] for row in suite[1:]] == ["planner", "random", "bound"]
        assert suite[1][1].startswith("65.0 (")
        assert suite[1][2:] == ["~20", "~48"]
        assert suite[3] == ["bound", "85.0", "", ""]
        assert overview == [
            ["search", "bound", "planner", "random"],
            ["pond", "90.0", "**~80**", "~20"],
            ["fog", "80.0", "**~50**", "**~50**"],
        ]
        assert order[1][:2] == ["planner", "random"]
        assert order[1][2].startswith("+30.0 (+")
        assert order[1][3].startswith("-")
        assert "```sh\npython -m something\n```" in text
        assert "Figures are estimates" in text.replace("\n", " ")
        for search in board.searches:
            sentence = search.reason.split(". ")[0]
            assert f"- **{search.name}**: {sentence} (" in " ".join(text.split())
        assert "(10 x 10 cells, 1 drone, 40 steps)." in text.replace("\n  ", " ")

    def test_exact_figures_have_no_interval_and_sampled_ones_no_noise(self) -> None:
        board = Leaderboard(
            (
                made_up("planner", "pond", 81, exact=0.804, bound=0.9),
                made_up("random", "pond", 20, bound=0.9),
                made_up("planner", "fog", 57, exact=0.508, bound=1.0),
                made_up("random", "fog", 60, bound=1.0),
            )
        )
        text = page.markdown(board, "command")
        suite, overview, order = tables_of(text)
        assert overview[1:] == [
            ["pond", "90.0", "**80.4**", "~20"],
            ["fog", "100.0", "50.8", "**~60**"],
        ]
        time = ((10 + 0.196 * 30) / 40 + (10 + 0.492 * 90) / 100) / 2
        assert suite[1][1:] == ["65.6", "29.4", f"{100 * time:.1f}"]
        assert suite[2][1].startswith("40.0 (")
        assert order[1][2].startswith("+25.6 (+")
        words = " ".join(text.split())
        assert "are exact (no sampling error), except estimates" in words
        assert "2 of 2 contain the exact success" in words
        assert "The bound is trivial on fog: 100%." in words
        assert "the best policy of a search reaches 74.7% of the bound" in words  # 80.4/90, 60/100
        assert "The bounds are exact. No exact value and no interval lies above a bound." in words

    def test_narrow_intervals_become_a_tilde(self) -> None:
        limit = SUITE["pond"].scenario.timestep_limit
        curves = np.full((2000, limit + 1), 0.3)
        curves[::2] += 0.01
        sampled = replace(made_up("random", "pond", 50), conditional=curves)
        board = Leaderboard((made_up("planner", "pond", 80, exact=0.8), sampled))
        assert 0.0 < 100 * (sampled.success.high - sampled.success.low) < 0.5
        suite, _, order = tables_of(page.markdown(board, "command"))
        assert suite[2][1] == "~30.5"
        assert order[1][2] == "~+49.5"

    def test_exceptions_to_the_expected_order_are_named(self) -> None:
        names = ("planner", "greedy-posterior", "greedy-matrix", "random")
        made = [made_up(name, "pond", 9, exact=0.5 - 0.1 * k) for k, name in enumerate(names)]
        text = " ".join(page.markdown(Leaderboard(tuple(made)), "command").split())
        assert "The expected order is planner; greedy-posterior; greedy-matrix; random:" in text
        assert "3 of 3 pairs are in this order. Differences" in text
        made[1] = made_up("greedy-posterior", "pond", 9, exact=0.6, step=20)
        text = " ".join(page.markdown(Leaderboard(tuple(made)), "command").split())
        assert (
            "2 of 3 pairs are in this order; planner is less successful, faster than "
            "greedy-posterior." in text
        )

    def test_the_confidence_is_that_of_all_bounds_together(self) -> None:
        made = [made_up("planner", name, 9, exact=0.5) for name in ("pond", "fog", "night")]
        bounds = [bound_by_time(np.full(each.limit + 1, 0.9), confidence=0.999) for each in made]
        bounded = [each.with_bound(bound) for each, bound in zip(made, bounds, strict=True)]
        text = " ".join(page.markdown(Leaderboard(tuple(bounded)), "command").split())
        assert "All bounds hold simultaneously with at least 99.7% confidence." in text

    def test_without_bounds_the_page_does_not_mention_them(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80), made_up("random", "pond", 20)))
        text = page.markdown(board, "command")
        assert not re.search("bound|gap", text.lower())

    def test_tables_are_aligned_as_plain_text(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80), made_up("random", "pond", 5)))
        for block in re.findall(r"(?:^\|.*\|\n)+", page.markdown(board, "command"), re.MULTILINE):
            lines = block.splitlines()
            assert len({len(line) for line in lines}) == 1
            bars = {tuple(m.start() for m in re.finditer(r"\|", line)) for line in lines}
            assert len(bars) == 1

    def test_the_page_shows_existing_plots_with_alternative_texts(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80),))
        for names in ({"success"}, {"success", "time"}):
            text = page.markdown(board, "command", names)
            assert {*re.findall(r"!\[(.+)\]\((.+)\)", text)} == {
                (page.PLOTS[name], f"{name}-light.svg") for name in names
            }


class TestRun:
    def test_a_rerun_loads_everything_from_the_store(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        played: list[object] = []
        honest = run.play

        def counted(*arguments: Any) -> Episodes:
            played.append(arguments[2])
            return honest(*arguments)

        monkeypatch.setattr(run, "play", counted)
        limited: list[object] = []
        quick: Callable[..., SuccessBound] = bounds.success_bound

        def bounded(scenario: Scenario, drones: tuple[Cell, ...], **more: Any) -> SuccessBound:
            limited.append(scenario)
            return quick(scenario, drones, **more)

        monkeypatch.setattr(bounds, "success_bound", bounded)

        def board(*policies: str) -> Leaderboard:
            store = Store(tmp_path)
            return leaderboard(policies, ["pond", "fog"], episodes=20, store=store, progress=False)

        first = board("random")
        assert (len(played), len(limited)) == (2, 2)
        again = board("random")
        assert (len(played), len(limited)) == (2, 2)
        for one, other in zip(first.evaluations, again.evaluations, strict=True):
            assert one.data == other.data
        board("random", "sector-search")
        assert (len(played), len(limited)) == (4, 2)

    def test_every_policy_plays_the_same_episodes_and_has_the_bound(self) -> None:
        board = leaderboard(
            ["random", "sector-search"], ["pond", SUITE["fog"]], episodes=7, seed=3, progress=False
        )
        assert board.policies == ("random", "sector-search")
        assert [each.name for each in board.searches] == ["pond", "fog"]
        for each in board.evaluations:
            assert (each.seed, len(each.episodes)) == (3, 7)
            assert each.bound is not None
            assert each.bound.by_time[-1] == 0.875

    def test_policies_have_the_expected_order(self) -> None:
        best, *ranked = [name for group in EXPECTED_ORDER for name in group if name in POLICIES]
        contest = leaderboard(searches=["pond"], episodes=1, bounds=False, progress=False)
        assert list(contest.policies) == [best, "ppo", *ranked]

    def test_an_added_policy_can_see_the_posterior(self) -> None:
        def stay(seen: dict[str, np.ndarray]) -> np.ndarray:
            return np.full(seen["positions"].shape[:2], int(Action.SEARCH))

        board = leaderboard(
            ["random"], ["pond"], added=[stay], posterior=True, episodes=2, bounds=False,
            progress=False,
        )  # fmt: skip
        shown = {each.policy: each.search.scenario.bayesian_update for each in board.evaluations}
        assert shown == {"stay": True, "random": False}

    @pytest.mark.slow
    @pytest.mark.usefixtures("_no_plots")
    def test_workers_have_no_effect(self, tmp_path: Path) -> None:
        texts = []
        for workers in ("1", "2"):
            out = tmp_path / workers
            short = [*SHORT[:-1], workers, "--no-bound"]
            assert command.main(["leaderboard", *short, *FEW, "--out", str(out)]) == 0
            texts.append((out / "leaderboard.csv").read_text("utf-8"))
        assert texts[0] == texts[1]

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            ({"policies": []}, "policies must be at least one"),
            ({"policies": ["random", "random"]}, "all be different, got more than once: random"),
            ({"searches": ["pond", "fog", "pond"]}, "all be different, got more than once: pond"),
            ({"policies": ["randm"]}, "did you mean random"),
            ({"searches": ["pnd"]}, "did you mean pond"),
            ({"episodes": 0}, "episodes must be an integer of at least 1, got 0"),
            ({"view": "foo"}, "view must be one of 'swarm', 'drone', 'parallel', got 'foo'"),
            ({"observation": "bar"}, "observation must be one of 'dict'.*, got 'bar'"),
            ({"view": "parallel", "observation": "flat"}, "view='parallel' needs observation"),
            ({"added": ["own=random"], "view": "drone"}, "view must be 'swarm' or 'parallel'"),
            ({"view": 3}, "view must be one of .*, got 3"),
            ({"posterior": "yes"}, "posterior must be True or False, got 'yes'"),
            ({"bounds": 1}, "bounds must be True or False, got 1"),
            ({"policies": "random"}, "policies must be a list, got 'random'"),
            ({"policies": 3}, "policies must be a list, got 3"),
            ({"searches": 2.5}, "searches must be a list, got 2.5"),
            ({"episodes": 10**14}, "episodes must be smaller: with episodes=10{14}, .*GiB"),
            ({"searches": "pond"}, "searches must be a list, got 'pond'"),
            ({"added": "mine.py:act"}, "added must be a list, got 'mine.py:act'"),
        ],
    )
    def test_bad_input_is_refused(self, arguments: dict[str, Any], words: str) -> None:
        with pytest.raises((TypeError, ValueError), match=words):
            leaderboard(**{"searches": ["pond"], "episodes": 1, **arguments}, progress=False)


class TestCommand:
    def test_it_prints_and_writes_everything(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        pytest.importorskip("matplotlib")
        out = tmp_path / "out"
        assert command.main(["leaderboard", *SHORT, *FEW, "--out", str(out)]) == 0
        output = capsys.readouterr().out
        text = (out / "leaderboard.md").read_text("utf-8")
        data = json.loads((out / "leaderboard.json").read_text("utf-8"))
        with (out / "leaderboard.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))

        words = " ".join(text.split())
        assert "except estimates, which have a tilde or a 95% confidence interval." in words
        assert "Estimates are means over sampled paths of the probability of success" in words
        tasks = [(each["policy"], each["search"]) for each in data["evaluations"]]
        assert tasks == [
            (policy, search)
            for search in ("pond", "harbour")
            for policy in ("greedy-matrix", "random")
        ]
        assert [(row["policy"], row["search"]) for row in rows] == tasks
        _, overview, _ = tables_of(text)
        for row, each in zip(rows, data["evaluations"], strict=True):
            assert float(row["success"]) == each["success"]["value"]
            value = 100 * each["success"]["value"]
            width = 100 * (each["success"]["high"] - each["success"]["low"])
            shown = f"~{value:.{int(width < 0.5)}f}"
            if each["success"]["exact"]:
                shown = f"{value:.1f}"
            assert each["success"]["exact"] == (each["policy"] == "greedy-matrix")
            assert row["method"] == ("exact" if each["success"]["exact"] else "conditional")
            (line,) = [line for line in overview if line[0] == each["search"]]
            place = overview[0].index(each["policy"])
            assert line[place].strip("*") == shown
            assert shown in output
        assert data["command"] in text
        assert data["command"].startswith("python -m DroneSwarmSearch leaderboard --episodes 30")
        for name in page.PLOTS:
            assert f"({name}-light.svg)" in text
            for theme in ("light", "dark"):
                assert (out / f"{name}-{theme}.svg").stat().st_size > 5_000
        assert not list(out.glob(".*"))

    @pytest.mark.usefixtures("_no_plots")
    def test_an_added_policy_has_a_row(self, tmp_path: Path, idler: str) -> None:
        out = tmp_path / "out"
        arguments = ["--episodes", "5", "--searches", "pond", "--workers", "1", "--no-bound"]
        assert (
            command.main(["leaderboard", *arguments, *FEW, "--add", idler, "--out", str(out)]) == 0
        )
        suite, overview, order = tables_of((out / "leaderboard.md").read_text("utf-8"))
        assert overview[0] == ["search", idler, "greedy-matrix", "random"]
        assert overview[1][1] == "~0"
        assert [row[0] for row in suite[1:]] == ["greedy-matrix", "random", idler]  # best first
        assert suite[3][1] == "0.0 (0.0-43.4)"
        assert order[1][:2] == [idler, "greedy-matrix"]

    def test_without_matplotlib_there_are_tables_and_a_hint(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        for name in ("plots", "plot_style"):
            monkeypatch.delitem(sys.modules, f"DroneSwarmSearch.evaluation.{name}", raising=False)
            monkeypatch.delattr(f"DroneSwarmSearch.evaluation.{name}", raising=False)
        assert command.main(["leaderboard", *SHORT, *FEW, "--out", str(tmp_path)]) == 0
        assert "pip install" in capsys.readouterr().err
        assert "![" not in (tmp_path / "leaderboard.md").read_text("utf-8")
        assert not list(tmp_path.glob("*.svg"))

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["--searches", "pnd"], "did you mean pond"),
            (["--policies", "planer"], "did you mean planner"),
            (["--episodes", "0"], "episodes must be an integer of at least 1, got 0"),
            (["--workers", "0"], "--workers: must be an integer of at least 1, got '0'"),
            (["--add", "nowhere.py:policy"], "'nowhere.py' does not exist"),
        ],
    )
    def test_wrong_arguments_are_refused_before_any_work(
        self,
        arguments: list[str],
        words: str,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        out = tmp_path / "out"
        with pytest.raises(SystemExit) as stop:
            command.main(["leaderboard", *arguments, "--out", str(out)])
        assert stop.value.code == 2
        assert words in capsys.readouterr().err
        assert not out.exists()

    @pytest.mark.usefixtures("_no_plots")
    def test_an_interruption_keeps_finished_work(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        honest, played = run.play, 0

        def interrupted(*arguments: Any) -> Episodes:
            nonlocal played
            played += 1
            if played == 3:
                raise KeyboardInterrupt
            return honest(*arguments)

        monkeypatch.setattr(run, "play", interrupted)
        arguments = [*SHORT, *FEW, "--no-bound", "--out", str(tmp_path)]
        assert command.main(["leaderboard", *arguments]) == 130
        output = capsys.readouterr().err
        assert "interrupted" in output
        assert str(tmp_path / "portions") in output
        # The exact values of two tasks, two portions, and the conditional success of one.
        assert len(Store(tmp_path / "portions")) == 5
        assert command.main(["leaderboard", *arguments]) == 0
        # Four tasks, of which two were stored; one was interrupted.
        assert played == 3 + 2

    def test_a_full_disk_is_reported(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        def full(self: Store, key: Mapping[str, Any], entry: object) -> None:
            raise StorageError(28, "No space left on device", str(self.directory))

        monkeypatch.setattr(Store, "save", full)
        assert (
            command.main(["leaderboard", *SHORT, *FEW, "--no-bound", "--out", str(tmp_path)]) == 1
        )
        output = capsys.readouterr().err
        assert "No space left on device" in output
        assert "Traceback" not in output
