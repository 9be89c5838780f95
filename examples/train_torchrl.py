"""Train drones with TorchRL's PPO, on a batch of searches.

    pip install "DroneSwarmSearchEnvironment[torchrl]"
    python examples/train_torchrl.py --out runs/ippo
    python examples/train_torchrl.py --out runs/mappo --critic central

All drones share one policy. Masks prevent crashes. The critic sees the drone's observation (IPPO),
or also the state, which shows the person (MAPPO). The state is used in training only.
"""

from __future__ import annotations

import warnings

from DroneSwarmSearch import training

training.exit_on_interrupt(__name__)  # also during the imports below

import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import RewardSum, TransformedEnv
from torchrl.modules import MLP
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from DroneSwarmSearch import Action
from DroneSwarmSearch.adapters.torchrl import (
    LOGITS,
    OBSERVATION,
    PPO_KEYS,
    PROBABILITY,
    STATE,
    VALUE,
    SearchEnv,
    TrainedPolicy,
    WithState,
    episode_metrics,
    masked_policy,
)
from DroneSwarmSearch.evaluation import View
from DroneSwarmSearch.training import TRAINING_TASK

warnings.filterwarnings("ignore", module="torch")  # how TorchRL uses PyTorch

NUM_SWARMS, NUM_STEPS = 100, 50  # searches, and steps of each between two updates
BATCH = NUM_SWARMS * NUM_STEPS
EPOCHS, MINIBATCH_SIZE, LEARNING_RATE, ENTROPY = 4, 1000, 1.5e-3, 0.02  # both fall to 0
LAYERS = {"num_cells": [128, 128], "activation_class": nn.Tanh}

# In the coverage mission nobody is found: a search pays the swarm the probability of success that
# it adds, which is less noisy than a find.
MISSION = {"mission": "coverage", "shared_reward": True}

# What the policy is shown, in training and evaluation.
SHOWN = {"observation": "crops", "right_of_way": True}


def main() -> None:
    parser = training.arguments(__doc__, steps=400_000, short=2 * BATCH)
    sees = "sees the drone's observation, or also the state (local)"
    parser.add_argument("--critic", choices=["local", "central"], default="local", help=sees)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with training.Run(options, f"TorchRL, PPO with a {options.critic} critic") as run:
        central = options.critic == "central"
        torch.manual_seed(options.seed)
        env = SearchEnv(NUM_SWARMS, state=central, **MISSION, **SHOWN, **TRAINING_TASK)
        network = TensorDictModule(MLP(out_features=len(Action), **LAYERS), [OBSERVATION], [LOGITS])
        policy = masked_policy(network)
        seen = [OBSERVATION, STATE] if central else [OBSERVATION]
        critic = TensorDictModule(WithState(MLP(out_features=1, **LAYERS)), seen, [VALUE])
        critic(policy(env.reset()))  # determines the numbers of inputs
        loss = ClipPPOLoss(policy, critic, entropy_coeff=ENTROPY, normalize_advantage=True)
        loss.set_keys(**PPO_KEYS)
        loss.make_value_estimator(ValueEstimators.GAE, gamma=0.99, lmbda=0.95)
        optimiser = torch.optim.Adam(loss.parameters(), lr=LEARNING_RATE, eps=1e-5)
        if run.resuming:
            checkpoint = torch.load(run.checkpoint, weights_only=True)
            loss.load_state_dict(checkpoint["loss"])
            optimiser.load_state_dict(checkpoint["optimiser"])
            run.resume_from(checkpoint["steps"])
        env.set_seed(options.seed + run.steps_done)  # a resumed run plays new episodes

        def save(steps: int) -> None:
            state = {"loss": loss.state_dict(), "optimiser": optimiser.state_dict()}
            with run.saving("checkpoint.pt") as path:
                torch.save({"steps": steps, **state}, path)

        if not run.resuming:
            save(0)
        collector = Collector(TransformedEnv(env, RewardSum()), policy, frames_per_batch=BATCH)
        batches = iter(collector)
        while run.steps_done < run.total_steps:
            batch = next(batches)
            left = 1 - run.steps_done / run.total_steps
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
                    total = sum(value for name, value in losses.items() if name.startswith("loss_"))
                    optimiser.zero_grad()
                    total.backward()
                    nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
                    optimiser.step()
            save(run.steps_done + BATCH)
            run.log(run.steps_done + BATCH, **episode_metrics(batch, success=PROBABILITY))
        collector.shutdown()
    training.compare_with_baselines(
        TrainedPolicy(policy, TRAINING_TASK["n_drones"]),  # samples actions, as in training
        TRAINING_TASK,
        view=View("drone", action_mask=True, **SHOWN),
        episodes=options.episodes,
        name="torchrl-ppo",
        folder=run.folder,
    )


if __name__ == "__main__":
    main()
