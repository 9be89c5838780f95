"""Tools for training: the task, learning curves, the comparison with the baselines."""

import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trainer_examples import module

from DroneSwarmSearch import Action, Scenario, cli, training
from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.evaluation import View, evaluate, search
from DroneSwarmSearch.training.curve import read_columns

ROOT = Path(__file__).parents[1]

begin: Any = module("training_script").begin


def test_rows_are_appended_and_printed(tmp_path, capsys):
    path = tmp_path / "curve.csv"
    training.log_row(path, steps=123_456_789, found=math.nan)
    training.log_row(path, steps=123_456_790, found=1 / 3)
    assert path.read_text() == "steps,found\n123456789,nan\n123456790,0.333333\n"
    assert "steps 123456790, found 0.333333" in capsys.readouterr().out
    columns = read_columns(path)
    assert columns["steps"].tolist() == [123_456_789, 123_456_790]
    assert columns["found"].tolist() == pytest.approx([math.nan, 1 / 3], abs=1e-6, nan_ok=True)


def test_curves_are_plotted_with_the_baselines(tmp_path, monkeypatch):
    figure = pytest.importorskip("matplotlib.figure").Figure
    drawn = []
    savefig = figure.savefig
    monkeypatch.setattr(
        figure, "savefig", lambda self, *args, **how: drawn.append(self) or savefig(self, *args)
    )
    paths = [tmp_path / "first.csv", tmp_path / "second.csv"]
    for number, path in enumerate(paths):
        for step in range(40 * number, 40 * number + 40):
            other = math.nan if step % 2 else step / 160
            training.log_row(path, steps=step, **{"a/found_here": step / 80, "other": other})
    searches = [Scenario(**{**SMALL, "person_initial_position": (x, 0)}) for x in (2, 4)]
    baselines = [evaluate("greedy-matrix", each, episodes=2, progress=False) for each in searches]
    training.plot_curve(*paths, columns=["a/found_here", "other"], baselines=baselines)
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    [axes] = drawn[0].axes
    mean = 50 * sum(each.success.value for each in baselines)
    labelled = {line.get_label(): line for line in axes.lines if line.get_label()[0] != "_"}
    assert [*labelled] == ["found here", "other", "single rows", f"greedy-matrix {mean:.1f}%"]
    assert labelled[f"greedy-matrix {mean:.1f}%"].get_ydata()[0] == pytest.approx(mean / 100)
    assert {line.get_marker() for line in labelled.values()} >= {"", "o"}  # 40 and 20 rows
    assert axes.get_xlim()[0] == 0 and axes.get_ylim()[0] == 0
    with pytest.raises(KeyError, match="reward"):
        training.plot_curve(paths[0], columns=["reward"])


def test_a_trained_policy_samples_allowed_actions_by_its_seed():
    logits = np.tile([0.0, 1.0, -1e9, 0.0, 2.0, -1e9], (2000, 1))
    policy = TrainedPolicy(lambda observations: logits)
    policy.reset(seed=[1, 2])
    actions = policy(None)
    shares = np.bincount(actions, minlength=6) / 2000
    expected = np.exp(logits[0]) / np.exp(logits[0]).sum()
    assert shares == pytest.approx(expected, abs=0.05) and shares[2] == shares[5] == 0
    assert (policy(None) != actions).any()
    policy.reset(seed=[1, 2])
    assert (policy(None) == actions).all()
    assert (TrainedPolicy(lambda observations: logits, deterministic=True)(None) == 4).all()
    with pytest.raises(TypeError, match="deterministic must be True or False, got 1"):
        TrainedPolicy(lambda observations: logits, 1)  # type: ignore[arg-type]


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


def test_the_comparison_is_printed_and_saved(tmp_path, capsys):
    pytest.importorskip("imageio_ffmpeg")
    trained, *others = training.compare_with_baselines(
        search_column_two,
        SMALL,
        view=View("drone", "flat"),
        episodes=30,
        name="mine",
        folder=tmp_path,
    )
    names = ["mine", "random", "greedy-matrix", "greedy-posterior"]
    assert [each.policy for each in (trained, *others)] == names
    assert (trained.success.value, others[1].success.value) == (1.0, 1.0)
    assert {each.seed for each in (trained, *others)} == {1_000_000}
    shown = capsys.readouterr().out
    first = shown.split("\n\n")[0].splitlines()
    assert [name for line in first for name in names if line.startswith(name)] == names
    random = " ".join(line for line in shown.splitlines() if line.startswith("random"))
    gain = 100 * (1 - others[0].success.value)
    assert f"+{gain:.1f}" in random.split() and gain > 0
    with (tmp_path / "evaluation.csv").open(newline="") as file:
        saved = list(csv.DictReader(file))
    assert [row["policy"] for row in saved] == names
    assert {row["episodes"] for row in saved} == {"30"}
    assert search(str(tmp_path / "search.json")).fingerprint == trained.search.fingerprint
    assert (tmp_path / "video.gif").read_bytes().startswith(b"GIF89a")
    assert "--policy" not in shown


def test_a_policy_given_as_text_can_be_played(tmp_path, capsys):
    pytest.importorskip("imageio_ffmpeg")
    training.compare_with_baselines(
        "greedy-matrix", SMALL, episodes=1, folder=tmp_path, baselines=[]
    )
    command = capsys.readouterr().out.splitlines()[-1].partition(": ")[2].split()
    assert command[:3] == ["python", "-m", "DroneSwarmSearch"]
    cli.main([*command[3:], "--text"])
    assert "found" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("files", "arguments", "message"),
    [
        ([], ["--resume"], "runs holds no training to resume"),
        (["model1.zip"], [], "runs holds a training to resume"),
        ([], ["--steps", "x"], "argument --steps: invalid int value: 'x'"),
        (None, ["--steps", "3"], ""),
        (["model1.zip"], ["--resume"], ""),
    ],
)
def test_scripts_begin_in_a_new_folder_or_resume(
    files, arguments, message, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["train.py", "--out", "runs", *arguments])
    for name in files or ():
        Path("runs").mkdir(exist_ok=True)
        Path("runs", name).touch()
    steps = {"type": int, "default": 7, "help": "in all"}
    if message:
        with pytest.raises(SystemExit):
            begin("Train.", "model*.zip", steps=steps)
        assert message in capsys.readouterr().err
        return
    options = begin("Train.", "model*.zip", steps=steps)
    assert options.steps == (3 if files is None else 7) and Path("runs").is_dir()
    assert (options.seed, options.threads, options.episodes) == (0, 1, 1000)
    monkeypatch.setattr(sys, "argv", ["train.py", "--out", "runs"])
    with pytest.raises(SystemExit):
        begin("Train.")
