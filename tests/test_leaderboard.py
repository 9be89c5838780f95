"""The leaderboard: summaries, tables, files and command."""

import csv
import re
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from helpers import bound_by_time, made_evaluation

from DroneSwarmSearch import Action, Scenario
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.evaluation import SUITE, View, evaluate, leaderboard, mean_of, run
from DroneSwarmSearch.evaluation.board import Leaderboard
from DroneSwarmSearch.planning import SuccessBound

SHORT = ["--episodes", "30", "--searches", "pond", "harbour", "--workers", "1"]
FEW = ["--policies", "greedy-matrix", "random"]

IDLER = """\
import numpy as np

def idle(observations):
    return np.full(observations["positions"].shape[:2], 5)
"""


@pytest.fixture(autouse=True)
def _quick_bounds(monkeypatch):
    """Replace the slow bounds: all persons may be found from step 10 on."""

    def quick(scenario: Scenario, drones: object) -> SuccessBound:
        by_time = (np.arange(scenario.timestep_limit + 1) >= 10) * 0.875
        return bound_by_time(by_time, gap=0.004, confidence=0.9999)

    monkeypatch.setattr(run, "success_bound", quick)


@pytest.fixture
def idler(tmp_path):
    """A policy in a file."""
    (tmp_path / "idler.py").write_text(IDLER, "utf-8")
    return f"{tmp_path / 'idler.py'}:idle"


def board_of(*rows: tuple[str, str, int, int], bound: float | None = None, **made: Any) -> Any:
    """A leaderboard of rows with policy, search, finds in 100 episodes, and their step."""
    several = []
    for policy, search, finds, step in rows:
        found = np.zeros((100, len(SUITE[search].scenario.persons_to_find)), np.int64)
        found[:finds] = step
        several.append(made_evaluation(found, SUITE[search], policy=policy, bound=bound, **made))
    return Leaderboard(several)


def test_tables_show_the_best_first():
    board = board_of(
        ("random", "pond", 20, 10),
        ("planner", "pond", 50, 10),
        ("random", "fog", 40, 10),
        ("planner", "fog", 30, 10),
        bound=0.9,
        is_exact=True,
    )
    assert [row[:3] for row in board.summary_table] == [
        ["policy", "success, %", "gap, points"],
        ["planner", "40.0", "50.0"],
        ["random", "30.0", "60.0"],
        ["bound", "90.0", ""],
    ]
    assert board.search_table == [
        ["search", "bound", "planner", "random"],
        ["pond", "90.0", "50.0*", "20.0"],
        ["fog", "90.0", "30.0", "40.0*"],
    ]


def test_a_rerun_reads_everything_from_the_folder(tmp_path, monkeypatch):
    calls = {}
    for name in ("roll_out", "success_bound"):
        calls[name] = Mock(wraps=getattr(run, name))
        monkeypatch.setattr(run, name, calls[name])

    def board(*policies: str) -> Leaderboard:
        where = ["pond", "fog"]
        return leaderboard(policies, where, episodes=20, out=tmp_path, progress=False)

    first = board("random")
    again = board("random")
    assert [each.call_count for each in calls.values()] == [2, 2]
    for one, other in zip(first.evaluations, again.evaluations, strict=True):
        assert one.summary == other.summary
    board("random", "sector-search")
    assert [each.call_count for each in calls.values()] == [8, 2]


def test_an_added_policy_can_see_the_posterior():
    def stay(seen: dict[str, np.ndarray]) -> np.ndarray:
        return np.full(seen["positions"].shape[:2], int(Action.SEARCH))

    board = leaderboard(
        ["random"], ["pond"], added=[stay], view=View(bayesian_update=True), episodes=2,
        bounds=False, progress=False,
    )  # fmt: skip
    shown = {each.policy: each.search.scenario.bayesian_update for each in board.evaluations}
    assert shown == {"stay": True, "random": False}


class Waiting:
    """Idles in a view that nobody has to state."""

    view = View("drone", "planes", bayesian_update=True)

    def __init__(self, scenario: Scenario) -> None:
        self.drones = scenario.n_drones

    def __call__(self, planes: np.ndarray) -> np.ndarray:
        return np.full(len(planes), int(Action.IDLE))


def submitted(folder: Path, *rows: str) -> Path:
    """A file of submissions."""
    path = folder / "submissions.csv"
    head = "name,policy,deterministic,success,authors,reference"
    path.write_text("\n".join([head, *rows]) + "\n", "utf-8")
    return path


def test_submissions_are_evaluated_as_their_rows_state(tmp_path):
    path = submitted(
        tmp_path, f"waiting,{__file__}:Waiting,yes,0.0,A,x", "odd,random,,2.0,B,https://x.org"
    )
    board = leaderboard(
        ["random"], ["pond"], submissions=path, episodes=40, bounds=False, progress=False
    )
    waiting, odd, random = board.evaluations
    assert (waiting.policy, waiting.is_exact, waiting.view) == ("waiting", True, Waiting.view)
    assert waiting.search.scenario.bayesian_update
    assert (odd.policy, odd.is_exact) == ("odd", False)
    assert np.array_equal(odd.curves, random.curves)


@pytest.mark.thorough
@pytest.mark.parametrize("policy", ["parallel-sweep", "random"])
def test_a_claim_is_the_mean_over_the_searches_or_in_its_interval(tmp_path, policy):
    """Exact for the first policy, give or take a tenth of a point; sampled for the second."""
    how = {"episodes": 20, "progress": False}
    found = [evaluate(policy, each, **how).success for each in ("pond", "fog")]
    _, low, high = mean_of(found).scaled(100.0)

    def claim(success: float) -> None:
        path = submitted(tmp_path, f"own,{policy},,{success},A,x")
        leaderboard(["random"], ["pond", "fog"], submissions=path, bounds=False, **how)

    claim(max(low - 0.05, 0.0))
    claim(high + 0.05)
    with pytest.raises(ValueError, match="success of own in submissions must be that of the rerun"):
        claim(high + 0.2)


@pytest.mark.parametrize(
    "row", ["own,random,,1.0,A", "own,random,,1.0,A,x,more", "own,random,,lots,A,x"]
)
def test_rows_of_submissions_are_complete(tmp_path, row):
    with pytest.raises(ValueError, match="submissions must have the columns name, policy"):
        leaderboard(["random"], ["pond"], submissions=submitted(tmp_path, row), progress=False)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"policies": []}, "policies must be at least one"),
        ({"policies": ["random", "random"]}, "different names, got random, random"),
        ({"searches": ["pond", "fog", "pond"]}, "different names, got pond, fog, pond"),
        (
            {"policies": [], "added": ["random"], "view": "drone"},
            "view must be 'swarm' or 'parallel'",
        ),
    ],
)
def test_bad_input_is_refused(arguments, words):
    with pytest.raises((TypeError, ValueError), match=words):
        leaderboard(**{"searches": ["pond"], "episodes": 1, **arguments}, progress=False)


@pytest.mark.thorough
def test_it_prints_and_writes_everything(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    out = tmp_path / "out"
    assert command.main(["leaderboard", *SHORT, *FEW, "--out", str(out)]) == 0
    output = capsys.readouterr().out
    with (out / "leaderboard.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["policy"], row["search"], row["method"]) for row in rows] == [
        (policy, search, method)
        for search in ("pond", "harbour")
        for policy, method in (("greedy-matrix", "exact"), ("random", "conditional"))
    ]
    for row in rows:
        assert f"{100 * float(row['success']):.1f}" in output
    for name in ("time", "success"):
        for theme in ("light", "dark"):
            assert (out / f"{name}-{theme}.svg").stat().st_size > 5_000
    assert not list(out.glob(".*"))


def test_without_matplotlib_there_are_tables_and_a_hint(tmp_path, idler, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "DroneSwarmSearch.evaluation.plots", raising=False)
    monkeypatch.delattr("DroneSwarmSearch.evaluation.plots", raising=False)
    arguments = ["--episodes", "5", "--searches", "pond", "--workers", "1", "--no-bound"]
    arguments += [*FEW, "--add", idler, "--out", str(tmp_path / "out")]
    assert command.main(["leaderboard", *arguments]) == 0
    output = capsys.readouterr()
    assert re.search(r"search +greedy-matrix +random +idle\n", output.out)
    assert re.search(r"idle +0\.0 \(0\.0-43\.4\)", output.out)
    assert "pip install" in output.err
    assert (tmp_path / "out" / "leaderboard.csv").exists()
    assert not list((tmp_path / "out").glob("*.svg"))
