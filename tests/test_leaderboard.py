"""The leaderboard: summaries, comparisons, page, files and command."""

from __future__ import annotations

import csv
import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import tables_of

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
from DroneSwarmSearch.evaluation.board import THEORY, Leaderboard, PairwiseComparison
from DroneSwarmSearch.evaluation.episodes import Reliability
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
        return SuccessBound(by_time, 0.875, 0.004, 0.9999)

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
    policy: str, search: str, successes: int, *, step: int = 10, bound: float | None = None
) -> Evaluation:
    """100 episodes, of which the first succeed in one step."""
    where = SUITE[search]
    limit = where.scenario.timestep_limit
    found = np.zeros((100, len(where.scenario.situation)), np.int64)
    found[:successes] = step
    endings = np.where(found[:, 0] > 0, 1, 4)
    episodes = Episodes(found, endings, np.full(100, limit), np.zeros(100), Reliability.empty())
    known = None
    if bound is not None:
        known = SuccessBound(np.full(limit + 1, bound), bound, 0.001, 1.0)
    return Evaluation(policy, where, 0, "swarm", "dict", episodes, known)


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
        assert summary.share_of_bound is not None
        assert summary.share_of_bound.value == pytest.approx((0.8 / 1.0 + 0.4 / 0.5) / 2)
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

    def test_policies_are_compared_with_the_next_group_of_theory(self) -> None:
        names = ["mine", "planner", "greedy-matrix", "sector-search", "random"]
        board = Leaderboard(tuple(made_up(name, "pond", 50) for name in names), ("mine",))
        assert [(pair.first, pair.second) for pair in board.comparisons] == [
            ("mine", "planner"),
            ("planner", "greedy-matrix"),
            ("planner", "sector-search"),
            ("greedy-matrix", "random"),
            ("sector-search", "random"),
        ]
        assert sorted(name for rank in THEORY for name in rank) == sorted(POLICIES)

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
        assert "Intervals above the bound: random on pond." in text


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
        overview, suite, order, limits, pond, _ = tables_of(text)
        assert overview == [
            ["search", "planner", "random", "bound"],
            ["pond", "**80.0**", "20.0", "90.0"],
            ["fog", "**50.0**", "**50.0**", "80.0"],
        ]
        assert [row[0] for row in suite] == ["policy", "planner", "random"]
        assert suite[1][1].startswith("65.0 (")
        assert order[1][:2] == ["planner", "random"]
        assert order[1][2] == "more successful, faster"
        assert order[1][3].startswith("+30.0 (+")
        assert order[1][4].startswith("-")
        assert limits[1] == ["pond", "90.0", "0.10", "exact"]
        success = board.by_name["planner", "pond"].success
        assert pond[1][1] == f"80.0 ({100 * success.low:.1f}-{100 * success.high:.1f})"
        assert pond[1][3].startswith(f"{80 / 0.9:.1f} (")
        assert "```sh\npython -m something\n```" in text
        for search in board.searches:
            assert f"### {search.name}\n" in text
            assert search.reason.split(",")[0] in text.replace("\n", " ")

    def test_without_bounds_the_page_does_not_mention_them(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80), made_up("random", "pond", 20)))
        text = page.markdown(board, "command")
        assert "bound" not in text.replace("share of bound", "bound").lower()

    def test_the_page_states_what_the_network_was_trained_with(self) -> None:
        packaged = Leaderboard((made_up("ppo", "pond", 40),))
        assert "an earlier drift model" in page.markdown(packaged, "command")
        own = Leaderboard((made_up("ppo", "pond", 40),), ("ppo",))
        assert "an earlier drift model" not in page.markdown(own, "command")

    def test_tables_are_aligned_as_plain_text(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80), made_up("random", "pond", 5)))
        for block in re.findall(r"(?:^\|.*\|\n)+", page.markdown(board, "command"), re.MULTILINE):
            lines = block.splitlines()
            assert len({len(line) for line in lines}) == 1
            bars = {tuple(m.start() for m in re.finditer(r"\|", line)) for line in lines}
            assert len(bars) == 1

    def test_the_page_shows_existing_plots_with_alternative_texts(self) -> None:
        board = Leaderboard((made_up("planner", "pond", 80),))
        text = page.markdown(board, "command", {"success", "episode"})
        assert re.findall(r"!\[(.+)\]\((.+)\)", text) == [
            (page.PLOTS[name], f"{name}.png") for name in ("success", "episode")
        ]


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
        # Two tasks, and the one with the posterior.
        assert (len(played), len(limited)) == (3, 2)
        again = board("random")
        assert (len(played), len(limited)) == (3, 2)
        for one, other in zip(first.evaluations, again.evaluations, strict=True):
            assert one.data == other.data
        board("random", "sector-search")
        assert (len(played), len(limited)) == (5, 2)

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
        assert board.posterior is not None
        assert board.posterior.search.scenario.bayesian_update

    def test_policies_have_the_order_of_theory(self) -> None:
        ranked = [name for rank in THEORY for name in rank]
        contest = leaderboard(searches=["pond"], episodes=1, bounds=False, progress=False)
        assert list(contest.policies) == ranked

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

        tasks = [(each["policy"], each["search"]) for each in data["evaluations"]]
        assert tasks == [
            (policy, search)
            for search in ("pond", "harbour")
            for policy in ("greedy-matrix", "random")
        ]
        assert [(row["policy"], row["search"]) for row in rows] == tasks
        (overview, *_) = tables_of(text)
        for row, each in zip(rows, data["evaluations"], strict=True):
            assert float(row["success"]) == each["success"]["value"]
            shown = f"{100 * each['success']['value']:.1f}"
            (line,) = [line for line in overview if line[0] == each["search"]]
            place = overview[0].index(each["policy"])
            assert line[place].strip("*") == shown
            assert shown in output
        assert data["command"] in text
        assert data["command"].startswith("python -m DroneSwarmSearch leaderboard --episodes 30")
        for name in page.PLOTS:
            assert f"({name}.png)" in text
            assert (out / f"{name}.png").stat().st_size > 5_000
            assert (out / f"{name}.svg").stat().st_size > 5_000
        assert not list(out.glob(".*"))

    @pytest.mark.usefixtures("_no_plots")
    def test_an_added_policy_has_a_row(self, tmp_path: Path, idler: str) -> None:
        out = tmp_path / "out"
        arguments = ["--episodes", "5", "--searches", "pond", "--workers", "1", "--no-bound"]
        assert (
            command.main(["leaderboard", *arguments, *FEW, "--add", idler, "--out", str(out)]) == 0
        )
        overview, suite, order, *_ = tables_of((out / "leaderboard.md").read_text("utf-8"))
        assert overview[0] == ["search", idler, "greedy-matrix", "random"]
        assert overview[1][1] == "0.0"
        assert suite[1][:2] == [idler, "0.0 (0.0-43.4)"]
        assert order[1][:2] == [idler, "greedy-matrix"]

    def test_without_matplotlib_there_are_tables_and_a_hint(
        self,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        for name in ("maps", "plots", "plot_style"):
            monkeypatch.delitem(sys.modules, f"DroneSwarmSearch.evaluation.{name}", raising=False)
            monkeypatch.delattr(f"DroneSwarmSearch.evaluation.{name}", raising=False)
        assert command.main(["leaderboard", *SHORT, *FEW, "--out", str(tmp_path)]) == 0
        assert "pip install" in capsys.readouterr().err
        assert "![" not in (tmp_path / "leaderboard.md").read_text("utf-8")
        assert not list(tmp_path.glob("*.png"))

    @pytest.mark.parametrize(
        ("arguments", "words"),
        [
            (["--searches", "pnd"], "did you mean pond"),
            (["--policies", "planer"], "did you mean planner"),
            (["--episodes", "0"], "episodes must be an integer of at least 1, got 0"),
            (["--workers", "0"], "--workers: must be an integer of at least 1, got '0'"),
            (["--add", "nowhere.py:policy"], "there is no 'nowhere.py'"),
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
        assert len(Store(tmp_path / "portions")) == 2
        assert command.main(["leaderboard", *arguments]) == 0
        # Five tasks, of which two were stored; one was interrupted.
        assert played == 3 + 3

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
