"""Tianshou (extra ``tianshou``): a batch of drones, masked networks, and the success rate.

Any algorithm for a single agent with discrete actions trains one policy that all drones share;
see examples/train_tianshou.py. Q-learning policies take the masks from the observations by
themselves, actor-critic algorithms by `MaskedActor` and `MaskedCritic`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from DroneSwarmSearch._internal.arrays import Ints
from DroneSwarmSearch._internal.extras import imports_of
from DroneSwarmSearch.adapters.trained_policy import LEAST_LOGIT, listed
from DroneSwarmSearch.vector.vector_env import DroneVectorEnv

with imports_of("tianshou"):
    import torch
    from tianshou.algorithm.algorithm_base import Policy
    from tianshou.data import Batch, CollectStats
    from tianshou.env import BaseVectorEnv
    from tianshou.utils.net.discrete import DiscreteActor, DiscreteCritic
    from tianshou.utils.torch_utils import torch_train_mode

__all__ = ["DroneVenv", "MaskedActor", "MaskedCritic", "SuccessStats", "logits"]


class DroneVenv(BaseVectorEnv):
    """Adapts a `DroneVectorEnv` to Tianshou's collectors, which reset the episodes that ended.

    Observations with masks become ``Batch(obs=..., mask=...)``, as Tianshou's policies expect.
    The infos hold "is_success" and, if the environment's do, "probability_of_success".

    All drones of a swarm act in the same step, so collect steps, or a number of episodes that is
    a multiple of the number of drones.

    Args:
        env: an environment with autoreset_mode="Disabled", and masks in the observations or none.

    Raises:
        ValueError: `env` has another autoreset mode.
    """

    def __init__(self, env: DroneVectorEnv) -> None:
        # The base class's constructor would make a worker for each sub-environment.
        mode = env.metadata["autoreset_mode"]
        if mode is not AutoresetMode.DISABLED:
            raise ValueError(f"env must have autoreset_mode='Disabled', got {mode.value!r}")
        self.env = env
        self.env_num = self.wait_num = env.num_envs
        self.is_async = self.is_closed = False
        self._drones = env.batch.scenario_of(0).n_drones
        self._seed: int | None = None

    def reset(
        self, env_id: int | Sequence[int] | Ints | None = None, **keywords: Any
    ) -> tuple[Any, NDArray[Any]]:
        """Begin episodes.

        Args:
            env_id: the sub-environments to reset, all or none of each swarm; by default, all.
            keywords: `seed` (by default, once, that of the method `seed`) and `options` of
                `DroneVectorEnv.reset`.
        """
        chosen = self._indices("env_id", env_id)
        if keywords.get("seed") is None:
            keywords["seed"], self._seed = self._seed, None
        mask = np.zeros(self.env_num, np.bool_)
        mask[chosen] = True
        options = {**(keywords.pop("options", None) or {}), "reset_mask": mask}
        observations, infos = self.env.reset(options=options, **keywords)
        return _rows(observations, chosen), _infos(infos, chosen)

    def step(
        self, action: ArrayLike, id: int | Sequence[int] | Ints | None = None
    ) -> tuple[Any, NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Let drones act once.

        Args:
            action: an action for each of these drones.
            id: the drones' sub-environments, all or none of each swarm; by default, all. The
                others must be reset before they act again.
        """
        chosen = self._indices("id", id)
        left_out = np.ones(self.env_num, np.bool_)
        left_out[chosen] = False
        if left_out.any():
            self.env.reset(options={"reset_mask": left_out})  # so that they can make the step
        actions = np.zeros(self.env_num, np.int64)
        actions[chosen] = action
        observations, rewards, *flags, infos = self.env.step(actions)
        terminated, truncated = (flag[chosen] for flag in flags)
        own = _rows(observations, chosen)
        return own, rewards[chosen], terminated, truncated, _infos(infos, chosen)

    def seed(self, seed: int | list[int] | None = None) -> list[list[int] | None]:
        """Seed the next reset: the first swarm gets the seed, the others the next integers."""
        self._seed = seed[0] if isinstance(seed, list) else seed
        return [None if self._seed is None else [self._seed]] * self.env_num

    def get_env_attr(self, key: str, id: int | Sequence[int] | Ints | None = None) -> list[Any]:
        """An attribute of the environment, once for each of these sub-environments."""
        names = {name: f"single_{name}" for name in ("action_space", "observation_space")}
        return [getattr(self.env, names.get(key, key)) for _ in self._wrap_id(id)]

    def render(self, **_: Any) -> list[Any]:
        return list(self.env.render() or ())

    def close(self) -> None:
        self.env.close()
        self.is_closed = True

    def _indices(self, name: str, given: Any) -> Ints:
        """The indices of sub-environments; raises unless they make up whole swarms."""
        indices: Ints = np.asarray(self._wrap_id(given))
        swarms = np.bincount(indices // self._drones)
        if not np.isin(swarms, (0, self._drones)).all():
            raise ValueError(
                f"{name} must hold all {self._drones} drones of a swarm or none, got "
                f"{indices.tolist()}; collect a multiple of {self._drones} episodes"
            )
        return indices


def _rows(observations: Any, chosen: Ints) -> Any:
    """Some sub-environments' observations, as Tianshou expects them."""
    if not isinstance(observations, dict):
        return observations[chosen]
    if "action_mask" not in observations:
        return Batch({key: array[chosen] for key, array in observations.items()})
    inner = _rows(observations["observation"], chosen)
    return Batch(obs=inner, mask=observations["action_mask"][chosen])


def _infos(infos: dict[str, Any], chosen: Ints) -> NDArray[Any]:
    """An info for each of some sub-environments."""
    return np.array(listed(infos))[chosen]


@dataclass(kw_only=True)
class SuccessStats(CollectStats):
    """Statistics of a collection, with success; a ``collect_stats_class`` for collectors.

    Attributes:
        successes: whether each collected episode of a drone ended with success.
        probabilities: the probability of success (POS) at its end, if the infos hold it.
    """

    successes: list[bool] = field(default_factory=list)
    probabilities: list[float] = field(default_factory=list)

    def update_at_episode_done(
        self, episode_batch: Any, episode_return: float, refresh_sequence_stats: bool = False
    ) -> None:
        super().update_at_episode_done(episode_batch, episode_return, refresh_sequence_stats)
        infos = episode_batch.info
        self.successes.append(bool(infos.is_success[-1]))
        if "probability_of_success" in infos.get_keys():
            self.probabilities.append(float(infos.probability_of_success[-1]))


class MaskedActor(DiscreteActor):
    """A network with masked logits, for ``DiscreteActorPolicy``.

    It takes the `keywords` of ``DiscreteActor``; `preprocess_net` gets observations without masks.
    """

    def __init__(self, **keywords: Any) -> None:
        super().__init__(**{"action_shape": 6, **keywords, "softmax_output": False})

    def forward(
        self, obs: Any, state: Any = None, info: dict[str, Any] | None = None
    ) -> tuple[torch.Tensor, Any]:
        """The masked logits, shape (M, actions), and the hidden state."""
        values, hidden = super().forward(obs.obs, state, info)
        mask = torch.as_tensor(obs.mask, device=values.device)
        return values.masked_fill(mask == 0, LEAST_LOGIT), hidden


class MaskedCritic(DiscreteCritic):
    """A critic for observations with masks, which do not change the values."""

    def forward(
        self, obs: Any, state: Any = None, info: dict[str, Any] | None = None
    ) -> torch.Tensor:
        """The values, shape (M, 1)."""
        return super().forward(obs.obs, state, info)


def logits(policy: Policy) -> Callable[[Mapping[str, Any]], NDArray[Any]]:
    """The network of a policy trained with masks in the observations, for `TrainedPolicy`.

    The logits of Q-learning policies are their values: pass `TrainedPolicy` deterministic=True.
    """

    def masked_logits(observations: Mapping[str, Any]) -> NDArray[Any]:
        mask = observations["action_mask"]
        batch = Batch(obs=observations["observation"], mask=mask)
        with torch.no_grad(), torch_train_mode(policy, False):
            output = policy(Batch(obs=batch, info=Batch()))
        return np.where(mask, output.logits.numpy(), LEAST_LOGIT)

    return masked_logits
