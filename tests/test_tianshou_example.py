"""The Tianshou example, run as users run it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest
from trainer_examples import check_folder, check_table, interrupt, rows, run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("tianshou") is None, reason="tianshou is not installed"
    ),
]

EXAMPLE = "train_tianshou"
NAME = "tianshou-ppo"


def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    import torch

    small = ("--num-envs", 8, "--episodes", 20, "--out", tmp_path)
    check_table(run(EXAMPLE, "--short", *small), NAME, 20)
    trained = check_folder(tmp_path, "model.pt", NAME)
    assert 2_000 <= trained[-1] < 2_000 + 8 * 64
    first = torch.load(tmp_path / "model.pt")
    check_table(run(EXAMPLE, "--resume", "--steps", 4_000, *small), NAME, 20)
    steps = check_folder(tmp_path, "model.pt", NAME)
    assert steps[: len(trained)] == trained and 4_000 <= steps[-1] < 4_000 + 8 * 64
    second = torch.load(tmp_path / "model.pt")
    assert (first["steps"], second["steps"]) == (trained[-1], steps[-1])
    assert any(
        (first["ppo"][name] != second["ppo"][name]).any()
        for name in first["ppo"]
        if name.startswith("policy.")
    )


def test_a_seed_determines_the_training(tmp_path: Path) -> None:
    curves = []
    for number, seed in enumerate((1, 1, 2)):
        folder = tmp_path / str(number)
        short = ("--short", "--num-envs", 8, "--episodes", 5)
        run(EXAMPLE, *short, "--seed", seed, "--out", folder)
        curves.append([(row["reward"], row["found"]) for row in rows(folder / "curve.csv")])
    assert curves[0] == curves[1] != curves[2]


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", "model.pt", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt(EXAMPLE, folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()
