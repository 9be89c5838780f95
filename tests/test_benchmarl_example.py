"""The BenchMARL task."""

import re
import shutil
from pathlib import Path

import pytest
from documents import ROOT
from trainer_examples import python

benchmarl = pytest.importorskip("benchmarl")

pytestmark = pytest.mark.slow

TASK = """
import warnings
warnings.simplefilter("ignore")
import torch
from torchrl.envs import RewardSum, TransformedEnv, check_env_specs
from DroneSwarmSearch.adapters.benchmarl import SearchTask
from DroneSwarmSearch.training import TRAINING_TASK

task = SearchTask.SEARCH.get_task({**TRAINING_TASK, "right_of_way": True})
make = task.get_env_fun(num_envs=3, continuous_actions=False, seed=4, device="cpu")
env = make()
check_env_specs(env)
assert env.batch_size == (3,)
assert task.group_map(env) == {"drones": ["drone0", "drone1"]}
assert task.max_steps(env) == 50
assert task.supports_discrete_actions() and not task.supports_continuous_actions()
assert task.info_spec(env) is None
for spec, key, shape in (
    (task.observation_spec(env), ("drones", "observation"), (2, 105)),
    (task.action_mask_spec(env), ("drones", "action_mask"), (2, 6)),
    (task.action_spec(env), ("drones", "action"), (2,)),
    (task.state_spec(env), "state", (3, 10, 10)),
):
    assert list(spec.keys(True, True)) == [key], spec
    assert spec[key].shape == shape

local = SearchTask.SEARCH.get_task({**TRAINING_TASK, "state": False})
assert local.state_spec(local.get_env_fun(2, False, 0, "cpu")()) is None

batch = TransformedEnv(make(), task.get_reward_sum_transform(env)).rollout(
    60, break_when_any_done=False
)
ended = batch["next", "done"].squeeze(-1)
assert ended.sum() >= 3
logged = {f"collection/{name}": batch["next", "info", key][ended].double().mean().item()
          for name, key in (("success_rate", "is_success"), ("share_found", "share_found"),
                            ("probability_of_success", "probability_of_success"))}
assert task.log_info(batch).keys() == logged.keys()
assert all(abs(task.log_info(batch)[name] - mean) < 1e-6 for name, mean in logged.items())
assert 0 < logged["collection/probability_of_success"] < 1
assert task.log_info(batch[:, :0]) == {}
print("passed")
"""


def test_the_task_describes_the_environment(tmp_path):
    """Its specs fit, and its logs contain the success rate."""
    script = tmp_path / "task.py"
    script.write_text(TASK, "utf-8")
    assert python(script).splitlines()[-1] == "passed"


EXPERIMENT = """
import sys
import warnings
warnings.simplefilter("ignore")
from torch import nn
from benchmarl.algorithms import IppoConfig
from benchmarl.environments import task_config_registry
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig

tasks = {name: task for name, task in task_config_registry.items() if "droneswarm" in name}
assert [*tasks] == [f"droneswarmsearch/{name}" for name in ("drift", "wreck", "radio", "fleet")]
for task in tasks.values():
    config = ExperimentConfig.get_from_yaml()
    config.max_n_frames = None
    config.max_n_iters = 1
    config.on_policy_n_envs_per_worker = 2
    config.on_policy_collected_frames_per_batch = 100
    config.on_policy_n_minibatch_iters = 1
    config.evaluation = False
    config.loggers = []
    config.create_json = False
    config.save_folder = sys.argv[1]
    layers = MlpConfig(num_cells=[8], layer_class=nn.Linear, activation_class=nn.Tanh)
    experiment = Experiment(
        task=task.get_from_yaml(),
        algorithm_config=IppoConfig.get_from_yaml(),
        model_config=layers,
        critic_model_config=layers,
        seed=0,
        config=config,
    )
    experiment.run()
print("passed")
"""


def test_the_tasks_offered_to_benchmarl_run_in_it(tmp_path):
    """In a copy of the installed package, with the files and lines that its README names."""
    offered = ROOT / "benchmarks" / "for_benchmarl"
    copy = tmp_path / "benchmarl"
    shutil.copytree(Path(benchmarl.__file__).parent, copy)
    shutil.copytree(offered / "benchmarl", copy, dirs_exist_ok=True)
    readme = (offered / "README.md").read_text("utf-8")
    [line] = re.findall(r"^from \.droneswarmsearch.*$", readme, re.MULTILINE)
    registry = copy / "environments" / "__init__.py"
    text = registry.read_text("utf-8")
    text = text.replace("\ntasks = [", f"\n{line}\n\ntasks = [DroneSwarmSearchTask, ", 1)
    registry.write_text(text, "utf-8")
    script = tmp_path / "experiment.py"
    script.write_text(EXPERIMENT, "utf-8")
    runs = tmp_path / "runs"
    runs.mkdir()
    assert python(script, runs).splitlines()[-1] == "passed"
    assert len([*runs.iterdir()]) == 4, "a folder for each task, and none elsewhere"
