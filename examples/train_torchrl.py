"""Train drones with TorchRL's PPO, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[torchrl]"
    python examples/train_torchrl.py --out runs/ippo
    python examples/train_torchrl.py --out runs/mappo --critic central

All drones share one policy. Masks prevent crashes. The critic sees the drone's observation (IPPO),
or also the state, which shows the person (MAPPO). The state is used in training only.
"""

from __future__ import annotations

import warnings
from os.path import relpath

import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import RewardSum, TransformedEnv
from torchrl.modules import MLP
from torchrl.objectives import ClipPPOLoss, ValueEstimators
from training_script import begin, finish

from DroneSwarmSearch import Action, Scenario, training
from DroneSwarmSearch.adapters import TrainedPolicy
from DroneSwarmSearch.adapters.torchrl import (
    LOGITS,
    OBSERVATION,
    PPO_KEYS,
    PROBABILITY,
    STATE,
    VALUE,
    SearchEnv,
    episode_metrics,
    logits,
    masked_policy,
)
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK

warnings.filterwarnings("ignore", module="torch")  # how TorchRL uses PyTorch

# searches, and steps of each between two updates
NUM_SWARMS = 100
NUM_STEPS = 50
BATCH = NUM_SWARMS * NUM_STEPS
# both fall to 0
EPOCHS = 4
MINIBATCH_SIZE = 1000
LEARNING_RATE = 1.5e-3
ENTROPY = 0.02
LAYERS = {"num_cells": [128, 128], "activation_class": nn.Tanh}

# In the coverage mission nobody is found: a search pays the swarm the probability of success that
# it adds, which is less noisy than a find.
MISSION = {"mission": "coverage", "shared_reward": True}

# What the policy is shown, in training and evaluation.
SHOWN = {"observation": "crops", "right_of_way": True}


class WithState(nn.Module):
    """A critic's network, which also gets the state, if there is one."""

    def __init__(self) -> None:
        super().__init__()
        self.network = MLP(out_features=1, **LAYERS)

    def forward(self, seen: torch.Tensor, state: torch.Tensor | None = None) -> torch.Tensor:
        if state is not None:  # the same for every drone
            shared = state.flatten(-3).unsqueeze(-2).expand(*seen.shape[:-1], -1)
            seen = torch.cat([seen, shared], dim=-1)
        return self.network(seen)


def make_policy() -> TensorDictModule:
    """The drones' policy; the first observations determine the number of inputs."""
    network = TensorDictModule(MLP(out_features=len(Action), **LAYERS), [OBSERVATION], [LOGITS])
    return masked_policy(network)


class Trained(TrainedPolicy):
    """The saved network, for `evaluate`, `record` and `play`; it samples actions."""

    def __init__(self, scenario: Scenario, path: str) -> None:
        torch.set_num_threads(1)
        policy = make_policy()
        policy.load_state_dict(torch.load(path))
        view = View("drone", action_mask=True, bayesian_update=True, **SHOWN)
        super().__init__(logits(policy, scenario.n_drones), view=view)


def main() -> None:
    sees = "sees the drone's observation, or also the state"
    options = begin(
        "Train drones with TorchRL's PPO.",
        critic={"choices": ["local", "central"], "default": "local", "help": sees},
        steps={"type": int, "default": 400_000, "help": "environment steps in all"},
    )
    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)
    central = options.critic == "central"
    env = SearchEnv(NUM_SWARMS, state=central, **MISSION, **SHOWN, **TRAINING_TASK)
    env.set_seed(options.seed)
    policy = make_policy()
    seen = [OBSERVATION, STATE] if central else [OBSERVATION]
    critic = TensorDictModule(WithState(), seen, [VALUE])
    critic(policy(env.reset()))  # determines the numbers of inputs
    loss = ClipPPOLoss(policy, critic, entropy_coeff=ENTROPY, normalize_advantage=True)
    loss.set_keys(**PPO_KEYS)
    loss.make_value_estimator(ValueEstimators.GAE, gamma=0.99, lmbda=0.95)
    optimiser = torch.optim.Adam(loss.parameters(), lr=LEARNING_RATE, eps=1e-5)
    total = -(-options.steps // BATCH) * BATCH
    env = TransformedEnv(env, RewardSum())
    collector = Collector(env, policy, frames_per_batch=BATCH, total_frames=total)
    for number, batch in enumerate(collector):
        left = 1 - number * BATCH / total
        optimiser.param_groups[0]["lr"] = LEARNING_RATE * left
        loss.entropy_coeff.fill_(ENTROPY * left)
        with torch.no_grad():
            loss.value_estimator(
                batch,
                params=loss.critic_network_params,
                target_params=loss.target_critic_network_params,
            )
        steps = batch.reshape(-1)
        for _ in range(EPOCHS):
            for indices in torch.randperm(len(steps)).split(MINIBATCH_SIZE):
                losses = loss(steps[indices])
                optimiser.zero_grad()
                sum(value for name, value in losses.items() if name.startswith("loss_")).backward()
                nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                optimiser.step()
        metrics = episode_metrics(batch, success=PROBABILITY)
        training.log_row(options.out / "curve.csv", steps=(number + 1) * BATCH, **metrics)
        torch.save(policy.state_dict(), options.out / "policy.pt")
    collector.shutdown()
    trained = f"{relpath(__file__)}:Trained:{options.out / 'policy.pt'}"
    finish(trained, "torchrl-ppo", options)


if __name__ == "__main__":
    main()
