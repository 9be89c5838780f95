"""The Stable-Baselines3 example: its environments, and short runs as users run it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from trainer_examples import check_folder, check_table, interrupt, module, rows, run

from DroneSwarmSearch import Action, Ending, training

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

EXAMPLE = "train_sb3"


def needs(name: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"{name} is missing")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module(EXAMPLE)


@pytest.mark.slow
@pytest.mark.parametrize(
    "variant",
    [
        (),
        pytest.param(("--mask",), marks=needs("sb3_contrib")),
        pytest.param(("--supersuit",), marks=needs("supersuit")),
    ],
    ids=["batched", "masked", "supersuit"],
)
def test_it_trains_resumes_and_compares(tmp_path: Path, variant: tuple[str, ...]) -> None:
    small = ("--num-envs", 8, "--episodes", 20, "--out", tmp_path, *variant)
    output = run(EXAMPLE, "--short", "--steps", 1000, *small)
    check_table(output, "ppo", 20)
    assert check_folder(tmp_path, "model.zip", "ppo") == [512, 1024]
    first = (tmp_path / "model.zip").read_bytes()
    output = run(EXAMPLE, "--resume", "--steps", 2000, *small)
    check_table(output, "ppo", 20)
    assert check_folder(tmp_path, "model.zip", "ppo") == [512, 1024, 1536, 2048]
    second = (tmp_path / "model.zip").read_bytes()
    assert first != second
    run(EXAMPLE, "--resume", "--steps", 2000, *small)
    assert (tmp_path / "model.zip").read_bytes() == second  # nothing left to train


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".model.*", "model.zip", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_sb3", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()


@needs("supersuit")
@pytest.mark.filterwarnings("ignore:The `render_mode` attribute")
def test_the_batch_and_supersuit_step_through_the_same_episodes(example: ModuleType) -> None:
    batch, supersuit = example.make_batch(3, seed=7), example.make_supersuit(3, seed=7)
    batch.reset()  # SuperSuit starts its first episodes when it is seeded
    assert (batch.reset() == supersuit.reset()).all()
    assert batch.observation_space == supersuit.observation_space
    assert batch.action_space == supersuit.action_space
    rng, ended = np.random.default_rng(0), 0
    for _ in range(200):
        actions = rng.choice(len(Action), 6, p=[0.05, 0.15, 0.05, 0.15, 0.4, 0.2])
        *one, infos = batch.step(actions)
        *other, other_infos = supersuit.step(actions)
        assert all((a == b).all() for a, b in zip(one, other, strict=True))
        for i in one[-1].nonzero()[0]:
            last = infos[i]["terminal_observation"]
            assert (last == other_infos[i]["terminal_observation"]).all()
            ended += 1
    assert ended > 20


def test_the_curve_counts_every_episode(
    example: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = {"grid_size": 6, "person_initial_position": (1, 0), "vector": (0.0, 0.0)}
    distant = {"drones_positions": [(0, 0), (5, 5)]}  # no collision in the step of a find
    monkeypatch.setattr(example, "TRAINING_TASK", {**training.TRAINING_TASK, **task, **distant})

    class CountFinds(BaseCallback):
        def __init__(self) -> None:
            super().__init__()
            self.found: list[bool] = []

        def _on_step(self) -> bool:
            endings = self.training_env.get_attr("batch")[0].endings
            self.found += (endings[endings > 0] == Ending.FOUND).tolist()
            return True

    env = example.make_batch(16, seed=0)
    model = PPO("MlpPolicy", env, n_steps=40, batch_size=1280, n_epochs=1, seed=0, device="cpu")
    options = training.arguments("", steps=640, short=1).parse_args(["--out", str(tmp_path)])
    count = CountFinds()
    with training.Run(options, "PPO") as record:
        model.learn(2 * 640, [count, example.CurveCallback(record)])
    (row,) = rows(tmp_path / "curve.csv")
    assert 5 < sum(count.found) < len(count.found) - 5
    assert float(row["found"]) == pytest.approx(np.mean(count.found), rel=1e-5)
    assert row["steps"] == "640"
    returns = [episode["r"] / example.REWARD_SCALE for episode in model.ep_info_buffer]
    assert min(returns) - 1 <= float(row["reward"]) <= max(returns) + 1
