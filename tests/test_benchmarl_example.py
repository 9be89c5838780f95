"""The example for BenchMARL, run as users run it, and the task that it defines."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from trainer_examples import EXAMPLES, check_folder, check_table, interrupt, python, rows

pytest.importorskip("benchmarl")

pytestmark = pytest.mark.slow

EXAMPLE = EXAMPLES / "train_benchmarl.py"

MOMENTS = """
import sys, torch

for path in sys.argv[1:]:
    kept = torch.load(path, weights_only=True)
    states = [each["state"][0]["step"] for each in kept["optimisers"].values()]
    print(kept["state"]["total_frames"], *(int(step) for step in states))
"""


@pytest.mark.parametrize("algorithm", ["ippo", "mappo"])
def test_it_trains_and_goes_on(algorithm: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    usual = (EXAMPLE, "--short", "--out", folder, "--algorithm", algorithm)
    name = f"benchmarl-{algorithm}"
    check_table(python(*usual), name, 50)
    [checkpoints] = folder.glob("*/checkpoints")
    place = checkpoints.relative_to(folder)
    assert check_folder(folder, place / "checkpoint_2048.pt", name) == [1024, 2048]
    first = rows(folder / "curve.csv")

    check_table(python(*usual, "--resume", "--steps", 3000), name, 50)
    assert check_folder(folder, place / "checkpoint_3072.pt", name) == [1024, 2048, 3072]
    assert rows(folder / "curve.csv")[:2] == first

    kept = [checkpoints / f"checkpoint_{steps}.pt" for steps in (1024, 2048, 3072)]
    script = tmp_path / "moments.py"
    script.write_text(MOMENTS, "utf-8")
    seen = [list(map(int, line.split())) for line in python(script, *kept).splitlines()]
    once = seen[0][1]
    assert seen == [[1024 * i, once * i, once * i] for i in (1, 2, 3)]


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as on POSIX")
@pytest.mark.parametrize("moment", ["", "*/checkpoints/*", "curve.csv"])
def test_ctrl_c_says_what_is_there(tmp_path: Path, moment: str) -> None:
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
task = example["SearchTask"].TRAINING_TASK.get_task(training.TRAINING_TASK)
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
    (task.info_spec(env), ("drones", "info", "Found"), (2,)),
    (task.action_spec(env), ("drones", "action"), (2,)),
    (task.state_spec(env), "state", (3, 10, 10)),
):
    assert list(spec.keys(True, True)) == [key], spec
    assert spec[key].shape == shape

idle = lambda tensordict: tensordict.set(("drones", "action"), torch.tensor([5, 5]))
states = [env.rollout(50, idle)["next", "state"] for env in envs]
assert states[0].shape == (50, 3, 10, 10)
assert not torch.equal(*states)
print("as it should be")
"""


def test_the_task_says_what_the_search_is(tmp_path: Path) -> None:
    """The specs, and that swarms side by side search different seas."""
    script = tmp_path / "task.py"
    script.write_text(TASK, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "as it should be"


PILOT = """
import runpy, sys, warnings
warnings.simplefilter("ignore")
import numpy as np, torch
from DroneSwarmSearch import DroneSwarmSearch, training
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation

example = runpy.run_path(sys.argv[1])
env = ActionMask(FlatObservation(DroneSwarmSearch(**training.TRAINING_TASK)), right_of_way=True)
shown, infos = env.reset(seed=1, drones_positions=[(0, 4), (1, 5)])
masks = [infos[drone]["action_mask"].astype(bool).tolist() for drone in env.possible_agents]

def policy(swarms):
    assert swarms["drones", "observation"].shape == (3, 2, 105)
    assert swarms["drones", "action_mask"].tolist() == [masks] * 3
    return swarms.set(("drones", "action"), torch.tensor([[0, 1], [2, 3], [4, 5]]))

seen = np.stack(list(shown.values()) * 3)
assert example["Pilot"](policy)(seen).tolist() == [0, 1, 2, 3, 4, 5]
print("as it should be")
"""


def test_the_policy_is_masked_in_the_evaluation(tmp_path: Path) -> None:
    """As in training, told from the positions in what it is shown."""
    script = tmp_path / "pilot.py"
    script.write_text(PILOT, "utf-8")
    assert python(script, EXAMPLE).splitlines()[-1] == "as it should be"
