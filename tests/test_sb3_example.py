"""The Stable-Baselines3 example: short runs, as users run it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from trainer_examples import check_folder, check_table, interrupt, run

pytest.importorskip("sb3_contrib")

EXAMPLE = "train_sb3"


@pytest.mark.slow
def test_it_trains_resumes_and_compares(tmp_path: Path) -> None:
    small = ("--episodes", 20, "--out", tmp_path)
    output = run(EXAMPLE, "--short", *small)
    check_table(output, "maskable-ppo", 20)
    assert check_folder(tmp_path, "model.zip", "maskable-ppo") == [5000]
    first = (tmp_path / "model.zip").read_bytes()
    output = run(EXAMPLE, "--resume", "--steps", 10_000, *small)
    check_table(output, "maskable-ppo", 20)
    assert check_folder(tmp_path, "model.zip", "maskable-ppo") == [5000, 10_000]
    second = (tmp_path / "model.zip").read_bytes()
    assert first != second
    run(EXAMPLE, "--resume", "--steps", 10_000, *small)
    assert (tmp_path / "model.zip").read_bytes() == second  # nothing left to train


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".model.*", "model.zip", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_sb3", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()
