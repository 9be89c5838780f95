"""The command line: output, files, errors and exit codes."""

import csv
import errno
import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import bound_by_time, refusal

from DroneSwarmSearch import Drift, Person, Scenario
from DroneSwarmSearch import cli as command
from DroneSwarmSearch._internal.progress import progress
from DroneSwarmSearch.evaluation import SUITE, View, evaluate
from DroneSwarmSearch.planning import SuccessBound
from DroneSwarmSearch.policies import DEFAULT_WEIGHTS, POLICIES
from DroneSwarmSearch.training import TASKS

OWN = """
import os
import warnings
import numpy as np

class Still:
    def __init__(self, scenario):
        self.n_drones = scenario.n_drones

    def __call__(self, shown):
        return np.full((len(shown["row"]), self.n_drones), 4)

def dies(shown):
    os._exit(3)

def refuses(shown):
    raise LookupError("no chart")

def interrupts(shown):
    raise KeyboardInterrupt

def differs(shown):
    raise ValueError("shapes differ")

def warns(shown):
    warnings.warn("an old chart")
    return np.full(shown["positions"].shape[:2], 4)

"""

INCIDENT = (
    "plan --position 54.18 7.85 --time 2026-03-01T05:30Z --object PIW-1 --wind 300 20kn --out plan"
)


@pytest.fixture
def own(tmp_path):
    """A file with policies."""
    path = tmp_path / "own.py"
    path.write_text(OWN, "utf-8")
    return path


def answer(capsys: pytest.CaptureFixture[str], *arguments: object, code: int = 0) -> Any:
    """The output of a command."""
    capsys.readouterr()
    assert command.main([str(each) for each in arguments]) == code
    return capsys.readouterr()


def files_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_every_command_has_help(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as stop:
        command.main(["--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for name in ("play", "plan", "evaluate", "leaderboard", "bound", "record", "export"):
        assert re.search(rf"^ +{name}\b", text, re.MULTILINE)
        with pytest.raises(SystemExit) as stop:
            command.main([name, "--help"])
        output = capsys.readouterr().out
        assert stop.value.code == 0
        assert max(map(len, output.splitlines())) <= 80
        assert f"usage: python -m DroneSwarmSearch {name}" in output
        assert f"\n  droneswarmsearch {name}" in output  # an example
        assert ("executed" in output) == (name not in ("play", "plan", "bound"))


@pytest.mark.parametrize("arguments", [[], ["play"], ["--text"]])
def test_the_default_command_is_play(arguments, monkeypatch):
    seen: list[Any] = []
    monkeypatch.setattr("DroneSwarmSearch.commands.play.run", seen.append)
    assert command.main(arguments) == 0
    assert [options.text for options in seen] == ["--text" in arguments]


@pytest.mark.thorough
def test_searches_of_the_benchmark_have_names(capsys):
    command.main(["play", "radio/499", "--policy", "random", "--text", "--fps", "50"])
    shown = capsys.readouterr().out
    assert TASKS["radio"].story in " ".join(shown.split())
    assert "search          radio/499, seed 0" in shown
    for wrong in ("radio/500", "radio/", "radio/one"):
        with pytest.raises(SystemExit):
            command.main(["play", wrong])
        assert f"SEARCH must be radio/0 to radio/499, got '{wrong}'" in capsys.readouterr().err


def test_the_list_has_all_policies_and_searches(capsys):
    text = answer(capsys, "evaluate", "--list").out
    words = " ".join(text.split())
    for name in POLICIES:
        assert re.search(rf"^  {name}\b", text, re.MULTILINE)
    for name, each in SUITE.items():
        assert re.search(rf"^  {name}\b", text, re.MULTILINE)
        assert f"{name} {each.outline} {each.reason}" in words


def rows_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> list[dict[str, str]]:
    """The rows that a command prints with --csv."""
    return [*csv.DictReader(io.StringIO(answer(capsys, *arguments, "--csv").out))]


def test_evaluate_prints_csv(capsys):
    (row,) = rows_of(capsys, "evaluate", "random", "pond", "--episodes", 10, "--posterior")
    got = evaluate("random", "pond", episodes=10, view=View(bayesian_update=True))
    assert row == {name: str(value) for name, value in got.summary.items()}
    assert row["bayesian_update"] == "True"


def test_all_means_the_whole_suite(capsys, monkeypatch):
    few = {name: SUITE[name] for name in ("pond", "fog")}
    monkeypatch.setattr("DroneSwarmSearch.commands.evaluation.SUITE", few)
    rows = rows_of(capsys, "evaluate", "random", "all", "--episodes", 2)
    assert [row["search"] for row in rows] == ["pond", "fog"]


@pytest.mark.parametrize(
    ("name", "reaches"), [("evaluate", True), ("evaluate", False), ("export", True)]
)
def test_a_grid_that_is_too_small_for_the_drift_causes_a_warning(capsys, tmp_path, name, reaches):
    person = Person(Drift((3, 3), start_sd=0.3, vector=(0.3 if reaches else 0.0, 0)))
    storm = tmp_path / "storm.json"
    storm.write_text(json.dumps(Scenario(7, timestep_limit=10, persons=person).to_dict()), "utf-8")
    arguments = {
        "evaluate": ["random", storm, "--episodes", 2],
        "export": [storm, "--policies", "random", "--out", tmp_path / "out.json"],
    }
    printed = answer(capsys, name, *arguments[name]).err
    warning = "warning: 4.8% of a person's forecast lies beyond the grid of 7 x 7 cells"
    assert (warning in printed) == ("warning" in printed) == reaches


def test_policies_can_come_from_files(capsys, own):
    (row,) = rows_of(capsys, "evaluate", f"{own}:Still", "wreck", "--episodes", 3)
    assert row["policy"] == "Still" and float(row["calibration_error"]) > 0


def test_trained_weights_are_a_policy(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(DEFAULT_WEIGHTS, "mine.npz")
    pond = json.loads(json.dumps(SUITE["pond"].data)) | {"timestep_limit": 12}
    Path("short.json").write_text(json.dumps(pond))
    Path("trained.py").write_text("from DroneSwarmSearch.policies import ImitationPolicy\n")
    weights = "trained.py:ImitationPolicy:mine.npz"
    arguments = ("short.json", "--episodes", 2)
    arguments += ("--out", "results")
    (mine,) = rows_of(capsys, "evaluate", weights, *arguments)
    (boxed,) = rows_of(capsys, "evaluate", "imitation", *arguments)
    assert mine["policy"] == "mine" and mine["success"] == boxed["success"]

    with np.load("mine.npz") as file:
        np.savez("mine.npz", **{name: -file[name] for name in file})
    (other,) = rows_of(capsys, "evaluate", weights, *arguments)
    assert other["success"] != mine["success"]


def test_view_and_observation_are_options(capsys, tmp_path):
    path = tmp_path / "flat.py"
    path.write_text(
        "def act(shown):\n"
        "    masks = shown['action_mask']\n"
        "    assert shown['observation'].ndim == 2\n"
        "    assert masks[:, 4:].all() and not masks.all()\n"
        "    return [5] * len(masks)\n",
        "utf-8",
    )
    view = ("--view", "drone", "--observation", "flat", "--action-mask", "--right-of-way")
    (row,) = rows_of(capsys, "evaluate", f"{path}:act", "harbour", "--episodes", 2, *view)
    assert row["time_limit"] == "2"


def test_results_are_written_and_a_rerun_resumes(capsys, own, tmp_path):
    out = tmp_path / "out"
    arguments = ("evaluate", f"{own}:Still", "pond", "fog", "--episodes", 6, "--out", out)
    first = answer(capsys, *arguments)
    again = answer(capsys, *arguments)
    assert again.out == first.out
    assert first.err == f"written to {out}/Still.csv\n"
    assert files_in(out) == {"finished", "Still.csv"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evalaute"], "invalid choice: 'evalaute'"),
        (["evaluate", "random"], "POLICY and SEARCH are needed"),
        (["evaluate", "random", "harbor"], "got 'harbor'; did you mean harbour"),
        (["evaluate", "randon", "pond"], "got 'randon'"),
        (
            ["evaluate", "mine.py", "pond"],
            "'file.py:Class' or 'file.py:Class:argument', got 'mine.py'",
        ),
        (["evaluate", f"{__file__}:none", "pond"], "test_cli.py has none called 'none'"),
        (["bound", "no.json"], "No such file or directory: 'no.json'"),
    ],
)
def test_wrong_arguments_are_refused(capsys, arguments, message):
    assert message in refusal(capsys, *arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("evaluate randon pond", "POLICY must be one of"),
        ("evaluate random pnd", "SEARCH must be one of"),
        ("evaluate random pond --episodes 0", "--episodes must be"),
        ("evaluate random pond --seed -1", "--seed must be"),
        ("evaluate random pond --workers 0", "--workers must be"),
        ("evaluate random pond --view drone", "--view must be 'swarm' or 'parallel'"),
        ("evaluate random pond --right-of-way", "--right-of-way needs --action-mask"),
        ("leaderboard --policies random random", "--policies must be"),
        ("leaderboard --searches pnd", "--searches must be one of"),
        ("bound pnd", "SEARCH must be one of"),
        ("play pnd", "SEARCH must be one of"),
        ("play drift/500", "SEARCH must be drift/0 to drift/499"),
        ("play --policy randon", "--policy must be one of"),
        ("play --text --seed -1", "--seed must be"),
        ("play --fps 0", "--fps must be"),
        ("play --record mine.mov", "--record must end in .gif or .mp4"),
        ("record pond --out mine.mov", "--out must end in .gif or .mp4"),
        ("record pond --out mine.gif --fps 51", "--fps must be"),
        ("record pond --out mine.gif --seed -1", "--seed must be"),
        ("record radio/0 --out mine.gif --drone 4", "--drone must be"),
        ("export pnd --out mine.json", "SEARCH must be one of"),
        ("export pond --out mine.txt", "--out must end in .json"),
        ("export pond --out mine.json --seeds -1", "--seeds must be"),
        (f"{INCIDENT} --seconds -5", "--seconds must be a finite number above 0"),
        (f"{INCIDENT} --bearing 45", "--distance must be given together with --bearing"),
        (f"{INCIDENT} --bearing-error 2", "--bearing must be given together with --bearing-error"),
        (f"{INCIDENT} --tracks none.nc", "--object cannot be given together with --tracks"),
    ],
)
def test_errors_begin_with_what_was_typed(capsys, arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, reason = refusal(capsys, *arguments.split()).split("error: ")
    assert reason.startswith(message)
    assert not files_in(tmp_path)


def test_errors_about_a_file_name_its_keys(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {
        "position": [54, 8],
        "bearing_error": 2,
        "time": "2026-03-01T05:30Z",
        "object_class": "PIW-1",
        "wind": "300 20kn",
    }
    Path("incident.json").write_text(json.dumps(given), "utf-8")
    reason = refusal(capsys, "plan", "--incident", "incident.json", "--out", "plan")
    assert "incident.json must be the file of an incident: " in reason
    assert "--" not in reason.split("incident.json", 1)[1]


def test_missing_files_and_folders_are_refused(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = answer(capsys, "evaluate", "none.py:act", "pond", code=1).err
    assert line.endswith("none.py: No such file or directory\n")
    Path("out").write_text("a file", "utf-8")
    for arguments in (("evaluate", "random", "pond"), ("bound", "pond")):
        output = answer(capsys, *arguments, "--out", "out", code=1)
        assert output.out == ""
        assert output.err.startswith("out/finished: Not a directory")
        assert output.err.count("\n") == 1


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs Linux")
@pytest.mark.parametrize(
    "arguments",
    [
        ["evaluate", "POLICY", "pond", "--out", "/proc/x"],
        ["leaderboard", "--policies", "random", "--searches", "pond", "--out", "/proc/x"],
        ["bound", "pond", "--out", "/proc/x"],
        ["record", "pond", "--policy", "POLICY", "--out", "/proc/x/a.gif"],
        ["export", "pond", "--policies", "POLICY", "--out", "/proc/x/a.json"],
        ["play", "pond", "--policy", "POLICY", "--record", "/proc/x/a.gif"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_the_folder_is_tried_before_the_work(capsys, own, arguments):
    policy = f"{own}:dies"  # so that the test would fail if it flew
    output = answer(capsys, *[text.replace("POLICY", policy) for text in arguments], code=1)
    assert output.err == "/proc/x: No such file or directory\n" or "/proc/x/" in output.err


def test_a_warning_is_a_line(capsys, own):
    output = answer(capsys, "evaluate", f"{own}:warns", "pond", "--episodes", 2)
    assert output.err == "warning: an old chart\n"


def test_a_policy_that_interrupts_stops_the_command(capsys, own):
    output = answer(capsys, "evaluate", f"{own}:interrupts", "pond", "--episodes", 2, code=130)
    assert output.err == "interrupted\n"


def test_a_full_disk_is_reported_and_finished_results_are_kept(capsys, own, tmp_path, monkeypatch):
    sync = os.fsync
    calls = []

    def full(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) > 2:  # when the folder is tried, and the first result
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(descriptor)

    out = tmp_path / "out"
    arguments = ("evaluate", f"{own}:Still", "pond", "fog", "--episodes", 4, "--out", out)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        output = answer(capsys, *arguments, code=1)
    assert output.out == ""
    kept = f"finished results are kept in {out}, and the same command resumes"
    assert re.fullmatch(f".*No space left on device.*; {re.escape(kept)}\n", output.err)
    assert len(files_in(out / "finished")) == 1
    answer(capsys, *arguments)
    assert len(files_in(out / "finished")) == 2


def test_a_worker_that_dies_is_reported(own):
    with pytest.raises(RuntimeError, match="process managed by the executor was unexpectedly"):
        command.main(["evaluate", f"{own}:dies", "pond", "--view", "swarm", "--workers", "2"])


def test_a_closed_pipe_ends_the_command_quietly():
    command = [sys.executable, "-m", "DroneSwarmSearch", "evaluate", "--list"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 1


@pytest.mark.thorough
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device is always full")
@pytest.mark.parametrize(
    ("arguments", "buffered"),
    [("evaluate --list", False), ("export pond --policies random --out {folder}/a.json", True)],
)
def test_output_that_cannot_be_written_is_reported_in_a_line(arguments, buffered, tmp_path):
    command = [sys.executable, "-m", "DroneSwarmSearch", *arguments.format(folder=tmp_path).split()]
    environment = {**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"}
    with Path("/dev/full").open("w") as full:
        pipes = {"stdout": full, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.run(command, **pipes, env=environment, check=False)
    assert process.returncode == 1
    (line,) = process.stderr.splitlines()
    assert "No space left on device" in line


@pytest.fixture
def bounds(monkeypatch):
    """Replace the slow bounds, and record their searches."""
    asked: list[str] = []

    def straight(scenario: Any, drones: Any) -> SuccessBound:
        asked.append(f"{scenario.grid_size}:{len(drones)}")
        by_time = np.linspace(0.0, 0.5, scenario.timestep_limit + 1)
        return bound_by_time(by_time, gap=0.004)

    monkeypatch.setattr("DroneSwarmSearch.evaluation.run.success_bound", straight)
    return asked


def test_bounds_are_shown_and_read_from_the_folder(capsys, bounds, tmp_path):
    lines = answer(capsys, "bound", "pond", "fog", "--out", tmp_path).out.splitlines()
    assert lines[-2].split() == ["pond", "40", "12.50", "25.00", "37.50", "50.00", "0.40", "exact"]
    assert lines[-1].split()[:2] == ["fog", "100"]
    assert bounds == ["10:1", "20:4"]
    arguments = ("evaluate", "random", "pond", "--episodes", 20, "--bound", "--out", tmp_path)
    lines = answer(capsys, *arguments).out.splitlines()
    got = evaluate("random", "pond", episodes=20)
    share, low, high = (100 * each for each in got.success)
    shown = "\n".join(lines)
    assert re.search(r"^random +pond ", shown, re.MULTILINE)
    assert f"{share:.1f} ({low:.1f}-{high:.1f})" in shown
    assert " 50.0\n" in shown, "the bound"
    assert f"{got.time.value:.1f} ({got.time.low:.1f}-{got.time.high:.1f})" in shown
    assert "\n20 episodes of each search, seeds from 0, suite v2" in shown
    (row,) = csv.DictReader((tmp_path / "random.csv").read_text("utf-8").splitlines())
    assert (row["bound"], float(row["share_of_bound"])) == ("0.5", share / 50)
    assert len(bounds) == 2


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("kind", "shown"), [(Terminal, True), (Terminal, False), (io.StringIO, 1)])
def test_a_terminal_shows_a_bar_that_disappears(monkeypatch, kind, shown):
    stream = kind()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("tqdm.std.time", iter(range(100)).__next__)
    with progress("work", 4.0, shown) as bar:
        assert "work:  50%" not in stream.getvalue()
        for done in (1.0, 1.5, 2.0):
            bar(done)
        assert ("work:  50%|" in stream.getvalue()) == (kind is Terminal and shown)
    assert not stream.getvalue().rpartition("\r")[0].rpartition("\r")[2].strip()


@pytest.mark.parametrize(
    "arguments",
    [["record", "--out", "a.gif", "--policy"], ["export", "--out", "a.json", "--policies"]],
)
def test_the_error_of_a_policy_is_no_wrong_argument(arguments, own, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="shapes differ"):
        command.main([*arguments, f"{own}:differs", "--", "pond"])
    assert list(tmp_path.iterdir()) == [own]


@pytest.mark.parametrize(("package", "how"), [("joblib", ["--workers", 2]), ("ray", ["--ray"])])
def test_a_missing_package_is_named(capsys, monkeypatch, package, how):
    monkeypatch.setitem(sys.modules, package, None)
    output = answer(capsys, "evaluate", "random", "pond", "--episodes", 2, *how, code=1)
    assert re.search(f"(?i)needs the package {package}: pip install", output.err)
