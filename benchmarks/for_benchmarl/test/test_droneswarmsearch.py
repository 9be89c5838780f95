#  Copyright (c) Meta Platforms, Inc. and affiliates.
#
#  This source code is licensed under the license found in the
#  LICENSE file in the root directory of this source tree.
#

import pytest
from benchmarl.algorithms import IppoConfig, algorithm_config_registry
from benchmarl.algorithms.common import AlgorithmConfig
from benchmarl.environments import DroneSwarmSearchTask, Task
from benchmarl.experiment import Experiment
from utils_experiment import ExperimentUtils

pytest.importorskip("DroneSwarmSearch")


class TestDroneSwarmSearch:
    @pytest.mark.parametrize("algo_config", algorithm_config_registry.values())
    @pytest.mark.parametrize("task", [DroneSwarmSearchTask.DRIFT])
    def test_all_algos(
        self, algo_config: AlgorithmConfig, task: Task, experiment_config, mlp_sequence_config
    ):
        if not algo_config.supports_discrete_actions():
            pytest.skip()
        run(algo_config, task, experiment_config, mlp_sequence_config)

    @pytest.mark.parametrize("task", list(DroneSwarmSearchTask))
    def test_all_tasks(self, task: Task, experiment_config, mlp_sequence_config):
        run(IppoConfig, task, experiment_config, mlp_sequence_config)

    @pytest.mark.parametrize("task", [DroneSwarmSearchTask.RADIO])
    def test_reloading_trainer(self, task: Task, experiment_config, mlp_sequence_config):
        ExperimentUtils.check_experiment_loading(
            algo_config=IppoConfig.get_from_yaml(),
            model_config=mlp_sequence_config,
            experiment_config=experiment_config,
            task=task.get_from_yaml(),
        )


def run(algo_config, task, experiment_config, model_config):
    Experiment(
        algorithm_config=algo_config.get_from_yaml(),
        model_config=model_config,
        seed=0,
        config=experiment_config,
        task=task.get_from_yaml(),
    ).run()
