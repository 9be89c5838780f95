#  Copyright (c) Meta Platforms, Inc. and affiliates.
#
#  This source code is licensed under the license found in the
#  LICENSE file in the root directory of this source tree.
#

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarl.environments.common import Task, TaskClass
from benchmarl.utils import DEVICE_TYPING
from tensordict import TensorDictBase
from torchrl.data import Composite
from torchrl.envs import EnvBase


class DroneSwarmSearchClass(TaskClass):
    """The tasks of DroneSwarmSearch's benchmark; the config has keywords of its `SearchEnv`."""

    def get_env_fun(
        self,
        num_envs: int,
        continuous_actions: bool,
        seed: int | None,
        device: DEVICE_TYPING,
    ) -> Callable[[], EnvBase]:
        return self._search.get_env_fun(num_envs, continuous_actions, seed, device)

    @property
    def _search(self) -> TaskClass:
        """The same for the package's own searches."""
        try:
            from DroneSwarmSearch.adapters.benchmarl import SearchClass
            from DroneSwarmSearch.training import TASKS
        except ImportError as error:
            raise ImportError(
                "Module `DroneSwarmSearch` not found, install it using "
                "`pip install DroneSwarmSearchEnvironment`"
            ) from error
        task = TASKS[self.name.lower()]
        return SearchClass(self.name, {**task.training, **self.config})

    def supports_continuous_actions(self) -> bool:
        return False

    def supports_discrete_actions(self) -> bool:
        return True

    def has_render(self, env: EnvBase) -> bool:
        return False

    def max_steps(self, env: EnvBase) -> int:
        return self._search.max_steps(env)

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        return self._search.group_map(env)

    def action_spec(self, env: EnvBase) -> Composite:
        return self._search.action_spec(env)

    def observation_spec(self, env: EnvBase) -> Composite:
        return self._search.observation_spec(env)

    def action_mask_spec(self, env: EnvBase) -> Composite | None:
        return self._search.action_mask_spec(env)

    def info_spec(self, env: EnvBase) -> Composite | None:
        return self._search.info_spec(env)

    def state_spec(self, env: EnvBase) -> Composite | None:
        return self._search.state_spec(env)

    @staticmethod
    def env_name() -> str:
        return "droneswarmsearch"

    @staticmethod
    def log_info(batch: TensorDictBase) -> dict[str, Any]:
        from DroneSwarmSearch.adapters.benchmarl import SearchClass

        return SearchClass.log_info(batch)


class DroneSwarmSearchTask(Task):
    """Enum for the tasks of DroneSwarmSearch's benchmark."""

    DRIFT = None
    WRECK = None
    RADIO = None
    FLEET = None

    @staticmethod
    def associated_class() -> type:
        return DroneSwarmSearchClass
