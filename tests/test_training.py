"""What the training examples share: options, learning curves, runs, the comparison."""

from __future__ import annotations

import argparse
import contextlib
import csv
import io
import math
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from DroneSwarmSearch import Action, DroneSwarmSearch, training
from DroneSwarmSearch.evaluation import progress
from DroneSwarmSearch.training import curve as curves
from DroneSwarmSearch.training import run as runs
from DroneSwarmSearch.vector import DroneVectorEnv, SwarmVectorEnv

BY_DEFAULT = {"steps": 5000, "seed": 0, "resume": False, "short": False, "episodes": 1000}


def options(folder: Path, *given: str) -> argparse.Namespace:
    return training.arguments("Train.", steps=5000, short=70).parse_args(
        ["--out", str(folder), *given]
    )


def rows(folder: Path) -> list[dict[str, str]]:
    """What a program that knows nothing of ours reads from curve.csv."""
    with (folder / "curve.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that runs and progress see."""
    now = [100.0]
    for module in (runs, progress):
        monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    return now


# The exercise.


def test_the_exercise_is_a_search_that_can_be_sent_elsewhere() -> None:
    assert pickle.loads(pickle.dumps(training.TRAINING_TASK)) == training.TRAINING_TASK
    env = DroneSwarmSearch(**training.TRAINING_TASK)
    env.reset(seed=0)
    assert (env.grid_size, len(env.agents), env.timestep_limit) == (10, 2, 50)
    assert env.scenario.bayesian_update


# Options.


def test_options_have_defaults(tmp_path: Path) -> None:
    assert vars(options(tmp_path)) == {**BY_DEFAULT, "out": tmp_path}


def test_a_short_run_has_few_steps_and_episodes_unless_they_are_given(tmp_path: Path) -> None:
    short = options(tmp_path, "--short")
    assert (short.steps, short.episodes) == (70, 50)
    short = options(tmp_path, "--short", "--steps", "90", "--episodes", "7", "--seed", "3")
    assert (short.steps, short.episodes, short.seed) == (90, 7, 3)


def test_numbers_may_have_underscores(tmp_path: Path) -> None:
    assert options(tmp_path, "--steps", "1_000_000").steps == 10**6


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--steps", "0"), "--steps: must be an integer of at least 1, got '0'"),
        (("--steps", "many"), "--steps: must be an integer of at least 1, got 'many'"),
        (("--seed", "-1"), "--seed: must be an integer of at least 0, got '-1'"),
        (("--episodes", "0.5"), "--episodes: must be an integer of at least 1, got '0.5'"),
    ],
)
def test_wrong_options_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: tuple[str, ...], words: str
) -> None:
    with pytest.raises(SystemExit, match="2"):
        options(tmp_path, *given)
    assert words in capsys.readouterr().err


def test_a_folder_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        training.arguments("Train.", steps=5, short=1).parse_args([])
    assert "--out" in capsys.readouterr().err


def test_help_tells_the_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    parser = training.arguments("Train with care.", steps=50_000, short=700)
    parser.add_argument("--own", help="of this example")
    with pytest.raises(SystemExit, match="0"):
        parser.parse_args(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    for words in ("Train with care.", "(50,000)", "700 steps, 50 episodes", "of this example"):
        assert words in told


@pytest.mark.parametrize("name", ["steps", "short"])
def test_steps_of_an_example_are_checked(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be an integer of at least 1, got 0"):
        training.arguments("Train.", **{"steps": 5, "short": 1, name: 0})


# Learning curves.


def test_a_row_is_in_the_file_at_once(tmp_path: Path, clock: list[float]) -> None:
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


def test_numbers_of_steps_are_exact_however_large(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(123_456_789)
        run.log(123_456_790)
    assert [row["steps"] for row in rows(tmp_path)] == ["123456789", "123456790"]


def test_figures_of_ones_own_get_columns_whenever_they_come(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10, found=0.0)
        run.log(20, found=math.nan, loss=0.125)
        run.log(30, found=1.0)
        run.log(40, loss=0.25, entropy=1.5)
    assert list(rows(tmp_path)[0]) == ["steps", "seconds", "reward", "found", "loss", "entropy"]
    assert [row["found"] for row in rows(tmp_path)] == ["0", "", "1", ""]
    assert [row["loss"] for row in rows(tmp_path)] == ["", "0.125", "", "0.25"]
    assert [row["entropy"] for row in rows(tmp_path)] == ["", "", "", "1.5"]


def test_steps_must_rise(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
        with pytest.raises(ValueError, match="steps must be an integer of at least 11, got 10"):
            run.log(10)
        with pytest.raises(TypeError, match=r"steps must be an integer of at least 11, got 11\.5"):
            run.log(11.5)  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="figures must have names other than steps, seconds"):
            run.log(11, seconds=1.0)
    assert len(rows(tmp_path)) == 1


def test_a_line_cut_off_by_a_crash_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("steps,seconds,reward,found\n10,1,-5,0.5\n20,2,-4,0.")
    curve = training.Curve(path)
    assert curve.rows == [{"steps": 10, "seconds": 1, "reward": -5, "found": 0.5}]
    assert (curve.steps, curve.seconds) == (10, 1.0)


@pytest.mark.parametrize(
    ("text", "got"), [("", "nothing"), ("time,loss\n", "time,loss"), ("steps", "nothing")]
)
def test_other_files_are_no_curves(tmp_path: Path, text: str, got: str) -> None:
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(ValueError, match=f"must be a learning curve with the col.*, got '{got}'"):
        training.Curve(tmp_path / "curve.csv")


def test_the_moving_mean_is_over_a_twentieth_and_leaves_out_what_is_unknown() -> None:
    values = np.arange(40.0)
    assert curves.moving_mean(values)[:3].tolist() == [0.0, 0.5, 1.5]
    values[1] = math.nan
    assert curves.moving_mean(values)[:4].tolist() == [0.0, 0.0, 2.0, 2.5]
    unknown = np.array([math.nan, 3.0])
    assert np.isnan(curves.moving_mean(unknown)).tolist() == [True, False]
    assert curves.moving_mean(np.zeros(0)).shape == (0,)


def test_the_curve_is_drawn(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")

    def drawn(name: str, *found: float) -> np.ndarray:
        with training.Run(options(tmp_path / name), "Trial") as run:
            for step, share in enumerate(found, 1):
                run.log(100 * step, reward=-1e5 * share, found=share)
        with image.open(tmp_path / name / "curve.png") as picture:
            return np.asarray(picture.convert("RGB"))

    one, other = drawn("one", 0.1, 0.3, 0.8), drawn("other", 0.1, 0.3, math.nan)
    assert one.shape[1] > one.shape[0] > 500
    assert one.shape == other.shape and (one != other).any()
    assert (one[:5] == 255).all()  # on white


def test_without_matplotlib_the_run_goes_on_and_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
    assert "DroneSwarmSearchEnvironment[evaluation]" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["curve.csv"]


# Runs.


def test_a_run_goes_on_from_its_checkpoint(tmp_path: Path, clock: list[float]) -> None:
    with training.Run(options(tmp_path), "Trial", "model") as run:
        for steps in (10, 20, 30):
            clock[0] += 1
            run.log(steps, loss=steps / 10)
            if steps == 20:
                with run.saving("model") as path:
                    path.write_text("at 20")
    clock[0] += 1000
    with training.Run(options(tmp_path, "--resume"), "Trial", "model") as run:
        assert run.resumes and run.steps_done == 30
        assert run.checkpoint.read_text() == "at 20"
        run.go_on_from(20)
        assert run.steps_done == 20
        clock[0] += 5
        run.log(25, found=1.0)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "20", "25"]
    assert [row["seconds"] for row in rows(tmp_path)] == ["1", "2", "7"]
    assert [row["loss"] for row in rows(tmp_path)] == ["1", "2", ""]


def test_a_checkpoint_ahead_of_the_curve_counts(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 15)
        run.log(10)
    run = training.Run(options(tmp_path, "--resume"), "Trial")
    run.go_on_from(15)
    assert run.steps_done == 15
    run.log(20)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "20"]


def test_a_checkpoint_is_replaced_as_a_whole(tmp_path: Path) -> None:
    run = training.Run(options(tmp_path), "Trial")
    with run.saving("model.zip") as path:
        assert path.suffix == ".zip"
        path.write_text("first")

    def fail() -> None:
        with run.saving("model.zip") as path:
            path.write_text("sec")
            raise RuntimeError("in mid-work")

    with pytest.raises(RuntimeError, match="in mid-work"):
        fail()
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [
        ("model.zip", "first")
    ]


def save(run: training.Run, steps: int, name: str = "checkpoint.pt") -> None:
    with run.saving(name) as path:
        path.write_text(str(steps))


def test_a_checkpoint_without_a_curve_counts(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 0)
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        assert run.checkpoint.read_text() == "0"
        run.go_on_from(0)
        run.log(10)
    assert [row["steps"] for row in rows(tmp_path)] == ["10"]


def test_the_newest_of_the_checkpoints_of_a_pattern_counts(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial", "*/at_*.pt") as run:
        with pytest.raises(FileNotFoundError, match=r"no checkpoint \*/at_\*\.pt in"):
            _ = run.checkpoint
        (tmp_path / "saved").mkdir()
        for time, steps in enumerate((9, 10, 11)):
            path = tmp_path / "saved" / f"at_{steps}.pt"
            path.touch()
            os.utime(path, (time, time))
    run = training.Run(options(tmp_path, "--resume"), "Trial", "*/at_*.pt")
    assert run.checkpoint == tmp_path / "saved" / "at_11.pt"


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 0)
        run.log(10)
    with pytest.raises(SystemExit, match="holds a run already: go on with it by --resume"):
        training.Run(options(tmp_path), "Trial")
    assert len(rows(tmp_path)) == 1


def test_nor_is_the_curve_of_another_trainer(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
    with pytest.raises(SystemExit, match=r"a learning curve, but no .*\.pt to resume from: choose"):
        training.Run(options(tmp_path), "Trial")
    assert len(rows(tmp_path)) == 1


def test_what_is_not_there_is_not_resumed(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"nothing to resume in .*: no model; start without"):
        training.Run(options(tmp_path / "nowhere", "--resume"), "Trial", "model")
    assert not (tmp_path / "nowhere").exists()
    with training.Run(options(tmp_path), "Trial", "model") as run:
        run.log(10)
    with pytest.raises(SystemExit, match=r"no model; delete .*curve\.csv and start without --res"):
        training.Run(options(tmp_path, "--resume"), "Trial", "model")


def save_folder(run: training.Run, text: str) -> None:
    with run.saving_folder() as path:
        (path / "part").mkdir(parents=True)
        (path / "part" / "weights").write_text(text)


def weights(folder: Path) -> list[tuple[str, str]]:
    """The names and texts of all files there, hidden ones included."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return [(path.relative_to(folder).as_posix(), path.read_text()) for path in files]


def test_a_checkpoint_that_is_a_folder_is_replaced_as_a_whole(tmp_path: Path) -> None:
    run = training.Run(options(tmp_path), "Trial", "checkpoint")
    for text in ("first", "second"):
        save_folder(run, text)
        assert weights(tmp_path) == [("checkpoint/part/weights", text)]

    def stop() -> None:
        with run.saving_folder() as path:
            path.mkdir()
            (path / "weights").write_text("thi")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert weights(tmp_path) == [("checkpoint/part/weights", "second")]


@pytest.mark.parametrize("renamed", [0, 1, 2])
@pytest.mark.parametrize("killed", [False, True])
def test_a_folder_is_there_at_whatever_moment_the_program_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renamed: int, killed: bool
) -> None:
    """Stopped by Ctrl-C, or killed, before or after each of the two renamings."""
    run = training.Run(options(tmp_path), "Trial", "checkpoint")
    save_folder(run, "first")
    rename, calls = Path.rename, 0

    def stopping(self: Path, target: Path) -> Path:
        nonlocal calls
        if calls == renamed:
            calls += 1
            raise KeyboardInterrupt
        calls += 1
        path = rename(self, target)
        if calls == renamed == 2:
            raise KeyboardInterrupt
        return path

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", stopping)
        if killed:
            patch.setattr(training.Run, "_restore_replaced_folder", lambda run: None)
        with pytest.raises(KeyboardInterrupt):
            save_folder(run, "second")
    run = training.Run(options(tmp_path, "--resume"), "Trial", "checkpoint")
    kept = "second" if renamed == 2 else "first"
    assert weights(tmp_path) == [("checkpoint/part/weights", kept)]
    save_folder(run, "third")
    assert weights(tmp_path) == [("checkpoint/part/weights", "third")]


TRAINER = """
import os, signal, sys
sys.modules["matplotlib"] = None  # its import takes long
from DroneSwarmSearch import training

moment = os.environ.get("MOMENT")

def may_stop(now):
    if now == moment:
        os.kill(os.getpid(), signal.SIGINT)

def save(steps):
    with run.saving("model") as path:
        path.write_text(str(steps)[:1])
        may_stop(f"saving {steps}")
        path.write_text(str(steps))

options = training.arguments("Trial.", steps=40, short=20).parse_args()
with training.Run(options, "Trial", "model") as run:
    may_stop("setup")
    if run.resumes:
        run.go_on_from(int(run.checkpoint.read_text()))
    else:
        save(0)
    while run.steps_done < run.wanted:
        may_stop(f"round {run.steps_done}")
        save(run.steps_done + 10)
        may_stop(f"saved {run.steps_done}")
        run.log(run.steps_done + 10)
    may_stop("end")
print("trained", run.steps_done)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
@pytest.mark.parametrize(
    ("moment", "steps", "rows_left"),
    [
        ("setup", None, 0),
        ("saving 0", None, 0),
        ("round 0", 0, 0),
        ("saving 10", 0, 0),
        ("saved 0", 10, 0),
        ("round 10", 10, 1),
        ("saving 20", 10, 1),
        ("end", 40, 4),
    ],
)
def test_ctrl_c_says_what_is_there_and_that_is_true(
    tmp_path: Path, moment: str, steps: int | None, rows_left: int
) -> None:
    script, folder = tmp_path / "trainer.py", tmp_path / "run"
    script.write_text(TRAINER)

    def train(*arguments: str, moment: str = "") -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(script), "--out", str(folder), *arguments],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
            env={
                **os.environ,
                "MOMENT": moment,
                "PYTHONPATH": str(Path(__file__).parents[1]),
            },
        )

    stopped = train(moment=moment)
    assert (stopped.returncode, stopped.stdout) == (130, "")
    (told,) = (line for line in stopped.stderr.splitlines() if line.startswith("interrupted"))
    if steps is None:
        assert told == (
            f"interrupted before the first checkpoint: there is nothing to resume in {folder}; "
            "start without --resume"
        )
        assert not list(folder.iterdir())
    else:
        assert told == (
            f"interrupted after {10 * rows_left} steps; --resume goes on from the last "
            f"checkpoint, {folder / 'model'}"
        )
        assert (folder / "model").read_text() == str(steps)
    for arguments in ([], ["--resume"]):
        fits = bool(arguments) == (steps is not None)
        if not fits:
            refused = train(*arguments)
            assert refused.returncode == 1
            wanted = "holds a run already" if steps is not None else "nothing to resume"
            assert wanted in refused.stderr
    going_on = train(*(["--resume"] if steps is not None else []))
    assert going_on.stdout == "trained 40\n", going_on.stderr
    wanted = ["10", "20", "30", "40"]
    assert [row["steps"] for row in rows(folder)] == (wanted[1:] if moment == "saved 0" else wanted)


def test_ctrl_c_ends_the_program_with_the_curve_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")

    def train() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            save(run, 1234)
            run.log(1234)
            raise KeyboardInterrupt

    with pytest.raises(SystemExit) as stopped:
        train()
    assert stopped.value.code == 130
    assert "interrupted after 1,234 steps; --resume goes on" in capsys.readouterr().err
    assert (tmp_path / "curve.png").exists()


def test_ctrl_c_while_the_curve_is_drawn_is_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(training.Curve, "draw", interrupted)

    def train() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            save(run, 50)
            run.log(50)

    with pytest.raises(SystemExit) as stopped:
        train()
    assert stopped.value.code == 130
    assert "interrupted after 50 steps; --resume goes on" in capsys.readouterr().err


def test_an_error_that_a_library_makes_of_ctrl_c_is_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def train() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            save(run, 50)
            run.log(50)
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt:
                raise RuntimeError("not permitted")  # noqa: B904 (as in TorchRL's clean-up)

    with pytest.raises(SystemExit) as stopped:
        train()
    assert stopped.value.code == 130
    assert "interrupted after 50 steps; --resume goes on" in capsys.readouterr().err


def test_ctrl_c_without_a_checkpoint_says_what_is_in_the_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def train() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            run.log(50)
            raise KeyboardInterrupt

    with pytest.raises(SystemExit):
        train()
    told = capsys.readouterr().err
    assert f"delete {tmp_path / 'curve.csv'} and start without --resume" in told
    assert "goes on" not in told


def test_ctrl_c_in_the_comparison_says_what_is_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(seen: np.ndarray) -> np.ndarray:
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as stopped:
        training.compare_with_baselines(stop, SMALL, episodes=5, folder=tmp_path)
    assert stopped.value.code == 130
    assert f"the training in {tmp_path} is complete" in capsys.readouterr().err
    with pytest.raises(KeyboardInterrupt):
        training.compare_with_baselines(stop, SMALL, episodes=5)


def test_other_errors_come_through(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), training.Run(options(tmp_path), "Trial") as run:
        run.log(1 // 0)


def told(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What was told of the progress; without matplotlib the picture is missed as well."""
    lines = capsys.readouterr().err.splitlines()
    return [line for line in lines if "matplotlib" not in line]


def test_progress_tells_the_latest_figures_and_the_time_left_of_this_run(
    tmp_path: Path, clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        save(run, 2500)
        clock[0] += 40
        run.log(2500, reward=-98_765.4, found=0.123)
    assert told(capsys) == ["Trial: 50%, about 40 s left, 12% found, return -98,765"]
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        clock[0] += 40
        run.log(3750)
    assert told(capsys) == ["Trial: 75%, about 40 s left, 12% found, return -98,765"]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_the_figures_stand_behind_the_bar(
    tmp_path: Path, clock: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with training.Run(options(tmp_path), "Trial") as run:
        clock[0] += 10
        run.log(1000, found=0.5)
    assert "20%" in terminal.getvalue() and "50% found" in terminal.getvalue()


# The comparison.


class SearchOnTheWay:
    """Flies right, searching every other cell: leaves the grid in the end."""

    def __call__(self, seen: np.ndarray) -> np.ndarray:
        """Actions for flat observations, whose first number is the drone's column."""
        column = np.rint(seen[:, 0] * 4).astype(int)
        return np.where(column == 2, Action.SEARCH, Action.RIGHT)


SMALL: dict[str, Any] = {
    "grid_size": 5,
    "n_drones": 2,
    "vector": (0.0, 0.0),
    "person_initial_position": (2, 0),
    "disperse_constant": 0,
    "timestep_limit": 6,
}


def test_the_comparison_prints_a_table_and_saves_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine, *rivals = training.compare_with_baselines(
        SearchOnTheWay(), SMALL, episodes=30, name="mine", folder=tmp_path
    )
    assert [each.policy for each in rivals] == ["random", "greedy-matrix", "greedy-posterior"]
    assert (mine.success.value, rivals[1].success.value) == (1.0, 1.0)
    assert {each.seed for each in (mine, *rivals)} == {1_000_000}
    table = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in table[2:6]] == ["mine", *(each.policy for each in rivals)]
    assert table[2].split()[1:] == ["100.0", "(88.6-100.0)", "2.0", "(2.0-2.0)", "0.0"]
    points, steps = table[4].split()[-8:-4], table[4].split()[-4:]
    assert points == ["+0.0", "(-11.4", "to", "+11.4)"] and steps[0] == "+0.0"
    gain = 100 * (1 - rivals[0].success.value)
    assert f"+{gain:.1f}" in table[3].split() and gain > 0
    with (tmp_path / "evaluation.csv").open(newline="") as file:
        saved = list(csv.DictReader(file))
    assert [row["policy"] for row in saved] == ["mine", *(each.policy for each in rivals)]
    assert {row["episodes"] for row in saved} == {"30"}


def test_a_negative_lead_is_one_too_late(capsys: pytest.CaptureFixture[str]) -> None:
    def idle(seen: np.ndarray) -> np.ndarray:
        return np.full(len(seen), Action.IDLE)

    training.compare_with_baselines(idle, SMALL, episodes=20, baselines=["greedy-matrix"])
    mine, greedy = capsys.readouterr().out.splitlines()[2:4]
    assert mine.split() == ["trained", "0.0", "(0.0-16.1)", "6.0", "(6.0-6.0)", "0.0"]
    assert "-100.0 (-100.0 to -77.2)" in greedy
    assert "-4.0 (-4.0 to -4.0)" in greedy


def test_mishaps_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    def leave(seen: np.ndarray) -> np.ndarray:
        return np.full(len(seen), Action.UP)

    training.compare_with_baselines(leave, SMALL, episodes=20, baselines=[])
    assert capsys.readouterr().out.splitlines()[2].split()[-1] == "100.0"


def test_start_cells_may_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    def search(seen: np.ndarray) -> np.ndarray:
        return np.full(len(seen), Action.SEARCH)

    there = {**SMALL, "drones_positions": [(2, 0), (4, 4)]}
    (mine,) = training.compare_with_baselines(search, there, episodes=20, baselines=[])
    assert mine.search.drones == ((2, 0), (4, 4))
    assert (mine.success.value, mine.time.value) == (1.0, 1.0)


def test_the_policy_may_be_shown_other_layouts(capsys: pytest.CaptureFixture[str]) -> None:
    shapes = []

    def idle(seen: np.ndarray) -> np.ndarray:
        shapes.append(seen["position"].shape)
        return np.full(len(seen["position"]), Action.IDLE)

    training.compare_with_baselines(idle, SMALL, episodes=3, observation="dict", baselines=[])
    assert set(shapes) <= {(6, 2)}


# Masks of flat observations.


@pytest.mark.parametrize("right_of_way", [False, True])
@pytest.mark.parametrize(("grid_size", "n_drones"), [(2, 1), (2, 4), (5, 3), (13, 16), (41, 2)])
def test_masks_told_by_flat_observations_are_those_of_the_view(
    grid_size: int, n_drones: int, right_of_way: bool
) -> None:
    parameters = {"grid_size": grid_size, "n_drones": n_drones, "timestep_limit": 20}
    env = DroneVectorEnv(7, observation="flat", bayesian_update=True, **parameters)
    seen, _ = env.reset(seed=1)
    for _ in range(40):
        masks = training.masks_of_flat(seen, parameters, right_of_way)
        assert masks.tolist() == env.action_masks(right_of_way).tolist()
        seen, *_ = env.step(env.action_space.sample())


@pytest.mark.parametrize(
    ("view", "shown"),
    [
        (DroneVectorEnv, {"observation": "crops", "grid_size": 5, "n_drones": 3}),
        # As many numbers as "flat" shows: 202, 3 k + 2 n + 1 for k = N² / 3, and n swarms.
        (DroneVectorEnv, {"observation": "crops", "grid_size": 13, "n_drones": 16}),
        (DroneVectorEnv, {"observation": "crops", "grid_size": 9, "n_drones": 60}),
        (
            DroneVectorEnv,
            {"observation": "top-cells", "top_cells": 12, "grid_size": 6, "n_drones": 2},
        ),
        (
            DroneVectorEnv,
            {"observation": "top-cells", "top_cells": 3, "grid_size": 3, "n_drones": 4},
        ),
        (DroneVectorEnv, {"observation": "top-cells", "grid_size": 8, "n_drones": 2}),
        *(
            (
                DroneVectorEnv,
                {"observation": "top-cells", "top_cells": k, "grid_size": n, "n_drones": 1},
            )
            for n, k in ((3, 3), (6, 12), (9, 27), (12, 48))
        ),
        (DroneVectorEnv, {"observation": "planes", "grid_size": 4, "n_drones": 2}),
        (SwarmVectorEnv, {"observation": "flat", "grid_size": 5, "n_drones": 2}),
        (SwarmVectorEnv, {"observation": "flat", "grid_size": 4, "n_drones": 3}),
    ],
)
def test_masks_are_told_by_flat_observations_of_drones_alone(
    view: type[DroneVectorEnv], shown: dict[str, Any]
) -> None:
    parameters = {key: shown[key] for key in ("grid_size", "n_drones")}
    env = view(2 * parameters["n_drones"], person_initial_position=(2, 1), **shown)
    seen, _ = env.reset(seed=0)
    for _ in range(5):
        with pytest.raises(ValueError, match="seen must be observations in the layout 'flat'"):
            training.masks_of_flat(seen, parameters)
        seen, *_ = env.step(env.action_space.sample())


def test_masks_are_told_by_whole_swarms_of_the_same_search() -> None:
    parameters = {"grid_size": 5, "n_drones": 3}
    env = DroneVectorEnv(4, observation="flat", **parameters)
    seen, _ = env.reset(seed=0)
    assert training.masks_of_flat(seen[:0], parameters).shape == (0, 6)
    for wrong in (seen[:-1], seen[0], seen[::-1], seen[[0, 3, 6]], seen * 0.9, seen * np.nan):
        with pytest.raises(ValueError, match="seen must be observations in the layout 'flat'"):
            training.masks_of_flat(wrong, parameters)
    for other in ({"grid_size": 6, "n_drones": 3}, {"grid_size": 5, "n_drones": 4}):
        with pytest.raises(ValueError, match=r"seen must be .* for grid_size="):
            training.masks_of_flat(seen, other)
    with pytest.raises(TypeError, match="seen must be an array of floats, got int64"):
        training.masks_of_flat(seen.astype(np.int64), parameters)
    with pytest.raises(ValueError, match="seen must be one array of observations"):
        training.masks_of_flat([[0.0], [0.0, 1.0]], parameters)
    with pytest.raises(ValueError, match="parameters must hold 'n_drones'"):
        training.masks_of_flat(seen, {"grid_size": 5})
    with pytest.raises(TypeError, match="parameters must be a mapping, got 5"):
        training.masks_of_flat(seen, 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="right_of_way must be True or False, got 1"):
        training.masks_of_flat(seen, parameters, 1)  # type: ignore[arg-type]


def test_a_swallowed_ctrl_c_is_heard_at_the_next_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some code of libraries cannot raise: callbacks from C, for one."""
    options = training.arguments("Train.", steps=10, short=5).parse_args(
        ["--out", str(tmp_path / "run")]
    )
    run = training.Run(options, "test")

    def train() -> None:
        with run:
            run.log(1)
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            run.log(2)
            raise AssertionError("it trains on")

    with pytest.raises(SystemExit) as stopped:
        train()
    assert stopped.value.code == 130
    assert run.steps_done == 2
    assert "interrupted before the first checkpoint" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
