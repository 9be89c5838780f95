"""TorchRL (extra ``torchrl``): many searches as one batched environment, and masked policies.

See examples/train_torchrl.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.extras import imports_of
from DroneSwarmSearch.adapters.trained_policy import LEAST_LOGIT
from DroneSwarmSearch.core.rules import Action
from DroneSwarmSearch.vector.vector_env import DroneVectorEnv

with imports_of("torchrl"):
    import torch
    from tensordict import TensorDict, TensorDictBase
    from tensordict.nn import TensorDictModuleBase
    from torchrl.data import Binary, Bounded, Categorical, Composite, TensorSpec, Unbounded
    from torchrl.envs import EnvBase
    from torchrl.envs.utils import ExplorationType, set_exploration_type
    from torchrl.modules import MaskedCategorical, ProbabilisticActor

__all__ = [
    "ACTION",
    "ACTION_MASK",
    "ACTION_VALUE",
    "GROUP",
    "LOGITS",
    "OBSERVATION",
    "PPO_KEYS",
    "PROBABILITY",
    "RETURN",
    "REWARD",
    "SHARE_FOUND",
    "STATE",
    "SUCCESS",
    "VALUE",
    "SearchEnv",
    "episode_metrics",
    "logits",
    "masked_policy",
]

Key = str | tuple[str, ...]

GROUP = "drones"
"""The group of all drones."""

OBSERVATION = (GROUP, "observation")
ACTION_MASK = (GROUP, "action_mask")
"""What policies are shown."""

ACTION = (GROUP, "action")
REWARD = (GROUP, "reward")
"""What `SearchEnv` takes and gives."""

STATE = "state"
SUCCESS = ("info", "is_success")
PROBABILITY = ("info", "probability_of_success")
SHARE_FOUND = ("info", "share_found")
"""What critics and logs are shown."""

LOGITS = (GROUP, "logits")
VALUE = (GROUP, "value")
RETURN = (GROUP, "episode_reward")
"""What policies, critics and ``RewardSum`` write."""

ACTION_VALUE = (GROUP, "action_value")
"""What value-based policies write."""

PPO_KEYS: dict[str, Key] = {
    "action": ACTION,
    "sample_log_prob": (GROUP, "log_prob"),
    "reward": REWARD,
    "done": (GROUP, "done"),
    "terminated": (GROUP, "terminated"),
    "value": VALUE,
    "value_target": (GROUP, "value_target"),
    "advantage": (GROUP, "advantage"),
}
"""The keys for ``ClipPPOLoss.set_keys``, with a policy made by `masked_policy`."""


class SearchEnv(EnvBase):
    """Many searches as one TorchRL environment; its batch size is (num_swarms,).

    Given the same seed and actions, each swarm reproduces `DroneSwarmSearch`. The n drones of each
    swarm form the group "drones", as in TorchRL's multi-agent environments. Entries:

    - ("drones", "observation"): each drone's observation in the layout, (num_swarms, n, ...).
    - ("drones", "action_mask"): the valid actions, see `wrappers.action_masks`: bool,
      (num_swarms, n, 6). `masked_policy` and TorchRL's transform `ActionMask` obey it.
    - ("drones", "action"): see `rules.Action`: int64, (num_swarms, n).
    - ("drones", "reward"): float32, (num_swarms, n, 1).
    - "done", "terminated", "truncated": bool, (num_swarms, 1); and the same for each drone,
      ("drones", "done") and so on, (num_swarms, n, 1).
    - "state": `DroneSwarmSearch.state` of each swarm, float32, (num_swarms, 3, N, N), if
      `state` is True. It shows the persons: give it to critics, not to policies.
    - ("info", ...): "is_success", "Found", "ending" and, if there is one,
      "probability_of_success", as in the infos of `SwarmVectorEnv`; and "share_found", the share of
      the persons who have been found: (num_swarms, 1).

    TorchRL resets swarms whose episodes have ended; "_reset" selects them. `set_seed(s)` seeds
    swarm i with s + i when it is reset next, and its later episodes follow from that.

    Args:
        num_swarms: the number of swarms.
        observation: the layout: "flat", or "dict", "planes", "top-cells" or "crops".
        state: whether to write "state".
        seed: as for `set_seed`.
        device: of the tensors. The searches themselves run on the CPU.
        keywords: `shared_reward`, `top_cells`, `right_of_way`, `separate_flags`, `reward_scale`
            and the arguments of `DroneVectorEnv` from `grid_size` on.

    Attributes:
        n_drones: the drones in each swarm.
        group_map: the names of the drones in the group "drones".
        vector_env: the `DroneVectorEnv`, whose `batch` knows the whole state of all searches.
    """

    def __init__(
        self,
        num_swarms: int = 1,
        *,
        observation: str = "flat",
        state: bool = False,
        seed: int | None = None,
        device: torch.device | str = "cpu",
        **keywords: Any,
    ) -> None:
        checks.boolean("state", state)
        env = DroneVectorEnv(
            num_swarms,
            observation=observation,
            action_mask="observation",
            autoreset_mode="Disabled",
            copy=True,  # TorchRL keeps the arrays
            **keywords,
        )
        super().__init__(device=device, batch_size=[env.batch.num_rows])
        self.vector_env = env
        scenario = env.batch.scenario_of(0)
        self.n_drones = scenario.n_drones
        self.group_map = {GROUP: [f"drone{i}" for i in range(self.n_drones)]}
        self._shows_state = state
        self._set_seed(seed)
        self._make_specs()

    def _make_specs(self) -> None:
        """Make the specs of observations, actions, rewards and flags."""
        env = self.vector_env
        swarms = self.batch_size
        drones = torch.Size([*swarms, self.n_drones])
        masks = Binary(shape=(*drones, len(Action)), dtype=torch.bool)
        space = env.single_observation_space
        assert isinstance(space, spaces.Dict)
        layout = _spec(space["observation"], drones)
        self.observation_spec = self._of_group({"observation": layout, "action_mask": masks})
        self.observation_spec["info"] = self._info_spec()
        if self._shows_state:
            size = env.batch.scenario_of(0).grid_size
            shape = (*swarms, 3, size, size)
            self.observation_spec["state"] = Unbounded(shape, device=self.device)
        self.action_spec = self._of_group({"action": Categorical(len(Action), drones)})
        self.reward_spec = self._of_group({"reward": Unbounded((*drones, 1))})
        self.done_spec = Composite(
            {**_flags(swarms), GROUP: Composite(_flags(drones), shape=drones)},
            shape=swarms,
            device=self.device,
        )

    def _of_group(self, specs: dict[str, TensorSpec]) -> Composite:
        """Specs of what each drone has."""
        drones = torch.Size([*self.batch_size, self.n_drones])
        group = Composite(specs, shape=drones, device=self.device)
        return Composite({GROUP: group}, shape=self.batch_size, device=self.device)

    def _info_spec(self) -> Composite:
        """The spec of the infos, whose names it keeps."""
        shape = (*self.batch_size, 1)
        infos: dict[str, TensorSpec] = {
            "is_success": Binary(shape=shape, dtype=torch.bool),
            "Found": Binary(shape=shape, dtype=torch.bool),
            "ending": Unbounded(shape=shape, dtype=torch.int8),
        }
        if self.vector_env.batch.probability_of_success is not None:
            infos["probability_of_success"] = Bounded(0.0, 1.0, shape, dtype=torch.float64)
        self._info_names = tuple(infos)
        infos["share_found"] = Bounded(0.0, 1.0, shape, dtype=torch.float64)
        return Composite(infos, shape=self.batch_size, device=self.device)

    def _set_seed(self, seed: int | None) -> None:
        swarms = self.batch_size[0]
        first = None if seed is None else checks.integer("seed", seed, 0)
        self._seeds = [None if first is None else first + swarm for swarm in range(swarms)]

    def _reset(self, tensordict: TensorDictBase | None = None) -> TensorDictBase:
        chosen = np.ones(self.batch_size[0], np.bool_)
        if tensordict is not None and (mask := tensordict.get("_reset", None)) is not None:
            chosen = mask.cpu().numpy().reshape(-1)
        options = {"reset_mask": chosen.repeat(self.n_drones)}
        observations, self._infos = self.vector_env.reset(seed=self._seeds, options=options)
        for swarm in chosen.nonzero()[0].tolist():
            self._seeds[swarm] = None
        return self._written(observations)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        actions = tensordict.get(ACTION).cpu().numpy().reshape(-1)
        observations, rewards, terminated, truncated, self._infos = self.vector_env.step(actions)
        written = self._written(observations)
        drones = written[GROUP]
        drones["reward"] = self._by_drone(rewards.astype(np.float32))
        values = {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        for name, flags in values.items():
            drones[name] = self._by_drone(flags)
            written[name] = drones[name][:, 0].clone()
        return written

    def _written(self, observations: Any) -> TensorDict:
        """The current observations, masks, infos and states."""
        drones = TensorDict(observations, batch_size=self.vector_env.num_envs)
        drones = drones.reshape(*self.batch_size, self.n_drones)
        drones["action_mask"] = drones["action_mask"].bool()
        infos = {name: self._by_drone(self._infos[name])[:, 0].clone() for name in self._info_names}
        infos["share_found"] = self._by_drone(self._infos["persons_found"].mean(axis=1))[:, 0]
        tensors: dict[str, Any] = {
            GROUP: drones,
            "info": TensorDict(infos, batch_size=self.batch_size),
        }
        if self._shows_state:
            tensors["state"] = torch.from_numpy(self.vector_env.batch.state_planes())
        return TensorDict(tensors, batch_size=self.batch_size).to(self.device)

    def _by_drone(self, values: NDArray[Any]) -> torch.Tensor:
        """A tensor of shape (num_swarms, n_drones, 1)."""
        return torch.from_numpy(values).reshape(*self.batch_size, self.n_drones, 1)


def _flags(shape: torch.Size) -> dict[str, TensorSpec]:
    """The specs of the ends of episodes."""
    names = ("done", "terminated", "truncated")
    return {name: Binary(shape=(*shape, 1), dtype=torch.bool) for name in names}


def _spec(space: spaces.Space[Any], shape: torch.Size) -> TensorSpec:
    """The spec of a batch of observations of a space, a Box or a Dict."""
    if isinstance(space, spaces.Dict):
        return Composite({name: _spec(part, shape) for name, part in space.items()}, shape=shape)
    assert isinstance(space, spaces.Box)
    low = torch.from_numpy(space.low)
    high = torch.from_numpy(space.high)
    return Bounded(low, high, space.shape, dtype=low.dtype).expand(*shape, *space.shape)


def masked_policy(network: TensorDictModuleBase) -> ProbabilisticActor:
    """A policy that samples valid actions, and writes their log-probabilities for PPO.

    `network` reads `OBSERVATION` and writes `LOGITS`, (..., n_drones, 6).
    """
    return ProbabilisticActor(
        network,
        in_keys={"logits": LOGITS, "mask": ACTION_MASK},
        out_keys=[ACTION],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=PPO_KEYS["sample_log_prob"],
    )


def episode_metrics(batch: TensorDictBase, success: Key = SUCCESS) -> dict[str, float]:
    """The means over the episodes that end in a batch; nothing if none ends.

    Args:
        batch: from a collector, with the returns that the transform ``RewardSum`` writes.
        success: the entry whose mean is "found", next to "reward", the mean return of a drone:
            `SUCCESS`, with several persons `SHARE_FOUND`, or in the coverage mission `PROBABILITY`.
    """
    ended = batch["next"][batch["next", "done"].squeeze(-1)]
    if not len(ended):
        return {}
    return {"reward": float(ended[RETURN].mean()), "found": float(ended[success].float().mean())}


def logits(
    policy: TensorDictModuleBase,
    n_drones: int,
    hidden: Mapping[str, tuple[int, ...]] | None = None,
) -> Callable[[Mapping[str, Any]], NDArray[Any]]:
    """The network of a policy of TorchRL or BenchMARL, for `TrainedPolicy`.

    Args:
        policy: reads `OBSERVATION` and `ACTION_MASK` of swarms of `n_drones`, and writes `LOGITS`
            or `ACTION_VALUE`. With values, pass ``deterministic=True`` to `TrainedPolicy`.
        n_drones: of a swarm.
        hidden: the names of a recurrent policy's hidden states, and their shapes for each drone.
            It reads them and "is_init", and writes the next ones under "next".
    """
    return _Recurrent(policy, n_drones, hidden) if hidden else _Masked(policy, n_drones)


class _Masked:
    """The logits of a policy that acts on what it sees, see `logits`."""

    def __init__(self, policy: TensorDictModuleBase, n_drones: int) -> None:
        self._policy = policy
        self._n_drones = n_drones

    def __call__(self, observations: Mapping[str, Any]) -> NDArray[Any]:
        count = len(observations["action_mask"])
        drones = TensorDict(dict(observations), batch_size=count).reshape(-1, self._n_drones)
        drones["action_mask"] = drones["action_mask"].bool()
        batch = TensorDict({GROUP: drones}, batch_size=count // self._n_drones)
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            written = self._written(batch)
        values = written[LOGITS if LOGITS in written.keys(include_nested=True) else ACTION_VALUE]
        masked = values.masked_fill(~drones["action_mask"], LEAST_LOGIT)
        by_drone: NDArray[Any] = masked.flatten(0, 1).numpy()
        return by_drone

    def _written(self, batch: TensorDict) -> Any:
        return self._policy(batch)


class _Recurrent(_Masked):
    """The logits of a policy that carries hidden states from step to step."""

    def __init__(
        self, policy: TensorDictModuleBase, n_drones: int, hidden: Mapping[str, tuple[int, ...]]
    ) -> None:
        super().__init__(policy, n_drones)
        self._hidden = hidden
        self.reset()

    def reset(self) -> None:
        """Forget what was seen: episodes begin."""
        self._states: dict[str, torch.Tensor] = {}

    def _written(self, batch: TensorDict) -> Any:
        swarms = len(batch)
        batch["is_init"] = torch.full((swarms, 1), not self._states)
        for name, shape in self._hidden.items():
            begin = torch.zeros(swarms, self._n_drones, *shape)
            batch[GROUP, name] = self._states.get(name, begin)
        written = self._policy(batch)
        self._states = {name: written["next", GROUP, name] for name in self._hidden}
        return written
