"""What the training examples share: options, learning curves, runs, the comparison."""

from __future__ import annotations

import argparse
import csv
import io
import math
import pickle
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
    assert pickle.loads(pickle.dumps(training.EXERCISE)) == training.EXERCISE
    env = DroneSwarmSearch(**training.EXERCISE)
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
    with training.Run(options(tmp_path), "Trial") as run:
        for steps in (10, 20, 30):
            clock[0] += 1
            run.log(steps, loss=steps / 10)
            if steps == 20:
                with run.saving("model") as path:
                    path.write_text("at 20")
    clock[0] += 1000
    with training.Run(options(tmp_path, "--resume"), "Trial") as run:
        assert run.resumes and run.steps_done == 30
        assert run.checkpoint("model").read_text() == "at 20"
        run.go_on_from(20)
        assert run.steps_done == 20
        clock[0] += 5
        run.log(25, found=1.0)
    assert [row["steps"] for row in rows(tmp_path)] == ["10", "20", "25"]
    assert [row["seconds"] for row in rows(tmp_path)] == ["1", "2", "7"]
    assert [row["loss"] for row in rows(tmp_path)] == ["1", "2", ""]


def test_a_checkpoint_ahead_of_the_curve_counts(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
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


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    with training.Run(options(tmp_path), "Trial") as run:
        run.log(10)
    with pytest.raises(SystemExit, match="holds a run already: go on with it by --resume"):
        training.Run(options(tmp_path), "Trial")
    assert len(rows(tmp_path)) == 1


def test_what_is_not_there_is_not_resumed(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"nothing to resume in .*: no curve\.csv"):
        training.Run(options(tmp_path / "nowhere", "--resume"), "Trial")
    assert not (tmp_path / "nowhere").exists()
    with training.Run(options(tmp_path), "Trial") as run:
        assert run.checkpoint("model") == tmp_path / "model"
        run.log(10)
    with pytest.raises(SystemExit, match=r"nothing to resume in .*: no model"):
        training.Run(options(tmp_path, "--resume"), "Trial").checkpoint("model")


def test_ctrl_c_ends_the_program_with_the_curve_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")

    def train() -> None:
        with training.Run(options(tmp_path), "Trial") as run:
            run.log(1234)
            raise KeyboardInterrupt

    with pytest.raises(SystemExit) as stopped:
        train()
    assert stopped.value.code == 130
    assert "interrupted after 1,234 steps; --resume goes on" in capsys.readouterr().err
    assert (tmp_path / "curve.png").exists()


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
    pytest.importorskip("rich")
    monkeypatch.setenv("COLUMNS", "120")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with training.Run(options(tmp_path), "Trial") as run:
        clock[0] += 10
        run.log(1000, found=0.5)
    assert "20 %" in terminal.getvalue() and "50% found" in terminal.getvalue()


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
    assert points == ["+0.0", "(+0.0", "to", "+0.0)"] and steps[0] == "+0.0"
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
    assert "-100.0 (-100.0 to -100.0)" in greedy
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
        (DroneVectorEnv, {"observation": "glimpses", "grid_size": 5, "n_drones": 3}),
        # As many numbers as "flat" shows: 202, 3 k + 2 n + 1 for k = N² / 3, and n swarms.
        (DroneVectorEnv, {"observation": "glimpses", "grid_size": 13, "n_drones": 16}),
        (DroneVectorEnv, {"observation": "glimpses", "grid_size": 9, "n_drones": 60}),
        (
            DroneVectorEnv,
            {"observation": "top-cells", "top_cells": 12, "grid_size": 6, "n_drones": 2},
        ),
        (
            DroneVectorEnv,
            {"observation": "top-cells", "top_cells": 3, "grid_size": 3, "n_drones": 4},
        ),
        (DroneVectorEnv, {"observation": "top-cells", "grid_size": 8, "n_drones": 2}),
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
