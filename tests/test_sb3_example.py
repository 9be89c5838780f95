"""The example for Stable-Baselines3, run as users run it, and its parts."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from trainer_examples import check_folder, check_table, interrupt, module, run

from DroneSwarmSearch import Action, training
from DroneSwarmSearch.rules import Ending

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

EXAMPLE = "train_sb3"
FOUND = Ending.FOUND


def needs(name: str) -> pytest.MarkDecorator:
    return pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"{name} is missing")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return module(EXAMPLE)


@pytest.mark.slow
@pytest.mark.parametrize(
    "way",
    [
        (),
        pytest.param(("--mask",), marks=needs("sb3_contrib")),
        pytest.param(("--supersuit",), marks=needs("supersuit")),
    ],
    ids=["batched", "masked", "supersuit"],
)
def test_it_trains_resumes_and_compares(tmp_path: Path, way: tuple[str, ...]) -> None:
    small = ("--num-envs", 8, "--episodes", 20, "--out", tmp_path, *way)
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
    assert (tmp_path / "model.zip").read_bytes() == second  # all was done before


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as on POSIX")
@pytest.mark.parametrize("moment", ["", ".model.*", "model.zip", "curve.csv"])
def test_ctrl_c_says_what_is_there(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_sb3", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()


def test_masks_read_from_observations_are_the_views(example: ModuleType) -> None:
    env = example.batched(5, seed=3)
    env.reset()
    rng = np.random.default_rng(0)
    masked_out = 0
    for _ in range(60):
        masks = np.stack(env.env_method("action_masks"))
        actions = np.array([rng.choice(mask.nonzero()[0]) for mask in masks])
        seen, _, _, _ = env.step(actions)
        read = training.masks_of_flat(seen, training.TRAINING_TASK)
        assert (read == np.stack(env.env_method("action_masks"))).all()
        masked_out += int((~masks).sum())
    assert masked_out > 100


def both(example: ModuleType) -> tuple[Any, Any]:
    """The two kinds of environments, at the beginning of the same episodes."""
    batched, wrapped = example.batched(3, seed=7), example.wrapped(3, seed=7)
    batched.reset()  # the first episodes, which SuperSuit's form begins when it is seeded
    assert (batched.reset() == wrapped.reset()).all()
    return batched, wrapped


@needs("supersuit")
@pytest.mark.filterwarnings("ignore:The `render_mode` attribute")
def test_supersuit_steps_through_the_same_searches_as_the_batch(example: ModuleType) -> None:
    batched, wrapped = both(example)
    assert batched.observation_space == wrapped.observation_space
    assert batched.action_space == wrapped.action_space
    rng, ended = np.random.default_rng(0), 0
    for _ in range(200):
        actions = rng.choice(len(Action), 6, p=[0.05, 0.15, 0.05, 0.15, 0.4, 0.2])
        seen, rewards, dones, infos = batched.step(actions)
        theirs, their_rewards, their_dones, their_infos = wrapped.step(actions)
        assert (seen == theirs).all()
        assert (rewards == their_rewards).all()
        assert (dones == their_dones).all()
        for slot in dones.nonzero()[0]:
            last = infos[slot]["terminal_observation"]
            assert (last == their_infos[slot]["terminal_observation"]).all()
            ended += 1
    assert ended > 20


def test_the_record_has_every_episode(
    example: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    apart = {"drones_positions": [(0, 0), (5, 5)]}  # who is hit while finding is not paid for it
    near = {"grid_size": 6, "person_initial_position": (1, 0), "vector": (0.0, 0.0)}
    monkeypatch.setattr(example, "TRAINING_TASK", {**training.TRAINING_TASK, **near, **apart})

    class Count(BaseCallback):
        """Counts episodes by what the engine says of them."""

        def __init__(self) -> None:
            super().__init__()
            self.found: list[bool] = []

        def _on_step(self) -> bool:
            endings = self.training_env.get_attr("batch")[0].endings
            self.found += (endings[endings > 0] == FOUND).tolist()
            return True

    env = example.batched(16, seed=0)
    model = PPO("MlpPolicy", env, n_steps=40, batch_size=1280, n_epochs=1, seed=0, device="cpu")
    options = training.arguments("", steps=640, short=1).parse_args(["--out", str(tmp_path)])
    count = Count()
    with training.Run(options, "PPO") as record:
        model.learn(2 * 640, [count, example.Record(record)])
        (row,) = record.curve.rows
    assert 5 < sum(count.found) < len(count.found) - 5
    assert row["found"] == pytest.approx(np.mean(count.found))
    assert row["steps"] == 640
    returns = [episode["r"] / example.SCALE for episode in model.ep_info_buffer]
    assert min(returns) - 1 <= row["reward"] <= max(returns) + 1
