"""Train drones with TorchRL's PPO; all drones share one policy.

    python examples/train_torchrl.py --out runs/ippo
    python examples/train_torchrl.py --out runs/mappo --critic central

The critic sees the drone's observation (IPPO), or also the state, which contains the person
(MAPPO). The state is used in training only. Needs
pip install "DroneSwarmSearchEnvironment[torchrl,evaluation]".
"""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import (
    Compose,
    EnvBase,
    InitTracker,
    PettingZooWrapper,
    RewardSum,
    SerialEnv,
    TransformedEnv,
)
from torchrl.modules import MLP, MaskedCategorical, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from DroneSwarmSearch import Action, DroneSwarmSearch, training
from DroneSwarmSearch.training import TRAINING_TASK
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

REWARD_SCALE = 2.0**-17  # brings a return of 100,000 points below 1
NUM_ENVS, NUM_STEPS = 16, 64  # environments, and steps of each between two updates
EPOCHS, MINIBATCH_SIZE = 6, 256
LEARNING_RATE, GAMMA, GAE_LAMBDA, ENT_COEF = 1e-3, 0.99, 0.95, 0.01
HIDDEN = [128, 128]

# TorchRL's keys of the group "drones".
OBSERVATION, MASK = ("drones", "observation"), ("drones", "action_mask")
LOGITS, ACTION, LOGPROB = ("drones", "logits"), ("drones", "action"), ("drones", "log_prob")
REWARD, RETURN = ("drones", "reward"), ("drones", "return")
VALUE, TARGET, ADVANTAGE = ("drones", "value"), ("drones", "target"), ("drones", "advantage")

warnings.filterwarnings("ignore", "PettingZoo in TorchRL is tested using")


def make_env(with_state: bool) -> EnvBase:
    """One environment, with its drones as one group and masks against crashes.

    The time limit counts as termination, because the drones observe the remaining time and the
    rewards include a penalty for running out of it. With `SeparateFlags`, the critic would
    bootstrap over the limit, and each such penalty would count again for a further episode.
    """
    env: Any = DroneSwarmSearch(**TRAINING_TASK)
    env = FlatObservation(ScaledRewards(env, REWARD_SCALE))
    env = ActionMask(env, right_of_way=True)  # in the infos, where TorchRL expects it
    groups = {"drones": env.possible_agents}
    return PettingZooWrapper(env, group_map=groups, return_state=with_state)


def make_envs(num_envs: int, with_state: bool) -> EnvBase:
    """Several environments, with each drone's return so far."""
    envs = SerialEnv(num_envs, partial(make_env, with_state))
    returns = RewardSum(in_keys=[REWARD], out_keys=[RETURN], reset_keys=["_reset"])
    return TransformedEnv(envs, Compose(InitTracker(), returns))


def make_policy(env: EnvBase) -> tuple[nn.Module, ProbabilisticActor]:
    """The network from observations to logits, and the actor that samples allowed actions."""
    inputs = env.observation_spec[OBSERVATION].shape[-1]
    network = MLP(inputs, len(Action), num_cells=HIDDEN, activation_class=nn.Tanh)
    policy = ProbabilisticActor(
        TensorDictModule(network, in_keys=[OBSERVATION], out_keys=[LOGITS]),
        in_keys={"logits": LOGITS, "mask": MASK},
        out_keys=[ACTION],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=LOGPROB,
    )
    return network, policy


class Critic(nn.Module):
    """The value of each drone's observation and, if given, of the state."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.network = MLP(inputs, 1, num_cells=HIDDEN, activation_class=nn.Tanh)

    def forward(
        self, observations: torch.Tensor, state: torch.Tensor | None = None
    ) -> torch.Tensor:
        """Values (..., drones, 1) for observations (..., drones, n) and state (..., 3, N, N)."""
        if state is not None:
            shared = state.flatten(-3).unsqueeze(-2)
            shared = shared.expand(*observations.shape[:-1], shared.shape[-1])
            observations = torch.cat([observations, shared], dim=-1)
        values: torch.Tensor = self.network(observations)
        return values


def make_loss(env: EnvBase, policy: ProbabilisticActor, central: bool) -> ClipPPOLoss:
    """PPO's loss with its critic; a central critic also sees the state."""
    inputs = env.observation_spec[OBSERVATION].shape[-1]
    if central:
        inputs += env.observation_spec["state"].shape[-3:].numel()
    critic = TensorDictModule(
        Critic(inputs),
        in_keys=[OBSERVATION, "state"] if central else [OBSERVATION],
        out_keys=[VALUE],
    )
    loss = ClipPPOLoss(policy, critic, entropy_coeff=ENT_COEF)
    loss.set_keys(
        action=ACTION,
        sample_log_prob=LOGPROB,
        reward=REWARD,
        done=("drones", "done"),
        terminated=("drones", "terminated"),
        value=VALUE,
        value_target=TARGET,
        advantage=ADVANTAGE,
    )
    loss.make_value_estimator(ValueEstimators.GAE, gamma=GAMMA, lmbda=GAE_LAMBDA)
    return loss


def add_advantages(batch: TensorDictBase, loss: ClipPPOLoss) -> None:
    """Add advantages and value targets to a batch of shape (environments, steps)."""
    with torch.no_grad():
        loss.value_estimator(
            batch,
            params=loss.critic_network_params,
            target_params=loss.target_critic_network_params,
        )


def update(batch: TensorDictBase, loss: ClipPPOLoss, optimiser: torch.optim.Optimizer) -> float:
    """Update policy and critic; returns the last loss."""
    advantages = batch[ADVANTAGE]
    batch[ADVANTAGE] = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    steps = batch.reshape(-1)
    for _ in range(EPOCHS):
        for indices in torch.randperm(len(steps)).split(MINIBATCH_SIZE):
            losses = loss(steps[indices])
            total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
            optimiser.zero_grad()
            total.backward()
            nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
            optimiser.step()
    return float(total.detach())


def episode_statistics(batch: TensorDictBase) -> dict[str, float]:
    """The mean return and the success rate of the episodes that ended in a batch."""
    ended = batch["next"][batch["next", "done"].squeeze(-1)]
    if not len(ended):
        return {}
    return {
        "reward": float(ended[RETURN].mean()) / REWARD_SCALE,
        "found": float(ended["drones", "info", "Found"].amax(dim=-1).mean()),
    }


class TrainedPolicy:
    """The network's best allowed actions, for `evaluate`."""

    def __init__(self, network: nn.Module) -> None:
        self.network = network

    def __call__(self, observations: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Actions, shape (drones,), for flat observations with masks."""
        with torch.no_grad():
            logits = self.network(torch.from_numpy(observations["observation"]))
        logits[torch.from_numpy(observations["action_mask"] == 0)] = -torch.inf
        actions: NDArray[np.int64] = logits.argmax(dim=-1).numpy()
        return actions


def main() -> None:
    parser = training.arguments(__doc__, steps=200_000, short=2 * NUM_ENVS * NUM_STEPS)
    parser.add_argument(
        "--critic",
        choices=["local", "central"],
        default="local",
        help="sees the drone's observation, or also the state (local)",
    )
    options = parser.parse_args()
    with training.Run(options, f"TorchRL, PPO with a {options.critic} critic") as run:
        central = options.critic == "central"
        env = make_envs(NUM_ENVS, central)
        torch.manual_seed(options.seed)
        network, policy = make_policy(env)
        loss = make_loss(env, policy, central)
        optimiser = torch.optim.Adam(loss.parameters(), lr=LEARNING_RATE, eps=1e-5)
        if run.resuming:
            checkpoint = torch.load(run.checkpoint, weights_only=True)
            loss.load_state_dict(checkpoint["loss"])
            optimiser.load_state_dict(checkpoint["optimiser"])
            run.resume_from(checkpoint["steps"])
        env.set_seed(options.seed + run.steps_done)  # a resumed run plays new episodes

        def save(steps: int) -> None:
            state = {
                "steps": steps,
                "loss": loss.state_dict(),
                "optimiser": optimiser.state_dict(),
            }
            with run.saving("checkpoint.pt") as path:
                torch.save(state, path)

        if not run.resuming:
            save(0)
        collector = Collector(env, policy, frames_per_batch=NUM_ENVS * NUM_STEPS)
        batches = iter(collector)
        while run.steps_done < run.total_steps:
            batch = next(batches)
            add_advantages(batch, loss)
            last_loss = update(batch, loss, optimiser)
            steps = run.steps_done + batch.numel()
            save(steps)
            run.log(steps, **episode_statistics(batch), loss=last_loss)
        collector.shutdown()
    training.compare_with_baselines(
        TrainedPolicy(network),
        TRAINING_TASK,
        action_mask=True,
        right_of_way=True,
        episodes=options.episodes,
        name="torchrl-ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
