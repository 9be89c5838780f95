"""BenchMARL (extra ``benchmarl``): a task on `SearchEnv`; see examples/train_benchmarl.py."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from DroneSwarmSearch._internal.extras import imports_of

with imports_of("benchmarl"):
    import torch
    from benchmarl.environments import Task, TaskClass
    from tensordict import TensorDictBase
    from torchrl.data import Composite
    from torchrl.envs import EnvBase

    from DroneSwarmSearch.adapters.torchrl import (
        GROUP,
        PROBABILITY,
        SHARE_FOUND,
        STATE,
        SUCCESS,
        SearchEnv,
        episode_metrics,
    )

__all__ = ["SearchClass", "SearchTask"]


class SearchClass(TaskClass):
    """A task with your own parameters; ``SearchTask.SEARCH.get_task(config)`` makes one.

    MAPPO's critic and QMIX's mixer see the state, which shows the persons; the policies do not.
    The logs contain "collection/success_rate" and "collection/share_found", the mean share of the
    persons found, over the episodes that end in a batch; and "collection/probability_of_success",
    their mean probability of success, if the infos hold it.

    Args:
        name: the name of the task.
        config: keywords of `SearchEnv`, except `num_swarms`, `seed` and `device`. `state` is True
            by default; with False, critics see the drones' observations.
    """

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: torch.device | str
    ) -> Callable[[], EnvBase]:
        config = {"state": True, **self.config}
        return partial(SearchEnv, num_envs, seed=seed, device=device, **config)

    def supports_continuous_actions(self) -> bool:
        return False

    def supports_discrete_actions(self) -> bool:
        return True

    def has_render(self, env: EnvBase) -> bool:
        return False

    def max_steps(self, env: EnvBase) -> int:
        return int(env.vector_env.batch.scenario_of(0).timestep_limit)

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        return dict(env.group_map)

    def action_spec(self, env: EnvBase) -> Composite:
        return env.full_action_spec_unbatched

    def observation_spec(self, env: EnvBase) -> Composite:
        return _of_drones(env, "observation")

    def action_mask_spec(self, env: EnvBase) -> Composite:
        return _of_drones(env, "action_mask")

    def info_spec(self, env: EnvBase) -> None:
        return None  # the infos are those of a swarm, not of its drones

    def state_spec(self, env: EnvBase) -> Composite | None:
        spec = env.full_observation_spec_unbatched.get(STATE, None)
        return None if spec is None else Composite({STATE: spec.clone()})

    @staticmethod
    def env_name() -> str:
        return "droneswarmsearch"

    @staticmethod
    def log_info(batch: TensorDictBase) -> dict[str, float]:
        keys = {"success_rate": SUCCESS, "share_found": SHARE_FOUND}
        if PROBABILITY in batch["next"].keys(include_nested=True):
            keys["probability_of_success"] = PROBABILITY
        metrics = {name: episode_metrics(batch, success=key) for name, key in keys.items()}
        return {f"collection/{name}": metric["found"] for name, metric in metrics.items() if metric}


def _of_drones(env: EnvBase, name: str) -> Composite:
    """One entry of the specs of the drones."""
    drones = env.full_observation_spec_unbatched[GROUP]
    return Composite({GROUP: Composite({name: drones[name].clone()}, shape=drones.shape)})


class SearchTask(Task):
    """The task; ``SearchTask.SEARCH.get_task(config)`` takes the `config` of `SearchClass`."""

    SEARCH = None

    @staticmethod
    def associated_class() -> type[SearchClass]:
        return SearchClass
