"""Tools for training: options, learning curves, runs, the comparison with the baselines, masks."""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import math
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, DroneSwarmSearch, training
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training.curve import Curve, moving_mean

DEFAULTS = {"steps": 5000, "seed": 0, "resume": False, "short": False, "episodes": 1000}
DEFAULTS["threads"] = 1  # PyTorch's default makes small networks slow on a busy machine
ROOT = Path(__file__).parents[1]


def options(folder: Path, *given: str) -> argparse.Namespace:
    parser = training.arguments("Train.", steps=5000, short=70)
    return parser.parse_args(["--out", str(folder), *given])


def rows(folder: Path) -> list[dict[str, str]]:
    """Read curve.csv without the package."""
    with (folder / "curve.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def save(run: training.Run, steps: int, name: str = "checkpoint.pt") -> None:
    with run.saving(name) as path:
        path.write_text(str(steps))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time in seconds that runs and progress bars read."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def plots() -> None:
    """Plot learning curves, as most tests do not."""
    pytest.importorskip("matplotlib")


@pytest.fixture(autouse=True)
def quick_runs(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip plots, each of which takes longer than the rest of a test."""
    if "plots" not in request.fixturenames:
        monkeypatch.setattr(Curve, "draw", lambda *_: None)


def test_the_task_can_be_pickled_and_played() -> None:
    task = pickle.loads(pickle.dumps(training.TRAINING_TASK))
    assert task == training.TRAINING_TASK
    env = DroneSwarmSearch(**task)
    env.reset(seed=0)
    assert (env.grid_size, len(env.agents), env.timestep_limit) == (10, 2, 50)
    assert env.scenario.bayesian_update


# Options.


def test_options_have_defaults(tmp_path: Path) -> None:
    assert vars(options(tmp_path)) == {**DEFAULTS, "out": tmp_path}


def test_a_short_run_has_fewer_steps_and_episodes_by_default(tmp_path: Path) -> None:
    short = options(tmp_path, "--short")
    assert (short.steps, short.episodes) == (70, 50)
    short = options(tmp_path, "--short", "--steps", "90", "--episodes", "7", "--seed", "3")
    assert (short.steps, short.episodes, short.seed) == (90, 7, 3)


@pytest.mark.parametrize("path", sorted((ROOT / "docs/guides/trainers").glob("*.md")), ids=str)
def test_snippets_that_train_use_one_thread(path: Path) -> None:
    for block in re.findall(r"^```python\n(.*?)^```$", path.read_text("utf-8"), re.M | re.S):
        uses = re.search(
            r"^(from|import) (agilerl|ray|stable_baselines3|tianshou|torch)", block, re.M
        )
        assert not uses or "torch.set_num_threads(1)" in block or "GymWrapper" in block


def test_numbers_may_have_underscores(tmp_path: Path) -> None:
    assert options(tmp_path, "--steps", "1_000_000").steps == 10**6


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--steps", "0"), "--steps: must be an integer of at least 1, got '0'"),
        (("--steps", "many"), "--steps: must be an integer of at least 1, got 'many'"),
        (("--seed", "-1"), "--seed: must be an integer of at least 0, got '-1'"),
        (("--episodes", "0.5"), "--episodes: must be an integer of at least 1, got '0.5'"),
    ],
)
def test_invalid_options_are_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: tuple[str, ...], message: str
) -> None:
    with pytest.raises(SystemExit, match="2"):
        options(tmp_path, *given)
    assert message in capsys.readouterr().err


def test_the_folder_is_required(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        training.arguments("Train.", steps=5, short=1).parse_args([])
    assert "--out" in capsys.readouterr().err


def test_the_help_shows_defaults_and_added_options(capsys: pytest.CaptureFixture[str]) -> None:
    parser = training.arguments("Train with care.", steps=50_000, short=700)
    parser.add_argument("--own", help="of this example")
    with pytest.raises(SystemExit, match="0"):
        parser.parse_args(["--help"])
    shown = " ".join(capsys.readouterr().out.split())
    for words in ("Train with care.", "(50,000)", "700 steps, 50 episodes", "of this example"):
        assert words in shown


@pytest.mark.parametrize("name", ["steps", "short"])
def test_default_steps_are_checked(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be an integer of at least 1, got 0"):
        training.arguments("Train.", **{"steps": 5, "short": 1, name: 0})


# Learning curves.


def test_a_row_is_written_at_once(tmp_path: Path, clock: list[float]) -> None:
    with training.Run(options(tmp_path / "new"), "Trial") as run:
        clock[0] += 1.5
        run.log(10, reward=-1234.5678, found=0.25)
        assert rows(run.folder) == [
            {"steps": "10", "seconds": "1.5", "reward": "-1234.57", "found": "0.25"}
        ]
        clock[0] += 2
        run.log(20)
        assert rows(run.folder)[1] == {"steps": "20", "seconds": "3.5", "reward": "", "found": ""}
        assert run.steps_done == 20


def test_large_numbers_of_steps_are_exact(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(123_456_789)
        run.log(123_456_790)
    assert [row["steps"] for row in rows(tmp_path)] == ["123456789", "123456790"]


def test_a_new_value_adds_a_column(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10, found=0.0)
        run.log(20, found=math.nan, loss=0.125)
        run.log(30, found=1.0)
        run.log(40, loss=0.25, entropy=1.5)
    assert list(rows(tmp_path)[0]) == ["steps", "seconds", "reward", "found", "loss", "entropy"]
    assert [row["found"] for row in rows(tmp_path)] == ["0", "", "1", ""]
    assert [row["loss"] for row in rows(tmp_path)] == ["", "0.125", "", "0.25"]
    assert [row["entropy"] for row in rows(tmp_path)] == ["", "", "", "1.5"]


def test_success_on_held_out_searches_has_a_column_for_each_policy(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10, held_out={"the network": 0.5, "greedy-matrix": 0.25})
        run.log(20, loss=1.0)
    first, second = rows(tmp_path)
    assert first["held-out the network"] == "0.5" and first["held-out greedy-matrix"] == "0.25"
    assert second["held-out the network"] == second["held-out greedy-matrix"] == ""


def test_steps_must_increase_and_names_must_be_new(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
        with pytest.raises(ValueError, match="steps must be an integer of at least 11, got 10"):
            run.log(10)
        with pytest.raises(TypeError, match=r"steps must be an integer of at least 11, got 11\.5"):
            run.log(11.5)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="values must have names other than steps, seconds"):
            run.log(11, seconds=1.0)
    assert len(rows(tmp_path)) == 1


def test_an_incomplete_last_line_is_ignored(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("steps,seconds,reward,found\n10,1,-5,0.5\n20,2,-4,0.")
    curve = Curve(path)
    assert curve.rows == [{"steps": 10, "seconds": 1, "reward": -5, "found": 0.5}]
    assert (curve.steps, curve.seconds) == (10, 1.0)


@pytest.mark.parametrize(
    ("text", "got"), [("", "nothing"), ("time,loss\n", "time,loss"), ("steps", "nothing")]
)
def test_other_files_are_rejected(tmp_path: Path, text: str, got: str) -> None:
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(ValueError, match=f"must be a learning curve with the col.*, got '{got}'"):
        Curve(tmp_path / "curve.csv")


def test_the_moving_mean_covers_a_twentieth_and_skips_unknown_values() -> None:
    values = np.arange(40.0)
    assert moving_mean(values)[:3].tolist() == [0.0, 0.5, 1.5]
    values[1] = math.nan
    assert moving_mean(values)[:4].tolist() == [0.0, 0.0, 2.0, 2.5]
    unknown = np.array([math.nan, 3.0])
    assert np.isnan(moving_mean(unknown)).tolist() == [True, False]
    assert moving_mean(np.zeros(0)).shape == (0,)


@pytest.mark.usefixtures("plots")
def test_the_curve_is_plotted(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")

    def plotted(name: str, *found: float, held_out: dict[str, float] | None = None) -> np.ndarray:
        with training.Run(options(tmp_path / name), "Trial") as run:
            for step, share in enumerate(found, 1):
                run.log(100 * step, reward=-1e5 * share, found=share, held_out=held_out)
        with image.open(tmp_path / name / "curve.png") as picture:
            return np.asarray(picture.convert("RGB"))

    one, other = plotted("one", 0.1, 0.3, 0.8), plotted("other", 0.1, 0.3, math.nan)
    assert one.shape[1] > one.shape[0] > 500
    assert one.shape == other.shape and (one != other).any()
    with_held_out = plotted("held-out", 0.1, 0.3, 0.8, held_out={"trained": 0.5})
    assert with_held_out.shape[0] > one.shape[0]


@pytest.mark.usefixtures("plots")
def test_without_matplotlib_the_run_reports_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
    assert "DroneSwarmSearchEnvironment[evaluation]" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["curve.csv"]


# Checkpoints.


def test_a_run_resumes_from_its_checkpoint(tmp_path: Path, clock: list[float]) -> None:
    with training.Run(options(tmp_path), "Trial", "model") as run:
        for steps in (10, 20, 30):
            clock[0] += 1
            run.log(steps, loss=steps / 10)
            if steps == 20:
                save(run, 20, "model")
    clock[0] += 1000
    with training.Run(options(tmp_path, "--resume"), "Trial", "model") as run:
        assert run.resuming and run.steps_done == 30
        assert run.checkpoint.read_text() == "20"
        run.resume_from(20)
        assert run.steps_done == 20
        clock[0] += 5
        run.log(25, found=1.0)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "20", "25"]
    assert [row["seconds"] for row in rows(tmp_path)] == ["1", "2", "7"]
    assert [row["loss"] for row in rows(tmp_path)] == ["1", "2", ""]


def test_resuming_removes_an_incomplete_last_line(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 10)
        run.log(10)
    with (tmp_path / "curve.csv").open("a") as file:
        file.write("20,2,")
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        run.resume_from(10)
        run.log(30)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "30"]


def test_a_run_without_rows_has_no_curve(tmp_path: Path) -> None:
    run = training.Run(options(tmp_path), "Trial")
    run.resume_from(0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("logged", [False, True])
def test_a_checkpoint_may_be_ahead_of_the_curve(tmp_path: Path, logged: bool) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 15)
        if logged:
            run.log(10)
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        run.resume_from(15)
        assert run.steps_done == 15
        run.log(20)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "20"][not logged :]


def test_a_file_is_replaced_atomically(tmp_path: Path) -> None:
    run = training.Run(options(tmp_path), "Trial")
    with run.saving("model.zip") as path:
        assert path.suffix == ".zip"
        path.write_text("first")

    def fail() -> None:
        with run.saving("model.zip") as path:
            path.write_text("sec")
            raise RuntimeError("disk full")

    with pytest.raises(RuntimeError, match="disk full"):
        fail()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [
        ("model.zip", "first")
    ]


def test_a_folder_is_replaced_atomically(tmp_path: Path) -> None:
    run = training.Run(options(tmp_path), "Trial", "checkpoint_*")

    def save_folder(name: str, error: BaseException | None = None) -> None:
        with run.saving_folder(name) as path:
            (path / "part").mkdir(parents=True)
            (path / "part" / "weights").write_text(name)
            if error is not None:
                raise error

    for name in ("checkpoint_0", "checkpoint_1"):
        save_folder(name)
        assert [path.name for path in tmp_path.iterdir()] == [name]
    with pytest.raises(KeyboardInterrupt):
        save_folder("checkpoint_2", KeyboardInterrupt())
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint_1"]

    (tmp_path / ".new").mkdir()  # as if the program had been killed
    (tmp_path / ".new" / "part").write_text("incomplete")
    run = training.Run(options(tmp_path, "--resume"), "Trial", "checkpoint_*")
    assert (run.checkpoint / "part" / "weights").read_text() == "checkpoint_1"
    save_folder("checkpoint_2")
    assert (run.checkpoint / "part" / "weights").read_text() == "checkpoint_2"
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint_2"]


def test_the_newest_match_of_a_pattern_counts(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial", "*/at_*.pt") as run:
        with pytest.raises(FileNotFoundError, match=r"no checkpoint \*/at_\*\.pt in"):
            _ = run.checkpoint
        (tmp_path / "saved").mkdir()
        for second, steps in enumerate((9, 10, 11)):
            path = tmp_path / "saved" / f"at_{steps}.pt"
            path.touch()
            os.utime(path, (second, second))
    run = training.Run(options(tmp_path, "--resume"), "Trial", "*/at_*.pt")
    assert run.checkpoint == tmp_path / "saved" / "at_11.pt"


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 0)
        run.log(10)
    with pytest.raises(SystemExit, match="already holds a run: continue it with --resume"):
        training.Run(options(tmp_path), "Trial")
    assert len(rows(tmp_path)) == 1


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("a file, in which no folder can be made")
    with pytest.raises(SystemExit, match=r"cannot write to .*out: "):
        training.Run(options(tmp_path / "file" / "out"), "Trial")


def test_a_curve_without_a_checkpoint_is_not_overwritten(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
    with pytest.raises(SystemExit, match=r"a learning curve, but no .*\.pt to resume from: choose"):
        training.Run(options(tmp_path), "Trial")
    assert len(rows(tmp_path)) == 1


def test_resuming_without_a_checkpoint_starts_from_the_beginning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with training.Run(options(tmp_path, "--resume"), "Trial", "model") as run:
        assert not run.resuming and run.steps_done == 0
        run.log(10)
    message = f"nothing to resume in {tmp_path}: the training starts from the beginning"
    assert message in capsys.readouterr().err
    with pytest.raises(SystemExit, match=r"a learning curve, but no model to resume from: choose"):
        training.Run(options(tmp_path, "--resume"), "Trial", "model")


# Ctrl-C.


def train(folder: Path, *arguments: str, interrupt_at: str = "") -> None:
    """A training loop of four rounds of ten steps; Ctrl-C may be pressed at one point."""

    def point(name: str) -> None:
        if name == interrupt_at:
            signal.raise_signal(signal.SIGINT)

    def save_at(steps: int) -> None:
        with run.saving("model") as path:
            path.write_text(str(steps)[:1])
            point(f"saving {steps}")
            path.write_text(str(steps))

    with training.Run(options(folder, "--steps", "40", *arguments), "Trial", "model") as run:
        point("setup")
        if run.resuming:
            run.resume_from(int(run.checkpoint.read_text()))
        else:
            save_at(0)
        while run.steps_done < run.total_steps:
            point(f"round {run.steps_done}")
            save_at(run.steps_done + 10)
            point(f"saved {run.steps_done + 10}")
            run.log(run.steps_done + 10)
        point("end")


def exit_code(function: Callable[..., object], *arguments: Any, **named: Any) -> object:
    with pytest.raises(SystemExit) as stopped:
        function(*arguments, **named)
    return stopped.value.code


@pytest.mark.parametrize(
    ("point", "checkpoint", "logged"),
    [
        ("setup", None, 0),
        ("saving 0", None, 0),
        ("round 0", 0, 0),
        ("saving 10", 0, 0),
        ("saved 10", 10, 0),
        ("round 10", 10, 1),
        ("saving 20", 10, 1),
        ("end", 40, 4),
    ],
)
def test_after_ctrl_c_a_run_resumes_from_its_last_checkpoint(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    point: str,
    checkpoint: int | None,
    logged: int,
) -> None:
    folder = tmp_path / "run"
    assert exit_code(train, folder, interrupt_at=point) == 130
    (message,) = (
        line for line in capsys.readouterr().err.splitlines() if line.startswith("interrupted")
    )
    if checkpoint is None:
        assert message == (
            f"interrupted before the first checkpoint: there is nothing to resume in {folder}; "
            "start again"
        )
        assert not list(folder.iterdir())
        train(folder, "--resume")
    else:
        assert message == (
            f"interrupted after {10 * logged} steps; --resume continues from the last "
            f"checkpoint, {folder / 'model'}"
        )
        assert (folder / "model").read_text() == str(checkpoint)
        assert "already holds a run" in str(exit_code(train, folder))
        train(folder, "--resume")
    steps = ["10", "20", "30", "40"]
    assert [row["steps"] for row in rows(folder)] == (steps[1:] if point == "saved 10" else steps)


@pytest.mark.usefixtures("plots")
def test_ctrl_c_plots_the_curve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            save(run, 1234)
            run.log(1234)
            raise KeyboardInterrupt

    assert exit_code(interrupted) == 130
    assert "interrupted after 1,234 steps; --resume continues" in capsys.readouterr().err
    assert (tmp_path / "curve.png").exists()


def test_ctrl_c_counts_while_the_curve_is_plotted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Curve, "draw", interrupt)
    assert exit_code(train, tmp_path) == 130
    assert "interrupted after 40 steps; --resume continues" in capsys.readouterr().err


def test_ctrl_c_counts_when_a_library_raises_another_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            save(run, 50)
            run.log(50)
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt:
                raise RuntimeError("not permitted")  # noqa: B904 (as in TorchRL's clean-up)

    assert exit_code(interrupted) == 130
    assert "interrupted after 50 steps; --resume continues" in capsys.readouterr().err


def test_ctrl_c_counts_when_a_library_suppresses_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = training.Run(options(tmp_path), "Trial")

    def interrupted() -> None:
        with run:
            run.log(1)
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            run.log(2)
            raise AssertionError("the training continues")

    assert exit_code(interrupted) == 130
    assert run.steps_done == 2
    assert "interrupted before the first checkpoint" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


IMPORTING = """
import time
from DroneSwarmSearch import training

training.exit_on_interrupt(__name__)
try:
    print("importing", flush=True)
    time.sleep(60)
except BaseException:
    print("suppressed", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
def test_ctrl_c_before_a_run_ends_a_script_with_one_line() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", IMPORTING], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        shown = process.communicate(timeout=60)
    assert process.returncode == 130
    assert shown == ("", "interrupted before the training began; nothing has been written\n")


def test_a_run_replaces_the_handler_of_ctrl_c_of_a_script(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGINT)
    training.exit_on_interrupt("a module")
    assert signal.getsignal(signal.SIGINT) is before
    training.exit_on_interrupt("__main__")
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 10)
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before is signal.default_int_handler


def test_ctrl_c_during_the_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def stop(observations: np.ndarray) -> np.ndarray:
        raise KeyboardInterrupt

    compare = training.compare_with_baselines
    assert exit_code(compare, stop, SMALL, episodes=5, folder=tmp_path) == 130
    assert f"the training in {tmp_path} is complete" in capsys.readouterr().err
    with pytest.raises(KeyboardInterrupt):
        compare(stop, SMALL, episodes=5)


def test_other_errors_are_raised(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), training.Run(options(tmp_path), "Trial") as run:
        run.log(1 // 0)


# Progress.


def test_progress_shows_the_latest_values_and_the_time_left(
    tmp_path: Path,
    clock: list[float],
    capsys: pytest.CaptureFixture[str],
) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 2500)
        clock[0] += 40
        run.log(2500, reward=-98_765.4, found=0.123)
    line = "Trial: 50%, about 40 s left, 12% found, return -98,765"
    assert line in capsys.readouterr().err.splitlines()
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        clock[0] += 40
        run.log(3750, reward=0.3251)  # as in a coverage mission
    line = "Trial: 75%, about 40 s left, 12% found, return 0.33"
    assert line in capsys.readouterr().err.splitlines()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_a_progress_bar(
    tmp_path: Path, clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with training.Run(options(tmp_path), "Trial") as run:
        clock[0] += 10
        run.log(1000, found=0.5)
    assert "20%" in terminal.getvalue() and "50% found" in terminal.getvalue()


# The comparison with the baselines.

SMALL: dict[str, Any] = {
    "grid_size": 5,
    "n_drones": 2,
    "vector": (0.0, 0.0),
    "person_initial_position": (2, 0),
    "disperse_constant": 0,
    "timestep_limit": 6,
}


def search_column_two(observations: np.ndarray) -> np.ndarray:
    """Fly to the right, and search in column 2; the first value is the drone's column."""
    column = np.rint(observations[:, 0] * 4).astype(int)
    return np.where(column == 2, Action.SEARCH, Action.RIGHT)


def always(action: Action) -> Callable[[np.ndarray], np.ndarray]:
    return lambda observations: np.full(len(observations), action)


def test_the_comparison_is_printed_and_saved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained, *others = training.compare_with_baselines(
        search_column_two, SMALL, episodes=30, name="mine", folder=tmp_path
    )
    names = ["mine", "random", "greedy-matrix", "greedy-posterior"]
    assert [each.policy for each in (trained, *others)] == names
    assert (trained.success.value, others[1].success.value) == (1.0, 1.0)
    assert {each.seed for each in (trained, *others)} == {1_000_000}
    shown = capsys.readouterr().out
    assert [name for line in shown.splitlines() for name in names if line.startswith(name)] == names
    random = next(line for line in shown.splitlines() if line.startswith("random"))
    gain = 100 * (1 - others[0].success.value)
    assert f"+{gain:.1f}" in random.split() and gain > 0
    with (tmp_path / "evaluation.csv").open(newline="") as file:
        saved = list(csv.DictReader(file))
    assert [row["policy"] for row in saved] == names
    assert {row["episodes"] for row in saved} == {"30"}


def test_a_policy_behind_a_baseline_has_a_negative_lead(
    capsys: pytest.CaptureFixture[str],
) -> None:
    idle = always(Action.IDLE)
    training.compare_with_baselines(idle, SMALL, episodes=20, baselines=["greedy-matrix"])
    greedy = next(
        line for line in capsys.readouterr().out.splitlines() if line.startswith("greedy")
    )
    assert "-100.0" in greedy.split() and "-4.0" in greedy.split()


def test_the_comparison_counts_crashes(capsys: pytest.CaptureFixture[str]) -> None:
    leave = always(Action.UP)
    training.compare_with_baselines(leave, SMALL, episodes=20, baselines=[])
    trained = next(
        line for line in capsys.readouterr().out.splitlines() if line.startswith("trained")
    )
    assert trained.split()[-1] == "100.0"


def test_the_comparison_accepts_start_cells(capsys: pytest.CaptureFixture[str]) -> None:
    task = {**SMALL, "drones_positions": [(2, 0), (4, 4)]}
    search = always(Action.SEARCH)
    (trained,) = training.compare_with_baselines(search, task, episodes=20, baselines=[])
    assert trained.search.drones == ((2, 0), (4, 4))
    assert (trained.success.value, trained.time.value) == (1.0, 1.0)


def test_the_comparison_accepts_other_layouts(capsys: pytest.CaptureFixture[str]) -> None:
    shapes = []

    def idle(observations: dict[str, np.ndarray]) -> np.ndarray:
        shapes.append(observations["position"].shape)
        return np.full(len(observations["position"]), Action.IDLE)

    view = View("drone", "dict")
    training.compare_with_baselines(idle, SMALL, episodes=3, view=view, baselines=[])
    assert set(shapes) <= {(6, 2)}
