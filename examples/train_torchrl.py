"""Train drones with TorchRL: PPO with one policy that all drones share.

    python examples/train_torchrl.py --out runs/ippo
    python examples/train_torchrl.py --out runs/mappo --critic central

The critic judges by what its drone sees (IPPO), or by the whole state as well, in which the
person is to be seen (MAPPO): `state()` serves in training alone, and the policy that comes
of it needs no more than its observations. Needs
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
from DroneSwarmSearch.wrappers import ActionMask, FlatObservation, ScaledRewards

SCALE = 2.0**-17
"""Of the rewards: a return of -100000 becomes -0.76."""

SWARMS, LENGTH = 16, 64
"""Environments side by side, and steps of each between two updates of the policy."""

EPOCHS, MINIBATCH = 6, 256
LEARNING_RATE, DISCOUNT, LAMBDA, ENTROPY = 1e-3, 0.99, 0.95, 0.01
HIDDEN = [128, 128]

# Where TorchRL keeps what belongs to the group of drones.
OBSERVATION, MASK = ("drones", "observation"), ("drones", "action_mask")
LOGITS, ACTION, LOG_PROB = ("drones", "logits"), ("drones", "action"), ("drones", "log_prob")
REWARD, RETURN = ("drones", "reward"), ("drones", "return")
VALUE, TARGET, ADVANTAGE = ("drones", "value"), ("drones", "target"), ("drones", "advantage")

warnings.filterwarnings("ignore", "PettingZoo in TorchRL is tested using")


def make_swarm(with_state: bool) -> EnvBase:
    """An environment, its drones as one group; moves that may end in a crash are masked."""
    env: Any = DroneSwarmSearch(**training.TRAINING_TASK)
    env = FlatObservation(ScaledRewards(env, SCALE))
    env = ActionMask(env, right_of_way=True)  # in the infos, where TorchRL looks for it
    groups = {"drones": env.possible_agents}
    return PettingZooWrapper(env, group_map=groups, return_state=with_state)


class Critic(nn.Module):
    """The value of each drone's place, by its observation and, if it is given, the state."""

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


class Pilot:
    """The trained network as the evaluation wants it: flat observations in, actions out."""

    def __init__(self, network: nn.Module) -> None:
        self.network = network

    def __call__(self, seen: NDArray[np.float32]) -> NDArray[np.int64]:
        """Actions, shape (slots,), for observations of shape (slots, n)."""
        with torch.no_grad():
            logits = self.network(torch.from_numpy(seen))
        masks = training.masks_of_flat(seen, training.TRAINING_TASK)
        logits[~torch.from_numpy(masks)] = -torch.inf
        actions: NDArray[np.int64] = logits.argmax(dim=-1).numpy()
        return actions


def make_environment(swarms: int, with_state: bool) -> EnvBase:
    """Some swarms side by side, with what every drone has earned in the episode so far."""
    many = SerialEnv(swarms, partial(make_swarm, with_state))
    returns = RewardSum(in_keys=[REWARD], out_keys=[RETURN], reset_keys=["_reset"])
    return TransformedEnv(many, Compose(InitTracker(), returns))


def make_policy(env: EnvBase) -> tuple[nn.Module, ProbabilisticActor]:
    """A network from observations to logits, and what draws the actions that are allowed."""
    features = env.observation_spec[OBSERVATION].shape[-1]
    network = MLP(features, len(Action), num_cells=HIDDEN, activation_class=nn.Tanh)
    policy = ProbabilisticActor(
        TensorDictModule(network, in_keys=[OBSERVATION], out_keys=[LOGITS]),
        in_keys={"logits": LOGITS, "mask": MASK},
        out_keys=[ACTION],
        distribution_class=MaskedCategorical,
        return_log_prob=True,
        log_prob_key=LOG_PROB,
    )
    return network, policy


def make_loss(env: EnvBase, policy: ProbabilisticActor, central: bool) -> ClipPPOLoss:
    """PPO's loss, with a critic of its own, which sees the state as well if it is central."""
    inputs = env.observation_spec[OBSERVATION].shape[-1]
    if central:
        inputs += env.observation_spec["state"].shape[-3:].numel()
    critic = TensorDictModule(
        Critic(inputs),
        in_keys=[OBSERVATION, "state"] if central else [OBSERVATION],
        out_keys=[VALUE],
    )
    loss = ClipPPOLoss(policy, critic, entropy_coeff=ENTROPY)
    loss.set_keys(
        action=ACTION,
        sample_log_prob=LOG_PROB,
        reward=REWARD,
        done=("drones", "done"),
        terminated=("drones", "terminated"),
        value=VALUE,
        value_target=TARGET,
        advantage=ADVANTAGE,
    )
    loss.make_value_estimator(ValueEstimators.GAE, gamma=DISCOUNT, lmbda=LAMBDA)
    return loss


def judge(batch: TensorDictBase, loss: ClipPPOLoss) -> None:
    """Add advantages and the critic's targets to a batch of shape (swarms, steps).

    Nothing is expected to follow an episode's last step, the limit's included: drones see
    their time run out and pay for it, so that it ends the search like success or a crash.
    `SeparateFlags` would tell the limit apart, and the critic be asked what follows: each
    loss would then be counted again and again, as the start of a further one.
    """
    with torch.no_grad():
        loss.value_estimator(
            batch,
            params=loss.critic_network_params,
            target_params=loss.target_critic_network_params,
        )


def improve(batch: TensorDictBase, loss: ClipPPOLoss, optimiser: torch.optim.Optimizer) -> float:
    """Improve policy and critic by a batch that was judged; returns the last loss."""
    advantages = batch[ADVANTAGE]
    batch[ADVANTAGE] = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    steps = batch.reshape(-1)
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(steps)).split(MINIBATCH):
            losses = loss(steps[rows])
            total = losses["loss_objective"] + losses["loss_critic"] + losses["loss_entropy"]
            optimiser.zero_grad()
            total.backward()
            nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
            optimiser.step()
    return float(total.detach())


def figures(batch: TensorDictBase) -> dict[str, float]:
    """The mean return and the share found of the episodes that ended in a batch."""
    ended = batch["next"][batch["next", "done"].squeeze(-1)]
    if not len(ended):
        return {}
    return {
        "reward": float(ended[RETURN].mean()) / SCALE,
        "found": float(ended["drones", "info", "Found"].amax(dim=-1).mean()),
    }


def main() -> None:
    """Train, and compare the result with the baselines."""
    parser = training.arguments(__doc__, steps=200_000, short=2 * SWARMS * LENGTH)
    parser.add_argument(
        "--critic",
        choices=["local", "central"],
        default="local",
        help="judges by what the drone sees, or by the state as well (local)",
    )
    options = parser.parse_args()
    with training.Run(options, f"TorchRL, PPO with a {options.critic} critic") as run:
        central = options.critic == "central"
        env = make_environment(SWARMS, central)
        torch.manual_seed(options.seed)
        network, policy = make_policy(env)
        loss = make_loss(env, policy, central)
        optimiser = torch.optim.Adam(loss.parameters(), lr=LEARNING_RATE, eps=1e-5)
        if run.resuming:
            kept = torch.load(run.checkpoint, weights_only=True)
            loss.load_state_dict(kept["loss"])
            optimiser.load_state_dict(kept["optimiser"])
            run.resume_from(kept["steps"])
        env.set_seed(options.seed + run.steps_done)  # a resumed run meets other seas

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
        collector = Collector(env, policy, frames_per_batch=SWARMS * LENGTH)
        batches = iter(collector)
        while run.steps_done < run.total_steps:
            batch = next(batches)
            judge(batch, loss)
            last = improve(batch, loss, optimiser)
            steps = run.steps_done + batch.numel()
            save(steps)
            run.log(steps, **figures(batch), loss=last)
        collector.shutdown()
    training.compare_with_baselines(
        Pilot(network),
        training.TRAINING_TASK,
        episodes=options.episodes,
        name="torchrl-ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
