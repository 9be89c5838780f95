"""The BenchMARL example: its task and policy, and short runs as users run it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from trainer_examples import EXAMPLES, check_folder, check_table, interrupt, python, rows

pytest.importorskip("benchmarl")

pytestmark = pytest.mark.slow

EXAMPLE = EXAMPLES / "train_benchmarl.py"

OPTIMISER_STEPS = """
import sys, torch

for path in sys.argv[1:]:
    checkpoint = torch.load(path, weights_only=True)
    steps = [each["state"][0]["step"] for each in checkpoint["optimisers"].values()]
    print(checkpoint["state"]["total_frames"], *map(int, steps))
"""


@pytest.mark.parametrize("algorithm", ["ippo", "mappo"])
def test_it_trains_resumes_and_compares(algorithm: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = (EXAMPLE, "--short", "--out", folder, "--algorithm", algorithm)
    name = f"benchmarl-{algorithm}"
    check_table(python(*arguments), name, 50)
    [checkpoints] = folder.glob("*/checkpoints")
    relative = checkpoints.relative_to(folder)
    assert check_folder(folder, relative / "checkpoint_2048.pt", name) == [1024, 2048]
    first = rows(folder / "curve.csv")

    check_table(python(*arguments, "--resume", "--steps", 3000), name, 50)
    assert check_folder(folder, relative / "checkpoint_3072.pt", name) == [1024, 2048, 3072]
    assert rows(folder / "curve.csv")[:2] == first

    paths = [checkpoints / f"checkpoint_{steps}.pt" for steps in (1024, 2048, 3072)]
    script = tmp_path / "optimiser_steps.py"
    script.write_text(OPTIMISER_STEPS, "utf-8")
    counts = [list(map(int, line.split())) for line in python(script, *paths).splitlines()]
    per_batch = counts[0][1]
    assert counts == [[1024 * i, per_batch * i, per_batch * i] for i in (1, 2, 3)]


@pytest.mark.skipif(sys.platform == "win32", reason="sends Ctrl-C as POSIX does")
@pytest.mark.parametrize("moment", ["", "*/checkpoints/*", "curve.csv"])
def test_after_ctrl_c_it_resumes(tmp_path: Path, moment: str) -> None:
    folder = tmp_path / "run"
    interrupt("train_benchmarl", folder, moment, "--episodes", 5)
    assert (folder / "evaluation.csv").exists()


TASK = """
import runpy, sys, warnings
warnings.simplefilter("ignore")
import torch
from torchrl.envs import check_env_specs
from DroneSwarmSearch import training

example = runpy.run_path(sys.argv[1])
task = example["SearchTask"].SEARCH.get_task(training.TRAINING_TASK)
make = task.get_env_fun(num_envs=2, continuous_actions=False, seed=4, device="cpu")
envs = [make(), make()]
env = envs[0]
check_env_specs(env)
assert task.group_map(env) == {"drones": ["drone0", "drone1"]}
assert task.max_steps(env) == 50
assert task.supports_discrete_actions() and not task.supports_continuous_actions()
for spec, key, shape in (
    (task.observation_spec(env), ("drones", "observation"), (2, 105)),
    (task.action_mask_spec(env), ("drones", "action_mask"), (2, 6)),
    (task.action_spec(env), ("drones", "action"), (2,)),
    (task.state_spec(env), "state", (3, 10, 10)),
):
    assert list(spec.keys(True, True)) == [key], spec
    assert spec[key].shape == shape
infos = task.info_spec(env)["drones", "info"]
assert {name: infos[name].shape for name in infos} == {
    "Found": (2,),
    "probability_of_success": (2,),
}

idle = lambda tensordict: tensordict.set(("drones", "action"), torch.tensor([5, 5]))
states = [env.rollout(50, idle)["next", "state"] for env in envs]
assert states[0].shape == (50, 3, 10, 10)
assert not torch.equal(*states)
print("passed")
"""


def test_the_task_describes_the_environment(tmp_path: Path) -> None:
    """Its specs fit, and its environments play different episodes."""
    script = tmp_path / "task.py"
    script.write_text(TASK, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "passed"


POLICY = """
import runpy, sys, warnings
warnings.simplefilter("ignore")
import numpy as np, torch
from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation

example = runpy.run_path(sys.argv[1])
env = FlatObservation(DroneSwarmSearch(**training.TRAINING_TASK))
env = ActionMask(env, in_observation=True, right_of_way=True)
observations, infos = env.reset(seed=1, drones_positions=[(0, 4), (1, 5)])
masks = [infos[drone]["action_mask"].astype(bool).tolist() for drone in env.possible_agents]

def policy(batch):
    assert batch["drones", "observation"].shape == (3, 2, 105)
    assert batch["drones", "action_mask"].tolist() == [masks] * 3
    return batch.set(("drones", "action"), torch.tensor([[0, 1], [2, 3], [4, 5]]))

shown = [*observations.values()] * 3
batched = {key: np.stack([each[key] for each in shown]) for key in shown[0]}
actions = example["TrainedPolicy"](policy)(batched)
assert actions.tolist() == [0, 1, 2, 3, 4, 5]
print("passed")
"""


def test_the_trained_policy_gets_the_masks_of_training(tmp_path: Path) -> None:
    script = tmp_path / "policy.py"
    script.write_text(POLICY, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "passed"
