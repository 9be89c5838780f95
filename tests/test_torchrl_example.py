"""The TorchRL example: short runs as users run it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from trainer_examples import EXAMPLES, check_folder, check_table, interrupt, python, rows

pytest.importorskip("torchrl")

import torch

pytestmark = pytest.mark.slow

EXAMPLE = EXAMPLES / "train_torchrl.py"


@pytest.mark.parametrize("critic", ["local", "central"])
def test_it_trains_resumes_and_compares(critic: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = (EXAMPLE, "--short", "--out", folder, "--critic", critic)
    check_table(python(*arguments), "torchrl-ppo", 50)
    assert check_folder(folder, "checkpoint.pt", "torchrl-ppo") == [5000, 10000]
    first = rows(folder / "curve.csv")
    before = torch.load(folder / "checkpoint.pt", weights_only=True)
    assert before["steps"] == 10000

    check_table(python(*arguments, "--resume", "--steps", 12000), "torchrl-ppo", 50)
    assert check_folder(folder, "checkpoint.pt", "torchrl-ppo") == [5000, 10000, 15000]
    assert rows(folder / "curve.csv")[:2] == first
    after = torch.load(folder / "checkpoint.pt", weights_only=True)
    assert after["steps"] == 15000
    assert any(bool((after["loss"][key] != old).any()) for key, old in before["loss"].items())
    moments = after["optimiser"]["state"][0]["step"]
    assert float(moments) == 1.5 * float(before["optimiser"]["state"][0]["step"])


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".checkpoint.*", "checkpoint.pt", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_torchrl", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()
