"""The command line, as its users see it: what is printed, written and said, and exit codes."""

from __future__ import annotations

import csv
import errno
import importlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import __main__ as command
from DroneSwarmSearch.evaluation import SUITE, Store, evaluate, progress, run
from DroneSwarmSearch.planning.bound import SuccessBound
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.policies.ppo import DEFAULT_WEIGHTS

PATIENCE = 60.0
"""Seconds after which a test fails that waits for another process."""

OWN = """
import os
import time
from pathlib import Path
import numpy as np

class Still:
    def __init__(self, scenario):
        self.n_drones = scenario.n_drones

    def __call__(self, shown):
        return np.full((len(shown["row"]), self.n_drones), 4)

def dies(shown):
    os._exit(3)

def refuses(shown):
    raise LookupError("no chart of this sea")

def leaves(shown):
    raise SystemExit(0)

class LeavesAtOnce(Still):
    def __init__(self, scenario):
        raise SystemExit

class LeavesAtReset(Still):
    def reset(self, seed, rows=None):
        os.sys.exit("done")

class LeavesPreparing(Still):
    def prepare(self, drones):
        os.sys.exit(0)

def interrupts(shown):
    raise KeyboardInterrupt

def wrong(shown):
    return [0]

class Waits(Still):
    def reset(self, seed, rows=None):
        home = Path(__file__).parent
        with (home / "played").open("a") as file:
            print(seed[0], file=file)
        while seed[0] >= 500 and not (home / "free").exists():
            time.sleep(0.05)  # a signal that comes just before a sleep is heard after it
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A file with policies."""
    path = tmp_path / "own.py"
    path.write_text(OWN, "utf-8")
    return path


def answer(capsys: pytest.CaptureFixture[str], *arguments: object, code: int = 0) -> Any:
    """What a command prints."""
    capsys.readouterr()
    assert command.main([str(each) for each in arguments]) == code
    return capsys.readouterr()


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The last line of what a command says when it refuses its arguments."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        command.main([str(each) for each in arguments])
    captured = capsys.readouterr()
    assert stop.value.code == 2
    assert captured.out == ""
    return str(captured.err.splitlines()[-1])


def files_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_help_names_every_command_and_each_has_help_of_its_own(capsys):
    text = answer(capsys, "--help").out
    for name in ("play", *command.COMMANDS):
        assert re.search(rf"^  {name} ", text, re.MULTILINE)
    for name in ("evaluate", "bound"):
        with pytest.raises(SystemExit) as stop:
            command.main([name, "--help"])
        told = capsys.readouterr().out
        assert stop.value.code == 0
        assert f"usage: python -m DroneSwarmSearch {name}" in told
        assert f"\n  python -m DroneSwarmSearch {name} " in told  # an example


@pytest.mark.parametrize("name", list(command.COMMANDS))
def test_every_command_is_where_it_is_said_to_be(name):
    module, function = command.COMMANDS[name]
    assert callable(getattr(importlib.import_module(module), function))


def test_an_unknown_command_brings_similar_ones(capsys):
    told = answer(capsys, "evalaute", code=2)
    assert told.out == ""
    assert "no such command: 'evalaute'; did you mean evaluate?" in told.err
    assert "commands:" in told.err


@pytest.mark.parametrize("arguments", [[], ["play"], ["--text"]])
def test_without_a_command_there_is_the_demo(arguments, monkeypatch):
    seen: list[Sequence[str]] = []
    monkeypatch.setattr("DroneSwarmSearch.demo.main", lambda argv: seen.append(argv) or 0)
    assert command.main(arguments) == 0
    assert seen == [[each for each in arguments if each != "play"]]


def test_the_list_shows_all_there_is(capsys):
    text = answer(capsys, "evaluate", "--list").out
    for name in POLICIES:
        assert re.search(rf"^  {name}\b", text, re.MULTILINE)
    for name, each in SUITE.items():
        assert re.search(rf"^  {name} .* {each.scenario.timestep_limit} steps$", text, re.MULTILINE)
        assert each.reason in text


def test_evaluate_prints_a_table(capsys):
    told = answer(capsys, "evaluate", "random", "pond", "harbour", "--episodes", 20, "--seed", 3)
    lines = told.out.splitlines()
    got = evaluate("random", "harbour", episodes=20, seed=3)
    share, low, high = (100 * each for each in got.success)
    assert lines[0].split()[:2] == ["policy", "search"]
    assert lines[2].split()[:2] == ["random", "pond"]
    assert lines[3].split()[:2] == ["random", "harbour"]
    assert f"{share:.1f} ({low:.1f}-{high:.1f})" in lines[3]
    assert f"{got.time.value:.1f} ({got.time.low:.1f}-{got.time.high:.1f})" in lines[3]
    assert lines[5].startswith("20 episodes of each search, seeds from 3, suite v1")
    assert told.err == ""


def test_on_a_terminal_the_table_is_drawn_with_rich(capsys, monkeypatch):
    pytest.importorskip("rich")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    drawn = answer(capsys, "evaluate", "random", "pond", "--episodes", 5).out
    assert "random" in drawn
    assert "─" in drawn
    monkeypatch.setitem(sys.modules, "rich.box", None)
    plain = answer(capsys, "evaluate", "random", "pond", "--episodes", 5).out
    assert "─" not in plain
    assert "random  pond" in plain


def test_evaluate_prints_json_or_csv(capsys):
    arguments = ("evaluate", "random", "pond", "--episodes", 10, "--posterior")
    (told,) = json.loads(answer(capsys, *arguments, "--json").out)
    got = evaluate("random", "pond", episodes=10, bayesian_update=True)
    assert told == got.data
    (row,) = csv.DictReader(io.StringIO(answer(capsys, *arguments, "--csv").out))
    assert row["bayesian_update"] == "True"
    assert float(row["success_high"]) == got.success.high
    assert "not allowed with" in refusal(capsys, *arguments, "--json", "--csv")


def test_all_stands_for_the_suite(capsys, monkeypatch):
    few = {name: SUITE[name] for name in ("pond", "fog")}
    monkeypatch.setattr("DroneSwarmSearch.evaluation.cli.SUITE", few)
    told = answer(capsys, "evaluate", "random", "all", "--episodes", 2, "--csv").out
    assert [row["search"] for row in csv.DictReader(io.StringIO(told))] == ["pond", "fog"]


def test_policies_of_ones_own_come_from_files_and_modules(capsys, own, monkeypatch):
    monkeypatch.syspath_prepend(own.parent)
    monkeypatch.delitem(sys.modules, "own", raising=False)
    for text in (f"{own}:Still", "own:Still"):
        told = answer(capsys, "evaluate", text, "wreck", "--episodes", 3, "--json").out
        (each,) = json.loads(told)
        assert each["policy"] == text
        assert sum(each["calibration"]["searches"]) >= 3 * 6


def test_trained_weights_are_a_policy(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(DEFAULT_WEIGHTS, "mine.npz")
    played: list[Any] = []
    original = run.play
    monkeypatch.setattr(run, "play", lambda *args: played.append(args[2]) or original(*args))
    arguments = ("evaluate", "mine.npz", "pond", "--episodes", 20, "--json", "--out", "results")
    (mine,) = json.loads(answer(capsys, *arguments).out)
    answer(capsys, *arguments)
    assert len(played) == 1, "kept under a hash of the weights"
    named = ("evaluate", "my-own=mine.npz", *arguments[2:6])
    assert json.loads(answer(capsys, *named).out)[0]["policy"] == "my-own"
    (boxed,) = json.loads(answer(capsys, "evaluate", "ppo", *arguments[2:6]).out)
    assert mine["policy"] == "mine.npz"
    assert mine["success"] == boxed["success"]

    with np.load("mine.npz") as file:
        np.savez("mine.npz", **{name: -file[name] for name in file})
    (other,) = json.loads(answer(capsys, *arguments).out)
    assert other["success"] != mine["success"]


def test_weights_that_change_in_mid_work_are_stored_as_what_they_are(capsys, tmp_path, monkeypatch):
    """A trainer may write the file while it is evaluated."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(DEFAULT_WEIGHTS, "mine.npz")
    original = run.play

    def changing(*arguments: Any) -> Any:
        with np.load(DEFAULT_WEIGHTS) as file:
            np.savez("mine.npz", **{name: -file[name] for name in file})
        return original(*arguments)

    arguments = ("evaluate", "mine.npz", "pond", "harbour", "--episodes", 5, "--json")
    with monkeypatch.context() as patch:
        patch.setattr(run, "play", changing)
        answer(capsys, *arguments, "--out", "results")
    shutil.copy(DEFAULT_WEIGHTS, "mine.npz")
    fresh = json.loads(answer(capsys, *arguments).out)
    assert json.loads(answer(capsys, *arguments, "--out", "results").out) == fresh


def test_a_view_and_a_layout_can_be_asked_for(capsys, tmp_path):
    path = tmp_path / "flat.py"
    path.write_text(
        "def act(shown):\n    assert shown.ndim == 2\n    return [5] * len(shown)\n", "utf-8"
    )
    view = ("--view", "drone", "--observation", "flat")
    (told,) = json.loads(
        answer(capsys, "evaluate", f"{path}:act", "harbour", "--episodes", 2, "--json", *view).out
    )
    assert (told["view"], told["observation"]) == ("drone", "flat")
    assert told["endings"]["time_limit"] == 2


def test_results_are_written_and_a_rerun_goes_on(capsys, own, tmp_path, monkeypatch):
    played: list[Any] = []
    original = run.play
    monkeypatch.setattr(run, "play", lambda *args: played.append(args[2]) or original(*args))
    out = tmp_path / "out"
    arguments = ("evaluate", f"{own}:Still", "pond", "fog", "--episodes", 6, "--out", out)
    first = answer(capsys, *arguments)
    assert len(played) == 2
    again = answer(capsys, *arguments)
    assert again.out == first.out
    assert first.err == f"written to {out}\n"
    assert len(played) == 2
    stem = re.sub(r"[^\w.-]", "-", f"{own}-Still").strip(".-")
    assert files_in(out) == {
        "portions",
        f"{stem}.summary.csv",
        *(f"{stem}.{name}{end}" for name in ("pond", "fog") for end in (".json", ".episodes.csv")),
    }
    told = json.loads((out / f"{stem}.fog.json").read_text("utf-8"))
    assert (told["episodes"], told["search"]) == (6, "fog")
    answer(capsys, *arguments, "--posterior")
    assert f"{stem}.fog.posterior.json" in files_in(out)
    own.write_text(OWN + "\n# changed\n", "utf-8")
    answer(capsys, *arguments)  # another policy now, for all one knows
    assert len(played) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate"], "POLICY and SEARCH are needed; `evaluate --list` shows those there are"),
        (["evaluate", "random"], "POLICY and SEARCH are needed"),
        (["evaluate", "random", "lagon"], "got 'lagon'; did you mean lagoon?"),
        (["evaluate", "randon", "pond"], "got 'randon'; did you mean random?"),
        (["evaluate", "nofile.py:act", "pond"], "there is no 'nofile.py'"),
        (["evaluate", "nofile.npz", "pond"], "there is no 'nofile.npz'"),
        (["evaluate", "no.module:act", "pond"], "there is no 'no.module'"),
        (["evaluate", "math:tau", "pond"], "math has none called 'tau'"),
        (["evaluate", "random", "pond", "--episodes", "0"], "episodes must be an integer of at"),
        (["evaluate", "random", "pond", "--episodes", "x"], "--episodes: invalid int value: 'x'"),
        (["evaluate", "random", "pond", "--seed", "-1"], "seed must be an integer of at least 0"),
        (["evaluate", "random", "pond", "--workers", "0"], "--workers: must be an integer of at"),
        (["evaluate", "random", "pond", "--view", "x"], "view must be one of 'swarm', 'drone'"),
        (["evaluate", "random", "pond", "--view", "drone"], "view must be 'swarm' or 'parallel'"),
        (["evaluate", "ppo", "pond", "--observation", "flat"], "observation must be 'dict' for"),
        (
            ["evaluate", "DroneSwarmSearch.policies:GreedyPolicy", "pond", "--view", "drone"],
            "view must be 'swarm' or 'parallel' for DroneSwarmSearch.policies:GreedyPolicy",
        ),
        (["leaderboard", "--add", "own=ppo", "--view", "drone"], "view must be 'swarm' or"),
        (["evaluate", "/.npz", "pond"], "there is no '/.npz'"),
        (["bound", "lagon"], "got 'lagon'; did you mean lagoon?"),
        (["bound"], "the following arguments are required: SEARCH"),
    ],
)
def test_arguments_that_cannot_be_met_are_refused(capsys, arguments, message):
    assert message in refusal(capsys, *arguments)


@pytest.mark.parametrize("command_name", ["evaluate", "leaderboard", "record"])
def test_help_says_that_code_is_executed(capsys, command_name):
    with pytest.raises(SystemExit):
        command.main([command_name, "--help"])
    assert "executed" in capsys.readouterr().out


def test_folders_and_damaged_weights_are_refused_in_words(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("folder.npz", "folder.py"):
        Path(name).mkdir()
    Path("text.npz").write_text("no weights", "utf-8")
    np.save("array.npy", np.zeros(3))
    shutil.copy("array.npy", "array.npz")
    for text, message in (
        ("folder.npz", "'folder.npz' is a folder"),
        ("folder.py:act", "'folder.py' is a folder"),
        ("text.npz", "text.npz must hold a network's weights"),
        ("array.npz", "array.npz must hold a network's weights"),
    ):
        assert message in refusal(capsys, "evaluate", text, "pond")
        assert message in refusal(capsys, "leaderboard", "--add", text)
    Path("out").write_text("a file", "utf-8")
    for arguments in (("evaluate", "random", "pond"), ("bound", "pond")):
        told = answer(capsys, *arguments, "--out", "out", code=1)
        assert told.out == ""
        assert told.err.startswith("out: finished work needs a folder, and this is a file")
        assert told.err.count("\n") == 1


@pytest.mark.parametrize(
    ("environment", "policy"),
    [
        ({"PYTHONIOENCODING": "ascii"}, "\xe9.py:act"),
        ({"PYTHONIOENCODING": "ascii"}, "n\xe9=random"),
        ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, "\xe9.py:act"),
    ],
)
def test_a_terminal_that_lacks_letters_gets_others(tmp_path, environment, policy):
    (tmp_path / "\xe9.py").write_text("def act(shown):\n    return [[4]] * len(shown['row'])\n")
    arguments = ("evaluate", policy, "pond", "--episodes", "2", "--csv", "--out", "r\xe9sultats")
    home = str(Path(command.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-m", "DroneSwarmSearch", *arguments],
        capture_output=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, **environment, "PYTHONPATH": home},
    )
    assert done.returncode == 0, done.stderr
    assert b",pond," in done.stdout
    assert done.stdout.isascii()


def test_wrong_actions_are_told_in_a_line(capsys, own):
    told = answer(capsys, "evaluate", f"{own}:wrong", "pond", "--episodes", 2, code=1)
    assert told.out == ""
    assert told.err.startswith("ValueError: the policy must return actions of shape (2, 1)")
    assert told.err.count("\n") == 1


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_policy_raises_is_told_with_the_place(capsys, own, workers):
    arguments = ("evaluate", f"{own}:refuses", "pond", "--episodes", 2, "--workers", workers)
    told = answer(capsys, *arguments, code=1)
    assert "in refuses" in told.err
    assert told.err.endswith("LookupError: no chart of this sea\n")


@pytest.mark.parametrize("out", [False, True])
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("policy", ["leaves", "LeavesAtOnce", "LeavesAtReset", "LeavesPreparing"])
def test_a_policy_that_ends_the_program_fails(capsys, own, tmp_path, policy, workers, out):
    told = answer(
        capsys,
        *("evaluate", f"{own}:{policy}", "pond", "--episodes", 2, "--workers", workers),
        *(["--out", tmp_path / "out"] if out else []),
        code=1,
    )
    assert told.out == ""
    last = told.err.splitlines()[-1]
    assert re.match(r"RuntimeError: .*own\.py:\w+ .*must not end the program, got SystemExit", last)
    assert f"own.py:{policy}" in last


@pytest.mark.parametrize("command_name", ["evaluate", "leaderboard"])
def test_a_file_that_ends_the_program_is_refused(capsys, tmp_path, command_name, monkeypatch):
    (tmp_path / "leaves.py").write_text(
        "import sys\n\ndef act(shown): ...\n\nsys.exit()\n", "utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for text in (f"{tmp_path}/leaves.py:act", "leaves:act"):
        given = {"evaluate": [text, "pond"], "leaderboard": ["--add", text, "--out", tmp_path]}
        told = refusal(capsys, command_name, *given[command_name])
        assert "ends the program when it is (SystemExit: None)" in told


def test_a_policy_that_interrupts_stops_the_command(capsys, own):
    told = answer(capsys, "evaluate", f"{own}:interrupts", "pond", "--episodes", 2, code=130)
    assert told.err == "interrupted\n"


def test_a_crashed_worker_is_told_and_what_is_finished_is_kept(capsys, own, tmp_path):
    out = tmp_path / "out"
    Store(out / "portions").save({"what": "something finished before"}, 1)
    arguments = (f"{own}:dies", "pond", "--episodes", 2, "--workers", 2)
    told = answer(capsys, "evaluate", *arguments, "--out", out, code=1)
    assert told.err == (
        "a worker process died (exit code 3) while it was doing episodes 0 to 1 of "
        f"{own}:dies on pond; what was finished is kept in {out / 'portions'}: the same command "
        "goes on there\n"
    )


def test_a_full_disk_is_told_and_what_is_finished_is_kept(capsys, own, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "PORTION", 2)
    sync, calls = os.fsync, []

    def full(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) > 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(descriptor)

    out = tmp_path / "out"
    arguments = ("evaluate", f"{own}:Still", "pond", "fog", "--episodes", 4, "--out", out)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        told = answer(capsys, *arguments, code=1)
    assert str(out / "portions") in told.err
    assert told.err.endswith(
        "No space left on device; what was written before is kept: the same command goes on from "
        "there\n"
    )
    assert " pond " in told.out  # finished, so told
    assert len(Store(out / "portions")) == 3
    answer(capsys, *arguments)
    assert len(Store(out / "portions")) == 4


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="there are no process groups")
def test_ctrl_c_is_told_and_a_rerun_goes_on(own):
    out, played = own.parent / "out", own.parent / "played"
    program = (
        *(sys.executable, "-m", "DroneSwarmSearch", "evaluate", f"{own}:Waits", "pond"),
        *("--episodes", "1000", "--out", str(out)),
    )
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(program, start_new_session=True, **pipes)
    end = time.monotonic() + PATIENCE
    portions = Store(out / "portions")
    while not (played.exists() and "500" in played.read_text("utf-8") and len(portions) == 1):
        assert time.monotonic() < end
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    printed, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert printed == ""
    kept = f"what was finished is kept in {portions.directory}: the same command goes on there"
    assert told == f"interrupted; {kept}\n"

    played.unlink()
    (own.parent / "free").touch()
    done = subprocess.run(program, timeout=PATIENCE, check=False, **pipes)
    assert done.returncode == 0
    assert played.read_text("utf-8").split() == ["500"]
    assert "1000 episodes of each search" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="the system does not name this error")
def test_when_nobody_reads_on_the_command_ends_quietly(own):
    process = subprocess.Popen(
        [sys.executable, "-m", "DroneSwarmSearch", "evaluate", "--list"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    told = process.stderr.read()
    process.stderr.close()
    assert process.wait(PATIENCE) == 1
    assert told == b""


def test_without_ray_there_is_a_hint(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    told = answer(capsys, "evaluate", "random", "pond", "--episodes", 2, "--ray", code=1)
    assert told.err.startswith("ray needs the package Ray: pip install")


# Bounds.


@pytest.fixture
def bounds(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Takes the place of the bounds, which take minutes; notes for which searches."""
    asked: list[str] = []

    def straight(scenario: Any, drones: Any, report: Any) -> SuccessBound:
        asked.append(f"{scenario.grid_size}:{len(drones)}")
        by_time = np.linspace(0.0, 0.5, scenario.timestep_limit + 1)
        return SuccessBound(by_time=by_time, relaxed=0.49, gap=0.004, confidence=1.0)

    monkeypatch.setattr("DroneSwarmSearch.evaluation.bounds.success_bound", straight)
    return asked


def test_bound_prints_a_table_or_json(capsys, bounds, tmp_path):
    lines = answer(capsys, "bound", "pond", "fog", "--out", tmp_path).out.splitlines()
    assert lines[2].split() == ["pond", "40", "12.50", "25.00", "37.50", "50.00", "0.40", "exact"]
    assert lines[3].split()[:2] == ["fog", "100"]
    assert bounds == ["10:1", "20:4"]
    told = json.loads(answer(capsys, "bound", "fog", "--out", tmp_path, "--json").out)
    assert [each["search"] for each in told] == ["fog"]
    assert told[0]["by_time"] == np.linspace(0.0, 0.5, 101).tolist()
    assert len(bounds) == 2  # kept


@pytest.mark.parametrize(
    "changes",
    [
        {"by_time": [0.1] * 40},
        {"by_time": [float("nan")] * 41},
        {"by_time": [2.0] * 41},
        {"by_time": "x"},
        {"gap": None},
        {"more": 1},
    ],
)
@pytest.mark.parametrize("is_signed", [False, True])
def test_a_damaged_bound_is_worked_out_again(capsys, bounds, tmp_path, changes, is_signed):
    first = answer(capsys, "bound", "pond", "--out", tmp_path, "--json").out
    (path,) = (tmp_path / "portions").iterdir()
    whole = path.read_bytes()
    told = json.loads(whole)
    told["entry"] |= changes
    path.write_text(json.dumps(told), "utf-8")
    if is_signed:
        key = {name: told["key"][name] for name in ("what", "parameters")}
        Store(tmp_path / "portions").save(key, told["entry"])
    assert answer(capsys, "bound", "pond", "--out", tmp_path, "--json").out == first
    assert len(bounds) == 2
    assert path.read_bytes() == whole


def test_evaluate_tells_the_share_of_the_bound(capsys, bounds, tmp_path):
    arguments = ("evaluate", "random", "pond", "--episodes", 20, "--bound", "--out", tmp_path)
    lines = answer(capsys, *arguments).out.splitlines()
    assert lines[0].split()[-6:] == ["bound,", "%", "share", "of", "it,", "%"]
    assert " 50.0 " in lines[2]
    told = json.loads((tmp_path / "random.pond.json").read_text("utf-8"))
    assert told["bound"]["by_time"][-1] == 0.5
    assert told["share_of_bound"]["value"] == pytest.approx(told["success"]["value"] / 0.5)
    answer(capsys, *arguments, "--posterior")
    assert bounds == ["10:1"]  # what is shown makes no difference to it


# Progress.


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that `progress` sees."""
    now = [100.0]
    monkeypatch.setattr("DroneSwarmSearch.evaluation.progress.time.monotonic", lambda: now[0])
    return now


def test_elsewhere_than_on_a_terminal_a_line_comes_now_and_then(capsys, clock):
    with progress.Progress("work", 200.0) as bar:
        for _ in range(7):
            clock[0] += 10.0
            bar((clock[0] - 100.0) * 2)
    assert capsys.readouterr().err.splitlines() == [
        "work: 30%, about 1 min 10 s left",
        "work: 60%, about 40 s left",
    ]


@pytest.mark.parametrize("shown", [True, False])
def test_on_a_terminal_there_is_a_bar_after_two_seconds(monkeypatch, clock, shown):
    pytest.importorskip("rich")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress.Progress("work", 4.0, shown) as bar:
        clock[0] += 1.9
        bar(1.0)
        assert terminal.getvalue() == ""
        clock[0] += 2.1
        bar(2.0)
    assert ("work" in terminal.getvalue() and "50 %" in terminal.getvalue()) == shown


def test_without_rich_a_hint_comes_once(monkeypatch, clock):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(progress, "_hinted", False)
    monkeypatch.setitem(sys.modules, "rich.progress", None)
    for _ in range(2):
        with progress.Progress("work", 4.0) as bar:
            clock[0] += 5.0
            bar(1.0)
            bar(2.0)
    assert terminal.getvalue() == f"{progress.HINT}\n"


@pytest.mark.parametrize(
    ("share", "seconds", "words"),
    [
        (0.0, 5.0, "time left unknown"),
        (0.5, 5.0, "about 5 s left"),
        (0.5, 60.0, "about 1 min 00 s left"),
        (0.01, 100.0, "about 2 h 45 min left"),
        (1.0, 5.0, "about 0 s left"),
    ],
)
def test_the_time_left_is_told_in_words(share, seconds, words):
    assert progress._left(share, seconds) == words
