"""The benchmark, as its users see it: every group measures, tells and writes its figures."""

from __future__ import annotations

import json
import re
import sys
import types
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import DroneSwarmSearch
from DroneSwarmSearch import bench, demo
from DroneSwarmSearch import cli as command
from DroneSwarmSearch.bench import cases, memory, peers, turns
from DroneSwarmSearch.bench.cases import Size
from DroneSwarmSearch.bench.groups import COIN_GAME_RATIOS, GROUPS
from DroneSwarmSearch.vector import threads

SHORT = ["--short", "--sizes", "5x2", "--num-envs", "1", "3"]
COMPARED = [name for name in GROUPS if name not in ("memory", "peers")]


@pytest.fixture(autouse=True)
def _no_peers(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is installed beside the package makes no difference."""
    for name in ("DSSE", "jax", "jaxmarl"):
        monkeypatch.setitem(sys.modules, name, None)


def measured(path: Path, *arguments: str) -> dict[str, Any]:
    """What a run of the benchmark writes to a file."""
    assert bench.main([*arguments, "--json", str(path)]) == 0
    told: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return told


def table_rows(output: str) -> set[tuple[str, str]]:
    """The first two columns of all tables."""
    return set(re.findall(r"^\| (\S.*?) +\| +(any|[\d,]+) \|", output, re.MULTILINE))


def rows_of(figures: list[dict[str, Any]]) -> set[tuple[str, str]]:
    return {(each["name"], str(each["num_envs"] or "any")) for each in figures}


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The last line of what the benchmark says when it refuses its arguments."""
    with pytest.raises(SystemExit) as stop:
        bench.main(arguments)
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    return captured.err.splitlines()[-1]


class TestGroups:
    @pytest.mark.parametrize("group", COMPARED)
    def test_every_ratio_is_told_and_written(
        self, group: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        told = measured(tmp_path / "all.json", *SHORT, "--only", group)
        captured = capsys.readouterr()
        assert captured.err == "", "progress is for terminals"
        assert "## 5 x 5 cells, 2 drones" in captured.out
        (size,) = told["sizes"]
        assert size["left_out"] == []
        ratios = rows_of(size["ratios"])
        assert ratios == {(str(ratio), n) for ratio in GROUPS[group] for n in ("1", "3")}
        speeds = rows_of(size["steps_per_second"])
        assert {name for name, _ in speeds} == {
            each.name for ratio in GROUPS[group] for each in ratio
        }
        assert table_rows(captured.out) == ratios | speeds

    def test_the_figures_fit_each_other(self, tmp_path: Path) -> None:
        told = measured(tmp_path / "all.json", *SHORT, "--only", "batch", "--rounds", "5")
        (size,) = told["sizes"]
        speeds = {(each["name"], each["num_envs"]): each for each in size["steps_per_second"]}
        for each in (*speeds.values(), *size["ratios"]):
            assert len(each["rounds"]) == 5
            assert 0 < each["lower"] <= each["median"] <= each["upper"]
            assert each["median"] == np.median(each["rounds"])
        of, to = speeds["batch, index", 3]["rounds"], speeds["one environment", None]["rounds"]
        ratio = next(
            each
            for each in size["ratios"]
            if (each["name"], each["num_envs"]) == ("batch, index / one environment", 3)
        )
        assert ratio["rounds"] == [a / b for a, b in zip(of, to, strict=True)]

    def test_where_it_was_measured_is_told(
        self, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        arguments = ["--short", "--only", "forecasts", "--sizes", "3x1", "4x2", "--num-envs", "2"]
        told = measured(tmp_path / "with a blank.json", *arguments)
        line = f"python -m DroneSwarmSearch bench {' '.join(arguments)} --json '"
        assert told["command"].startswith(line)
        assert f"\n    {told['command']}\n" in capsys.readouterr().out
        assert told["versions"]["package"] == DroneSwarmSearch.__version__
        assert told["versions"]["numpy"] == np.__version__
        assert {"python", "gymnasium"} <= told["versions"].keys()
        assert told["cpus"] >= 1
        assert told["threads"] == threads.usual_number()
        assert told["parameters"]["sizes"] == ["3x1", "4x2"]
        assert told["parameters"]["num_envs"] == [2]
        assert told["parameters"]["rounds"] == bench.SHORT["rounds"]
        assert [each["n_drones"] for each in told["sizes"]] == [1, 2]

    def test_memory(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        told = measured(tmp_path / "all.json", "--short", "--only", "memory")
        figures = told["memory"]
        if figures is None:
            assert "left out: memory" in capsys.readouterr().out
            return
        assert told["sizes"] == []
        assert figures["num_envs"] == bench.MEMORY_ROWS_SHORT
        assert 0 < figures["peak_mib_before"] <= figures["peak_mib"] < 1000
        assert figures["growth_mib"] >= 0
        output = capsys.readouterr().out
        assert f"peak after 10 steps {figures['peak_mib']:,.0f} MiB" in output

    @pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process begins afresh")
    def test_memory_is_that_of_the_batch_alone(self) -> None:
        """The process measured begins as a copy of this one, whose memory is not counted."""
        ballast = np.ones(2**25)
        figures = memory.measure(Size(5, 2), 10, (2, 4))
        assert figures["peak_mib"] < ballast.nbytes / 2**20

    def test_peers_that_are_missing_are_left_out(
        self, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        told = measured(tmp_path / "all.json", *SHORT, "--only", "peers")
        output = capsys.readouterr().out
        assert output.count("left out: ") == 3
        assert "left out: DSSE, not installed" in output
        assert "python -m pip install DSSE==1.1.9" in output
        assert "python -m pip install jaxmarl" in output
        assert [(each["grid_size"], each["n_drones"]) for each in told["sizes"]] == [
            (5, 2),
            (20, 2),
        ]
        for size in told["sizes"]:
            assert size["steps_per_second"] == size["ratios"] == [], "nothing to compare with"

    def test_a_peer_that_is_there_is_compared(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        resets = []

        class Peer:
            """Ends every episode after three steps."""

            def __init__(self, grid_size: int, drone_amount: int, **_: object) -> None:
                print("hello")
                self.names = {f"drone{i}" for i in range(drone_amount)}
                self.left = 0

            @property
            def agents(self) -> set[str]:
                return self.names if self.left else set()

            def reset(self, options: dict[str, Any]) -> None:
                resets.append(options)
                self.left = 3

            def step(self, actions: dict[str, int]) -> None:
                assert self.left > 0
                assert actions.keys() == self.names
                assert set(actions.values()) <= set(range(9))
                self.left -= 1

        module = types.ModuleType("DSSE")
        module.DroneSwarmSearch = Peer  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "DSSE", module)
        told = measured(tmp_path / "all.json", *SHORT, "--only", "peers")
        names = {name for name, _ in rows_of(told["sizes"][0]["ratios"])}
        assert names == {"batch, index / DSSE", "batch, matrices / DSSE"}
        assert len(resets) > 1
        assert len(resets[0]["drones_positions"]) == 2
        assert "hello" not in capsys.readouterr().out

    def test_what_takes_too_much_memory_is_left_out(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        monkeypatch.setattr(cases, "MOST_BYTES", 4 * 25 * 3)
        told = measured(tmp_path / "all.json", *SHORT, "--only", "views")
        (size,) = told["sizes"]
        assert "left out: DroneVectorEnv, 6 matrices a step take" in capsys.readouterr().out
        speeds = rows_of(size["steps_per_second"])
        assert ("DroneVectorEnv", "1") in speeds
        assert ("DroneVectorEnv", "3") not in speeds
        assert ("SwarmVectorEnv", "3") in speeds


class TestContestants:
    @pytest.mark.parametrize(
        "case",
        list(dict.fromkeys(each for name in COMPARED for ratio in GROUPS[name] for each in ratio)),
        ids=lambda each: each.name,
    )
    def test_makes_the_steps_asked_for(self, case: cases.BenchmarkCase) -> None:
        num_envs = 4 if case.batched else 1
        run = case.make(Size(7, 2), num_envs)
        assert run(1) == num_envs, "at first no row begins anew"
        made = run(200)
        if case.batched and case is not cases.GATHER:
            assert 100 * num_envs < made < 200 * num_envs, "rows that begin anew do not count"
        else:
            assert made == 200 * num_envs

    def test_each_row_of_actions_differs(self) -> None:
        rows = cases.random_actions(3, 2)
        assert len(rows) == cases.ACTION_ROWS
        assert {row.shape for row in rows} == {(3, 2)}
        assert set(np.unique(rows)) == set(range(6))
        assert not any(np.shares_memory(a, b) for a, b in pairwise(rows))

    @pytest.mark.parametrize("grid_size", range(2, 9))
    def test_drones_stand_apart(self, grid_size: int) -> None:
        for n_drones in range(1, grid_size**2 + 1):
            cells = cases.spread_cells(grid_size, n_drones)
            assert len(cells) == len(set(cells)) == n_drones
            assert all(0 <= x < grid_size and 0 <= y < grid_size for x, y in cells)

    def test_drones_keep_away_from_the_border(self) -> None:
        assert cases.spread_cells(7, 1) == [(3, 3)]
        assert cases.spread_cells(20, 4) == [(6, 6), (13, 6), (6, 13), (13, 13)]


def test_turns_are_interleaved_and_go_to_and_fro() -> None:
    turns_taken: list[tuple[str, int]] = []
    played: list[str] = []

    def player(name: str) -> Callable[[int], int]:
        def run(steps: int) -> int:
            played.append(name)
            return 7 * steps

        return run

    rates = turns.take_turns(
        {"a": player("a"), "b": player("b")},
        rounds=3,
        seconds=1e-9,
        warm_up=5,
        tell=lambda key, number: turns_taken.append((key, number)),
    )
    assert played == [*"aabb", *"ab", *"ba", *"ab"]
    assert turns_taken == [
        *(("a", 0), ("b", 0)),
        *(("a", 1), ("b", 1), ("b", 2), ("a", 2), ("a", 3), ("b", 3)),
    ]
    assert {key: len(each) for key, each in rates.items()} == {"a": 3, "b": 3}
    assert all(rate > 0 for each in rates.values() for rate in each)


def test_spread_is_the_median_and_the_quartiles() -> None:
    assert turns.Spread.of([5.0, 1.0, 2.0, 4.0, 3.0]) == (3.0, 2.0, 4.0)


def test_a_duel_is_what_coin_game_is_compared_in() -> None:
    assert peers.COIN_GAME_SIZE.n_drones == 2
    assert all(ratio.of is cases.INDEX for ratio in COIN_GAME_RATIOS)


class TestCommandLine:
    def test_help_names_every_option_and_group(self, capsys: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as stop:
            bench.main(["--help"])
        assert stop.value.code == 0
        text = capsys.readouterr().out
        for option in (
            *("--only", "--sizes", "--num-envs", "--rounds", "--seconds", "--json", "--short"),
        ):
            assert re.search(rf"^ +{option}\b.*", text, re.MULTILINE), option
        assert "7x1 20x4 50x11" in text
        assert all(re.search(rf"\b{group}\b", text.split("groups:")[1]) for group in GROUPS)

    @pytest.mark.parametrize(
        ("option", "values", "problem"),
        [
            ("--only", ["speed"], "invalid choice: 'speed'"),
            ("--sizes", ["20"], "drones that fit, such as 20x4, got '20'"),
            ("--sizes", ["1x1"], "got '1x1'"),
            ("--sizes", ["3x10"], "got '3x10'"),
            ("--sizes", ["3x0"], "got '3x0'"),
            ("--num-envs", ["0"], "must be an integer of at least 1, got '0'"),
            ("--num-envs", ["many"], "must be an integer of at least 1, got 'many'"),
            ("--rounds", ["1.5"], "must be an integer of at least 1, got '1.5'"),
            ("--seconds", ["0"], "must be a number above 0, got '0'"),
            ("--seconds", ["soon"], "must be a number above 0, got 'soon'"),
            ("--json", ["no/such/folder.json"], "cannot write no/such/folder.json"),
        ],
    )
    def test_refuses(
        self, capsys: pytest.CaptureFixture[str], option: str, values: list[str], problem: str
    ) -> None:
        line = refusal(capsys, option, *values)
        assert line.startswith("python -m DroneSwarmSearch bench: error: argument " + option)
        assert problem in line

    def test_progress_is_one_line_on_a_terminal(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
        assert bench.main([*SHORT, "--only", "posterior"]) == 0
        shown = capsys.readouterr().err
        assert "\n" not in shown
        lines = shown.split("\r\x1b[2K")
        assert "5x2: preparing batch, posterior, 3 searches" in lines
        assert "5x2: 100 %, round 3 of 3, one environment, posterior" in lines
        assert lines[-1] == "", "wiped away in the end"
        assert max(map(len, lines)) < 80

    def test_interrupted_politely(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        def interrupt(*_: object, **__: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(bench, "take_turns", interrupt)
        path = tmp_path / "all.json"
        assert bench.main([*SHORT, "--only", "batch", "--json", str(path)]) == 130
        assert capsys.readouterr().err == "interrupted\n"
        assert not path.exists()

    @pytest.mark.parametrize("option", ["-h", "--help"])
    def test_the_package_names_both_commands(
        self, option: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert command.main([option]) == 0
        text = capsys.readouterr().out
        assert re.search(r"^  play +\S", text, re.MULTILINE)
        assert re.search(r"^  bench +\S", text, re.MULTILINE)

    def test_the_package_runs_the_benchmark(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert command.main(["bench", *SHORT, "--only", "forecasts"]) == 0
        assert f"python -m DroneSwarmSearch bench {' '.join(SHORT)}" in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("given", "passed"),
        [
            ([], []),
            (["play"], []),
            (["play", "--help"], ["--help"]),
            (["--seed", "3"], ["--seed", "3"]),
            (["play", "--seed", "3"], ["--seed", "3"]),
            (["--seed", "bench"], ["--seed", "bench"]),
        ],
    )
    def test_all_else_goes_to_the_demo(
        self, given: list[str], passed: list[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        played = []
        monkeypatch.setattr(demo, "main", lambda argv: played.append(argv) or 5)
        assert command.main(given) == 5
        assert played == [passed]
