"""The environment in TorchRL, and the TorchRL example."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trainer_examples import EXAMPLES, check_folder, check_table, interrupt, python, rows

from DroneSwarmSearch import Action, DroneSwarmSearch, training
from DroneSwarmSearch.wrappers import (
    ActionMask,
    CropsObservation,
    DictObservation,
    FlatObservation,
    OtherDrones,
    PlanesObservation,
    ScaledRewards,
    SeparateFlags,
    TopCellsObservation,
)

pytest.importorskip("torchrl")

import torch
from tensordict import TensorDictBase
from torchrl.envs import EnvBase, PettingZooWrapper, check_env_specs

pytestmark = [
    pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL is tested using"),
    pytest.mark.filterwarnings("ignore:Creating .* which inherits from WeightUpdaterBase"),
]

EXAMPLE = EXAMPLES / "train_torchrl.py"

LAYOUTS: dict[str, Callable[[Any], Any]] = {
    "dict": DictObservation,
    "dict with other drones": lambda env: OtherDrones(DictObservation(env)),
    "flat": FlatObservation,
    "planes": PlanesObservation,
    "top cells": TopCellsObservation,
    "crops": CropsObservation,
}


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    """The names of the example."""
    return runpy.run_path(str(EXAMPLE))


def search(**arguments: Any) -> DroneSwarmSearch:
    return DroneSwarmSearch(**{**training.TRAINING_TASK, **arguments})


def wrapped(env: Any, **arguments: Any) -> EnvBase:
    return PettingZooWrapper(env, group_map={"drones": env.possible_agents}, **arguments)


def rollout(env: EnvBase, actions: list[tuple[int, ...]]) -> TensorDictBase:
    """Play an episode with given actions, one tuple per step."""
    remaining = iter(actions)

    def policy(tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set(("drones", "action"), torch.tensor(next(remaining)))

    return env.rollout(len(actions), policy)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("state", [False, True])
def test_specs_contain_the_data(layout: str, masked: bool, state: bool) -> None:
    env: Any = LAYOUTS[layout](ScaledRewards(SeparateFlags(search())))
    if masked:
        env = ActionMask(env, right_of_way=True)
    env = wrapped(env, return_state=state)
    check_env_specs(env)
    keys = env.observation_spec.keys(True)
    assert (("drones", "action_mask") in keys) == masked
    assert ("state" in keys) == state


def test_observations_masks_rewards_and_states_are_the_environments() -> None:
    plain = ActionMask(FlatObservation(search()), right_of_way=True)
    inner = ActionMask(FlatObservation(search()), right_of_way=True)
    env = wrapped(inner, return_state=True)
    observations, infos = plain.reset(seed=3)
    shown = env.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(30):
        for index, drone in enumerate(plain.possible_agents):
            assert shown["drones", "observation"][index].tolist() == observations[drone].tolist()
            mask = infos[drone]["action_mask"].astype(bool)
            assert shown["drones", "action_mask"][index].tolist() == mask.tolist()
        assert shown["state"].tolist() == plain.state().tolist()
        masks = [infos[drone]["action_mask"] for drone in plain.possible_agents]
        actions = [int(rng.choice(mask.nonzero()[0])) for mask in masks]
        observations, rewards, _, _, infos = plain.step(
            dict(zip(plain.possible_agents, actions, strict=True))
        )
        stepped = env.step(shown.set(("drones", "action"), torch.tensor(actions)))
        expected = np.array(list(rewards.values()), np.float32)
        assert stepped["next", "drones", "reward"].flatten().tolist() == expected.tolist()
        shown = stepped["next"]


def test_masked_random_play_never_crashes() -> None:
    env = wrapped(ActionMask(SeparateFlags(FlatObservation(search())), right_of_way=True))
    torch.manual_seed(0)
    for _ in range(3):
        played = env.rollout(50)
        found = played["next", "drones", "info", "Found"][-1].any()
        assert bool(played["next", "terminated"][-1]) == bool(found)
        assert len(played) == 50 or found


IDLE, SEARCH, LEFT = int(Action.IDLE), int(Action.SEARCH), int(Action.LEFT)


@pytest.mark.parametrize("central", [False, True])
@pytest.mark.parametrize("separate", [False, True])
def test_only_truncated_episodes_are_bootstrapped(
    example: dict[str, Any], central: bool, separate: bool
) -> None:
    """Value targets of the last step: time limit, a drone off the grid, all found."""
    env = example["make_envs"](1, True)
    _, policy = example["make_policy"](env)
    loss = example["make_loss"](env, policy, central)

    def last_targets(env: Any, actions: list[tuple[int, ...]]) -> tuple[Any, Any, Any]:
        """Targets, rewards and values of the next observation."""
        inner = FlatObservation(ScaledRewards(SeparateFlags(env) if separate else env))
        batch = rollout(wrapped(ActionMask(inner), return_state=True), actions).unsqueeze(0)
        assert batch["next", "done"][0, -1]
        example["add_advantages"](batch, loss)
        reward, value = batch["next", "drones", "reward"], batch["next", "drones", "value"]
        assert bool((value != 0).all())
        return batch["drones", "target"][0, -1], reward[0, -1], value[0, -1]

    targets, rewards, next_values = last_targets(search(), [(IDLE, IDLE)] * 50)
    assert torch.allclose(targets, rewards + 0.99 * next_values if separate else rewards)
    targets, rewards, _ = last_targets(search(), [(IDLE, IDLE), (LEFT, IDLE)])
    assert torch.allclose(targets, rewards)
    at_once = search(vector=(0, 0), disperse_constant=0, person_initial_position=(1, 0))
    targets, rewards, _ = last_targets(at_once, [(IDLE, SEARCH)])
    assert bool(rewards[1] > 0)
    assert torch.allclose(targets, rewards)


def test_the_time_limit_terminates_the_examples_episodes(example: dict[str, Any]) -> None:
    played = rollout(example["make_env"](False), [(IDLE, IDLE)] * 50)
    assert played["next", "terminated"].flatten().tolist() == [False] * 49 + [True]


def test_the_trained_policy_respects_the_masks(example: dict[str, Any]) -> None:
    env = ActionMask(FlatObservation(search()), right_of_way=True)
    observations, infos = env.reset(seed=1, drones_positions=[(0, 4), (1, 5)])
    masks = np.stack([infos[drone]["action_mask"] for drone in env.possible_agents]).astype(bool)
    assert not masks.all()

    def network_for(action: int) -> Callable[[torch.Tensor], torch.Tensor]:
        return lambda batch: torch.eye(6)[action].repeat(len(batch), 1)

    for action in range(6):
        policy = example["TrainedPolicy"](network_for(action))
        shown = {"observation": np.stack([*observations.values()]), "action_mask": masks}
        chosen = policy(shown)
        assert masks[[0, 1], chosen].all()
        assert ((chosen == action) == masks[:, action]).all()


def test_only_central_critics_see_the_state(example: dict[str, Any]) -> None:
    env = example["make_envs"](2, True)
    shown = env.reset()
    moved = shown.clone()  # the persons
    moved["state"][:, 2] = moved["state"][:, 2].roll(1, dims=-1)
    for central in (False, True):
        network, policy = example["make_policy"](env)
        critic = example["make_loss"](env, policy, central).critic_network
        with torch.no_grad():
            values = [critic(each.clone())["drones", "value"] for each in (shown, moved)]
        assert torch.equal(*values) != central
        assert network(shown["drones", "observation"]).shape == (2, 2, 6)


@pytest.mark.slow
@pytest.mark.parametrize("critic", ["local", "central"])
def test_it_trains_resumes_and_compares(critic: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = (EXAMPLE, "--short", "--out", folder, "--critic", critic)
    check_table(python(*arguments), "torchrl-ppo", 50)
    assert check_folder(folder, "checkpoint.pt", "torchrl-ppo") == [1024, 2048]
    first = rows(folder / "curve.csv")
    before = torch.load(folder / "checkpoint.pt", weights_only=True)
    assert before["steps"] == 2048

    check_table(python(*arguments, "--resume", "--steps", 3000), "torchrl-ppo", 50)
    assert check_folder(folder, "checkpoint.pt", "torchrl-ppo") == [1024, 2048, 3072]
    assert rows(folder / "curve.csv")[:2] == first
    after = torch.load(folder / "checkpoint.pt", weights_only=True)
    assert after["steps"] == 3072
    assert any(bool((after["loss"][key] != old).any()) for key, old in before["loss"].items())
    moments = after["optimiser"]["state"][0]["step"]
    assert float(moments) == 1.5 * float(before["optimiser"]["state"][0]["step"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", ".checkpoint.*", "checkpoint.pt", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_torchrl", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()
